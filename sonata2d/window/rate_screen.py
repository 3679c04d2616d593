"""The screen for rating recorded runs: each run is watched to its end, then the question is answered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..collect.rating import RatingSession
from ..collect.texts import text
from ..core.devices import View
from ..errors import RecordError
from ..view.fonts import wrapped
from ..view.palette import BLUE, FAINT, FLOOR, VERMILLION
from .actions import Action
from .answer import Answer, question_of
from .cards import Card
from .playback import Player, Timeline
from .scene_camera import SceneCamera
from .stage import Screen, Stage
from .widgets import LARGE, MINUS, PLUS, SMALL, TEXT, button_row, draw_panel, line_height, text_size, write, write_lines

_SPEEDS = (0.25, 0.5, 1.0, 2.0)
_DELAY = 1.0  # time to read the text before a run starts, s
_LOWER = 116  # height of the lower bar without the answer, px at scale 1
_MAX_LINES = 4  # of the context above the picture
_PICTURE = 0.3  # fraction of the window's height that is kept for the picture, if the question permits it
_ESCAPE = 4.0  # s, within which a second Esc closes the window
_ENTER = (pygame.K_RETURN, pygame.K_KP_ENTER)

_Phase = Literal["start", "watch", "break", "end"]
_CARD_BUTTONS = {"start": "rating.begin", "break": "rating.continue", "end": "rating.close"}


class RateScreen(Screen):
    """Shows the runs of a rating session and stores the answers.

    The screen shows neither the file nor the driver, so that names do not influence the rating and repeats are not
    recognised. Saved answers are on the disk; closing the window loses at most the answer that is not saved yet.

    Args:
        session: the runs, the question and the rater.
        view: initial view.
        context: shown with runs whose file has no context.

    Attributes:
        phase: `watch`, or the card on show: `start`, `break` or `end`.
        player: of the run; defined while a run is shown.
        answer: widgets of the answer, after the run was watched.
        notice: the message on show; empty without one.
        picture: the part of the window that shows the run, px; defined while a run is shown.
        timeline: of the run; can be dragged after the run was watched.
    """

    def __init__(self, session: RatingSession, *, view: View = "top", context: str | None = None) -> None:
        self.session, self._context, self._spec = session, context or "", session.spec
        self.phase: _Phase = "start"
        self.answer: Answer | None = None
        self._camera = SceneCamera(view)
        self._delay = self._seconds = self._escape_left = 0.0
        self._label: Any = None
        self.notice = ""
        self._following: Screen | None = self
        self._percent = _percent_done(session)
        if session.done == session.total:
            self.phase = "end"

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._label = self.answer.label if self.answer else None
        self._build()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._close()
        elif self.phase != "watch":  # a card covers the window
            if event.type == pygame.KEYDOWN:
                self._press_on_card(event.key)
            elif self._card.pressed(event):
                self._leave_card()
        elif event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:  # the text field does not pass Enter on
            self._save()
        elif self.answer is not None and self.answer.handle(event):
            self.notice = ""
        elif not self.timeline.handle(event) and event.type == pygame.KEYDOWN:  # not a key of the answer
            self._press(event)

    def advance(self, seconds: float) -> Screen | None:
        self._escape_left -= seconds
        if self.phase == "watch":
            self._delay -= seconds
            if self._delay <= 0.0:
                self._seconds += seconds if self.player.playing else 0.0
                self.player.advance(seconds)
            if self.player.watched and self.answer is None:
                self._stage.ui.clear_and_reset()
                self._build()
            words = text("player.pause" if self.player.playing else "player.play")
            if self._play_button.text != words:
                self._play_button.set_text(words)
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        if self.phase == "watch":
            self._camera.draw_picture(surface.subsurface(self.picture), self.player.moment)
            self._draw_question(surface)
            draw_panel(surface, self._bar, edge="top")
            self.timeline.draw(surface)
            self._draw_bar(surface)
        else:
            surface.fill(FLOOR)
            self._card.draw(surface)

    # Input of the rater

    def _press_on_card(self, key: int) -> None:
        if key == pygame.K_ESCAPE:
            self._close()
        elif key in _ENTER or (key == pygame.K_SPACE and self.phase != "end"):
            self._leave_card()

    def _leave_card(self) -> None:
        """Continue with the next run; after the last one, close the window."""
        if self.phase == "end":
            self._close()
        else:
            self.session.take_break()
            self._next()

    def _press(self, event: pygame.Event) -> None:
        """Process a key that the answer has not used."""
        commands: dict[int, Callable[[], object]] = {
            pygame.K_SPACE: self._toggle,
            pygame.K_r: self.player.restart,
            pygame.K_v: self._switch_view,
            pygame.K_ESCAPE: self._escape,
            **dict.fromkeys(PLUS, self.player.faster),
            **dict.fromkeys(MINUS, self.player.slower),
            **dict.fromkeys(_ENTER, self._save),
        }
        is_letter = self.answer is not None and self.answer.is_typing and not event.mod & pygame.KMOD_CTRL
        if event.key in commands and (not is_letter or event.key in (pygame.K_ESCAPE, pygame.K_RETURN)):
            commands[event.key]()

    def _toggle(self) -> None:
        self._delay = 0.0
        self.player.toggle()

    def _switch_view(self) -> None:
        self._camera.apply(Action.VIEW)

    def _escape(self) -> None:
        """Close at the second press, because the key is hit easily and the answer on show would be lost."""
        if self._escape_left > 0.0:
            self._close()
        self._escape_left, self.notice = _ESCAPE, text("rating.escape_again")

    def _close(self) -> None:
        self._following = None

    def _save(self) -> None:
        """Store the answer and continue; without an answer, show what is missing."""
        if self.answer is None:
            self.notice = text("rating.watch_to_end")
        elif self.answer.label is None:
            self.notice = text("rating.answer_first")
        else:
            try:
                self.session.rate(self.player.record, self.answer.label, seconds=self._seconds, whole=True)
            except RecordError as error:  # the answer stays on show, and can be saved again
                self.notice = str(error)
            else:
                self._next()

    def _next(self) -> None:
        """Show the next run, a break, or the end."""
        self.answer, self._label, self.notice, self._seconds = None, None, "", 0.0
        self._percent = _percent_done(self.session)
        if self.session.break_due:
            self.phase = "break"
        elif (record := self.session.load()) is None:
            self.phase = "end"
        else:
            self.phase, self.player, self._delay = "watch", Player(record, speeds=_SPEEDS), _DELAY
        self._stage.ui.clear_and_reset()
        self._build()

    # Widgets

    def _build(self) -> None:
        """Create the widgets of the phase for the window's size."""
        stage = self._stage
        (width, height), s = stage.size, stage.scale
        if self.phase != "watch":
            title, lines = _CARDS[self.phase](self.session)
            self._card = Card(stage.ui, s, title, lines, [(text(_CARD_BUTTONS[self.phase]), Action.CONFIRM)])
            return
        edge = round(20 * s)
        answer = Answer.height_of(self._spec, width - 2 * edge, s)
        bar_height = round(_LOWER * s) + answer
        self._bar = pygame.Rect(0, height - bar_height, width, bar_height)
        self._lines = self._text_lines(width - 2 * edge, height - bar_height - round(_PICTURE * height))
        top = round(16 * s) + sum(line_height(size) for _, size in self._lines)
        self._head = pygame.Rect(0, 0, width, top)
        self.picture = pygame.Rect(0, top, width, self._bar.top - top)
        bar = self._bar
        line = pygame.Rect(edge + 4, bar.top + round(10 * s), width - edge - round(200 * s), round(24 * s))
        # Contacts are not marked, because they would suggest an answer before the run is watched.
        self.timeline = Timeline(self.player, line, scale=s, draggable=self.player.watched, show_contacts=False)
        row = pygame.Rect(edge, bar.bottom - round(54 * s), width - 2 * edge, round(40 * s))
        self._build_buttons(row)
        self._free = pygame.Rect(edge, bar.top + round(46 * s), width - 2 * edge, answer)
        if self.player.watched:
            self.answer = Answer(self._spec, stage.ui, self._free, s, self._label)

    def _build_buttons(self, row: pygame.Rect) -> None:
        """Playback on the left, saving on the right, and space for the progress in between."""
        ui, gap = self._stage.ui, round(6 * self._stage.scale)
        specs = [
            (text("player.pause"), self._toggle, text("player.play_tip")),
            (text("rating.again"), self.player.restart, text("rating.again_tip")),
            (text("player.camera"), self._switch_view, text("player.camera_tip")),
        ]
        left = pygame.Rect(row.left, row.top, round(row.width * 0.36), row.height)
        self._play_button: UIButton = button_row(ui, left, specs, gap=gap)[0]
        right = pygame.Rect(0, row.top, round(row.width * 0.2), row.height)
        right.right = row.right
        (self._save_button,) = button_row(ui, right, [(text("rating.save"), self._save, text("rating.save_tip"))])
        if not self.player.watched:
            self._save_button.disable()
        self._between = pygame.Rect(left.right, row.top, right.left - left.right, row.height)

    def _text_lines(self, max_width: int, max_height: int) -> list[tuple[str, int]]:
        """Lines of context and question, each with its text height in px; a small window has fewer of them."""
        s = self._stage.scale
        context = self.player.record.context or self._context
        small, large = text_size(TEXT, s), text_size(LARGE, s)
        question = [(line, large) for line in wrapped(question_of(self._spec), max_width, large)]
        used = sum(line_height(size) for _, size in question)
        count = min(max((max_height - used) // line_height(small), 0), _MAX_LINES)
        lines = wrapped(context, max_width, small, max_lines=count) if count else []
        return [(line, small) for line in lines] + question

    # Drawing

    def _draw_question(self, surface: pygame.Surface) -> None:
        s, y = self._stage.scale, self._head.top + round(8 * self._stage.scale)
        draw_panel(surface, self._head, edge="bottom")
        for words, size in self._lines:
            write(surface, words, (round(20 * s), y + line_height(size) / 2), size=size)
            y += line_height(size)

    def _draw_bar(self, surface: pygame.Surface) -> None:
        """Draw the time, the answer or the reason why it is missing, and the progress of the session."""
        player, s, box = self.player, self._stage.scale, self._between
        right = self._bar.right - round(20 * s)
        write(
            surface, player.time_text, (right, self.timeline.box.centery), size=text_size(SMALL, s), anchor="midright"
        )
        size = text_size(TEXT, s)
        if self.answer is not None:
            self.answer.draw(surface)
        else:
            hint = text("rating.wait")
            write(surface, hint, self._free.center, size=size, colour=FAINT, anchor="center")
        words, colour = text("rating.progress", percent=self._percent, rater=self.session.rater), FAINT
        if self.notice:
            words, colour = self.notice, VERMILLION
        write_lines(surface, wrapped(words, box.width - 20, size, max_lines=2), box.center, size=size, colour=colour)
        thickness = max(round(4 * s), 1)
        progress = pygame.Rect(0, self._bar.bottom - thickness, self._bar.width * self._percent // 100, thickness)
        surface.fill(BLUE, progress)


def rating_start(session: RatingSession) -> tuple[str, list[str]]:
    """The question, the fraction of the runs that is done, and the keys.

    The number of presentations is not shown: it would reveal that some runs are shown twice.
    """
    spec = session.spec
    return question_of(spec), [
        "",
        text("rating.left_some", percent=_percent_done(session)) if session.done else text("rating.left_none"),
        text("rating.watch_first"),
        text(f"rating.keys_{spec.kind}"),
        text("rating.keys_play_typing" if spec.kind == "text" else "rating.keys_play"),
        text("rating.stop"),
    ]


def _rating_break(session: RatingSession) -> tuple[str, list[str]]:
    """Suggestion to take a break."""
    return text("rating.break"), [
        text("rating.left_some", percent=_percent_done(session)),
        text("rating.break_line"),
        "",
        text("rating.break_stop"),
    ]


def rating_end(session: RatingSession) -> tuple[str, list[str]]:
    """Thanks, and how many runs could not be shown."""
    lines = [text("rating.all_done" if session.done == session.total else "rating.too_early")]
    if session.skipped:
        lines.append(text("rating.unreadable", count=len(session.skipped)))
    return text("rating.thanks"), lines


def _percent_done(session: RatingSession) -> int:
    """Fraction of the presentations that are rated, in percent."""
    return 100 * session.done // max(session.total, 1)


_CARDS = {"start": rating_start, "break": _rating_break, "end": rating_end}
