"""Floor, grid lines and walls of a room."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..core.geometry import Barriers, Point
from ..core.portable_math import Array
from ..core.scene import Scene
from .brush import Brush
from .palette import FLOOR, GRID, WALL

# Outer walls extend outward only, so that the visible edge of a wall is the line at which bodies stop.
_WALL_WIDTH, _PARTITION_WIDTH = 0.12, 0.05  # m

_Line = tuple[Point, Point]


def draw_room(brush: Brush, scene: Scene, *, grid: bool) -> None:
    """Draw walls, floor and, if `grid` is set, the grid lines."""
    walls = tuple((wall.start, wall.end) for wall in scene.walls)
    partitions, lines = _floor_plan(scene.polygon, walls)
    for wall in walls:
        brush.stroke(WALL, wall, 2 * _WALL_WIDTH)  # the floor covers the inner half
    if scene.polygon:
        brush.polygon(FLOOR, scene.polygon)
    for line in lines if grid else ():
        brush.stroke(GRID, line, 0.0)
    for hole in scene.holes:
        brush.polygon(WALL, hole)
    for wall in partitions:
        brush.stroke(WALL, wall, _PARTITION_WIDTH)


@lru_cache(maxsize=8)
def _floor_plan(polygon: tuple[Point, ...], walls: tuple[_Line, ...]) -> tuple[tuple[_Line, ...], tuple[_Line, ...]]:
    """The walls inside a room, and lines at whole metres, clipped to its floor; kept for the frames of a window.

    Args:
        polygon: corners of the floor, m; empty for a scene without an outline, in which all walls count as inside.
        walls: start and end of each, m.
    """
    if not polygon:
        return walls, ()
    outline = np.array(polygon, dtype=float)
    return tuple(wall for wall in walls if _is_partition(*wall, outline)), tuple(_grid(outline))


def _is_partition(start: Point, end: Point, outline: Array) -> bool:
    """Whether a wall is inside the room rather than on its outline."""
    edges = Barriers(outline, np.roll(outline, -1, axis=0), np.zeros(len(outline)))
    middle = np.array([[(start[0] + end[0]) / 2, (start[1] + end[1]) / 2]])
    return float(edges.gaps(middle).min()) > 1e-3


def _grid(outline: Array) -> list[_Line]:
    """Lines at whole metres inside a polygon, (V, 2)."""
    lines: list[_Line] = []
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
