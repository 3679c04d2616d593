"""Scalar functions for kernels, with the same bits as the array versions in `portable_math`, `vectors`, `geometry`.

Rows of barriers in kernels are rows of `Barriers.table`: the columns `START_X` to `INVERSE` below.
"""

from __future__ import annotations

import math

from .. import portable_math, vectors
from ..portable_math import Array
from .kernel import subroutine

# Columns of `Barriers.table`: ends of the core line, half the thickness, vector from start to end, and the inverse of
# its squared length (0 for a disc).
START_X, START_Y, END_X, END_Y, RADIUS, ALONG_X, ALONG_Y, INVERSE = range(8)

Vector = tuple[float, float]

exp = subroutine(portable_math.exp_of)
angle_of = subroutine(portable_math.angle_of)
rotation = subroutine(portable_math.rotation)
unit_vector = subroutine(portable_math.unit_vector)
wrap_angle = subroutine(vectors.wrap_angle)
length = subroutine(vectors.length)


@subroutine
def quantised(value: float) -> float:
    """`geometry.quantised` of a number within its bounds."""
    return float(round(value * 10_000.0)) / 10_000.0 + 0.0


@subroutine
def canonical_angle(theta: float) -> float:
    """`geometry.canonical_angle`."""
    angle = quantised(wrap_angle(theta))
    return 3.1416 if angle <= -3.1416 else angle


@subroutine
def clipped(value: float, low: float, high: float) -> float:
    """The value limited to [low, high]."""
    return min(max(value, low), high)


@subroutine
def unit_or(x: float, y: float, minimum: float, default_x: float, default_y: float) -> Vector:
    """The unit vector along (x, y); the default for a vector not longer than the minimum."""
    size = math.sqrt(x * x + y * y)
    if size > minimum:
        size = max(size, 1e-6)
        return x / size, y / size
    return default_x, default_y


@subroutine
def to_line(x: float, y: float, along_x: float, along_y: float, inverse: float) -> Vector:
    """Vector from a point to the nearest point on a straight line, m.

    Args:
        x, y: the point relative to the start of the line, m.
        along_x, along_y: vector from the start to the end of the line, m.
        inverse: of its squared length, as `inverse_square` returns it.
    """
    t = min(max((x * along_x + y * along_y) * inverse, 0.0), 1.0)
    return t * along_x - x, t * along_y - y


@subroutine
def to_shoulder_line(dx: float, dy: float, body_x: float, body_y: float, shoulder: float) -> Vector:
    """`geometry.to_shoulder_line` of one point, m.

    Args:
        dx, dy: from the point to the middle of the line, m.
        body_x, body_y: unit vector of the heading.
        shoulder: half the length of the line, m; see `Humans.shoulder`.
    """
    if shoulder < 0.0:  # the line lies along the heading
        body_x, body_y, shoulder = -body_y, body_x, -shoulder
    along = min(max(body_x * dy - body_y * dx, -shoulder), shoulder)
    return dx + along * body_y, dy - along * body_x


@subroutine
def shoulder_line_distance(
    dx: float, dy: float, bx: float, by: float, shoulder: float, other_bx: float, other_by: float, other_shoulder: float
) -> float:
    """`geometry.shoulder_line_distances` of one pair, m.

    Args:
        dx, dy: from the middle of the first line to the middle of the other one, m.
        bx, by, other_bx, other_by: unit vectors of the headings.
        shoulder, other_shoulder: half the length of the lines, m; see `Humans.shoulder`.
    """
    if shoulder < 0.0:
        bx, by, shoulder = -by, bx, -shoulder
    if other_shoulder < 0.0:
        other_bx, other_by, other_shoulder = -other_by, other_bx, -other_shoulder
    nearest, ahead, other_ahead = math.inf, 1.0, 1.0
    for end in (-1.0, 1.0):
        x, y = dx + end * by * shoulder, dy - end * bx * shoulder  # from an end of the first line
        line_x, line_y = to_shoulder_line(x, y, other_bx, other_by, other_shoulder)
        nearest = min(nearest, length(line_x, line_y))
        other_ahead *= x * other_bx + y * other_by
        x, y = dx + end * other_by * other_shoulder, dy - end * other_bx * other_shoulder  # to an end of the other one
        line_x, line_y = to_shoulder_line(x, y, bx, by, shoulder)
        nearest = min(nearest, length(line_x, line_y))
        ahead *= x * bx + y * by
    return 0.0 if ahead < 0.0 and other_ahead < 0.0 else nearest


@subroutine
def half_line(body_x: float, body_y: float, shoulder: float) -> Vector:
    """Vector from the middle of a person's shoulder line to one of its ends, m; on the left if it lies across.

    Args:
        body_x, body_y: unit vector of the heading.
        shoulder: half the length of the line, m; see `Humans.shoulder`.
    """
    if shoulder < 0.0:
        return body_x * shoulder, body_y * shoulder
    return -body_y * shoulder, body_x * shoulder


@subroutine
def extent(nx: float, ny: float, body_x: float, body_y: float, shoulder: float) -> float:
    """Half the extent of a person's shoulder line in a direction, m.

    Args:
        nx, ny: the direction, a unit vector.
        body_x, body_y: unit vector of the heading.
        shoulder: half the length of the line, m; see `Humans.shoulder`.
    """
    if shoulder < 0.0:
        return -shoulder * abs(nx * body_x + ny * body_y)
    return shoulder * abs(nx * body_y - ny * body_x)


@subroutine
def turned_towards(x: float, y: float, to_x: float, to_y: float, cosine: float, sine: float, side: float) -> Vector:
    """A unit vector that is turned towards another by a given angle at most.

    Args:
        x, y: unit vector that is turned.
        to_x, to_y: unit vector towards which it is turned, and which is the result if it is within the angle.
        cosine, sine: of the angle.
        side: to which a turn towards the opposite direction goes: 1 to the right, -1 to the left.
    """
    if x * to_x + y * to_y >= cosine:
        return to_x, to_y
    turn = x * to_y - y * to_x
    if not (turn > 0.0 or (turn == 0.0 and side < 0.0)):
        sine = -sine
    return cosine * x - sine * y, cosine * y + sine * x


@subroutine
def inverse_square(x: float, y: float) -> float:
    """Inverse of the squared length of a vector; 0 for the null vector."""
    square = x * x + y * y
    return 1.0 / square if square > 0.0 else 0.0


@subroutine
def towards(barriers: Array, k: int, x: float, y: float) -> Vector:
    """Vector from a point to the nearest point on the core line of barrier k, m."""
    px, py = x - barriers[k, START_X], y - barriers[k, START_Y]
    return to_line(px, py, barriers[k, ALONG_X], barriers[k, ALONG_Y], barriers[k, INVERSE])


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
def line_gap(barriers: Array, k: int, start_x: float, start_y: float, end_x: float, end_y: float) -> float:
    """Gap between a straight line and barrier k, m; minus the barrier's radius where its core line is crossed."""
    radius: float = barriers[k, RADIUS]
    if crosses(barriers, k, start_x, start_y, end_x, end_y):
        return -radius
    # Unless two segments cross, they are nearest at an end of one of them.
    nearest = min(gap(barriers, k, start_x, start_y), gap(barriers, k, end_x, end_y))
    along_x, along_y = end_x - start_x, end_y - start_y
    inverse = inverse_square(along_x, along_y)
    px, py = barriers[k, START_X] - start_x, barriers[k, START_Y] - start_y
    dx, dy = to_line(px, py, along_x, along_y, inverse)
    nearest = min(nearest, math.sqrt(dx * dx + dy * dy) - radius)
    px, py = barriers[k, END_X] - start_x, barriers[k, END_Y] - start_y
    dx, dy = to_line(px, py, along_x, along_y, inverse)
    return min(nearest, math.sqrt(dx * dx + dy * dy) - radius)


@subroutine
def is_inside(edges: Array, x: float, y: float) -> bool:
    """Whether a point lies inside closed lines and outside their holes (even-odd rule).

    Args:
        edges: (K, 4), start and end of each edge of all the lines and holes, m.
        x, y: the point, m.
    """
    is_odd = False
    for k in range(len(edges)):
        if meets_ray(edges, k, x, y):
            is_odd = not is_odd
    return is_odd


@subroutine
def meets_ray(edges: Array, k: int, x: float, y: float) -> bool:
    """Whether edge k, a row of `is_inside`, meets the ray from a point in the direction of x."""
    ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
    return bool((ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay))


@subroutine
def choice(uniform: float, count: int) -> int:
    """The index of `RandomStream.choice` for a uniform random number, of `count` items."""
    return min(int(uniform * count), count - 1)
