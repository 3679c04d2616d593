"""Walls and furniture push walkers away, and walls hide walkers from one another."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...entities import Scene
from ...exact import Array, exp
from ...geometry import Barriers, segments_cross


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


def sight_blockers(scene: Scene) -> Barriers | None:
    """The walls that can stand between two people in the room: inner ones, and edges off the outline's convex hull."""
    blocking = []
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:
            blocking.append((wall.start, wall.end, 0.0))
    return Barriers.of(blocking) if blocking else None


def sight(position: Array, blockers: Barriers) -> Any:
    """Who has whom in the line of sight, (M, M) of bool; forces do not go through walls."""
    count = len(position)
    first, second = np.triu_indices(count, 1)
    hidden = segments_cross(position[first], position[second], blockers).any(axis=0)
    seen = np.ones((count, count), dtype=bool)
    seen[first[hidden], second[hidden]] = False
    seen[second[hidden], first[hidden]] = False
    return seen
