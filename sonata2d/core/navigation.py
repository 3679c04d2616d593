"""Shortest paths through the free space of a scene: visibility graph over the corners of inflated obstacles."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .barrier_grid import Solids, solids_of
from .compiled.calls import FLOAT, INT, INTS, PACKED, address_of
from .compiled.packing import Packed
from .free_space import Borders, Space, check_lines, check_place, check_point, check_points, find_borders, index_borders
from .geometry import Barriers, Point
from .path_search import find_path
from .portable_math import Array, BoolArray, IntArray
from .vectors import X, Y
from .visibility import MOST_POINTS, NODE_SIZE, Graph, complete, find_all_rows, find_nodes, find_row, index_nodes

_LONGEST_ROW = 512  # nodes visible from one node that are kept
_MANY = 100  # nodes
_KEPT = 32  # floor plans
_NOTHING = Barriers.of(())


class FloorPlan(NamedTuple):
    """Free space and visibility graph of a floor plan for a clearance, which are found once.

    Attributes:
        solids, borders: see `Space`.
        origins, nodes, first, item, visible, component: see `Graph`.
    """

    solids: Solids
    borders: Borders
    origins: Array
    nodes: Array
    first: IntArray
    item: IntArray
    visible: NDArray[np.int32]
    component: IntArray

    def graph(self, capacity: int) -> Graph:
        """The visibility graph, with space for the nodes around a number of added barriers."""
        return Graph(
            self.origins, self.nodes, self.first, self.item, self.visible, self.component,
            np.empty((2 * MOST_POINTS * capacity, NODE_SIZE)), np.zeros(len(self.nodes), dtype=bool), np.full(1, -1),
            np.full(2, np.nan), np.zeros(len(self.nodes) + 1, dtype=bool),
            address_of(find_row, PACKED, PACKED, INT, FLOAT, FLOAT, INTS),
            address_of(complete, PACKED, PACKED),
        )  # fmt: skip


_floor_plans: OrderedDict[tuple[bytes, bytes, float], FloorPlan] = OrderedDict()  # those used last are at the end


def floor_plan(outline: Array, barriers: Barriers, clearance: float) -> FloorPlan:
    """The floor plan of a room; the last ones are kept."""
    key = barriers.table.tobytes(), outline.tobytes(), clearance
    plan = _floor_plans.pop(key, None) or _new_floor_plan(outline, barriers, clearance)
    _floor_plans[key] = plan
    while len(_floor_plans) > _KEPT:
        try:
            _floor_plans.popitem(last=False)
        except KeyError:  # another thread was faster
            break
    return plan


def _new_floor_plan(outline: Array, barriers: Barriers, clearance: float) -> FloorPlan:
    solids, edges = solids_of(barriers), find_borders(barriers.table, _rows(outline))
    borders = Borders(np.ascontiguousarray(edges), *index_borders(edges))
    nothing = solids_of(_NOTHING)
    space = Packed(Space(solids, nothing, borders, np.empty((0, 4)), np.zeros(1, np.int64), clearance))
    origins, nodes = find_nodes(space.argument)
    first, item = index_nodes(solids.grid, nodes)
    visible = np.zeros((len(nodes), min(len(nodes) + 1, _LONGEST_ROW)), dtype=np.int32)
    return FloorPlan(
        solids,
        borders,
        np.ascontiguousarray(origins),
        nodes.copy(),
        first,
        item,
        visible,
        np.zeros(len(nodes), dtype=np.int64),
    )


def find_edges(plan: FloorPlan, packed_space: Any, packed_graph: Any) -> None:
    """Find all edges of the visibility graph of a floor plan, if they are many and not known."""
    if len(plan.nodes) > _MANY and plan.component[0] == 0:
        find_all_rows(packed_space, packed_graph)


class FreeSpace:
    """Positions that a disc can occupy: inside the outline, outside furniture, and off every barrier by the clearance.

    Paths go round corners by polygons instead of arcs. Their lengths are exact to a few centimetres, and a gap hardly
    wider than the disc can count as closed; every path found is free.

    Args:
        outline: (K, 2), the room's polygon, m. Its edges are among the barriers, as in `Scene.barriers`.
        barriers: obstacles; a closed sequence of edges counts as the outline of a solid object.
        clearance: of the disc's centre from every barrier, m; positive.
        added: further obstacles, which change more often, such as discs of standing pedestrians. What is known of the
            other ones is kept: `with_added` takes little time.
        plan: `floor_plan` of these, if it is at hand.

    Raises:
        ValueError: clearance is zero or negative.

    Source: Lozano-Pérez & Wesley, Comm. ACM 22 (1979) 560; Hart, Nilsson & Raphael,
    IEEE Trans. Syst. Sci. Cybern. 4 (1968) 100.
    """

    def __init__(
        self,
        outline: Array,
        barriers: Barriers,
        clearance: float,
        added: Barriers = _NOTHING,
        plan: FloorPlan | None = None,
    ) -> None:
        if not clearance > 0.0:
            raise ValueError(f"clearance must be positive, got {clearance}")
        self.outline, self.barriers, self.added, self.clearance = outline, barriers, added, float(clearance)
        self._plan = floor_plan(outline, barriers, self.clearance) if plan is None else plan
        plan, holes = self._plan, find_borders(added.table, np.empty((0, 2)))
        self._space = Packed(
            Space(plan.solids, solids_of(added), plan.borders, holes, np.array([len(holes)]), self.clearance)
        )
        self._graph = Packed(plan.graph(len(added)))

    def find_edges(self) -> None:
        """Find all edges of the visibility graph now, rather than when paths need them, if they are many."""
        find_edges(self._plan, self._space.argument, self._graph.argument)

    def with_added(self, added: Barriers) -> FreeSpace:
        """The same space with other added obstacles."""
        return FreeSpace(self.outline, self.barriers, self.clearance, added, self._plan)

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
        check_lines(self._space.argument, _rows(start), _rows(end), clear)
        return clear

    def is_open(self, start: Point, end: Point) -> bool:
        """Whether the disc can be at the end, and move straight there from the start; m."""
        ends = float(start[X]), float(start[Y]), float(end[X]), float(end[Y])
        return bool(check_place(self._space.argument, *ends))

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
        self.is_free(corner)
        self.is_clear(corner, corner)
        self.is_free_at(corner[0])
        self.distance(corner[0], corner[0])

    def _search(self, start: Point, goal: Point) -> tuple[float, Array]:
        """Length of the shortest path, m, and its points, (K, 2); infinite and (0, 2) without a path."""
        ends, size = (float(start[X]), float(start[Y]), float(goal[X]), float(goal[Y])), 32
        while True:
            route, length = np.empty((size, 2)), np.empty(1)
            count = find_path(self._space.argument, self._graph.argument, *ends, route, length)
            if count <= size:
                return float(length[0]), route[:count]
            size = count


def _rows(points: Array) -> Array:
    """A contiguous, writeable copy of points: a kernel is compiled for one kind of arrays."""
    return np.array(points, dtype=float, order="C")
