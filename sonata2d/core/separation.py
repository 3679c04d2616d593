"""Separations of convex polygons and straight lines: how far apart they are, in which direction, and where."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from .compiled.kernel import kernel, subroutine
from .compiled.scalar import END_X, END_Y, RADIUS, START_X, START_Y, inverse_square, length, to_line
from .geometry import Outline, Shape
from .portable_math import Array
from .vectors import X, Y

NORMAL_X, NORMAL_Y, DISTANCE, ARM_X, ARM_Y = range(5)  # items of a separation
SEPARATION_SIZE = 5
_TOUCHING = 1e-7  # m, a distance without a direction


@subroutine
def place_corners(core: Array, x: float, y: float, c: float, s: float, corners: Array) -> None:
    """Set the corners, (K, 2), of a core in the body frame, (K, 2), at a pose: position, m, cosine and sine."""
    for k in range(len(core)):
        ahead, left = core[k, X], core[k, Y]
        corners[k, X], corners[k, Y] = x + ahead * c - left * s, y + ahead * s + left * c


@subroutine
def separate(corners: Array, ax: float, ay: float, bx: float, by: float, found: Array) -> None:
    """The separation of a convex polygon and a straight line from a to b.

    Args:
        corners: (K, 2), of the polygon, counter-clockwise, m; one is a point.
        ax, ay, bx, by: m.
        found: (5,), is filled: unit vector from the polygon to the line, in which they are `DISTANCE` apart, m; and the
            point of the polygon that is nearest. Where they overlap the distance is negative: the least translation
            that ends the overlap.
    """
    count, along_x, along_y = len(corners), bx - ax, by - ay
    inverse, nearest = inverse_square(along_x, along_y), math.inf
    for k in range(count):
        x, y = corners[k, X], corners[k, Y]
        dx, dy = to_line(x - ax, y - ay, along_x, along_y, inverse)  # from the corner to the line
        nearest = _take(found, nearest, dx, dy, x, y)
        if count > 1:
            side_x, side_y = corners[(k + 1) % count, X] - x, corners[(k + 1) % count, Y] - y
            along_side = inverse_square(side_x, side_y)
            for end in range(2):
                ex, ey = (ax, ay) if end == 0 else (bx, by)
                dx, dy = to_line(ex - x, ey - y, side_x, side_y, along_side)  # from the end to the side
                nearest = _take(found, nearest, -dx, -dy, ex + dx, ey + dy)
    if nearest > 0.0:
        found[NORMAL_X], found[NORMAL_Y] = found[NORMAL_X] / nearest, found[NORMAL_Y] / nearest
        found[DISTANCE] = nearest
    else:
        found[NORMAL_X], found[NORMAL_Y], found[DISTANCE] = 1.0, 0.0, 0.0
    if count > 2:
        _separate_overlapping(corners, ax, ay, bx, by, found)


@subroutine
def _take(found: Array, nearest: float, dx: float, dy: float, x: float, y: float) -> float:
    """Note a vector and the point where it begins if it is the shortest so far; the shortest length, m."""
    distance = length(dx, dy)
    if distance < nearest:
        found[NORMAL_X], found[NORMAL_Y], found[ARM_X], found[ARM_Y] = dx, dy, x, y
        return distance
    return nearest


@subroutine
def _separate_overlapping(corners: Array, ax: float, ay: float, bx: float, by: float, found: Array) -> None:
    """Replace a separation if the polygon and the line overlap: no side and no normal of the line parts them.

    Where they touch, the vector between them has no direction, and only the unit vector is replaced.

    Source: separating axis theorem; Ericson, Real-Time Collision Detection (2005), section 5.2.1.
    """
    count, best, is_apart = len(corners), -math.inf, found[DISTANCE] > _TOUCHING
    normal_x, normal_y, arm_x, arm_y = 1.0, 0.0, 0.0, 0.0
    for k in range(count):
        x, y = corners[k, X], corners[k, Y]
        side_x, side_y = corners[(k + 1) % count, X] - x, corners[(k + 1) % count, Y] - y
        size = length(side_x, side_y)
        nx, ny = side_y / size, -side_x / size  # outwards
        at_a, at_b = nx * (ax - x) + ny * (ay - y), nx * (bx - x) + ny * (by - y)
        distance = min(at_a, at_b)
        if distance >= 0.0 and is_apart:
            return
        if distance > best:
            best, normal_x, normal_y = distance, nx, ny
            arm_x, arm_y = (ax, ay) if at_a <= at_b else (bx, by)
    along_x, along_y = bx - ax, by - ay
    size = length(along_x, along_y)
    for side in range(2 if size > 0.0 else 0):
        sign = 1.0 if side == 0 else -1.0
        nx, ny = sign * along_y / size, -sign * along_x / size  # from the polygon to the line
        distance, deepest = math.inf, 0
        for k in range(count):
            depth = nx * (ax - corners[k, X]) + ny * (ay - corners[k, Y])
            if depth < distance:
                distance, deepest = depth, k
        if distance >= 0.0 and is_apart:
            return
        if distance > best + _TOUCHING:  # sides of the polygon come first
            best, normal_x, normal_y = distance, nx, ny
            arm_x, arm_y = corners[deepest, X], corners[deepest, Y]
    found[NORMAL_X], found[NORMAL_Y] = normal_x, normal_y
    if best < 0.0:
        found[DISTANCE], found[ARM_X], found[ARM_Y] = best, arm_x, arm_y


@subroutine
def gap_to_line(
    core: Array, rounding: float, x: float, y: float, c: float, s: float, corners: Array, found: Array,
    line: tuple[float, float, float, float, float],
) -> float:  # fmt: skip
    """Gap between an outline at a pose and a thick line: ends and radius, m; negative where they overlap.

    Args:
        core: (K, 2), of the outline, in the body frame, m; `corners`, (K, 2), and `found` are scratch.
        rounding: m.
        x, y, c, s: position, m, cosine and sine of the heading.
        line: start, end, radius, m.
    """
    place_corners(core, x, y, c, s, corners)
    separate(corners, line[0], line[1], line[2], line[3], found)
    gap: float = found[DISTANCE] - rounding - line[4]
    return gap


@subroutine
def gap_to_barrier(
    core: Array, rounding: float, x: float, y: float, c: float, s: float, corners: Array, found: Array,
    barriers: Array, k: int,
) -> float:  # fmt: skip
    """`gap_to_line` of barrier k, a row of `Barriers.table`."""
    line = barriers[k, START_X], barriers[k, START_Y], barriers[k, END_X], barriers[k, END_Y], barriers[k, RADIUS]
    return gap_to_line(core, rounding, x, y, c, s, corners, found, line)


@kernel
def _fill_gaps(core: Array, rounding: float, poses: Array, lines: Array, gaps: Array) -> None:
    """`outline_gaps`: poses (T, 4), x, y, cosine, sine; lines (1 or T, M, 5); gaps (T, M), output."""
    corners, found = core.copy(), np.empty(SEPARATION_SIZE)
    for t in range(len(poses)):
        place_corners(core, poses[t, 0], poses[t, 1], poses[t, 2], poses[t, 3], corners)
        own = lines[t if len(lines) > 1 else 0]
        for m in range(len(own)):
            separate(corners, own[m, 0], own[m, 1], own[m, 2], own[m, 3], found)
            gaps[t, m] = found[DISTANCE] - rounding - own[m, 4]


def outline_gaps(shape: Outline, position: Array, direction: Array, lines: Array) -> Array:
    """Gaps between an outline and thick lines, (T, M), m; negative where they overlap, NaN for a line that is NaN.

    Args:
        shape: the outline.
        position, direction: (T, 2), m, and unit vectors of the headings.
        lines: (T, M, 5), or (1, M, 5) for lines that do not move: start, end and radius, m.
    """
    poses = np.concatenate((position, direction), axis=1, dtype=float)
    gaps = np.empty((len(poses), lines.shape[1]))
    if len(poses):
        core = np.array(shape.core, dtype=float)
        _fill_gaps(core, float(shape.rounding), np.ascontiguousarray(poses), np.array(lines, dtype=float), gaps)
    gaps[np.isnan(np.broadcast_to(lines[..., 0], gaps.shape))] = np.nan
    return gaps


_EXCESS = 0.07  # m, by which covering discs may reach beyond an outline
_MOST_DISCS = 16


def covering_discs(shape: Shape) -> tuple[Array, float]:
    """Discs of one radius that cover an outline: centres in the body frame, (D, 2), m, and the radius, m.

    The outline is cut into strips across its longer side, and these into parts, with a disc around each. The discs
    reach beyond the sides by 7 cm at most, unless more than 16 of them would be needed.
    """
    core = np.array(shape.core, dtype=float)
    if len(core) == 1:
        return np.zeros((1, 2)), float(shape.rounding)
    axis = X if shape.sides[0] >= shape.sides[1] else Y
    low, high = float(core[:, axis].min()), float(core[:, axis].max())
    best: tuple[float, int, Array, float] | None = None
    for count in range(1, _MOST_DISCS + 1):
        for rows in range(1, _MOST_DISCS // count + 1):
            discs, radius, excess = _grid_of_discs(core, axis, low, high, count, rows)
            rank = max(excess, _EXCESS), count * rows
            if best is None or rank < best[:2]:
                best = (*rank, discs, radius)
    assert best is not None
    return best[2], best[3] + shape.rounding


def _grid_of_discs(
    core: Array, axis: int, low: float, high: float, count: int, rows: int
) -> tuple[Array, float, float]:
    """Discs around the parts of strips of a polygon: centres, radius, and how far they reach beyond it, m."""
    cuts, half = np.linspace(low, high, count + 1), (high - low) / (2 * count)
    spans = [_span_between(core, axis, *ends) for ends in pairwise(cuts.tolist())]
    widest = max(b - a for a, b in spans) / (2 * rows)
    radius = float(length(half, widest))
    discs = np.empty((count * rows, 2))
    for k, (a, b) in enumerate(spans):
        part = (b - a) / rows
        discs[k * rows : (k + 1) * rows, axis] = (cuts[k] + cuts[k + 1]) / 2
        discs[k * rows : (k + 1) * rows, 1 - axis] = a + part * (np.arange(rows) + 0.5)
    return discs, radius, radius - min(half, widest)


def _span_between(core: Array, axis: int, low: float, high: float) -> tuple[float, float]:
    """Extent of a convex polygon across an axis between two places on it, m."""
    across = [point[1 - axis] for point in core if low <= point[axis] <= high]
    for a, b in zip(core, np.roll(core, -1, axis=0), strict=True):
        for place in (low, high):
            if min(a[axis], b[axis]) < place < max(a[axis], b[axis]):
                part = (place - a[axis]) / (b[axis] - a[axis])
                across.append(a[1 - axis] + part * (b[1 - axis] - a[1 - axis]))
    return min(across), max(across)
