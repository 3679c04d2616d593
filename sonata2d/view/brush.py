"""Draws shapes given in metres on a canvas; a brush has a pose in the world and draws in that local frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.geometry import Point, Stadium
from ..core.portable_math import Array
from .canvas import Canvas
from .fonts import width_of
from .palette import Colour
from .projection import Camera

_UNIT_CIRCLE = {
    count: tuple((math.cos(k * 2 * math.pi / count), math.sin(k * 2 * math.pi / count)) for k in range(count))
    for count in (16, 24, 32)
}


Part = tuple[tuple[Any, ...], Callable[["Brush"], None], Point]
"""A drawing that can be cached: a key that starts with its kind, a function that draws it, its world direction."""


@dataclass(frozen=True, slots=True)
class Brush:
    """A pen with a pose in the world, which draws on `canvas` as `camera` sees it.

    Points are (ahead, left) of the pose, m.

    Attributes:
        hairline: the smallest width of a line, in pixels of the canvas: one pixel of the finished picture.
        x, y, direction: pose of the brush: m, and a unit vector.
        cache: draws the parts given to `stamp` instead of the brush: `SpriteCache.put` without its first argument.
    """

    canvas: Canvas
    camera: Camera
    hairline: float = 1.0
    x: float = 0.0
    y: float = 0.0
    direction: Point = (1.0, 0.0)
    cache: Callable[..., None] | None = None

    def at(self, position: Point, direction: Point = (1.0, 0.0)) -> Brush:
        """The same brush at another pose: world position, m, and unit vector."""
        return Brush(self.canvas, self.camera, self.hairline, *position, direction)

    def stamp(self, position: Point, *parts: Part, whole: bool = False) -> None:
        """Draw the parts of one object on top of each other at a world position, each in its own direction.

        Args:
            whole: whether a cache may round the position to whole pixels.
        """
        if self.cache is not None:
            self.cache(self.camera, position, *parts, whole=whole)
            return
        with self.canvas.group(parts[0][0][0]):
            for _, draw, direction in parts:
                draw(self.at(position, direction))

    def inside(self, outline: Sequence[Point]) -> AbstractContextManager[None]:
        """Clip all drawing within the context to a polygon."""
        return self.canvas.inside(self.pixels(outline))

    def pixels(self, points: Sequence[Point]) -> list[Point]:
        """Transform points from the brush's frame to pixels of the canvas."""
        (c, s), camera = self.direction, self.camera
        return [camera.to_pixels((self.x + a * c - b * s, self.y + a * s + b * c)) for a, b in points]

    def thickness(self, width: float) -> float:
        """Convert a line width from metres to pixels of the canvas."""
        return max(width * self.camera.scale, self.hairline)

    def disc(self, colour: Colour, centre: Point, radius: float) -> None:
        """Draw a filled circle."""
        self.canvas.circle(colour, self.pixels([centre])[0], radius * self.camera.scale)

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        """Draw a circle line whose outer edge is at `radius`."""
        self.canvas.ring(colour, self.pixels([centre])[0], radius * self.camera.scale, self.thickness(width))

    def body(self, colour: Colour, radius: float, shoulder: float) -> None:
        """Fill the outline of a person: all within `radius` of its shoulder line, see `Humans.shoulder`; m."""
        if shoulder != 0.0:
            self.stroke(colour, list(Stadium(radius, shoulder).core), 2 * radius)
        else:
            self.disc(colour, (0.0, 0.0), radius)

    def dashed_body(self, colour: Colour, radius: float, shoulder: float, width: float, dashes: int) -> None:
        """Draw the outline of a person, or a circle, as dashes separated by gaps of the same length."""
        for k in range(dashes):
            self.stroke(colour, body_arc(radius - width / 2, shoulder, k / dashes, (k + 0.5) / dashes, 7), width)

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """Draw a filled polygon; if `edge` is given, with an outline."""
        self.canvas.polygon(colour, self.pixels(points), edge, self.thickness(width))

    def box(self, colour: Colour, low: Point, high: Point, edge: Colour | None = None, width: float = 0.0) -> None:
        """Draw a rectangle along the brush's axes, from its rear right corner to its front left corner."""
        (a, b), (c, d) = low, high
        self.polygon(colour, [(a, b), (c, b), (c, d), (a, d)], edge, width)

    def ellipse(
        self, colour: Colour, centre: Point, semi_axes: Point, edge: Colour | None = None, width: float = 0.0
    ) -> None:
        """Draw a filled ellipse along the brush's axes; `semi_axes` are its extents ahead and to the left, m."""
        pixels = max(semi_axes) * self.camera.scale / self.hairline
        corners = _UNIT_CIRCLE[16 if pixels < 8.0 else 24 if pixels < 32.0 else 32]
        (x, y), (a, b) = centre, semi_axes
        self.polygon(colour, [(x + a * c, y + b * s) for c, s in corners], edge, width)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """Draw a line through points, with round ends and bends."""
        self.canvas.stroke(colour, self.pixels(points), self.thickness(width))

    def steps(self, colours: Sequence[Colour], starts: Array, ends: Array, width: float) -> None:
        """Draw the steps of a path, each in its own colour, with round ends; as if the brush were at the origin.

        Args:
            colours: of the K steps.
            starts, ends: (K, 2), world frame, m.
            width: m.
        """
        points = np.stack((starts, ends), axis=1)
        x, y = self.camera.to_pixels((points[..., 0], points[..., 1]))  # type: ignore[arg-type]  # of arrays
        self.canvas.steps(colours, np.stack((x, y), axis=2), self.thickness(width))

    def dots(self, colour: Colour, start: Point, end: Point, radius: float, spacing: float) -> None:
        """Draw evenly spaced dots from start to end, about `spacing` metres apart."""
        (ax, ay), (bx, by) = self.pixels([start, end])
        count = max(round(math.hypot(bx - ax, by - ay) / (spacing * self.camera.scale)), 1)
        for k in range(count + 1):
            place = ax + (bx - ax) * k / count, ay + (by - ay) * k / count
            self.canvas.circle(colour, place, radius * self.camera.scale)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """Draw a translucent polygon; alpha is 0 (invisible) to 255."""
        self.canvas.wash(colour, alpha, self.pixels(points))

    def word(self, colour: Colour, text: str, max_width: float, height: float) -> None:
        """Write upright text centred on the brush's position, unless it would be too small to read.

        Args:
            max_width, height: upper limits, m; the text is scaled down to fit.
        """
        size = height * self.camera.scale
        size *= min(max_width * self.camera.scale / max(width_of(text, round(size) or 1), 1), 1.0)
        if size >= 9 * self.hairline:
            self.canvas.text(colour, text, self.pixels([(0.0, 0.0)])[0], round(size))


def body_arc(radius: float, shoulder: float, start: float, end: float, count: int) -> list[Point]:
    """Points on the outline of a person, in its frame, m.

    Args:
        radius: half the depth of the body, m.
        shoulder: half the length of the shoulder line, m, see `Humans.shoulder`; 0 gives a circle.
        start, end: first and last point, as fractions of the outline's length from its foremost point to the left.
        count: number of points.
    """
    if shoulder < 0.0:
        return [(-y, x) for x, y in body_arc(radius, -shoulder, start, end, count)]
    half = math.pi * radius + 2 * shoulder  # the length from the foremost point to the rearmost one
    points = []
    for k in range(count):
        part = 2 * (start + (end - start) * k / (count - 1)) % 2
        angle = (min(part, 2 - part) * half - shoulder) / radius if radius > 0.0 else 0.0
        x, y = radius * math.cos(min(max(angle, 0.0), math.pi)), radius * math.sin(min(max(angle, 0.0), math.pi))
        # before and after the half circle around the shoulder, the outline is straight
        y += shoulder + min(angle, 0.0) * radius - max(angle - math.pi, 0.0) * radius
        points.append((x, y if part <= 1 else -y))
    return points
