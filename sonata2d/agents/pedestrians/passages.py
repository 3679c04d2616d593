"""Narrow passages: pedestrians do not enter a door or a gap in which others walk the other way; they wait beside it.

One direction at a time has the right of way. It changes when no pedestrian that walks in this direction is near, or
when those in the other direction have waited for `_PATIENCE`. So the direction alternates, as Helbing & Molnár (Phys.
Rev. E 51 (1995) 4282, section III) describe it for two crowds at a door; the rules and figures are ours.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, find_within, is_within, solids_of
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Floats, Floats2, Ints, Ints2, Packed, unpack, zeros
from ...core.compiled.scalar import END_X, RADIUS, START_X, length, towards
from ...core.geometry import inside_polygon, segment_distances
from ...core.humans import X, Y
from ...core.portable_math import Array, BoolArray
from ...core.scene import Scene
from .models.base import Walkers
from .routes import Routes, stopping_speed

_NARROWEST, WIDEST = 0.3, 1.1  # m: one person passes, and two do not pass each other comfortably
_DEEPEST, _OFFSET = 8.0, 0.15  # m: of a passage between its two ends, and between their middles across it
_SAMPLING = 0.25  # m, between the places at which the width of a deep passage is tested
_ROOM_AHEAD, _ROOM = 0.8, 0.6  # m: at both ends of a passage there is a free circle of this radius at this distance
_ROOM_ASIDE = 0.8  # m, by which this circle may be off the line of the passage
_RANGE = 3.0  # m, on the path, within which pedestrians consider a passage
_INSIDE = 0.45  # m, from the end of a passage, within which pedestrians count as inside
_CLAIM = 1.5  # m, from the end of a passage, within which pedestrians can get the right of way
_PATIENCE = 6.0  # s, after which the right of way goes to the direction that waits
_JAM = 18.0  # s, after which the rule is suspended, because a pedestrian in the passage may be stuck
_WAITING_DISTANCE = 1.1  # m, from the end of a passage
_LANE, _LANE_LENGTH = 0.55, 2.2  # m, half the width and the length of what is kept free for those who come out
_STEP_ASIDE = 0.5  # m/s

_X, _Y, _UX, _UY, _HALF_WIDTH, _HALF_DEPTH, _LEFT_ROOM, _RIGHT_ROOM = range(8)  # columns of `Passages.frame`


class Passages(NamedTuple):
    """All narrow passages of a scene, for kernels.

    Attributes:
        frame: (G, 8), x and y of the middle, m; unit vector from one side wall to the other; half the distance between
            these walls, m; half the length of the passage in the walking direction, m, 0 between two ends of walls;
            where people wait at the end to the left of the unit vector, and at that to the right: 1 on the side to
            which the vector points, -1 on the other one, 0 on both.
        holder: (G,) of int, direction with the right of way: 1 to the left of the unit vector, -1 to the right, 0 if
            no pedestrian has it.
        waited: (G,), for which the other direction has been waiting, s.
        way: (G, N) of int, direction in which each pedestrian is about to pass, or passes; 0 if it does not.
        distance: (G, N), on the path of each pedestrian with a way, to the end of the passage, m; 0 inside.
    """

    frame: Floats2
    holder: Ints
    waited: Floats
    way: Ints2
    distance: Floats2


def find_passages(scene: Scene) -> Passages:
    """The narrow passages between walls and furniture that have room for those who wait on both sides."""
    solids = Packed(solids_of(scene.barriers))
    narrow = np.zeros((4 * len(scene.barriers), 5))
    ends = narrow[: _find_ends(solids.argument, narrow)]
    ends = ends[inside_polygon(ends[:, :2], scene.outline)]
    groups: list[list[Array]] = []
    for end in ends:
        group = next((group for group in groups if _are_of_one(scene, group[0], end)), None)
        if group is None:
            groups.append([end])
        else:
            group.append(end)
    frames = [_frame(scene, np.array(group)) for group in groups]
    frame = np.array([row for row in frames if row is not None]).reshape(-1, 8)
    shape = len(frame), len(scene.humans)
    return zeros(Passages, len(frame), frame=frame, way=np.zeros(shape, dtype=np.int64), distance=np.zeros(shape))


def _are_of_one(scene: Scene, first: Array, second: Array) -> bool:
    """Whether two narrow places are parts of one passage: one behind the other, with neither walls nor room between."""
    dx, dy = (second[:2] - first[:2]).tolist()
    _, _, ux, uy, _ = first.tolist()
    ahead = abs(dy * ux - dx * uy)
    is_parallel = abs(ux * second[_UX] + uy * second[_UY]) > 0.9
    if not is_parallel or abs(dx * ux + dy * uy) > _OFFSET or ahead > _DEEPEST:
        return False
    if segment_distances(first[None, :2], second[None, :2], scene.barriers).min() < _NARROWEST / 4:
        return False  # as in a hollow wall
    count = int(ahead / _SAMPLING) + 1
    between = np.array([[first[0] + dx * k / count, first[1] + dy * k / count] for k in range(1, count)])
    return not len(between) or bool(scene.barriers.gaps(between).min(axis=0).max() < WIDEST / 2)


def _frame(scene: Scene, ends: Array) -> Array | None:
    """A row of `Passages.frame` for a passage that consists of narrow places; None without room for those who wait."""
    narrowest = ends[ends[:, 4].argmin()]
    x, y = (np.add.reduce(ends[:, :2], axis=0) / len(ends)).tolist()
    ux, uy = narrowest[2:4].tolist()
    ahead = (ends[:, 1] - y) * ux - (ends[:, 0] - x) * uy
    half_depth = abs(ahead).max()
    sides = [_side_with_room(scene, x, y, ux, uy, sign * (half_depth + _ROOM_AHEAD)) for sign in (1.0, -1.0)]
    if None in sides:
        return None
    return np.array([x, y, ux, uy, narrowest[4] / 2, half_depth, *sides])


def _side_with_room(scene: Scene, x: float, y: float, ux: float, uy: float, ahead: float) -> float | None:
    """Where those can wait who come to an end of a passage: 1, -1 or 0, as in `Passages.frame`; None if nowhere.

    Args:
        scene: its walls and furniture.
        x, y, ux, uy: see `Passages.frame`.
        ahead: of the place from the middle of the passage, m, positive to the left of (ux, uy).
    """
    asides = np.array([0.0, _ROOM_ASIDE, -_ROOM_ASIDE])
    places = np.stack((x - uy * ahead + ux * asides, y + ux * ahead + uy * asides), axis=1)
    is_free = (scene.barriers.gaps(places).min(axis=0) >= _ROOM) & inside_polygon(places, scene.outline)
    ahead_free, left_free, right_free = is_free.tolist()
    if ahead_free or (left_free and right_free):
        return 0.0
    return 1.0 if left_free else -1.0 if right_free else None


@kernel
def _find_ends(packed_solids: Any, narrow: Array) -> int:
    """Find the narrow places at the ends of barriers.

    Args:
        packed_solids: walls and furniture.
        narrow: (M, 5), is filled: middle, m; unit vector from one side to the other; width, m.

    Returns:
        Number of rows that were filled.
    """
    solids, count = unpack(packed_solids, Solids), 0
    barriers, near = solids.table, np.empty(len(solids.table), dtype=np.int64)
    for k in range(len(barriers)):
        for column in (START_X, END_X):
            x, y = barriers[k, column], barriers[k, column + 1]
            for n in range(find_within(solids, x, y, WIDEST + barriers[k, RADIUS], near)):
                j = near[n]
                dx, dy = towards(barriers, j, x, y)
                size = max(length(dx, dy), 1e-6)
                width = size - barriers[k, RADIUS] - barriers[j, RADIUS]
                if not _NARROWEST < width < WIDEST or count == len(narrow):
                    continue
                ux, uy, middle = dx / size, dy / size, barriers[k, RADIUS] + 0.5 * width
                mx, my = x + ux * middle, y + uy * middle
                if not is_within(solids, mx, my, 0.5 * width - 1e-6):
                    row = narrow[count]
                    row[0], row[1], row[2], row[3], row[4] = mx, my, ux, uy, width
                    count += 1
    return count


@subroutine
def give_way(
    passages: Passages, routes: Routes, walkers: Walkers, humans: Array, is_present: BoolArray, side: float, dt: float
) -> None:
    """Let pedestrians wait beside passages in which others have the right of way.

    Args:
        passages: updated.
        routes: of the pedestrians.
        walkers: desired directions and speeds of those who wait are changed.
        humans: (N, 9), columns of `core.humans`.
        is_present: (N,).
        side: of the rules, +1 or -1: to which those step who wait right in front of a passage.
        dt: tick, s.
    """
    if len(passages.holder) == 0:
        return
    for k in range(len(humans)):
        is_walking = is_present[k] and walkers.walks[k]
        for g in range(len(passages.holder)):
            aside, ahead = _in_frame(passages, g, humans[k, X], humans[k, Y])
            # Those who were on their way through have a way until they have come out.
            comes_out = is_walking and passages.way[g, k] * ahead > 0.0 and _is_inside(passages, g, aside, ahead)
            passages.way[g, k] = passages.way[g, k] if comes_out else 0
            passages.distance[g, k] = 0.0
        if is_walking:
            _find_way(passages, k, routes, humans)
    for g in range(len(passages.holder)):
        _choose_holder(passages, g, dt)
        for k in range(len(humans)):
            way, holder = passages.way[g, k], passages.holder[g]
            has_way = (way * holder > 0 and passages.waited[g] <= _PATIENCE) or passages.waited[g] > _JAM
            if way * holder != 0 and not has_way and passages.distance[g, k] > 0.0:
                _wait(passages, g, k, walkers, humans, side)
                routes.checkpoint[k, 0] = math.nan  # it makes no progress, but is not stuck


@subroutine
def _find_way(passages: Passages, k: int, routes: Routes, humans: Array) -> None:
    """Find the first passage on the path of pedestrian k."""
    x, y, walked = humans[k, X], humans[k, Y], 0.0
    for n in range(max(routes.next[k], 0), routes.length[k]):
        next_x, next_y = routes.path[k, n, 0], routes.path[k, n, 1]
        step, nearest, first = length(next_x - x, next_y - y), 1.0, -1
        for g in range(len(passages.holder)):
            aside, ahead = _in_frame(passages, g, x, y)
            next_aside, next_ahead = _in_frame(passages, g, next_x, next_y)
            if ahead * next_ahead < 0.0:
                part = ahead / (ahead - next_ahead)
                crossing = aside + part * (next_aside - aside)
                if part < nearest and abs(crossing) < passages.frame[g, _HALF_WIDTH]:
                    nearest, first = part, g
        if first >= 0:
            distance = walked + nearest * step - passages.frame[first, _HALF_DEPTH]
            if passages.way[first, k] == 0 and distance < _RANGE:
                aside, ahead = _in_frame(passages, first, x, y)
                is_inside = walked == 0.0 and _is_inside(passages, first, aside, ahead)
                passages.way[first, k] = -1 if ahead > 0.0 else 1
                passages.distance[first, k] = 0.0 if is_inside else max(distance, 1e-3)
            return
        walked += step
        if walked > _RANGE:
            return
        x, y = next_x, next_y


@subroutine
def _is_inside(passages: Passages, g: int, aside: float, ahead: float) -> bool:
    """Whether a point, in the frame of passage g, is in it or right in front of it."""
    half_width, half_depth = passages.frame[g, _HALF_WIDTH], passages.frame[g, _HALF_DEPTH]
    return bool(abs(aside) < half_width and abs(ahead) < half_depth + _INSIDE)


@subroutine
def _in_frame(passages: Passages, g: int, x: float, y: float) -> tuple[float, float]:
    """A point in the frame of passage g: along its unit vector, and to the left of it; m."""
    dx, dy = x - passages.frame[g, _X], y - passages.frame[g, _Y]
    ux, uy = passages.frame[g, _UX], passages.frame[g, _UY]
    return dx * ux + dy * uy, dy * ux - dx * uy


@subroutine
def _choose_holder(passages: Passages, g: int, dt: float) -> None:
    """Keep the right of way, or give it to the direction whose first walker is nearest."""
    left, right, first = math.inf, math.inf, 0
    for k in range(passages.way.shape[1]):
        distance = passages.distance[g, k]
        if passages.way[g, k] > 0:
            if distance < min(left, right):
                first = 1
            left = min(left, distance)
        elif passages.way[g, k] < 0:
            if distance < min(left, right):
                first = -1
            right = min(right, distance)
    holder = passages.holder[g]
    to_holder, to_other_side = (left, right) if holder > 0 else (right, left)
    if holder != 0:
        passages.waited[g] = passages.waited[g] + dt if to_other_side < _CLAIM else 0.0
        if passages.waited[g] > _PATIENCE and to_holder > 0.0:
            passages.holder[g], passages.waited[g] = -holder, 0.0
            return
        if to_holder < _CLAIM:
            return
    passages.waited[g] = 0.0
    passages.holder[g] = first if min(left, right) < _CLAIM else 0


@subroutine
def _wait(passages: Passages, g: int, k: int, walkers: Walkers, humans: Array, side: float) -> None:
    """Let pedestrian k come no closer to passage g, and step out of the way of those who come out."""
    ux, uy, half_depth = passages.frame[g, _UX], passages.frame[g, _UY], passages.frame[g, _HALF_DEPTH]
    aside, ahead = _in_frame(passages, g, humans[k, X], humans[k, Y])
    ahead = math.copysign(max(abs(ahead) - half_depth, 0.0), ahead)  # from the nearer end
    distance = max(length(aside, ahead), 1e-6)
    rest = max(distance - _WAITING_DISTANCE, 0.0)
    speed, limit = walkers.desired_speed[k], stopping_speed(rest)
    if abs(aside) < _LANE and distance < _LANE_LENGTH:
        outwards = passages.frame[g, _LEFT_ROOM if ahead > 0.0 else _RIGHT_ROOM]
        if outwards == 0.0:  # the side of the rules is as seen by a walker who faces the passage
            outwards = -side * ahead if aside == 0.0 else aside
        # It steps aside, and approaches if it is still far.
        approach = min(rest, 1.0) / distance
        along, across = math.copysign(1.0, outwards) - approach * aside, -approach * ahead
        dx, dy = along * ux - across * uy, along * uy + across * ux
        size = max(length(dx, dy), 1e-6)
        walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = dx / size, dy / size
        limit = max(limit, _STEP_ASIDE)
    walkers.desired_speed[k] = min(speed, limit)
