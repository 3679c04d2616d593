"""Decisions of pedestrians: destinations, visits, conversations, pauses, seats, queues, exits.

Positions are never set: pedestrians walk to where they will stand or leave. Each pedestrian draws its own random
numbers. Members of walking groups stay with their group, pause with it, and leave with it.

The kernels take the packed `CrowdState`: they are called rarely, and compiled apart from the tick.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...core.barrier_grid import is_within
from ...core.compiled.calls import (
    call,
    call_for_flag,
    call_for_int,
)
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import unpack
from ...core.compiled.scalar import length
from ...core.free_space import is_clear, is_free
from ...core.philox import uniform, uniform_between
from ...core.portable_math import Array, IntArray
from .crowd_state import COMPANY, PLACES, CrowdState
from .routes import ARRIVAL_DISTANCE, is_near
from .social.company import (
    QUEUEING,
    SITTING,
    STANDING,
    TALKS,
    add_link,
    is_in_the_way,
    is_unattended,
    start_standing,
    start_walking,
    update_links,
)
from .social.f_formations import (
    CENTRE_X,
    CENTRE_Y,
    MAXIMUM_MEMBERS,
    MOST_POSITIONS,
    PAIR_DISTANCE,
    POSITION_X,
    POSITION_Y,
    joining_positions,
    widened,
)
from .social.fixtures import SPOT_SPACING
from .social.tasks import (
    EXIT,
    NO_TASK,
    QUEUE,
    RISING,
    SEATED,
    SIT,
    STAY,
    TALK,
    TURNING,
    VISIT,
)
from .wayfinding import (
    LONGEST_PATH,
    follow_track,
    path_length,
    resting_place,
    set_path,
    start_wandering,
    stop,
    update_obstacles,
    watch_robot,
)

_DETOUR = 1.3  # largest ratio of the lengths of a path with room and of a path without, at which the first is preferred
_PLACE_TOLERANCE = 0.25  # m, from the position of a task
_APPROACH_TIME = 25.0  # s, after which a task whose position was not reached is given up
_MEETING_DISTANCE, _SEPARATION = 2.2, 3.5  # m: within the first, a pair may stop to talk; again after the second
_POSITION_SPACING = 0.7  # m, between the positions of two tasks
_MEMBER_SPACING, _MEMBER_DISTANCE = 0.6, 1.2  # m, in a group that pauses: least between members, most from the leader
_LONG_STAY = 10.0  # s, from which on paths lead round a pedestrian that pauses
_FOREVER = 1e6  # s
_SERVED_TIME = 120.0  # s, for which a pedestrian that was served does not queue again
_LEFT_ALONE_TIME = 2.0  # s, that a pedestrian stays when its partners have left
_STOPPING_DISTANCE = 0.8  # m from the goal, within which a pedestrian that is to stand there has arrived
_MINIMUM_TRIP = 2.0  # m; random destinations nearer than this are rejected
_MEMBER_HALF_WIDTH = 0.4  # m, half the width that each member of a group needs at its destination
_ATTEMPTS = 30
_DOOR_REACH = 0.12  # m, beyond the place before a door, in which a pedestrian disappears
_TURN_TIME = 1.6  # s, in which a pedestrian turns its back to the seat
_STANDS_AGAIN = 0.12  # m, from the place beside the seat
_REACTION_LOW, _REACTION_HIGH = 0.3, 0.9  # s, after which a pedestrian follows when the place ahead is free
_AT_HEAD = 0.3  # m, from the first place of a queue, within which the first pedestrian is served
_ROOM_AT_HEAD = 0.6  # m, from the first place, at which the one that was served makes room for the next
_KINDS = np.array([VISIT, TALK, SIT, QUEUE, EXIT])  # in the order in which they are drawn
_AHEAD = 3.0  # m, distance of the point that a standing pedestrian faces


@subroutine
def _x(crowd: CrowdState, k: int) -> float:
    return float(crowd.walkers.position[k, 0])


@subroutine
def _y(crowd: CrowdState, k: int) -> float:
    return float(crowd.walkers.position[k, 1])


@subroutine
def _ticks(crowd: CrowdState, seconds: float) -> int:
    return int(seconds / crowd.obstacles.dt)


@subroutine
def _is_open(crowd: CrowdState, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a pedestrian can stand at the end, and walk there straight from (x, y); m."""
    return bool(call_for_flag(crowd.calls.check_place, (crowd.obstacles.for_places, x, y, end_x, end_y)))


@subroutine
def _path_in(
    crowd: CrowdState, space: Any, graph: Any, x: float, y: float, end_x: float, end_y: float, route: Array
) -> int:
    """Number of points of the shortest path in a packed space, which is written into the route, (R, 2), m."""
    size = np.empty(1)
    return int(call_for_int(crowd.calls.find_path, (space, graph, x, y, end_x, end_y, route, size)))


@kernel
def plan_path(packed_state: Any, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """The path to a destination with room for the shoulders, or a shorter one on which they must turn.

    Args:
        packed_state: packed `CrowdState`.
        x, y, end_x, end_y: start and destination, m.
        route: (R, 2), output: points of the path, m.

    Returns:
        Number of points; 0 if there is no path.
    """
    crowd = unpack(packed_state, CrowdState)
    count = _path_in(crowd, crowd.obstacles.for_space, crowd.obstacles.for_space_graph, x, y, end_x, end_y, route)
    size = path_length(route, count)
    if count > 0 and size <= _DETOUR * length(end_x - x, end_y - y):
        return count  # no other one is much shorter
    tight = np.empty((len(route), 2))
    other = _path_in(crowd, crowd.obstacles.for_tight, crowd.obstacles.for_tight_graph, x, y, end_x, end_y, tight)
    if other == 0 or (count > 0 and size <= _DETOUR * path_length(tight, other)):
        return count
    for n in range(other):
        route[n, 0], route[n, 1] = tight[n, 0], tight[n, 1]
    return other


@subroutine
def _plan(crowd: CrowdState, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """`plan_path`."""
    return int(call_for_int(crowd.calls.plan_path, (crowd, x, y, end_x, end_y, route)))


@kernel
def send(packed_state: Any, k: int, x: float, y: float) -> bool:
    """Send pedestrian k to a destination, m, where it stays; False if there is no path."""
    crowd = unpack(packed_state, CrowdState)
    journeys, routes = crowd.journeys, crowd.routes
    route = np.empty((LONGEST_PATH, 2))
    count = _plan(crowd, _x(crowd, k), _y(crowd, k), x, y, route)
    if count == 0:
        return False
    set_path(routes, journeys, k, route, count, 1)
    routes.is_assigned[k], routes.is_stopping[k] = True, False
    journeys.spot[k, 0] = journeys.spot[k, 1] = math.nan
    return True


@subroutine
def _send(crowd: CrowdState, k: int, x: float, y: float) -> bool:
    """`send`."""
    return bool(call_for_flag(crowd.calls.send, (crowd, k, x, y)))


@kernel
def stand(
    packed_state: Any, k: int, x: float, y: float, facing_x: float, facing_y: float, posture: int, is_brief: bool
) -> None:
    """`start_standing` in a packed `CrowdState`."""
    crowd = unpack(packed_state, CrowdState)
    start_standing(crowd.company, k, x, y, facing_x, facing_y, posture, is_brief, crowd.is_present)


@subroutine
def _stand(
    crowd: CrowdState, k: int, x: float, y: float, facing_x: float, facing_y: float, posture: int,
    is_brief: bool,
) -> None:  # fmt: skip
    """`stand`."""
    call(crowd.calls.stand, (crowd, k, x, y, facing_x, facing_y, posture, is_brief))


@subroutine
def _set_task(
    crowd: CrowdState, k: int, kind: int, x: float, y: float, facing_x: float, facing_y: float, target: int, until: int,
    has_arrived: bool,
) -> None:  # fmt: skip
    tasks = crowd.tasks
    tasks.kind[k], tasks.target[k], tasks.until[k], tasks.has_arrived[k] = kind, target, until, has_arrived
    tasks.position[k, 0], tasks.position[k, 1] = x, y
    tasks.facing[k, 0], tasks.facing[k, 1] = facing_x, facing_y


@subroutine
def _draw_end(crowd: CrowdState, k: int, kind: int, tick: int) -> int:
    """The tick until which pedestrian k stays at a visit, a conversation or on a seat."""
    h = crowd.habits
    low, high = h.visit_low, h.visit_high
    if kind == TALK:
        low, high = h.talk_low, h.talk_high
    elif kind == SIT:
        low, high = h.sit_low, h.sit_high
    return tick + _ticks(crowd, uniform_between(crowd.draws, k, COMPANY, low, high))


# The beginning


@kernel
def begin(packed_state: Any, seats: IntArray, queues: IntArray) -> None:
    """Begin the tasks of pedestrians that interact, sit or stand in a queue at the start.

    Args:
        packed_state: packed `CrowdState`.
        seats, queues: (N,) of int, row of each pedestrian's seat and queue in `Fixtures`; -1 for none.
    """
    crowd = unpack(packed_state, CrowdState)
    company, fixtures = crowd.company, crowd.fixtures
    for k in range(len(seats)):
        has_interaction = company.has_object[k] or company.partner_count[k] > 0
        # Pedestrians with a limited presence draw nothing: they arrive and leave by their own schedule.
        is_free_to_go = not company.is_walking[k] and has_interaction and company.is_always_present[k]
        if crowd.habits.is_lively and is_free_to_go and uniform(crowd.draws, k, COMPANY) < crowd.habits.leaves:
            kind = VISIT if company.has_object[k] else TALK
            x, y = company.standing_position[k, 0], company.standing_position[k, 1]
            _set_task(crowd, k, kind, x, y, x, y, -1, _draw_end(crowd, k, kind, 0), True)
    for k in range(len(seats)):
        if seats[k] >= 0:
            stop(crowd.routes, crowd.journeys, k)
            # It has been sitting for a while: a random part of its time is over.
            until = int(_draw_end(crowd, k, SIT, 0) * uniform(crowd.draws, k, COMPANY))
            seat = fixtures.seat[seats[k]]
            has_place, x, y = _place_beside(crowd, seats[k])
            if not has_place:
                x, y = seat[4], seat[5]
            _set_task(crowd, k, SIT, x, y, seat[0], seat[1], seats[k], until, True)
            crowd.tasks.phase[k] = SEATED
            _sit_down(crowd, k)
    for q in range(len(crowd.lines.size)):
        x, y = fixtures.slot[q, 0, 0], fixtures.slot[q, 0, 1]
        while True:  # the nearest one first
            nearest, least = -1, math.inf
            for k in range(len(queues)):
                distance = length(_x(crowd, k) - x, _y(crowd, k) - y)
                if queues[k] == q and crowd.tasks.kind[k] != QUEUE and distance < least:
                    nearest, least = k, distance
            if nearest < 0:
                break
            stop(crowd.routes, crowd.journeys, nearest)
            _set_task(crowd, nearest, QUEUE, x, y, x, y, q, 0, True)
            _join_line(crowd, q, nearest)


# In every tick


@kernel
def advance_tasks(packed_state: Any, tick: int, robot: Array) -> None:
    """Advance all tasks by one tick: arrivals, ends, meetings; and the obstacles that result.

    Args:
        packed_state: packed `CrowdState`, updated.
        tick: that begins.
        robot: columns of `core.state`.
    """
    crowd = unpack(packed_state, CrowdState)
    journeys, tasks = crowd.journeys, crowd.tasks
    if watch_robot(crowd.obstacles, robot):
        tasks.is_changed[0] = True
    for k in range(len(tasks.kind)):
        tasks.is_leaving[k] = False
        if tasks.kind[k] != NO_TASK:
            _advance_task(crowd, k, tick)
    for q in range(len(crowd.lines.size)):
        served = _advance_line(crowd, q, tick)
        if served >= 0:
            tasks.may_queue_from[served] = tick + _ticks(crowd, _SERVED_TIME)
            call(crowd.calls.leave, (crowd, served, tick))
    if crowd.habits.meets > 0.0:
        _start_meetings(crowd, tick)
    if tasks.is_changed[0]:
        tasks.is_changed[0] = False
        update_obstacles(crowd.obstacles, crowd.company, crowd.is_present)
    for k in range(len(tasks.kind)):
        if journeys.track_start[k + 1] > journeys.track_start[k]:
            follow_track(journeys, crowd.routes, k, tick)
    if tick == 0:
        call(crowd.calls.start_straight, (crowd,))


@kernel
def update_partners(packed_state: Any) -> None:
    """Exclude absent pedestrians from partners, when other ones are present."""
    crowd = unpack(packed_state, CrowdState)
    update_links(crowd.company, crowd.is_present)


@subroutine
def _advance_task(crowd: CrowdState, k: int, tick: int) -> None:
    """End the task of pedestrian k if it is over or has become impossible; start its activity on arrival."""
    tasks = crowd.tasks
    kind = tasks.kind[k]
    if kind == EXIT:
        _advance_exit(crowd, k)
    elif tasks.has_arrived[k]:
        if kind == SIT:
            _advance_seat(crowd, k, tick)
        elif kind != QUEUE and tick >= tasks.until[k]:  # of a queue, see `_advance_line`
            call(crowd.calls.leave, (crowd, k, tick))
    else:
        partner_left = kind == TALK and tasks.target[k] >= 0 and crowd.company.is_walking[tasks.target[k]]
        if partner_left or tick >= tasks.until[k] or not _follow_tail(crowd, k):
            call(crowd.calls.leave, (crowd, k, tick))
        elif length(_x(crowd, k) - tasks.position[k, 0], _y(crowd, k) - tasks.position[k, 1]) < _PLACE_TOLERANCE:
            _arrive(crowd, k, tick)


@kernel
def leave(packed_state: Any, k: int, tick: int) -> None:
    """Pedestrian k goes on; newcomers to a conversation that are left alone by this leave soon after."""
    crowd = unpack(packed_state, CrowdState)
    company, tasks = crowd.company, crowd.tasks
    kind = tasks.kind[k]
    partners = company.partners[k, : company.partner_count[k]].copy()
    tasks.kind[k] = NO_TASK
    if kind != STAY:
        tasks.last[k], tasks.has_walked[k] = kind, False
    tasks.sits_on[k] = -1
    if not company.is_walking[k]:
        if is_in_the_way(company, k, crowd.is_present):
            tasks.is_changed[0] = True
        start_walking(company, k, crowd.is_present)
    start_wandering(crowd.routes, crowd.journeys, k, _x(crowd, k), _y(crowd, k))
    for n in range(len(partners) if kind == TALK else 0):
        other = partners[n]
        if tasks.kind[other] != NO_TASK and company.partner_count[other] == 0:
            tasks.until[other] = min(tasks.until[other], tick + _ticks(crowd, _LEFT_ALONE_TIME))


@subroutine
def _arrive(crowd: CrowdState, k: int, tick: int) -> None:
    """Pedestrian k has reached the position of its task: its activity begins."""
    company, tasks = crowd.company, crowd.tasks
    kind, target = tasks.kind[k], tasks.target[k]
    x, y = tasks.position[k, 0], tasks.position[k, 1]
    facing_x, facing_y = tasks.facing[k, 0], tasks.facing[k, 1]
    if kind == STAY:
        _pause(crowd, k, x, y, tasks.until[k], tick)
        return
    stop(crowd.routes, crowd.journeys, k)
    tasks.has_arrived[k] = True
    if kind == SIT:
        _stand_at_seat(crowd, k, x, y, STANDING)
        tasks.phase[k], tasks.until[k] = TURNING, tick + _ticks(crowd, _TURN_TIME)
        return
    tasks.is_changed[0] = True
    if kind == QUEUE:
        _join_line(crowd, target, k)
        return
    if kind == VISIT:
        piece = crowd.fixtures.thing_piece[target]
        add_link(company, k, len(tasks.kind) + piece, crowd.fixtures.thing_relation[target])
    else:
        members, size = _members_of(crowd, target)
        for n in range(1, size):  # by index
            m = n
            while m > 0 and members[m - 1] > members[m]:
                members[m - 1], members[m] = members[m], members[m - 1]
                m -= 1
        for n in range(size):
            add_link(company, members[n], k, TALKS)
            # Members move outwards to the radius of the larger formation, as far as there is room.
            place = company.standing_position[members[n]]
            to_x, to_y = widened(place[0], place[1], facing_x, facing_y, size + 1)
            if _is_open(crowd, facing_x, facing_y, to_x, to_y):
                place[0], place[1] = to_x, to_y
    _stand(crowd, k, x, y, facing_x, facing_y, STANDING, False)
    call(crowd.calls.update_partners, (crowd,))
    tasks.until[k] = _draw_end(crowd, k, kind, tick)


@subroutine
def _members_of(crowd: CrowdState, k: int) -> tuple[IntArray, int]:
    """Pedestrian k and its partners, and their number."""
    company = crowd.company
    members, size = np.empty(1 + company.partners.shape[1], dtype=np.int64), 1 + company.partner_count[k]
    members[0] = k
    for n in range(size - 1):
        members[n + 1] = company.partners[k, n]
    return members, size


# Pauses


@kernel
def start_stay(packed_state: Any, k: int, x: float, y: float, duration: float, tick: int) -> None:
    """Pedestrian k, which has arrived, stands at a place, m, for a time, s, and its followers beside it."""
    crowd = unpack(packed_state, CrowdState)
    until = tick + _ticks(crowd, min(duration, _FOREVER))
    _pause(crowd, k, x, y, until, tick)
    taken, count = np.empty((len(crowd.tasks.kind) + 1, 2)), 1
    taken[0, 0], taken[0, 1] = x, y
    for follower in range(len(crowd.tasks.kind)):
        if follower == k or crowd.routes.leader[follower] != k or not crowd.is_present[follower]:
            continue
        spot_x, spot_y = _spot_beside(crowd, follower, k, x, y, taken[:count])
        taken[count, 0], taken[count, 1], count = spot_x, spot_y, count + 1
        vx, vy = crowd.walkers.velocity[follower, 0], crowd.walkers.velocity[follower, 1]
        rest_x, rest_y = resting_place(crowd.obstacles.space, _x(crowd, follower), _y(crowd, follower), vx, vy)
        near = length(rest_x - spot_x, rest_y - spot_y) < _PLACE_TOLERANCE
        if (near and length(rest_x - x, rest_y - y) < _MEMBER_DISTANCE) or not _send(crowd, follower, spot_x, spot_y):
            _pause(crowd, follower, rest_x, rest_y, until, tick)
        else:
            _set_task(crowd, follower, STAY, spot_x, spot_y, x, y, -1, until, False)
        crowd.journeys.spot[follower, 0], crowd.journeys.spot[follower, 1] = spot_x, spot_y


@subroutine
def _pause(crowd: CrowdState, k: int, x: float, y: float, until: int, tick: int) -> None:
    """Pedestrian k stands at a place, m, until a tick.

    It faces where its feet point; at its last goal, if others stand there and it is not behind, it faces that goal.
    """
    routes = crowd.routes
    dx, dy = crowd.walkers.body_direction[k, 0], crowd.walkers.body_direction[k, 1]
    facing_x, facing_y = x + _AHEAD * dx, y + _AHEAD * dy
    if routes.length[k] > 0 and routes.goals_left[k] == 0:
        to_x, to_y = routes.destination[k, 0] - x, routes.destination[k, 1] - y
        distance = length(to_x, to_y)
        if distance > ARRIVAL_DISTANCE and to_x * dx + to_y * dy > -0.5 * distance:
            facing_x, facing_y = x + to_x, y + to_y
    is_brief = (until - tick) * crowd.obstacles.dt < _LONG_STAY
    stop(routes, crowd.journeys, k)
    _stand(crowd, k, x, y, facing_x, facing_y, STANDING, is_brief)
    _set_task(crowd, k, STAY, x, y, facing_x, facing_y, -1, until, True)
    if not is_brief:
        crowd.tasks.is_changed[0] = True


@subroutine
def _spot_beside(crowd: CrowdState, k: int, leader: int, x: float, y: float, taken: Array) -> tuple[float, float]:
    """Where a follower stands beside its leader, m: on its present side of it, or opposite, or where it is."""
    side = crowd.obstacles.side
    dx, dy = _x(crowd, k) - _x(crowd, leader), _y(crowd, k) - _y(crowd, leader)
    gap = max(length(dx, dy), 1e-6)
    scale, side = min(max(gap, _POSITION_SPACING), _MEMBER_DISTANCE) / gap, side
    for turn in range(4):  # by the side of the rules, so that a mirrored scene gives the mirrored place
        ux, uy = dx, dy
        if turn == 1:
            ux, uy = dy * side, -dx * side
        elif turn == 2:
            ux, uy = -dy * side, dx * side
        elif turn == 3:
            ux, uy = -dx, -dy
        spot_x, spot_y, has_room = x + ux * scale, y + uy * scale, True
        for n in range(len(taken)):
            has_room = has_room and length(spot_x - taken[n, 0], spot_y - taken[n, 1]) > _MEMBER_SPACING
        if has_room and _is_open(crowd, x, y, spot_x, spot_y):
            return spot_x, spot_y
    return _x(crowd, k), _y(crowd, k)


# Doors


@subroutine
def _in_door(crowd: CrowdState, d: int, x: float, y: float) -> tuple[float, float]:
    """A point relative to a door: into the room, and to the left; m."""
    door = crowd.fixtures.door[d]
    dx, dy = x - door[0], y - door[1]
    return dx * door[2] + dy * door[3], dy * door[2] - dx * door[3]


@subroutine
def _advance_exit(crowd: CrowdState, k: int) -> None:
    """Let pedestrian k leave if it has reached its door; those that follow it then go there by themselves."""
    routes, tasks = crowd.routes, crowd.tasks
    d = tasks.target[k]
    if not crowd.is_present[k]:
        tasks.kind[k] = NO_TASK
        return
    ahead, left = _in_door(crowd, d, _x(crowd, k), _y(crowd, k))
    if not (ahead < crowd.habits.door_depth + _DOOR_REACH and abs(left) < crowd.fixtures.door[d, 4] / 2):
        return
    tasks.is_leaving[k], tasks.kind[k] = True, NO_TASK
    for follower in range(len(tasks.kind)):
        if follower != k and routes.leader[follower] == k:
            routes.leader[follower] = routes.first[follower] = follower
            if tasks.kind[follower] != NO_TASK:
                _send(crowd, follower, tasks.position[follower, 0], tasks.position[follower, 1])


@subroutine
def _start_exit(crowd: CrowdState, k: int) -> bool:
    """Send pedestrian k and its followers to a door, chosen by share; False if they can reach no door.

    The door is not the one through which the pedestrian came, if there is another one.
    """
    fixtures = crowd.fixtures
    others = 0
    for d in range(len(fixtures.door)):
        others += 1 - fixtures.came_through[d, k]
    weights = np.zeros(len(fixtures.door))
    for d in range(len(fixtures.door)):
        if others == 0 or fixtures.came_through[d, k] == 0:
            weights[d] = fixtures.door[d, 6]
    d = _choose(crowd, k, COMPANY, weights)
    if d < 0:
        return False
    door, depth = fixtures.door[d], crowd.habits.door_depth
    _, left = _in_door(crowd, d, _x(crowd, k), _y(crowd, k))
    left = min(max(left, -door[5]), door[5])
    x, y = door[0] + depth * door[2] - left * door[3], door[1] + depth * door[3] + left * door[2]
    if not _send(crowd, k, x, y):
        return False
    for member in range(len(crowd.tasks.kind)):
        if (member == k or crowd.routes.leader[member] == k) and crowd.is_present[member]:
            _set_task(crowd, member, EXIT, x, y, door[0], door[1], d, 0, False)
            crowd.routes.is_exiting[member] = True
    return True


@subroutine
def _choose(crowd: CrowdState, k: int, purpose: int, weights: Array) -> int:
    """An index, with probabilities proportional to weights; -1 if there is none, and then nothing is drawn."""
    total, last = 0.0, -1
    for n in range(len(weights)):
        total += weights[n]
        if weights[n] > 0.0:
            last = n
    if last < 0:
        return -1
    remainder = uniform_between(crowd.draws, k, purpose, 0.0, total)
    for n in range(len(weights)):
        remainder -= weights[n]
        if remainder < 0.0:
            return n
    return last  # rounding can leave a remainder of zero


# Seats


@subroutine
def _place_beside(crowd: CrowdState, s: int) -> tuple[bool, float, float]:
    """Whether a place beside a seat is free, and the first one, m."""
    seat = crowd.fixtures.seat[s]
    for n in range(3):
        x, y = seat[4 + 2 * n], seat[5 + 2 * n]
        if _is_open(crowd, x, y, x, y):
            return True, x, y
    return False, 0.0, 0.0


@subroutine
def _stand_at_seat(crowd: CrowdState, k: int, x: float, y: float, posture: int) -> None:
    """Pedestrian k stands or sits at a place, m, and faces the direction of its seat."""
    seat = crowd.fixtures.seat[crowd.tasks.target[k]]
    _stand(crowd, k, x, y, x + _AHEAD * seat[2], y + _AHEAD * seat[3], posture, False)


@subroutine
def _sit_down(crowd: CrowdState, k: int) -> None:
    fixtures = crowd.fixtures
    s = crowd.tasks.target[k]
    _stand_at_seat(crowd, k, fixtures.seat[s, 0], fixtures.seat[s, 1], SITTING)
    crowd.tasks.sits_on[k] = fixtures.seat_piece[s]


@subroutine
def _advance_seat(crowd: CrowdState, k: int, tick: int) -> None:
    """Turn the back to the seat, sit, get up to the place beside it, and leave."""
    tasks = crowd.tasks
    if tasks.phase[k] == TURNING:
        if tick >= tasks.until[k]:
            tasks.phase[k] = SEATED
            _sit_down(crowd, k)
            tasks.until[k] = _draw_end(crowd, k, SIT, tick)
    elif tasks.phase[k] == SEATED:
        if tick >= tasks.until[k]:
            has_place, x, y = _place_beside(crowd, tasks.target[k])
            if has_place:  # else it waits until there is room to stand
                tasks.position[k, 0], tasks.position[k, 1], tasks.phase[k] = x, y, RISING
                _stand_at_seat(crowd, k, x, y, SITTING)
    elif length(_x(crowd, k) - tasks.position[k, 0], _y(crowd, k) - tasks.position[k, 1]) < _STANDS_AGAIN:
        call(crowd.calls.leave, (crowd, k, tick))


# Queues


@subroutine
def _tail(crowd: CrowdState, q: int) -> int:
    """The first slot behind the last pedestrian in a queue."""
    size = crowd.lines.size[q]
    return int(crowd.lines.slot[q, size - 1]) + 1 if size > 0 else 0


@subroutine
def _slot_place(crowd: CrowdState, q: int, number: int) -> tuple[float, float]:
    """Where a pedestrian stands in a slot of a queue, m; beyond the last one, at the same spacing."""
    slot = crowd.fixtures.slot[q]
    last = len(slot) - 1
    if number <= last or last == 0:
        return slot[min(number, last), 0], slot[min(number, last), 1]
    beyond = number - last
    dx, dy = slot[last, 0] - slot[last - 1, 0], slot[last, 1] - slot[last - 1, 1]
    return slot[last, 0] + beyond * dx, slot[last, 1] + beyond * dy


@subroutine
def _stand_in_line(crowd: CrowdState, q: int, k: int, number: int) -> None:
    x, y = _slot_place(crowd, q, number)
    ux, uy = crowd.fixtures.queue[q, 0], crowd.fixtures.queue[q, 1]
    _stand(crowd, k, x, y, x + _AHEAD * ux, y + _AHEAD * uy, QUEUEING, False)


@subroutine
def _join_line(crowd: CrowdState, q: int, k: int) -> None:
    """Pedestrian k takes the first slot behind the last one."""
    lines = crowd.lines
    size = lines.size[q]
    lines.slot[q, size], lines.member[q, size], lines.move_at[q, size] = _tail(crowd, q), k, -1
    lines.size[q] += 1
    _stand_in_line(crowd, q, k, lines.slot[q, size])


@subroutine
def _advance_line(crowd: CrowdState, q: int, tick: int) -> int:
    """Let the pedestrians in a queue move up; the one that leaves it because it was served, or -1."""
    fixtures, lines = crowd.fixtures, crowd.lines
    ahead = -1  # slot of the member in front
    head_x, head_y = fixtures.slot[q, 0, 0], fixtures.slot[q, 0, 1]
    for n in range(lines.size[q]):
        k, slot = lines.member[q, n], lines.slot[q, n]
        if slot - 1 > ahead and (slot > 1 or _has_room_at_head(crowd, q)):
            if lines.move_at[q, n] < 0:
                reaction = uniform_between(crowd.draws, k, COMPANY, _REACTION_LOW, _REACTION_HIGH)
                lines.move_at[q, n] = tick + _ticks(crowd, reaction)
            elif tick >= lines.move_at[q, n]:
                lines.slot[q, n], lines.move_at[q, n], crowd.tasks.is_changed[0] = slot - 1, -1, True
                _stand_in_line(crowd, q, k, slot - 1)
        ahead = lines.slot[q, n]
    if lines.size[q] == 0 or lines.slot[q, 0] > 0:
        return -1
    first = lines.member[q, 0]
    if lines.served_at[q] < 0:
        if length(_x(crowd, first) - head_x, _y(crowd, first) - head_y) < _AT_HEAD:
            low, high = fixtures.queue[q, 2], fixtures.queue[q, 3]
            lines.served_at[q] = tick + _ticks(crowd, uniform_between(crowd.draws, first, COMPANY, low, high))
        return -1
    if tick < lines.served_at[q]:
        return -1
    lines.served_at[q], lines.last_served[q] = -1, first
    lines.size[q] -= 1
    for n in range(lines.size[q]):
        lines.member[q, n], lines.slot[q, n] = lines.member[q, n + 1], lines.slot[q, n + 1]
        lines.move_at[q, n] = lines.move_at[q, n + 1]
    return int(first)


@subroutine
def _has_room_at_head(crowd: CrowdState, q: int) -> bool:
    """Whether the pedestrian that was served last has left the head of a queue."""
    lines = crowd.lines
    k, slot = lines.last_served[q], crowd.fixtures.slot[q, 0]
    if k >= 0 and length(_x(crowd, k) - slot[0], _y(crowd, k) - slot[1]) > _ROOM_AT_HEAD:
        lines.last_served[q] = -1
    return bool(lines.last_served[q] < 0)


@subroutine
def _follow_tail(crowd: CrowdState, k: int) -> bool:
    """Send pedestrian k to the end of its queue if that has moved; False if it cannot join any more."""
    tasks = crowd.tasks
    q = tasks.target[k]
    if tasks.kind[k] != QUEUE:
        return True
    tail = _tail(crowd, q)
    if tail >= crowd.fixtures.capacity[q]:
        return False
    x, y = _slot_place(crowd, q, tail)
    if x == tasks.position[k, 0] and y == tasks.position[k, 1]:
        return True
    tasks.position[k, 0], tasks.position[k, 1] = x, y
    return _send(crowd, k, x, y)


# Choices


@kernel
def choose_destination(packed_state: Any, k: int, tick: int) -> None:
    """Give pedestrian k its next destination and the path to it; without a path it stays."""
    crowd = unpack(packed_state, CrowdState)
    habits, journeys, routes = crowd.habits, crowd.journeys, crowd.routes
    x, y = _x(crowd, k), _y(crowd, k)
    if routes.is_stopping[k]:
        routes.is_stopping[k] = False
        # A pedestrian without progress is somewhere else on its path.
        if is_near(x, y, routes.destination[k, 0], routes.destination[k, 1], _STOPPING_DISTANCE):
            _stay_here(crowd, k, journeys.stay[k], tick)
            return
    if routes.goals_left[k] == 0:
        _stay_here(crowd, k, math.inf, tick)
        return
    route = np.empty((LONGEST_PATH, 2))
    if routes.goals_left[k] > 0:
        # Goals of the scene are always approached, straight if there is no free path.
        goal_x, goal_y = _pop_goal(crowd, k)
        count = _plan(crowd, x, y, goal_x, goal_y, route)
        if count == 0:  # through a gap that is hardly wider than the body, or between people who talk
            count = _path_in(
                crowd, crowd.obstacles.for_passable, crowd.obstacles.for_passable_graph, x, y, goal_x, goal_y, route
            )
        if count == 0:
            route[0, 0], route[0, 1], route[1, 0], route[1, 1], count = x, y, goal_x, goal_y, 2
        set_path(routes, journeys, k, route, count, 1)
        return
    if habits.is_lively and _choose_task(crowd, k, tick):
        return
    followers = 0
    for other in range(len(routes.leader)):
        followers += routes.leader[other] == k
    half_width = _MEMBER_HALF_WIDTH * max(followers, 1)
    for attempt in range(_ATTEMPTS):
        # The first half of the attempts looks for an untaken place of interest with room for all members.
        is_choosy = attempt < _ATTEMPTS // 2
        place = _choose_place(crowd, k) if is_choosy else -1
        goal_x, goal_y = _draw_goal(crowd, k, place)
        if place < 0 and is_near(x, y, goal_x, goal_y, _MINIMUM_TRIP):
            continue
        if not is_free(crowd.obstacles.space, goal_x, goal_y) or (is_choosy and _is_taken(crowd, k, goal_x, goal_y)):
            continue
        # A choosy leader goes where the group can walk abreast as it stands, and where all members have room.
        if is_choosy and followers > 1 and _is_in_file(crowd, k, goal_x - x, goal_y - y):
            continue
        if is_choosy and followers > 1 and is_within(crowd.obstacles.solids, goal_x, goal_y, half_width):
            continue
        count = _plan(crowd, x, y, goal_x, goal_y, route)
        if count == 0:
            continue
        set_path(routes, journeys, k, route, count, 1)
        low, high = habits.pause_low, habits.pause_high
        if place >= 0:
            low, high = crowd.fixtures.place[place, 4], crowd.fixtures.place[place, 5]
        journeys.place[k] = place
        duration = uniform_between(crowd.draws, k, PLACES, low, high) if high > 0.0 else 0.0
        _plan_stay(crowd, k, duration, goal_x, goal_y)
        return
    route[0, 0], route[0, 1] = x, y
    set_path(routes, journeys, k, route, 1, 0)


@kernel
def find_new_paths(packed_state: Any) -> None:
    """Find new paths to the same destinations for pedestrians that were pushed off their paths."""
    crowd = unpack(packed_state, CrowdState)
    routes = crowd.routes
    route = np.empty((LONGEST_PATH, 2))
    for k in range(len(routes.is_blocked)):
        if routes.is_blocked[k]:
            routes.is_blocked[k] = False
            to_x, to_y = routes.destination[k, 0], routes.destination[k, 1]
            count = _plan(crowd, _x(crowd, k), _y(crowd, k), to_x, to_y, route)
            if count > 0:
                set_path(routes, crowd.journeys, k, route, count, 1)


@kernel
def start_straight(packed_state: Any) -> None:
    """Send pedestrians that see their first goal straight there, in the first tick."""
    crowd = unpack(packed_state, CrowdState)
    journeys, routes = crowd.journeys, crowd.routes
    here = np.empty((2, 2))
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not crowd.is_present[k] or routes.goals_left[k] <= 0:
            continue
        x, y, first = _x(crowd, k), _y(crowd, k), journeys.goal_start[k + 1] - routes.goals_left[k]
        goal_x, goal_y = journeys.goal[first, 0], journeys.goal[first, 1]
        if is_clear(crowd.obstacles.space, x, y, goal_x, goal_y) or (
            not is_free(crowd.obstacles.space, x, y) and is_clear(crowd.obstacles.passable, x, y, goal_x, goal_y)
        ):
            _pop_goal(crowd, k)
            here[0, 0], here[0, 1], here[1, 0], here[1, 1] = x, y, goal_x, goal_y
            set_path(routes, journeys, k, here, 2, 1)


@subroutine
def _pop_goal(crowd: CrowdState, k: int) -> tuple[float, float]:
    """The next goal of pedestrian k, m."""
    journeys = crowd.journeys
    n = journeys.goal_start[k + 1] - crowd.routes.goals_left[k]
    _plan_stay(crowd, k, journeys.goal_stay[n], journeys.goal[n, 0], journeys.goal[n, 1])
    crowd.routes.goals_left[k] -= 1
    return journeys.goal[n, 0], journeys.goal[n, 1]


@subroutine
def _plan_stay(crowd: CrowdState, k: int, duration: float, x: float, y: float) -> None:
    """Let pedestrian k stand at its destination, m, for a time, s."""
    journeys = crowd.journeys
    journeys.stay[k], crowd.routes.is_stopping[k] = duration, duration > 0.0
    journeys.spot[k, 0] = x if duration > 0.0 else math.nan
    journeys.spot[k, 1] = y if duration > 0.0 else math.nan


@subroutine
def _stay_here(crowd: CrowdState, k: int, duration: float, tick: int) -> None:
    """Let pedestrian k stand where it comes to rest: near its destination, not exactly there."""
    vx, vy = crowd.walkers.velocity[k, 0], crowd.walkers.velocity[k, 1]
    x, y = resting_place(crowd.obstacles.space, _x(crowd, k), _y(crowd, k), vx, vy)
    crowd.journeys.spot[k, 0], crowd.journeys.spot[k, 1] = x, y
    call(crowd.calls.start_stay, (crowd, k, x, y, duration, tick))


@subroutine
def _is_in_file(crowd: CrowdState, k: int, ahead: float, left: float) -> bool:
    """Whether a follower of pedestrian k is more ahead or behind than beside it on the way along (ahead, left)."""
    for other in range(len(crowd.routes.leader)):
        if other != k and crowd.routes.leader[other] == k:
            x, y = _x(crowd, other) - _x(crowd, k), _y(crowd, other) - _y(crowd, k)
            if abs(x * ahead + y * left) > abs(x * left - y * ahead):
                return True
    return False


@subroutine
def _choose_place(crowd: CrowdState, k: int) -> int:
    """A place of interest, by weight, other than the present one; -1 if the scene has no places."""
    place = crowd.fixtures.place
    weights = np.zeros(len(place))
    for n in range(len(place)):
        if n != crowd.journeys.place[k] or len(place) == 1:
            weights[n] = place[n, 3]
    return _choose(crowd, k, PLACES, weights)


@subroutine
def _draw_goal(crowd: CrowdState, k: int, place: int) -> tuple[float, float]:
    """A random point in a place of interest, or in the bounding box of the room; m."""
    draws = crowd.draws
    box = crowd.fixtures.box
    if place < 0:
        x = uniform_between(draws, k, PLACES, box[0], box[2])
        return x, uniform_between(draws, k, PLACES, box[1], box[3])
    x = y = 1.0
    while x * x + y * y > 1.0:
        x = uniform_between(draws, k, PLACES, -1.0, 1.0)
        y = uniform_between(draws, k, PLACES, -1.0, 1.0)
    row = crowd.fixtures.place[place]
    return row[0] + row[2] * x, row[1] + row[2] * y


@subroutine
def _is_taken(crowd: CrowdState, k: int, x: float, y: float) -> bool:
    """Whether pedestrian k would stand where another one stands for a time, or will, or in front of a door."""
    spot, kept_free = crowd.journeys.spot, crowd.fixtures.kept_free
    for other in range(len(spot)):
        if other != k and crowd.is_present[other] and is_near(spot[other, 0], spot[other, 1], x, y, SPOT_SPACING):
            return True
    for n in range(len(kept_free)):
        if is_near(kept_free[n, 0], kept_free[n, 1], x, y, kept_free[n, 2]):
            return True
    return False


@subroutine
def _choose_task(crowd: CrowdState, k: int, tick: int) -> bool:
    """Whether wandering pedestrian k is sent to a task instead of a random destination.

    After a visit or a conversation, a pedestrian wanders to another place before it may take the next one; it does not
    sit, queue or try to leave twice in a row either.
    """
    tasks = crowd.tasks
    has_walked = tasks.has_walked[k]
    tasks.has_walked[k] = True
    # At the start everybody walks first; followers of a group have no choice of their own.
    if tick == 0 or not (tasks.may_take_part[k] or tasks.may_lead_out[k]):
        return False
    kind = _draw_kind(crowd, k)
    if kind == NO_TASK or (kind == tasks.last[k] and not has_walked):
        return False
    if kind == EXIT:  # the only task that a whole group takes
        return _start_exit(crowd, k)
    if not tasks.may_take_part[k] or (kind in (VISIT, TALK) and not has_walked):
        return False
    # Possible targets; without any, nothing is drawn, and the pedestrian wanders on
    options = np.empty((len(tasks.kind) + len(crowd.fixtures.thing) + len(crowd.fixtures.seat) + 8, 5))
    count = 0
    if kind == VISIT:
        count = _find_objects(crowd, k, options)
    elif kind == TALK:
        count = _find_groups(crowd, k, options)
    elif kind == SIT:
        count = _find_seats(crowd, options)
    elif tick >= tasks.may_queue_from[k]:
        count = _find_queues(crowd, options)
    if count == 0:
        return False
    row = options[min(int(uniform(crowd.draws, k, COMPANY) * count), count - 1)]
    if not _send(crowd, k, row[0], row[1]):
        return False
    until = tick + _ticks(crowd, _APPROACH_TIME)
    _set_task(crowd, k, kind, row[0], row[1], row[2], row[3], int(row[4]), until, False)
    return True


@subroutine
def _draw_kind(crowd: CrowdState, k: int) -> int:
    """Draw the kind of the next task of pedestrian k; `NO_TASK`: it walks to another place."""
    h, draw = crowd.habits, uniform(crowd.draws, k, COMPANY)
    chances = (h.visits, h.joins, h.sits, h.queues, h.exits)
    for n in range(len(chances)):
        if draw < chances[n]:
            return int(_KINDS[n])
        draw -= chances[n]
    return NO_TASK


@subroutine
def _add_option(options: Array, count: int, x: float, y: float, facing_x: float, facing_y: float, target: int) -> int:
    """Add where to stand and what to face, m, and a target; the new number of options."""
    if count < len(options):
        row = options[count]
        row[0], row[1], row[2], row[3], row[4] = x, y, facing_x, facing_y, target
        count += 1
    return count


@subroutine
def _is_claimed(crowd: CrowdState, kind: int, target: int) -> bool:
    """Whether a pedestrian has a task of a kind with a target."""
    tasks = crowd.tasks
    for k in range(len(tasks.kind)):
        if tasks.kind[k] == kind and tasks.target[k] == target:
            return True
    return False


@subroutine
def _is_unclaimed_place(crowd: CrowdState, x: float, y: float) -> bool:
    """Whether no pedestrian is on its way to a position near this one."""
    tasks = crowd.tasks
    for k in range(len(tasks.kind)):
        distance = length(x - tasks.position[k, 0], y - tasks.position[k, 1])
        if tasks.kind[k] != NO_TASK and not tasks.has_arrived[k] and not distance > _POSITION_SPACING:
            return False
    return True


@subroutine
def _find_objects(crowd: CrowdState, k: int, options: Array) -> int:
    """Options for objects that no other pedestrian attends to or goes to, at a disc on the side of the pedestrian."""
    fixtures = crowd.fixtures
    count = 0
    for n in range(len(fixtures.thing)):
        row = fixtures.thing[n]
        if _is_claimed(crowd, VISIT, n) or not is_unattended(crowd.company, fixtures.thing_piece[n]):
            continue
        clearance = row[6] + crowd.walkers.radius[k]
        if row[5] == 1.0:
            dx, dy = _x(crowd, k) - row[0], _y(crowd, k) - row[1]
            scale = (row[2] + clearance) / max(length(dx, dy), 1e-6)
            x, y = row[0] + dx * scale, row[1] + dy * scale
        else:
            x, y = row[0] + row[2] * (row[4] + clearance), row[1] + row[3] * (row[4] + clearance)
        if _is_open(crowd, x, y, x, y) and _is_unclaimed_place(crowd, x, y):
            count = _add_option(options, count, x, y, row[0], row[1], n)
    return count


@subroutine
def _find_groups(crowd: CrowdState, k: int, options: Array) -> int:
    """Options for formations with room: the best open position beside pedestrians that stand or talk."""
    company, tasks = crowd.company, crowd.tasks
    count = 0
    ranked = np.empty((MOST_POSITIONS, 6))
    for other in range(len(tasks.kind)):
        kind = tasks.kind[other]
        is_busy = kind in (STAY, SIT, QUEUE) or company.is_walking[other] or company.has_object[other]
        if is_busy or not crowd.is_present[other] or not company.stays[other]:
            continue
        members, size = _members_of(crowd, other)
        coming, is_first = 0, True
        for n in range(size):
            is_first = is_first and other <= members[n]
            for j in range(len(tasks.kind)):
                coming += tasks.kind[j] == TALK and not tasks.has_arrived[j] and tasks.target[j] == members[n]
        # Each formation is considered once, by its first member.
        if not is_first or size + coming >= MAXIMUM_MEMBERS:
            continue
        places = np.empty((size, 2))
        for n in range(size):
            places[n, 0] = company.standing_position[members[n], 0]
            places[n, 1] = company.standing_position[members[n], 1]
        facing = company.facing_point[other]
        for n in range(joining_positions(places, facing[0], facing[1], _x(crowd, k), _y(crowd, k), ranked)):
            row = ranked[n]
            if _is_open(crowd, row[CENTRE_X], row[CENTRE_Y], row[POSITION_X], row[POSITION_Y]) and _is_unclaimed_place(
                crowd, row[POSITION_X], row[POSITION_Y]
            ):
                count = _add_option(
                    options, count, row[POSITION_X], row[POSITION_Y], row[CENTRE_X], row[CENTRE_Y], other
                )
                break
    return count


@subroutine
def _find_seats(crowd: CrowdState, options: Array) -> int:
    """Options for free seats that can be reached."""
    seat, count = crowd.fixtures.seat, 0
    for s in range(len(seat)):
        if not _is_claimed(crowd, SIT, s):
            has_place, x, y = _place_beside(crowd, s)
            if has_place and _is_unclaimed_place(crowd, x, y):
                count = _add_option(options, count, x, y, seat[s, 0], seat[s, 1], s)
    return count


@subroutine
def _find_queues(crowd: CrowdState, options: Array) -> int:
    """Options for queues that are not full; several pedestrians may be on their way to one place."""
    fixtures, tasks = crowd.fixtures, crowd.tasks
    count = 0
    for q in range(len(crowd.lines.size)):
        coming = 0
        for j in range(len(tasks.kind)):
            coming += tasks.kind[j] == QUEUE and not tasks.has_arrived[j] and tasks.target[j] == q
        tail = _tail(crowd, q)
        if tail + coming < fixtures.capacity[q]:
            x, y = _slot_place(crowd, q, tail)
            ux, uy = fixtures.queue[q, 0], fixtures.queue[q, 1]
            count = _add_option(options, count, x, y, x + _AHEAD * ux, y + _AHEAD * uy, q)
    return count


# Meetings


@subroutine
def _start_meetings(crowd: CrowdState, tick: int) -> None:
    """Let pairs of wandering pedestrians that come near each other stop and talk.

    A pair is asked once per encounter; pairs that are near at the start have met already.
    """
    meetings, tasks, walkers = crowd.meetings, crowd.tasks, crowd.walkers
    count = len(tasks.kind)
    is_able = np.empty(count, dtype=np.bool_)
    for k in range(count):
        is_able[k] = crowd.company.is_walking[k] and tasks.may_take_part[k] and tasks.kind[k] == NO_TASK
    start, other = meetings.start.copy(), meetings.other[: meetings.start[count]].copy()
    total = 0
    for i in range(count):
        meetings.start[i] = total
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j = walkers.neighbour[n]
            dx, dy = _x(crowd, j) - _x(crowd, i), _y(crowd, j) - _y(crowd, i)
            square = dx * dx + dy * dy
            if j < i or not square < _SEPARATION * _SEPARATION:
                continue
            has_met = not meetings.is_begun[0]
            for m in range(start[i], start[i + 1]):
                has_met = has_met or other[m] == j
            if square < _MEETING_DISTANCE * _MEETING_DISTANCE and not has_met:
                has_met = True
                # Nobody stops for two others in the same tick.
                wants_to = is_able[i] and is_able[j] and uniform(crowd.draws, i, COMPANY) < crowd.habits.meets
                if wants_to and _stop_to_talk(crowd, i, j, tick):
                    is_able[i] = is_able[j] = False
            if has_met and total < len(meetings.other):
                meetings.other[total] = j
                total += 1
    meetings.start[count], meetings.is_begun[0] = total, True


@subroutine
def _stop_to_talk(crowd: CrowdState, i: int, j: int, tick: int) -> bool:
    """Let two pedestrians stop where they meet and talk; False if there is no room."""
    x, y = (_x(crowd, i) + _x(crowd, j)) / 2, (_y(crowd, i) + _y(crowd, j)) / 2
    dx, dy = _x(crowd, i) - _x(crowd, j), _y(crowd, i) - _y(crowd, j)
    double = 2 * max(length(dx, dy), 1e-6)
    ux, uy = dx * PAIR_DISTANCE / double, dy * PAIR_DISTANCE / double
    if not _is_open(crowd, x, y, x + ux, y + uy) or not _is_open(crowd, x, y, x - ux, y - uy):
        return False
    until = _draw_end(crowd, i, TALK, tick)
    for turn in range(2):
        k, sign = (i, 1.0) if turn == 0 else (j, -1.0)
        to_x, to_y = x + sign * ux, y + sign * uy
        stop(crowd.routes, crowd.journeys, k)
        _set_task(crowd, k, TALK, to_x, to_y, x, y, -1, until, True)
        crowd.tasks.has_walked[k] = False
        _stand(crowd, k, to_x, to_y, x, y, STANDING, False)
    crowd.tasks.is_changed[0] = True
    add_link(crowd.company, i, j, TALKS)
    call(crowd.calls.update_partners, (crowd,))
    return True
