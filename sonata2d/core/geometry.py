"""Poses, twists, shapes and distances in the plane: metres, radians, x right, y up, theta counter-clockwise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from .bounds import MAX_MAGNITUDE, Number, Positive
from .floats import make_floats
from .portable_math import Array, BoolArray, IntArray, angle_of, unit_vector
from .vectors import X, Y, length, lengths, wrap_angle

PRECISION = 1e-4  # m, rad, m/s, ...: resolution of the numbers in files, and of those that worlds are built from
Point = tuple[Number, Number]
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
    """Position and heading, in the world frame unless stated otherwise.

    Attributes:
        x: to the right, m.
        y: up, m.
        theta: counter-clockwise from x, rad.
    """

    x: Number
    y: Number
    theta: Number = 0.0

    def __post_init__(self) -> None:
        if not type(self.x) is type(self.y) is type(self.theta) is float:
            make_floats(self)

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
        dx, dy = float(x) - self.x, float(y) - self.y
        return dx * c + dy * s, dy * c - dx * s

    def to_world(self, point: HasXY | Point) -> Point:
        """Transform a point (ahead, left) from the body frame of this pose to the world frame, m."""
        ahead, left = point if isinstance(point, tuple) else (point.x, point.y)
        c, s = self.direction
        ahead, left = float(ahead), float(left)
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


class Outline:
    """Base class of outlines: all points within `rounding` of a convex polygon, the core.

    Attributes:
        core: corners of the core in the body frame, counter-clockwise, m; one point for a disc, two for a stadium.
        rounding: m.
    """

    __slots__ = ()

    @property
    def core(self) -> tuple[Point, ...]:
        raise NotImplementedError

    @property
    def rounding(self) -> float:
        return 0.0

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle around the centre that contains the shape, m."""
        return max(math.sqrt(x * x + y * y) for x, y in self.core) + self.rounding

    @property
    def inradius(self) -> float:
        """Radius of the largest circle around the centre within the shape, m; 0 if the centre lies outside."""
        core = self.core
        if len(core) < 3:  # the centre lies on the core
            return self.rounding
        sides = zip(core, (*core[1:], core[0]), strict=True)
        depths = [(a[X] * b[Y] - a[Y] * b[X]) / length(b[X] - a[X], b[Y] - a[Y]) for a, b in sides]
        return max(min(depths), 0.0) + self.rounding

    @property
    def sides(self) -> tuple[float, float]:
        """Length and width of the rectangle around the shape, along and across the heading, m."""
        ahead, left = ([point[axis] for point in self.core] for axis in (X, Y))
        return max(ahead) - min(ahead) + 2.0 * self.rounding, max(left) - min(left) + 2.0 * self.rounding

    def corners(self, pose: Pose) -> list[Point]:
        """The corners of the core at a pose, counter-clockwise, world frame."""
        c, s = pose.direction
        return [(pose.x + ahead * c - left * s, pose.y + ahead * s + left * c) for ahead, left in self.core]

    def edges(self, pose: Pose) -> list[Edge]:
        """The outline at a pose as thick segments: its sides; one segment for a disc and for a stadium."""
        corners = self.corners(pose)
        if len(corners) < 3:
            return [(corners[0], corners[-1], self.rounding)]
        return [(a, b, self.rounding) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]


@dataclass(frozen=True, slots=True)
class Disc(Outline):
    """A circular outline.

    Attributes:
        radius: m.
    """

    radius: Positive

    @property
    def core(self) -> tuple[Point, ...]:
        return ((0.0, 0.0),)

    @property
    def rounding(self) -> float:
        return self.radius

    def corners(self, pose: Pose) -> list[Point]:
        return [pose.position]


@dataclass(frozen=True, slots=True)
class Rectangle(Outline):
    """A rectangular outline, centred at the pose of the body.

    Attributes:
        length: along the body's x axis, m.
        width: along the body's y axis, m.
    """

    length: Positive
    width: Positive

    @property
    def core(self) -> tuple[Point, ...]:
        a, b = self.length / 2, self.width / 2
        return (a, b), (-a, b), (-a, -b), (a, -b)

    @property
    def sides(self) -> tuple[float, float]:
        return self.length, self.width

    @property
    def inradius(self) -> float:
        return min(self.length, self.width) / 2

    @property
    def circumradius(self) -> float:
        return math.sqrt(self.length * self.length + self.width * self.width) / 2


@dataclass(frozen=True, slots=True)
class Stadium(Outline):
    """The outline of a person: all points within `radius` of a line through its centre; m.

    Attributes:
        shoulder: half the length of the line, m, across the heading; negative: along the heading; 0 gives a disc.
    """

    radius: float
    shoulder: float

    @property
    def core(self) -> tuple[Point, ...]:
        if self.shoulder < 0.0:
            return (self.shoulder, 0.0), (-self.shoulder, 0.0)
        return (0.0, self.shoulder), (0.0, -self.shoulder)

    @property
    def rounding(self) -> float:
        return self.radius

    @property
    def circumradius(self) -> float:
        return self.radius + abs(self.shoulder)


@dataclass(frozen=True, slots=True)
class Polygon(Outline):
    """A convex polygon; the pose of the body is the origin of the corners' coordinates.

    Clockwise corners, crossing sides and a shape that is not convex raise a ValueError.

    Attributes:
        points: the corners in the body frame, counter-clockwise, m; 3 to 16.
    """

    points: tuple[Point, ...]

    def __post_init__(self) -> None:
        make_floats(self)
        checked_corners(self.points)

    @property
    def core(self) -> tuple[Point, ...]:
        return self.points


MOST_CORNERS = 16


def checked_corners(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The corners of a `Polygon` as given.

    Raises:
        ValueError: as `Polygon`.
    """
    fault = _fault_of(corners)
    if fault:
        raise ValueError(f"{fault}; give 3 to {MOST_CORNERS} corners of a convex polygon, counter-clockwise")
    return corners


def _fault_of(corners: tuple[Point, ...]) -> str:
    """The reason why points are not the corners of a convex polygon in counter-clockwise order; empty if they are."""
    count = len(corners)
    if not 3 <= count <= MOST_CORNERS:
        return f"the polygon has {count} corners"
    turned = 0.0
    for k, (bx, by) in enumerate(corners):
        (ax, ay), (cx, cy) = corners[k - 1], corners[(k + 1) % count]
        ux, uy, vx, vy = bx - ax, by - ay, cx - bx, cy - by
        cross = ux * vy - uy * vx
        if cross <= 1e-9 * max(1.0, (ux * ux + uy * uy) + (vx * vx + vy * vy)):
            return f"the polygon does not turn left at its corner ({bx:g}, {by:g})"
        turned += angle_of(cross, ux * vx + uy * vy)
    return "" if turned < 7.0 else "the sides of the polygon cross"


Shape = Disc | Rectangle | Polygon  # of furniture and robots


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


def shoulder_lines(position: Array, direction: Array, shoulder: Array | float) -> tuple[Array, Array]:
    """The lines from which the outlines of people extend by their radius; see `Stadium`.

    Args:
        position: (..., 2), m.
        direction: (..., 2), unit vectors of the headings.
        shoulder: (...), half the length of the lines, m; see `Humans.shoulder`.

    Returns:
        Left ends and right ends, (..., 2) each, m; of lines along the heading, rear ends and front ends.
    """
    direction, half = _across(direction, shoulder)
    left = np.stack((-direction[..., Y] * half, direction[..., X] * half), axis=-1)
    return position + left, position - left


def to_shoulder_line(offset: Array, direction: Array, shoulder: Array | float) -> Array:
    """Vectors from points to the nearest points on shoulder lines, (..., 2), m; the offset itself for a disc.

    Args:
        offset: (..., 2), m, from the points to the middles of the lines.
        direction: (..., 2), unit vectors of the headings.
        shoulder: (...), half the length of the lines, m; see `Humans.shoulder`.
    """
    direction, half = _across(direction, shoulder)
    bx, by = direction[..., X], direction[..., Y]
    along = np.clip(bx * offset[..., Y] - by * offset[..., X], -half, half)
    return np.stack((offset[..., X] + along * by, offset[..., Y] - along * bx), axis=-1)


def _across(direction: Array, shoulder: Array | float) -> tuple[Array, Array]:
    """Unit vectors across shoulder lines, (..., 2), and half the length of the lines, (...), m."""
    half = np.asarray(shoulder)
    if not (half < 0.0).any():
        return direction, half
    turned = np.stack((-direction[..., Y], direction[..., X]), axis=-1)
    return np.where((half < 0.0)[..., None], turned, direction), np.abs(half)


def shoulder_line_distances(
    offset: Array, direction: Array, shoulder: Array | float, other_direction: Array, other_shoulder: Array | float
) -> Array:
    """Distances between the shoulder lines of pairs of people, (...), m; 0 where they cross.

    Args:
        offset: (..., 2), m, from the middle of the first line to the middle of the other one.
        direction, other_direction: (..., 2), unit vectors of the headings.
        shoulder, other_shoulder: (...), half the length of the lines, m; see `Humans.shoulder`.
    """
    direction, shoulder = _across(direction, shoulder)
    other_direction, other_shoulder = _across(other_direction, other_shoulder)
    ends = shoulder_lines(np.zeros_like(offset), direction, shoulder)
    other_ends = shoulder_lines(offset, other_direction, other_shoulder)
    # Unless two segments cross, they are nearest at an end of one of them.
    nearest = [lengths(to_shoulder_line(offset - end, other_direction, other_shoulder)) for end in ends]
    nearest += [lengths(to_shoulder_line(-end, direction, shoulder)) for end in other_ends]
    ahead = [(end * direction).sum(axis=-1) for end in other_ends]
    other_ahead = [((end - offset) * other_direction).sum(axis=-1) for end in ends]
    crosses = (ahead[0] * ahead[1] < 0.0) & (other_ahead[0] * other_ahead[1] < 0.0)
    return np.where(crosses, 0.0, np.minimum.reduce(nearest))


def contact_times(
    offset: Array, relative_velocity: Array, radii: Array | float, direction: Array, shoulder: Array | float
) -> Array:
    """Times until discs touch the outlines of people, at constant velocities and headings.

    Args:
        offset: (..., 2), m, from the centre of the disc to the middle of the person's shoulder line; NaN gives inf.
        relative_velocity: (..., 2), m/s, velocity of the disc minus velocity of the person.
        radii: (...), m, sum of both radii.
        direction: (..., 2), unit vectors of the people's headings.
        shoulder: (...), half the length of the shoulder lines, m; see `Humans.shoulder`.

    Returns:
        (...), s; 0 where they overlap, infinite where they never touch.

    Source: the outline widened by the disc's radius consists of two discs around the ends of the shoulder line, for
    which see `disc_contact_times`, and of a rectangle between them.
    """
    direction, half = _across(direction, shoulder)
    left, right = shoulder_lines(offset, direction, half)
    times = np.minimum(
        disc_contact_times(left, relative_velocity, radii), disc_contact_times(right, relative_velocity, radii)
    )
    bx, by = direction[..., X], direction[..., Y]
    vx, vy = relative_velocity[..., X], relative_velocity[..., Y]
    ahead, aside = offset[..., X] * bx + offset[..., Y] * by, offset[..., Y] * bx - offset[..., X] * by
    speed, sideways = vx * bx + vy * by, vy * bx - vx * by
    closes = (ahead * speed > 1e-9) & (np.abs(ahead) > radii)  # slower ones would take years, or overflow
    time = (np.abs(ahead) - radii) / np.where(closes, np.abs(speed), 1.0)
    meets = closes & (np.abs(aside - sideways * time) < half)
    is_inside = (np.abs(ahead) <= radii) & (np.abs(aside) < half)
    return np.where(is_inside, 0.0, np.where(meets, np.minimum(time, times), times))


def disc_contact_times(offset: Array, relative_velocity: Array, radii: Array | float) -> Array:
    """Times until pairs of discs touch, at constant velocities.

    Args:
        offset: (..., 2), m, C, from the centre of the first disc to the centre of the second; NaN gives inf.
        relative_velocity: (..., 2), m/s, V, velocity of the first disc minus velocity of the second.
        radii: (...), m, R, sum of the two radii.

    Returns:
        (...), s; 0 where they overlap, infinite where they never touch.

    Source: the smaller root of |C - V t| = R.
    """
    approach = (offset * relative_velocity).sum(axis=-1)
    squared_speed = (relative_velocity * relative_velocity).sum(axis=-1)
    excess = (offset * offset).sum(axis=-1) - np.square(radii)
    discriminant = approach * approach - squared_speed * excess
    meets = (approach > 0.0) & (discriminant > 0.0)
    time = (approach - np.sqrt(np.where(meets, discriminant, 0.0))) / np.where(meets, squared_speed, 1.0)
    return np.where(excess <= 0.0, 0.0, np.where(meets, time, np.inf))


def polygon_area(polygon: Sequence[Point]) -> float:
    """Area of a simple polygon, m²."""
    following = (*polygon[1:], *polygon[:1])
    doubled: float = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(polygon, following, strict=True))
    return abs(doubled) / 2.0


def inside_rings(points: Array, polygon: Sequence[Point], holes: Iterable[Sequence[Point]]) -> BoolArray:
    """Whether points lie in a polygon and in none of its holes; (N, 2) to (N,) of bool."""
    inside = inside_polygon(points, np.array(polygon, dtype=float))
    for hole in holes:
        inside &= ~inside_polygon(points, np.array(hole, dtype=float))
    return inside


def inside_polygon(points: Array, polygon: Array) -> BoolArray:
    """Whether points lie in a simple polygon (even-odd rule); (N, 2) and (K, 2) to (N,) of bool."""
    a, b = polygon, np.concatenate((polygon[1:], polygon[:1]))
    x, y = points[:, X, None], points[:, Y, None]
    straddles = (a[:, Y] > y) != (b[:, Y] > y)
    rise = np.where(b[:, Y] == a[:, Y], 1.0, b[:, Y] - a[:, Y])
    crossing = a[:, X] + (y - a[:, Y]) * (b[:, X] - a[:, X]) / rise
    is_odd: BoolArray = np.count_nonzero(straddles & (x < crossing), axis=1) % 2 == 1
    return is_odd
