"""Shortest paths through the free space of a scene: visibility graph over the corners of inflated obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from . import vectors
from .geometry import Barriers, Point, inside_edges, segment_distances, segments_cross
from .portable_math import PI, Array, BoolArray, IntArray, unit_vectors
from .vectors import X, Y

TOLERANCE = 1e-6  # m, by which a clearance may be missed
MARGIN = 1e-3  # m, distance of turning points from the inflated corners

# Polygons around a unit circle that their edges touch, and offsets (ahead, left) around the end of a barrier.
_HEXAGON = unit_vectors(np.arange(6) * PI / 3) * 1.1547005383792517
_DODECAGON = unit_vectors(np.arange(12) * PI / 6) * 1.0352761804100832
_SQUARE = ((1.0, 1.0), (1.0, -1.0))
_TAN_PI_8 = 0.41421356237309503
_OCTAGON = ((1.0, _TAN_PI_8), (1.0, -_TAN_PI_8), (_TAN_PI_8, 1.0), (_TAN_PI_8, -1.0))
_MIN_SINE = 0.5  # of half the angle of a corner; a corner under 60° would have a long mitre, so it counts as two ends
_MIN_COSINE = 1e-6  # of half the angle of a corner; below it the barriers are collinear and need no turning point
_MAX_PUSHES = 8  # attempts to reach a free position by moving off the nearest barriers


def corner_polygons(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], ...]:
    """Candidate turning points around the discs, corners and free ends of barriers.

    Args:
        barriers: M thick segments.
        offset: distance of the candidates from the barriers' surfaces, m.

    Returns:
        For discs, corners and ends in turn: C wide polygons (C, k, 2), and C polygons (C, l, 2) with more points that
        keep closer to the barrier, for places where the wide ones do not fit; m.
    """
    return (_disc_polygons(barriers, offset), *_end_polygons(barriers, offset))


def _disc_polygons(barriers: Barriers, offset: float) -> tuple[Array, Array]:
    """Hexagons (D, 6, 2) and dodecagons (D, 12, 2) around the discs among the barriers."""
    is_disc = (barriers.start == barriers.end).all(axis=1)
    centre, radius = barriers.start[is_disc][:, None, :], (barriers.radius[is_disc] + offset)[:, None, None]
    return centre + radius * _HEXAGON, centre + radius * _DODECAGON


def _end_polygons(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Points around the ends of barriers that have a length.

    Returns:
        Where two barriers meet, mitres (C, 1, 2) and bevels (C, 2, 2); at the other ends, halves of squares (E, 2, 2)
        and of octagons (E, 4, 2).
    """
    along = barriers.end - barriers.start
    length = vectors.lengths(along)
    has_length = length > 0.0
    unit = along[has_length] / length[has_length, None]
    ends = np.concatenate((barriers.start[has_length], barriers.end[has_length]))
    outward = np.concatenate((-unit, unit))
    radius = (np.tile(barriers.radius[has_length], 2) + offset)[:, None]

    meets = (ends[:, None, :] == ends[None, :, :]).all(axis=2) & ~np.eye(len(ends), dtype=bool)
    partner = meets.argmax(axis=1) if len(ends) else np.zeros(0, dtype=int)
    both = outward + outward[partner]
    cosine = vectors.lengths(both) / 2  # of half the angle between the two barriers
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    joined = (meets.sum(axis=1) == 1) & (sine >= _MIN_SINE)
    # Each corner once, at the first of its two ends; none where a wall continues straight on.
    first = joined & (np.arange(len(ends)) < partner) & (cosine > _MIN_COSINE)
    bisector = both[first] / (2 * cosine[first, None])
    mitre = _offsets(ends[first], bisector, radius[first], [(1 / sine[first], 0.0)])
    cut = (1.0 - sine[first]) / cosine[first]
    bevel = _offsets(ends[first], bisector, radius[first], [(1.0, cut), (1.0, -cut)])
    free_ends = (ends[~joined], outward[~joined], radius[~joined])
    return (mitre, bevel), (_offsets(*free_ends, _SQUARE), _offsets(*free_ends, _OCTAGON))


def _offsets(origin: Array, ahead: Array, radius: Array, steps: Sequence[tuple[Any, Any]]) -> Array:
    """Points at offsets from origins.

    Args:
        origin: (E, 2), m.
        ahead: (E, 2), unit vectors.
        radius: (E, 1), unit of the steps, m.
        steps: offsets (ahead, left), each a float or (E,).

    Returns:
        (E, len(steps), 2), m.
    """
    left = np.stack((-ahead[:, Y], ahead[:, X]), axis=1)
    columns = [origin + radius * (ahead * np.reshape(a, (-1, 1)) + left * np.reshape(b, (-1, 1))) for a, b in steps]
    return np.stack(columns, axis=1)


class _Graph(NamedTuple):
    """Visibility graph: turning points (n, 2), shortest path lengths (n, n), and next node on each path (n, n)."""

    nodes: Array
    lengths: Array
    next_node: IntArray


@dataclass(frozen=True, eq=False)
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

    outline: Array
    barriers: Barriers
    clearance: float

    def __post_init__(self) -> None:
        if not self.clearance > 0.0:
            raise ValueError(f"clearance must be positive, got {self.clearance}")

    def is_free(self, points: Array) -> BoolArray:
        """Whether the disc can be at the points; (N, 2) to (N,) of bool."""
        keeps_clearance: BoolArray = np.all(self.barriers.gaps(points) >= self.clearance - TOLERANCE, axis=0)
        return keeps_clearance & inside_edges(points, *self._borders)

    def is_clear(self, start: Array, end: Array) -> BoolArray:
        """Whether the disc can move straight from start to end; (N, 2) and (N, 2) to (N,) of bool."""
        is_clear: BoolArray = np.all(segment_distances(start, end, self.barriers) >= self.clearance - TOLERANCE, axis=0)
        return is_clear

    def nearest_free(self, point: Point) -> Point | None:
        """A free position near a point.

        Returns:
            The point itself if it is free, else the point pushed off the barriers that are too near, else the nearest
            turning point; None if there is none on this side of the barriers.
        """
        origin = candidate = np.array([point], dtype=float)
        for _ in range(_MAX_PUSHES):
            if self.is_free(candidate)[0]:
                crossed = candidate is not origin and segments_cross(origin, candidate, self.barriers).any()
                return None if crossed else (float(candidate[0, X]), float(candidate[0, Y]))
            candidate = candidate + self._push(candidate)
        return self._nearest_node(origin)

    def towards(self, goal: Point) -> GoalField:
        """The shortest paths to one goal; faster than `path` and `distance` for many starts."""
        return GoalField(self, goal)

    def path(self, start: Point, goal: Point) -> Array | None:
        """The shortest path.

        A start or goal without the clearance is connected to its `nearest_free` position.

        Returns:
            (K, 2), m, from start to goal; None if there is no path.
        """
        return self.towards(goal).path(start)

    def distance(self, start: Point, goal: Point) -> float:
        """Length of the shortest path, m; infinite if there is none."""
        return float(self.towards(goal).distances(np.array([start], dtype=float))[0])

    def _is_clear(self, start: Array, end: Array) -> BoolArray:
        """`is_clear` for positions known to be free.

        Between free positions a barrier comes too near only at one of its ends or by being crossed, which is faster
        to test.
        """
        ends, minimum, lines = self._ends
        x, y = Barriers(start, end, np.zeros(len(start))).towards(ends)
        keeps_clearance: BoolArray = np.all(x * x + y * y >= minimum * minimum, axis=1)
        return keeps_clearance & ~segments_cross(start, end, lines).any(axis=0)

    @cached_property
    def _ends(self) -> tuple[Array, Array, Barriers]:
        """Distinct ends of the barriers (E, 2), their minimum distances (E,), and the barriers that have a length."""
        barriers = self.barriers
        rows = np.column_stack((np.concatenate((barriers.start, barriers.end)), np.tile(barriers.radius, 2)))
        rows = np.unique(rows, axis=0)
        has_length = (barriers.start != barriers.end).any(axis=1)
        position, radius = slice(0, 2), 2  # columns
        return rows[:, position].copy(), rows[:, radius] + (self.clearance - TOLERANCE), barriers.subset(has_length)

    @cached_property
    def _borders(self) -> tuple[Array, Array]:
        """Start and end of the edges of the outline and, as holes, of solid objects; (K, 2) each."""
        start, end = self.barriers.start, self.barriers.end
        solid = _solid_edges(self.barriers, {(float(x), float(y)) for x, y in self.outline})
        following = np.concatenate((self.outline[1:], self.outline[:1]))
        return np.concatenate((self.outline, start[solid])), np.concatenate((following, end[solid]))

    @cached_property
    def _graph(self) -> _Graph:
        nodes = self._turning_points()
        count = len(nodes)
        i, j = np.triu_indices(count, 1)
        clear = self._is_clear(nodes[i], nodes[j])
        i, j = i[clear], j[clear]
        lengths = np.where(np.eye(count, dtype=bool), 0.0, np.inf)
        lengths[i, j] = lengths[j, i] = vectors.lengths(nodes[i] - nodes[j])
        next_node = np.tile(np.arange(count), (count, 1))
        for k in range(count):  # Floyd's algorithm
            detour = lengths[:, k, None] + lengths[None, k, :]
            is_shorter = detour < lengths
            lengths = np.where(is_shorter, detour, lengths)
            next_node = np.where(is_shorter, next_node[:, k, None], next_node)
        return _Graph(nodes, lengths, next_node)

    def _turning_points(self) -> Array:
        """Free positions (n, 2) around the inflated barriers: wide polygons, or closer ones where these do not fit."""
        offset = self.clearance + MARGIN
        found = []
        for wide, close in corner_polygons(self.barriers, offset):
            fits = self.is_free(wide.reshape(-1, 2)).reshape(wide.shape[:2]).all(axis=1)
            narrow = close[~fits].reshape(-1, 2)
            found += [wide[fits].reshape(-1, 2), narrow[self.is_free(narrow)]]
        return np.concatenate(found)

    def _push(self, position: Array) -> Array:
        """Displacement (1, 2) that moves a position (1, 2) off the barrier whose clearance it misses most."""
        x, y = (component[:, 0] for component in self.barriers.towards(position))
        distance = np.sqrt(x * x + y * y)
        deepest = int(np.argmin(distance - self.barriers.radius))
        if distance[deepest] == 0.0:  # on the core line: no direction is better than another
            return np.zeros((1, 2))
        missing = self.clearance - (distance[deepest] - self.barriers.radius[deepest])
        scale = max(float(missing), 0.0) / float(distance[deepest])
        return np.array([[-float(x[deepest]) * scale, -float(y[deepest]) * scale]])

    def _nearest_node(self, position: Array) -> Point | None:
        """The nearest turning point to a position (1, 2) on the same side of the barriers."""
        nodes = self._graph.nodes
        nodes = nodes[~segments_cross(np.repeat(position, len(nodes), axis=0), nodes, self.barriers).any(axis=0)]
        if len(nodes) == 0:
            return None
        x, y = nodes[int(np.argmin(vectors.lengths(nodes - position)))]
        return float(x), float(y)


class GoalField:
    """The shortest paths from anywhere to one goal.

    Args:
        space: free space that paths stay in.
        goal: m; paths to a goal without the clearance end through its `FreeSpace.nearest_free` position.
    """

    def __init__(self, space: FreeSpace, goal: Point) -> None:
        self.space = space
        self.goal = goal
        self._end = space.nearest_free(goal)

    def distances(self, points: Array) -> Array:
        """Length of the shortest path from each point; (P, 2) to (P,), m; infinite if there is none."""
        starts = self._starts(points)
        lengths, _ = self._entries(starts)
        return np.where(np.isfinite(lengths), lengths + vectors.lengths(starts - points), np.inf)

    def path(self, start: Point) -> Array | None:
        """The shortest path from start to goal, (K, 2), m; None if there is none."""
        origin = np.array([start], dtype=float)
        free = self._starts(origin)
        lengths, entries = self._entries(free)
        if not np.isfinite(lengths[0]):
            return None
        points = [origin, free, *self._turns(int(entries[0])), np.array([self._end]), np.array([self.goal])]
        return np.concatenate([points[0], *(b for a, b in pairwise(points) if (a != b).any())])

    def _starts(self, points: Array) -> Array:
        """The free position nearest to each point, (P, 2); NaN where there is none."""
        starts = points.astype(float)
        for k in np.flatnonzero(~self.space.is_free(points)):
            x, y = starts[k]
            starts[k] = self.space.nearest_free((float(x), float(y))) or (np.nan, np.nan)
        return starts

    @cached_property
    def _from_nodes(self) -> tuple[Array, IntArray]:
        """For each of n nodes: length of its path to the goal (n,), and the last node on that path (n,)."""
        graph = self.space._graph
        end = np.array([self._end]).repeat(len(graph.nodes), axis=0)
        last = np.where(self.space._is_clear(graph.nodes, end), vectors.lengths(graph.nodes - end), np.inf)
        totals = graph.lengths + last[None, :]
        exits = np.argmin(totals, axis=1)
        return totals[np.arange(len(totals)), exits], exits

    def _entries(self, starts: Array) -> tuple[Array, IntArray]:
        """Length of the path from each free start (P,), and the first node on it (P,); -1 for a straight path."""
        lengths = np.full(len(starts), np.inf)
        entries = np.full(len(starts), -1)
        if self._end is None:
            return lengths, entries
        end = np.array([self._end]).repeat(len(starts), axis=0)
        straight = self.space._is_clear(starts, end)
        lengths[straight] = vectors.lengths(end - starts)[straight]
        blocked = np.flatnonzero(~straight & ~np.isnan(starts[:, X]))
        if len(blocked) and len(self.space._graph.nodes):
            self._fill_blocked(starts, blocked, lengths, entries)
        return lengths, entries

    def _fill_blocked(self, starts: Array, blocked: IntArray, lengths: Array, entries: IntArray) -> None:
        """Fill in lengths and entries of the starts that have no straight path.

        Nodes are tried in the order of the path length that they would give, in batches of growing size: testing
        visibility is the expensive part, and mostly one of the first nodes is visible.
        """
        nodes = self.space._graph.nodes
        bounds = vectors.lengths(nodes[None, :, :] - starts[blocked, None, :]) + self._from_nodes[0]
        order = np.argsort(bounds, axis=1, kind="stable")
        bounds = np.take_along_axis(bounds, order, axis=1)
        tried, batch = 0, 2
        while len(blocked) and tried < len(nodes):
            row, column = np.nonzero(np.isfinite(bounds[:, tried : tried + batch]))
            column += tried
            clear = np.zeros(bounds.shape, dtype=bool)
            clear[row, column] = self.space._is_clear(starts[blocked[row]], nodes[order[row, column]])
            found, first = clear.any(axis=1), clear.argmax(axis=1)
            rows = np.flatnonzero(found)
            lengths[blocked[rows]] = bounds[rows, first[rows]]
            entries[blocked[rows]] = order[rows, first[rows]]
            blocked, bounds, order = blocked[~found], bounds[~found], order[~found]
            tried, batch = tried + batch, batch * 2

    def _turns(self, node: int) -> list[Array]:
        """Turning points (1, 2) of the path from a node on; none for -1."""
        if node < 0:
            return []
        graph, last = self.space._graph, int(self._from_nodes[1][node])
        path = [node]
        while path[-1] != last:
            path.append(int(graph.next_node[path[-1], last]))
        return [graph.nodes[k : k + 1] for k in path]


def _solid_edges(barriers: Barriers, outline: set[Point]) -> BoolArray:
    """Mask (M,) of the barriers that are edges of a solid object.

    A solid object is a closed line of consecutive barriers without a corner of the room's outline.
    """
    start = [(float(x), float(y)) for x, y in barriers.start]
    end = [(float(x), float(y)) for x, y in barriers.end]
    solid = np.zeros(len(barriers), dtype=bool)
    first = 0
    for k in range(len(barriers)):
        closes = end[k] == start[first]
        if closes and k > first + 1 and outline.isdisjoint(start[first : k + 1]):
            solid[first : k + 1] = True
        if closes or k + 1 == len(barriers) or end[k] != start[k + 1]:  # the line ends here
            first = k + 1
    return solid
