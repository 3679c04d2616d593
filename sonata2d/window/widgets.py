"""Parts of the screens: lines of text, rows of buttons, and answers without a default."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pygame
import pygame_gui
from pygame_gui.elements import UIButton

from ..collect.texts import text
from ..view.fonts import rendered, shortened, width_of, wrapped
from ..view.palette import BLUE, FAINT, GRID, INK, PAPER, Colour

_PANEL: Colour = (250, 249, 246)
EDGE: Colour = (214, 212, 206)
TEXT, SMALL, LARGE = 20, 18, 28  # heights of texts, px at scale 1
_PITCH = 1.3  # distance of lines, in heights of the text
PLUS = (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS)
MINUS = (pygame.K_MINUS, pygame.K_KP_MINUS)
_HOVER: Colour = (234, 242, 248)  # of a button under the mouse
_CHOICE_GAP, _CHOICE_ROW = 8, 42  # px at scale 1: between answers, and height of an answer with one line
_CHOICE_LINES = 2  # in a button, if there is more than one column
_END_SHARE = 0.33  # of a slider's width for the meaning of an end
_MAX_NOTICE = 5  # lines of a notice
_BUTTON_PADDING = 8  # px, left and right of a button's text together
_MIN_TEXT = 17  # px; smaller text is hard to read
_ButtonSpec = tuple[str, Callable[[], object] | None, str]  # text, command, tool tip (may be empty)


def text_size(size: int, scale: float) -> int:
    """Text height for a window scale, px; at least 17 px, so that text stays readable in small windows."""
    return max(round(size * scale), _MIN_TEXT)


def draw_panel(surface: pygame.Surface, box: pygame.Rect, *, edge: str) -> None:
    """Draw a plain background for texts and widgets, with a line along its `top` or `bottom` edge."""
    surface.fill(_PANEL, box)
    y = box.top if edge == "top" else box.bottom - 1
    pygame.draw.line(surface, EDGE, (box.left, y), (box.right - 1, y))


def write(
    surface: pygame.Surface,
    words: str,
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
        words: the line.
        position: of the anchor, px.
        size: text height, px.
        colour: RGB.
        anchor: attribute of `pygame.Rect` that lies at `position`.
        max_width: px.

    Returns:
        The box of the drawn text, px.
    """
    line = rendered(shortened(words, max_width, size), size, colour)
    box = line.get_rect(**{anchor: (round(position[0]), round(position[1]))})
    surface.blit(line, box)
    return box


def line_height(size: int) -> int:
    """Distance of lines of a text height, px."""
    return round(size * _PITCH)


def write_lines(
    surface: pygame.Surface,
    lines: Sequence[str],
    centre: tuple[float, float],
    *,
    size: int,
    colour: Colour = INK,
    anchor: str = "center",
) -> None:
    """Draw lines below one another, as a block whose middle is at the height of `centre`.

    Args:
        surface: target.
        lines: from top to bottom.
        centre: of the block, px; its x coordinate is the left or right edge for the anchors `midleft` and `midright`.
        size: text height, px.
        colour: RGB.
        anchor: point of each line that lies below or above `centre`: `center`, `midleft` or `midright`.
    """
    pitch = line_height(size)
    top = centre[1] - (len(lines) - 1) / 2 * pitch
    for k, line in enumerate(lines):
        write(surface, line, (centre[0], top + k * pitch), size=size, colour=colour, anchor=anchor)


def draw_notice(
    surface: pygame.Surface,
    notice: str,
    midtop: tuple[float, float],
    *,
    size: int,
    max_width: float,
    otherwise_above: float | None = None,
) -> pygame.Rect:
    """Draw a notice on a dark plate, so that it stands out.

    Args:
        surface: target.
        notice: its text; what does not fit into five lines is replaced by an ellipsis.
        midtop: middle of the plate's upper edge, px.
        size: text height, px.
        max_width: of the plate, px.
        otherwise_above: lower edge of the plate if there is not enough space below `midtop`, px; None for no choice.

    Returns:
        The box of the plate, px.
    """
    padding = round(0.6 * size)
    lines = wrapped(notice, max_width - 2 * padding, size, max_lines=_MAX_NOTICE)
    widest = max((width_of(line, size) for line in lines), default=0)
    box = pygame.Rect(0, 0, widest + 2 * padding, line_height(size) * len(lines) + padding // 2)
    box.midtop = round(midtop[0]), round(midtop[1])
    if otherwise_above is not None and box.bottom > surface.get_height():
        box.bottom = max(round(otherwise_above), box.height)
    pygame.draw.rect(surface, INK, box, border_radius=padding // 2)
    write_lines(surface, lines, box.center, size=size, colour=PAPER)
    return box


def button_row(
    ui: pygame_gui.UIManager, box: pygame.Rect, specs: Sequence[_ButtonSpec], *, gap: int = 6
) -> list[UIButton]:
    """Create buttons side by side that fill a box; the width of each follows its text.

    Args:
        ui: manager of the window's widgets.
        box: px.
        specs: text, command and tool tip of each button.
        gap: between buttons, px.
    """
    texts = [natural_width(ui, words) for words, _, _ in specs]
    rest = (box.width - gap * (len(specs) - 1) - sum(texts)) / len(specs)
    if rest < _BUTTON_PADDING:  # too narrow for all texts: equal widths, and the longest texts are cut
        texts, rest = [0] * len(specs), (box.width - gap * (len(specs) - 1)) / len(specs)
    buttons, left = [], float(box.left)
    for (words, command, tip), width in zip(specs, texts, strict=True):
        place = pygame.Rect(round(left), box.top, round(width + rest), box.height)
        words = fitted(ui, words, place.width - _BUTTON_PADDING)
        buttons.append(UIButton(place, words, ui, command=command, tool_tip_text=tip or None))
        left += width + rest + gap
    return buttons


def natural_width(ui: pygame_gui.UIManager, words: str) -> int:
    """Width of a text in the theme's font of buttons, px."""
    return int(ui.get_theme().get_font(["button"]).size(words)[0])


def fitted(ui: pygame_gui.UIManager, words: str, max_width: float) -> str:
    """Shorten a text of a button or label to `max_width` px of the theme's font."""
    return shortened(words, max_width, ui.get_theme().get_font(["button"]).get_point_size())


class Drag:
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


class Choices:
    """Buttons of which one may be chosen; their texts wrap, and none is chosen at first.

    Args:
        box: px; as high as `height_of` says.
        texts: of the buttons.
        scale: of texts and buttons.
        chosen: index of the button chosen before; None for none.

    Attributes:
        chosen: index of the chosen button; None before the first choice.
        places: of the buttons, px.
    """

    def __init__(self, box: pygame.Rect, texts: Sequence[str], scale: float, chosen: int | None = None) -> None:
        self.chosen, self._unit, self._size = chosen, scale, text_size(TEXT, scale)
        columns, height = _grid(texts, box.width, scale)
        gap, rows = round(_CHOICE_GAP * scale), -(-len(texts) // columns)
        width = (box.width - gap * (columns - 1)) // columns
        top = box.top + max(box.height - rows * (height + gap) + gap, 0) // 2
        self.places = [
            pygame.Rect(box.left + k % columns * (width + gap), top + k // columns * (height + gap), width, height)
            for k in range(len(texts))
        ]
        self._lines = [wrapped(words, width - 2 * gap, self._size) for words in texts]
        self._hovered: int | None = None

    @staticmethod
    def height_of(texts: Sequence[str], width: int, scale: float) -> int:
        """Height that the buttons need in a width, px."""
        columns, height = _grid(texts, width, scale)
        gap, rows = round(_CHOICE_GAP * scale), -(-len(texts) // columns)
        return rows * (height + gap) - gap

    def handle(self, event: pygame.Event) -> bool:
        """Process a mouse event; returns True if it chooses a button."""
        if event.type not in (pygame.MOUSEBUTTONDOWN, pygame.MOUSEMOTION):
            return False
        hit = next((k for k, place in enumerate(self.places) if place.collidepoint(event.pos)), None)
        if event.type == pygame.MOUSEMOTION:
            self._hovered = hit
        elif event.button == pygame.BUTTON_LEFT and hit is not None:
            self.chosen = hit
            return True
        return False

    def draw(self, surface: pygame.Surface) -> None:
        """Draw the buttons; the chosen one is filled, so that colour is not the only cue of its edge."""
        radius = round(6 * self._unit)
        for k, (place, lines) in enumerate(zip(self.places, self._lines, strict=True)):
            is_chosen = k == self.chosen
            fill = BLUE if is_chosen else _HOVER if k == self._hovered else PAPER
            pygame.draw.rect(surface, fill, place, border_radius=radius)
            edge = BLUE if is_chosen or k == self._hovered else FAINT
            pygame.draw.rect(surface, edge, place, max(round(self._unit), 1), border_radius=radius)
            write_lines(surface, lines, place.center, size=self._size, colour=PAPER if is_chosen else INK)


def _grid(texts: Sequence[str], width: int, scale: float) -> tuple[int, int]:
    """Number of columns, as many as leave few lines in each button, and the height of a button, px."""
    gap, size = round(_CHOICE_GAP * scale), text_size(TEXT, scale)
    longest_word = max(width_of(word, size) for words in texts for word in [*words.split(), ""])
    for columns in range(len(texts), 0, -1):
        inner = max((width - gap * (columns - 1)) // columns - 2 * gap, 1)
        lines = max(len(wrapped(words, inner, size)) for words in texts)
        if lines <= _CHOICE_LINES and longest_word <= inner:
            break
    return columns, max(round(_CHOICE_ROW * scale), lines * line_height(size) + 2 * gap)


class Scale:
    """Slider from 0 to 1 that shows no value before the first input, so that it suggests no answer.

    Args:
        box: px, including the texts at both ends.
        ends: meanings of 0 and 1.
        scale: of texts.
        value: initial value, 0 to 1; None for no value yet.
        shows_value: whether the value, or a hint before the first one, is written between the ends.
    """

    def __init__(
        self, box: pygame.Rect, ends: tuple[str, str], *, scale: float, value: float | None, shows_value: bool = True
    ) -> None:
        self.box, self.value, self._unit, self._shows_value = box, value, scale, shows_value
        self._size = text_size(TEXT, scale)
        self._ends = [wrapped(end, box.width * _END_SHARE, self._size) for end in ends]
        edge, height = round(12 * scale), round(8 * scale)
        self.track = pygame.Rect(box.left + edge, box.top + round(16 * scale), box.width - 2 * edge, height)
        self._drag = Drag(self.track, self.track.inflate(2 * edge, 3 * edge), self._set)

    @staticmethod
    def height_of(ends: tuple[str, str], width: int, scale: float) -> int:
        """Height that the slider needs in a width, px."""
        size = text_size(TEXT, scale)
        lines = max(len(wrapped(end, width * _END_SHARE, size)) for end in ends)
        return round(44 * scale) + max(lines, 1) * line_height(size)

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
        track, value, u, size = self.track, self.value, self._unit, self._size
        pygame.draw.rect(surface, GRID, track, border_radius=round(4 * u))
        for tenth in range(11):
            x, length = track.left + round(tenth / 10 * track.width), 9 if tenth % 5 == 0 else 6
            pygame.draw.line(surface, FAINT, (x, track.bottom + 3 * u), (x, track.bottom + length * u))
        if value is not None:
            x = track.left + round(value * track.width)
            pygame.draw.circle(surface, PAPER, (x, track.centery), 12 * u)
            pygame.draw.aacircle(surface, BLUE, (x, track.centery), 12 * u, max(round(4 * u), 1))
        y = track.bottom + 14 * u + size / 2
        words = text("question.no_value") if value is None else f"{value:.2f}"
        if self._shows_value:
            write(surface, words, (self.box.centerx, y), size=size, colour=FAINT, anchor="center",
                  max_width=self.box.width * (1 - 2 * _END_SHARE))  # fmt: skip
        for lines, anchor, x in zip(self._ends, ("midleft", "midright"), (self.box.left, self.box.right), strict=True):
            middle = y + (len(lines) - 1) / 2 * line_height(size)  # the first lines of both ends are side by side
            write_lines(surface, lines, (x, middle), size=size, anchor=anchor)

    def _set(self, value: float) -> None:
        self.value = value
