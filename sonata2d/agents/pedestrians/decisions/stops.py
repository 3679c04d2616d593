"""Via points and stops of pedestrians on their way."""

from __future__ import annotations

import math
from typing import Any

from ....core.barrier_grid import is_within
from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import exp, length
from ....core.free_space import Space, is_clear, is_free
from ....core.humans import X, Y
from ....core.philox import uniform, uniform_between
from ..crowd_state import WAYS, CrowdState
from ..routes import is_near, stopping_distance
from ..social.tasks import NO_TASK
from ..wayfinding import BRAKING_TIME, set_stop
from .acts import x_of, y_of

_SHORTEST_WAY = 3.0  # m, with a via point
_MIDDLE = 0.25, 0.75  # of the way, where via points are
_ATTEMPTS = 3
_CROWD = 2.0  # sum of the weights of strangers, which fall to 1/e over 1 m, from which there are no via points
_COMPANY = 4.0  # m, from a member of the group whose via points and stops a pedestrian shares
_LEAST_SPEED = 0.3  # m/s, of a pedestrian that stops on its way
# Free distances where a pedestrian stops, m, from its centre: to walls and furniture, the centres of strangers, the
# circle around a robot, and its destination.
FROM_SOLIDS, _FROM_STRANGERS, _FROM_ROBOTS, _FROM_DESTINATION = 0.65, 0.75, 0.65, 1.0


@subroutine
def via_point(crowd: CrowdState, k: int, x: float, y: float, goal_x: float, goal_y: float) -> tuple[bool, float, float]:
    """Whether pedestrian k takes a via point on its straight way from (x, y) to its goal, and the point; m."""
    routes, space, way = crowd.routes, crowd.obstacles.space, length(goal_x - x, goal_y - y)
    if crowd.habits.detours <= 0.0 or way < _SHORTEST_WAY or _is_in_crowd(crowd, k, x, y):
        return False, 0.0, 0.0
    for other in range(len(routes.first)):
        # Members with goals of their own pass beside the via point of the first one that has set out to the same goal.
        leads = routes.leader[other] == other and routes.goals_left[other] == routes.goals_left[k]
        if not leads or routes.length[other] == 0 or not _are_in_company(crowd, k, other):
            continue
        via_x = routes.destination[other, 0] + x - x_of(crowd, other)
        via_y = routes.destination[other, 1] + y - y_of(crowd, other)
        has_via = not math.isnan(routes.onward[other, 0]) and not routes.is_stopping[other]
        return has_via and _is_way(space, x, y, via_x, via_y, goal_x, goal_y), via_x, via_y
    for _ in range(_ATTEMPTS):
        part = uniform_between(crowd.draws, k, WAYS, _MIDDLE[0], _MIDDLE[1])
        total = -1.5
        for _ in range(3):
            total += uniform(crowd.draws, k, WAYS)  # the sum has the variance 1/4
        left = 2.0 * total * crowd.habits.detours * crowd.obstacles.side
        via_x = x + part * (goal_x - x) - left * (goal_y - y)
        via_y = y + part * (goal_y - y) + left * (goal_x - x)
        if is_free(space, via_x, via_y) and _is_way(space, x, y, via_x, via_y, goal_x, goal_y):
            return True, via_x, via_y
    return False, 0.0, 0.0


@subroutine
def _is_way(space: Space, x: float, y: float, via_x: float, via_y: float, goal_x: float, goal_y: float) -> bool:
    """Whether the straight ways from (x, y) to a via point, and from there to the goal, are free; m."""
    return is_clear(space, x, y, via_x, via_y) and is_clear(space, via_x, via_y, goal_x, goal_y)


@subroutine
def _is_in_crowd(crowd: CrowdState, k: int, x: float, y: float) -> bool:
    """Whether strangers are so close around pedestrian k at (x, y), m, that it goes where they leave room."""
    total = 0.0
    for other in range(len(crowd.is_present)):
        if crowd.is_present[other] and crowd.routes.first[other] != crowd.routes.first[k]:
            total += exp(-length(x_of(crowd, other) - x, y_of(crowd, other) - y))
    return total > _CROWD


@kernel
def start_stops(packed_state: Any, tick: int) -> None:
    """Let pedestrians that are on their way stop for a time, at the rate `Social.stops`, where there is room.

    Args:
        packed_state: packed `CrowdState`, updated.
        tick: that begins.
    """
    crowd = unpack(packed_state, CrowdState)
    journeys, routes, habits = crowd.journeys, crowd.routes, crowd.habits
    chance = habits.stops / 60.0 * crowd.obstacles.dt
    for n in range(routes.walkers[0]):
        k = routes.order[n]
        if not _may_stop(crowd, k):
            continue
        if not journeys.wants_stop[k]:
            draw = uniform(crowd.draws, k, WAYS)
            journeys.wants_stop[k] = draw < chance and draw * _share(crowd, k) < chance
            if not journeys.wants_stop[k]:
                continue
        has_place, x, y = _stop_place(crowd, k)
        if not has_place:
            continue
        # Short stops are more frequent than long ones; the time begins when the pedestrian begins to brake.
        part = uniform(crowd.draws, k, WAYS)
        duration = BRAKING_TIME + habits.stop_low + (habits.stop_high - habits.stop_low) * part * part * part
        dx, dy = x - x_of(crowd, k), y - y_of(crowd, k)
        for other in range(len(routes.first)):
            if other == k or (_are_in_company(crowd, k, other) and _may_stop(crowd, other)):
                journeys.wants_stop[other] = False
                from_x, from_y = x_of(crowd, other), y_of(crowd, other)
                set_stop(routes, journeys, other, from_x, from_y, from_x + dx, from_y + dy, duration)


@subroutine
def _are_in_company(crowd: CrowdState, k: int, other: int) -> bool:
    """Whether two pedestrians are members of one group, present, and near each other."""
    is_member = other != k and crowd.routes.first[other] == crowd.routes.first[k] and crowd.is_present[other]
    return is_member and is_near(x_of(crowd, k), y_of(crowd, k), x_of(crowd, other), y_of(crowd, other), _COMPANY)


@subroutine
def _share(crowd: CrowdState, k: int) -> float:
    """Number of pedestrians that decide about the stops of the group of pedestrian k."""
    members = 1.0
    for other in range(len(crowd.routes.first)):
        members += _are_in_company(crowd, k, other) and _may_stop(crowd, other)
    return members


@subroutine
def _may_stop(crowd: CrowdState, k: int) -> bool:
    """Whether pedestrian k walks to a destination, of its own or of its group, and is not about to stop."""
    routes, velocity = crowd.routes, crowd.walkers.velocity
    is_idle = crowd.is_present[k] and crowd.company.is_walking[k] and crowd.tasks.kind[k] == NO_TASK
    leads = routes.leader[k] == k and not routes.is_assigned[k] and routes.length[k] > 0
    stops = routes.is_stopping[k] and not math.isnan(routes.onward[k, 0])
    return is_idle and leads and not stops and length(velocity[k, 0], velocity[k, 1]) > _LEAST_SPEED


@subroutine
def _stop_place(crowd: CrowdState, k: int) -> tuple[bool, float, float]:
    """Whether pedestrian k can stop where it would come to rest on its way, and that place, m.

    People do not stop in doorways, close to walls, or close to strangers and robots.
    """
    routes, walkers = crowd.routes, crowd.walkers
    x, y = x_of(crowd, k), y_of(crowd, k)
    vx, vy = walkers.velocity[k, 0], walkers.velocity[k, 1]
    speed = length(vx, vy)
    scale = stopping_distance(speed) / speed
    to_x, to_y = x + scale * vx, y + scale * vy
    if is_near(to_x, to_y, routes.destination[k, 0], routes.destination[k, 1], _FROM_DESTINATION):
        return False, to_x, to_y
    if is_within(crowd.obstacles.solids, to_x, to_y, FROM_SOLIDS):
        return False, to_x, to_y
    if not is_clear(crowd.obstacles.space, x, y, to_x, to_y):
        return False, to_x, to_y
    for n in range(len(crowd.fixtures.kept_free)):
        disc = crowd.fixtures.kept_free[n]
        if is_near(disc[0], disc[1], to_x, to_y, disc[2]):
            return False, to_x, to_y
    return not is_beside_others(crowd, k, to_x, to_y), to_x, to_y


@subroutine
def is_beside_others(crowd: CrowdState, k: int, x: float, y: float) -> bool:
    """Whether a place, m, is too close to a pedestrian that is not in the group of pedestrian k, or to a robot.

    A pedestrian that ignores the robot stops beside it, too.
    """
    first, robots = crowd.routes.first, crowd.robots
    for r in range(len(robots.radius) if crowd.reactions.weight[k] > 0.0 else 0):
        if is_near(robots.state[r, X], robots.state[r, Y], x, y, robots.radius[r] + _FROM_ROBOTS):
            return True
    for other in range(len(crowd.is_present)):
        is_stranger = other != k and crowd.is_present[other] and first[other] != first[k]
        if is_stranger and is_near(x_of(crowd, other), y_of(crowd, other), x, y, _FROM_STRANGERS):
            return True
    return False
