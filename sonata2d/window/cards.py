"""A card in the window: a title, lines, space for an answer, and buttons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..view.fonts import width_of, wrapped
from ..view.palette import BLUE, FAINT, INK, PAPER, VERMILLION, Colour
from .actions import Action
from .widgets import EDGE, LARGE, SMALL, TEXT, button_row, draw_notice, line_height, natural_width, text_size, write

Buttons = Sequence[tuple[str, Action]]
_WIDTH, _ROW, _GAP = 640, 42, 14  # px at scale 1
_MAX_ROWS = 6  # into which a line below the title is wrapped; an ellipsis replaces the rest
_SHRINK = 0.92  # factor by which a card becomes smaller until it fits into the window
_MAX_KEY_SHARE = 0.28  # of the width, for the keys of one of the two columns of pairs; longer ones wrap
_PAIR_GAP = 10  # px at scale 1, between key and meaning


class _Line(NamedTuple):
    """One drawn line of a card; its place is relative to the upper left corner of the card, px."""

    words: str
    size: int  # px
    colour: Colour
    x: float
    y: float  # of the middle
    anchor: str = "center"


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
        bottom: edge of the space for the card, px; None for the edge of the window.
        stacked: whether the buttons are below one another; they are as well if they do not fit side by side.

    Attributes:
        box: of the card, px.
        free: box left free for other widgets, px.
        scale: of the card; smaller than the scale of the window if the card would not fit.
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
            self._lines, head = self._laid_out(inner)
            free = free_height(inner, self.scale) if free_height else 0
            gap, row = self._px(_GAP), self._px(_ROW)
            widths = [natural_width(ui, words) + 2 * gap for words, _ in buttons]
            is_stacked = stacked or sum(widths) + gap * (len(buttons) - 1) > inner
            rows = [[button] for button in buttons] if is_stacked else [buttons] if buttons else []
            self.box.height = head + (free + gap if free else 0) + len(rows) * (row + gap) + gap // 2
            if self.box.height <= end - start - 10 or self.scale < 0.4:
                break
            start = 10 if self.scale < 0.8 * scale else start  # rather over the readings than unreadable
            self.scale *= _SHRINK
        self.box.center = window_width // 2, end // 2
        if top is not None:
            self.box.top = start
        self.free = pygame.Rect(self.box.left + gap, self.box.top + head, inner, free)
        place = pygame.Rect(self.free.left, self.box.bottom - gap // 2 - len(rows) * (row + gap), inner, row)
        self._buttons: dict[UIButton, Action] = {}
        for specs in rows:
            created = button_row(ui, place, [(words, None, "") for words, _ in specs], gap=gap)
            self._buttons |= zip(created, (action for _, action in specs), strict=True)
            place.top += row + gap

    def pressed(self, event: pygame.Event) -> Action | None:
        """Action of the button that an event reports as pressed; None for other events."""
        return self._buttons.get(event.ui_element) if event.type == pygame_gui.UI_BUTTON_PRESSED else None

    def draw(self, surface: pygame.Surface, notice: str = "") -> None:
        """Draw everything but the widgets; a notice is shown beside the card, not behind it."""
        radius = self._px(10)
        pygame.draw.rect(surface, PAPER, self.box, border_radius=radius)
        pygame.draw.rect(surface, EDGE, self.box, width=max(self._px(1), 1), border_radius=radius)
        for words, size, colour, x, y, anchor in self._lines:
            place = self.box.left + x, self.box.top + y
            write(surface, words, place, size=size, colour=colour, anchor=anchor)
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

    def _laid_out(self, width: int) -> tuple[list[_Line], int]:
        """The texts as lines that fit into a width, and their lower edge within the card, px."""
        above, title, lines, warning = self._texts
        parts = [(above, SMALL, FAINT), (title, LARGE, INK)]
        parts += [(line, TEXT, INK) for line in lines] + [(warning, TEXT, VERMILLION)]
        laid_out, y = [], self._px(_GAP)
        for words, points, colour in parts:
            size = text_size(points, self.scale)
            is_line = words in lines  # an empty one separates paragraphs
            for row in wrapped(words, width, size, max_lines=_MAX_ROWS if is_line else None) or [""] * is_line:
                laid_out.append(_Line(row, size, colour, self.box.width / 2, y + line_height(size) / 2))
                y += line_height(size)
        half = (len(self._pairs) + 1) // 2
        columns = [self._column(pairs, k, width, y) for k, pairs in enumerate((self._pairs[:half], self._pairs[half:]))]
        laid_out += [line for column, _ in columns for line in column]
        return laid_out, max(end for _, end in columns) + self._px(6)

    def _column(self, pairs: list[tuple[str, str]], k: int, width: int, y: int) -> tuple[list[_Line], int]:
        """The left (0) or right (1) column of keys and their meanings from y on, and its lower edge, px."""
        size, gap = text_size(TEXT, self.scale), self._px(_PAIR_GAP)
        keys = min(max((width_of(key, size) for key, _ in pairs), default=0), round(_MAX_KEY_SHARE * width))
        x, lines, pitch = self._px(_GAP) + k * width // 2 + keys, [], line_height(size)
        for key, meaning in pairs:
            rows = wrapped(key, keys, size), wrapped(meaning, width // 2 - keys - 2 * gap, size)
            for words, colour, left, anchor in ((rows[0], BLUE, x, "midright"), (rows[1], INK, x + gap, "midleft")):
                lines += [_Line(row, size, colour, left, y + (j + 0.5) * pitch, anchor) for j, row in enumerate(words)]
            y += max(len(rows[0]), len(rows[1])) * pitch
        return lines, y
