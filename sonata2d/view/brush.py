"""Shapes in metres onto a surface. A brush stands somewhere in the world and draws in the frame of that place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import pygame

from ..geometry import Point
from .camera import Camera
from .palette import Colour

_ROUND = tuple((math.cos(k * math.pi / 16), math.sin(k * math.pi / 16)) for k in range(32))


@dataclass(frozen=True, slots=True)
class Brush:
    """Draws on `surface` as `camera` sees it; points are (ahead, left) of where it stands, m.

    Widths are metres, and never thinner than a pixel of the finished picture (`hairline`, in pixels of the surface).
    """

    surface: pygame.Surface
    camera: Camera
    hairline: float = 1.0
    x: float = 0.0
    y: float = 0.0
    heading: Point = (1.0, 0.0)

    def at(self, position: Point, heading: Point = (1.0, 0.0)) -> Brush:
        """The same brush standing at a world position, looking along a unit vector."""
        return Brush(self.surface, self.camera, self.hairline, *position, heading)

    def pixels(self, points: Sequence[Point]) -> list[Point]:
        """Where points of the brush's frame lie on the surface."""
        (c, s), camera = self.heading, self.camera
        return [camera.to_pixels((self.x + a * c - b * s, self.y + a * s + b * c)) for a, b in points]

    def thickness(self, width: float) -> float:
        """A width in pixels of the surface."""
        return max(width * self.camera.scale, self.hairline)

    def disc(self, colour: Colour, centre: Point, radius: float) -> None:
        pygame.draw.circle(self.surface, colour, self.pixels([centre])[0], radius * self.camera.scale)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        """A circle line whose outer edge is at `radius`."""
        line = max(round(self.thickness(width)), 1)
        pygame.draw.circle(self.surface, colour, self.pixels([centre])[0], radius * self.camera.scale, line)

    def dashed_ring(self, colour: Colour, centre: Point, radius: float, width: float, dashes: int) -> None:
        """A circle line of so many dashes, gaps as long as the dashes."""
        for k in range(dashes):
            turns = [(k + part / 12) * 2 * math.pi / dashes for part in range(7)]
            r = radius - width / 2
            self.stroke(colour, [(centre[0] + r * math.cos(t), centre[1] + r * math.sin(t)) for t in turns], width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """A filled polygon, with an outline if `edge` is given."""
        pygame.draw.polygon(self.surface, colour, self.pixels(points))
        if edge is not None:
            self.stroke(edge, [*points, points[0]], width)

    def box(self, colour: Colour, low: Point, high: Point, edge: Colour | None = None, width: float = 0.0) -> None:
        """A rectangle along the brush's axes, from its lower right corner to its upper left one."""
        (a, b), (c, d) = low, high
        self.polygon(colour, [(a, b), (c, b), (c, d), (a, d)], edge, width)

    def ellipse(
        self, colour: Colour, centre: Point, half: Point, edge: Colour | None = None, width: float = 0.0
    ) -> None:
        """An ellipse along the brush's axes; `half` is its reach ahead and to the left."""
        self.polygon(colour, [(centre[0] + half[0] * c, centre[1] + half[1] * s) for c, s in _ROUND], edge, width)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """A line through points, round at ends and bends."""
        half, corners = self.thickness(width) / 2, self.pixels(points)
        for (ax, ay), (bx, by) in pairwise(corners):
            length = math.hypot(bx - ax, by - ay)
            if length > 0.0:
                nx, ny = (by - ay) / length * half, (ax - bx) / length * half
                quad = [(ax + nx, ay + ny), (bx + nx, by + ny), (bx - nx, by - ny), (ax - nx, ay - ny)]
                pygame.draw.polygon(self.surface, colour, quad)
        if half > 1.0:
            for corner in corners:
                pygame.draw.circle(self.surface, colour, corner, half)

    def dots(self, colour: Colour, start: Point, end: Point, radius: float, spacing: float) -> None:
        """Dots from start to end, evenly spaced and about `spacing` apart."""
        (ax, ay), (bx, by) = start, end
        count = max(round(math.hypot(bx - ax, by - ay) / spacing), 1)
        for k in range(count + 1):
            self.disc(colour, (ax + (bx - ax) * k / count, ay + (by - ay) * k / count), radius)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """A polygon that lets what is below shine through; alpha 0..255."""
        corners = self.pixels(points)
        left, top = (math.floor(min(c[k] for c in corners)) for k in (0, 1))
        width, height = (math.ceil(max(c[k] for c in corners)) - low + 1 for k, low in ((0, left), (1, top)))
        tile = pygame.Surface((width, height), pygame.SRCALPHA, 32)
        pygame.draw.polygon(tile, (*colour, alpha), [(x - left, y - top) for x, y in corners])
        self.surface.blit(tile, (left, top))
