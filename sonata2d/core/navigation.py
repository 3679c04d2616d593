"""Shortest paths through the free space of a scene: visibility graph over the corners of inflated obstacles."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from .compiled.packing import Packed
from .geometry import Barriers, Point
from .portable_math import Array, BoolArray
from .vectors import X, Y
from .visibility import (
    NEEDS_GRAPH,
    NOT_BUILT,
    Graph,
    Space,
    build_nodes,
    check_lines,
    check_point,
    check_points,
    find_path,
    prepare,
)


class FreeSpace:
    """Positions that a disc can occupy: inside the outline, outside furniture, and off every barrier by the clearance.

    Paths go round corners by polygons instead of arcs. Their lengths are exact to a few centimetres, and a gap hardly
    wider than the disc can count as closed; every path found is free.

    Args:
        outline: (K, 2), the room's polygon, m. Its edges are among the barriers, as in `Scene.barriers`.
        barriers: obstacles; a closed sequence of edges counts as the outline of a solid object. Add standing
            pedestrians as discs with `Barriers.joined`.
        clearance: of the disc's centre from every barrier, m; positive.

    Raises:
        ValueError: clearance is zero or negative.

    Source: Lozano-Pérez & Wesley, Comm. ACM 22 (1979) 560; Hart, Nilsson & Raphael,
    IEEE Trans. Syst. Sci. Cybern. 4 (1968) 100.
    """

    def __init__(self, outline: Array, barriers: Barriers, clearance: float) -> None:
        if not clearance > 0.0:
            raise ValueError(f"clearance must be positive, got {clearance}")
        self.outline, self.barriers, self.clearance = outline, barriers, float(clearance)
        self._graph = NOT_BUILT  # most spaces need none: many paths are straight

    def is_free_at(self, point: Point) -> bool:
        """Whether the disc can be at a point, m."""
        return bool(check_point(self._space.argument, float(point[X]), float(point[Y])))

    def is_free(self, points: Array) -> BoolArray:
        """Whether the disc can be at the points; (N, 2) to (N,) of bool."""
        free = np.empty(len(points), dtype=bool)
        check_points(self._space.argument, _rows(points), free)
        return free

    def is_clear(self, start: Array, end: Array) -> BoolArray:
        """Whether the disc can move straight from start to end; (N, 2) and (N, 2) to (N,) of bool."""
        clear = np.empty(len(start), dtype=bool)
        check_lines(self.barriers.table, self.clearance, _rows(start), _rows(end), clear)
        return clear

    def is_open(self, start: Point, end: Point) -> bool:
        """Whether the disc can be at the end, and move straight there from the start; m."""
        if not self.is_free_at(end):
            return False
        return bool(self.is_clear(np.array([start], dtype=float), np.array([end], dtype=float))[0])

    def path(self, start: Point, goal: Point) -> Array | None:
        """The shortest path.

        A start or goal without the clearance is connected to a free position near to it.

        Returns:
            (K, 2), m, from start to goal; None if there is no path.
        """
        _, route = self._search(start, goal)
        return route if len(route) else None

    def distance(self, start: Point, goal: Point) -> float:
        """Length of the shortest path, m; infinite without a path."""
        return self._search(start, goal)[0]

    def warm_up(self) -> None:
        """Call each kernel of this class once, so that none is compiled or loaded later."""
        corner = self.outline[:1]
        self._built_graph()
        self.is_free(corner)
        self.is_clear(corner, corner)
        self.is_free_at(corner[0])
        self.distance(corner[0], corner[0])

    def _search(self, start: Point, goal: Point) -> tuple[float, Array]:
        """Length of the shortest path, m, and its points, (K, 2); infinite and (0, 2) without a path."""
        ends, graph = (float(start[X]), float(start[Y]), float(goal[X]), float(goal[Y])), self._graph
        while True:
            # besides the nodes: start and goal, and the free positions near to them
            route = np.empty((len(graph.value.nodes) + 4, 2))
            count, length = find_path(self._space.argument, graph.argument, *ends, route)
            if count != NEEDS_GRAPH:
                return length, route[:count]
            graph = self._built_graph()

    @cached_property
    def _space(self) -> Packed[Space]:
        table = self.barriers.table
        ends, lines, borders = prepare(table, _rows(self.outline), self.clearance)
        return Packed(Space(table, _columns(ends), _columns(lines), borders, self.clearance))

    def _built_graph(self) -> Packed[Graph]:
        if not self._graph.value.is_built:
            nodes = build_nodes(self._space.argument)
            n = len(nodes)
            self._graph = Packed(Graph(nodes, np.zeros((n, n), np.uint8), np.zeros(n + 1, np.int64), True))
        return self._graph


def _rows(points: Array) -> Array:
    """A contiguous, writeable copy of points: a kernel is compiled for one kind of arrays."""
    return np.array(points, dtype=float, order="C")


def _columns(rows: Array) -> Array:
    """The transposed array, contiguous, which kernels run through faster."""
    return np.ascontiguousarray(rows.T)
