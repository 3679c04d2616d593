"""Shortest paths through the free space of a scene: visibility graph over the corners of inflated obstacles."""

from __future__ import annotations

import numpy as np

from .compiled.packing import Packed
from .geometry import Barriers, Point
from .portable_math import Array, BoolArray
from .vectors import X, Y
from .visibility import (
    FOUND,
    NEEDS_GRAPH,
    NOT_BUILT,
    Graph,
    Space,
    build_graph,
    check_lines,
    check_point,
    check_points,
    find_free,
    find_paths,
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

    Source: Lozano-Pérez & Wesley, Comm. ACM 22 (1979) 560; Floyd, Comm. ACM 5 (1962) 345.
    """

    def __init__(self, outline: Array, barriers: Barriers, clearance: float) -> None:
        if not clearance > 0.0:
            raise ValueError(f"clearance must be positive, got {clearance}")
        self.outline, self.barriers, self.clearance = outline, barriers, float(clearance)
        self._prepared: Packed[Space] | None = None
        self._graph = NOT_BUILT  # most spaces need none: many paths are straight

    def is_free_at(self, point: Point) -> bool:
        """Whether the disc can be at a point, m."""
        return bool(check_point(self._space().argument, float(point[X]), float(point[Y])))

    def is_free(self, points: Array) -> BoolArray:
        """Whether the disc can be at the points; (N, 2) to (N,) of bool."""
        free = np.empty(len(points), dtype=bool)
        check_points(self._space().argument, _rows(points), free)
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

    def nearest_free(self, point: Point) -> Point | None:
        """A free position near a point.

        Returns:
            The point itself if it is free, else the point pushed off the barriers that are too near, else the nearest
            turning point; None without a turning point on this side of the barriers.
        """
        x, y = float(point[X]), float(point[Y])
        space = self._space().argument
        status, free_x, free_y = find_free(space, self._graph.argument, x, y)
        if status == NEEDS_GRAPH:
            status, free_x, free_y = find_free(space, self._built_graph().argument, x, y)
        return (float(free_x), float(free_y)) if status == FOUND else None

    def towards(self, goal: Point) -> GoalField:
        """The shortest paths to one goal; faster than `distance` for many starts."""
        return GoalField(self, goal)

    def path(self, start: Point, goal: Point) -> Array | None:
        """The shortest path.

        A start or goal without the clearance is connected to its `nearest_free` position.

        Returns:
            (K, 2), m, from start to goal; None if there is no path.
        """
        _, route = self._search(np.array([start], dtype=float), goal)
        return route if len(route) else None

    def distance(self, start: Point, goal: Point) -> float:
        """Length of the shortest path, m; infinite without a path."""
        lengths, _ = self._search(np.array([start], dtype=float), goal)
        return float(lengths[0])

    def warm_up(self) -> None:
        """Call each kernel of this class once, so that none is compiled or loaded later."""
        corner = self.outline[:1]
        self._built_graph()
        self.is_free(corner)
        self.is_clear(corner, corner)
        self.is_free_at(corner[0])
        self.nearest_free(corner[0])
        self.distance(corner[0], corner[0])

    def _search(self, points: Array, goal: Point) -> tuple[Array, Array]:
        """The shortest paths from points (P, 2) to a goal: their lengths (P,), and the path (K, 2) of the last one."""
        lengths = np.empty(len(points))
        route = self._find_paths(points, goal, lengths, self._graph)
        if route is None:
            route = self._find_paths(points, goal, lengths, self._built_graph())
        assert route is not None
        return lengths, route

    def _find_paths(self, points: Array, goal: Point, lengths: Array, graph: Packed[Graph]) -> Array | None:
        """Fill the lengths, and return the path of the last point; None if the graph must be built first."""
        # besides the nodes: start and goal, and the free positions near to them
        route = np.empty((len(graph.value.nodes) + 4, 2))
        space, x, y = self._space(), float(goal[X]), float(goal[Y])
        count = find_paths(space.argument, graph.argument, points, x, y, lengths, route)
        return None if count == NEEDS_GRAPH else route[:count]

    def _space(self) -> Packed[Space]:
        if self._prepared is None:
            table = self.barriers.table
            ends, lines, borders = prepare(table, _rows(self.outline), self.clearance)
            self._prepared = Packed(Space(table, _columns(ends), _columns(lines), borders, self.clearance))
        return self._prepared

    def _built_graph(self) -> Packed[Graph]:
        if not self._graph.value.is_built:
            self._graph = Packed(Graph(*build_graph(self._space().argument), True))
        return self._graph


class GoalField:
    """The shortest paths from anywhere to one goal.

    Args:
        space: free space that paths stay in.
        goal: m; paths to a goal without the clearance end through its `FreeSpace.nearest_free` position.
    """

    def __init__(self, space: FreeSpace, goal: Point) -> None:
        self.space = space
        self.goal = goal

    def distances(self, points: Array) -> Array:
        """Length of the shortest path from each point; (P, 2) to (P,), m; infinite without a path."""
        lengths, _ = self.space._search(_rows(points), self.goal)
        return lengths

    def path(self, start: Point) -> Array | None:
        """The shortest path from start to goal, (K, 2), m; None without a path."""
        return self.space.path(start, self.goal)


def _rows(points: Array) -> Array:
    """A contiguous, writeable copy of points: a kernel is compiled for one kind of arrays."""
    return np.array(points, dtype=float, order="C")


def _columns(rows: Array) -> Array:
    """The transposed array, contiguous, which kernels run through faster."""
    return np.ascontiguousarray(rows.T)
