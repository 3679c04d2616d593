"""Canvases of pixels, on which shapes are drawn; `svg` has the canvas of vectors with the same methods.

A shape is split into primitives, functions that draw on a surface. There are two sets of them. On a surface that is
`fine` times larger than the finished picture, edges are hard, because making the picture smaller smooths them. On a
surface of the picture's own size, edges are antialiased, which is faster for large areas.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pygame

from ..core.geometry import Point
from ..core.portable_math import Array
from .fonts import rendered
from .palette import PAPER, Colour
from .polygons import ends_and_bends, filling, pixel_centres, pixels_of, ribbon, widened
from .svg import SvgCanvas

_LARGE = 40.0  # px, radius above which an antialiased circle is drawn 2 instead of 4 times larger
_DOT = 8.0  # px, radius up to which images of antialiased discs are kept

Primitive = Callable[..., object]  # draws; its arguments: surface, colour, points, and further settings


class RasterCanvas:
    """A canvas that splits shapes into primitives; points are pixels right of and below the upper left corner.

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
        """Draw the steps of paths, each in its own colour; on a larger surface with round ends.

        Args:
            colours: of the K steps.
            steps: (K, 2, 2), start and end of each, px.
            width: px.
        """
        along = np.abs(steps[:, 1] - steps[:, 0])
        # pygame measures the width of a line along an axis of the picture; its polygons include their edges
        exact = width * np.hypot(*along.T) / np.maximum(along.max(axis=1), 1e-9) + (self.fine > 1)
        widths = np.rint(exact).astype(int).tolist()
        has_round_ends = self.fine > 1 and self._is_wide(width)
        for colour, step, line_width in zip(colours, steps.tolist(), widths, strict=True):
            self.draw(_step, colour, step, width, line_width, self.fine == 1)
            for end in step if has_round_ends else ():
                self.circle(colour, end, width / 2)

    def _is_wide(self, width: float) -> bool:
        """Whether the ends of a line are large enough to be rounded."""
        return width > 1.5 * self.fine

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """Draw a translucent polygon; alpha is 0 (invisible) to 255."""
        self.draw(_wash, colour, points, 0.0, alpha, 2 if self.fine == 1 else 1)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        """Draw one upright line of text; `anchor` names the point of its box at `place`, as in `pygame.Rect`."""
        box = rendered(words, size, colour).get_rect(**{anchor: (round(place[0]), round(place[1]))})
        self.draw(_text, colour, [place], box.width / 2, words, size, anchor)
        return box

    def group(self, kind: str) -> AbstractContextManager[None]:
        """Mark all shapes drawn within the context as one object of a kind, on canvases that can express it."""
        return nullcontext()

    def inside(self, outline: Sequence[Point]) -> AbstractContextManager[None]:
        """Clip all drawing within the context to a polygon."""
        raise NotImplementedError

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
    """A canvas of pixels: a pygame surface.

    Args:
        surface: drawn on.
        fine: size of the surface in multiples of the finished picture's; 1 selects antialiased primitives.
    """

    def __init__(self, surface: pygame.Surface, fine: int = 1) -> None:
        super().__init__(fine)
        self.surface = surface

    @classmethod
    def blank(cls, size: tuple[int, int]) -> PixelCanvas:
        """A white picture of a size, px."""
        surface = pygame.Surface(size, 0, 32)
        surface.fill(PAPER)
        return cls(surface)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.surface.get_size()

    def place(self, other: PixelCanvas, left: int, top: int) -> None:
        """Add another picture, with its upper left corner at a point, px."""
        self.surface.blit(other.surface, (left, top))

    def content(self) -> bytes:
        """The content of a PNG file."""
        file = io.BytesIO()
        pygame.image.save(self.surface, file, "picture.png")
        return file.getvalue()

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        """Draw an upright rectangle of whole pixels; if `edge` is given, with an outline and round corners."""
        pygame.draw.rect(self.surface, colour, box, 0, 4 if edge else -1)
        if edge is not None:
            pygame.draw.rect(self.surface, edge, box, 1, 4)

    @contextmanager
    def inside(self, outline: Sequence[Point]) -> Iterator[None]:
        before = self.surface.copy()
        yield
        mask = pygame.Surface(before.get_size(), pygame.SRCALPHA, 32)
        pygame.draw.polygon(mask, (255, 255, 255, 255), outline)
        pygame.draw.polygon(before, (0, 0, 0, 0), outline)
        self.surface.blit(mask, (0, 0), special_flags=pygame.BLEND_RGBA_MULT)  # nothing remains outside
        self.surface.blit(before, (0, 0), special_flags=pygame.BLEND_RGBA_ADD)

    def draw(
        self, primitive: Primitive, colour: Colour, points: Sequence[Point], margin: float, *settings: Any
    ) -> None:
        primitive(self.surface, colour, points, *settings)


Canvas = RasterCanvas | SvgCanvas  # they have the same methods to draw
Picture = PixelCanvas | SvgCanvas  # finished, of pixels or vectors


# Primitives


def _hard_circle(surface: pygame.Surface, colour: Colour, points: Sequence[Point], radius: float, width: float) -> None:
    """Draw a circle line, or a filled circle if its width is 0."""
    pygame.draw.circle(surface, colour, points[0], radius, max(round(width), 1) if width else 0)


def _step(surface: pygame.Surface, colour: Colour, points: Sequence[Point], width: int, smooth: bool) -> None:
    start, end = pixel_centres(points) if smooth else points
    (pygame.draw.aaline if smooth else pygame.draw.line)(surface, colour, start, end, width)


def _text(surface: pygame.Surface, colour: Colour, points: Sequence[Point], words: str, size: int, anchor: str) -> None:
    line = rendered(words, size, colour)
    surface.blit(line, line.get_rect(**{anchor: (round(points[0][0]), round(points[0][1]))}))


def _inner_polygon(surface: pygame.Surface, colour: Colour, points: Sequence[Point]) -> None:
    pygame.draw.polygon(surface, colour, pixels_of(points))


def _smooth_line(surface: pygame.Surface, colour: Colour, points: Sequence[Point], closed: bool) -> None:
    centres = pixel_centres(points)
    if closed:
        pygame.draw.aalines(surface, colour, True, centres)
    else:  # for few points faster than `aalines`, which omits very short segments
        for start, end in pairwise(centres):
            pygame.draw.aaline(surface, colour, start, end)


def _smooth_circle(
    surface: pygame.Surface, colour: Colour, points: Sequence[Point], radius: float, width: float
) -> None:
    x, y = points[0]
    if radius < _DOT and not width:  # small discs are frequent (dotted lines); their images are kept per 1/4 pixel
        (column, dx), (row, dy) = divmod(round(x * 4), 4), divmod(round(y * 4), 4)
        margin, image = _dot_image(colour, round(radius * 8) / 8, dx / 4, dy / 4)
        put(surface, image, column - margin, row - margin)
        return
    left, top, side = math.floor(x - radius), math.floor(y - radius), math.ceil(2 * radius) + 2
    if in_view(surface, left, top, side, side):
        fine = 4 if radius < _LARGE else 2
        tile = spare_tile(fine * side, fine * side)
        _hard_circle(tile, colour, [((x - left) * fine, (y - top) * fine)], radius * fine, width * fine)
        put(surface, pygame.transform.smoothscale(tile, (side, side)), left, top)


@lru_cache(maxsize=1024)
def _dot_image(colour: Colour, radius: float, dx: float, dy: float) -> tuple[int, pygame.Surface]:
    """A premultiplied image of a disc, and the pixels from the image's left and upper edge to the disc's centre."""
    margin = math.ceil(radius) + 1
    side = 2 * margin + 1
    tile = spare_tile(8 * side, 8 * side)
    pygame.draw.circle(tile, colour, (8 * (margin + dx), 8 * (margin + dy)), 8 * radius)
    return margin, pygame.transform.smoothscale(tile, (side, side))


def _wash(surface: pygame.Surface, colour: Colour, points: Sequence[Point], alpha: int, fine: int) -> None:
    """Draw a translucent polygon by way of a tile that is `fine` times larger."""
    left, top, width, height = _bounds(points)
    if in_view(surface, left, top, width, height):
        tile = spare_tile(fine * width, fine * height)
        corners = [(fine * (x - left), fine * (y - top)) for x, y in points]
        pygame.draw.polygon(tile, premultiplied(colour, alpha), corners)
        put(surface, pygame.transform.smoothscale(tile, (width, height)) if fine > 1 else tile, left, top)


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


def put(surface: pygame.Surface, image: pygame.Surface, left: int, top: int) -> None:
    """Blend a premultiplied image onto a surface."""
    surface.blit(image, (left, top), special_flags=pygame.BLEND_PREMULTIPLIED)


def in_view(surface: pygame.Surface, left: float, top: float, width: float, height: float) -> bool:
    """Whether any part of a box of pixels lies on the surface."""
    wide, high = surface.get_size()
    return left < wide and top < high and left + width > 0 and top + height > 0
