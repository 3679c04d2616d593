"""Recorded runs, shown to be judged: each is watched to its end, then the question is answered."""

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
from ..view.veil import draw_veil
from .answer import Answer
from .bars import LARGE, SMALL, TEXT, Entry, Timeline, button_row, plate, text_size, wrapped, write
from .player import Player
from .projector import Projector
from .rate_cards import break_card, end_card, start_card
from .stage import Screen, Stage

_SPEEDS = (0.25, 0.5, 1.0, 2.0)
_HOLD = 1.0  # s before a run begins, to take in the text
_HIGH = 206  # pixels of the bar below, at scale 1
_MOST_LINES = 4  # of the text above

Phase = Literal["start", "watch", "break", "end"]
_ON = {"start": "Begin", "break": "Go on", "end": "Close"}
_CARDS = {"start": start_card, "break": break_card, "end": end_card}


class RateScreen:
    """Shows the runs of a session and writes down what the person answers.

    Neither the file nor who drove is shown, so that nobody is judged by name and a repeat is not told from a first
    showing. Whatever was saved is on the disk; closing the window loses at most the answer that is not saved yet.

    Args:
        session: what is to be rated, and by whom.
        view: from which runs are seen at first.
        context: shown with runs whose file holds none.
    """

    def __init__(self, session: RatingSession, *, view: View = "top", context: str | None = None) -> None:
        self.session, self._context = session, context or ""
        self.phase: Phase = "start"
        self.player: Player | None = None
        self.answer: Answer | None = None
        self._projector: Projector | None = None
        self._record: EpisodeRecord | None = None
        self._view: View = view
        self._hold = self._seconds = 0.0
        self._label: Any = None
        self._notice = ""
        self._closing = False
        self._place = (session.done, session.total)
        if self._place[0] == self._place[1]:
            self.phase = "end"

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._label = self.answer.label if self.answer else None
        self._lay()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._closing = True
        elif self.phase != "watch":
            if event.type == pygame.KEYDOWN:
                self._press_on_card(event.key)
        elif event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:  # Enter, which the text field keeps to itself
            self._save()
        elif self.answer is not None and self.answer.handle(event):
            self._notice = ""
        elif not self._line.handle(event) and event.type == pygame.KEYDOWN:
            self._press(event)

    def advance(self, seconds: float) -> Screen | None:
        if self.phase == "watch" and self.player is not None:
            self._hold -= seconds
            if self._hold <= 0.0:
                self._seconds += seconds if self.player.playing else 0.0
                self.player.advance(seconds)
            if self.player.watched and self.answer is None:
                self._stage.ui.clear_and_reset()
                self._lay()
            text = "Pause" if self.player.playing else "Play"
            if self._play_button.text != text:
                self._play_button.set_text(text)
        return None if self._closing else self

    def draw(self, surface: pygame.Surface) -> None:
        if self.phase == "watch" and self._projector is not None:
            self._projector.draw(surface.subsurface(self._picture))
            self._draw_question(surface)
            plate(surface, self._bar, edge="top")
            self._line.draw(surface)
            self._draw_bar(surface)
        else:
            surface.fill(FLOOR)
            draw_veil(surface, *_CARDS[self.phase](self.session), scale=self._stage.scale)

    def leave(self) -> None:
        """All that was saved is on the disk already."""

    # --- what the person does

    def _press_on_card(self, key: int) -> None:
        if key == pygame.K_ESCAPE:
            self._close()
        elif key in (pygame.K_RETURN, pygame.K_KP_ENTER) or (key == pygame.K_SPACE and self.phase != "end"):
            self._leave_card()

    def _leave_card(self) -> None:
        """On from a card: to the next run, or away after the last one."""
        if self.phase == "end":
            self._close()
        else:
            self.session.rested()
            self._next()

    def _press(self, event: pygame.Event) -> None:
        """A key that was not for the answer."""
        assert self.player is not None
        assert self._projector is not None
        doings: dict[int, Callable[[], None]] = {
            pygame.K_SPACE: self._toggle,
            pygame.K_r: self._again,
            pygame.K_v: self._projector.switch,
            **dict.fromkeys((pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS), self.player.faster),
            **dict.fromkeys((pygame.K_MINUS, pygame.K_KP_MINUS), self.player.slower),
            **dict.fromkeys((pygame.K_RETURN, pygame.K_KP_ENTER), self._save),
            pygame.K_ESCAPE: self._close,
        }
        is_letter = self.answer is not None and self.answer.takes_letters and not event.mod & pygame.KMOD_CTRL
        if event.key in doings and (not is_letter or event.key in (pygame.K_ESCAPE, pygame.K_RETURN)):
            doings[event.key]()

    def _toggle(self) -> None:
        if self.player is not None:
            self._hold = 0.0
            self.player.toggle()

    def _again(self) -> None:
        """From the start."""
        if self.player is not None:
            self.player.restart()

    def _close(self) -> None:
        self._closing = True

    def _save(self) -> None:
        """Write the answer down and go on; without one, say what is missing."""
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
        """The next run, or a rest, or the end."""
        self.answer, self._label, self._notice, self._seconds = None, None, "", 0.0
        self.phase = "break" if self.session.break_due else "watch"
        self._record = self.session.load() if self.phase == "watch" else None
        self._place = (self.session.done, self.session.total)
        if self._record is not None:
            self.player = Player(self._record, speeds=_SPEEDS)
            self._projector = Projector(self.player, view=self._view, like=self._projector)
            self._hold = _HOLD
        elif self.phase == "watch":
            self.phase = "end"
        self._stage.ui.clear_and_reset()
        self._lay()

    # --- where things stand

    def _lay(self) -> None:
        """Widgets of the phase, for the window's size."""
        stage = self._stage
        (width, height), s = stage.size, stage.scale
        if self.phase != "watch" or self.player is None:
            row = pygame.Rect(0, height - round(70 * s), round(160 * s), round(40 * s))
            row.centerx = width // 2
            button_row(stage.ui, row, [(_ON[self.phase], self._leave_card, "")])
            return
        self._lines = self._texts(width - round(40 * s))
        top = round(16 * s) + sum(_pitch(size) for _, size in self._lines)
        self._bar = pygame.Rect(0, height - round(_HIGH * s), width, round(_HIGH * s))
        self._head = pygame.Rect(0, 0, width, top)
        self._picture = pygame.Rect(0, top, width, self._bar.top - top)
        edge, bar = round(20 * s), self._bar
        line = pygame.Rect(edge + 4, bar.top + round(10 * s), width - edge - round(170 * s), round(24 * s))
        self._line = Timeline(self.player, line, live=self.player.watched, marks=False)  # nothing is told beforehand
        row = pygame.Rect(edge, bar.bottom - round(50 * s), width - 2 * edge, round(38 * s))
        self._lay_buttons(row)
        self._free = pygame.Rect(edge, bar.top + round(48 * s), width - 2 * edge, row.top - bar.top - round(60 * s))
        if self.player.watched:
            self.answer = Answer(self.session.spec, stage.ui, self._free, s, self._label)

    def _lay_buttons(self, row: pygame.Rect) -> None:
        """Left: play; right: save. In between there is room for words."""
        ui, gap = self._stage.ui, round(6 * self._stage.scale)
        left: list[Entry] = [
            ("Pause", self._toggle, "play or pause (Space)"),
            ("See again", self._again, "from the start (R)"),
            ("Camera", self._switch, "whole room, or behind the robot (V)"),
        ]
        third = pygame.Rect(row.left, row.top, round(row.width * 0.36), row.height)
        self._play_button: UIButton = button_row(ui, third, left, gap=gap)[0]
        right = pygame.Rect(0, row.top, round(row.width * 0.2), row.height)
        right.right = row.right
        (self._save_button,) = button_row(ui, right, [("Save & next", self._save, "(Enter)")])
        if self.player is not None and not self.player.watched:
            self._save_button.disable()
        self._between = pygame.Rect(third.right, row.top, right.left - third.right, row.height)

    def _switch(self) -> None:
        if self._projector is not None:
            self._projector.switch()

    def _texts(self, room: int) -> list[tuple[str, int]]:
        """Context and question in lines, each with its size in pixels."""
        s, spec = self._stage.scale, self.session.spec
        context = (self._record.context if self._record else None) or self._context
        small, large = text_size(TEXT, s), text_size(LARGE, s)
        lines = [(line, small) for line in wrapped(context, room, small, most=_MOST_LINES)]
        asked = spec.question or f"{spec.name}?"
        return lines + [(line, large) for line in wrapped(asked, room, large, most=2)]

    # --- what is seen

    def _draw_question(self, surface: pygame.Surface) -> None:
        s, y = self._stage.scale, self._head.top + round(8 * self._stage.scale)
        plate(surface, self._head, edge="bottom")
        for text, size in self._lines:
            write(surface, text, (round(20 * s), y + _pitch(size) / 2), size=size)
            y += _pitch(size)

    def _draw_bar(self, surface: pygame.Surface) -> None:
        """Time, then the answer or why there is none yet, then how far the session is."""
        assert self.player is not None
        player, s, box = self.player, self._stage.scale, self._between
        time = f"{player.time:.1f} / {player.length:.1f} s   {player.speed:g}x"
        right = self._bar.right - round(20 * s)
        write(surface, time, (right, self._line.box.centery), size=text_size(SMALL, s), anchor="midright")
        if self.answer is not None:
            self.answer.draw(surface)
        else:
            told = "The answer opens when the run was seen to its end."
            write(surface, told, self._free.center, size=text_size(TEXT, s), colour=FAINT, anchor="center")
        done, total = self._place
        words, colour = f"{done + 1} of {total}   ·   {self.session.rater}", FAINT
        if self._notice:
            words, colour = self._notice, VERMILLION
        write(surface, words, box.center, size=text_size(TEXT, s), colour=colour, anchor="center", room=box.width - 20)
        share = pygame.Rect(0, self._bar.bottom - 4, round(self._bar.width * done / max(total, 1)), 4)
        surface.fill(BLUE, share)


def _pitch(size: int) -> int:
    """Pixels from line to line."""
    return round(size * 1.25)
