"""Parts of the screens: lines of text, rows of buttons, a timeline to drag, and a slider without a default."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..view.fonts import rendered, shortened, width_of
from ..view.palette import BLUE, FAINT, GRID, INK, PAPER, VERMILLION, Colour

if TYPE_CHECKING:
    from .playback import Player

PANEL: Colour = (250, 249, 246)
EDGE: Colour = (214, 212, 206)
TEXT, SMALL, LARGE = 20, 18, 28  # heights of texts, px at scale 1
PLUS = (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS)
MINUS = (pygame.K_MINUS, pygame.K_KP_MINUS)
_BUTTON_PADDING = 8  # px, left and right of a button's text together
_MIN_TEXT = 17  # px; smaller text is hard to read
ButtonSpec = tuple[str, Callable[[], object], str]  # text, command, tool tip (may be empty)


def text_size(size: int, scale: float) -> int:
    """Text height for a window scale, px; at least 17 px, so that text stays readable in small windows."""
    return max(round(size * scale), _MIN_TEXT)


def draw_panel(surface: pygame.Surface, box: pygame.Rect, *, edge: str) -> None:
    """Draw a plain background for texts and widgets, with a line along its `top` or `bottom` edge."""
    surface.fill(PANEL, box)
    y = box.top if edge == "top" else box.bottom - 1
    pygame.draw.line(surface, EDGE, (box.left, y), (box.right - 1, y))


def write(
    surface: pygame.Surface,
    text: str,
    position: tuple[float, float],
    *,
    size: int,
    colour: Colour = INK,
    anchor: str = "midleft",
    max_width: float = 1e4,
) -> pygame.Rect:
    """Draw one line of text, shortened to `max_width` px.

    Args:
        surface: target.
        text: the line.
        position: of the anchor, px.
        size: text height, px.
        colour: RGB.
        anchor: attribute of `pygame.Rect` that lies at `position`.
        max_width: px.

    Returns:
        The box of the drawn text, px.
    """
    line = rendered(shortened(text, max_width, size), size, colour)
    box = line.get_rect(**{anchor: (round(position[0]), round(position[1]))})
    surface.blit(line, box)
    return box


def wrapped(text: str, max_width: float, size: int, *, max_lines: int) -> list[str]:
    """Break a text into at most `max_lines` lines of at most `max_width` px; an ellipsis replaces the excess."""
    lines = [""]
    words = text.split()
    for k, word in enumerate(words):
        longer = f"{lines[-1]} {word}".strip()
        if width_of(longer, size) <= max_width or not lines[-1]:
            lines[-1] = longer
        elif len(lines) < max_lines:
            lines.append(word)
        else:
            lines[-1] = shortened(" ".join([lines[-1], *words[k:]]), max_width, size)
            break
    return [shortened(line, max_width, size) for line in lines if line]


def button_row(
    ui: pygame_gui.UIManager, box: pygame.Rect, specs: Sequence[ButtonSpec], *, gap: int = 6, equal: bool = False
) -> list[UIButton]:
    """Create buttons side by side that fill a box.

    Args:
        ui: manager of the window's widgets.
        box: px.
        specs: text, command and tool tip of each button.
        gap: between buttons, px.
        equal: whether all buttons have the same width; otherwise the width follows the text.
    """
    font = ui.get_theme().get_font(["button"])
    texts = [0 if equal else font.size(text)[0] for text, _, _ in specs]
    rest = (box.width - gap * (len(specs) - 1) - sum(texts)) / len(specs)
    if rest < _BUTTON_PADDING:  # too narrow for all texts: equal widths, and the longest texts are cut
        texts, rest = [0] * len(specs), (box.width - gap * (len(specs) - 1)) / len(specs)
    buttons, left = [], float(box.left)
    for (text, command, tip), width in zip(specs, texts, strict=True):
        place = pygame.Rect(round(left), box.top, round(width + rest), box.height)
        text = fitted(ui, text, place.width - _BUTTON_PADDING)
        buttons.append(UIButton(place, text, ui, command=command, tool_tip_text=tip or None))
        left += width + rest + gap
    return buttons


def fitted(ui: pygame_gui.UIManager, text: str, max_width: float) -> str:
    """Shorten a text of a button or label to `max_width` px of the theme's font."""
    font = ui.get_theme().get_font(["button"])
    if font.size(text)[0] <= max_width:
        return text
    while text and font.size(f"{text}…")[0] > max_width:
        text = text[:-1]
    return f"{text.rstrip()}…"


class _Drag:
    """Mouse drag along a horizontal track.

    Args:
        track: px.
        hit_box: a press in here starts the drag, px.
        on_move: receives the position along the track, 0 to 1.
    """

    def __init__(self, track: pygame.Rect, hit_box: pygame.Rect, on_move: Callable[[float], None]) -> None:
        self._track, self._hit_box, self._on_move = track, hit_box, on_move
        self._active = False

    def handle(self, event: pygame.Event) -> bool:
        """Process an event; returns True if it belongs to the drag."""
        if event.type == pygame.MOUSEBUTTONDOWN and event.button == 1 and self._hit_box.collidepoint(event.pos):
            self._active = True
        elif event.type == pygame.MOUSEBUTTONUP and self._active:
            self._active = False
            return True
        elif event.type != pygame.MOUSEMOTION or not self._active:
            return False
        self._on_move(min(max((event.pos[0] - self._track.left) / self._track.width, 0.0), 1.0))
        return True


class Timeline:
    """Progress bar of a played run, which can be dragged.

    Args:
        player: of the run.
        box: px.
        draggable: whether the mouse moves it.
        show_contacts: whether the starts of contacts are marked.
    """

    def __init__(self, player: Player, box: pygame.Rect, *, draggable: bool = True, show_contacts: bool = True) -> None:
        self.player, self.box, self.draggable = player, box, draggable
        self._marks = player.contacts() if show_contacts else []
        self._drag = _Drag(box, box.inflate(12, 8), player.seek)

    def handle(self, event: pygame.Event) -> bool:
        """Process an event; returns True if the timeline has used it."""
        return self.draggable and self._drag.handle(event)

    def draw(self, surface: pygame.Surface) -> None:
        box = self.box
        x, y = box.left + round(self.player.fraction * box.width), box.centery
        track = pygame.Rect(box.left, y - 3, box.width, 6)
        pygame.draw.rect(surface, GRID, track, border_radius=3)
        pygame.draw.rect(surface, BLUE, (box.left, y - 3, x - box.left, 6), border_radius=3)
        for mark in self._marks:
            at = box.left + round(mark * box.width)
            pygame.draw.line(surface, VERMILLION, (at, y - 4), (at, y + 4), 2)
            pygame.draw.polygon(surface, VERMILLION, [(at, y - 5), (at - 4, y - 11), (at + 4, y - 11)])
        if self.draggable:
            pygame.draw.circle(surface, PAPER, (x, y), 9)
            pygame.draw.aacircle(surface, BLUE, (x, y), 9, 3)


class Scale:
    """Slider from 0 to 1 that shows no value before the first input, so that it suggests no answer.

    Args:
        box: px, including the texts at both ends.
        ends: meanings of 0 and 1.
        scale: of texts.
        value: initial value, 0 to 1; None for no value yet.
    """

    def __init__(
        self, box: pygame.Rect, ends: tuple[str, str], *, scale: float = 1.0, value: float | None = None
    ) -> None:
        self.box, self.value = box, value
        self._ends, self._size = ends, text_size(TEXT, scale)
        self.track = pygame.Rect(box.left + 12, box.top + box.height // 3 - 4, box.width - 24, 8)
        self._drag = _Drag(self.track, self.track.inflate(24, 36), self._set)

    def handle(self, event: pygame.Event) -> bool:
        """Process a mouse event or an arrow key (with Shift: small steps); returns True if the slider has used it."""
        if event.type == pygame.KEYDOWN and event.key in (pygame.K_LEFT, pygame.K_RIGHT):
            step = 0.01 if event.mod & pygame.KMOD_SHIFT else 0.05
            sign = 1 if event.key == pygame.K_RIGHT else -1
            # The first key press marks the middle.
            self._set(0.5 if self.value is None else min(max(round(self.value + sign * step, 4), 0.0), 1.0))
            return True
        return self._drag.handle(event)

    def draw(self, surface: pygame.Surface) -> None:
        track, value = self.track, self.value
        pygame.draw.rect(surface, GRID, track, border_radius=4)
        for tenth in range(11):
            x = track.left + round(tenth / 10 * track.width)
            pygame.draw.line(surface, FAINT, (x, track.bottom + 3), (x, track.bottom + (9 if tenth % 5 == 0 else 6)))
        if value is not None:
            x = track.left + round(value * track.width)
            pygame.draw.circle(surface, PAPER, (x, track.centery), 12)
            pygame.draw.aacircle(surface, BLUE, (x, track.centery), 12, 4)
        y = (track.bottom + 9 + self.box.bottom) / 2
        text = "click or press an arrow key" if value is None else f"{value:.2f}"
        middle = write(surface, text, (self.box.centerx, y), size=self._size, colour=FAINT, anchor="center")
        max_width = (self.box.width - middle.width) / 2 - 16
        write(surface, self._ends[0], (self.box.left, y), size=self._size, max_width=max_width)
        write(surface, self._ends[1], (self.box.right, y), size=self._size, anchor="midright", max_width=max_width)

    def _set(self, value: float) -> None:
        self.value = value
