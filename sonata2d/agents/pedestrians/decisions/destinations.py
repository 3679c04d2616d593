"""Destinations of pedestrians: goals, visits, conversations, seats, queues, exits, or a place in the room."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....core.barrier_grid import is_within
from ....core.compiled.calls import call
from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import length
from ....core.free_space import is_clear, is_free
from ....core.philox import uniform, uniform_between
from ....core.portable_math import Array
from ..crowd_state import COMPANY, PLACES, CrowdState
from ..routes import CHECK_INTERVAL, is_near
from ..social.company import is_unattended
from ..social.f_formations import (
    CENTRE_X,
    CENTRE_Y,
    MAXIMUM_MEMBERS,
    MOST_POSITIONS,
    POSITION_X,
    POSITION_Y,
    joining_positions,
)
from ..social.fixtures import SPOT_SPACING
from ..social.tasks import EXIT, NO_TASK, QUEUE, SIT, STAY, TALK, VISIT
from ..wayfinding import LONGEST_PATH, plan_stay, set_path, set_straight_path
from .acts import (
    choose,
    is_open,
    members_of,
    path_in,
    path_past_people,
    planned,
    resting_place_of,
    set_task,
    ticks,
    try_to_send,
    x_of,
    y_of,
)
from .places import AHEAD, place_beside, slot_place, start_exit, tail_of
from .stops import FROM_SOLIDS, is_beside_others, via_point
from .tasks import POSITION_SPACING

_APPROACH_TIME = 25.0  # s, after which a task whose position was not reached is given up
_STOPPING_DISTANCE = 0.8  # m from the goal, within which a pedestrian that is to stand there has arrived
_MINIMUM_TRIP = 2.0  # m; random destinations nearer than this are rejected
_MEMBER_HALF_WIDTH = 0.4  # m, half the width that each member of a group needs at its destination
_ATTEMPTS = 30
_PAST_PEOPLE_CHECKS = 8  # checks of paths between two searches for a path past people who enclose the destination
_NO_DESTINATION_PAUSE = 2.0  # s, for which a pedestrian stands if no attempt finds a destination
_KINDS = np.array([VISIT, TALK, SIT, QUEUE, EXIT])  # in the order in which they are drawn


@kernel
def choose_destination(packed_state: Any, k: int, tick: int) -> None:
    """Give pedestrian k its next destination and the path to it; without a path it stays."""
    crowd = unpack(packed_state, CrowdState)
    habits, journeys, routes = crowd.habits, crowd.journeys, crowd.routes
    x, y = x_of(crowd, k), y_of(crowd, k)
    if journeys.delay[k] > 0.0:
        duration, journeys.delay[k] = journeys.delay[k], 0.0
        _stay_here(crowd, k, duration, tick)
        return
    if routes.is_stopping[k]:
        routes.is_stopping[k] = False
        # A pedestrian without progress is somewhere else on its path.
        to_x, to_y = routes.destination[k, 0], routes.destination[k, 1]
        if is_near(x, y, to_x, to_y, _STOPPING_DISTANCE):
            rest_x, rest_y = resting_place_of(crowd, k)
            # One that wanders goes elsewhere if somebody, or a robot, stands where it would come to rest.
            if routes.goals_left[k] >= 0 or not is_beside_others(crowd, k, rest_x, rest_y):
                _stay_here(crowd, k, journeys.stay[k], tick)
                return
    route = np.empty((LONGEST_PATH, 2))
    if not math.isnan(routes.onward[k, 0]):
        goal_x, goal_y = routes.onward[k, 0], routes.onward[k, 1]
        routes.onward[k, 0] = routes.onward[k, 1] = math.nan
        count = _way_to(crowd, k, x, y, goal_x, goal_y, route)
        set_path(routes, journeys, k, route, count, 1)
        plan_stay(routes, journeys, k, journeys.onward_stay[k], goal_x, goal_y)
        return
    if routes.goals_left[k] == 0:
        _stay_here(crowd, k, math.inf, tick)
        return
    if routes.goals_left[k] > 0:
        n = journeys.goal_start[k + 1] - routes.goals_left[k]
        goal_x, goal_y = journeys.goal[n, 0], journeys.goal[n, 1]
        routes.goals_left[k] -= 1
        count = _way_to(crowd, k, x, y, goal_x, goal_y, route)
        _set_out(crowd, k, route, count, journeys.goal_stay[n])
        return
    if habits.is_lively and _choose_task(crowd, k, tick):
        return
    followers = 0
    for other in range(len(routes.leader)):
        followers += routes.leader[other] == k
    half_width = _MEMBER_HALF_WIDTH * followers if followers > 1 else 0.0
    if habits.pause_high > 0.0 or len(crowd.fixtures.place) > 0:
        half_width = max(half_width, FROM_SOLIDS)
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
        if is_choosy and half_width > 0.0 and is_within(crowd.obstacles.solids, goal_x, goal_y, half_width):
            continue
        count = planned(crowd, k, x, y, goal_x, goal_y, route)
        if count == 0:
            continue
        low, high = habits.pause_low, habits.pause_high
        if place >= 0:
            low, high = crowd.fixtures.place[place, 4], crowd.fixtures.place[place, 5]
        journeys.place[k] = place
        duration = uniform_between(crowd.draws, k, PLACES, low, high) if high > 0.0 else 0.0
        _set_out(crowd, k, route, count, duration)
        return
    # No place is in reach, as between walls on all sides: look again later, since every attempt costs two searches.
    _stay_here(crowd, k, _NO_DESTINATION_PAUSE, tick)


@kernel
def find_new_paths(packed_state: Any, tick: int) -> None:
    """Find new paths to the same destinations for pedestrians that were pushed off their paths.

    Args:
        packed_state: packed `CrowdState`, updated.
        tick: that begins.
    """
    crowd = unpack(packed_state, CrowdState)
    routes = crowd.routes
    route = np.empty((LONGEST_PATH, 2))
    for k in range(len(routes.is_blocked)):
        if routes.is_blocked[k]:
            routes.is_blocked[k] = False
            to_x, to_y = routes.destination[k, 0], routes.destination[k, 1]
            count = planned(crowd, k, x_of(crowd, k), y_of(crowd, k), to_x, to_y, route)
            # Such a path is soon blocked again, so that it is looked for less often.
            if count == 0 and (tick // CHECK_INTERVAL + k) % _PAST_PEOPLE_CHECKS == 0:
                count = path_past_people(crowd, k, x_of(crowd, k), y_of(crowd, k), to_x, to_y, route)
            if count > 0:
                set_path(routes, crowd.journeys, k, route, count, 1)


@kernel
def start_straight(packed_state: Any) -> None:
    """Send pedestrians that see their first goal straight there, in the first tick."""
    crowd = unpack(packed_state, CrowdState)
    journeys, routes = crowd.journeys, crowd.routes
    straight = np.empty((2, 2))
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not crowd.is_present[k] or routes.goals_left[k] <= 0 or journeys.delay[k] > 0.0:
            continue
        x, y, first = x_of(crowd, k), y_of(crowd, k), journeys.goal_start[k + 1] - routes.goals_left[k]
        goal_x, goal_y = journeys.goal[first, 0], journeys.goal[first, 1]
        if is_clear(crowd.obstacles.space, x, y, goal_x, goal_y) or (
            not is_free(crowd.obstacles.space, x, y) and is_clear(crowd.obstacles.passable, x, y, goal_x, goal_y)
        ):
            routes.goals_left[k] -= 1
            straight[0, 0], straight[0, 1], straight[1, 0], straight[1, 1] = x, y, goal_x, goal_y
            _set_out(crowd, k, straight, 2, journeys.goal_stay[first])


@subroutine
def _way_to(crowd: CrowdState, k: int, x: float, y: float, goal_x: float, goal_y: float, route: Array) -> int:
    """The path from (x, y) to a destination that is always approached, m: straight if there is no free path.

    Returns:
        Number of points, which are written into the route, (R, 2), m.
    """
    count = planned(crowd, k, x, y, goal_x, goal_y, route)
    if count == 0:  # through a gap that is hardly wider than the body, or between people who talk
        space, graph = crowd.obstacles.for_passable, crowd.obstacles.for_passable_graph
        count = path_in(crowd, space, graph, x, y, goal_x, goal_y, route)
    if count == 0:
        count = path_past_people(crowd, k, x, y, goal_x, goal_y, route)
    if count == 0:
        route[0, 0], route[0, 1], route[1, 0], route[1, 1], count = x, y, goal_x, goal_y, 2
    return count


@subroutine
def _set_out(crowd: CrowdState, k: int, route: Array, count: int, duration: float) -> None:
    """Let pedestrian k walk on a path, by a via point if it is straight, and stand at its end for a time, s."""
    routes, journeys, end = crowd.routes, crowd.journeys, count - 1
    x, y, goal_x, goal_y = route[0, 0], route[0, 1], route[end, 0], route[end, 1]
    has_via, via_x, via_y = False, 0.0, 0.0
    if count == 2:
        has_via, via_x, via_y = via_point(crowd, k, x, y, goal_x, goal_y)
    if not has_via:
        set_path(routes, journeys, k, route, count, 1)
        plan_stay(routes, journeys, k, duration, goal_x, goal_y)
        return
    set_straight_path(routes, journeys, k, x, y, via_x, via_y)
    plan_stay(routes, journeys, k, 0.0, via_x, via_y)
    routes.onward[k, 0], routes.onward[k, 1], journeys.onward_stay[k] = goal_x, goal_y, duration


@subroutine
def _stay_here(crowd: CrowdState, k: int, duration: float, tick: int) -> None:
    """Let pedestrian k stand where it comes to rest: near its destination, not exactly there."""
    x, y = resting_place_of(crowd, k)
    crowd.journeys.spot[k, 0], crowd.journeys.spot[k, 1] = x, y
    call(crowd.calls.start_stay, (crowd, k, x, y, duration, tick))


@subroutine
def _is_in_file(crowd: CrowdState, k: int, ahead: float, left: float) -> bool:
    """Whether a follower of pedestrian k is more ahead or behind than beside it on the way along (ahead, left)."""
    for other in range(len(crowd.routes.leader)):
        if other != k and crowd.routes.leader[other] == k:
            x, y = x_of(crowd, other) - x_of(crowd, k), y_of(crowd, other) - y_of(crowd, k)
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
    return choose(crowd, k, PLACES, weights)


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
        return start_exit(crowd, k)
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
    if not try_to_send(crowd, k, row[0], row[1]):
        return False
    until = tick + ticks(crowd, _APPROACH_TIME)
    set_task(crowd, k, kind, row[0], row[1], row[2], row[3], int(row[4]), until, False)
    return True


@subroutine
def _draw_kind(crowd: CrowdState, k: int) -> int:
    """Draw the kind of the next task of pedestrian k; `NO_TASK`: it walks to another place."""
    h, draw = crowd.habits, uniform(crowd.draws, k, COMPANY)
    chances = (h.visits, h.joins, h.sits, h.queues, h.exits)
    for n in range(len(chances)):
        if draw < chances[n]:
            # People on wheels and people who push a cart do not sit down.
            return NO_TASK if _KINDS[n] == SIT and crowd.rolls[k] else int(_KINDS[n])
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
        if tasks.kind[k] != NO_TASK and not tasks.has_arrived[k] and not distance > POSITION_SPACING:
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
            dx, dy = x_of(crowd, k) - row[0], y_of(crowd, k) - row[1]
            scale = (row[2] + clearance) / max(length(dx, dy), 1e-6)
            x, y = row[0] + dx * scale, row[1] + dy * scale
        else:
            x, y = row[0] + row[2] * (row[4] + clearance), row[1] + row[3] * (row[4] + clearance)
        if is_open(crowd, x, y, x, y) and _is_unclaimed_place(crowd, x, y):
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
        members, size = members_of(crowd, other)
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
        for n in range(joining_positions(places, facing[0], facing[1], x_of(crowd, k), y_of(crowd, k), ranked)):
            row = ranked[n]
            if is_open(crowd, row[CENTRE_X], row[CENTRE_Y], row[POSITION_X], row[POSITION_Y]) and _is_unclaimed_place(
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
            has_place, x, y = place_beside(crowd, s)
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
        tail = tail_of(crowd, q)
        if tail + coming < fixtures.capacity[q]:
            x, y = slot_place(crowd, q, tail)
            ux, uy = fixtures.queue[q, 0], fixtures.queue[q, 1]
            count = _add_option(options, count, x, y, x + AHEAD * ux, y + AHEAD * uy, q)
    return count
