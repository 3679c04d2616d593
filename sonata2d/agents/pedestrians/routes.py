"""Routes of walking pedestrians: what happens on their paths in every tick, compiled.

`decisions` fills `Routes` with destinations and paths. The functions here follow them: waypoints, leaders, arrivals,
blocked paths, targets.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ...core.barrier_grid import Solids, is_crossed
from ...core.compiled.calls import call_for_flag
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats2, Floats3, Ints
from ...core.compiled.scalar import Vector, exp, length, unit_or
from ...core.humans import X, Y
from ...core.portable_math import PI, Array, BoolArray
from .models.base import Walkers, are_together

ARRIVAL_DISTANCE = 0.5  # m from the goal
EXIT_DISTANCE = 0.5  # m from the goal at which a pedestrian leaves
_SHORT_LEG = 1.0  # m, of a path whose direction says nothing
_PASSING_DISTANCE = 3.0  # m beside the goal at which it also leaves, once it has walked past it
_CLUSTER_AREA = 0.7  # m^2, of each pedestrian in a cluster that stands at one goal
_LARGEST_CLUSTER = 3.0  # m, radius
_WAYPOINT_DISTANCE = 0.6  # m from a waypoint at which the next one becomes the target if nothing is in between
_REACHED_DISTANCE = 0.2  # m from a waypoint at which the next one becomes the target anyway
_ARRIVAL_BRAKING = 0.8  # m/s^2, of a walker that arrives where it will stay, or waits
_TURNING, _BRAKING = 1.0, 1.0  # m/s^2, lateral and longitudinal, of a walker that turns at a waypoint
CHECK_INTERVAL = 5  # ticks between checks whether paths are still free
_PROGRESS_INTERVAL = 30  # ticks in which a wandering pedestrian must make progress, else it chooses a new destination
_MINIMUM_PROGRESS = 0.4  # m
# Distance from a corner at which a walker aims, m, per stranger on the inner side; largest and smallest such distance,
# m; cosine of the largest angle between walkers of one stream; sine of the smallest turn that is a corner.
_LANE, _WIDEST_SHIFT, _NARROWEST_SHIFT, _SAME_WAY_COSINE, _CORNER = 1.6, 2.0, 0.03, 0.5, 0.1
_LANE_RANGE = 4.0  # m, from a corner, within which walkers in a stream choose how far beside it they pass
MOST_WAYPOINTS = 32  # in a row of `Routes.path`
_ROOM_AHEAD = 1.5  # m, free distance that a follower needs to walk beside its leader, and a walker to turn at a corner


class Routes(NamedTuple):
    """Targets and paths of all pedestrians, for kernels.

    Attributes:
        order: (N,) of int, the pedestrians that have a path, in the order in which they are processed; as many as
            `walkers`.
        walkers: (1,) of int.
        leader: (N,) of int, for each of these the leader of its group, or the pedestrian itself; else -1.
        first: (N,) of int, the first member of the group of each pedestrian, with or without goals of its own; the
            pedestrian itself if it has no group.
        path: (N, P, 2), m, waypoints; the first `length` ones of each row are valid.
        destination: (N, 2), m, end of the whole path.
        is_partial: (N,) of bool, paths of more waypoints than a row of `path` holds.
        length: (N,) of int; 0 means that the pedestrian stays where it is.
        next: (N,) of int, index of the present waypoint; of an empty path -1 or 0.
        version: (N,) of int, a number of its own for every path; followers share the number of a copied path.
        copied: (N,) of int, version of the leader's path that a follower copied last.
        goals_left: (N,) of int, goals of the scene that are still to be visited; -1 for pedestrians without goals.
        is_assigned: (N,) of bool, the destination is set from outside.
        is_stopping: (N,) of bool, the pedestrian will stand at its destination for a time.
        is_exiting: (N,) of bool, the pedestrian leaves the scene at its destination.
        is_abreast: (N,) of bool, pedestrians with room to walk beside the first member of their group, or without one.
        onward: (N, 2), m, the destination to which the pedestrian goes on from a via point or a stop; else NaN.
        checkpoint: (N, 2), m, position at the last progress check; NaN before the first.
        target: (N, 2), m, the point at which the pedestrian aims: the present waypoint, or one near it.
        is_final: (N,) of bool, whether the target is where the pedestrian will stay.
        is_leaving: (N,) of bool, the pedestrian has reached the place where it leaves the scene.
        is_blocked: (N,) of bool, the pedestrian was pushed off its path and needs another one.
    """

    order: Ints
    walkers: Ints
    leader: Ints
    first: Ints
    path: Floats3
    destination: Floats2
    is_partial: Bools
    length: Ints
    next: Ints
    version: Ints
    copied: Ints
    goals_left: Ints
    is_assigned: Bools
    is_stopping: Bools
    is_exiting: Bools
    is_abreast: Bools
    onward: Floats2
    checkpoint: Floats2
    target: Floats2
    is_final: Bools
    is_leaving: Bools
    is_blocked: Bools


@subroutine
def next_without_destination(
    routes: Routes, first: int, tick: int, humans: Array, is_present: BoolArray, is_walking: BoolArray, solids: Solids
) -> int:
    """Follow the leaders' paths, up to the first pedestrian that needs a destination.

    Args:
        routes: followers copy the paths of their leaders.
        first: item of `Routes.order` to begin with.
        tick: that begins.
        humans: (N, 9), columns of `core.humans`.
        is_present, is_walking: (N,).
        solids: walls and furniture.

    Returns:
        Item of `Routes.order` whose pedestrian needs a destination; the number of items if nobody needs one.
    """
    for n in range(first, routes.walkers[0]):
        k = routes.order[n]
        if not is_present[k]:
            continue
        leader = routes.leader[k]
        if leader != k and not is_present[leader]:
            leader = k  # followers of an absent leader lead themselves
        if leader == k:
            if _needs_destination(routes, k, tick, humans) or _is_stuck(routes, k, tick, humans):
                return n
            if is_on_last_leg(routes, k) and _has_settled(routes, k, humans, is_present, is_walking, solids):
                return n
        elif routes.copied[k] != routes.version[leader] and not routes.is_assigned[k]:
            routes.copied[k] = routes.version[k] = routes.version[leader]
            count = routes.length[leader]
            for w in range(count):
                routes.path[k, w, 0], routes.path[k, w, 1] = routes.path[leader, w, 0], routes.path[leader, w, 1]
            routes.length[k], routes.next[k] = count, min(1, count - 1)
            routes.destination[k, 0] = routes.destination[leader, 0]
            routes.destination[k, 1] = routes.destination[leader, 1]
            routes.is_partial[k] = routes.is_partial[leader]
    return int(routes.walkers[0])


@subroutine
def _needs_destination(routes: Routes, k: int, tick: int, humans: Array) -> bool:
    """Whether a pedestrian has arrived; without a path it tries again every `CHECK_INTERVAL`."""
    if routes.is_assigned[k] or is_on_last_leg(routes, k):
        return False
    count = routes.length[k]
    if count < 2:
        return bool(count == 0 or tick % CHECK_INTERVAL == 0)
    is_last = routes.next[k] == count - 1 and not routes.is_partial[k]
    x, y = routes.destination[k, 0], routes.destination[k, 1]
    return bool(is_last and is_near(humans[k, X], humans[k, Y], x, y, ARRIVAL_DISTANCE))


@subroutine
def _has_settled(
    routes: Routes, k: int, humans: Array, is_present: BoolArray, is_walking: BoolArray, solids: Solids
) -> bool:
    """Whether a pedestrian has arrived at its last goal, an area that grows with those who stand there.

    Its path may lead round those who stand, but not round a wall.
    """
    if routes.is_assigned[k] or routes.is_exiting[k] or routes.length[k] == 0:
        return False
    x, y = routes.destination[k, 0], routes.destination[k, 1]
    if not is_near(humans[k, X], humans[k, Y], x, y, _LARGEST_CLUSTER):
        return False
    standing = 1
    for j in range(len(humans)):
        standing += is_present[j] and not is_walking[j] and is_near(humans[j, X], humans[j, Y], x, y, _LARGEST_CLUSTER)
    radius = max(ARRIVAL_DISTANCE, math.sqrt(standing * _CLUSTER_AREA / PI))
    return is_near(humans[k, X], humans[k, Y], x, y, radius) and not is_crossed(
        solids, humans[k, X], humans[k, Y], x, y
    )


@subroutine
def _is_stuck(routes: Routes, k: int, tick: int, humans: Array) -> bool:
    """Whether a pedestrian made no progress since the last check, `_PROGRESS_INTERVAL` ticks ago.

    Goals of the scene are never given up, but via points and places of stops on the way to them are.
    """
    is_on_way_to_goal = routes.goals_left[k] >= 0 and math.isnan(routes.onward[k, 0])
    if is_on_way_to_goal or routes.is_assigned[k] or (tick + k) % _PROGRESS_INTERVAL != 0:
        return False
    x, y = routes.checkpoint[k, 0], routes.checkpoint[k, 1]
    routes.checkpoint[k, 0], routes.checkpoint[k, 1] = humans[k, X], humans[k, Y]
    return not math.isnan(x) and is_near(humans[k, X], humans[k, Y], x, y, _MINIMUM_PROGRESS)


@subroutine
def advance_on_paths(
    routes: Routes, tick: int, humans: Array, is_present: BoolArray, check_line: Ints, space: Any, passable: Any
) -> bool:
    """Aim at the next waypoint when the present one is reached or the next one is in view; find blocked paths.

    Args:
        routes: updated.
        tick: that begins.
        humans: (N, 9), columns of `core.humans`.
        is_present: (N,).
        check_line: address of the kernel of this name.
        space, passable: packed free space of paths, and of bodies.

    Returns:
        Whether a path is blocked, see `Routes.is_blocked`.
    """
    has_path, any_blocked = False, False
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not is_present[k]:
            continue
        has_path = has_path or routes.length[k] > 0
        step = routes.next[k]
        if routes.is_partial[k] and step == routes.length[k] - 1:
            last_x, last_y = routes.path[k, step, 0], routes.path[k, step, 1]
            if is_near(humans[k, X], humans[k, Y], last_x, last_y, _WAYPOINT_DISTANCE):
                routes.is_blocked[k] = True
        if step < routes.length[k] - 1:
            px, py, x, y = humans[k, X], humans[k, Y], routes.path[k, step, 0], routes.path[k, step, 1]
            if is_near(px, py, x, y, _WAYPOINT_DISTANCE):
                # Behind a corner the way on may be near, but not in view.
                dx, dy = routes.path[k, step + 1, 0] - px, routes.path[k, step + 1, 1] - py
                part = min(1.0, _ROOM_AHEAD / max(math.sqrt(dx * dx + dy * dy), 1e-6))
                is_open = call_for_flag(check_line, (passable, px, py, px + dx * part, py + dy * part))
                if is_open or is_near(px, py, x, y, _REACHED_DISTANCE):
                    routes.next[k] = step + 1
        any_blocked |= routes.is_blocked[k]
    if tick % CHECK_INTERVAL != 0 or not has_path:
        return any_blocked
    _find_room_abreast(routes, humans, is_present, check_line, space)
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not is_present[k] or routes.length[k] == 0:
            continue
        px, py, step = humans[k, X], humans[k, Y], routes.next[k]
        following = min(step + 1, routes.length[k] - 1)
        x, y = routes.path[k, following, 0], routes.path[k, following, 1]
        if call_for_flag(check_line, (space, px, py, x, y)):
            routes.next[k] = following
            continue
        x, y = routes.path[k, step, 0], routes.path[k, step, 1]
        if not call_for_flag(check_line, (passable, px, py, x, y)):
            routes.is_blocked[k] = any_blocked = True
    return any_blocked


@subroutine
def _find_room_abreast(routes: Routes, humans: Array, is_present: BoolArray, check_line: Ints, space: Any) -> None:
    """Find the pedestrians with room to walk beside the first member of their group, in its direction."""
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        first = routes.first[k]
        routes.is_abreast[k] = not is_present[first]
        if first == k or not is_present[k] or not is_present[first]:
            continue
        dx, dy = routes.target[first, 0] - humans[first, X], routes.target[first, 1] - humans[first, Y]
        distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
        scale = min(distance, _ROOM_AHEAD) / distance
        x, y = humans[k, X], humans[k, Y]
        routes.is_abreast[k] = call_for_flag(check_line, (space, x, y, x + dx * scale, y + dy * scale))


@subroutine
def set_targets(routes: Routes, humans: Array, is_present: BoolArray, solids: Solids) -> None:
    """Set the targets, and find the pedestrians that are about to stay or to leave."""
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if is_present[k] and routes.length[k] > 0:
            routes.target[k, 0], routes.target[k, 1] = _point_to_aim_at(routes, k, humans[k, X], humans[k, Y], solids)
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not is_present[k]:
            routes.is_leaving[k] = False
            continue
        leader = routes.leader[k]
        # Followers abreast without a target of their own aim at the leader's target, shifted by their present offset.
        if leader != k and routes.is_abreast[k] and is_present[leader] and not routes.is_assigned[k]:
            for axis in range(2):
                shifted = routes.target[leader, axis] + humans[k, X + axis] - humans[leader, X + axis]
                routes.target[k, axis] = shifted
        stays = routes.is_assigned[k] or routes.is_stopping[k] or is_on_last_leg(routes, k)
        is_last = stays and routes.next[k] == routes.length[k] - 1 and not routes.is_partial[k]
        routes.is_final[k] = routes.length[k] > 0 and is_last and not routes.is_exiting[k]
        routes.is_leaving[k] = (
            # those that leave through doors are found by `advance_tasks`
            routes.is_exiting[k]
            and is_on_last_leg(routes, k)
            and is_last
            and _has_passed(routes, k, humans[k, X], humans[k, Y], solids)
        )


@subroutine
def _point_to_aim_at(routes: Routes, k: int, x: float, y: float, solids: Solids) -> Vector:
    """The present waypoint of pedestrian k at (x, y), m; within `_WAYPOINT_DISTANCE` of it, a point on the next leg.

    The nearer the pedestrian is to the waypoint, the farther along the leg the point lies. So it turns before it
    reaches the waypoint, and does not go back to it if others have pushed it past. A pedestrian that was pushed beside
    a doorway, so that the point is behind a wall, goes back to the waypoint.
    """
    n = routes.next[k]
    to_x, to_y = routes.path[k, n, 0], routes.path[k, n, 1]
    dx, dy = x - to_x, y - to_y
    distance = length(dx, dy)
    if n == routes.length[k] - 1 or distance > _WAYPOINT_DISTANCE:
        return to_x, to_y
    ux, uy = unit_or(routes.path[k, n + 1, 0] - to_x, routes.path[k, n + 1, 1] - to_y, 1e-3, 0.0, 0.0)
    beyond = max(dx * ux + dy * uy + _WAYPOINT_DISTANCE - distance, 0.0)
    aim_x, aim_y = to_x + beyond * ux, to_y + beyond * uy
    if is_crossed(solids, x, y, aim_x, aim_y):
        return to_x, to_y
    return aim_x, aim_y


@subroutine
def _has_passed(routes: Routes, k: int, x: float, y: float, solids: Solids) -> bool:
    """Whether pedestrian k at (x, y) has reached the end of its path, or walked past it."""
    n = routes.length[k] - 1
    end_x, end_y = routes.path[k, n, 0], routes.path[k, n, 1]
    if is_near(x, y, end_x, end_y, EXIT_DISTANCE):
        return True
    before = max(n - 1, 0)  # the end of a path may be a short step to the side, off an obstacle
    while before > 0 and is_near(routes.path[k, before, 0], routes.path[k, before, 1], end_x, end_y, _SHORT_LEG):
        before -= 1
    ux, uy = unit_or(end_x - routes.path[k, before, 0], end_y - routes.path[k, before, 1], 1e-3, 0.0, 0.0)
    dx, dy = x - end_x, y - end_y
    is_past = dx * ux + dy * uy > 0.0 and abs(ux * dy - uy * dx) < _PASSING_DISTANCE
    return is_past and not is_crossed(solids, x, y, end_x, end_y)


@subroutine
def keep_lanes(routes: Routes, walkers: Walkers, check_line: Ints, space: Any) -> None:
    """Let walkers in a stream pass a corner side by side: each one aims as far beside it as others walk on its inside.

    Without this all would aim at the same point, and pass it one behind the other. It applies to walkers within
    `_LANE_RANGE` of the corner.

    Args:
        routes: after `set_targets`; targets are moved.
        walkers: all pedestrians, with the desired directions of the last tick.
        check_line: address of the kernel of this name.
        space: packed free space of paths.
    """
    for k in range(len(walkers.walks)):
        n = routes.next[k]
        follows = routes.leader[k] != k and routes.is_abreast[k]  # beside the leader
        if not walkers.walks[k] or follows or n < 0 or n >= routes.length[k] - 1:
            continue
        x, y = routes.path[k, n, 0], routes.path[k, n, 1]
        if not is_near(walkers.position[k, 0], walkers.position[k, 1], x, y, _LANE_RANGE):
            continue
        ux, uy = unit_or(x - walkers.position[k, 0], y - walkers.position[k, 1], 1e-3, 0.0, 0.0)
        vx, vy = unit_or(routes.path[k, n + 1, 0] - x, routes.path[k, n + 1, 1] - y, 1e-3, 0.0, 0.0)
        turn = ux * vy - uy * vx
        if abs(turn) < _CORNER:
            continue
        shift = min(_LANE * _inside(walkers, k, ux, uy, math.copysign(1.0, turn)), _WIDEST_SHIFT)
        to_x, to_y = unit_or(ux - vx, uy - vy, 1e-3, 0.0, 0.0)  # out of the corner
        for _ in range(3):
            if shift < _NARROWEST_SHIFT:
                break
            if call_for_flag(check_line, (space, x, y, x + to_x * shift, y + to_y * shift)):
                routes.target[k, 0], routes.target[k, 1] = x + to_x * shift, y + to_y * shift
                break
            shift *= 0.5


@subroutine
def _inside(walkers: Walkers, k: int, ux: float, uy: float, side: float) -> float:
    """Number of strangers on one side of pedestrian k, 1 is left and -1 right, that walk in the direction (ux, uy)."""
    total = 0.0
    for n in range(walkers.neighbour_start[k], walkers.neighbour_start[k + 1]):
        j = walkers.neighbour[n]
        if not walkers.walks[j] or are_together(walkers, k, j):
            continue
        if ux * walkers.desired_direction[j, 0] + uy * walkers.desired_direction[j, 1] < _SAME_WAY_COSINE:
            continue
        dx, dy = walkers.position[j, 0] - walkers.position[k, 0], walkers.position[j, 1] - walkers.position[k, 1]
        distance = max(length(dx, dy), 0.01)
        aside = side * (ux * dy - uy * dx) / distance
        total += walkers.attention[n] * max(aside, 0.0) * exp(-distance)
    return total


@subroutine
def stopping_speed(distance: float) -> float:
    """The speed from which a walker stops at a distance, m, if it brakes evenly; m/s."""
    return math.sqrt(2.0 * _ARRIVAL_BRAKING * distance)


@subroutine
def stopping_distance(speed: float) -> float:
    """The distance in which a walker stops from a speed, m/s; m."""
    return speed * speed / (2.0 * _ARRIVAL_BRAKING) + ARRIVAL_DISTANCE


@subroutine
def corner_speed(routes: Routes, k: int, x: float, y: float) -> float:
    """The speed at which pedestrian k at (x, y) can still turn at its next waypoint, m/s."""
    n = routes.next[k]
    if routes.length[k] == 0 or n < 0 or n >= routes.length[k] - 1:
        return math.inf
    ax, ay = routes.path[k, n, 0] - x, routes.path[k, n, 1] - y
    bx, by = routes.path[k, n + 1, 0] - routes.path[k, n, 0], routes.path[k, n + 1, 1] - routes.path[k, n, 1]
    a, b = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
    if a < 1e-3 or b < 1e-3:
        return math.inf
    cosine = (ax * bx + ay * by) / (a * b)
    # a turn by the angle p begins `_WAYPOINT_DISTANCE` before the waypoint, and has the radius of that over tan(p / 2)
    half = math.sqrt(max(1.0 - cosine, 0.0) / max(1.0 + cosine, 1e-6))
    square = _TURNING * _WAYPOINT_DISTANCE / max(half, 1e-6)
    return math.sqrt(square + 2.0 * _BRAKING * max(a - _WAYPOINT_DISTANCE, 0.0))


@subroutine
def point_ahead(routes: Routes, k: int, x: float, y: float, distance: float) -> Vector:
    """The point at a distance ahead of (x, y) on the path of pedestrian k, or the end of the path; m.

    Returns:
        The target of a pedestrian without a path.
    """
    ahead_x, ahead_y = routes.target[k, 0], routes.target[k, 1]
    if routes.leader[k] < 0:
        return ahead_x, ahead_y
    for n in range(max(routes.next[k], 0), routes.length[k]):  # `next` is -1 on an empty path
        dx, dy = routes.path[k, n, 0] - x, routes.path[k, n, 1] - y
        length = math.sqrt(dx * dx + dy * dy)
        if length >= distance:
            return x + dx * (distance / length), y + dy * (distance / length)
        x, y = routes.path[k, n, 0], routes.path[k, n, 1]
        ahead_x, ahead_y, distance = x, y, distance - length
    return ahead_x, ahead_y


@subroutine
def is_on_last_leg(routes: Routes, k: int) -> bool:
    """Whether pedestrian k has no destination beyond the present one."""
    return bool(routes.goals_left[k] == 0 and math.isnan(routes.onward[k, 0]))


@subroutine
def is_near(x: float, y: float, other_x: float, other_y: float, radius: float) -> bool:
    dx, dy = other_x - x, other_y - y
    return dx * dx + dy * dy < radius * radius
