"""Tasks of pedestrians: arrivals, pauses, meetings, ends.

Positions are never set: pedestrians walk to where they will stand or leave. Each pedestrian draws its own random
numbers. Members of walking groups stay with their group, pause with it, and leave with it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....core.barrier_grid import find_within
from ....core.compiled.calls import call
from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import length, towards, unit_or
from ....core.philox import uniform
from ....core.portable_math import Array, IntArray
from ..crowd_state import COMPANY, CrowdState
from ..doorways import watch_doors
from ..routes import ARRIVAL_DISTANCE, is_near
from ..social.company import STANDING, TALKS, add_link, is_in_the_way, start_walking, update_links
from ..social.f_formations import PAIR_DISTANCE, widened
from ..social.tasks import EXIT, NO_TASK, QUEUE, SEATED, SIT, STAY, TALK, TURNING, VISIT
from ..wayfinding import follow_track, interrupt, start_wandering, stop, update_obstacles, watch_robots
from .acts import draw_end, is_open, let_stand, members_of, resting_place_of, set_task, ticks, try_to_send, x_of, y_of
from .places import (
    AHEAD,
    advance_exit,
    advance_line,
    advance_seat,
    follow_tail,
    join_line,
    place_beside,
    sit_down,
    stand_at_seat,
)

_PLACE_TOLERANCE = 0.25  # m, from the position of a task
_MEETING_DISTANCE, _SEPARATION = 2.2, 3.5  # m: within the first, a pair may stop to talk; again after the second
POSITION_SPACING = 0.7  # m, between the positions of two tasks
_MEMBER_SPACING, _MEMBER_DISTANCE = 0.6, 1.2  # m, in a group that pauses: least between members, most from the leader
_LONG_STAY = 10.0  # s, from which on paths lead round a pedestrian that pauses
_FACED_WALL = 1.0  # m; people who stand do not face walls and furniture that are nearer
_FOREVER = 1e6  # s
_SERVED_TIME = 120.0  # s, for which a pedestrian that was served does not queue again
_LEFT_ALONE_TIME = 2.0  # s, that a pedestrian stays when its partners have left
_TURN_TIME = 1.6  # s, in which a pedestrian turns its back to the seat


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
            set_task(crowd, k, kind, x, y, x, y, -1, draw_end(crowd, k, kind, 0), True)
    for k in range(len(seats)):
        if seats[k] >= 0:
            stop(crowd.routes, crowd.journeys, k)
            # It has been sitting for a while: a random part of its time is over.
            until = int(draw_end(crowd, k, SIT, 0) * uniform(crowd.draws, k, COMPANY))
            seat = fixtures.seat[seats[k]]
            has_place, x, y = place_beside(crowd, seats[k])
            if not has_place:
                x, y = seat[4], seat[5]
            set_task(crowd, k, SIT, x, y, seat[0], seat[1], seats[k], until, True)
            crowd.tasks.phase[k] = SEATED
            sit_down(crowd, k)
    for q in range(len(crowd.lines.size)):
        x, y = fixtures.slot[q, 0, 0], fixtures.slot[q, 0, 1]
        while True:  # the nearest one first
            nearest, least = -1, math.inf
            for k in range(len(queues)):
                distance = length(x_of(crowd, k) - x, y_of(crowd, k) - y)
                if queues[k] == q and crowd.tasks.kind[k] != QUEUE and distance < least:
                    nearest, least = k, distance
            if nearest < 0:
                break
            stop(crowd.routes, crowd.journeys, nearest)
            set_task(crowd, nearest, QUEUE, x, y, x, y, q, 0, True)
            join_line(crowd, q, nearest)


@kernel
def advance_tasks(packed_state: Any, tick: int) -> None:
    """Advance all tasks by one tick: arrivals, ends, meetings; and the obstacles that result.

    Args:
        packed_state: packed `CrowdState`, updated.
        tick: that begins.
    """
    crowd = unpack(packed_state, CrowdState)
    journeys, tasks = crowd.journeys, crowd.tasks
    if len(crowd.doorways.openings) > 0 and watch_doors(crowd.doorways):
        tasks.is_changed[0] = True
    if watch_robots(crowd.obstacles, crowd.robots):
        tasks.is_changed[0] = True
    for k in range(len(tasks.kind)):
        tasks.is_leaving[k] = False
        if tasks.kind[k] != NO_TASK:
            _advance_task(crowd, k, tick)
    for q in range(len(crowd.lines.size)):
        served = advance_line(crowd, q, tick)
        if served >= 0:
            tasks.may_queue_from[served] = tick + ticks(crowd, _SERVED_TIME)
            call(crowd.calls.leave, (crowd, served, tick))
    if crowd.habits.meets > 0.0:
        _start_meetings(crowd, tick)
    if crowd.habits.stops > 0.0:
        call(crowd.calls.start_stops, (crowd, tick))
    if len(crowd.passages.holder) > 0:
        call(crowd.calls.avoid_queues, (crowd, tick))
    if tasks.is_changed[0]:
        tasks.is_changed[0] = False
        call(crowd.calls.find_obstacles, (crowd, True))
    for k in range(len(tasks.kind)):
        if journeys.track_start[k + 1] > journeys.track_start[k]:
            follow_track(journeys, crowd.routes, k, tick)
    if tick == 0:
        call(crowd.calls.start_straight, (crowd,))


@kernel
def find_obstacles(packed_state: Any, with_robots: bool) -> None:
    """Update what paths lead round: people who stand, leaves of open doors, and, if asked, robots that stand."""
    crowd = unpack(packed_state, CrowdState)
    update_obstacles(crowd.obstacles, crowd.doorways, crowd.robots, crowd.company, crowd.is_present, with_robots)


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
        advance_exit(crowd, k)
    elif tasks.has_arrived[k]:
        if kind == SIT:
            advance_seat(crowd, k, tick)
        elif kind != QUEUE and tick >= tasks.until[k]:  # of a queue, see `advance_line`
            call(crowd.calls.leave, (crowd, k, tick))
    else:
        partner_left = kind == TALK and tasks.target[k] >= 0 and crowd.company.is_walking[tasks.target[k]]
        if partner_left or tick >= tasks.until[k] or not follow_tail(crowd, k):
            call(crowd.calls.leave, (crowd, k, tick))
        elif length(x_of(crowd, k) - tasks.position[k, 0], y_of(crowd, k) - tasks.position[k, 1]) < _PLACE_TOLERANCE:
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
    start_wandering(crowd.routes, crowd.journeys, k, x_of(crowd, k), y_of(crowd, k))
    for n in range(len(partners) if kind == TALK else 0):
        other = partners[n]
        if tasks.kind[other] != NO_TASK and company.partner_count[other] == 0:
            tasks.until[other] = min(tasks.until[other], tick + ticks(crowd, _LEFT_ALONE_TIME))


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
        stand_at_seat(crowd, k, x, y, STANDING)
        tasks.phase[k], tasks.until[k] = TURNING, tick + ticks(crowd, _TURN_TIME)
        return
    tasks.is_changed[0] = True
    if kind == QUEUE:
        join_line(crowd, target, k)
        return
    if kind == VISIT:
        piece = crowd.fixtures.thing_piece[target]
        add_link(company, k, len(tasks.kind) + piece, crowd.fixtures.thing_relation[target])
    else:
        members, size = members_of(crowd, target)
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
            if is_open(crowd, facing_x, facing_y, to_x, to_y):
                place[0], place[1] = to_x, to_y
    let_stand(crowd, k, x, y, facing_x, facing_y, STANDING, False)
    call(crowd.calls.update_partners, (crowd,))
    tasks.until[k] = draw_end(crowd, k, kind, tick)


@kernel
def start_stay(packed_state: Any, k: int, x: float, y: float, duration: float, tick: int) -> None:
    """Pedestrian k, which has arrived, stands at a place, m, for a time, s, and its followers beside it."""
    crowd = unpack(packed_state, CrowdState)
    until = tick + ticks(crowd, min(duration, _FOREVER))
    _pause(crowd, k, x, y, until, tick)
    taken, count = np.empty((len(crowd.tasks.kind) + 1, 2)), 1
    taken[0, 0], taken[0, 1] = x, y
    for follower in range(len(crowd.tasks.kind)):
        if follower == k or crowd.routes.leader[follower] != k or not crowd.is_present[follower]:
            continue
        spot_x, spot_y = _spot_beside(crowd, follower, k, x, y, taken[:count])
        taken[count, 0], taken[count, 1], count = spot_x, spot_y, count + 1
        rest_x, rest_y = resting_place_of(crowd, follower)
        near = length(rest_x - spot_x, rest_y - spot_y) < _PLACE_TOLERANCE
        if (near and length(rest_x - x, rest_y - y) < _MEMBER_DISTANCE) or not try_to_send(
            crowd, follower, spot_x, spot_y
        ):
            _pause(crowd, follower, rest_x, rest_y, until, tick)
        else:
            set_task(crowd, follower, STAY, spot_x, spot_y, x, y, -1, until, False)
        crowd.journeys.spot[follower, 0], crowd.journeys.spot[follower, 1] = spot_x, spot_y


@subroutine
def _pause(crowd: CrowdState, k: int, x: float, y: float, until: int, tick: int) -> None:
    """Pedestrian k stands at a place, m, until a tick.

    It faces where its feet point; at its last goal, if others stand there and it is not behind, it faces that goal. It
    does not stand with its face to a wall.
    """
    routes = crowd.routes
    dx, dy = crowd.walkers.body_direction[k, 0], crowd.walkers.body_direction[k, 1]
    facing_x, facing_y = x + AHEAD * dx, y + AHEAD * dy
    if routes.length[k] > 0 and routes.goals_left[k] == 0:
        to_x, to_y = routes.destination[k, 0] - x, routes.destination[k, 1] - y
        distance = length(to_x, to_y)
        if distance > ARRIVAL_DISTANCE and to_x * dx + to_y * dy > -0.5 * distance:
            facing_x, facing_y = x + to_x, y + to_y
    facing_x, facing_y = _away_from_walls(crowd, x, y, facing_x - x, facing_y - y)
    is_brief = (until - tick) * crowd.obstacles.dt < _LONG_STAY
    stop(routes, crowd.journeys, k)
    let_stand(crowd, k, x, y, facing_x, facing_y, STANDING, is_brief)
    set_task(crowd, k, STAY, x, y, facing_x, facing_y, -1, until, True)
    if not is_brief:
        crowd.tasks.is_changed[0] = True


@subroutine
def _away_from_walls(crowd: CrowdState, x: float, y: float, ahead_x: float, ahead_y: float) -> tuple[float, float]:
    """The point to face from (x, y), m: along a direction, or along its reflection at a wall close ahead."""
    solids = crowd.obstacles.solids
    found = np.empty(len(solids.table), dtype=np.int64)
    for _ in range(2):  # in a corner a reflection leads to the other wall
        for n in range(find_within(solids, x, y, _FACED_WALL, found)):
            dx, dy = towards(solids.table, found[n], x, y)
            ux, uy = unit_or(dx, dy, 1e-6, 0.0, 0.0)
            into = ahead_x * ux + ahead_y * uy
            if into > 0.0:
                ahead_x, ahead_y = ahead_x - 2.0 * into * ux, ahead_y - 2.0 * into * uy
    return x + ahead_x, y + ahead_y


@subroutine
def _spot_beside(crowd: CrowdState, k: int, leader: int, x: float, y: float, taken: Array) -> tuple[float, float]:
    """Where a follower stands beside its leader, m: on its present side of it, or opposite, or where it is."""
    side = crowd.obstacles.side
    dx, dy = x_of(crowd, k) - x_of(crowd, leader), y_of(crowd, k) - y_of(crowd, leader)
    gap = max(length(dx, dy), 1e-6)
    scale = min(max(gap, POSITION_SPACING), _MEMBER_DISTANCE) / gap
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
        if has_room and is_open(crowd, x, y, spot_x, spot_y):
            return spot_x, spot_y
    return x_of(crowd, k), y_of(crowd, k)


@subroutine
def _start_meetings(crowd: CrowdState, tick: int) -> None:
    """Let pairs of pedestrians that come near each other stop and talk; those with goals go on to these.

    A pair in sight of each other is asked once per encounter; pairs that are near at the start have met already.
    """
    meetings, tasks, walkers = crowd.meetings, crowd.tasks, crowd.walkers
    count = len(tasks.kind)
    is_able = np.empty(count, dtype=np.bool_)
    for k in range(count):
        is_able[k] = crowd.company.is_walking[k] and tasks.may_meet[k] and tasks.kind[k] == NO_TASK
    start, other = meetings.start.copy(), meetings.other[: meetings.start[count]].copy()
    total = 0
    for i in range(count):
        meetings.start[i] = total
        for m in range(start[i], start[i + 1]):  # pairs that have met and are still near
            j = other[m]
            is_there = crowd.is_present[i] and crowd.is_present[j] and total < len(meetings.other)
            if is_there and is_near(x_of(crowd, i), y_of(crowd, i), x_of(crowd, j), y_of(crowd, j), _SEPARATION):
                meetings.other[total] = j
                total += 1
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j = walkers.neighbour[n]
            reach = _MEETING_DISTANCE if meetings.is_begun[0] else _SEPARATION
            if j < i or not is_near(x_of(crowd, i), y_of(crowd, i), x_of(crowd, j), y_of(crowd, j), reach):
                continue
            has_met = total == len(meetings.other)
            for m in range(meetings.start[i], total):
                has_met = has_met or meetings.other[m] == j
            if has_met:
                continue
            meetings.other[total] = j
            total += 1
            # Nobody stops for two others in the same tick.
            if meetings.is_begun[0] and is_able[i] and is_able[j]:
                wants_to = uniform(crowd.draws, i, COMPANY) < crowd.habits.meets
                if wants_to and _stop_to_talk(crowd, i, j, tick):
                    is_able[i] = is_able[j] = False
    meetings.start[count], meetings.is_begun[0] = total, True


@subroutine
def _stop_to_talk(crowd: CrowdState, i: int, j: int, tick: int) -> bool:
    """Let two pedestrians stop where they meet and talk; False if there is no room."""
    x, y = (x_of(crowd, i) + x_of(crowd, j)) / 2, (y_of(crowd, i) + y_of(crowd, j)) / 2
    dx, dy = x_of(crowd, i) - x_of(crowd, j), y_of(crowd, i) - y_of(crowd, j)
    double = 2 * max(length(dx, dy), 1e-6)
    ux, uy = dx * PAIR_DISTANCE / double, dy * PAIR_DISTANCE / double
    if not is_open(crowd, x, y, x + ux, y + uy) or not is_open(crowd, x, y, x - ux, y - uy):
        return False
    until = draw_end(crowd, i, TALK, tick)
    for turn in range(2):
        k, sign = (i, 1.0) if turn == 0 else (j, -1.0)
        to_x, to_y = x + sign * ux, y + sign * uy
        if crowd.routes.goals_left[k] >= 0:
            interrupt(crowd.routes, crowd.journeys, k)
        stop(crowd.routes, crowd.journeys, k)
        set_task(crowd, k, TALK, to_x, to_y, x, y, -1, until, True)
        crowd.tasks.has_walked[k] = False
        let_stand(crowd, k, to_x, to_y, x, y, STANDING, False)
    crowd.tasks.is_changed[0] = True
    add_link(crowd.company, i, j, TALKS)
    call(crowd.calls.update_partners, (crowd,))
    return True
