"""The room itself: floor, lines, walls and the furniture in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..core.geometry import Barriers, Point
from ..core.portable_math import Array
from ..core.scene import Scene
from .brush import Brush
from .palette import FLOOR, GRID, WALL
from .things import draw_thing, front_of

_WALL_WIDTH, _PARTITION_WIDTH = 0.12, 0.05  # m; outer walls grow outward, so the line bodies stop at stays where it is

Line = tuple[Point, Point]


@dataclass(frozen=True)
class FloorPlan:
    """What is drawn of a room, worked out once.

    Attributes:
        outline: of the floor.
        walls: all of them.
        partitions: those that stand within the room.
        grid: lines at whole metres, as far as the floor goes.
    """

    outline: tuple[Point, ...]
    walls: tuple[Line, ...]
    partitions: tuple[Line, ...]
    grid: tuple[Line, ...]

    @classmethod
    def of(cls, scene: Scene) -> FloorPlan:
        walls = tuple((wall.start, wall.end) for wall in scene.walls)
        if not scene.polygon:
            return cls((), walls, walls, ())
        within = tuple(wall for wall in walls if _is_partition(*wall, scene.outline))
        return cls(scene.polygon, walls, within, tuple(_grid(scene.outline)))


def draw_room(brush: Brush, plan: FloorPlan, *, grid: bool) -> None:
    """Walls, floor and lines."""
    for wall in plan.walls:
        brush.stroke(WALL, wall, 2 * _WALL_WIDTH)  # the floor will cover the inner half
    if plan.outline:
        brush.polygon(FLOOR, plan.outline)
    for line in plan.grid if grid else ():
        brush.stroke(GRID, line, 0.0)
    for wall in plan.partitions:
        brush.stroke(WALL, wall, _PARTITION_WIDTH)


def draw_furniture(brush: Brush, scene: Scene) -> None:
    """All things, those that stand on others last."""
    for thing in sorted(scene.furniture, key=lambda thing: thing.on is not None):
        draw_thing(brush.at(thing.pose.position, front_of(thing)), thing)


def _is_partition(start: Point, end: Point, outline: Array) -> bool:
    """Whether a wall stands within the room rather than on its outline."""
    edges = Barriers(outline, np.roll(outline, -1, axis=0), np.zeros(len(outline)))
    middle = np.array([[(start[0] + end[0]) / 2, (start[1] + end[1]) / 2]])
    return float(edges.gaps(middle).min()) > 1e-3


def _grid(outline: Array) -> list[Line]:
    lines: list[Line] = []
    for axis in (0, 1):
        along, low, high = outline[:, 1 - axis], outline[:, axis].min(), outline[:, axis].max()
        for at in range(math.ceil(low), math.floor(high) + 1):
            for a, b in _spans(outline[:, axis], along, at + 1e-6):
                lines.append(((float(at), a), (float(at), b)) if axis == 0 else ((a, float(at)), (b, float(at))))
    return lines


def _spans(across: Array, along: Array, at: float) -> list[tuple[float, float]]:
    """Where the line across = at runs within a polygon: stretches of along (even-odd rule)."""
    a, b = np.roll(across, 1), across
    cut = (a > at) != (b > at)
    share = (at - a[cut]) / (b[cut] - a[cut])
    start = np.roll(along, 1)[cut]
    hits = sorted(float(hit) for hit in start + share * (along[cut] - start))
    return list(zip(hits[::2], hits[1::2], strict=False))
