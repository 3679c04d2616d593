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
    segment_distances,
    segments_cross,
)


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
