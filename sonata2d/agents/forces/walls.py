"""Walls and furniture push walkers away, and walls hide walkers from one another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...exact import Array, exp
from ...geometry import Barriers, Point, segments_cross
from ...scene import Scene


def wall_acceleration(position: Array, radius: Array, barriers: Barriers, *, strength: float, reach: float) -> Array:
    """Push away from walls and furniture.

    Args:
        position: (N, 2), m.
        radius: (N,), m.
        barriers: M thick segments.
        strength: m/s2, at the skin.
        reach: m, in which the push falls to 1/e.

    Returns:
        (N, 2), m/s2, summed in the order of the barriers.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755, wall term a exp(-d/b), with d from outline to wall.
    """
    x, y = barriers.towards(position)
    apart = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    gap = np.maximum(apart - barriers.radius[:, None] - radius, 0.0)
    push = exp(gap * (-1.0 / reach)) * (-strength) / apart
    return np.stack((np.add.reduce(push * x, axis=0), np.add.reduce(push * y, axis=0)), axis=1)


class Sight:
    """Who has whom in the line of sight; forces do not go through walls.

    Args:
        scene: its inner walls, and the edges off its outline's convex hull, can stand between two people in the room.
        count: M, how many look.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        self._walls = Barriers.of(_blocking(scene))
        self._pairs = np.triu_indices(count, 1)
        self._all = np.ones((count, count), dtype=bool)

    def seen(self, position: Array) -> Any:
        """(M, M) of bool, from (M, 2), m."""
        if not len(self._walls):
            return self._all
        first, second = self._pairs
        hidden = segments_cross(position[first], position[second], self._walls).any(axis=0)
        first, second = first[hidden], second[hidden]
        seen = self._all.copy()
        seen[first, second] = seen[second, first] = False
        return seen


def _blocking(scene: Scene) -> Iterator[tuple[Point, Point, float]]:
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:
            yield wall.start, wall.end, 0.0
