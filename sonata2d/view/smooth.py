"""A surface drawn on at its own size with smooth edges: for large shapes, which would cost too much drawn larger."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from itertools import pairwise

import pygame

from ..core.geometry import Point
from .canvas import Pixels
from .outlines import bar, filling, middles, whole
from .palette import Colour
from .tiles import in_view, premultiplied, put, spare

_LARGE = 40.0  # pixels of radius, from which on round shapes are drawn less finely
_WIDE = 8.0  # pixels of a line
_DOT = 8.0  # pixels of radius, up to which round shapes are kept


class Smooth:
    """A canvas of a pygame surface at its own pixels; see `filling` for how edges come out smooth."""

    def __init__(self, surface: pygame.Surface) -> None:
        self.surface = surface
        self._hard = Pixels(surface)

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        self._round(colour, centre, radius, 0.0)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        self._round(colour, centre, radius, width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        inner, rims = filling(points)
        pygame.draw.polygon(self.surface, colour, whole(inner))
        for rim in rims:
            pygame.draw.aalines(self.surface, colour, True, middles(rim))
        if edge is not None:
            self.stroke(edge, [*points, points[0]], width)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        for start, end in pairwise(points):
            if start == end:
                continue
            if width < 2.0:
                self._line(colour, start, end)
            elif width < _WIDE:
                self.polygon(colour, bar(start, end, width / 2))
            else:
                self._wide_bar(colour, start, end, width / 2)
        for point in points if width >= 3.0 else ():
            self.circle(colour, point, width / 2)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        left, top = (math.floor(min(point[k] for point in points)) for k in (0, 1))
        width, height = (math.ceil(max(p[k] for p in points)) - low + 1 for k, low in ((0, left), (1, top)))
        if in_view(self.surface, left, top, width, height):
            tile = spare(2 * width, 2 * height)
            corners = [(2 * (x - left), 2 * (y - top)) for x, y in points]
            pygame.draw.polygon(tile, premultiplied(colour, alpha), corners)
            self._put(tile, left, top, width, height)

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        self._hard.rectangle(colour, box, edge)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        return self._hard.text(colour, words, place, size, anchor)

    def group(self, kind: str) -> AbstractContextManager[None]:
        return nullcontext()

    def _wide_bar(self, colour: Colour, start: Point, end: Point, half: float) -> None:
        """A bar with smooth sides; its ends lie below round ones."""
        pygame.draw.polygon(self.surface, colour, whole(bar(start, end, half - 1.1)))
        for inset in (1.25, 0.5):
            right, far_right, far_left, left = bar(start, end, half - inset)
            self._line(colour, right, far_right)
            self._line(colour, left, far_left)

    def _line(self, colour: Colour, start: Point, end: Point) -> None:
        """A smooth line one pixel wide; for two points faster than pygame's for many."""
        start, end = middles((start, end))
        pygame.draw.aaline(self.surface, colour, start, end)

    def _round(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        if radius < _DOT and not width:
            self._dot(colour, centre, radius)
            return
        left, top = math.floor(centre[0] - radius), math.floor(centre[1] - radius)
        side = math.ceil(2 * radius) + 2
        if in_view(self.surface, left, top, side, side):
            fine = 4 if radius < _LARGE else 2
            tile = spare(fine * side, fine * side)
            middle = (centre[0] - left) * fine, (centre[1] - top) * fine
            pygame.draw.circle(tile, colour, middle, radius * fine, max(round(width * fine), 1) if width else 0)
            self._put(tile, left, top, side, side)

    def _dot(self, colour: Colour, centre: Point, radius: float) -> None:
        """A small disc, of which there are many: at one of 16 places within a pixel."""
        (x, dx), (y, dy) = (divmod(round(value * 4), 4) for value in centre)
        margin, image = _dot_image(colour, round(radius * 8) / 8, dx / 4, dy / 4)
        put(self.surface, image, x - margin, y - margin)

    def _put(self, tile: pygame.Surface, left: int, top: int, width: int, height: int) -> None:
        small = pygame.transform.smoothscale(tile, (width, height))
        put(self.surface, small, left, top)


@lru_cache(maxsize=1024)
def _dot_image(colour: Colour, radius: float, dx: float, dy: float) -> tuple[int, pygame.Surface]:
    """A premultiplied disc, and how far left of and above the disc's pixel the picture begins."""
    margin = math.ceil(radius) + 1
    side = 2 * margin + 1
    tile = spare(8 * side, 8 * side)
    pygame.draw.circle(tile, colour, (8 * (margin + dx), 8 * (margin + dy)), 8 * radius)
    return margin, pygame.transform.smoothscale(tile, (side, side))
