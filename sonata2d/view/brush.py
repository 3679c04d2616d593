"""Shapes in metres onto a canvas. A brush stands somewhere in the world and draws in the frame of that place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

from ..core.geometry import Point
from .camera import Camera
from .canvas import Canvas
from .fonts import width_of
from .palette import Colour

_ROUND = {
    count: tuple((math.cos(k * 2 * math.pi / count), math.sin(k * 2 * math.pi / count)) for k in range(count))
    for count in (16, 24, 32)
}


@dataclass(frozen=True, slots=True)
class Brush:
    """Draws on `canvas` as `camera` sees it; points are (ahead, left) of where it stands, m.

    Widths are metres, and never thinner than a pixel of the finished picture (`hairline`, in pixels of the canvas).
    """

    canvas: Canvas
    camera: Camera
    hairline: float = 1.0
    x: float = 0.0
    y: float = 0.0
    direction: Point = (1.0, 0.0)

    def at(self, position: Point, direction: Point = (1.0, 0.0)) -> Brush:
        """The same brush standing at a world position, looking along a unit vector."""
        return Brush(self.canvas, self.camera, self.hairline, *position, direction)

    def pixels(self, points: Sequence[Point]) -> list[Point]:
        """Where points of the brush's frame lie on the canvas."""
        (c, s), camera = self.direction, self.camera
        return [camera.to_pixels((self.x + a * c - b * s, self.y + a * s + b * c)) for a, b in points]

    def thickness(self, width: float) -> float:
        """A width in pixels of the canvas."""
        return max(width * self.camera.scale, self.hairline)

    def disc(self, colour: Colour, centre: Point, radius: float) -> None:
        self.canvas.circle(colour, self.pixels([centre])[0], radius * self.camera.scale)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        """A circle line whose outer edge is at `radius`."""
        self.canvas.ring(colour, self.pixels([centre])[0], radius * self.camera.scale, self.thickness(width))

    def dashed_ring(self, colour: Colour, centre: Point, radius: float, width: float, dashes: int) -> None:
        """A circle line of so many dashes, gaps as long as the dashes."""
        for k in range(dashes):
            turns = [(k + part / 12) * 2 * math.pi / dashes for part in range(7)]
            r = radius - width / 2
            self.stroke(colour, [(centre[0] + r * math.cos(t), centre[1] + r * math.sin(t)) for t in turns], width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """A filled polygon, with an outline if `edge` is given."""
        self.canvas.polygon(colour, self.pixels(points), edge, self.thickness(width))

    def box(self, colour: Colour, low: Point, high: Point, edge: Colour | None = None, width: float = 0.0) -> None:
        """A rectangle along the brush's axes, from its lower right corner to its upper left one."""
        (a, b), (c, d) = low, high
        self.polygon(colour, [(a, b), (c, b), (c, d), (a, d)], edge, width)

    def ellipse(
        self, colour: Colour, centre: Point, half: Point, edge: Colour | None = None, width: float = 0.0
    ) -> None:
        """An ellipse along the brush's axes; `half` is its reach ahead and to the left."""
        pixels = max(half) * self.camera.scale / self.hairline
        corners = _ROUND[16 if pixels < 8.0 else 24 if pixels < 32.0 else 32]
        self.polygon(colour, [(centre[0] + half[0] * c, centre[1] + half[1] * s) for c, s in corners], edge, width)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """A line through points, round at ends and bends."""
        self.canvas.stroke(colour, self.pixels(points), self.thickness(width))

    def dots(self, colour: Colour, start: Point, end: Point, radius: float, spacing: float) -> None:
        """Dots from start to end, evenly spaced and about `spacing` apart."""
        (ax, ay), (bx, by) = start, end
        count = max(round(math.hypot(bx - ax, by - ay) / spacing), 1)
        for k in range(count + 1):
            self.disc(colour, (ax + (bx - ax) * k / count, ay + (by - ay) * k / count), radius)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """A polygon that lets what is below shine through; alpha 0..255."""
        self.canvas.wash(colour, alpha, self.pixels(points))

    def word(self, colour: Colour, text: str, room: float, height: float) -> None:
        """A word in the middle, upright in the picture and at most `room` wide and `height` high, m; none if tiny."""
        size = height * self.camera.scale
        size *= min(room * self.camera.scale / max(width_of(text, round(size) or 1), 1), 1.0)
        if size >= 9 * self.hairline:
            self.canvas.text(colour, text, self.pixels([(0.0, 0.0)])[0], round(size))

    def group(self, kind: str) -> AbstractContextManager[None]:
        """What is drawn within is one of a kind, where the canvas can tell so."""
        return self.canvas.group(kind)
