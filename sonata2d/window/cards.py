"""Cards in the window (a title, lines and buttons), and the texts of the driving and rating screens."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, NamedTuple

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..collect.texts import text
from ..view.fonts import width_of, wrapped
from ..view.palette import BLUE, FAINT, INK, PAPER, VERMILLION, Colour
from .actions import Action, is_about
from .answer import Answer, question_of
from .hud import Light
from .widgets import EDGE, LARGE, SMALL, TEXT, draw_notice, line_height, natural_width, text_size, write

if TYPE_CHECKING:
    from ..collect.rating import RatingSession
    from ..collect.session import Session

Buttons = Sequence[tuple[str, Action]]
Text = tuple[str, list[str]]  # title and lines
_WIDTH, _ROW, _GAP = 640, 42, 14  # px at scale 1
_MAX_ROWS = 6  # into which a line below the title is wrapped; an ellipsis replaces the rest
_SHRINK = 0.92  # factor by which a card becomes smaller until it fits into the window
_MAX_KEY_SHARE = 0.28  # of the width, for the keys of one of the two columns of pairs; longer ones wrap
_PAIR_GAP, _COLUMN_GAP = 10, 20  # px at scale 1: between key and meaning, and between the columns of pairs
_SHORT_RUN = 2.0  # s; a shorter run may have been ended by mistake


class _Line(NamedTuple):
    """One drawn line of a card."""

    words: str
    size: int  # px
    colour: Colour


class _Column(NamedTuple):
    """Keys and their meanings below one another, as wrapped lines."""

    rows: list[tuple[list[str], list[str]]]  # lines of the key, and of its meaning
    key_width: int  # px
    meaning_width: int  # px

    @property
    def lines(self) -> int:
        """Height, in lines."""
        return sum(max(len(key), len(meaning)) for key, meaning in self.rows)


class Card:
    """A panel in the middle of the window, or in its upper part so that the robot stays visible.

    Args:
        ui: manager of the window's widgets.
        scale: of texts and widgets.
        title: headline.
        lines: further lines; pairs of a key and its meaning are set in two columns.
        buttons: text and action of each button.
        above: a small line above the title.
        warning: a line that stands out, below the others.
        free_height: height left free between lines and buttons, px, for a width in px and a scale.
        top: of the card, px; None for the middle.
        bottom: edge of the space for the card, px; None for that of the window.
        stacked: whether the buttons are below one another; they are as well if they do not fit side by side.

    Attributes:
        box: of the card, px.
        free: box left free for other widgets, px.
        scale: of the card; smaller than that of the window if the card would not fit.
    """

    def __init__(
        self,
        ui: pygame_gui.UIManager,
        scale: float,
        title: str,
        lines: Sequence[str | tuple[str, str]] = (),
        buttons: Buttons = (),
        *,
        above: str = "",
        warning: str = "",
        free_height: Callable[[int, float], int] | None = None,
        top: int | None = None,
        bottom: int | None = None,
        stacked: bool = False,
    ) -> None:
        self._texts = (above, title, [line for line in lines if isinstance(line, str)], warning)
        self._pairs = [line for line in lines if isinstance(line, tuple)]
        self.scale = scale
        window_width, end = ui.window_resolution[0], bottom or ui.window_resolution[1]
        start = top or 0
        while True:  # smaller until the height fits; the width is limited anyway
            self.box = pygame.Rect(0, 0, min(self._px(_WIDTH * (1.6 if self._pairs else 1.0)), window_width - 20), 0)
            inner = self.box.width - 2 * self._px(_GAP)
            self._lines, self._columns = self._laid_out(inner), self._columns_of_pairs(inner)
            free = free_height(inner, self.scale) if free_height else 0
            gap, row = self._px(_GAP), self._px(_ROW)
            widths = [natural_width(ui, words) + 2 * gap for words, _ in buttons]
            is_stacked = stacked or sum(widths) + gap * (len(buttons) - 1) > inner
            rows = len(buttons) if is_stacked else min(len(buttons), 1)
            head = gap + sum(line_height(line.size) for line in self._lines)
            head += max((column.lines for column in self._columns), default=0) * self._pair_pitch + self._px(6)
            self.box.height = head + (free + gap if free else 0) + rows * (row + gap) + gap // 2
            if self.box.height <= end - start - 10 or self.scale < 0.4:
                break
            start = 10 if self.scale < 0.8 * scale else start  # rather over the readings than unreadable
            self.scale *= _SHRINK
        self.box.center = window_width // 2, end // 2
        if top is not None:
            self.box.top = start
        self.free = pygame.Rect(self.box.left + gap, self.box.top + head, inner, free)
        place = pygame.Rect(self.free.left, self.box.bottom - gap // 2 - rows * (row + gap), inner, row)
        self._buttons = self._create_buttons(ui, buttons, place, widths, is_stacked)

    def pressed(self, event: pygame.Event) -> Action | None:
        """Action of the button that an event reports as pressed; None for other events."""
        return self._buttons.get(event.ui_element) if event.type == pygame_gui.UI_BUTTON_PRESSED else None

    def draw(self, surface: pygame.Surface, notice: str = "") -> None:
        """Draw everything but the widgets; a notice is shown beside the card, not behind it."""
        radius = self._px(10)
        pygame.draw.rect(surface, PAPER, self.box, border_radius=radius)
        pygame.draw.rect(surface, EDGE, self.box, width=max(self._px(1), 1), border_radius=radius)
        y: float = self.box.top + self._px(_GAP)
        for words, size, colour in self._lines:
            pitch = line_height(size)
            write(surface, words, (self.box.centerx, y + pitch / 2), size=size, colour=colour, anchor="center")
            y += pitch
        self._draw_pairs(surface, y)
        if notice:
            width, gap, size = self.box.width, self._px(6), text_size(TEXT, self.scale)
            place = self.box.centerx, self.box.bottom + gap
            draw_notice(surface, notice, place, size=size, max_width=width, otherwise_above=self.box.top - gap)

    def kill(self) -> None:
        """Remove the widgets."""
        for button in self._buttons:
            button.kill()

    def _px(self, size: float) -> int:
        return round(size * self.scale)

    @property
    def _pair_pitch(self) -> int:
        return line_height(text_size(TEXT, self.scale))

    def _laid_out(self, width: int) -> list[_Line]:
        """The texts as lines that fit into a width."""
        above, title, lines, warning = self._texts
        parts = [(above, SMALL, FAINT), (title, LARGE, INK)]
        parts += [(line, TEXT, FAINT) for line in lines] + [(warning, TEXT, VERMILLION)]
        laid_out = []
        for words, points, colour in parts:
            size = text_size(points, self.scale)
            is_line = words in lines  # an empty one separates paragraphs
            rows = wrapped(words, width, size, max_lines=_MAX_ROWS if is_line else None)
            laid_out += [_Line(row, size, colour) for row in rows or ([""] if is_line else [])]
        return laid_out

    def _columns_of_pairs(self, width: int) -> list[_Column]:
        """Keys and their meanings in two columns, wrapped where they are too wide for the card."""
        half, size = (len(self._pairs) + 1) // 2, text_size(TEXT, self.scale)
        columns = [pairs for pairs in (self._pairs[:half], self._pairs[half:]) if pairs]
        keys = [min(max(width_of(key, size) for key, _ in pairs), round(_MAX_KEY_SHARE * width)) for pairs in columns]
        meanings = [max(width_of(meaning, size) for _, meaning in pairs) for pairs in columns]
        rest = width - sum(keys) - len(columns) * self._px(_PAIR_GAP) - self._px(_COLUMN_GAP)
        if sum(meanings) > rest:  # the shorter ones keep their width, the longer ones wrap
            narrow = min(min(meanings), rest // 2)
            meanings = [narrow if meaning == min(meanings) else rest - narrow for meaning in meanings]
        return [
            _Column([(wrapped(key, a, size), wrapped(meaning, b, size)) for key, meaning in pairs], a, b)
            for pairs, a, b in zip(columns, keys, meanings, strict=True)
        ]

    def _draw_pairs(self, surface: pygame.Surface, top: float) -> None:
        """Draw the columns of keys and their meanings; space that is left is between and beside them."""
        size, gap = text_size(TEXT, self.scale), self._px(_PAIR_GAP)
        used = sum(column.key_width + gap + column.meaning_width for column in self._columns)
        space = (self.box.width - used) / (len(self._columns) + 1)
        left = self.box.left + space
        for column in self._columns:
            middle, y = left + column.key_width, top + 0.5 * self._pair_pitch
            for key, meaning in column.rows:
                for k, words in enumerate(key):
                    place = middle, y + k * self._pair_pitch
                    write(surface, words, place, size=size, colour=BLUE, anchor="midright")
                for k, words in enumerate(meaning):
                    write(surface, words, (middle + gap, y + k * self._pair_pitch), size=size, colour=INK)
                y += max(len(key), len(meaning)) * self._pair_pitch
            left = middle + gap + column.meaning_width + space

    def _create_buttons(
        self, ui: pygame_gui.UIManager, buttons: Buttons, place: pygame.Rect, widths: Sequence[int], stacked: bool
    ) -> dict[UIButton, Action]:
        """Buttons side by side, with widths by their texts, or below one another."""
        gap, created = self._px(_GAP), {}
        left, top = place.left, place.top
        rest = place.width - gap * (len(buttons) - 1) - sum(widths)
        for (words, action), natural in zip(buttons, widths, strict=True):
            width = place.width if stacked else natural + rest // len(buttons)
            created[UIButton(pygame.Rect(left, top, width, place.height), words, ui)] = action
            left, top = (left, top + place.height + gap) if stacked else (left + width + gap, top)
        return created


# Texts of the driving screen, by the state of the session

LIGHTS: dict[str, Light] = {"waiting": "waiting", "driving": "recording", "paused": "paused", "ended": "frozen"}

_DRIVE = ("keys.driving_keys", "keys.drive")
_HELP = ("F1", "keys.help")
_KEYS: dict[str, tuple[tuple[str, str], ...]] = {  # a key, or the key of its text; the key of its meaning
    "waiting": (
        _DRIVE, ("N", "keys.another_scene"), ("V", "keys.camera"), ("G", "keys.scene"), ("Z", "keys.zones"), _HELP,
    ),
    "driving": (
        _DRIVE, ("Enter", "keys.end_run"), ("P", "keys.pause"), ("V", "keys.camera"), ("H", "keys.readings"), _HELP,
    ),
    "paused": (("P", "keys.continue"), ("R", "keys.redo"), ("N", "keys.another_scene"), _HELP),
    "ended": (("Enter", "keys.keep"), ("Backspace", "keys.discard"), ("R", "keys.redo"), _HELP),
    "typing": (("Enter", "keys.keep"), ("Esc", "keys.menu"), ("Ctrl+Q", "keys.close")),  # letters belong to a text
}  # fmt: skip
_MENU = {
    "menu.continue": Action.MENU,
    "menu.redo": Action.REDO,
    "menu.next": Action.NEXT,
    "menu.undo": Action.UNDO,
    "menu.scene": Action.SCENE,
    "menu.controls": Action.REMAP,
    "menu.help": Action.HELP,
    "menu.new_person": Action.NEW_PERSON,
    "menu.quit": Action.QUIT,
}
_ENDED = {"run.keep": Action.CONFIRM, "run.discard": Action.DISCARD, "run.redo": Action.REDO}
_OUTCOMES = ("goal", "timeout", "contact", "stopped")


def keys_of(state: str, hidden: Collection[Action] = ()) -> tuple[tuple[str, str], ...]:
    """Keys and their functions in a state of the session, or while `typing`, without some actions."""
    shown = [pair for pair in _KEYS[state] if not is_about(pair[1], hidden)]
    return tuple((text(key) if key == _DRIVE[0] else key, text(meaning)) for key, meaning in shown)


def menu_buttons(hidden: Collection[Action]) -> Buttons:
    """Buttons of the menu without some actions."""
    return [(text(key), action) for key, action in _MENU.items() if action not in hidden]


def ended_card(ui: pygame_gui.UIManager, scale: float, session: Session, top: int) -> Card:
    """The card at the end of a run: the question about the run is the headline."""
    assert session.outcome is not None
    spec, status, time = session.label_spec, session.outcome.status, session.outcome.time

    def free_height(width: int, scale: float) -> int:
        return Answer.height_of(spec, width, scale) if spec.per_run else 0

    return Card(
        ui,
        scale,
        question_of(spec) if spec.per_run else text("run.keep_question"),
        buttons=[(text(key), action) for key, action in _ENDED.items()],
        above=text(f"run.{status}", time=f"{time:.1f}") if status in _OUTCOMES else status,
        warning=text("run.short", time=f"{time:.1f}") if time < _SHORT_RUN else "",
        free_height=free_height,
        top=top,
    )


def recovered_notice(session: Session) -> str:
    """Notice about a run that continues from an earlier session."""
    assert session.recovered is not None
    notice = text("notice.recovered", time=f"{session.recovered:.1f}")
    if session.scene.name == session.config.name:
        return notice
    return f"{notice} {text('notice.recovered_scenario', old=session.scene.name, new=session.config.name)}"


def state_notice(session: Session) -> str:
    """Notice that says what to do while the session is paused or waiting."""
    return text(f"notice.{session.state}") if session.state in ("paused", "waiting") else ""


# Texts of the rating screen, by phase


def rating_start(session: RatingSession) -> Text:
    """The question, the fraction of the runs that is done, and the keys.

    The number of presentations is not shown: it would reveal that some runs are shown twice.
    """
    spec = session.spec
    return question_of(spec), [
        "",
        text("rating.left_some", percent=percent_done(session)) if session.done else text("rating.left_none"),
        text("rating.watch_first"),
        text(f"rating.keys_{spec.kind}"),
        text("rating.keys_play_typing" if spec.kind == "text" else "rating.keys_play"),
        text("rating.stop"),
    ]


def rating_break(session: RatingSession) -> Text:
    """Suggestion to take a break."""
    return text("rating.break"), [
        text("rating.left_some", percent=percent_done(session)),
        text("rating.break_line"),
        "",
        text("rating.break_stop"),
    ]


def rating_end(session: RatingSession) -> Text:
    """Thanks, and how many runs could not be shown."""
    lines = [text("rating.all_done" if session.done == session.total else "rating.too_early")]
    if session.skipped:
        lines.append(text("rating.unreadable", count=len(session.skipped)))
    return text("rating.thanks"), lines


def percent_done(session: RatingSession) -> int:
    """Fraction of the presentations that are rated, in percent."""
    return 100 * session.done // max(session.total, 1)
