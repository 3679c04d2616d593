"""Canvas of a brush: shapes in pixels, drawn on a pygame surface or as SVG.

A shape is split into primitives, functions that draw on a surface. There are two sets of them. On a surface that is
`fine` times larger than the finished picture, edges are hard, because making the picture smaller smooths them. On a
surface of the picture's own size, edges are antialiased, which is faster for large areas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from itertools import pairwise
from typing import Any

import pygame

from ..core.geometry import Point
from ..core.portable_math import Array
from .fonts import rendered
from .palette import Colour
from .polygons import ends_and_bends, filling, pixel_centres, pixels_of, ribbon, step_ribbons, widened
from .svg import SvgCanvas

_LARGE = 40.0  # px, radius above which an antialiased circle is drawn 2 instead of 4 times larger
_DOT = 8.0  # px, radius up to which images of antialiased discs are kept

# Its arguments: surface, colour, points, and further settings of the primitive; it returns the box of changed pixels.
Primitive = Callable[..., pygame.Rect]


class RasterCanvas:
    """Shapes in pixels, measured right and down from the upper left corner, split into primitives.

    A subclass draws or records the primitives.

    Args:
        fine: size of the surface in multiples of the finished picture's; 1 selects antialiased primitives.
    """

    def __init__(self, fine: int) -> None:
        self.fine = fine

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        """Draw a filled circle."""
        self.draw(_smooth_circle if self.fine == 1 else _hard_circle, colour, [centre], radius, radius, 0.0)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        """Draw a circle line whose outer edge is at `radius`."""
        self.draw(_smooth_circle if self.fine == 1 else _hard_circle, colour, [centre], radius, radius, width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """Draw a filled polygon; if `edge` is given, with an outline centred on its sides."""
        if edge is None:
            self._fill(colour, points)
        else:  # two fillings are faster than an outline
            self._fill(edge, widened(points, width / 2))
            self._fill(colour, widened(points, -width / 2))

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """Draw a line through points, with round ends and bends."""
        if self.fine == 1 and width < 2.0:
            self.draw(_smooth_line, colour, points, 1.0, False)
            return
        self._fill(colour, ribbon(points, width / 2))
        for point in ends_and_bends(points) if self._is_wide(width) else ():
            self.circle(colour, point, width / 2)

    def steps(self, colours: Sequence[Colour], steps: Array, width: float) -> None:
        """Draw lines with round ends.

        Args:
            colours: of the K lines.
            steps: (K, 2, 2), start and end of each, px.
            width: px.
        """
        pairs = [(tuple(start), tuple(end)) for start, end in steps.tolist()]
        if self.fine == 1:
            for colour, pair in zip(colours, pairs, strict=True):
                self.stroke(colour, pair, width)
            return
        is_wide, radius = self._is_wide(width), width / 2
        starts = [start for start, _ in pairs[1:]]
        outlines = step_ribbons(steps, radius).tolist()
        for colour, (start, end), following, outline in zip(colours, pairs, [*starts, None], outlines, strict=True):
            self.draw(pygame.draw.polygon, colour, outline, 0.0)
            if is_wide:
                self.draw(_hard_circle, colour, [start], radius, radius, 0.0)
                if following != end:  # else the next step's start covers this end
                    self.draw(_hard_circle, colour, [end], radius, radius, 0.0)

    def _is_wide(self, width: float) -> bool:
        """Whether the ends of a line are large enough to be rounded."""
        return width > 1.5 * self.fine

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """Draw a translucent polygon; alpha is 0 (invisible) to 255."""
        self.draw(_smooth_wash if self.fine == 1 else _hard_wash, colour, points, 0.0, alpha)

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        """Draw an upright rectangle of whole pixels; if `edge` is given, with an outline and round corners."""
        self.polygon(colour, [box.topleft, box.topright, box.bottomright, box.bottomleft], edge, 1.0)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        """Draw one upright line of text; `anchor` names the point of its box at `place`, as in `pygame.Rect`."""
        box = rendered(words, size, colour).get_rect(**{anchor: (round(place[0]), round(place[1]))})
        self.draw(_text, colour, [place], box.width / 2, words, size, anchor)
        return box

    def group(self, kind: str) -> AbstractContextManager[None]:
        """Mark what is drawn inside as one object of a kind, on canvases that can express it."""
        return nullcontext()

    def _fill(self, colour: Colour, points: Sequence[Point]) -> None:
        if self.fine > 1:
            self.draw(pygame.draw.polygon, colour, points, 0.0)
            return
        inner, rims = filling(points)
        self.draw(_inner_polygon, colour, inner, 2.0)
        for rim in rims:
            self.draw(_smooth_line, colour, rim, 1.0, True)

    def draw(
        self, primitive: Primitive, colour: Colour, points: Sequence[Point], margin: float, *settings: Any
    ) -> None:
        """Draw or record one primitive that extends `margin` pixels beyond its points."""
        raise NotImplementedError


class PixelCanvas(RasterCanvas):
    """A pygame surface.

    Args:
        surface: drawn on.
        fine: size of the surface in multiples of the finished picture's; 1 selects antialiased primitives.
    """

    def __init__(self, surface: pygame.Surface, fine: int = 1) -> None:
        super().__init__(fine)
        self.surface = surface

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        self.draw(_rectangle, colour, (), 0.0, box, 4 if edge else -1, 0)
        if edge is not None:
            self.draw(_rectangle, edge, (), 0.0, box, 4, 1)

    def draw(
        self, primitive: Primitive, colour: Colour, points: Sequence[Point], margin: float, *settings: Any
    ) -> None:
        primitive(self.surface, colour, points, *settings)


class TrackingCanvas(PixelCanvas):
    """A pygame surface, with a record of what was drawn on.

    Attributes:
        boxes: that contain all changed pixels.
    """

    def __init__(self, surface: pygame.Surface, fine: int = 1) -> None:
        super().__init__(surface, fine)
        self.boxes: list[pygame.Rect] = []

    def draw(
        self, primitive: Primitive, colour: Colour, points: Sequence[Point], margin: float, *settings: Any
    ) -> None:
        self.boxes.append(primitive(self.surface, colour, points, *settings))


Canvas = RasterCanvas | SvgCanvas  # they have the same methods


# Primitives


def _hard_circle(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], radius: float, width: float
) -> pygame.Rect:
    """Draw a circle line, or a filled circle if its width is 0."""
    return pygame.draw.circle(surface, colour, points[0], radius, max(round(width), 1) if width else 0)


def _rectangle(
    surface: pygame.Surface, colour: Colour, _: Sequence[Point], box: pygame.Rect, corner_radius: int, width: int
) -> pygame.Rect:
    return pygame.draw.rect(surface, colour, box, width, corner_radius)


def _hard_wash(surface: pygame.Surface, colour: Colour, points: Sequence[Point], alpha: int) -> pygame.Rect:
    left, top, width, height = _bounds(points)
    tile = pygame.Surface((width, height), pygame.SRCALPHA, 32)
    pygame.draw.polygon(tile, (*colour, alpha), [(x - left, y - top) for x, y in points])
    return surface.blit(tile, (left, top))


def _text(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], words: str, size: int, anchor: str
) -> pygame.Rect:
    line = rendered(words, size, colour)
    return surface.blit(line, line.get_rect(**{anchor: (round(points[0][0]), round(points[0][1]))}))


def _inner_polygon(surface: pygame.Surface, colour: Colour, points: Sequence[Point]) -> pygame.Rect:
    return pygame.draw.polygon(surface, colour, pixels_of(points))


def _smooth_line(surface: pygame.Surface, colour: Colour, points: Sequence[Point], closed: bool) -> pygame.Rect:
    centres = pixel_centres(points)
    if closed:
        return pygame.draw.aalines(surface, colour, True, centres)
    # for few points faster than `aalines`, which omits very short segments
    first, *others = [pygame.draw.aaline(surface, colour, start, end) for start, end in pairwise(centres)]
    return first.unionall(others)


def _smooth_circle(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], radius: float, width: float
) -> pygame.Rect:
    x, y = points[0]
    if radius < _DOT and not width:  # small discs are frequent (dotted lines); their images are kept per 1/4 pixel
        (column, dx), (row, dy) = divmod(round(x * 4), 4), divmod(round(y * 4), 4)
        margin, image = _dot_image(colour, round(radius * 8) / 8, dx / 4, dy / 4)
        return put(surface, image, column - margin, row - margin)
    left, top, side = math.floor(x - radius), math.floor(y - radius), math.ceil(2 * radius) + 2
    if not in_view(surface, left, top, side, side):
        return pygame.Rect(0, 0, 0, 0)
    fine = 4 if radius < _LARGE else 2
    tile = spare_tile(fine * side, fine * side)
    _hard_circle(tile, colour, [((x - left) * fine, (y - top) * fine)], radius * fine, width * fine)
    return put(surface, pygame.transform.smoothscale(tile, (side, side)), left, top)


@lru_cache(maxsize=1024)
def _dot_image(colour: Colour, radius: float, dx: float, dy: float) -> tuple[int, pygame.Surface]:
    """A premultiplied image of a disc, and the pixels from the image's left and upper edge to the disc's centre."""
    margin = math.ceil(radius) + 1
    side = 2 * margin + 1
    tile = spare_tile(8 * side, 8 * side)
    pygame.draw.circle(tile, colour, (8 * (margin + dx), 8 * (margin + dy)), 8 * radius)
    return margin, pygame.transform.smoothscale(tile, (side, side))


def _smooth_wash(surface: pygame.Surface, colour: Colour, points: Sequence[Point], alpha: int) -> pygame.Rect:
    left, top, width, height = _bounds(points)
    if not in_view(surface, left, top, width, height):
        return pygame.Rect(0, 0, 0, 0)
    tile = spare_tile(2 * width, 2 * height)
    pygame.draw.polygon(tile, premultiplied(colour, alpha), [(2 * (x - left), 2 * (y - top)) for x, y in points])
    return put(surface, pygame.transform.smoothscale(tile, (width, height)), left, top)


def _bounds(points: Sequence[Point]) -> tuple[int, int, int, int]:
    """Left, top, width and height in whole pixels of the box that holds all points."""
    left, top = (math.floor(min(point[k] for point in points)) for k in (0, 1))
    width, height = (math.ceil(max(p[k] for p in points)) - low + 1 for k, low in ((0, left), (1, top)))
    return left, top, width, height


# Tiles are small images that are drawn larger on a spare surface, made smaller and put in their place. Their pixels are
# premultiplied by alpha, because otherwise smoothing would mix in the colour of transparent pixels.

_spare: list[pygame.Surface] = []


def spare_tile(width: int, height: int) -> pygame.Surface:
    """A transparent surface; valid until the next call."""
    if not _spare or _spare[0].get_width() < width or _spare[0].get_height() < height:
        old = _spare.pop().get_size() if _spare else (512, 512)
        _spare.append(pygame.Surface((max(old[0], width), max(old[1], height)), pygame.SRCALPHA, 32))
    tile = _spare[0].subsurface((0, 0, width, height))
    tile.fill((0, 0, 0, 0))
    return tile


def premultiplied(colour: Colour, alpha: int) -> tuple[int, int, int, int]:
    """The premultiplied pixel of a translucent colour."""
    r, g, b = (round(value * alpha / 255) for value in colour)
    return r, g, b, alpha


def put(surface: pygame.Surface, image: pygame.Surface, left: int, top: int) -> pygame.Rect:
    """Blend a premultiplied image onto a surface; returns the box of changed pixels."""
    return surface.blit(image, (left, top), special_flags=pygame.BLEND_PREMULTIPLIED)


def in_view(surface: pygame.Surface, left: float, top: float, width: float, height: float) -> bool:
    """Whether any part of a box of pixels lies on the surface."""
    wide, high = surface.get_size()
    return left < wide and top < high and left + width > 0 and top + height > 0
