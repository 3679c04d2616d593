"""Floor, grid lines and walls of a room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..core.geometry import Barriers, Point
from ..core.portable_math import Array
from ..core.scene import Scene
from .brush import Brush
from .palette import FLOOR, GRID, WALL

# Outer walls extend outward only, so that the visible edge of a wall is the line at which bodies stop.
_WALL_WIDTH, _PARTITION_WIDTH = 0.12, 0.05  # m

Line = tuple[Point, Point]


@dataclass(frozen=True)
class FloorPlan:
    """The lines of a room that do not depend on the camera, m.

    Attributes:
        outline: corners of the floor; empty for a scene without an outline.
        walls: all walls.
        partitions: the walls inside the room.
        grid: lines at whole metres, clipped to the floor.
    """

    outline: tuple[Point, ...]
    walls: tuple[Line, ...]
    partitions: tuple[Line, ...]
    grid: tuple[Line, ...]

    @classmethod
    def of(cls, scene: Scene) -> FloorPlan:
        """Derive the plan from a scene."""
        walls = tuple((wall.start, wall.end) for wall in scene.walls)
        if not scene.polygon:
            return cls((), walls, walls, ())
        partitions = tuple(wall for wall in walls if _is_partition(*wall, scene.outline))
        return cls(scene.polygon, walls, partitions, tuple(_grid(scene.outline)))


def draw_room(brush: Brush, plan: FloorPlan, *, grid: bool) -> None:
    """Draw walls, floor and, if `grid` is set, the grid lines."""
    for wall in plan.walls:
        brush.stroke(WALL, wall, 2 * _WALL_WIDTH)  # the floor covers the inner half
    if plan.outline:
        brush.polygon(FLOOR, plan.outline)
    for line in plan.grid if grid else ():
        brush.stroke(GRID, line, 0.0)
    for wall in plan.partitions:
        brush.stroke(WALL, wall, _PARTITION_WIDTH)


def _is_partition(start: Point, end: Point, outline: Array) -> bool:
    """Whether a wall is inside the room rather than on its outline."""
    edges = Barriers(outline, np.roll(outline, -1, axis=0), np.zeros(len(outline)))
    middle = np.array([[(start[0] + end[0]) / 2, (start[1] + end[1]) / 2]])
    return float(edges.gaps(middle).min()) > 1e-3


def _grid(outline: Array) -> list[Line]:
    """Lines at whole metres inside a polygon, (V, 2)."""
    lines: list[Line] = []
    for axis in (0, 1):
        across, along = outline[:, axis], outline[:, 1 - axis]
        for at in range(math.ceil(across.min()), math.floor(across.max()) + 1):
            for a, b in _spans(across, along, at + 1e-6):  # shifted, so that no line passes through a corner
                lines.append(((float(at), a), (float(at), b)) if axis == 0 else ((a, float(at)), (b, float(at))))
    return lines


def _spans(across: Array, along: Array, at: float) -> list[tuple[float, float]]:
    """Intervals of `along` in which the line `across` = `at` is inside a polygon (even-odd rule)."""
    a, b = np.roll(across, 1), across
    cut = (a > at) != (b > at)
    fraction = (at - a[cut]) / (b[cut] - a[cut])
    start = np.roll(along, 1)[cut]
    hits = sorted(float(hit) for hit in start + fraction * (along[cut] - start))
    return list(zip(hits[::2], hits[1::2], strict=False))
