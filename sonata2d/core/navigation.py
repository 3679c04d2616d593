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
from .portable_math import PI, Array, unit_vectors

_HEXAGON = unit_vectors(np.arange(6) * PI / 3) * 1.1547005383792517  # its edges touch the unit circle
_DODECAGON = unit_vectors(np.arange(12) * PI / 6) * 1.0352761804100832
_SQUARE = ((1.0, 1.0), (1.0, -1.0))
_CUT = 0.41421356237309503  # tan 22.5°
_OCTAGON = ((1.0, _CUT), (1.0, -_CUT), (_CUT, 1.0), (_CUT, -1.0))
_SHARP = 0.5  # a corner of less than 60° is treated as two loose ends: its mitre would stick out far
_STRAIGHT = 1e-6  # cosine of half the angle between barriers that go straight on


def surroundings(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], ...]:
    """Polygons round discs, corners and loose ends of barriers inflated by `offset`, m.

    Returns:
        For each kind wide polygons (C, k, 2) and, for where these have no room, closer ones (C, l, 2).
    """
    return (_discs(barriers, offset), *_corners(barriers, offset))


def _discs(barriers: Barriers, offset: float) -> tuple[Array, Array]:
    """Hexagons (D, 6, 2) round the discs among barriers inflated by `offset`, and closer polygons (D, 12, 2)."""
    is_disc = (barriers.start == barriers.end).all(axis=1)
    centre, reach = barriers.start[is_disc][:, None, :], (barriers.radius[is_disc] + offset)[:, None, None]
    return centre + reach * _HEXAGON, centre + reach * _DODECAGON


def _corners(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Mitres (C, 1, 2) where two barriers meet, squares (E, 2, 2) round other ends; each also with its corners cut."""
    along = barriers.end - barriers.start
    length = vectors.lengths(along)
    long = length > 0.0
    unit = along[long] / length[long, None]
    ends = np.concatenate((barriers.start[long], barriers.end[long]))
    outward = np.concatenate((-unit, unit))
    reach = (np.tile(barriers.radius[long], 2) + offset)[:, None]

    meets = (ends[:, None, :] == ends[None, :, :]).all(axis=2) & ~np.eye(len(ends), dtype=bool)
    partner = meets.argmax(axis=1) if len(ends) else np.zeros(0, dtype=int)
    both = outward + outward[partner]
    cosine = vectors.lengths(both) / 2  # of half the angle between the two barriers
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    joined = (meets.sum(axis=1) == 1) & (sine >= _SHARP)
    first = joined & (np.arange(len(ends)) < partner) & (cosine > _STRAIGHT)  # 0: a wall that goes straight on
    bisector = both[first] / (2 * cosine[first, None])
    mitre = _offsets(ends[first], bisector, reach[first], [(1 / sine[first], 0.0)])
    cut = (1.0 - sine[first]) / cosine[first]
    bevel = _offsets(ends[first], bisector, reach[first], [(1.0, cut), (1.0, -cut)])
    loose = (ends[~joined], outward[~joined], reach[~joined])
    return (mitre, bevel), (_offsets(*loose, _SQUARE), _offsets(*loose, _OCTAGON))


def _offsets(origin: Array, ahead: Array, reach: Array, steps: Sequence[tuple[Any, Any]]) -> Array:
    """Places (E, len(steps), 2) at (ahead, left) steps, in units of the reach (E, 1), from origins (E, 2)."""
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
    columns = [origin + reach * (ahead * np.reshape(a, (-1, 1)) + left * np.reshape(b, (-1, 1))) for a, b in steps]
    return np.stack(columns, axis=1)


TOLERANCE = 1e-6  # m, by which a clearance may be missed
MARGIN = 1e-3  # m, by which ways keep off the inflated corners they turn round


class _Graph(NamedTuple):
    """Where ways turn (n, 2), the shortest lengths between these places (n, n), and the next place on each way."""

    nodes: Array
    lengths: Array
    hop: Any


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Where a disc may be: inside the outline, outside furniture, and at least `clearance` from every barrier.

    Ways go round corners by polygons instead of arcs, so lengths are right to a few centimetres, and a gap hardly wider
    than the disc may count as closed; what is found is always free.

    Args:
        outline: (K, 2), the room's polygon. Its edges are among the barriers, as in `Scene.barriers`.
        barriers: what stands in the way; edges that follow each other round are taken for the outline of a solid
            thing. Join standing people as discs with `Barriers.joined`.
        clearance: of the disc's centre from every barrier, m; positive.

    Raises:
        ValueError: clearance is zero or less.

    Source: Lozano-Pérez & Wesley, Comm. ACM 22 (1979) 560; Floyd, Comm. ACM 5 (1962) 345.
    """

    outline: Array
    barriers: Barriers
    clearance: float

    def __post_init__(self) -> None:
        if not self.clearance > 0.0:
            raise ValueError(f"clearance must be positive, got {self.clearance}")

    def is_free(self, points: Array) -> Any:
        """Whether the disc may stand at the points; (N, 2) to (N,) of bool."""
        keeps_off = np.all(self.barriers.gaps(points) >= self.clearance - TOLERANCE, axis=0)
        return keeps_off & inside_edges(points, *self._borders)

    def is_clear(self, start: Array, end: Array) -> Any:
        """Whether the disc may go straight from start to end; (N, 2) and (N, 2) to (N,) of bool."""
        return np.all(segment_distances(start, end, self.barriers) >= self.clearance - TOLERANCE, axis=0)

    def nearest_free(self, point: Point) -> Point | None:
        """A free place close by: the point itself, or pushed off what is too near, or else the nearest corner.

        Returns:
            None if no free place is found on this side of the barriers.
        """
        here = there = np.array([point], dtype=float)
        for _ in range(8):
            if self.is_free(there)[0]:
                crossed = there is not here and segments_cross(here, there, self.barriers).any()
                return None if crossed else (float(there[0, 0]), float(there[0, 1]))
            there = there + self._push(there)
        return self._nearest_node(here)

    def towards(self, goal: Point) -> GoalField:
        """The ways to one goal, for many questions about it."""
        return GoalField(self, goal)

    def path(self, start: Point, goal: Point) -> Array | None:
        """The shortest way as (K, 2), start and goal included; None if there is none.

        A start or goal slightly too near to something is first led to `nearest_free`.
        """
        return self.towards(goal).path(start)

    def distance(self, start: Point, goal: Point) -> float:
        """Length of the shortest way, m; inf if there is none."""
        return float(self.towards(goal).distances(np.array([start], dtype=float))[0])

    def _is_clear(self, start: Array, end: Array) -> Any:
        """`is_clear` for places known to be free: then barriers can only come near by their ends, or cross."""
        ends, reach, lines = self._ends
        x, y = Barriers(start, end, np.zeros(len(start))).towards(ends)
        keeps_off = np.all(x * x + y * y >= reach * reach, axis=1)
        return keeps_off & ~segments_cross(start, end, lines).any(axis=0)

    @cached_property
    def _ends(self) -> tuple[Array, Array, Barriers]:
        """Distinct ends of the barriers (E, 2), how far to keep off them (E,), and the barriers that have a length."""
        both = self.barriers
        rows = np.column_stack((np.concatenate((both.start, both.end)), np.tile(both.radius, 2)))
        rows = np.unique(rows, axis=0)
        long = (both.start != both.end).any(axis=1)
        lines = Barriers(both.start[long], both.end[long], both.radius[long])
        return rows[:, :2].copy(), rows[:, 2] + (self.clearance - TOLERANCE), lines

    @cached_property
    def _borders(self) -> tuple[Array, Array]:
        """Edges (K, 2), (K, 2) of the outline and, as holes, of solid things."""
        start, end = self.barriers.start, self.barriers.end
        solid = _solid(self.barriers, {(float(x), float(y)) for x, y in self.outline})
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
        hop = np.tile(np.arange(count), (count, 1))
        for k in range(count):
            detour = lengths[:, k, None] + lengths[None, k, :]
            shorter = detour < lengths
            lengths = np.where(shorter, detour, lengths)
            hop = np.where(shorter, hop[:, k, None], hop)
        return _Graph(nodes, lengths, hop)

    def _turning_points(self) -> Array:
        """Free places (n, 2) just off the inflated barriers; closer ones where the space is narrow."""
        offset = self.clearance + MARGIN
        found = []
        for wide, close in surroundings(self.barriers, offset):
            has_room = self.is_free(wide.reshape(-1, 2)).reshape(wide.shape[:2]).all(axis=1)
            narrow = close[~has_room].reshape(-1, 2)
            found += [wide[has_room].reshape(-1, 2), narrow[self.is_free(narrow)]]
        return np.concatenate(found)

    def _push(self, at: Array) -> Array:
        """The step (1, 2) that takes a place just off the barrier it is deepest in."""
        x, y = (component[:, 0] for component in self.barriers.towards(at))
        apart = np.sqrt(x * x + y * y)
        deepest = int(np.argmin(apart - self.barriers.radius))
        if apart[deepest] == 0.0:
            return np.zeros((1, 2))
        lacking = self.clearance - (apart[deepest] - self.barriers.radius[deepest])
        scale = max(float(lacking), 0.0) / float(apart[deepest])
        return np.array([[-float(x[deepest]) * scale, -float(y[deepest]) * scale]])

    def _nearest_node(self, here: Array) -> Point | None:
        nodes = self._graph.nodes
        nodes = nodes[~segments_cross(np.repeat(here, len(nodes), axis=0), nodes, self.barriers).any(axis=0)]
        if len(nodes) == 0:
            return None
        x, y = nodes[int(np.argmin(vectors.lengths(nodes - here)))]
        return float(x), float(y)


class GoalField:
    """The shortest ways from anywhere to one goal.

    Args:
        space: what may be walked through.
        goal: m; if it is slightly too near to something, ways end through `FreeSpace.nearest_free` of it.
    """

    def __init__(self, space: FreeSpace, goal: Point) -> None:
        self.space = space
        self.goal = goal
        self._end = space.nearest_free(goal)

    def distances(self, points: Array) -> Array:
        """Length of the shortest way from each point; (P, 2) to (P,), m; inf if there is none."""
        starts = self._starts(points)
        lengths, _ = self._entries(starts)
        return np.where(np.isfinite(lengths), lengths + vectors.lengths(starts - points), np.inf)

    def path(self, start: Point) -> Array | None:
        """The shortest way as (K, 2), start and goal included; None if there is none."""
        here = np.array([start], dtype=float)
        free = self._starts(here)
        lengths, entries = self._entries(free)
        if not np.isfinite(lengths[0]):
            return None
        way = [here, free, *self._turns(int(entries[0])), np.array([self._end]), np.array([self.goal])]
        return np.concatenate([way[0], *(b for a, b in pairwise(way) if (a != b).any())])

    def _starts(self, points: Array) -> Array:
        """The points, led to free places; NaN where there is none."""
        starts = points.astype(float)
        for k in np.flatnonzero(~self.space.is_free(points)):
            x, y = starts[k]
            starts[k] = self.space.nearest_free((float(x), float(y))) or (np.nan, np.nan)
        return starts

    @cached_property
    def _from_nodes(self) -> tuple[Array, Any]:
        """For each node: the length of its way to the goal, and the last node on it."""
        graph = self.space._graph
        end = np.array([self._end]).repeat(len(graph.nodes), axis=0)
        last = np.where(self.space._is_clear(graph.nodes, end), vectors.lengths(graph.nodes - end), np.inf)
        whole = graph.lengths + last[None, :]
        exits = np.argmin(whole, axis=1)
        return whole[np.arange(len(whole)), exits], exits

    def _entries(self, starts: Array) -> tuple[Array, Any]:
        """Length of the way from each free start to the goal, and the node it first goes to (-1: straight)."""
        lengths = np.full(len(starts), np.inf)
        entries = np.full(len(starts), -1)
        if self._end is None:
            return lengths, entries
        end = np.array([self._end]).repeat(len(starts), axis=0)
        straight = self.space._is_clear(starts, end)
        lengths[straight] = vectors.lengths(end - starts)[straight]
        still = np.flatnonzero(~straight & ~np.isnan(starts[:, 0]))
        if len(still) and len(self.space._graph.nodes):
            self._enter(starts, still, lengths, entries)
        return lengths, entries

    def _enter(self, starts: Array, still: Any, lengths: Array, entries: Any) -> None:
        """Fill in the starts that must go round something: nodes are tried from the one that promises most."""
        nodes = self.space._graph.nodes
        promised = vectors.lengths(nodes[None, :, :] - starts[still, None, :]) + self._from_nodes[0]
        order = np.argsort(promised, axis=1, kind="stable")
        promised = np.take_along_axis(promised, order, axis=1)
        tried, width = 0, 2
        while len(still) and tried < len(nodes):
            row, column = np.nonzero(np.isfinite(promised[:, tried : tried + width]))
            column += tried
            clear = np.zeros(promised.shape, dtype=bool)
            clear[row, column] = self.space._is_clear(starts[still[row]], nodes[order[row, column]])
            found, first = clear.any(axis=1), clear.argmax(axis=1)
            rows = np.flatnonzero(found)
            lengths[still[rows]] = promised[rows, first[rows]]
            entries[still[rows]] = order[rows, first[rows]]
            still, promised, order = still[~found], promised[~found], order[~found]
            tried, width = tried + width, width * 2

    def _turns(self, node: int) -> list[Array]:
        """Places (1, 2) where the way turns, from its first node on; none for -1."""
        if node < 0:
            return []
        graph, last = self.space._graph, int(self._from_nodes[1][node])
        way = [node]
        while way[-1] != last:
            way.append(int(graph.hop[way[-1], last]))
        return [graph.nodes[k : k + 1] for k in way]


def _solid(barriers: Barriers, outline: set[Point]) -> Any:
    """(M,) of bool: which barriers are edges of a solid thing, a closed line without a corner of the room's outline."""
    start = [(float(x), float(y)) for x, y in barriers.start]
    end = [(float(x), float(y)) for x, y in barriers.end]
    solid = np.zeros(len(barriers), dtype=bool)
    first = 0
    for k in range(len(barriers)):
        closes = end[k] == start[first]
        if closes and k > first + 1 and outline.isdisjoint(start[first : k + 1]):
            solid[first : k + 1] = True
        if closes or k + 1 == len(barriers) or end[k] != start[k + 1]:
            first = k + 1
    return solid
