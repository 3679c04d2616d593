"""Poses, twists, shapes and distances in the plane: metres, radians, x right, y up, theta counter-clockwise."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from .portable_math import Array, BoolArray, IntArray, unit_vector
from .vectors import X, Y, wrap_angle

PRECISION = 1e-4  # m, rad, m/s, ...: resolution of the numbers in files, and of those that worlds are built from
MAX_MAGNITUDE = 1e11  # beyond it a double no longer resolves `PRECISION`
Point = tuple[float, float]
Edge = tuple[Point, Point, float]  # a thick segment: start, end, radius; m


class HasXY(Protocol):
    """Any object with a position in the plane."""

    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...


def as_point(row: Array) -> Point:
    """The position (m) that a row of an array begins with."""
    return float(row[X]), float(row[Y])


def quantised(value: float) -> float:
    """The nearest multiple of `PRECISION`, which a file can hold; never -0.0.

    Raises:
        ValueError: the magnitude exceeds `MAX_MAGNITUDE`.
    """
    if abs(value) > MAX_MAGNITUDE:
        raise ValueError(f"{value:g} is beyond what a file holds, {MAX_MAGNITUDE:g}")  # recorded: do not reword
    return float(round(value * 10_000.0)) / 10_000.0 + 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """Position (m) and heading (rad); in the world frame unless stated otherwise."""

    x: float
    y: float
    theta: float = 0.0

    @property
    def position(self) -> Point:
        return self.x, self.y

    @property
    def direction(self) -> Point:
        """Unit vector along theta."""
        return unit_vector(self.theta)

    def to_local(self, point: HasXY | Point) -> Point:
        """Transform a point from the world frame to the body frame of this pose: (ahead, left), m.

        >>> Pose(1.0, 0.0, 0.0).to_local((3.0, 1.0))
        (2.0, 1.0)
        """
        x, y = point if isinstance(point, tuple) else (point.x, point.y)
        c, s = self.direction
        dx, dy = x - self.x, y - self.y
        return dx * c + dy * s, dy * c - dx * s

    def to_world(self, point: HasXY | Point) -> Point:
        """Transform a point (ahead, left) from the body frame of this pose to the world frame, m."""
        ahead, left = point if isinstance(point, tuple) else (point.x, point.y)
        c, s = self.direction
        return self.x + ahead * c - left * s, self.y + ahead * s + left * c

    def rounded(self) -> Pose:
        """The nearest pose that a file can hold, with theta in (-3.1416, 3.1416]."""
        return Pose(quantised(self.x), quantised(self.y), canonical_angle(self.theta))


def canonical_angle(theta: float) -> float:
    """The equivalent angle as files hold it: a multiple of `PRECISION` in (-3.1416, 3.1416], rad."""
    angle = quantised(wrap_angle(theta))
    return 3.1416 if angle <= -3.1416 else angle


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity in the body frame: vx forward and vy left in m/s, omega counter-clockwise in rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    omega: float = 0.0

    def rounded(self) -> Twist:
        """The nearest twist that a file can hold."""
        return Twist(quantised(self.vx), quantised(self.vy), quantised(self.omega))


@dataclass(frozen=True, slots=True)
class Disc:
    """A circular outline of `radius` metres."""

    radius: float

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle around the centre that contains the shape, m."""
        return self.radius

    def edges(self, pose: Pose) -> list[Edge]:
        """The outline at a pose as one thick segment of zero length."""
        return [(pose.position, pose.position, self.radius)]


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangular outline: `length` along the body's x axis, `width` along its y axis, m."""

    length: float
    width: float

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle around the centre that contains the shape, m."""
        return math.sqrt(self.length * self.length + self.width * self.width) / 2

    def corners(self, pose: Pose) -> list[Point]:
        """The four corners at a pose, counter-clockwise, world frame."""
        a, b, x, y = self.length / 2, self.width / 2, pose.x, pose.y
        c, s = pose.direction
        corners = ((a, b), (-a, b), (-a, -b), (a, -b))
        return [(x + ahead * c - left * s, y + ahead * s + left * c) for ahead, left in corners]

    def edges(self, pose: Pose) -> list[Edge]:
        """The outline at a pose as four segments of zero radius."""
        corners = self.corners(pose)
        return [(a, b, 0.0) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]


Shape = Disc | Rectangle


_START, _END, _RADIUS, _ALONG, _INVERSE = slice(0, 2), slice(2, 4), 4, slice(5, 7), 7  # columns of `Barriers.table`


@dataclass(frozen=True)
class Barriers:
    """Solid obstacles as M thick segments: walls, edges of furniture, and discs (segments of zero length).

    Attributes:
        start, end: (M, 2), ends of the segments' core lines, m.
        radius: (M,), half the thickness, m.
    """

    start: Array
    end: Array
    radius: Array

    @classmethod
    def of(cls, edges: Iterable[Edge]) -> Barriers:
        """Barriers from thick segments; the arrays are read-only."""
        rows = [(*a, *b, r, 0.0, 0.0, 0.0) for a, b, r in edges]
        return cls._of_table(_completed(np.array(rows, dtype=float).reshape(-1, 8)))

    @classmethod
    def _of_table(cls, table: Array) -> Barriers:
        """Barriers whose `table` is given."""
        barriers = cls(table[:, _START], table[:, _END], table[:, _RADIUS])
        barriers.__dict__["table"] = table  # not to be computed again
        return barriers

    def __len__(self) -> int:
        return len(self.radius)

    def joined(self, other: Barriers) -> Barriers:
        """These barriers followed by the other ones."""
        if not len(other):
            return self
        table = np.concatenate((self.table, other.table))
        table.flags.writeable = False
        return Barriers._of_table(table)

    def subset(self, chosen: BoolArray | IntArray | list[int]) -> Barriers:
        """The barriers that an (M,) mask or an array of indices selects."""
        return Barriers(self.start[chosen], self.end[chosen], self.radius[chosen])

    @cached_property
    def table(self) -> Array:
        """All numbers of the barriers for kernels, (M, 8), read-only; columns as in `core.scalar`."""
        table = np.zeros((len(self), 8))
        table[:, _START], table[:, _END], table[:, _RADIUS] = self.start, self.end, self.radius
        return _completed(table)

    def towards(self, points: Array) -> tuple[Array, Array]:
        """Vectors from points to the nearest point on each segment's core line.

        Args:
            points: (N, 2), m.

        Returns:
            x and y components, (M, N) each, m; row m belongs to segment m.
        """
        start, along, inverse = self.table[:, _START, None], self.table[:, _ALONG, None], self.table[:, _INVERSE, None]
        px, py = points[:, X] - start[:, X], points[:, Y] - start[:, Y]
        dx, dy = along[:, X], along[:, Y]
        t = np.minimum(np.maximum((px * dx + py * dy) * inverse, 0.0), 1.0)
        return t * dx - px, t * dy - py

    def gaps(self, points: Array) -> Array:
        """Distance from points to the surface of each thick segment; (N, 2) to (M, N), m, negative inside."""
        x, y = self.towards(points)
        gaps: Array = np.sqrt(x * x + y * y) - self.radius[:, None]
        return gaps


def _completed(table: Array) -> Array:
    """A `Barriers.table` whose last columns, which are zeros, are filled from the other ones; read-only."""
    if len(table):
        along = np.subtract(table[:, _END], table[:, _START], out=table[:, _ALONG])
        square = along[:, X] * along[:, X] + along[:, Y] * along[:, Y]
        np.divide(1.0, square, out=table[:, _INVERSE], where=square > 0.0)
    table.flags.writeable = False
    return table


def segment_distances(start: Array, end: Array, barriers: Barriers) -> Array:
    """Gap between straight lines and each thick segment.

    Args:
        start, end: (N, 2), ends of the straight lines, m.
        barriers: M thick segments.

    Returns:
        (M, N), m; minus the segment's radius where its core line is crossed.
    """
    lines = Barriers(start, end, np.zeros(len(start)))
    # Unless two segments cross, they are nearest at an end of one of them.
    nearest = np.minimum(barriers.gaps(start), barriers.gaps(end))
    for ends in (barriers.start, barriers.end):
        nearest = np.minimum(nearest, lines.gaps(ends).T - barriers.radius[:, None])
    return np.where(segments_cross(start, end, barriers), -barriers.radius[:, None], nearest)


def segments_cross(start: Array, end: Array, barriers: Barriers) -> BoolArray:
    """Whether straight lines properly cross the core lines of thick segments.

    Args:
        start, end: (N, 2), ends of the straight lines, m.
        barriers: M thick segments.

    Returns:
        (M, N) of bool; False where a line only touches or is collinear.
    """
    a, d = barriers.start[:, None, :], (barriers.end - barriers.start)[:, None, :]
    p, w = start[None, :, :], (end - start)[None, :, :]

    def side(of: Any, along: Any, base: Any) -> Any:
        return along[..., X] * (of[..., Y] - base[..., Y]) - along[..., Y] * (of[..., X] - base[..., X])

    q, b = end[None, :, :], barriers.end[:, None, :]
    crossed: Any = (side(p, d, a) * side(q, d, a) < 0.0) & (side(a, w, p) * side(b, w, p) < 0.0)
    return np.asarray(crossed)


def inside_polygon(points: Array, polygon: Array) -> BoolArray:
    """Whether points lie in a simple polygon (even-odd rule); (N, 2) and (K, 2) to (N,) of bool."""
    a, b = polygon, np.concatenate((polygon[1:], polygon[:1]))
    x, y = points[:, X, None], points[:, Y, None]
    straddles = (a[:, Y] > y) != (b[:, Y] > y)
    rise = np.where(b[:, Y] == a[:, Y], 1.0, b[:, Y] - a[:, Y])
    crossing = a[:, X] + (y - a[:, Y]) * (b[:, X] - a[:, X]) / rise
    is_odd: BoolArray = np.count_nonzero(straddles & (x < crossing), axis=1) % 2 == 1
    return is_odd
