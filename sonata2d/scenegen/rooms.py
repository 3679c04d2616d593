"""Floor plans: the outline and the walls that everything else is placed within."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..chance import Chance
from ..entities import Wall
from ..exact import Array
from ..geometry import (
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
from .sections import RoomConfig


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

    def sample(self, chance: Chance) -> Point:
        """A place in the box round the room, all alike."""
        left, right, bottom, top = self.box
        return chance.uniform(left, right), chance.uniform(bottom, top)

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

    def is_in_sight(self, place: Pose, other: Pose) -> bool:
        """Whether no wall stands between two places."""
        start, end = (np.array([pose.position], dtype=float) for pose in (place, other))
        return not segments_cross(start, end, self.barriers).any()


def draw_plan(config: RoomConfig, chance: Chance) -> FloorPlan:
    """One of the kinds of room, or the given one."""
    inner = tuple(Wall(_rounded(x1, y1), _rounded(x2, y2)) for x1, y1, x2, y2 in config.walls)
    if config.polygon is not None:
        return FloorPlan("given", _counter_clockwise(config.polygon), inner)
    kind = chance.choice(list(config.kinds), list(config.kinds.values()))
    if kind == "l":
        return FloorPlan(kind, _l_shape(config.unit.draw(chance), chance.integer(0, 3)), inner)
    breadth = config.side.draw(chance) if kind == "square" else config.breadth.draw(chance)
    length = breadth if kind == "square" else config.length.at_least(breadth).draw(chance)
    x, y = length / 2, breadth / 2
    return FloorPlan(kind, _counter_clockwise(((-x, -y), (x, -y), (x, y), (-x, y))), inner)


def _l_shape(unit: float, quarters: int) -> tuple[Point, ...]:
    """An L in a square of three units centred at the origin, turned by quarters of a circle."""
    corners: tuple[Point, ...] = ((-1.5, -0.5), (0.5, -0.5), (0.5, -1.5), (1.5, -1.5), (1.5, 1.5), (-1.5, 1.5))
    for _ in range(quarters):
        corners = tuple((-y, x) for x, y in corners)
    return _counter_clockwise(tuple((x * unit, y * unit) for x, y in corners))


def _counter_clockwise(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    """The corners at a file's precision, counter-clockwise."""
    following = (*corners[1:], corners[0])
    doubled_area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(corners, following, strict=True))
    return tuple(_rounded(x, y) for x, y in (corners if doubled_area > 0.0 else corners[::-1]))


def _rounded(x: float, y: float) -> Point:
    return quantised(x), quantised(y)


def _sides(shape: Rectangle, pose: Pose) -> tuple[Array, Array]:
    """The sides of an oblong, from (4, 2) to (4, 2)."""
    corners = np.array(shape.corners(pose), dtype=float)
    return corners, np.concatenate((corners[1:], corners[:1]))
