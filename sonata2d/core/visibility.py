"""Kernels of `navigation`: the visibility graph. Its nodes are the points at which shortest paths can turn."""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from .barrier_grid import Grid, Solids, column_of, is_near_line, row_of
from .compiled.calls import call_for_int
from .compiled.kernel import kernel, subroutine
from .compiled.packing import Bools, Floats, Floats2, Ints, ShortInts2, unpack
from .compiled.scalar import END_X, END_Y, RADIUS, START_X, START_Y, Vector, length, towards
from .free_space import TOLERANCE, Space, is_free, is_in_hole
from .portable_math import PI, TAN_PI_8, Array, BoolArray, IntArray, unit_vectors
from .vectors import X, Y

MARGIN = 1e-3  # m, distance of turning points from the inflated corners

# Candidates for turning points, as offsets (ahead, left) from discs, corners and free ends of barriers: for each of
# these kinds a wide polygon, and one with more points that keeps closer to the barrier, for places where the wide one
# does not fit. Polygons around discs touch the unit circle; those at corners are in units of `_MITRE` and `_CUT`.
_DISC, _CORNER, _FREE_END = 0, 1, 2
_POLYGONS: tuple[Any, ...] = (
    unit_vectors(np.arange(6) * PI / 3) * 1.1547005383792517,
    unit_vectors(np.arange(12) * PI / 6) * 1.0352761804100832,
    [(1.0, 0.0)],
    [(1.0, 1.0), (1.0, -1.0)],
    [(1.0, 1.0), (1.0, -1.0)],
    [(1.0, TAN_PI_8), (1.0, -TAN_PI_8), (TAN_PI_8, 1.0), (TAN_PI_8, -1.0)],
)
_STEPS = np.concatenate(_POLYGONS)
_FIRST = np.array([*accumulate((len(polygon) for polygon in _POLYGONS), initial=0)])  # step of each polygon
# columns of origins of turning points, after x and y
_AHEAD_X, _AHEAD_Y, _REACH, _KIND, _MITRE, _CUT = range(2, 8)
_MIN_SINE = 0.5  # of half the angle of a corner; a corner under 60° would have a long mitre, so it counts as two ends
_MIN_COSINE = 1e-6  # of half the angle of a corner; below it the barriers are collinear and need no turning point
MOST_POINTS, NODE_SIZE = 12, 3  # points around one origin, columns of `Graph.nodes`

_SECTORS = 256  # of directions, for which it is known whether the view is blocked
_FEW = 16  # nodes that are tested without this
_BEYOND = 10.0  # m, more than a turning point can lie beyond the grid
_END = -1  # after the last item of a row of `Graph.visible`


class Graph(NamedTuple):
    """Visibility graph of a `Space`.

    Attributes:
        origins: (C, 8), around which the nodes lie, see `_origins`.
        nodes: (n, 3), turning points around `Space.solids`, free of these, m; origin of the wide polygon that it is a
            corner of, or -1.
        first, item: nodes in each cell of the grid of `Space.solids`, as in `Grid`.
        visible: (n, S) of int, for each node the nodes that are visible from it among `Space.solids`, then `_END`.
            They are numbered from 1 on; a row with a 0 in front of `_END`, or without `_END`, is not known yet.
        component: (n,) of int, number of the connected component of each node, from 1 on; 0 while not known.
        added_nodes: (A, 3), the same around `Space.added`, and closer ones in place of nodes of wide polygons that are
            not free any more; free of all barriers; as many as `added_count`.
        is_covered: (n,) of bool, nodes that are not free of `Space.added`.
        added_count: (1,) of int, -1 before the last two are filled.
        start, from_start: the last start of a search, m, and the components that are visible from it, (n + 1,) of
            bool; a pedestrian without a destination tries several from one place.
        find_row, complete: addresses of the kernels of these names.
    """

    origins: Floats2
    nodes: Floats2
    first: Ints
    item: Ints
    visible: ShortInts2
    component: Ints
    added_nodes: Floats2
    is_covered: Bools
    added_count: Ints
    start: Floats
    from_start: Bools
    find_row: Ints
    complete: Ints


@kernel
def find_nodes(packed_space: Any) -> tuple[Array, Array]:
    """`Graph.origins` and `Graph.nodes` of a space without added barriers."""
    space = unpack(packed_space, Space)
    origins = _origins(space.solids, space.clearance + MARGIN)
    nodes = np.empty((MOST_POINTS * len(origins), NODE_SIZE))
    return origins, nodes[: _turning_points(space, origins, nodes)]


def index_nodes(grid: Grid, nodes: Array) -> tuple[IntArray, IntArray]:
    """`Graph.first` and `Graph.item`."""
    corner, most = np.array((grid.west, grid.south)), (grid.columns - 1.0, grid.rows - 1.0)
    column, row = ((nodes[:, : Y + 1] - corner) / grid.cell).clip(0.0, most).astype(np.int64).T
    cell = column * grid.rows + row
    item = np.argsort(cell, kind="stable")
    return np.searchsorted(cell[item], np.arange(grid.columns * grid.rows + 1)), item


@subroutine
def _cell(grid: Grid, x: float, y: float) -> int:
    return column_of(grid, x) * grid.rows + row_of(grid, y)


@kernel
def complete(packed_space: Any, packed_graph: Any) -> None:
    """Fill what depends on added barriers, if that was not done before."""
    space, graph = unpack(packed_space, Space), unpack(packed_graph, Graph)
    if graph.added_count[0] >= 0:
        return
    added, grid = space.added, space.solids.grid
    graph.added_count[0] = 0
    if added.used[0] == 0:
        return
    minimum = space.clearance - TOLERANCE
    for k in range(added.used[0]):
        reach = minimum + added.table[k, RADIUS]
        ax, ay, bx, by = added.table[k, START_X], added.table[k, START_Y], added.table[k, END_X], added.table[k, END_Y]
        low, high = row_of(grid, min(ay, by) - reach), row_of(grid, max(ay, by) + reach)
        for column in range(column_of(grid, min(ax, bx) - reach), column_of(grid, max(ax, bx) + reach) + 1):
            for n in range(graph.first[column * grid.rows + low], graph.first[column * grid.rows + high + 1]):
                i = graph.item[n]
                dx, dy = towards(added.table, k, graph.nodes[i, X], graph.nodes[i, Y])
                if dx * dx + dy * dy < reach * reach:
                    graph.is_covered[i] = True
    if space.hole_count[0] > 0:
        for i in range(len(graph.nodes)):
            if is_in_hole(space, graph.nodes[i, X], graph.nodes[i, Y]):
                graph.is_covered[i] = True
    around = _origins(added, space.clearance + MARGIN)
    # Around other obstacles, closer polygons take the place of wide ones that do not fit any more.
    nodes, count, done = graph.added_nodes, _turning_points(space, around, graph.added_nodes), -1
    for i in range(len(graph.nodes)):
        k = int(graph.nodes[i, 2])
        if graph.is_covered[i] and k >= 0 and k != done:  # nodes of one polygon follow each other
            done, polygon = k, 2 * int(graph.origins[k, _KIND]) + 1
            for step in range(_FIRST[polygon], _FIRST[polygon + 1]):
                x, y = _candidate(graph.origins, k, step, True)
                if count < len(nodes) and is_free(space, x, y):
                    nodes[count, X], nodes[count, Y], nodes[count, 2] = x, y, -1.0
                    count += 1
    graph.added_count[0] = count


@subroutine
def is_node(graph: Graph, i: int) -> bool:
    """Whether node i is free of added barriers; the nodes are numbered one after the other."""
    return i >= len(graph.nodes) or not graph.is_covered[i]


@subroutine
def node(graph: Graph, i: int) -> Vector:
    """Position of node i, m."""
    if i < len(graph.nodes):
        return graph.nodes[i, X], graph.nodes[i, Y]
    i -= len(graph.nodes)
    return graph.added_nodes[i, X], graph.added_nodes[i, Y]


@subroutine
def _turning_points(space: Space, origins: Array, nodes: Array) -> int:
    """Fill `Graph.nodes` with free positions around origins, from wide polygons, or closer ones where these do not fit.

    Returns:
        Their number.
    """
    count = 0
    fits = np.empty(len(origins), dtype=np.bool_)
    for polygon in range(len(_FIRST) - 1):
        kind, is_close = polygon // 2, polygon % 2 == 1
        for k in range(len(origins)):
            if origins[k, _KIND] != kind or (is_close and fits[k]):
                continue
            first = count
            for step in range(_FIRST[polygon], _FIRST[polygon + 1]):
                x, y = _candidate(origins, k, step, is_close)
                if is_free(space, x, y):
                    nodes[count, X], nodes[count, Y] = x, y
                    nodes[count, 2] = -1.0 if is_close else k
                    count += 1
            if not is_close:
                fits[k] = count - first == _FIRST[polygon + 1] - _FIRST[polygon]
                if not fits[k]:
                    count = first
    return count


@subroutine
def _candidate(origins: Array, k: int, step: int, is_close: bool) -> Vector:
    """A point of the wide or the close polygon around origin k, m."""
    ahead, left = _STEPS[step, 0], _STEPS[step, 1]
    if is_close:
        left = left * origins[k, _CUT]
    else:
        ahead = ahead * origins[k, _MITRE]
    ahead_x, ahead_y, radius = origins[k, _AHEAD_X], origins[k, _AHEAD_Y], origins[k, _REACH]
    x = origins[k, X] + radius * (ahead_x * ahead - ahead_y * left)
    return x, origins[k, Y] + radius * (ahead_y * ahead + ahead_x * left)


@subroutine
def _origins(solids: Solids, offset: float) -> Array:
    """The discs, corners and free ends of barriers, around which paths turn.

    Args:
        solids: barriers.
        offset: distance of turning points from the barriers' surfaces, m.

    Returns:
        (C, 8): position, m; direction to which the barrier ends (unit vector); radius of the barrier and offset, m;
        kind; for corners, the factors by which the points lie farther ahead and aside.
    """
    table, barriers = solids.table, solids.used[0]
    origins, count = np.empty((2 * barriers, 8)), 0
    for k in range(barriers):
        if not _has_length(table, k):
            origins[count, X], origins[count, Y] = table[k, START_X], table[k, START_Y]
            origins[count, _AHEAD_X], origins[count, _AHEAD_Y] = 1.0, 0.0
            origins[count, _REACH], origins[count, _KIND] = table[k, RADIUS] + offset, _DISC
            origins[count, _MITRE], origins[count, _CUT] = 1.0, 1.0
            count += 1
    for side in range(2):
        for k in range(barriers):
            if not _has_length(table, k):
                continue
            partner, partner_side, meeting = _meeting_end(solids, k, side)
            ahead_x, ahead_y = _direction_at(table, k, side)
            origins[count, X], origins[count, Y] = table[k, 2 * side], table[k, 2 * side + 1]
            origins[count, _AHEAD_X], origins[count, _AHEAD_Y] = ahead_x, ahead_y
            origins[count, _REACH], origins[count, _KIND] = table[k, RADIUS] + offset, _FREE_END
            origins[count, _MITRE], origins[count, _CUT] = 1.0, 1.0
            if meeting == 1:
                other_x, other_y = _direction_at(table, partner, partner_side)
                x, y = ahead_x + other_x, ahead_y + other_y
                cosine = length(x, y) / 2  # of half the angle between the two barriers
                sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
                if sine >= _MIN_SINE:
                    # Each corner once, at the first of its two ends; none where a wall continues straight on.
                    is_first = side < partner_side or (side == partner_side and k < partner)
                    if not (is_first and cosine > _MIN_COSINE):
                        continue
                    origins[count, _AHEAD_X], origins[count, _AHEAD_Y] = x / (2 * cosine), y / (2 * cosine)
                    origins[count, _MITRE], origins[count, _CUT] = 1 / sine, (1.0 - sine) / cosine
                    origins[count, _KIND] = _CORNER
            count += 1
    return origins[:count]


@subroutine
def _has_length(table: Array, k: int) -> bool:
    """Whether barrier k is no disc."""
    return bool(table[k, START_X] != table[k, END_X] or table[k, START_Y] != table[k, END_Y])


@subroutine
def _direction_at(table: Array, k: int, side: int) -> Vector:
    """Unit vector from the other end of barrier k to its start (side 0) or end (side 1)."""
    along_x, along_y = table[k, END_X] - table[k, START_X], table[k, END_Y] - table[k, START_Y]
    size, sign = length(along_x, along_y), 2.0 * side - 1.0
    return sign * (along_x / size), sign * (along_y / size)


@subroutine
def _meeting_end(solids: Solids, k: int, side: int) -> tuple[int, int, int]:
    """An end of another barrier at the same point as an end of barrier k: barrier, side, and number of such ends."""
    table, grid = solids.table, solids.grid
    x, y = table[k, 2 * side], table[k, 2 * side + 1]
    cell, partner, partner_side, meeting = _cell(grid, x, y), -1, 0, 0
    for n in range(grid.first[cell], grid.first[cell + 1]):
        j = grid.item[n]
        for other in range(2):
            is_same = j == k and other == side
            if table[j, 2 * other] == x and table[j, 2 * other + 1] == y and not is_same and _has_length(table, j):
                partner, partner_side, meeting = j, other, meeting + 1
    return partner, partner_side, meeting


# Visible nodes


@subroutine
def _visible_nodes(space: Space, graph: Graph, own: int, x: float, y: float, found: IntArray) -> int:
    """The nodes around `Space.solids` to which a straight line from a free position is clear of these.

    Cells are visited from the position outwards, until the view is blocked in all directions.

    Args:
        space, graph: their added barriers and nodes are left out.
        own: node at this position; -1 for another one.
        x, y: free position, m.
        found: (n,) of int, is filled.

    Returns:
        Their number.
    """
    solids, clearance, count = space.solids, space.clearance, 0
    grid, minimum = solids.grid, clearance - TOLERANCE
    if len(graph.nodes) <= _FEW:
        for i in range(len(graph.nodes)):
            to_x, to_y = graph.nodes[i, X], graph.nodes[i, Y]
            if i != own and not is_near_line(solids, minimum, x, y, to_x, to_y):
                found[count] = i
                count += 1
        return count
    is_hidden = np.zeros(_SECTORS, dtype=np.bool_)
    is_complete = np.zeros(len(solids.table), dtype=np.bool_)  # barriers that need no second visit
    # Cells in view, in rings around the position: those of a ring are next to those of the ring before.
    own_column, own_row = column_of(grid, x), row_of(grid, y)
    cells, is_listed = np.empty(grid.columns * grid.rows, np.int64), np.zeros(grid.columns * grid.rows, np.bool_)
    cells[0], first, end, ring = own_column * grid.rows + own_row, 0, 1, 0
    while first < end:
        last = end
        for m in range(first, last):
            column, row = cells[m] // grid.rows, cells[m] % grid.rows
            if ring > 0 and _is_cell_hidden(is_hidden, grid, column, row, x, y):
                cells[m] = -1
                continue
            for n in range(graph.first[cells[m]], graph.first[cells[m] + 1]):
                i = graph.item[n]
                to_x, to_y = graph.nodes[i, X], graph.nodes[i, Y]
                if i == own or (to_x == x and to_y == y) or is_hidden[int(_sector(to_x - x, to_y - y)) % _SECTORS]:
                    continue
                if not is_near_line(solids, minimum, x, y, to_x, to_y):
                    found[count] = i
                    count += 1
        # What lies within these rings hides what is farther away.
        box = (
            grid.west + (own_column - ring) * grid.cell - x, grid.south + (own_row - ring) * grid.cell - y,
            grid.west + (own_column + ring + 1) * grid.cell - x, grid.south + (own_row + ring + 1) * grid.cell - y,
        )  # fmt: skip
        is_inside_box = box[0] <= 0.0 and box[1] <= 0.0 and box[2] >= 0.0 and box[3] >= 0.0
        for m in range(first, last):
            if cells[m] < 0:
                continue
            for n in range(grid.first[cells[m]], grid.first[cells[m] + 1]):
                k = grid.item[n]
                if is_inside_box and not is_complete[k]:
                    is_complete[k] = _hide(is_hidden, solids.table, k, clearance, x, y, box)
            column, row = cells[m] // grid.rows, cells[m] % grid.rows
            for c in range(max(column - 1, 0), min(column + 2, grid.columns)):
                for r in range(max(row - 1, 0), min(row + 2, grid.rows)):
                    is_outside = max(abs(c - own_column), abs(r - own_row)) > ring
                    if is_outside and not is_listed[c * grid.rows + r]:
                        cells[end], is_listed[c * grid.rows + r] = c * grid.rows + r, True
                        end += 1
        first, ring = last, ring + 1
    return count


@subroutine
def _is_cell_hidden(is_hidden: BoolArray, grid: Grid, column: int, row: int, x: float, y: float) -> bool:
    """Whether no line from a position beside a cell, m, that is not hidden leads into this cell."""
    west, south = grid.west + column * grid.cell - x, grid.south + row * grid.cell - y
    east, north = west + grid.cell, south + grid.cell
    # Border cells go on beyond the grid.
    west, east = west - _BEYOND * (column == 0), east + _BEYOND * (column == grid.columns - 1)
    south, north = south - _BEYOND * (row == 0), north + _BEYOND * (row == grid.rows - 1)
    if west > 0.0:
        ax, ay = east if south > 0.0 else west, south
        bx, by = east if north < 0.0 else west, north
    elif east < 0.0:
        ax, ay = west if north < 0.0 else east, north
        bx, by = west if south > 0.0 else east, south
    elif south > 0.0:
        ax, ay, bx, by = east, south, west, south
    elif north < 0.0:
        ax, ay, bx, by = west, north, east, north
    else:
        return False
    begin, end = _sector(ax, ay), _sector(bx, by)
    if end < begin:
        end += _SECTORS
    for n in range(int(begin), int(end) + 1):
        if not is_hidden[n % _SECTORS]:
            return False
    return True


@subroutine
def _hide(
    is_hidden: BoolArray, table: Array, k: int, clearance: float, x: float, y: float,
    box: tuple[float, float, float, float],
) -> bool:  # fmt: skip
    """Mark the sectors of directions in which barrier k blocks every line that leaves a box around a position.

    Args:
        is_hidden: (S,), is updated.
        table, k: barrier.
        clearance: m.
        x, y: position, m.
        box: west, south, east and north edge, relative to the position, m.

    Returns:
        Whether a larger box would change nothing.
    """
    ax, ay, bx, by = table[k, START_X] - x, table[k, START_Y] - y, table[k, END_X] - x, table[k, END_Y] - y
    middle_x, middle_y = ax + bx, ay + by
    if middle_x == 0.0 and middle_y == 0.0:
        return True
    # The core line, extended by less than the clearance; for a disc, a line across the view. Lines that cross it are
    # blocked.
    reach = 0.9 * (table[k, RADIUS] + clearance)
    along_x, along_y = bx - ax, by - ay
    if along_x == 0.0 and along_y == 0.0:
        along_x, along_y = -middle_y, middle_x
    scale = reach / length(along_x, along_y)
    ax, ay, bx, by = ax - scale * along_x, ay - scale * along_y, bx + scale * along_x, by + scale * along_y
    is_whole: bool = min(ax, bx) >= box[0] and min(ay, by) >= box[1] and max(ax, bx) <= box[2] and max(ay, by) <= box[3]
    if is_whole and is_hidden[int(_sector(middle_x, middle_y)) % _SECTORS]:
        return True  # most of these are hidden by others; that a few are not costs little
    if not is_whole:  # its part within the box
        along_x, along_y, low, high = bx - ax, by - ay, 0.0, 1.0
        for axis in range(2):
            start, change = (ax, along_x) if axis == 0 else (ay, along_y)
            least, most = box[axis], box[axis + 2]
            if change == 0.0:
                if start < least or start > most:
                    return False
            else:
                first, second = (least - start) / change, (most - start) / change
                low, high = max(low, min(first, second)), min(high, max(first, second))
        if not low < high:
            return False
        ax, ay, bx, by = ax + low * along_x, ay + low * along_y, ax + high * along_x, ay + high * along_y
    cross = ax * by - ay * bx
    if cross < 0.0:
        ax, ay, bx, by = bx, by, ax, ay
    if abs(cross) < 1e-12:
        return is_whole
    begin, end = _sector(ax, ay), _sector(bx, by)
    if end < begin:
        end += _SECTORS
    for n in range(math.ceil(begin), math.floor(end)):
        is_hidden[n % _SECTORS] = True
    return is_whole


@subroutine
def _sector(dx: float, dy: float) -> float:
    """Direction of a vector as a number from 0 to `_SECTORS`, which grows counter-clockwise."""
    part = dy / (abs(dx) + abs(dy))
    return (part + 1.0 if dx >= 0.0 else 3.0 - part) * (_SECTORS / 4)


@subroutine
def _known_row(graph: Graph, i: int) -> int:
    """Length of row i of `Graph.visible`; -1 if it is not known."""
    row = graph.visible[i]
    for n in range(len(row)):
        if row[n] <= 0:
            return n if row[n] == _END else -1
    return -1


@kernel
def find_row(packed_space: Any, packed_graph: Any, i: int, x: float, y: float, found: IntArray) -> int:
    """`visible_row` in a packed `Space` and `Graph`."""
    return visible_row(unpack(packed_space, Space), unpack(packed_graph, Graph), i, x, y, found)


@kernel
def find_all_rows(packed_space: Any, packed_graph: Any) -> None:
    """Fill all rows of `Graph.visible` that are not known yet, and `Graph.component`."""
    graph = unpack(packed_graph, Graph)
    found, waiting = np.empty(len(graph.nodes), dtype=np.int64), np.empty(len(graph.nodes), dtype=np.int64)
    component, number = np.zeros(len(graph.nodes), dtype=np.int64), 0
    for k in range(len(graph.nodes)):
        if component[k] > 0:
            continue
        number += 1
        component[k], waiting[0], first, last = number, k, 0, 1
        while first < last:
            i = waiting[first]
            x, y = graph.nodes[i, X], graph.nodes[i, Y]
            for n in range(call_for_int(graph.find_row, (packed_space, packed_graph, i, x, y, found))):
                if component[found[n]] == 0:
                    component[found[n]], waiting[last] = number, found[n]
                    last += 1
            first += 1
    for k in range(len(graph.nodes) - 1, -1, -1):  # the first one last: other threads then know that all are there
        graph.component[k] = component[k]


@subroutine
def visible_row(space: Space, graph: Graph, i: int, x: float, y: float, found: IntArray) -> int:
    """`_visible_nodes` of node i, or of a position (x, y) that is no node around `Space.solids`.

    Rows of `Graph.visible` may be filled by several threads at a time: these write the same numbers.
    """
    if i < 0 or i >= len(graph.nodes):
        return _visible_nodes(space, graph, -1, x, y, found)
    row, count = graph.visible[i], _known_row(graph, i)
    if count >= 0:
        for n in range(count):
            found[n] = row[n] - 1
        return count
    count = _visible_nodes(space, graph, i, x, y, found)
    if count < len(row):
        for n in range(count):
            row[n] = found[n] + 1
        row[count] = _END
    return count
