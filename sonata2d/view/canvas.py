"""What a brush draws on: the few shapes that every target knows, in its own pixels, and pixels as one such target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from itertools import pairwise
from typing import Protocol

import pygame

from ..core.geometry import Point
from .fonts import rendered
from .outlines import bar
from .palette import Colour


class Canvas(Protocol):
    """Shapes in pixels, right and down from the upper left corner."""

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        """A filled circle."""

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        """A circle line whose outer edge is at `radius`."""

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """A filled polygon; with an edge, a line so wide runs along its middle on the outline."""

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """A line through points, round at ends and bends."""

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """A polygon that lets what is below shine through; alpha 0..255."""

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        """An upright box of whole pixels; with an edge, a plate with round corners for a text to stand on."""

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        """One upright line; `anchor` names the point of its box that lies at `place`, as pygame's rectangles do."""

    def group(self, kind: str) -> AbstractContextManager[None]:
        """What is drawn within belongs together and is one of a kind, where the target can tell so."""


class Pixels:
    """A pygame surface; edges are hard, so that it is drawn larger and made smaller afterwards."""

    def __init__(self, surface: pygame.Surface) -> None:
        self.surface = surface

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        pygame.draw.circle(self.surface, colour, centre, radius)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        pygame.draw.circle(self.surface, colour, centre, radius, max(round(width), 1))

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        pygame.draw.polygon(self.surface, colour, points)
        if edge is not None:
            self.stroke(edge, [*points, points[0]], width)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        half = width / 2
        for start, end in pairwise(points):
            quad = bar(start, end, half)
            if quad:
                pygame.draw.polygon(self.surface, colour, quad)
        if half > 1.0:
            for corner in points:
                pygame.draw.circle(self.surface, colour, corner, half)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        left, top = (math.floor(min(point[k] for point in points)) for k in (0, 1))
        width, height = (math.ceil(max(p[k] for p in points)) - low + 1 for k, low in ((0, left), (1, top)))
        tile = pygame.Surface((width, height), pygame.SRCALPHA, 32)
        pygame.draw.polygon(tile, (*colour, alpha), [(x - left, y - top) for x, y in points])
        self.surface.blit(tile, (left, top))

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        pygame.draw.rect(self.surface, colour, box, border_radius=4 if edge else -1)
        if edge is not None:
            pygame.draw.rect(self.surface, edge, box, width=1, border_radius=4)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        line = rendered(words, size, colour)
        box = line.get_rect(**{anchor: (round(place[0]), round(place[1]))})
        self.surface.blit(line, box)
        return box

    def group(self, kind: str) -> AbstractContextManager[None]:
        return nullcontext()
