"""Narrow passages: pedestrians do not enter a door or a gap in which others walk the other way; they wait beside it.

One direction at a time has the right of way. It changes when no pedestrian that walks in this direction is near, or
when those in the other direction have waited for `_PATIENCE`. So the direction alternates, as Helbing & Molnár (Phys.
Rev. E 51 (1995) 4282, section III) describe it for two crowds at a door; the rules and figures are ours.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...core.barrier_grid import (
    Solids,
    column_of,
    find_within,
    is_blocked,
    is_within,
    packed_solids,
    rows_near_line,
    solids_of,
)
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Floats, Floats2, Ints, Ints2, unpack, zeros
from ...core.compiled.scalar import END_X, RADIUS, START_X, is_inside, length, towards
from ...core.geometry import Barriers, inside_polygon
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
_FOR_ONE = 0.5  # m, width of a gap that people pass one by one
_PATIENCE = 6.0  # s, after which the right of way goes to the direction that waits
_JAM = 18.0  # s, after which the rule is suspended, because a pedestrian in the passage may be stuck
_WAITING_DISTANCE = 1.1  # m, from the end of a passage
_LANE, _LANE_LENGTH = 0.55, 2.2  # m, half the width and the length of what is kept free for those who come out
_STEP_ASIDE = 0.5  # m/s

_NO_ROOM = 2.0  # neither side
_MOST_WAYS = 4  # passages that a pedestrian passes at a time

_X, _Y, _UX, _UY, _HALF_WIDTH, _HALF_DEPTH, _LEFT_ROOM, _RIGHT_ROOM = range(8)  # columns of `Passages.frame`


class Passages(NamedTuple):
    """All narrow passages of a scene, for kernels.

    Attributes:
        frame: (G, 8), x and y of the middle, m; unit vector from one side wall to the other; half the distance between
            these walls, m; half the length of the passage in the walking direction, m, 0 between two ends of walls;
            where people wait at the end to the left of the unit vector, and at that to the right: 1 on the side to
            which the vector points, -1 on the other one, 0 on both.
        gates: (G,) lines from one side wall to the other.
        holder: (G,) of int, direction with the right of way: 1 to the left of the unit vector, -1 to the right, 0 if
            no pedestrian has it.
        waited: (G,), for which the other direction has been waiting, s.
        passage: (N, W) of int, passages that each pedestrian is about to pass, or passes; -1 for none.
        way: (N, W) of int, direction in which it passes.
        distance: (N, W), on its path to the end of the passage, m; 0 inside.
    """

    frame: Floats2
    gates: Solids
    holder: Ints
    waited: Floats
    passage: Ints2
    way: Ints2
    distance: Floats2


def find_passages(scene: Scene) -> Passages:
    """The narrow passages between walls and furniture that have room for those who wait on both sides."""
    solids = packed_solids(scene.barriers)
    narrow = np.zeros((4 * len(scene.barriers), 5))
    narrow = narrow[: _find_ends(solids.argument, narrow)]
    ends = np.ascontiguousarray(narrow[inside_polygon(narrow[:, :2], scene.outline)])
    frame = np.zeros((len(ends), 8))
    frame = frame[: _find_frames(solids.argument, scene.outline_edges.copy(), ends, frame)].copy()
    half = frame[:, _UX : _UY + 1] * frame[:, _HALF_WIDTH : _HALF_WIDTH + 1]
    gates = zip((frame[:, :2] - half).tolist(), (frame[:, :2] + half).tolist(), strict=True)
    shape = len(scene.humans), _MOST_WAYS
    return zeros(
        Passages,
        len(frame),
        frame=frame,
        gates=solids_of(Barriers.of([((ax, ay), (bx, by), 0.0) for (ax, ay), (bx, by) in gates])),
        passage=np.full(shape, -1),
        way=np.zeros(shape, dtype=np.int64),
        distance=np.zeros(shape),
    )


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


@kernel
def _find_frames(packed_solids: Any, outline: Array, ends: Array, frame: Array) -> int:
    """Join narrow places to passages.

    Args:
        packed_solids: walls and furniture.
        outline: (K, 4), start and end of the edges of the room, m.
        ends: (E, 5), see `_find_ends`.
        frame: (E, 8), is filled, see `Passages.frame`.

    Returns:
        Number of rows that were filled.
    """
    solids, count, groups = unpack(packed_solids, Solids), 0, 0
    first, of = np.empty(len(ends), dtype=np.int64), np.empty(len(ends), dtype=np.int64)
    for e in range(len(ends)):
        of[e] = groups
        for group in range(groups):
            if _are_of_one(solids, ends[first[group]], ends[e]):
                of[e] = group
                break
        if of[e] == groups:
            first[groups] = e
            groups += 1
    x, y, members, narrowest = np.zeros(groups), np.zeros(groups), np.zeros(groups), first[:groups].copy()
    for e in range(len(ends)):
        group = of[e]
        x[group], y[group], members[group] = x[group] + ends[e, 0], y[group] + ends[e, 1], members[group] + 1.0
        if ends[e, 4] < ends[narrowest[group], 4]:
            narrowest[group] = e
    half_depth = np.zeros(groups)
    for e in range(len(ends)):
        group = of[e]
        ux, uy = ends[narrowest[group], _UX], ends[narrowest[group], _UY]
        dx, dy = ends[e, 0] - x[group] / members[group], ends[e, 1] - y[group] / members[group]
        half_depth[group] = max(half_depth[group], abs(dy * ux - dx * uy))
    for group in range(groups):
        row, best = frame[count], ends[narrowest[group]]
        row[_X], row[_Y], row[_UX], row[_UY] = x[group] / members[group], y[group] / members[group], best[2], best[3]
        row[_HALF_WIDTH], row[_HALF_DEPTH] = best[4] / 2, half_depth[group]
        row[_LEFT_ROOM] = _side_with_room(solids, outline, row, half_depth[group] + _ROOM_AHEAD)
        row[_RIGHT_ROOM] = _side_with_room(solids, outline, row, -half_depth[group] - _ROOM_AHEAD)
        count += row[_LEFT_ROOM] != _NO_ROOM and row[_RIGHT_ROOM] != _NO_ROOM
    return count


@subroutine
def _are_of_one(solids: Solids, first: Array, second: Array) -> bool:
    """Whether two narrow places are parts of one passage: one behind the other, with neither walls nor room between."""
    dx, dy, ux, uy = second[0] - first[0], second[1] - first[1], first[_UX], first[_UY]
    ahead = abs(dy * ux - dx * uy)
    is_parallel = abs(ux * second[_UX] + uy * second[_UY]) > 0.9
    if not is_parallel or abs(dx * ux + dy * uy) > _OFFSET or ahead > _DEEPEST:
        return False
    if is_blocked(solids, _NARROWEST / 4, 0.0, first[0], first[1], second[0], second[1]):
        return False  # as in a hollow wall
    count = int(ahead / _SAMPLING) + 1
    for k in range(1, count):
        if not is_within(solids, first[0] + dx * k / count, first[1] + dy * k / count, WIDEST / 2):
            return False
    return True


@subroutine
def _side_with_room(solids: Solids, outline: Array, row: Array, ahead: float) -> float:
    """Where those can wait who come to an end of a passage: 1, -1 or 0, as in `Passages.frame`; or `_NO_ROOM`.

    Args:
        solids: walls and furniture.
        outline: (K, 4), start and end of the edges of the room, m.
        row: of `Passages.frame`.
        ahead: of the place from the middle of the passage, m, positive to the left of the unit vector.
    """
    x, y, ux, uy = row[_X] - row[_UY] * ahead, row[_Y] + row[_UX] * ahead, row[_UX], row[_UY]
    if _has_room(solids, outline, x, y):
        return 0.0
    left = _has_room(solids, outline, x + ux * _ROOM_ASIDE, y + uy * _ROOM_ASIDE)
    right = _has_room(solids, outline, x - ux * _ROOM_ASIDE, y - uy * _ROOM_ASIDE)
    if left and right:
        return 0.0
    return 1.0 if left else -1.0 if right else _NO_ROOM


@subroutine
def _has_room(solids: Solids, outline: Array, x: float, y: float) -> bool:
    """Whether a point in the room has a free circle around it."""
    return not is_within(solids, x, y, _ROOM) and is_inside(outline, x, y)


@subroutine
def give_way(
    passages: Passages, routes: Routes, walkers: Walkers, humans: Array, is_present: BoolArray, side: float, dt: float
) -> None:
    """Let pedestrians wait beside passages in which others have the right of way.

    Args:
        passages: updated.
        routes: of the pedestrians.
        walkers: those who wait get new desired directions and speeds.
        humans: (N, 9), columns of `core.humans`.
        is_present: (N,).
        side: of the rules, +1 or -1: to which those step who wait right in front of a passage.
        dt: tick, s.
    """
    if len(passages.holder) == 0:
        return
    for k in range(len(humans)):
        is_walking = is_present[k] and walkers.walks[k]
        for w in range(_MOST_WAYS):
            g = passages.passage[k, w]
            if g < 0:
                continue
            aside, ahead = _in_frame(passages, g, humans[k, X], humans[k, Y])
            # Those who were on their way through have a way until they have come out.
            if not (is_walking and passages.way[k, w] * ahead > 0.0 and _is_inside(passages, g, aside, ahead)):
                passages.passage[k, w] = -1
            passages.distance[k, w] = 0.0
        if is_walking:
            _find_way(passages, k, routes, humans)
    _choose_holders(passages, dt)
    for k in range(len(humans)):
        for w in range(_MOST_WAYS):
            g = passages.passage[k, w]
            if g < 0:
                continue
            way, holder = passages.way[k, w], passages.holder[g]
            has_way = (way * holder > 0 and passages.waited[g] <= _PATIENCE) or passages.waited[g] > _JAM
            waits = holder != 0 and not has_way and passages.distance[k, w] > 0.0
            if waits or _is_behind(passages, k, w):
                _wait(passages, g, k, walkers, humans, side)
                routes.checkpoint[k, 0] = math.nan  # it makes no progress, but is not stuck


@subroutine
def _is_behind(passages: Passages, k: int, w: int) -> bool:
    """Whether pedestrian k lets another one, that walks the same way, pass first through a gap for one.

    Without this, two may block each other where both come to the gap at once.
    """
    g, distance = passages.passage[k, w], passages.distance[k, w]
    if 2.0 * passages.frame[g, _HALF_WIDTH] > _FOR_ONE or distance == 0.0:
        return False
    for other in range(len(passages.passage)):
        for v in range(_MOST_WAYS):
            if passages.passage[other, v] == g and passages.way[other, v] == passages.way[k, w]:
                nearer = passages.distance[other, v]
                is_first = nearer < distance or (nearer == distance and other < k)
                if is_first and nearer < _INSIDE:
                    return True
    return False


@subroutine
def _find_way(passages: Passages, k: int, routes: Routes, humans: Array) -> None:
    """Find the first passage on the path of pedestrian k."""
    begin, count = max(routes.next[k], 0), routes.length[k]
    first, leg, distance = first_on_path(passages, humans[k, X], humans[k, Y], routes.path[k], begin, count, _RANGE)
    if first < 0 or distance >= _RANGE:
        return
    x, y = humans[k, X], humans[k, Y]
    if leg > begin:
        x, y = routes.path[k, leg - 1, 0], routes.path[k, leg - 1, 1]
    aside, ahead = _in_frame(passages, first, x, y)
    is_inside = x == humans[k, X] and y == humans[k, Y] and _is_inside(passages, first, aside, ahead)
    _add_way(passages, k, first, -1 if ahead > 0.0 else 1, 0.0 if is_inside else max(distance, 1e-3))


@subroutine
def first_on_path(
    passages: Passages, x: float, y: float, path: Array, begin: int, count: int, farthest: float
) -> tuple[int, int, float]:
    """The first passage on a path from (x, y), m.

    Args:
        passages: of the scene.
        x, y: start, m.
        path: (R, 2), the points after the start, m.
        begin, count: the path has the points from `begin` up to but not including `count`.
        farthest: distance along the path beyond which legs are not looked at, m.

    Returns:
        Index of the passage, -1 without one; of the point at the end of the leg that passes it; distance to its end
        along the path, m.
    """
    walked = 0.0
    for n in range(begin, count):
        step = length(path[n, 0] - x, path[n, 1] - y)
        first, part = _first_gate(passages, x, y, path[n, 0], path[n, 1])
        if first >= 0:
            return first, n, walked + part * step - passages.frame[first, _HALF_DEPTH]
        walked += step
        if walked > farthest:
            break
        x, y = path[n, 0], path[n, 1]
    return -1, count, 0.0


@subroutine
def people_ahead(passages: Passages, g: int, k: int, distance: float) -> int:
    """Number of pedestrians other than k that pass passage g before one at a distance from it, m."""
    count = 0
    for other in range(len(passages.passage)):
        for w in range(_MOST_WAYS):
            count += other != k and passages.passage[other, w] == g and passages.distance[other, w] < distance
    return count


@subroutine
def width_of(passages: Passages, g: int) -> float:
    """The width of passage g, m."""
    return float(2.0 * passages.frame[g, _HALF_WIDTH])


@subroutine
def _first_gate(passages: Passages, x: float, y: float, to_x: float, to_y: float) -> tuple[int, float]:
    """The first passage that a straight line passes, -1 without one, and the part of the line up to its middle."""
    grid, nearest, first = passages.gates.grid, 1.0, -1
    for column in range(column_of(grid, min(x, to_x)), column_of(grid, max(x, to_x)) + 1):
        low, high = rows_near_line(grid, column, x, y, to_x, to_y, 0.0)
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            g = grid.item[n]
            aside, ahead = _in_frame(passages, g, x, y)
            to_aside, to_ahead = _in_frame(passages, g, to_x, to_y)
            if ahead * to_ahead < 0.0:
                part = ahead / (ahead - to_ahead)
                crossing = aside + part * (to_aside - aside)
                is_first = part < nearest or (part == nearest and g < first)
                if is_first and abs(crossing) < passages.frame[g, _HALF_WIDTH]:
                    nearest, first = part, g
    return first, nearest


@subroutine
def _add_way(passages: Passages, k: int, g: int, way: int, distance: float) -> None:
    """Note that pedestrian k is about to pass passage g, unless it comes out of it."""
    free = -1
    for w in range(_MOST_WAYS):
        if passages.passage[k, w] == g:
            return
        if passages.passage[k, w] < 0 and free < 0:
            free = w
    if free >= 0:
        passages.passage[k, free], passages.way[k, free], passages.distance[k, free] = g, way, distance


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
def _choose_holders(passages: Passages, dt: float) -> None:
    """Update the right of way of each passage: it is kept, or goes to the direction with the nearest walker."""
    count = len(passages.holder)
    # Distance of the nearest walker of each direction, and the direction of the nearer one.
    left, right, first = np.full(count, math.inf), np.full(count, math.inf), np.zeros(count, np.int64)
    for k in range(len(passages.passage)):
        for w in range(_MOST_WAYS):
            g, way, distance = passages.passage[k, w], passages.way[k, w], passages.distance[k, w]
            if g < 0:
                continue
            if distance < min(left[g], right[g]):
                first[g] = way
            if way > 0:
                left[g] = min(left[g], distance)
            else:
                right[g] = min(right[g], distance)
    for g in range(count):
        holder = passages.holder[g]
        to_holder, to_other_side = (left[g], right[g]) if holder > 0 else (right[g], left[g])
        if holder != 0:
            passages.waited[g] = passages.waited[g] + dt if to_other_side < _CLAIM else 0.0
            if passages.waited[g] > _PATIENCE and to_holder > 0.0:
                passages.holder[g], passages.waited[g] = -holder, 0.0
                continue
            if to_holder < _CLAIM:
                continue
        passages.waited[g] = 0.0
        passages.holder[g] = first[g] if min(left[g], right[g]) < _CLAIM else 0


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
