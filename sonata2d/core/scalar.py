"""Scalar functions for kernels, with the same bits as their array versions in `portable_math` and `geometry`.

Rows of barriers in kernels are rows of `Barriers.table`: the columns `START_X` to `INVERSE` below.
"""

from __future__ import annotations

import math

from . import portable_math
from .compiled import subroutine
from .portable_math import Array

# Columns of `Barriers.table`: ends of the core line, half the thickness, vector from start to end, and the inverse of
# its squared length (0 for a disc).
START_X, START_Y, END_X, END_Y, RADIUS, ALONG_X, ALONG_Y, INVERSE = range(8)

Vector = tuple[float, float]

exp = subroutine(portable_math.exp_of)
angle_of = subroutine(portable_math.angle_of)
rotation = subroutine(portable_math.rotation_of)


@subroutine
def clipped(value: float, low: float, high: float) -> float:
    """The value limited to [low, high]."""
    return min(max(value, low), high)


@subroutine
def length(x: float, y: float) -> float:
    """Length of a vector."""
    return math.sqrt(x * x + y * y)


@subroutine
def unit_or(x: float, y: float, minimum: float, default_x: float, default_y: float) -> Vector:
    """The unit vector along (x, y); the default for a vector not longer than the minimum."""
    size = math.sqrt(x * x + y * y)
    if size > minimum:
        size = max(size, 1e-6)
        return x / size, y / size
    return default_x, default_y


@subroutine
def towards(barriers: Array, k: int, x: float, y: float) -> Vector:
    """Vector from a point to the nearest point on the core line of barrier k, m."""
    px, py = x - barriers[k, START_X], y - barriers[k, START_Y]
    dx, dy = barriers[k, ALONG_X], barriers[k, ALONG_Y]
    t = min(max((px * dx + py * dy) * barriers[k, INVERSE], 0.0), 1.0)
    return t * dx - px, t * dy - py


@subroutine
def gap(barriers: Array, k: int, x: float, y: float) -> float:
    """Distance from a point to the surface of barrier k, m; negative inside."""
    dx, dy = towards(barriers, k, x, y)
    radius: float = barriers[k, RADIUS]
    return math.sqrt(dx * dx + dy * dy) - radius


@subroutine
def crosses(barriers: Array, k: int, start_x: float, start_y: float, end_x: float, end_y: float) -> bool:
    """Whether a straight line properly crosses the core line of barrier k; False where it only touches."""
    ax, ay, dx, dy = barriers[k, START_X], barriers[k, START_Y], barriers[k, ALONG_X], barriers[k, ALONG_Y]
    p = dx * (start_y - ay) - dy * (start_x - ax)
    q = dx * (end_y - ay) - dy * (end_x - ax)
    if not p * q < 0.0:
        return False
    wx, wy = end_x - start_x, end_y - start_y
    a = wx * (ay - start_y) - wy * (ax - start_x)
    b = wx * (barriers[k, END_Y] - start_y) - wy * (barriers[k, END_X] - start_x)
    return bool(a * b < 0.0)


@subroutine
def choice(uniform: float, count: int) -> int:
    """The index of `RandomStream.choice` for a uniform random number, of `count` items."""
    return min(int(uniform * count), count - 1)
