"""Floor plans: one function per room kind draws the outline and the inner walls, centred at the origin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.entities import Wall
from ..core.geometry import (
    Barriers,
    Disc,
    Point,
    Pose,
    Rectangle,
    Shape,
    inside_polygon,
    quantised,
    segment_distances,
    segments_cross,
)
from ..core.portable_math import Array
from ..core.rng import RandomStream
from ..registry import ROOM_KINDS
from .scenario.rooms import RoomConfig


@dataclass(frozen=True)
class FloorPlan:
    """A room without anything in it: its kind, its outline counter-clockwise, its inner walls."""

    kind: str
    polygon: tuple[Point, ...]
    inner: tuple[Wall, ...] = ()

    @cached_property
    def walls(self) -> tuple[Wall, ...]:
        """All of them, the outline's edges first."""
        following = (*self.polygon[1:], self.polygon[0])
        return tuple(Wall(a, b) for a, b in zip(self.polygon, following, strict=True)) + self.inner

    @cached_property
    def barriers(self) -> Barriers:
        """The walls as thick segments."""
        return Barriers.of((wall.start, wall.end, 0.0) for wall in self.walls)

    @cached_property
    def outline(self) -> Array:
        """The polygon as (K, 2)."""
        return np.array(self.polygon, dtype=float)

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """Smallest and largest x, smallest and largest y."""
        xs, ys = zip(*self.polygon, strict=True)
        return min(xs), max(xs), min(ys), max(ys)

    @property
    def size(self) -> str:
        """For messages: `4.0 m`, or `9.0 x 6.0 m`."""
        left, right, bottom, top = self.box
        return f"{right - left:.1f} m" if self.kind == "square" else f"{right - left:.1f} x {top - bottom:.1f} m"

    def sample(self, rng: RandomStream) -> Point:
        """A place in the box round the room, all alike."""
        left, right, bottom, top = self.box
        return rng.uniform(left, right), rng.uniform(bottom, top)

    def holds(self, shape: Shape, pose: Pose, gap: float) -> bool:
        """Whether an outline lies in the room, at least `gap` (m, above 0) from every wall."""
        inner = shape.radius if isinstance(shape, Disc) else min(shape.length, shape.width) / 2
        centre = np.array([pose.position], dtype=float)
        if self.barriers.gaps(centre).min() < inner + gap or not inside_polygon(centre, self.outline)[0]:
            return False
        return isinstance(shape, Disc) or bool(segment_distances(*_sides(shape, pose), self.barriers).min() >= gap)

    def contains(self, shape: Shape, pose: Pose) -> bool:
        """Whether an outline lies in the room; it may touch walls."""
        inside = bool(inside_polygon(np.array([pose.position], dtype=float), self.outline)[0])
        return inside and not (
            isinstance(shape, Rectangle) and segments_cross(*_sides(shape, pose), self.barriers).any()
        )

    def flipped(self) -> FloorPlan:
        """Its mirror image, left for right: y changes its sign."""
        corners = tuple((x, 0.0 - y) for x, y in self.polygon[::-1])
        inner = (Wall((w.start[0], 0.0 - w.start[1]), (w.end[0], 0.0 - w.end[1])) for w in self.inner)
        return FloorPlan(self.kind, corners, tuple(inner))

    def is_in_sight(self, place: Pose, other: Pose) -> bool:
        """Whether no wall stands between two places."""
        start, end = (np.array([pose.position], dtype=float) for pose in (place, other))
        return not segments_cross(start, end, self.barriers).any()


def _sides(shape: Rectangle, pose: Pose) -> tuple[Array, Array]:
    """The sides of an oblong, from (4, 2) to (4, 2)."""
    corners = np.array(shape.corners(pose), dtype=float)
    return corners, np.concatenate((corners[1:], corners[:1]))


_BESIDE = 0.3  # m, of wall that stays on either side of a doorway

Corners = tuple[Point, ...]
Walls = tuple[tuple[Point, Point], ...]


@dataclass(frozen=True, slots=True)
class RoomKind:
    """A kind of room.

    Attributes:
        draw: from the settings and the scene's random stream to the corners of the outline, in order, and the inner
            walls as pairs of end points; m, centred at the origin. All randomness comes from the stream.
        turned: whether a scene may turn the plan by quarters of a circle (`RoomConfig.turns`).
    """

    draw: Callable[[RoomConfig, RandomStream], tuple[Corners, Walls]]
    turned: bool = True


def room_kind(name: str) -> RoomKind:
    """The room kind of a name.

    Raises:
        Sonata2dError: there is no such kind, or the plug-in that provides it does not load.
    """
    kind: RoomKind = ROOM_KINDS.load(name, _problem)
    return kind


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a room kind."""
    return None if isinstance(found, RoomKind) else "is no RoomKind; it must be sonata2d.scenegen.RoomKind(draw)"


def draw_plan(config: RoomConfig, rng: RandomStream) -> FloorPlan:
    """One of the kinds of room, or the given one."""
    given = tuple(Wall(_rounded((x1, y1)), _rounded((x2, y2))) for x1, y1, x2, y2 in config.walls)
    if config.polygon is not None:
        return FloorPlan("given", _counter_clockwise(config.polygon), given)
    name = rng.choice(list(config.kinds), list(config.kinds.values()))
    kind = room_kind(name)
    corners, walls = kind.draw(config, rng)
    quarters = config.turns.draw(rng) if kind.turned else 0
    inner = tuple(Wall(_rounded(_turned(a, quarters)), _rounded(_turned(b, quarters))) for a, b in walls)
    return FloorPlan(name, _counter_clockwise(tuple(_turned(corner, quarters) for corner in corners)), inner + given)


def _square(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    side = config.side.draw(rng)
    return _oblong(side, side), ()


def _rectangle(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    breadth = config.breadth.draw(rng)
    return _oblong(config.length.at_least(breadth).draw(rng), breadth), ()


def _l(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    """An L in a square of three units."""
    u = config.unit.draw(rng)
    a, b = 1.5 * u, 0.5 * u
    return ((-a, -b), (b, -b), (b, -a), (a, -a), (a, a), (-a, a)), ()


def _t(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    """A T: the bar on top, the stem from its middle down."""
    x, y, arm = config.span.draw(rng) / 2, config.depth.draw(rng) / 2, config.arm.draw(rng)
    low, s = y - arm, arm / 2
    return ((-s, -y), (s, -y), (s, low), (x, low), (x, y), (-x, y), (-x, low), (-s, low)), ()


def _u(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    """A U: the bar below, an arm up from either end."""
    x, y, arm = config.span.draw(rng) / 2, config.depth.draw(rng) / 2, config.arm.draw(rng)
    s, low = x - arm, arm - y
    return ((-x, -y), (x, -y), (x, y), (s, y), (s, low), (-s, low), (-s, y), (-x, y)), ()


def _corridor(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    return _oblong(config.corridor_length.draw(rng), config.corridor_width.draw(rng)), ()


def _crossing(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    """A corridor along x and one along y, which cross in their middles."""
    x, y = config.corridor_length.draw(rng) / 2, config.corridor_length.draw(rng) / 2
    a, b = config.corridor_width.draw(rng) / 2, config.corridor_width.draw(rng) / 2  # of y's, of x's
    right = ((a, -y), (a, -b), (x, -b), (x, b), (a, b), (a, y))
    return right + tuple((-p, q) for p, q in right[::-1]), ()


def _doorway(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    """Two rooms side by side, and a wall between them with a doorway."""
    left, right, breadth = (config.chamber.draw(rng) for _ in range(3))
    half, wall = config.door.draw(rng) / 2, (left - right) / 2
    most = max(breadth / 2 - half - _BESIDE, 0.0)
    middle = min(max(config.door_offset.draw(rng), -most), most)
    inner = (((wall, -breadth / 2), (wall, middle - half)), ((wall, middle + half), (wall, breadth / 2)))
    return _oblong(left + right, breadth), inner


def _hall(config: RoomConfig, rng: RandomStream) -> tuple[Corners, Walls]:
    breadth = config.hall.draw(rng)
    return _oblong(config.hall.at_least(breadth).draw(rng), breadth), ()


SQUARE = RoomKind(_square, turned=False)
RECTANGLE = RoomKind(_rectangle, turned=False)
L = RoomKind(_l)
T = RoomKind(_t)
U = RoomKind(_u)
CORRIDOR = RoomKind(_corridor)
DOORWAY = RoomKind(_doorway)
CROSSING = RoomKind(_crossing)
HALL = RoomKind(_hall, turned=False)


def _oblong(length: float, breadth: float) -> Corners:
    x, y = length / 2, breadth / 2
    return (-x, -y), (x, -y), (x, y), (-x, y)


def _turned(point: Point, quarters: int) -> Point:
    """Turned about the origin by quarters of a circle."""
    x, y = point
    for _ in range(quarters):
        x, y = -y, x
    return x, y


def _counter_clockwise(corners: Corners) -> Corners:
    """The corners at a file's precision, counter-clockwise."""
    following = (*corners[1:], corners[0])
    doubled_area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(corners, following, strict=True))
    return tuple(_rounded(corner) for corner in (corners if doubled_area > 0.0 else corners[::-1]))


def _rounded(point: Point) -> Point:
    return quantised(point[0]), quantised(point[1])
