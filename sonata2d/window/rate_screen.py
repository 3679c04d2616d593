"""The screen for rating recorded runs: each run is watched to its end, then the question is answered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..collect.rating import RatingSession
from ..core.devices import View
from ..errors import RecordError
from ..record.record import EpisodeRecord
from ..view.palette import BLUE, FAINT, FLOOR, VERMILLION
from .answer import Answer
from .cards import rating_break, rating_end, rating_start
from .hud import draw_veil
from .playback import Exporter, Player
from .stage import Screen, Stage
from .widgets import LARGE, MINUS, PLUS, SMALL, TEXT, Timeline, button_row, draw_panel, text_size, wrapped, write

_SPEEDS = (0.25, 0.5, 1.0, 2.0)
_DELAY = 1.0  # time to read the text before a run starts, s
_BAR = 206  # height of the lower bar, px at scale 1
_MAX_LINES = 4  # of the context above the picture
_ENTER = (pygame.K_RETURN, pygame.K_KP_ENTER)

Phase = Literal["start", "watch", "break", "end"]
_CARD_BUTTONS = {"start": "Begin", "break": "Continue", "end": "Close"}
_CARDS = {"start": rating_start, "break": rating_break, "end": rating_end}


class RateScreen:
    """Shows the runs of a rating session and stores the answers.

    The screen shows neither the file nor the driver, so that names do not influence the rating and repeats are not
    recognised. Saved answers are on the disk; closing the window loses at most the answer that is not saved yet.

    Args:
        session: the runs, the question and the rater.
        view: initial view.
        context: shown with runs whose file has no context.

    Attributes:
        phase: `watch`, or the card on show: `start`, `break` or `end`.
        player: of the current run.
        answer: widgets of the answer, after the run was watched.
    """

    def __init__(self, session: RatingSession, *, view: View = "top", context: str | None = None) -> None:
        self.session, self._context = session, context or ""
        self.phase: Phase = "start"
        self.player: Player | None = None
        self.answer: Answer | None = None
        self._exporter: Exporter | None = None
        self._record: EpisodeRecord | None = None
        self._view: View = view
        self._delay = self._seconds = 0.0
        self._label: Any = None
        self._notice = ""
        self._closing = False
        self._progress = (session.done, session.total)
        if self._progress[0] == self._progress[1]:
            self.phase = "end"

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._label = self.answer.label if self.answer else None
        self._build()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._closing = True
        elif self.phase != "watch":
            if event.type == pygame.KEYDOWN:
                self._press_on_card(event.key)
        elif event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:  # the text field does not pass Enter on
            self._save()
        elif self.answer is not None and self.answer.handle(event):
            self._notice = ""
        elif not self._timeline.handle(event) and event.type == pygame.KEYDOWN:
            self._press(event)

    def advance(self, seconds: float) -> Screen | None:
        if self.phase == "watch" and self.player is not None:
            self._delay -= seconds
            if self._delay <= 0.0:
                self._seconds += seconds if self.player.playing else 0.0
                self.player.advance(seconds)
            if self.player.watched and self.answer is None:
                self._stage.ui.clear_and_reset()
                self._build()
            text = "Pause" if self.player.playing else "Play"
            if self._play_button.text != text:
                self._play_button.set_text(text)
        return None if self._closing else self

    def draw(self, surface: pygame.Surface) -> None:
        if self.phase == "watch" and self._exporter is not None:
            self._exporter.draw(surface.subsurface(self._picture))
            self._draw_question(surface)
            draw_panel(surface, self._bar, edge="top")
            self._timeline.draw(surface)
            self._draw_bar(surface)
        else:
            surface.fill(FLOOR)
            draw_veil(surface, *_CARDS[self.phase](self.session), scale=self._stage.scale)

    def leave(self) -> None:
        """Nothing needs to be saved: saved answers are on the disk."""

    # Input of the person

    def _press_on_card(self, key: int) -> None:
        if key == pygame.K_ESCAPE:
            self._close()
        elif key in _ENTER or (key == pygame.K_SPACE and self.phase != "end"):
            self._leave_card()

    def _leave_card(self) -> None:
        """Continue with the next run; close the window after the last one."""
        if self.phase == "end":
            self._close()
        else:
            self.session.take_break()
            self._next()

    def _press(self, event: pygame.Event) -> None:
        """Process a key that the answer has not used."""
        assert self.player is not None
        commands: dict[int, Callable[[], None]] = {
            pygame.K_SPACE: self._toggle,
            pygame.K_r: self._restart,
            pygame.K_v: self._switch_view,
            pygame.K_ESCAPE: self._close,
            **dict.fromkeys(PLUS, self.player.faster),
            **dict.fromkeys(MINUS, self.player.slower),
            **dict.fromkeys(_ENTER, self._save),
        }
        is_letter = self.answer is not None and self.answer.is_typing and not event.mod & pygame.KMOD_CTRL
        if event.key in commands and (not is_letter or event.key in (pygame.K_ESCAPE, pygame.K_RETURN)):
            commands[event.key]()

    def _toggle(self) -> None:
        if self.player is not None:
            self._delay = 0.0
            self.player.toggle()

    def _restart(self) -> None:
        if self.player is not None:
            self.player.restart()

    def _switch_view(self) -> None:
        if self._exporter is not None:
            self._exporter.switch_view()

    def _close(self) -> None:
        self._closing = True

    def _save(self) -> None:
        """Store the answer and continue; without an answer, tell the person what is missing."""
        label = self.answer.label if self.answer else None
        if self._record is None or self.answer is None:
            self._notice = "watch the run to its end first"
        elif label is None:
            self._notice = "answer first, then save"
        else:
            try:
                self.session.rate(self._record, label, seconds=self._seconds, whole=True)
            except RecordError as error:
                self._notice = str(error)
                return
            self._next()

    def _next(self) -> None:
        """Show the next run, a break, or the end."""
        self.answer, self._label, self._notice, self._seconds = None, None, "", 0.0
        self.phase = "break" if self.session.break_due else "watch"
        self._record = self.session.load() if self.phase == "watch" else None
        self._progress = (self.session.done, self.session.total)
        if self._record is not None:
            self.player = Player(self._record, speeds=_SPEEDS)
            self._exporter = Exporter(self.player, view=self._view, like=self._exporter)
            self._delay = _DELAY
        elif self.phase == "watch":
            self.phase = "end"
        self._stage.ui.clear_and_reset()
        self._build()

    # Widgets

    def _build(self) -> None:
        """Create the widgets of the phase for the window's size."""
        stage = self._stage
        (width, height), s = stage.size, stage.scale
        if self.phase != "watch" or self.player is None:
            row = pygame.Rect(0, height - round(70 * s), round(160 * s), round(40 * s))
            row.centerx = width // 2
            button_row(stage.ui, row, [(_CARD_BUTTONS[self.phase], self._leave_card, "")])
            return
        self._lines = self._text_lines(width - round(40 * s))
        top = round(16 * s) + sum(_pitch(size) for _, size in self._lines)
        self._bar = pygame.Rect(0, height - round(_BAR * s), width, round(_BAR * s))
        self._head = pygame.Rect(0, 0, width, top)
        self._picture = pygame.Rect(0, top, width, self._bar.top - top)
        edge, bar = round(20 * s), self._bar
        line = pygame.Rect(edge + 4, bar.top + round(10 * s), width - edge - round(170 * s), round(24 * s))
        # Contacts are not marked, because they would suggest an answer before the run is watched.
        self._timeline = Timeline(self.player, line, draggable=self.player.watched, show_contacts=False)
        row = pygame.Rect(edge, bar.bottom - round(50 * s), width - 2 * edge, round(38 * s))
        self._build_buttons(row)
        self._free = pygame.Rect(edge, bar.top + round(48 * s), width - 2 * edge, row.top - bar.top - round(60 * s))
        if self.player.watched:
            self.answer = Answer(self.session.spec, stage.ui, self._free, s, self._label)

    def _build_buttons(self, row: pygame.Rect) -> None:
        """Playback on the left, saving on the right, and space for the progress in between."""
        ui, gap = self._stage.ui, round(6 * self._stage.scale)
        specs = [
            ("Pause", self._toggle, "play or pause (Space)"),
            ("Watch again", self._restart, "from the start (R)"),
            ("Camera", self._switch_view, "whole room, or behind the robot (V)"),
        ]
        left = pygame.Rect(row.left, row.top, round(row.width * 0.36), row.height)
        self._play_button: UIButton = button_row(ui, left, specs, gap=gap)[0]
        right = pygame.Rect(0, row.top, round(row.width * 0.2), row.height)
        right.right = row.right
        (self._save_button,) = button_row(ui, right, [("Save & next", self._save, "(Enter)")])
        if self.player is not None and not self.player.watched:
            self._save_button.disable()
        self._between = pygame.Rect(left.right, row.top, right.left - left.right, row.height)

    def _text_lines(self, max_width: int) -> list[tuple[str, int]]:
        """Lines of context and question, each with its text height in px."""
        s, spec = self._stage.scale, self.session.spec
        context = (self._record.context if self._record else None) or self._context
        small, large = text_size(TEXT, s), text_size(LARGE, s)
        lines = [(line, small) for line in wrapped(context, max_width, small, max_lines=_MAX_LINES)]
        question = spec.question or f"{spec.name}?"
        return lines + [(line, large) for line in wrapped(question, max_width, large, max_lines=2)]

    # Drawing

    def _draw_question(self, surface: pygame.Surface) -> None:
        s, y = self._stage.scale, self._head.top + round(8 * self._stage.scale)
        draw_panel(surface, self._head, edge="bottom")
        for text, size in self._lines:
            write(surface, text, (round(20 * s), y + _pitch(size) / 2), size=size)
            y += _pitch(size)

    def _draw_bar(self, surface: pygame.Surface) -> None:
        """Draw the time, the answer or why there is none yet, and the progress of the session."""
        assert self.player is not None
        player, s, box = self.player, self._stage.scale, self._between
        time = f"{player.time:.1f} / {player.length:.1f} s   {player.speed:g}x"
        right = self._bar.right - round(20 * s)
        write(surface, time, (right, self._timeline.box.centery), size=text_size(SMALL, s), anchor="midright")
        size = text_size(TEXT, s)
        if self.answer is not None:
            self.answer.draw(surface)
        else:
            hint = "You can answer after the run has been watched to its end."
            write(surface, hint, self._free.center, size=size, colour=FAINT, anchor="center")
        done, total = self._progress
        text, colour = f"{done + 1} of {total}   ·   {self.session.rater}", FAINT
        if self._notice:
            text, colour = self._notice, VERMILLION
        write(surface, text, box.center, size=size, colour=colour, anchor="center", max_width=box.width - 20)
        progress = pygame.Rect(0, self._bar.bottom - 4, round(self._bar.width * done / max(total, 1)), 4)
        surface.fill(BLUE, progress)


def _pitch(size: int) -> int:
    """Distance of lines of a text height, px."""
    return round(size * 1.25)
