"""The neighbours of each pedestrian: those to whom it attends, found with a grid of square cells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, find_within, is_crossed, nearest_within
from ...core.compiled.kernel import subroutine
from ...core.compiled.scalar import clipped, length
from ...core.portable_math import Array, BoolArray, IntArray
from .models.base import Walkers

INTERACTION_RANGE = 5.0  # m, between centres; pedestrians that are farther apart do not affect each other
_ATTENDED = 20.0  # number of others in sight from which on the range shrinks: near people hide those behind them
WALL_RANGE = 2.0  # m, from the centre of a pedestrian to the surface of a wall; others have no effect on it
FADING_DISTANCE = 1.0  # m, over which attention falls to 0 at the range, so that no force sets in suddenly
_MANY = 6  # for more neighbours, the distance of the nearest wall is found first
_CELL = 1.001 * INTERACTION_RANGE  # m, minimum width: rounding must not put a pair within the range two cells apart


@subroutine
def find_neighbours(walkers: Walkers, is_present: BoolArray, view_blocks: Solids) -> int:
    """Fill the neighbour lists: pedestrians to whom each one attends, and the members of the same walking group.

    The time grows with the number of pedestrians and of neighbours. The lists do not depend on the cells. The attention
    is 1 near by and falls to 0 at the range of `range_of`; it is 0 for a member of the group out of sight.

    Args:
        walkers: `position` and `group` are used; `neighbour_start`, `neighbour` and `attention` are filled.
        is_present: (M,), pedestrians that are in the room; the others have no neighbours and are none.
        view_blocks: walls that can block a view.

    Returns:
        Number of pairs in both directions within the interaction range, or of one group, as far as they were found
        before `neighbour` was full. If it exceeds the length of `neighbour`, the lists are not valid.
    """
    position, start, neighbour = walkers.position, walkers.neighbour_start, walkers.neighbour
    count, capacity = len(position), len(neighbour) // 2  # pairs
    # The pairs: of each pedestrian the neighbours before it in the scene's order, and their distances.
    earlier, away = np.empty(capacity + count, np.int64), np.empty(capacity + count)
    first_pair, later = np.empty(count + 1, np.int64), np.zeros(count, np.int64)
    grid = _empty_grid(position, is_present)
    last_of_group, previous_member = np.full(count, -1, np.int64), np.empty(count, np.int64)
    pairs = 0
    for i in range(count):
        first_pair[i] = pairs
        if not is_present[i]:
            continue
        x, y, group = position[i, 0], position[i, 1], walkers.group[i]
        pairs = _append_near(grid, x, y, earlier, pairs)
        _insert(grid, i, x, y)
        near = pairs
        if group >= 0:
            j = last_of_group[group]
            while j >= 0:
                earlier[pairs] = j
                pairs += not _is_within_range(position[j, 0] - x, position[j, 1] - y)
                j = previous_member[j]
            previous_member[i], last_of_group[group] = last_of_group[group], i
        if pairs > capacity:
            return 2 * pairs
        view = 0.0  # m, within which nothing blocks a line of sight
        if near - first_pair[i] > _MANY:
            _, view = nearest_within(view_blocks, x, y, INTERACTION_RANGE)
        for n in range(first_pair[i], pairs):
            j = earlier[n]
            later[j] += 1
            away[n] = INTERACTION_RANGE
            distance = length(position[j, 0] - x, position[j, 1] - y)
            if n < near and (distance < view or not is_crossed(view_blocks, x, y, position[j, 0], position[j, 1])):
                away[n] = distance
    first_pair[count] = pairs

    # Later neighbours arrive in ascending order. Reading them row by row gives the earlier ones in that order.
    total = 0
    for i in range(count):
        start[i] = total
        before = first_pair[i + 1] - first_pair[i]
        total += before + later[i]
        later[i] = start[i] + before  # from now on, where the next one goes
    start[count] = total
    for i in range(count):
        for n in range(first_pair[i], first_pair[i + 1]):
            place = later[earlier[n]]
            neighbour[place], walkers.attention[place] = i, away[n]
            later[earlier[n]] = place + 1
    for i in range(count):
        later[i] = start[i]
    for i in range(count):
        for n in range(later[i], start[i + 1]):
            place = later[neighbour[n]]
            neighbour[place], walkers.attention[place] = i, walkers.attention[n]
            later[neighbour[n]] = place + 1
    low = kept = 0
    for i in range(count):
        high, in_sight, group = start[i + 1], 0, walkers.group[i]
        for n in range(low, high):
            in_sight += walkers.attention[n] < INTERACTION_RANGE
        reach, start[i] = range_of(in_sight), kept
        for n in range(low, high):
            weight = clipped((reach - walkers.attention[n]) / FADING_DISTANCE, 0.0, 1.0)
            if weight > 0.0 or (group >= 0 and walkers.group[neighbour[n]] == group):
                neighbour[kept], walkers.attention[kept] = neighbour[n], weight
                kept += 1
        low = high
    start[count] = kept
    return total


@subroutine
def range_of(in_sight: int) -> float:
    """Distance within which a pedestrian attends to others, m.

    In a crowd it is the radius of a circle with about the same number of people at any density.

    Args:
        in_sight: number of others in sight within `INTERACTION_RANGE`.

    Source: the denser a crowd, the more of it is hidden behind near people (Wirth et al., PNAS Nexus 2 (2023) pgad118);
    the formula is ours.
    """
    return INTERACTION_RANGE * min(math.sqrt(_ATTENDED / max(in_sight, 1)), 1.0)


@subroutine
def find_walls(walkers: Walkers, is_present: BoolArray, solids: Solids) -> int:
    """Fill the lists of walls and edges of furniture within `WALL_RANGE` of each pedestrian that is present.

    Args:
        walkers: `position` is used; `wall_start` and `wall` are filled.
        is_present: (M,).
        solids: walls and furniture.

    Returns:
        Number of walls in all lists together. If it exceeds the length of `wall`, the lists are not valid.
    """
    found, total = np.empty(len(solids.table), np.int64), 0
    for i in range(len(walkers.position)):
        walkers.wall_start[i] = total
        if is_present[i]:
            count = find_within(solids, walkers.position[i, 0], walkers.position[i, 1], WALL_RANGE, found)
            for n in range(min(count, len(walkers.wall) - total)):
                walkers.wall[total + n] = found[n]
            total += count
    walkers.wall_start[len(walkers.position)] = total
    return total


def with_longer_lists(walkers: Walkers, neighbours: int, walls: int) -> Walkers:
    """Walkers whose lists have room for twice as many neighbours and walls, and never for fewer; they are empty."""
    count = len(walkers.position)
    pairs = max(len(walkers.neighbour), 2 * max(neighbours, 8 * count))  # one of the lists may be long enough
    return with_lists(walkers, pairs, max(len(walkers.wall), 2 * max(walls, 8 * count)))


def with_lists(walkers: Walkers, neighbours: int, walls: int) -> Walkers:
    """Walkers whose lists have room for a number of neighbours and walls; they are empty."""
    return walkers._replace(
        neighbour=np.zeros(neighbours, dtype=np.int64), attention=np.zeros(neighbours),
        wall=np.zeros(walls, dtype=np.int64),
    )  # fmt: skip


@subroutine
def _is_within_range(dx: float, dy: float) -> bool:
    return dx * dx + dy * dy < INTERACTION_RANGE * INTERACTION_RANGE


class Grid(NamedTuple):
    """Square cells that cover the pedestrians; neighbours are in the same cell or in adjacent ones.

    Attributes:
        west, south: edges, m.
        width, depth: of a cell, m.
        columns, rows: their numbers.
        begin: (C,) of int, where the pedestrians of each cell begin.
        end: (C,) of int, where those that were inserted end.
        pedestrian: (N,) of int, their indices, cell by cell.
        x, y: (N,), their positions, m.
    """

    west: float
    south: float
    width: float
    depth: float
    columns: int
    rows: int
    begin: IntArray
    end: IntArray
    pedestrian: IntArray
    x: Array
    y: Array


@subroutine
def _empty_grid(position: Array, is_present: BoolArray) -> Grid:
    """A grid with space for the pedestrians that are present."""
    west, south, east, north = math.inf, math.inf, -math.inf, -math.inf
    for i in range(len(position)):
        if is_present[i]:
            west, east = min(west, position[i, 0]), max(east, position[i, 0])
            south, north = min(south, position[i, 1]), max(north, position[i, 1])
    width, depth, columns, rows = _CELL, _CELL, 1, 1
    if west < math.inf:
        most = int(math.sqrt(len(position))) + 1  # in each direction: few people far apart need no more cells
        columns, rows = min(int((east - west) / _CELL) + 1, most), min(int((north - south) / _CELL) + 1, most)
        width, depth = max((east - west) / columns, _CELL), max((north - south) / rows, _CELL)
    begin, end = np.zeros(columns * rows, np.int64), np.zeros(columns * rows, np.int64)
    pedestrian, xs, ys = np.empty(len(position), np.int64), np.empty(len(position)), np.empty(len(position))
    grid = Grid(west, south, width, depth, columns, rows, begin, end, pedestrian, xs, ys)
    for i in range(len(position)):
        if is_present[i]:
            column, row = _cell(grid, position[i, 0], position[i, 1])
            end[column * rows + row] += 1
    total = 0
    for c in range(len(begin)):
        begin[c] = total
        total += end[c]
        end[c] = begin[c]
    return grid


@subroutine
def _cell(grid: Grid, x: float, y: float) -> tuple[int, int]:
    """Column and row of a position."""
    column, row = int((x - grid.west) / grid.width), int((y - grid.south) / grid.depth)
    return min(column, grid.columns - 1), min(row, grid.rows - 1)


@subroutine
def _insert(grid: Grid, i: int, x: float, y: float) -> None:
    """Add pedestrian i at (x, y)."""
    column, row = _cell(grid, x, y)
    n = grid.end[column * grid.rows + row]
    grid.pedestrian[n], grid.x[n], grid.y[n] = i, x, y
    grid.end[column * grid.rows + row] = n + 1


@subroutine
def _append_near(grid: Grid, x: float, y: float, candidates: IntArray, count: int) -> int:
    """Append the pedestrians within the range of (x, y) to the first `count` found ones; returns their new number."""
    column, row = _cell(grid, x, y)
    for c in range(max(column - 1, 0), min(column + 2, grid.columns)):
        for r in range(max(row - 1, 0), min(row + 2, grid.rows)):
            for n in range(grid.begin[c * grid.rows + r], grid.end[c * grid.rows + r]):
                candidates[count] = grid.pedestrian[n]  # no branch, which would cost more: the next one overwrites it
                count += _is_within_range(grid.x[n] - x, grid.y[n] - y)
    return count
