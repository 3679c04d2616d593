"""A grid of square cells over barriers: kernels look at the barriers near a position or a line, not at all of them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .compiled.kernel import kernel, subroutine
from .compiled.packing import Floats2, Ints, Packed, unpack
from .compiled.scalar import (
    ALONG_X,
    ALONG_Y,
    END_X,
    END_Y,
    INVERSE,
    RADIUS,
    START_X,
    START_Y,
    clipped,
    crosses,
    gap,
    half_line,
    inverse_square,
    line_gap,
    to_line,
    towards,
)
from .geometry import Barriers, Point
from .portable_math import Array, IntArray

_SMALLEST_CELL = 1.0  # m
_FEW = 8  # barriers that need no more than one cell
_MOST_CELLS = 4096  # in each direction
_CHANGEABLE_CELL = 2.0  # m, least size of a cell for barriers that change; larger than their radii
_SLACK = 1e-6  # m, by which cells list more than they contain, against rounding


class Grid(NamedTuple):
    """Square cells in rows from south to north and columns from west to east; border cells go on beyond the grid.

    Attributes:
        west, south: edges, m.
        cell: side of a cell, m.
        columns, rows: their numbers.
        first: (C + 1,) of int, where the items of each cell begin; cells are numbered column by column.
        item: of int, barriers in each cell, ascending.
    """

    west: float
    south: float
    cell: float
    columns: int
    rows: int
    first: Ints
    item: Ints


class Solids(NamedTuple):
    """Barriers with their grid, for kernels.

    Attributes:
        table: (M, 8), rows of `Barriers.table`.
        used: (1,) of int, how many of the rows are used.
        grid: its items are rows of the table.
    """

    table: Floats2
    used: Ints
    grid: Grid


def solids_of(barriers: Barriers) -> Solids:
    """The barriers with their grid, which is made once."""
    solids: Solids | None = barriers.__dict__.get("_solids")
    if solids is None:
        solids = barriers.__dict__["_solids"] = with_grid_of(barriers.table)
    return solids


def packed_solids(barriers: Barriers) -> Packed[Solids]:
    """`solids_of` barriers as kernels take it."""
    packed: Packed[Solids] | None = barriers.__dict__.get("_packed_solids")
    if packed is None:
        packed = barriers.__dict__["_packed_solids"] = Packed(solids_of(barriers))
    return packed


def with_grid_of(table: Array) -> Solids:
    """The rows of a `Barriers.table` with their grid."""
    west, south, cell, columns, rows = _shape(table)
    first = np.zeros(columns * rows + 1, dtype=np.int64)
    grid = Grid(west, south, cell, columns, rows, first, np.empty(0, dtype=np.int64))
    _fill(table, *grid[:5], first, grid.item)
    grid = grid._replace(item=np.empty(int(first[-1]), dtype=np.int64))
    _fill(table, *grid[:5], first, grid.item)
    return Solids(table, np.array([len(table)]), grid)


def changeable_solids(around: Solids, capacity: int) -> Solids:
    """Space for barriers that kernels set, see `set_barrier` and `fill_grid`; at first there are none.

    Args:
        around: barriers of the same room, whose area the grid covers.
        capacity: largest number of barriers.
    """
    grid = around.grid
    width, depth = grid.columns * grid.cell, grid.rows * grid.cell
    cell = max(math.sqrt(width * depth / max(capacity, 1)), _CHANGEABLE_CELL)
    columns, rows = int(width / cell) + 1, int(depth / cell) + 1
    # A line through the whole room and a cell beside it on each side.
    most = 3 * (columns + rows + 2) * capacity
    first, item = np.zeros(columns * rows + 1, dtype=np.int64), np.zeros(most, dtype=np.int64)
    return Solids(
        np.zeros((capacity, 8)), np.zeros(1, np.int64), Grid(grid.west, grid.south, cell, columns, rows, first, item)
    )


@kernel
def _shape(table: Array) -> tuple[float, float, float, int, int]:
    """West and south edge, size of a cell, columns and rows of the grid of a table: about one barrier a cell."""
    if len(table) == 0:
        return 0.0, 0.0, 1.0, 1, 1
    west, south, east, north = math.inf, math.inf, -math.inf, -math.inf
    for k in range(len(table)):
        radius = table[k, RADIUS]
        west, east = min(west, _low(table, k, 0) - radius), max(east, _high(table, k, 0) + radius)
        south, north = min(south, _low(table, k, 1) - radius), max(north, _high(table, k, 1) + radius)
    if len(table) <= _FEW:
        return west, south, max(east - west, north - south, 1.0), 1, 1
    cell = max(math.sqrt((east - west) * (north - south) / len(table)), _SMALLEST_CELL)
    cell = max(cell, (east - west) / _MOST_CELLS, (north - south) / _MOST_CELLS)
    return west, south, cell, int((east - west) / cell) + 1, int((north - south) / cell) + 1


@subroutine
def _low(table: Array, k: int, axis: int) -> float:
    """Smallest coordinate of the core line of barrier k on an axis, m."""
    return float(min(table[k, START_X + axis], table[k, END_X + axis]))


@subroutine
def _high(table: Array, k: int, axis: int) -> float:
    """Largest coordinate of the core line of barrier k on an axis, m."""
    return float(max(table[k, START_X + axis], table[k, END_X + axis]))


@kernel
def _fill(
    table: Array, west: float, south: float, cell: float, columns: int, rows: int, first: IntArray, item: IntArray
) -> None:
    """`fill_grid` of all barriers of a table, (M, 8), with the fields of a `Grid`."""
    fill_grid(table, len(table), Grid(west, south, cell, columns, rows, first, item))


@subroutine
def set_barrier(table: Array, k: int, x: float, y: float, end_x: float, end_y: float, radius: float) -> None:
    """Set row k of a `Barriers.table`."""
    table[k, START_X], table[k, START_Y], table[k, END_X], table[k, END_Y] = x, y, end_x, end_y
    table[k, RADIUS], table[k, ALONG_X], table[k, ALONG_Y] = radius, end_x - x, end_y - y
    table[k, INVERSE] = inverse_square(end_x - x, end_y - y)


@subroutine
def fill_grid(table: Array, count: int, grid: Grid) -> None:
    """Fill `Grid.first`, and `Grid.item` if it is long enough.

    Args:
        table: (M, 8), rows of `Barriers.table`.
        count: of rows that are used.
        grid: of them.
    """
    first, item, columns, rows = grid.first, grid.item, grid.columns, grid.rows
    first[:] = 0
    for k in range(count):
        for place in range(_first_column(grid, table, k), _last_column(grid, table, k) + 1):
            low, high = _rows_of(grid, table, k, place)
            for row in range(low, high + 1):
                first[place * rows + row + 1] += 1
    for c in range(columns * rows):
        first[c + 1] += first[c]
    if first[columns * rows] > len(item):
        return
    following = first.copy()
    for k in range(count):
        for place in range(_first_column(grid, table, k), _last_column(grid, table, k) + 1):
            low, high = _rows_of(grid, table, k, place)
            for row in range(low, high + 1):
                item[following[place * rows + row]] = k
                following[place * rows + row] += 1


@subroutine
def _first_column(grid: Grid, table: Array, k: int) -> int:
    return column_of(grid, _low(table, k, 0) - table[k, RADIUS] - _SLACK)


@subroutine
def _last_column(grid: Grid, table: Array, k: int) -> int:
    return column_of(grid, _high(table, k, 0) + table[k, RADIUS] + _SLACK)


@subroutine
def _rows_of(grid: Grid, table: Array, k: int, column: int) -> tuple[int, int]:
    """First and last row of the cells of a column that barrier k reaches."""
    reach = table[k, RADIUS] + _SLACK
    return rows_near_line(grid, column, table[k, START_X], table[k, START_Y], table[k, END_X], table[k, END_Y], reach)


@subroutine
def column_of(grid: Grid, x: float) -> int:
    """The column at a coordinate, m; the first or the last one beyond the grid."""
    return int(clipped((x - grid.west) / grid.cell, 0.0, grid.columns - 1.0))


@subroutine
def row_of(grid: Grid, y: float) -> int:
    """The row at a coordinate, m; the first or the last one beyond the grid."""
    return int(clipped((y - grid.south) / grid.cell, 0.0, grid.rows - 1.0))


@subroutine
def rows_near_line(
    grid: Grid, column: int, x: float, y: float, end_x: float, end_y: float, reach: float
) -> tuple[int, int]:
    """First and last row of the cells of a column within a distance of a straight line from (x, y) to its end, m."""
    dx, dy, low, high = end_x - x, end_y - y, min(y, end_y), max(y, end_y)
    if dx != 0.0:
        # The part of the line that is near to the column; border columns have no end.
        left, right = grid.west + column * grid.cell - reach, grid.west + (column + 1) * grid.cell + reach
        a = -math.inf if column == 0 else (left - x) / dx
        b = math.inf if column == grid.columns - 1 else (right - x) / dx
        if dx < 0.0:
            a = math.inf if column == 0 else a
            b = -math.inf if column == grid.columns - 1 else b
        ya, yb = y + clipped(a, 0.0, 1.0) * dy, y + clipped(b, 0.0, 1.0) * dy
        low, high = min(ya, yb), max(ya, yb)
    return row_of(grid, low - reach), row_of(grid, high + reach)


@subroutine
def is_blocked(
    solids: Solids, clearance: float, tolerance: float, x: float, y: float, end_x: float, end_y: float
) -> bool:
    """Whether a barrier is nearer to a straight line than the clearance less the tolerance, m."""
    table, grid = solids.table, solids.grid
    if solids.used[0] == 0:
        return False
    first, last = column_of(grid, min(x, end_x) - clearance), column_of(grid, max(x, end_x) + clearance)
    for column in range(first, last + 1):
        low, high = rows_near_line(grid, column, x, y, end_x, end_y, clearance)
        # Cells of a column follow each other.
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            if is_too_near(table, grid.item[n], clearance, tolerance, x, y, end_x, end_y):
                return True
    return False


@subroutine
def is_too_near(
    table: Array, k: int, clearance: float, tolerance: float, x: float, y: float, end_x: float, end_y: float
) -> bool:
    """Whether barrier k is nearer to a straight line than the clearance less the tolerance, m."""
    if _is_beside(table, k, clearance, min(x, end_x), min(y, end_y), max(x, end_x), max(y, end_y)):
        return False
    return line_gap(table, k, x, y, end_x, end_y) < clearance - tolerance


@subroutine
def _is_beside(
    table: Array, k: int, clearance: float, low_x: float, low_y: float, high_x: float, high_y: float
) -> bool:
    """Whether barrier k keeps a clearance, m, from a rectangle because it is beyond one of its sides, as most are."""
    reach = table[k, RADIUS] + clearance
    return bool(
        _low(table, k, 0) > high_x + reach
        or _high(table, k, 0) < low_x - reach
        or _low(table, k, 1) > high_y + reach
        or _high(table, k, 1) < low_y - reach
    )


@subroutine
def is_near_line(solids: Solids, minimum: float, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a barrier is nearer to a straight line than a minimum, m, if both ends of the line keep the minimum.

    Faster than `is_blocked`: only the ends of the barrier, and crossings, need a test.
    """
    table, grid = solids.table, solids.grid
    if solids.used[0] == 0:
        return False
    along_x, along_y = end_x - x, end_y - y
    inverse = inverse_square(along_x, along_y)
    low_x, high_x, low_y, high_y = min(x, end_x), max(x, end_x), min(y, end_y), max(y, end_y)
    first, last = column_of(grid, low_x - minimum), column_of(grid, high_x + minimum)
    for column in range(first, last + 1):
        low, high = rows_near_line(grid, column, x, y, end_x, end_y, minimum)
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            k = grid.item[n]
            if _is_beside(table, k, minimum, low_x, low_y, high_x, high_y):
                continue
            reach = table[k, RADIUS] + minimum
            square = reach * reach
            dx, dy = to_line(table[k, START_X] - x, table[k, START_Y] - y, along_x, along_y, inverse)
            if dx * dx + dy * dy < square:
                return True
            dx, dy = to_line(table[k, END_X] - x, table[k, END_Y] - y, along_x, along_y, inverse)
            if dx * dx + dy * dy < square or crosses(table, k, x, y, end_x, end_y):
                return True
    return False


@subroutine
def is_crossed(solids: Solids, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a straight line properly crosses the core line of a barrier, as in `crosses`; m."""
    grid = solids.grid
    for column in range(column_of(grid, min(x, end_x)), column_of(grid, max(x, end_x)) + 1):
        low, high = rows_near_line(grid, column, x, y, end_x, end_y, 0.0)
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            if crosses(solids.table, grid.item[n], x, y, end_x, end_y):
                return True
    return False


@subroutine
def is_within(solids: Solids, x: float, y: float, distance: float) -> bool:
    """Whether the surface of a barrier is nearer to a point than a distance, m."""
    grid = solids.grid
    low, high = row_of(grid, y - distance), row_of(grid, y + distance)
    for column in range(column_of(grid, x - distance), column_of(grid, x + distance) + 1):
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            if gap(solids.table, grid.item[n], x, y) < distance:
                return True
    return False


@subroutine
def nearest_within(solids: Solids, x: float, y: float, distance: float) -> tuple[int, float]:
    """The barrier nearest to a point among those within a distance, m, and its gap; -1 and the distance without one."""
    grid, nearest, least = solids.grid, -1, distance
    low, high = row_of(grid, y - distance), row_of(grid, y + distance)
    for column in range(column_of(grid, x - distance), column_of(grid, x + distance) + 1):
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            k = grid.item[n]
            clearance = gap(solids.table, k, x, y)
            if clearance < least or (clearance == least and nearest >= 0 and k < nearest):
                nearest, least = k, clearance
    return nearest, least


@subroutine
def outline_gap(
    solids: Solids, x: float, y: float, body_x: float, body_y: float, radius: float, shoulder: float, limit: float
) -> float:
    """Gap between the outline of a person and the nearest barrier, m; negative where they overlap.

    Args:
        solids: barriers.
        x, y: position, m.
        body_x, body_y: unit vector of the heading.
        radius, shoulder: of its body, m; see `Humans`.
        limit: m, of the gap: barriers that are farther away are not looked for.
    """
    grid, nearest, half = solids.grid, limit + radius, abs(shoulder)
    along_x, along_y = half_line(body_x, body_y, shoulder)
    reach = nearest + half
    low, high = row_of(grid, y - reach), row_of(grid, y + reach)
    for column in range(column_of(grid, x - reach), column_of(grid, x + reach) + 1):
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            k = grid.item[n]
            if gap(solids.table, k, x, y) - half < nearest:
                distance = line_gap(solids.table, k, x + along_x, y + along_y, x - along_x, y - along_y)
                nearest = min(nearest, distance)
    return nearest - radius


@subroutine
def find_within(solids: Solids, x: float, y: float, distance: float, found: IntArray) -> int:
    """Find the barriers within a distance of a point, m, measured to their surfaces; in ascending order.

    Args:
        solids, x, y, distance: m.
        found: of int, as long as the table; is filled.

    Returns:
        Their number.
    """
    grid, table, count = solids.grid, solids.table, 0
    low, high = row_of(grid, y - distance), row_of(grid, y + distance)
    for column in range(column_of(grid, x - distance), column_of(grid, x + distance) + 1):
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            k = grid.item[n]
            dx, dy = towards(table, k, x, y)
            reach, place = distance + table[k, RADIUS], count
            if not dx * dx + dy * dy < reach * reach:
                continue
            while place > 0 and found[place - 1] > k:
                place -= 1
            if place > 0 and found[place - 1] == k:  # a barrier lies in several cells
                continue
            for m in range(count, place, -1):
                found[m] = found[m - 1]
            found[place] = k
            count += 1
    return count


@kernel
def _list_within(packed_solids: Any, x: float, y: float, distance: float, found: IntArray) -> int:
    """`find_within` in packed `Solids`."""
    return find_within(unpack(packed_solids, Solids), x, y, distance, found)


def rows_within(solids: Packed[Solids], point: Point, distance: float) -> IntArray:
    """Rows of the table within a distance of a point, m, measured to their surfaces; (K,) of int, ascending."""
    found = np.empty(len(solids.value.table), dtype=np.int64)
    return found[: _list_within(solids.argument, float(point[0]), float(point[1]), distance, found)]
