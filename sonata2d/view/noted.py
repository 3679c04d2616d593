"""Shapes noted instead of drawn, to be drawn later at other places and turned otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import pygame

from ..core.geometry import Point
from .fonts import rendered, width_of
from .outlines import ends_and_bends, filling, middles, ribbon, whole, widened
from .palette import Colour
from .smooth import Smooth
from .tiles import premultiplied

Shape = tuple[Any, ...]  # kind, colour, index of its first point, and what else the kind needs


class Noted:
    """A canvas that notes shapes; an outline becomes a larger shape below a smaller one.

    Args:
        fine: times the pixels a side of the picture; 1 to draw straight onto it, smooth lines round hard fillings.

    Attributes:
        points: of all shapes, pixels.
        margin: pixels that something goes beyond each point.
        shapes: how the points are used.
    """

    def __init__(self, fine: int) -> None:
        self.fine = fine
        self.points: list[Point] = []
        self.shapes: list[Shape] = []
        self.margin: list[float] = []

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        self._note("circle", colour, [centre], radius, radius)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        self._note("ring", colour, [centre], radius, radius, width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        if edge is None:
            self._fill(colour, points)
        else:
            self._fill(edge, widened(points, width / 2))
            self._fill(colour, widened(points, -width / 2))

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        if width < 2.0 and self.fine == 1:
            self._note("line", colour, points, 1.0, len(points))
            return
        self._fill(colour, ribbon(points, width / 2))
        for point in ends_and_bends(points) if width > 1.5 * self.fine else ():
            self.circle(colour, point, width / 2)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        self._note("wash", colour, points, 0.0, len(points), alpha)

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        self.polygon(colour, [box.topleft, box.topright, box.bottomright, box.bottomleft], edge, 1.0)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        box = pygame.Rect(0, 0, width_of(words, size), size)
        self._note("text", colour, [place], box.width / 2, words, size)
        return box

    def group(self, kind: str) -> AbstractContextManager[None]:
        return nullcontext()

    def _fill(self, colour: Colour, points: Sequence[Point]) -> None:
        if self.fine == 1:
            inner, rims = filling(points)
            self._note("polygon", colour, inner, 2.0, len(points))
            for rim in rims:
                self._note("rim", colour, rim, 1.0, len(points))
        else:
            self._note("polygon", colour, points, 0.0, len(points))

    def _note(self, kind: str, colour: Colour, points: Sequence[Point], reach: float, *more: Any) -> None:
        self.shapes.append((kind, colour, len(self.points), *more))
        self.points += points
        self.margin += [reach] * len(points)


def draw_large(tile: pygame.Surface, shapes: Sequence[Shape], points: list[Point]) -> None:
    """Draw shapes on a tile of premultiplied pixels, where a wash takes the place of what is below it."""
    for kind, colour, start, *more in shapes:
        if kind == "polygon":
            pygame.draw.polygon(tile, colour, points[start : start + more[0]])
        elif kind == "circle":
            pygame.draw.circle(tile, colour, points[start], more[0])
        elif kind == "ring":
            pygame.draw.circle(tile, colour, points[start], more[0], max(round(more[1]), 1))
        elif kind == "wash":
            pygame.draw.polygon(tile, premultiplied(colour, more[1]), points[start : start + more[0]])
        else:
            line = rendered(more[0], more[1], colour)
            tile.blit(line, line.get_rect(center=points[start]))


def draw_straight(surface: pygame.Surface, shapes: Sequence[Shape], points: list[Point]) -> None:
    """Draw shapes noted at the picture's own pixels."""
    canvas = Smooth(surface)
    for kind, colour, start, *more in shapes:
        if kind == "polygon":
            pygame.draw.polygon(surface, colour, whole(points[start : start + more[0]]))
        elif kind in ("rim", "line"):
            pygame.draw.aalines(surface, colour, kind == "rim", middles(points[start : start + more[0]]))
        elif kind == "circle":
            canvas.circle(colour, points[start], more[0])
        elif kind == "ring":
            canvas.ring(colour, points[start], more[0], more[1])
        elif kind == "wash":
            canvas.wash(colour, more[1], points[start : start + more[0]])
        else:
            canvas.text(colour, more[0], points[start], more[1])
