"""The neighbours of each pedestrian: those within the interaction range, found with a grid of square cells."""

from __future__ import annotations

import math

import numpy as np

from ...core.compiled import subroutine
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.scalar import clipped, crosses, length
from .models.base import Walkers

INTERACTION_RANGE = 6.0  # m, between centres; pedestrians that are farther apart do not affect each other
FADING_DISTANCE = 1.0  # m, over which attention falls to 0 at the range, so that no force sets in suddenly
_CELL = 1.001 * INTERACTION_RANGE  # m, minimum width: rounding must not put a pair within the range two cells apart


@subroutine
def find_neighbours(walkers: Walkers, is_present: BoolArray, view_blocks: Array) -> int:
    """Fill the neighbour lists: pedestrians within the interaction range, and the members of the same walking group.

    The time grows with the number of pedestrians and of neighbours. The lists do not depend on the cells.

    Args:
        walkers: `position` and `group` are used; `neighbour_start`, `neighbour` and `attention` are filled.
        is_present: (M,), pedestrians that are in the room; the others have no neighbours and are none.
        view_blocks: rows of the walls that can block a view.

    Returns:
        Number of neighbours in all lists together. If it exceeds the length of `neighbour`, the lists are not valid.
    """
    start, neighbour = walkers.neighbour_start, walkers.neighbour
    # Of each pedestrian the neighbours before and after it in the scene's order: first their number, later the place
    # of the next one in the lists.
    before, after = np.zeros(len(is_present), np.int64), np.zeros(len(is_present), np.int64)
    cells = _cells(walkers.position, is_present)
    _visit_pairs(walkers, is_present, cells, before, after, False)
    total = 0
    for i in range(len(is_present)):
        start[i] = total
        total += before[i] + after[i]
        before[i], after[i] = start[i], start[i] + before[i]
    start[len(is_present)] = total
    if total > len(neighbour):
        return total
    # Later neighbours arrive in ascending order. Reading them row by row gives the earlier ones in that order.
    _visit_pairs(walkers, is_present, cells, before, after, True)
    for i in range(len(is_present)):
        for n in range(before[i], start[i + 1]):
            j = neighbour[n]
            attention = _attention(walkers.position, i, j, view_blocks)
            neighbour[before[j]] = i
            walkers.attention[n] = walkers.attention[before[j]] = attention
            before[j] += 1
    return total


@subroutine
def is_hidden(x: float, y: float, other_x: float, other_y: float, view_blocks: Array) -> bool:
    """Whether a wall blocks the view from one point to another, m."""
    for b in range(len(view_blocks)):
        if crosses(view_blocks, b, x, y, other_x, other_y):
            return True
    return False


@subroutine
def _attention(position: Array, i: int, j: int, view_blocks: Array) -> float:
    """How much two pedestrians attend to each other: less near the range, not at all through walls."""
    x, y, other_x, other_y = position[i, 0], position[i, 1], position[j, 0], position[j, 1]
    distance = length(other_x - x, other_y - y)
    if distance >= INTERACTION_RANGE or is_hidden(x, y, other_x, other_y, view_blocks):
        return 0.0
    return clipped((INTERACTION_RANGE - distance) / FADING_DISTANCE, 0.0, 1.0)


# West and south edge, m; width and depth of a cell, m; numbers of columns and rows.
Cells = tuple[float, float, float, float, int, int]


@subroutine
def _cells(position: Array, is_present: BoolArray) -> Cells:
    """Cells that cover the pedestrians; neighbours are in the same cell or in adjacent ones."""
    west, south, east, north = math.inf, math.inf, -math.inf, -math.inf
    for i in range(len(position)):
        if is_present[i]:
            west, east = min(west, position[i, 0]), max(east, position[i, 0])
            south, north = min(south, position[i, 1]), max(north, position[i, 1])
    if not west < math.inf:
        return 0.0, 0.0, _CELL, _CELL, 1, 1
    most = int(math.sqrt(len(position))) + 1  # in each direction: not more cells than needed for few people far apart
    columns, rows = min(int((east - west) / _CELL) + 1, most), min(int((north - south) / _CELL) + 1, most)
    return west, south, max((east - west) / columns, _CELL), max((north - south) / rows, _CELL), columns, rows


@subroutine
def _visit_pairs(
    walkers: Walkers, is_present: BoolArray, cells: Cells, before: IntArray, after: IntArray, is_filling: bool
) -> None:
    """Count the neighbours before and after each pedestrian, or fill those after it into the lists."""
    position, group, neighbour = walkers.position, walkers.group, walkers.neighbour
    west, south, width, depth, columns, rows = cells
    square_range = INTERACTION_RANGE * INTERACTION_RANGE
    # Each cell and each group is a chain of the pedestrians that were visited before: the last one, and its precursors.
    in_cell, cell_chain = np.full(columns * rows, -1, np.int64), np.empty(len(position), np.int64)
    in_group, group_chain = np.full(len(position), -1, np.int64), np.empty(len(position), np.int64)
    for i in range(len(position)):
        if not is_present[i]:
            continue
        x, y, own_group = position[i, 0], position[i, 1], group[i]
        column, row = min(int((x - west) / width), columns - 1), min(int((y - south) / depth), rows - 1)
        for c in range(max(column - 1, 0), min(column + 2, columns)):
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                j = in_cell[c * rows + r]
                while j >= 0:
                    dx, dy = position[j, 0] - x, position[j, 1] - y
                    if dx * dx + dy * dy < square_range:
                        if is_filling:
                            neighbour[after[j]] = i
                        else:
                            before[i] += 1
                        after[j] += 1
                    j = cell_chain[j]
        cell_chain[i], in_cell[column * rows + row] = in_cell[column * rows + row], i
        if own_group >= 0:
            j = in_group[own_group]
            while j >= 0:
                dx, dy = position[j, 0] - x, position[j, 1] - y
                if not dx * dx + dy * dy < square_range:
                    if is_filling:
                        neighbour[after[j]] = i
                    else:
                        before[i] += 1
                    after[j] += 1
                j = group_chain[j]
            group_chain[i], in_group[own_group] = in_group[own_group], i
