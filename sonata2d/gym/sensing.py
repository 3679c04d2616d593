"""The robot's field of view and lidar, computed from the rows of an observation."""

from __future__ import annotations

import math

from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.scalar import length
from ..core.portable_math import Array, BoolArray
from .parts import Humans, Objects, places

_X, _Y, _COS, _SIN, _RADIUS, _SHOULDER = places(Humans, "x", "y", "cos", "sin", "radius", "shoulder")
_LENGTH, _WIDTH, _IS_DISC, _OBJECT_COS, _OBJECT_SIN = places(Objects, "length", "width", "is_disc", "cos", "sin")


@kernel
def visible(
    humans: Array, objects: Array, walls: Array, cosine: float, distance: float, occlusion: bool, is_seen: BoolArray
) -> None:
    """Mark the entities that the robot sees; all others become unseen.

    Args:
        humans, objects, walls: rows of an observation.
        cosine: of half the angle of the field of view.
        distance: m.
        occlusion: whether walls and pedestrians hide others.
        is_seen: (H + M,), true for rows that are not empty; false is written for entities that are not seen.
    """
    count = len(humans)
    is_there = is_seen.copy()
    for k in range(len(is_seen)):
        if not is_there[k]:
            continue
        is_seen[k] = False
        itself = k if k < count else -1  # a pedestrian does not hide itself
        for end in range(-1, 2):
            # A pedestrian is seen if its centre or an end of its shoulder line is, an object if its centre is.
            if k < count:
                x = humans[k, _X] - end * humans[k, _SHOULDER] * humans[k, _SIN]
                y = humans[k, _Y] + end * humans[k, _SHOULDER] * humans[k, _COS]
            else:
                x, y = objects[k - count, _X], objects[k - count, _Y]
            away = length(x, y)
            if away > distance or x < cosine * away:
                continue
            ux, uy, is_hidden = x / max(away, 1e-9), y / max(away, 1e-9), False
            for w in range(len(walls) if occlusion else 0):
                hit = _range_to_line(ux, uy, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3])
                is_hidden = is_hidden or hit < away
            for j in range(count if occlusion else 0):
                if is_there[j] and j != itself and not is_hidden:
                    is_hidden = _range_to_body(humans, j, ux, uy) < away
            if not is_hidden:
                is_seen[k] = True


@kernel
def measure_ranges(humans: Array, objects: Array, walls: Array, directions: Array, ranges: Array) -> None:
    """Shorten the ranges of rays from the origin, m, to the nearest outline in their directions.

    Args:
        humans, objects, walls: rows of an observation.
        directions: (R, 2), unit vectors.
        ranges: (R,), m, is updated.
    """
    for r in range(len(directions)):
        ux, uy, nearest = directions[r, 0], directions[r, 1], ranges[r]
        for w in range(len(walls)):
            nearest = min(nearest, _range_to_line(ux, uy, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]))
        for k in range(len(humans)):
            nearest = min(nearest, _range_to_body(humans, k, ux, uy))
        for k in range(len(objects)):
            x, y, a, b = objects[k, _X], objects[k, _Y], 0.5 * objects[k, _LENGTH], 0.5 * objects[k, _WIDTH]
            if objects[k, _IS_DISC] > 0.5:
                nearest = min(nearest, _range_to_disc(ux, uy, x, y, a))
                continue
            c, s = objects[k, _OBJECT_COS], objects[k, _OBJECT_SIN]
            for side in (-1.0, 1.0):
                lx, ly, wx, wy = a * c, a * s, -b * s * side, b * c * side
                nearest = min(nearest, _range_to_line(ux, uy, x + wx - lx, y + wy - ly, x + wx + lx, y + wy + ly))
                lx, ly, wx, wy = a * c * side, a * s * side, -b * s, b * c
                nearest = min(nearest, _range_to_line(ux, uy, x + lx - wx, y + ly - wy, x + lx + wx, y + ly + wy))
        ranges[r] = nearest


@subroutine
def _range_to_body(humans: Array, k: int, ux: float, uy: float) -> float:
    """Range of a ray from the origin to the outline of pedestrian k, m."""
    x, y, c, s = humans[k, _X], humans[k, _Y], humans[k, _COS], humans[k, _SIN]
    radius, shoulder = humans[k, _RADIUS], humans[k, _SHOULDER]
    sx, sy, nearest = -s * shoulder, c * shoulder, math.inf
    for side in (-1.0, 1.0):
        nearest = min(nearest, _range_to_disc(ux, uy, x + sx * side, y + sy * side, radius))
        fx, fy = x + c * radius * side, y + s * radius * side
        nearest = min(nearest, _range_to_line(ux, uy, fx - sx, fy - sy, fx + sx, fy + sy))
    return nearest


@subroutine
def _range_to_disc(ux: float, uy: float, x: float, y: float, radius: float) -> float:
    """Range of a ray from the origin to a circle, m; 0 from its inside, infinite if it misses it."""
    along, square = x * ux + y * uy, x * x + y * y
    if square <= radius * radius:
        return 0.0
    half = radius * radius - (square - along * along)
    if along <= 0.0 or half < 0.0:
        return math.inf
    return along - math.sqrt(half)


@subroutine
def _range_to_line(ux: float, uy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Range of a ray from the origin to the line between two points, m; infinite if it misses it."""
    dx, dy = bx - ax, by - ay
    cross = ux * dy - uy * dx
    if abs(cross) < 1e-12:
        return math.inf
    range_, part = (ax * dy - ay * dx) / cross, (ax * uy - ay * ux) / cross
    return range_ if range_ >= 0.0 and 0.0 <= part <= 1.0 else math.inf
