"""Kernels of `navigation`: free positions, visibility, the visibility graph, and shortest paths."""

from __future__ import annotations

import heapq
import math
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from .compiled.kernel import kernel, subroutine
from .compiled.packing import Bytes2, Floats2, Ints, Packed, unpack
from .compiled.scalar import (
    END_X,
    END_Y,
    RADIUS,
    START_X,
    START_Y,
    Vector,
    gap,
    inverse_square,
    is_inside,
    length,
    line_gap,
    to_line,
    towards,
)
from .portable_math import PI, TAN_PI_8, Array, BoolArray, IntArray, unit_vectors
from .vectors import X, Y

TOLERANCE = 1e-6  # m, by which a clearance may be missed
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
_AHEAD_X, _AHEAD_Y, _REACH, _KIND, _MITRE, _CUT = range(2, 8)  # columns of origins of turning points, after x and y
_MIN_SINE = 0.5  # of half the angle of a corner; a corner under 60° would have a long mitre, so it counts as two ends
_MIN_COSINE = 1e-6  # of half the angle of a corner; below it the barriers are collinear and need no turning point
_MAX_PUSHES = 8  # attempts to reach a free position by moving off the nearest barriers

NONE, FOUND, NEEDS_GRAPH = 0, 1, -1  # results of a search
_UNKNOWN, _OPEN, _BLOCKED = 0, 1, 2  # in `Graph.edges`
_LONG = 32  # nodes; a longer search also looks from the end, which may lie in a small closed space


class Space(NamedTuple):
    """A free space for kernels.

    Attributes:
        barriers: (M, 8), `Barriers.table`.
        ends: (3, E), x and y of the barriers' ends, m, and squares of their minimum distances, m^2.
        lines: (6, L), x and y of start, end and the vector between them, of the barriers that have a length, m.
        borders: (B, 4), start and end of the edges of the outline and, as holes, of solid objects, m.
        clearance: m.
    """

    barriers: Floats2
    ends: Floats2
    lines: Floats2
    borders: Floats2
    clearance: float


class Graph(NamedTuple):
    """Visibility graph, whose edges are found when paths need them.

    Attributes:
        nodes: (n, 2), turning points, m.
        edges: (n, n), whether the straight line between two nodes is free: `_UNKNOWN`, `_OPEN` or `_BLOCKED`.
        space: (n + 1,), number of the closed space that a node lies in, 0 while none is known; and how many are known.
        is_built: False for a graph that has not been needed yet, which is empty.
    """

    nodes: Floats2
    edges: Bytes2
    space: Ints
    is_built: bool


NOT_BUILT = Packed(Graph(np.empty((0, 2)), np.empty((0, 0), np.uint8), np.zeros(1, np.int64), False))


# Free positions and straight lines


@kernel
def prepare(barriers: Array, outline: Array, clearance: float) -> tuple[Array, Array, Array]:
    """The ends and lines of a `Space`, transposed, and its borders.

    A solid object is a closed line of consecutive barriers without a corner of the room's outline.
    """
    count = len(barriers)
    ends, end_count, lines, line_count = np.empty((2 * count, 3)), 0, np.empty((count, 6)), 0
    borders, border_count = np.empty((len(outline) + count, 4)), len(outline)
    for k in range(len(outline)):
        following = (k + 1) % len(outline)
        borders[k, 0], borders[k, 1] = outline[k, X], outline[k, Y]
        borders[k, 2], borders[k, 3] = outline[following, X], outline[following, Y]
    first, is_apart = 0, True  # start of the line, and whether it has no corner of the outline
    for k in range(count):
        start_x, start_y = barriers[k, START_X], barriers[k, START_Y]
        end_x, end_y = barriers[k, END_X], barriers[k, END_Y]
        minimum = barriers[k, RADIUS] + (clearance - TOLERANCE)
        ends[end_count, 0], ends[end_count, 1], ends[end_count, 2] = start_x, start_y, minimum * minimum
        end_count += 1
        if start_x != end_x or start_y != end_y:
            lines[line_count, 0], lines[line_count, 1], lines[line_count, 2] = start_x, start_y, end_x
            lines[line_count, 3], lines[line_count, 4], lines[line_count, 5] = end_y, end_x - start_x, end_y - start_y
            line_count += 1
        for c in range(len(outline)):
            if outline[c, X] == start_x and outline[c, Y] == start_y:
                is_apart = False
        closes = end_x == barriers[first, START_X] and end_y == barriers[first, START_Y]
        continues = False
        if not closes and k + 1 < count:
            continues = end_x == barriers[k + 1, START_X] and end_y == barriers[k + 1, START_Y]
        following = first if closes else k + 1
        if not (closes or continues) or barriers[following, RADIUS] != barriers[k, RADIUS]:
            ends[end_count, 0], ends[end_count, 1], ends[end_count, 2] = end_x, end_y, minimum * minimum
            end_count += 1
        if closes and k > first + 1 and is_apart:
            for i in range(first, k + 1):
                borders[border_count, 0], borders[border_count, 1] = barriers[i, START_X], barriers[i, START_Y]
                borders[border_count, 2], borders[border_count, 3] = barriers[i, END_X], barriers[i, END_Y]
                border_count += 1
        if not continues:
            first, is_apart = k + 1, True
    return ends[:end_count], lines[:line_count], borders[:border_count]


@kernel
def check_point(packed_space: Any, x: float, y: float) -> bool:
    """`FreeSpace.is_free_at` in a packed `Space`."""
    return bool(_is_free(unpack(packed_space, Space), x, y))


@kernel
def check_points(packed_space: Any, points: Array, free: BoolArray) -> None:
    """`FreeSpace.is_free` in a packed `Space` for points (N, 2), m, into an array (N,)."""
    space = unpack(packed_space, Space)
    for k in range(len(points)):
        free[k] = _is_free(space, points[k, X], points[k, Y])


@subroutine
def _is_free(space: Space, x: float, y: float) -> bool:
    """`FreeSpace.is_free` for one point."""
    minimum = space.clearance - TOLERANCE
    for k in range(len(space.barriers)):
        if gap(space.barriers, k, x, y) < minimum:
            return False
    return is_inside(space.borders, x, y)


@kernel
def check_lines(barriers: Array, clearance: float, start: Array, end: Array, clear: BoolArray) -> None:
    """`FreeSpace.is_clear` for straight lines from start (N, 2) to end (N, 2), m, into an array (N,)."""
    for i in range(len(start)):
        clear[i] = is_clear(barriers, clearance, start[i, X], start[i, Y], end[i, X], end[i, Y])


@subroutine
def is_clear(barriers: Array, clearance: float, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`FreeSpace.is_clear` for one straight line."""
    return _blocker(barriers, clearance, x, y, end_x, end_y) < 0


@subroutine
def _blocker(barriers: Array, clearance: float, x: float, y: float, end_x: float, end_y: float) -> int:
    """Index of the first barrier that is too near to a straight line; -1 if none is."""
    for k in range(len(barriers)):
        if _is_blocked(barriers, k, clearance, x, y, end_x, end_y):
            return k
    return -1


@subroutine
def _is_blocked(barriers: Array, k: int, clearance: float, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether barrier k is too near to a straight line."""
    # Most barriers are beyond one side of the rectangle around the line.
    reach = barriers[k, RADIUS] + clearance
    ax, ay, bx, by = barriers[k, START_X], barriers[k, START_Y], barriers[k, END_X], barriers[k, END_Y]
    if (
        min(ax, bx) > max(x, end_x) + reach
        or max(ax, bx) < min(x, end_x) - reach
        or min(ay, by) > max(y, end_y) + reach
        or max(ay, by) < min(y, end_y) - reach
    ):
        return False
    return line_gap(barriers, k, x, y, end_x, end_y) < clearance - TOLERANCE


@subroutine
def _is_visible(ends: Array, lines: Array, x: float, y: float, end_x: float, end_y: float) -> bool:
    """`FreeSpace.is_clear` for one line between positions known to be free.

    Between free positions a barrier comes too near only at one of its ends or by being crossed, which is faster
    to test.
    """
    along_x, along_y, near = end_x - x, end_y - y, 0
    inverse = inverse_square(along_x, along_y)
    for k in range(ends.shape[1]):  # without an exit, the loop uses the processor's vectors
        dx, dy = to_line(ends[0, k] - x, ends[1, k] - y, along_x, along_y, inverse)
        near += dx * dx + dy * dy < ends[2, k]
    return near == 0 and not _is_separated(lines, x, y, end_x, end_y)


@subroutine
def _is_separated(lines: Array, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a barrier is properly crossed between two points, as in `crosses`."""
    wx, wy, crossed = end_x - x, end_y - y, 0
    for k in range(lines.shape[1]):  # without an exit, as above
        ax, ay, dx, dy = lines[0, k], lines[1, k], lines[4, k], lines[5, k]
        p = dx * (y - ay) - dy * (x - ax)
        q = dx * (end_y - ay) - dy * (end_x - ax)
        a = wx * (ay - y) - wy * (ax - x)
        b = wx * (lines[3, k] - y) - wy * (lines[2, k] - x)
        crossed += (p * q < 0.0) & (a * b < 0.0)
    return crossed > 0


@subroutine
def _nearest_free(space: Space, graph: Graph, x: float, y: float) -> tuple[int, float, float]:
    """A free position near a point: status, x and y, m.

    The point itself if it is free, else the point pushed off the barriers that are too near, else the nearest turning
    point. `NONE` without a turning point on this side of the barriers; `NEEDS_GRAPH` if the graph must be built first.
    """
    free_x, free_y = x, y
    for k in range(_MAX_PUSHES):
        if _is_free(space, free_x, free_y):
            if k > 0 and _is_separated(space.lines, x, y, free_x, free_y):
                return NONE, x, y
            return FOUND, free_x, free_y
        push_x, push_y = _push(space, free_x, free_y)
        free_x, free_y = free_x + push_x, free_y + push_y
    if not graph.is_built:
        return NEEDS_GRAPH, x, y
    status, nearest = NONE, math.inf
    for i in range(len(graph.nodes)):
        node_x, node_y = graph.nodes[i, X], graph.nodes[i, Y]
        distance = length(node_x - x, node_y - y)
        if distance < nearest and not _is_separated(space.lines, x, y, node_x, node_y):
            status, nearest, free_x, free_y = FOUND, distance, node_x, node_y
    return status, free_x, free_y


@subroutine
def _push(space: Space, x: float, y: float) -> tuple[float, float]:
    """Displacement that moves a position off the barrier whose clearance it misses most."""
    deepest, dx, dy = math.inf, 0.0, 0.0
    for k in range(len(space.barriers)):
        depth = gap(space.barriers, k, x, y)
        if depth < deepest:
            deepest = depth
            dx, dy = towards(space.barriers, k, x, y)
    distance = length(dx, dy)
    if distance == 0.0:  # on the core line: no direction is better than another
        return 0.0, 0.0
    scale = max(space.clearance - deepest, 0.0) / distance
    return -dx * scale, -dy * scale


# The graph


@kernel
def build_nodes(packed_space: Any) -> Array:
    """Nodes of a `Graph`."""
    return _turning_points(unpack(packed_space, Space))


@subroutine
def _turning_points(space: Space) -> Array:
    """Free positions (n, 2) around the inflated barriers: wide polygons, or closer ones where these do not fit."""
    origins = _origins(space.barriers, space.clearance + MARGIN)
    nodes, count = np.empty((12 * len(origins), 2)), 0
    fits = np.empty(len(origins), dtype=np.bool_)
    for polygon in range(len(_FIRST) - 1):
        kind, is_close = polygon // 2, polygon % 2 == 1
        for k in range(len(origins)):
            if origins[k, _KIND] != kind or (is_close and fits[k]):
                continue
            first = count
            for step in range(_FIRST[polygon], _FIRST[polygon + 1]):
                x, y = _candidate(origins, k, step, is_close)
                if _is_free(space, x, y):
                    nodes[count, X], nodes[count, Y] = x, y
                    count += 1
            if not is_close:
                fits[k] = count - first == _FIRST[polygon + 1] - _FIRST[polygon]
                if not fits[k]:
                    count = first
    return nodes[:count]


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
def _origins(barriers: Array, offset: float) -> Array:
    """The discs, corners and free ends of barriers, around which paths turn.

    Args:
        barriers: (M, 8).
        offset: distance of turning points from the barriers' surfaces, m.

    Returns:
        (C, 8): position, m; direction to which the barrier ends (unit vector); radius of the barrier and offset, m;
        kind; for corners, the factors by which the points lie farther ahead and aside.
    """
    ends, end_count = _directed_ends(barriers, offset)
    origins, count = np.empty((len(barriers) + end_count, 8)), 0
    for k in range(len(barriers)):
        if barriers[k, START_X] == barriers[k, END_X] and barriers[k, START_Y] == barriers[k, END_Y]:
            origins[count, X], origins[count, Y] = barriers[k, START_X], barriers[k, START_Y]
            origins[count, _AHEAD_X], origins[count, _AHEAD_Y] = 1.0, 0.0
            origins[count, _REACH], origins[count, _KIND] = barriers[k, RADIUS] + offset, _DISC
            origins[count, _MITRE], origins[count, _CUT] = 1.0, 1.0
            count += 1
    for k in range(end_count):
        partner, meeting = -1, 0
        for other in range(end_count):
            if ends[other, X] == ends[k, X] and ends[other, Y] == ends[k, Y] and other != k:
                partner, meeting = other, meeting + 1
        for column in range(5):
            origins[count, column] = ends[k, column]
        origins[count, _KIND], origins[count, _MITRE], origins[count, _CUT] = _FREE_END, 1.0, 1.0
        if meeting == 1:
            x, y = ends[k, _AHEAD_X] + ends[partner, _AHEAD_X], ends[k, _AHEAD_Y] + ends[partner, _AHEAD_Y]
            cosine = length(x, y) / 2  # of half the angle between the two barriers
            sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
            if sine >= _MIN_SINE:
                # Each corner once, at the first of its two ends; none where a wall continues straight on.
                if not (k < partner and cosine > _MIN_COSINE):
                    continue
                origins[count, _AHEAD_X], origins[count, _AHEAD_Y] = x / (2 * cosine), y / (2 * cosine)
                origins[count, _MITRE], origins[count, _CUT] = 1 / sine, (1.0 - sine) / cosine
                origins[count, _KIND] = _CORNER
        count += 1
    return origins[:count]


@subroutine
def _directed_ends(barriers: Array, offset: float) -> tuple[Array, int]:
    """The starts, then the ends of barriers that have a length: rows as in `_origins`, and their number."""
    ends, count = np.empty((2 * len(barriers), 5)), 0
    for side in range(2):
        for k in range(len(barriers)):
            along_x, along_y = barriers[k, END_X] - barriers[k, START_X], barriers[k, END_Y] - barriers[k, START_Y]
            size, sign = length(along_x, along_y), 2.0 * side - 1.0
            if size > 0.0:
                ends[count, X], ends[count, Y] = barriers[k, 2 * side], barriers[k, 2 * side + 1]
                ends[count, _AHEAD_X], ends[count, _AHEAD_Y] = sign * (along_x / size), sign * (along_y / size)
                ends[count, _REACH] = barriers[k, RADIUS] + offset
                count += 1
    return ends, count


# Paths


@kernel
def find_path(
    packed_space: Any, packed_graph: Any, start_x: float, start_y: float, goal_x: float, goal_y: float, route: Array
) -> tuple[int, float]:
    """The shortest path from a start to a goal.

    Args:
        packed_space, packed_graph: packed `Space` and `Graph`.
        start_x, start_y, goal_x, goal_y: m.
        route: (n + 4, 2), output: points of the path, m.

    Returns:
        Number of points of the route, and length of the path, m; 0 and infinite if there is no path. `NEEDS_GRAPH` in
        place of the number if the graph must be built first.
    """
    space, graph = unpack(packed_space, Space), unpack(packed_graph, Graph)
    end_status, end_x, end_y = _nearest_free(space, graph, goal_x, goal_y)
    status, x, y = _nearest_free(space, graph, start_x, start_y)
    if status == NEEDS_GRAPH or end_status == NEEDS_GRAPH:
        return NEEDS_GRAPH, math.inf
    if status == NONE or end_status == NONE:
        return 0, math.inf
    shortest, count = length(end_x - x, end_y - y), 0
    if not _is_visible(space.ends, space.lines, x, y, end_x, end_y):
        if not graph.is_built:
            return NEEDS_GRAPH, math.inf
        shortest, count = _search(space, graph, x, y, end_x, end_y, route[2:])
        if shortest == math.inf:
            return 0, math.inf
    route[0, X], route[0, Y], route[1, X], route[1, Y] = start_x, start_y, x, y
    count += 2
    route[count, X], route[count, Y], route[count + 1, X], route[count + 1, Y] = end_x, end_y, goal_x, goal_y
    kept = 1
    for k in range(1, count + 2):  # drop the points that equal the previous one
        if route[k, X] != route[k - 1, X] or route[k, Y] != route[k - 1, Y]:
            route[kept, X], route[kept, Y] = route[k, X], route[k, Y]
            kept += 1
    return kept, shortest + length(x - start_x, y - start_y)


@subroutine
def _search(
    space: Space, graph: Graph, x: float, y: float, end_x: float, end_y: float, route: Array
) -> tuple[float, int]:
    """The shortest path over nodes: its length, m, infinite without a path, and their number; fills the route.

    A* that tests a line only when it would be the next one of the shortest path, so that most are never tested.
    """
    count, reached, is_connected = len(graph.nodes), 0, False
    if graph.space[count] > 0 and (
        _is_shut_off(space, graph, end_x, end_y, x, y) or _is_shut_off(space, graph, x, y, end_x, end_y)
    ):
        return math.inf, 0
    previous, is_reached = np.full(count + 1, -1), np.zeros(count + 1, dtype=np.bool_)  # the last is the end
    is_seen = np.zeros(count + 1, dtype=np.bool_)  # from the end; here the last is the start
    # Lines from one node, or the start or end (-1), to another: bound of the path and length up to there, m.
    lines, lines_back = [(math.inf, 0.0, -1, -1)], [(math.inf, 0.0, -1, -1)]
    _add_lines(lines, graph, is_reached, -1, x, y, end_x, end_y, 0.0)
    _add_lines(lines_back, graph, is_seen, -1, end_x, end_y, x, y, 0.0)
    while True:
        bound, travelled, i, j = heapq.heappop(lines)
        if bound == math.inf:
            _mark_closed(graph, is_reached)
            return math.inf, 0
        if not is_reached[j] and _is_open(space, graph, i, j, x, y, end_x, end_y):
            is_reached[j], previous[j], reached = True, i, reached + 1
            if j == count:
                return travelled, _trace(graph, previous, i, route)
            is_connected |= is_seen[j]
            _add_lines(lines, graph, is_reached, j, graph.nodes[j, X], graph.nodes[j, Y], end_x, end_y, travelled)
        if reached > _LONG and not is_connected:
            bound, travelled, i, j = heapq.heappop(lines_back)
            if bound == math.inf:
                _mark_closed(graph, is_seen)
                return math.inf, 0
            if not is_seen[j] and _is_open(space, graph, i, j, end_x, end_y, x, y):
                is_seen[j], is_connected = True, j == count or is_reached[j]
                if not is_connected:
                    _add_lines(lines_back, graph, is_seen, j, graph.nodes[j, X], graph.nodes[j, Y], x, y, travelled)


@subroutine
def _mark_closed(graph: Graph, is_reached: BoolArray) -> None:
    """Number the closed space of all nodes that a search without success has reached."""
    count = len(graph.nodes)
    graph.space[count] += 1
    for k in range(count):
        if is_reached[k]:
            graph.space[k] = graph.space[count]


@subroutine
def _is_shut_off(space: Space, graph: Graph, x: float, y: float, other_x: float, other_y: float) -> bool:
    """Whether a free position sees nodes of known closed spaces only, and another free position sees none of these."""
    count, blocker = len(graph.nodes), 0
    is_entered = np.zeros(graph.space[count] + 1, dtype=np.bool_)  # by number of the closed space
    for k in range(count):
        node_x, node_y = graph.nodes[k, X], graph.nodes[k, Y]
        # What blocks the line to a node mostly blocks the line to the next one, which is near.
        if _is_blocked(space.barriers, blocker, space.clearance, x, y, node_x, node_y):
            continue
        found = _blocker(space.barriers, space.clearance, x, y, node_x, node_y)
        if found >= 0:
            blocker = found
        elif graph.space[k] == 0:
            return False
        else:
            is_entered[graph.space[k]] = True
    for k in range(count):
        if is_entered[graph.space[k]] and _is_visible(
            space.ends, space.lines, other_x, other_y, graph.nodes[k, X], graph.nodes[k, Y]
        ):
            return False
    return True


@subroutine
def _add_lines(
    lines: list[tuple[float, float, int, int]], graph: Graph, is_reached: BoolArray,
    i: int, x: float, y: float, end_x: float, end_y: float, travelled: float,
) -> None:  # fmt: skip
    """Add the lines from node i, at a position, to the nodes that are not reached, and to the end."""
    count = len(graph.nodes)
    for j in range(count):
        if not is_reached[j] and (i < 0 or graph.edges[i, j] != _BLOCKED):
            node_x, node_y = graph.nodes[j, X], graph.nodes[j, Y]
            total = travelled + length(node_x - x, node_y - y)
            heapq.heappush(lines, (total + length(end_x - node_x, end_y - node_y), total, i, j))
    total = travelled + length(end_x - x, end_y - y)
    heapq.heappush(lines, (total, total, i, count))


@subroutine
def _is_open(space: Space, graph: Graph, i: int, j: int, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether the line from node i, or from the start (-1), to node j, or to the end (n), is free; nodes keep it."""
    count = len(graph.nodes)
    is_kept = i >= 0 and j < count
    if is_kept and graph.edges[i, j] != _UNKNOWN:
        return bool(graph.edges[i, j] == _OPEN)
    if i >= 0:
        x, y = graph.nodes[i, X], graph.nodes[i, Y]
    if j < count:
        end_x, end_y = graph.nodes[j, X], graph.nodes[j, Y]
    is_open = _is_visible(space.ends, space.lines, x, y, end_x, end_y)
    if is_kept:
        graph.edges[i, j] = graph.edges[j, i] = _OPEN if is_open else _BLOCKED
    return is_open


@subroutine
def _trace(graph: Graph, previous: IntArray, last: int, route: Array) -> int:
    """Put the nodes of a path up to the last one into the route; returns their number."""
    count, k = 0, last
    while k >= 0:
        count, k = count + 1, previous[k]
    k = last
    for place in range(count - 1, -1, -1):
        route[place, X], route[place, Y] = graph.nodes[k, X], graph.nodes[k, Y]
        k = previous[k]
    return count
