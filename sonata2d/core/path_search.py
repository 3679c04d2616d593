"""Kernels of `navigation`: shortest paths over the visibility graph."""

from __future__ import annotations

import heapq
import math
from typing import Any

import numpy as np

from .barrier_grid import is_near_line
from .compiled.calls import call, call_for_int
from .compiled.kernel import kernel, subroutine
from .compiled.packing import unpack
from .compiled.scalar import length
from .free_space import TOLERANCE, Space, is_clear, is_free, is_open, is_separated, push
from .portable_math import Array, BoolArray, IntArray
from .vectors import X, Y
from .visibility import Graph, is_node, node

_LONG = 32  # nodes; a longer search also looks from the end, which may lie in a small closed space
_TOO_LONG = 128  # nodes; one that is even longer only loses time by this
_MAX_PUSHES = 8  # attempts to reach a free position by moving off the nearest barriers


@kernel
def find_path(
    packed_space: Any, packed_graph: Any, start_x: float, start_y: float, goal_x: float, goal_y: float, route: Array,
    size: Array,
) -> int:  # fmt: skip
    """The shortest path from a start to a goal.

    Args:
        packed_space, packed_graph: packed `Space` and `Graph`.
        start_x, start_y, goal_x, goal_y: m.
        route: (R, 2), output: points of the path, m.
        size: (1,), output: length of the path, m; infinite without a path.

    Returns:
        Number of points of the route; 0 if there is no path. A number larger than R if the route is too short for them.
    """
    space, graph = unpack(packed_space, Space), unpack(packed_graph, Graph)
    size[0] = math.inf
    has_end, end_x, end_y = _nearest_free(space, graph, goal_x, goal_y)
    has_start, x, y = _nearest_free(space, graph, start_x, start_y)
    if not has_start or not has_end:
        return 0
    shortest, count = length(end_x - x, end_y - y), 0
    if not is_clear(space, x, y, end_x, end_y):
        call(graph.complete, (space, graph))
        shortest, count = _search(space, graph, x, y, end_x, end_y, route)
        if shortest == math.inf:
            return 0
    size[0] = shortest + length(x - start_x, y - start_y)
    if count + 4 > len(route):
        return count + 4
    route[0, X], route[0, Y], route[1, X], route[1, Y] = start_x, start_y, x, y
    count += 2
    route[count, X], route[count, Y], route[count + 1, X], route[count + 1, Y] = end_x, end_y, goal_x, goal_y
    kept = 1
    for k in range(1, count + 2):  # drop the points that equal the previous one
        if route[k, X] != route[k - 1, X] or route[k, Y] != route[k - 1, Y]:
            route[kept, X], route[kept, Y] = route[k, X], route[k, Y]
            kept += 1
    return kept


@subroutine
def _nearest_free(space: Space, graph: Graph, x: float, y: float) -> tuple[bool, float, float]:
    """A free position near a point: whether there is one, x and y, m.

    The point itself if it is free, else the point pushed off the barriers that are too near, else the nearest turning
    point on this side of the barriers.
    """
    free_x, free_y = x, y
    for k in range(_MAX_PUSHES):
        if is_free(space, free_x, free_y):
            return k == 0 or not is_separated(space, x, y, free_x, free_y), free_x, free_y
        push_x, push_y = push(space, free_x, free_y)
        free_x, free_y = free_x + push_x, free_y + push_y
    call(graph.complete, (space, graph))
    is_found, nearest = False, math.inf
    for i in range(len(graph.nodes) + graph.added_count[0]):
        if is_node(graph, i):
            node_x, node_y = node(graph, i)
            distance = length(node_x - x, node_y - y)
            if distance < nearest and not is_separated(space, x, y, node_x, node_y):
                is_found, nearest, free_x, free_y = True, distance, node_x, node_y
    return is_found, free_x, free_y


@subroutine
def _row(space: Space, graph: Graph, i: int, x: float, y: float, found: IntArray) -> int:
    """`visible_row`, which is called in several places and compiled once."""
    return int(call_for_int(graph.find_row, (space, graph, i, x, y, found)))


@subroutine
def _search(
    space: Space,
    graph: Graph,
    x: float,
    y: float,
    end_x: float,
    end_y: float,
    route: Array,
) -> tuple[float, int]:
    """The shortest path over nodes by A*: its length, m, infinite without a path, and their number; fills the route.

    Edges between nodes around `Space.solids` are known but for added barriers. Others are tested only when they would
    be the next ones of the shortest path, so that most are never tested.
    """
    fixed = len(graph.nodes)
    end = fixed + graph.added_count[0]  # number of nodes, and the number of the end; the start is -1
    best, previous = np.full(end + 1, math.inf), np.full(end + 1, -1)
    is_done, is_seen = np.zeros(end + 1, dtype=np.bool_), np.zeros(end + 1, dtype=np.bool_)  # from start, from end
    found, reached, is_connected = np.empty(max(fixed, 1), dtype=np.int64), 0, False
    sees_end = np.ones(max(fixed, 1), dtype=np.bool_)  # or may do so
    if fixed > 0 and graph.component[0] > 0:
        sees_end[:] = False
        if not _is_connected(space, graph, x, y, end_x, end_y, sees_end, found):
            return math.inf, 0
    # Bound of the length of the path, and node j; where the edge from node i was not tested, j + (i + 2) (end + 1)
    waiting, waiting_back = [(0.0, -1)], [(0.0, end)]
    is_seen[end] = True
    while len(waiting) > 0:
        _, j = heapq.heappop(waiting)
        node_x, node_y, travelled = x, y, 0.0
        if j >= 0:
            is_tested, i = j <= end, j // (end + 1) - 2
            j = j % (end + 1)
            if is_done[j]:
                continue
            node_x, node_y = (end_x, end_y) if j == end else node(graph, j)
            if not is_tested:
                from_x, from_y = (x, y) if i < 0 else node(graph, i)
                if not is_open(space, from_x, from_y, node_x, node_y):
                    continue
                best[j], previous[j] = (0.0 if i < 0 else best[i]) + length(node_x - from_x, node_y - from_y), i
            travelled, is_done[j], reached = best[j], True, reached + 1
            if j == end:
                return travelled, _trace(graph, previous, previous[end], route)
            is_connected |= is_seen[j]
        visible = _row(space, graph, j, node_x, node_y, found)
        for n in range(visible + end - fixed + 1):
            # nodes around solids that are in view, then all other ones, then the end
            k = found[n] if n < visible else fixed + n - visible
            if is_done[k] or (k < fixed and graph.is_covered[k]):
                continue
            if k == end and 0 <= j < fixed and not sees_end[j]:
                continue
            to_x, to_y = (end_x, end_y) if k == end else node(graph, k)
            total = travelled + length(to_x - node_x, to_y - node_y)
            if not total < best[k]:
                continue
            code = k
            if n >= visible:
                code += (j + 2) * (end + 1)
            elif is_near_line(space.added, space.clearance - TOLERANCE, node_x, node_y, to_x, to_y):
                continue
            else:
                best[k], previous[k] = total, j
            heapq.heappush(waiting, (total + length(end_x - to_x, end_y - to_y), code))
        if _LONG < reached <= _TOO_LONG and not is_connected:
            if len(waiting_back) > 0:
                is_connected = _look_back(space, graph, waiting_back, is_seen, is_done, x, y, end_x, end_y, found)
            else:  # the end lies in a closed space, unless the start, or a node that was reached, sees into it
                for _, code in waiting:
                    k = code % (end + 1)
                    is_connected |= k != end and is_seen[k]
                if not is_connected:
                    return math.inf, 0
    return math.inf, 0


@subroutine
def _is_connected(
    space: Space,
    graph: Graph,
    x: float,
    y: float,
    end_x: float,
    end_y: float,
    sees_end: BoolArray,
    found: IntArray,
) -> bool:
    """Whether start and end see nodes of one component of the graph; nodes that see the end are marked.

    Args:
        space, graph: added barriers are left out.
        x, y, end_x, end_y: start and end, m.
        sees_end: (n,), false everywhere; is filled.
        found: (n,) of int, scratch.
    """
    if graph.start[X] != x or graph.start[Y] != y:
        graph.start[X], graph.start[Y], graph.from_start[:] = x, y, False
        for n in range(_row(space, graph, -1, x, y, found)):
            graph.from_start[graph.component[found[n]]] = True
    is_connected = False
    for n in range(_row(space, graph, -1, end_x, end_y, found)):
        sees_end[found[n]] = True
        is_connected |= graph.from_start[graph.component[found[n]]]
    return is_connected


@subroutine
def _look_back(
    space: Space, graph: Graph, waiting: list[tuple[float, int]], is_seen: BoolArray, is_done: BoolArray, x: float,
    y: float, end_x: float, end_y: float, found: IntArray,
) -> bool:  # fmt: skip
    """Look from one more node that is connected to the end; whether a node is found that the search has reached."""
    fixed, end = len(graph.nodes), len(is_seen) - 1
    _, i = heapq.heappop(waiting)
    node_x, node_y = (end_x, end_y) if i == end else node(graph, i)
    visible, is_connected = _row(space, graph, -1 if i == end else i, node_x, node_y, found), False
    for n in range(visible + end - fixed):
        k = found[n] if n < visible else fixed + n - visible
        if is_seen[k] or (k < fixed and graph.is_covered[k]):
            continue
        to_x, to_y = node(graph, k)
        if n < visible and is_near_line(space.added, space.clearance - TOLERANCE, node_x, node_y, to_x, to_y):
            continue
        if n >= visible and not is_open(space, node_x, node_y, to_x, to_y):
            continue
        is_seen[k] = True
        is_connected |= is_done[k]
        heapq.heappush(waiting, (length(to_x - x, to_y - y), k))
    return is_connected


@subroutine
def _trace(graph: Graph, previous: IntArray, last: int, route: Array) -> int:
    """Put the nodes of a path up to the last one into the route from its third row on; returns their number."""
    count, k = 0, last
    while k >= 0:
        count, k = count + 1, previous[k]
    if count + 4 > len(route):
        return count
    k = last
    for place in range(count + 1, 1, -1):
        route[place, X], route[place, Y] = node(graph, k)
        k = previous[k]
    return count
