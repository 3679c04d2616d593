"""Cards in the window (a title, lines and buttons), and the texts of the driving and rating screens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..view.palette import BLUE, FAINT, INK, PAPER
from .actions import Action
from .widgets import EDGE, LARGE, TEXT, wrapped, write

if TYPE_CHECKING:
    from ..collect.rating import RatingSession
    from ..collect.session import Session

Buttons = Sequence[tuple[str, Action]]
Text = tuple[str, list[str]]  # title and lines
_WIDTH, _TITLE, _LINE, _ROW, _GAP = 520, 40, 24, 38, 12  # px at scale 1
_MAX_LINES = 4  # of one wrapped text


class Card:
    """A panel in the middle of the window, or in its upper part so that the robot stays visible.

    Args:
        ui: manager of the window's widgets.
        scale: of texts and widgets.
        title: first line.
        lines: further lines; pairs of a key and its meaning are set in two columns.
        buttons: text and action of each button.
        free_height: height left free between lines and buttons, px at scale 1.
        high_up: whether the card lies in the upper part of the window.
        stacked: whether the buttons are below one another.

    Attributes:
        box: of the card, px.
        free: box left free for other widgets, px.
    """

    def __init__(
        self,
        ui: pygame_gui.UIManager,
        scale: float,
        title: str,
        lines: Sequence[str | tuple[str, str]] = (),
        buttons: Buttons = (),
        *,
        free_height: int = 0,
        high_up: bool = False,
        stacked: bool = False,
    ) -> None:
        self._title, self._pairs = title, [line for line in lines if isinstance(line, tuple)]
        window_width, window_height = ui.window_resolution
        width = 1.7 * _WIDTH if self._pairs else _WIDTH
        # The card shrinks until both its width and its height fit into the window.
        self._scale = min(scale, (window_width - 20) / width)
        texts = [line for line in lines if isinstance(line, str)]
        inner, size = self._px(width - 2 * _GAP), self._px(TEXT)
        self._lines = [line for text in texts for line in wrapped(text, inner, size, max_lines=_MAX_LINES)]
        rows = len(buttons) if stacked else min(len(buttons), 1)
        above = _GAP + _TITLE + _LINE * (len(self._lines) + (len(self._pairs) + 1) // 2)
        height = above + free_height + rows * (_ROW + _GAP) + _GAP
        self._scale = min(self._scale, (window_height - 20) / height)
        self.box = pygame.Rect(0, 0, self._px(width), self._px(height))
        self.box.center = (window_width // 2, window_height // 2)
        if high_up:
            self.box.top = round(50 * scale)
        inside = self.box.inflate(-2 * self._px(_GAP), 0)
        self.free = pygame.Rect(inside.left, self.box.top + self._px(above), inside.width, self._px(free_height))
        self._buttons = self._create_buttons(ui, buttons, stacked)

    def pressed(self, event: pygame.Event) -> Action | None:
        """Action of the button that an event reports as pressed; None for other events."""
        return self._buttons.get(event.ui_element) if event.type == pygame_gui.UI_BUTTON_PRESSED else None

    def draw(self, surface: pygame.Surface, notice: str = "") -> None:
        """Draw everything but the widgets; a notice is shown below the card."""
        if notice:
            self._draw_notice(surface, notice)
        radius = self._px(10)
        pygame.draw.rect(surface, PAPER, self.box, border_radius=radius)
        pygame.draw.rect(surface, EDGE, self.box, width=1, border_radius=radius)
        x, y = self.box.centerx, self.box.top + self._px(_GAP + _TITLE / 2)
        width = self.free.width
        write(surface, self._title, (x, y), size=self._px(LARGE), anchor="center", max_width=width)
        y += self._px((_TITLE + _LINE) / 2)
        for line in self._lines:
            write(surface, line, (x, y), size=self._px(TEXT), colour=FAINT, anchor="center", max_width=width)
            y += self._px(_LINE)
        self._draw_pairs(surface, y)

    def kill(self) -> None:
        """Remove the widgets."""
        for button in self._buttons:
            button.kill()

    def _px(self, size: float) -> int:
        return round(size * self._scale)

    def _draw_notice(self, surface: pygame.Surface, notice: str) -> None:
        size, width = self._px(TEXT), self.free.width
        lines = wrapped(notice, width, size, max_lines=_MAX_LINES)
        box = pygame.Rect(self.box.left, self.box.bottom + 6, self.box.width, self._px(_LINE * len(lines) + _GAP))
        pygame.draw.rect(surface, INK, box, border_radius=self._px(8))
        for k, line in enumerate(lines):
            y = box.top + self._px((k + 0.5) * _LINE + _GAP / 2)
            write(surface, line, (box.centerx, y), size=size, colour=PAPER, anchor="center", max_width=width)

    def _draw_pairs(self, surface: pygame.Surface, top: int) -> None:
        """Keys and their meanings, one half on the left and one on the right."""
        half, size, width = (len(self._pairs) + 1) // 2, self._px(TEXT), self.free.width
        for k, (key, meaning) in enumerate(self._pairs):
            middle = self.free.left + (k // half) * width / 2 + 0.26 * width
            y = top + (k % half) * self._px(_LINE)
            write(surface, key, (middle, y), size=size, colour=BLUE, anchor="midright", max_width=0.26 * width)
            write(surface, meaning, (middle + 10, y), size=size, colour=INK, max_width=0.23 * width)

    def _create_buttons(self, ui: pygame_gui.UIManager, buttons: Buttons, stacked: bool) -> dict[UIButton, Action]:
        """Buttons side by side, with widths by the lengths of their texts, or below one another."""
        gap, row = self._px(_GAP), self._px(_ROW)
        letters = sum(len(text) + 2 for text, _ in buttons)
        left, top, created = self.free.left, self.free.bottom + gap // 2, {}
        total = self.free.width - gap * (len(buttons) - 1)
        for text, action in buttons:
            width = self.free.width if stacked else total * (len(text) + 2) // letters
            created[UIButton(pygame.Rect(left, top, width, row), text, ui)] = action
            left, top = (left, top + row + gap) if stacked else (left + width + gap, top)
        return created


# Texts of the driving screen, by the state of the session

Light = Literal["waiting", "recording", "paused", "frozen"]
LIGHTS: dict[str, Light] = {"waiting": "waiting", "driving": "recording", "paused": "paused", "ended": "frozen"}

_DRIVE = ("W A S D, stick or drag", "drive")
_HELP = ("F1", "help")
KEYS: dict[str, tuple[tuple[str, str], ...]] = {
    "waiting": (_DRIVE, ("N", "another scene"), ("V", "camera"), ("G", "scene"), ("Z", "zones"), _HELP),
    "driving": (_DRIVE, ("Enter", "end the run"), ("P", "pause"), ("V", "camera"), ("H", "readings"), _HELP),
    "paused": (("P", "continue"), ("R", "redo"), ("N", "another scene"), _HELP),
    "ended": (("Enter", "keep"), ("Backspace", "discard"), ("R", "redo"), _HELP),
}
TYPING_KEYS = (("Enter", "keep"), ("Esc", "menu"), ("Ctrl+Q", "close"))  # while letters belong to a text

MENU = (
    ("Continue", Action.MENU),
    ("Redo this scene", Action.REDO),
    ("Another scene", Action.NEXT),
    ("Undo the last keep", Action.UNDO),
    ("Scene settings", Action.SCENE),
    ("Set up the controls", Action.REMAP),
    ("Keys and buttons", Action.HELP),
    ("Quit", Action.QUIT),
)
ENDED = (("Keep (Enter)", Action.CONFIRM), ("Discard (Backspace)", Action.DISCARD), ("Redo (R)", Action.REDO))
_OUTCOMES = {"goal": "Goal reached", "timeout": "Time is over", "contact": "Collision", "stopped": "Run ended"}


def outcome_text(session: Session) -> Text:
    """Title and lines of the card at the end of a run."""
    assert session.outcome is not None
    spec, status = session.label_spec, session.outcome.status
    question = (spec.question or spec.name) if spec.per_run else "Keep this run?"
    return _OUTCOMES.get(status, status), [f"{session.outcome.time:.1f} s driven. {question}"]


def recovered_notice(session: Session) -> str:
    """Notice about a run that continues from an earlier session."""
    assert session.recovered is not None
    notice = f"Your last run was left open after {session.recovered:.1f} s; it continues from there."
    if session.scene.name == session.config.name:
        return notice
    return f"{notice} Its scenario is {session.scene.name}; {session.config.name} starts with the next scene."


def state_notice(session: Session) -> str:
    """Notice that tells what to do while the session is paused or waiting."""
    if session.state == "paused":
        return "Paused: drive on, or press P"
    if session.state != "waiting":
        return ""
    return "Drive to the green target. The world waits for your first move."


# Texts of the rating screen, by phase

_ANSWER_KEYS = {
    "yes_no": "Y, N: answer",
    "classes": "1, 2, …: answer",
    "slider": "Left, Right: answer (with Shift: small steps)",
    "text": "type the answer",
}
_MAX_SKIPPED = 5  # names of files that are listed


def rating_start(session: RatingSession) -> Text:
    """The question, the number of runs left, and the keys."""
    spec, total = session.spec, session.total
    with_control = "      (while typing: with Ctrl)" if spec.kind == "text" else ""
    return "Rating runs", [
        spec.question or f"{spec.name}?",
        "",
        f"{total - session.done} of {total} runs are left for {session.rater}.",
        "Watch each run to its end. Then you can answer.",
        f"{_ANSWER_KEYS[spec.kind]}      Enter: save, next run",
        f"Space: pause      R: watch again      V: camera      + -: speed{with_control}",
        "You can stop at any time with Esc and continue later.",
        "",
        "Space: begin",
    ]


def rating_break(session: RatingSession) -> Text:
    """Suggestion to take a break."""
    return "Time for a break", [
        f"{session.done} of {session.total} runs are rated.",
        "Look out of the window for a while.",
        "",
        "Space: continue      Esc: stop for now",
    ]


def rating_end(session: RatingSession) -> Text:
    """The file of the ratings, and the runs that could not be shown."""
    skipped = [f"Skipped, because it cannot be read: {name}" for name in session.skipped[:_MAX_SKIPPED]]
    more = len(session.skipped) - len(skipped)
    return "Thank you!", [
        f"All {session.total} runs are rated."
        if session.done == session.total
        else f"{session.done} of {session.total} runs are rated; it is too early to repeat the others.",
        f"The ratings are in {session.path}",
        *skipped,
        *([f"and {more} more"] if more > 0 else []),
        "",
        "Enter: close",
    ]
