"""Kernels of `navigation`: positions that a disc can occupy, and straight lines along which it can move."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from .barrier_grid import Solids, is_blocked, is_crossed, is_near_line, is_within, nearest_within
from .compiled.kernel import kernel, subroutine
from .compiled.packing import Floats2, Ints, unpack
from .compiled.scalar import END_X, END_Y, START_X, START_Y, Vector, is_inside, length, meets_ray, towards
from .portable_math import Array, BoolArray, IntArray
from .vectors import X, Y

TOLERANCE = 1e-6  # m, by which a clearance may be missed


class Borders(NamedTuple):
    """Closed lines around free space, in rows from south to north, for kernels.

    Attributes:
        edges: (B, 4), start and end of the edges of the outline and, as holes, of solid objects, m.
        south, height: of the first row, and of each row, m.
        first: (R + 1,) of int, where the edges of each row begin in `item`.
        item: of int, edges that reach into each row.
    """

    edges: Floats2
    south: float
    height: float
    first: Ints
    item: Ints


class Space(NamedTuple):
    """A free space for kernels.

    Attributes:
        solids: barriers that stay, such as walls and furniture.
        added: further barriers.
        borders: of the outline and of the solid objects among `solids`.
        holes: (B, 4), start and end of the edges of the solid objects among `added`, m; as many as `hole_count`.
        hole_count: (1,) of int.
        clearance: m.
    """

    solids: Solids
    added: Solids
    borders: Borders
    holes: Floats2
    hole_count: Ints
    clearance: float


@kernel
def find_borders(barriers: Array, outline: Array) -> Array:
    """The edges of an outline and of the solid objects among barriers, `Borders.edges`.

    A solid object is a closed line of consecutive barriers without a corner of the room's outline.
    """
    count = len(barriers)
    borders, border_count = np.empty((len(outline) + count, 4)), len(outline)
    for k in range(len(outline)):
        following = (k + 1) % len(outline)
        borders[k, 0], borders[k, 1] = outline[k, X], outline[k, Y]
        borders[k, 2], borders[k, 3] = outline[following, X], outline[following, Y]
    first, is_apart = 0, True  # start of the line, and whether it has no corner of the outline
    for k in range(count):
        start_x, start_y = barriers[k, START_X], barriers[k, START_Y]
        end_x, end_y = barriers[k, END_X], barriers[k, END_Y]
        for c in range(len(outline)):
            if outline[c, X] == start_x and outline[c, Y] == start_y:
                is_apart = False
        closes = end_x == barriers[first, START_X] and end_y == barriers[first, START_Y]
        continues = False
        if not closes and k + 1 < count:
            continues = end_x == barriers[k + 1, START_X] and end_y == barriers[k + 1, START_Y]
        if closes and k > first + 1 and is_apart:
            for i in range(first, k + 1):
                borders[border_count, 0], borders[border_count, 1] = barriers[i, START_X], barriers[i, START_Y]
                borders[border_count, 2], borders[border_count, 3] = barriers[i, END_X], barriers[i, END_Y]
                border_count += 1
        if not continues:
            first, is_apart = k + 1, True
    return borders[:border_count]


def index_borders(edges: Array) -> tuple[float, float, IntArray, IntArray]:
    """The other fields of `Borders`."""
    ys = edges[:, 1::2]
    south, north = float(ys.min(initial=math.inf)), float(ys.max(initial=-math.inf))
    rows = max(len(edges) // 8, 1) if north > south else 1
    height = (north - south) / rows if north > south else 1.0
    reach = np.stack((ys.min(axis=1) - TOLERANCE, ys.max(axis=1) + TOLERANCE), axis=1)
    low, high = ((reach - south) / height).clip(0.0, rows - 1.0).astype(np.int64).T
    count = high - low + 1  # of rows that an edge reaches into
    edge = np.repeat(np.arange(len(edges)), count)
    begin = np.array([*accumulate(count.tolist(), initial=0)])[:-1]  # of the rows of each edge
    row = np.arange(len(edge)) - np.repeat(begin - low, count)
    order = np.argsort(row, kind="stable")
    return south, height, np.searchsorted(row[order], np.arange(rows + 1)), edge[order]


@subroutine
def _is_in_room(borders: Borders, x: float, y: float) -> bool:
    """`is_inside` for `Borders`."""
    rows = len(borders.first) - 1
    row = int(min(max((y - borders.south) / borders.height, 0.0), rows - 1.0))
    is_odd = False
    for n in range(borders.first[row], borders.first[row + 1]):
        if meets_ray(borders.edges, borders.item[n], x, y):
            is_odd = not is_odd
    return is_odd


@kernel
def check_point(packed_space: Any, x: float, y: float) -> bool:
    """`FreeSpace.is_free_at` in a packed `Space`."""
    return bool(is_free(unpack(packed_space, Space), x, y))


@kernel
def check_points(packed_space: Any, points: Array, free: BoolArray) -> None:
    """`FreeSpace.is_free` in a packed `Space` for points (N, 2), m, into an array (N,)."""
    space = unpack(packed_space, Space)
    for k in range(len(points)):
        free[k] = is_free(space, points[k, X], points[k, Y])


@subroutine
def is_free(space: Space, x: float, y: float) -> bool:
    """`FreeSpace.is_free` for one point."""
    minimum = space.clearance - TOLERANCE
    if is_within(space.solids, x, y, minimum) or is_within(space.added, x, y, minimum):
        return False
    return _is_in_room(space.borders, x, y) and not is_in_hole(space, x, y)


@subroutine
def is_in_hole(space: Space, x: float, y: float) -> bool:
    """Whether a point lies in one of the solid objects among the added barriers."""
    return space.hole_count[0] > 0 and is_inside(space.holes[: space.hole_count[0]], x, y)


@kernel
def check_place(packed_space: Any, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`FreeSpace.is_open` in a packed `Space`: whether the end is free, and the straight line there is clear."""
    space = unpack(packed_space, Space)
    return is_free(space, end_x, end_y) and is_clear(space, x, y, end_x, end_y)


@kernel
def check_line(packed_space: Any, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`is_clear` in a packed `Space`."""
    return is_clear(unpack(packed_space, Space), x, y, end_x, end_y)


@kernel
def check_lines(packed_space: Any, start: Array, end: Array, clear: BoolArray) -> None:
    """`FreeSpace.is_clear` in a packed `Space` for straight lines from start to end, (N, 2), m, into an array (N,)."""
    space = unpack(packed_space, Space)
    for i in range(len(start)):
        clear[i] = is_clear(space, start[i, X], start[i, Y], end[i, X], end[i, Y])


@subroutine
def is_clear(space: Space, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`FreeSpace.is_clear` for one straight line."""
    return not is_blocked(space.added, space.clearance, TOLERANCE, x, y, end_x, end_y) and not is_blocked(
        space.solids, space.clearance, TOLERANCE, x, y, end_x, end_y
    )


@subroutine
def is_separated(space: Space, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a barrier is properly crossed between two points, as in `crosses`."""
    return is_crossed(space.added, x, y, end_x, end_y) or is_crossed(space.solids, x, y, end_x, end_y)


@subroutine
def is_open(space: Space, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`is_clear` for a line between free positions, which is faster to test."""
    minimum = space.clearance - TOLERANCE
    return not is_near_line(space.added, minimum, x, y, end_x, end_y) and not is_near_line(
        space.solids, minimum, x, y, end_x, end_y
    )


@subroutine
def push(space: Space, x: float, y: float) -> Vector:
    """Displacement that moves a position off the barrier whose clearance it misses most."""
    k, deepest = nearest_within(space.solids, x, y, space.clearance)
    other, depth = nearest_within(space.added, x, y, deepest)
    if k < 0 and other < 0:
        return 0.0, 0.0
    dx, dy = towards(space.added.table, other, x, y) if other >= 0 else towards(space.solids.table, k, x, y)
    distance = length(dx, dy)
    if distance == 0.0:  # on the core line: no direction is better than another
        return 0.0, 0.0
    scale = max(space.clearance - depth, 0.0) / distance
    return -dx * scale, -dy * scale
