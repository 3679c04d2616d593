"""Poses, twists, angles, shapes and distances in the plane: metres, radians, x right, y up, theta counter-clockwise."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from .portable_math import Array, unit_vector
from .vectors import wrap_angle

PRECISION = 1e-4  # m, rad, m/s …: what files hold and what worlds are built from
LARGEST = 1e11  # beyond it the precision is lost in a double
Point = tuple[float, float]


class HasXY(Protocol):
    """Anything with a place in the plane."""

    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...


def quantised(value: float) -> float:
    """The nearest multiple of `PRECISION`, without -0.0; what a file can hold.

    Raises:
        ValueError: the size is beyond `LARGEST`.
    """
    if abs(value) > LARGEST:
        raise ValueError(f"{value:g} is beyond what a file holds, {LARGEST:g}")
    return float(round(value * 10_000.0)) / 10_000.0 + 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """A place and a direction, world frame unless said: metres, metres, radians."""

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
        """(ahead, left) of a world point, seen from this pose.

        >>> Pose(1.0, 0.0, 0.0).to_local((3.0, 1.0))
        (2.0, 1.0)
        """
        x, y = point if isinstance(point, tuple) else (point.x, point.y)
        c, s = self.direction
        dx, dy = x - self.x, y - self.y
        return dx * c + dy * s, dy * c - dx * s

    def to_world(self, point: HasXY | Point) -> Point:
        """World coordinates of a point given as (ahead, left) of this pose; the inverse of `to_local`."""
        ahead, left = point if isinstance(point, tuple) else (point.x, point.y)
        c, s = self.direction
        return self.x + ahead * c - left * s, self.y + ahead * s + left * c

    def rounded(self) -> Pose:
        """The nearest pose that a file can hold, theta in (-3.1416, 3.1416]."""
        return Pose(quantised(self.x), quantised(self.y), canonical_angle(self.theta))


def canonical_angle(theta: float) -> float:
    """An angle as files hold it: a multiple of `PRECISION` in (-3.1416, 3.1416]."""
    angle = quantised(wrap_angle(theta))
    return 3.1416 if angle <= -3.1416 else angle


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity in the body frame: ahead (m/s), left (m/s), counter-clockwise (rad/s)."""

    vx: float = 0.0
    vy: float = 0.0
    omega: float = 0.0

    def rounded(self) -> Twist:
        """The nearest twist that a file can hold."""
        return Twist(quantised(self.vx), quantised(self.vy), quantised(self.omega))


@dataclass(frozen=True, slots=True)
class Disc:
    """A round outline of `radius` metres."""

    radius: float

    @property
    def reach(self) -> float:
        """Radius of the smallest circle round the centre that holds the shape, m."""
        return self.radius

    def edges(self, pose: Pose) -> list[tuple[Point, Point, float]]:
        """The outline as thick segments (start, end, radius)."""
        return [(pose.position, pose.position, self.radius)]


@dataclass(frozen=True, slots=True)
class Rectangle:
    """An oblong outline: `length` along the body's x, `width` along its y, m."""

    length: float
    width: float

    @property
    def reach(self) -> float:
        return math.sqrt(self.length * self.length + self.width * self.width) / 2

    def corners(self, pose: Pose) -> list[Point]:
        """The four corners, counter-clockwise, world frame."""
        a, b = self.length / 2, self.width / 2
        return [pose.to_world(corner) for corner in ((a, b), (-a, b), (-a, -b), (a, -b))]

    def edges(self, pose: Pose) -> list[tuple[Point, Point, float]]:
        """The outline as thin segments (start, end, 0)."""
        corners = self.corners(pose)
        return [(a, b, 0.0) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]


Shape = Disc | Rectangle


@dataclass(frozen=True)
class Barriers:
    """Solid things as M thick segments: walls, edges of furniture, and discs (segments of no length)."""

    start: Array  # (M, 2)
    end: Array  # (M, 2)
    radius: Array  # (M,)

    @classmethod
    def of(cls, edges: Iterable[tuple[Point, Point, float]]) -> Barriers:
        rows = list(edges)
        flat = np.array([[*a, *b, r] for a, b, r in rows], dtype=float).reshape(-1, 5)
        parts = flat[:, 0:2].copy(), flat[:, 2:4].copy(), flat[:, 4].copy()
        for part in parts:
            part.flags.writeable = False
        return cls(*parts)

    def __len__(self) -> int:
        return len(self.radius)

    def joined(self, other: Barriers) -> Barriers:
        """These and, after them, the other's."""
        parts = ((self.start, other.start), (self.end, other.end), (self.radius, other.radius))
        return Barriers(*(np.concatenate(pair) for pair in parts))

    def subset(self, chosen: Any) -> Barriers:
        """Those chosen by an (M,) mask or by indices."""
        return Barriers(self.start[chosen], self.end[chosen], self.radius[chosen])

    @cached_property
    def _along(self) -> tuple[Array, Array]:
        """(M, 2) start to end, and (M,) one over its squared length (0 for a disc)."""
        d = self.end - self.start
        square = d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]
        return d, np.where(square > 0.0, 1.0 / np.where(square > 0.0, square, 1.0), 0.0)

    def towards(self, points: Array) -> tuple[Array, Array]:
        """Vectors from points to the nearest point of each segment's core line.

        Args:
            points: (N, 2), m.

        Returns:
            x and y components, (M, N) each, m; one row a segment.
        """
        d, inverse = self._along
        px = points[:, 0] - self.start[:, 0, None]
        py = points[:, 1] - self.start[:, 1, None]
        dx, dy = d[:, 0, None], d[:, 1, None]
        t = np.minimum(np.maximum((px * dx + py * dy) * inverse[:, None], 0.0), 1.0)
        return t * dx - px, t * dy - py

    def gaps(self, points: Array) -> Array:
        """Distance from points to the surface of each thick segment; (N, 2) to (M, N), m, negative inside."""
        x, y = self.towards(points)
        gaps: Array = np.sqrt(x * x + y * y) - self.radius[:, None]
        return gaps


def segment_distances(start: Array, end: Array, barriers: Barriers) -> Array:
    """Gap between the straight ways start-end and each thick segment.

    Args:
        start: (N, 2), m.
        end: (N, 2), m.
        barriers: M thick segments.

    Returns:
        (M, N), m; minus the radius where they cross.
    """
    ways = Barriers(start, end, np.zeros(len(start)))
    nearest = np.minimum(barriers.gaps(start), barriers.gaps(end))
    for ends in (barriers.start, barriers.end):
        nearest = np.minimum(nearest, ways.gaps(ends).T - barriers.radius[:, None])
    return np.where(segments_cross(start, end, barriers), -barriers.radius[:, None], nearest)


def segments_cross(start: Array, end: Array, barriers: Barriers) -> Array:
    """Whether the straight ways start-end properly cross the core lines of thick segments; (M, N) of bool."""
    a, d = barriers.start[:, None, :], (barriers.end - barriers.start)[:, None, :]
    p, w = start[None, :, :], (end - start)[None, :, :]

    def side(of: Any, along: Any, base: Any) -> Any:
        return along[..., 0] * (of[..., 1] - base[..., 1]) - along[..., 1] * (of[..., 0] - base[..., 0])

    q, b = end[None, :, :], barriers.end[:, None, :]
    crossed: Any = (side(p, d, a) * side(q, d, a) < 0.0) & (side(a, w, p) * side(b, w, p) < 0.0)
    return np.asarray(crossed)


def inside_polygon(points: Array, polygon: Array) -> Any:
    """Whether points lie in a simple polygon (even-odd rule); (N, 2) and (K, 2) to (N,) of bool."""
    return inside_edges(points, polygon, np.concatenate((polygon[1:], polygon[:1])))


def inside_edges(points: Array, a: Array, b: Array) -> Any:
    """Whether points lie within closed lines, given as edges from a to b, (K, 2) each, and outside their holes."""
    x, y = points[:, 0, None], points[:, 1, None]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return np.count_nonzero(straddles & (x < crossing), axis=1) % 2 == 1


def shape_gap(shape: Shape, pose: Pose, other: Shape, other_pose: Pose) -> float:
    """Gap between two outlines, m; 0 where they touch or overlap."""
    dx, dy = pose.x - other_pose.x, pose.y - other_pose.y
    apart = math.sqrt(dx * dx + dy * dy)
    if isinstance(shape, Disc) and isinstance(other, Disc):
        return max(apart - shape.radius - other.radius, 0.0)
    if _holds(shape, pose, other_pose.position) or _holds(other, other_pose, pose.position):
        return 0.0
    edges, barriers = shape.edges(pose), Barriers.of(other.edges(other_pose))
    start, end = (np.array([edge[k] for edge in edges], dtype=float) for k in (0, 1))
    gaps = segment_distances(start, end, barriers)
    return max(float(gaps.min()) - edges[0][2], 0.0)


def _holds(shape: Shape, pose: Pose, point: Point) -> bool:
    """Whether a point lies within the shape."""
    ahead, left = pose.to_local(point)
    if isinstance(shape, Disc):
        return ahead * ahead + left * left <= shape.radius * shape.radius
    return abs(ahead) <= shape.length / 2 and abs(left) <= shape.width / 2
