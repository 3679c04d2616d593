"""Cards in the window: a title, some lines, and buttons that stand for actions."""

from __future__ import annotations

from collections.abc import Sequence

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..view.palette import BLUE, FAINT, INK, PAPER
from .actions import Action
from .bars import EDGE, LARGE, TEXT, wrapped, write

Buttons = Sequence[tuple[str, Action]]
_WIDTH, _TITLE, _LINE, _ROW, _GAP = 520, 40, 24, 38, 12  # px at scale 1
_MOST_LINES = 4  # of one text


class Card:
    """A plate in the middle of the window, or high, so that the robot can be seen; its buttons are widgets.

    Args:
        ui: the manager of the window's widgets.
        scale: of texts and widgets.
        title: what happened.
        lines: more of it; a pair is a key and what it does, and pairs stand in two columns.
        buttons: text and action of each.
        room: px at scale 1, left `free` between lines and buttons for other widgets.
        high_up: whether it lies in the upper part of the window.
        stacked: whether the buttons stand one below the other.

    Attributes:
        box: where it lies, px.
        free: the place left free, px.
    """

    def __init__(
        self,
        ui: pygame_gui.UIManager,
        scale: float,
        title: str,
        lines: Sequence[str | tuple[str, str]] = (),
        buttons: Buttons = (),
        *,
        room: int = 0,
        high_up: bool = False,
        stacked: bool = False,
    ) -> None:
        self._title, self._pairs = title, [line for line in lines if isinstance(line, tuple)]
        width, height = ui.window_resolution
        wide = 1.7 * _WIDTH if self._pairs else _WIDTH
        self._scale = min(scale, (width - 20) / wide)
        texts = [line for line in lines if isinstance(line, str)]
        inner, size = self._px(wide - 2 * _GAP), self._px(TEXT)
        self._lines = [line for text in texts for line in wrapped(text, inner, size, most=_MOST_LINES)]
        rows = len(buttons) if stacked else min(len(buttons), 1)
        above = _GAP + _TITLE + _LINE * (len(self._lines) + (len(self._pairs) + 1) // 2)
        high = above + room + rows * (_ROW + _GAP) + _GAP
        self._scale = min(self._scale, (height - 20) / high)
        self.box = pygame.Rect(0, 0, self._px(wide), self._px(high))
        self.box.center = (width // 2, height // 2)
        if high_up:
            self.box.top = round(50 * scale)
        inside = self.box.inflate(-2 * self._px(_GAP), 0)
        self.free = pygame.Rect(inside.left, self.box.top + self._px(above), inside.width, self._px(room))
        self._buttons = self._laid(ui, buttons, stacked)

    def pressed(self, event: pygame.Event) -> Action | None:
        """The action of the button that an event is of, if it is of one."""
        return self._buttons.get(event.ui_element) if event.type == pygame_gui.UI_BUTTON_PRESSED else None

    def draw(self, surface: pygame.Surface, notice: str = "") -> None:
        """All but the widgets; a notice stands on a plate below."""
        if notice:
            self._draw_notice(surface, notice)
        round_ = self._px(10)
        pygame.draw.rect(surface, PAPER, self.box, border_radius=round_)
        pygame.draw.rect(surface, EDGE, self.box, width=1, border_radius=round_)
        x, y = self.box.centerx, self.box.top + self._px(_GAP + _TITLE / 2)
        room = self.free.width
        write(surface, self._title, (x, y), size=self._px(LARGE), anchor="center", room=room)
        y += self._px((_TITLE + _LINE) / 2)
        for line in self._lines:
            write(surface, line, (x, y), size=self._px(TEXT), colour=FAINT, anchor="center", room=room)
            y += self._px(_LINE)
        self._draw_pairs(surface, y)

    def kill(self) -> None:
        """Take its widgets away."""
        for button in self._buttons:
            button.kill()

    def _px(self, size: float) -> int:
        return round(size * self._scale)

    def _draw_notice(self, surface: pygame.Surface, notice: str) -> None:
        size, room = self._px(TEXT), self.free.width
        lines = wrapped(notice, room, size, most=_MOST_LINES)
        plate = pygame.Rect(self.box.left, self.box.bottom + 6, self.box.width, self._px(_LINE * len(lines) + _GAP))
        pygame.draw.rect(surface, INK, plate, border_radius=self._px(8))
        for k, line in enumerate(lines):
            y = plate.top + self._px((k + 0.5) * _LINE + _GAP / 2)
            write(surface, line, (plate.centerx, y), size=size, colour=PAPER, anchor="center", room=room)

    def _draw_pairs(self, surface: pygame.Surface, top: int) -> None:
        """Keys and what they do, half of them to the left and half to the right."""
        half, size = (len(self._pairs) + 1) // 2, self._px(TEXT)
        for k, (key, meaning) in enumerate(self._pairs):
            left = self.free.left + (k // half) * self.free.width / 2
            middle, y = left + 0.26 * self.free.width, top + (k % half) * self._px(_LINE)
            write(surface, key, (middle, y), size=size, colour=BLUE, anchor="midright", room=0.26 * self.free.width)
            write(surface, meaning, (middle + 10, y), size=size, colour=INK, room=0.23 * self.free.width)

    def _laid(self, ui: pygame_gui.UIManager, buttons: Buttons, stacked: bool) -> dict[UIButton, Action]:
        """The buttons, side by side or one below the other."""
        gap, row = self._px(_GAP), self._px(_ROW)
        letters = sum(len(text) + 2 for text, _ in buttons)
        left, top, laid = self.free.left, self.free.bottom + gap // 2, {}
        room = self.free.width - gap * (len(buttons) - 1)
        for text, action in buttons:
            width = self.free.width if stacked else room * (len(text) + 2) // letters
            laid[UIButton(pygame.Rect(left, top, width, row), text, ui)] = action
            left, top = (left, top + row + gap) if stacked else (left + width + gap, top)
        return laid
