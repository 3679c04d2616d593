"""Acts that decisions consist of: walking to a place, standing, facing, random choices.

The kernels take the packed `CrowdState`: they are called rarely, and compiled apart from the tick.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....core.compiled.calls import call, call_for_flag, call_for_int
from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import Vector, length
from ....core.philox import uniform_between
from ....core.portable_math import Array, IntArray
from ..crowd_state import COMPANY, CrowdState
from ..social.company import start_standing
from ..social.tasks import SIT, TALK
from ..wayfinding import LONGEST_PATH, path_length, resting_place, robot_stands, set_path, use_added

_DETOUR = 1.3  # largest ratio of the lengths of a path with room and of a path without, at which the first is preferred
_TOUCHING = 0.1  # m, largest gap to a robot that a pedestrian touches


@subroutine
def x_of(crowd: CrowdState, k: int) -> float:
    return float(crowd.walkers.position[k, 0])


@subroutine
def y_of(crowd: CrowdState, k: int) -> float:
    return float(crowd.walkers.position[k, 1])


@subroutine
def resting_place_of(crowd: CrowdState, k: int) -> Vector:
    """Where pedestrian k comes to rest if it brakes now, m."""
    vx, vy = crowd.walkers.velocity[k, 0], crowd.walkers.velocity[k, 1]
    return resting_place(crowd.obstacles.space, x_of(crowd, k), y_of(crowd, k), vx, vy)


@subroutine
def ticks(crowd: CrowdState, seconds: float) -> int:
    return int(seconds / crowd.obstacles.dt)


@subroutine
def is_open(crowd: CrowdState, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a pedestrian can stand at the end, and walk there straight from (x, y); m."""
    return bool(call_for_flag(crowd.calls.check_place, (crowd.obstacles.for_places, x, y, end_x, end_y)))


@subroutine
def path_in(
    crowd: CrowdState, space: Any, graph: Any, x: float, y: float, end_x: float, end_y: float, route: Array
) -> int:
    """Number of points of the shortest path in a packed space, which is written into the route, (R, 2), m."""
    size = np.empty(1)
    return int(call_for_int(crowd.calls.find_path, (space, graph, x, y, end_x, end_y, route, size)))


@kernel
def plan_path(packed_state: Any, k: int, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """The path to a destination with room for the shoulders, or a shorter one on which they must turn.

    Args:
        packed_state: packed `CrowdState`.
        k: index of the pedestrian. The paths of one that ignores the robot do not lead round robots that stand, until
            it touches one.
        x, y, end_x, end_y: start and destination, m.
        route: (R, 2), output: points of the path, m.

    Returns:
        Number of points; 0 if there is no path.
    """
    crowd = unpack(packed_state, CrowdState)
    ignores_robots = crowd.reactions.weight[k] == 0.0 and robot_stands(crowd.obstacles)
    ignores_robots = ignores_robots and crowd.reactions.gap[k] > _TOUCHING
    if ignores_robots:
        call(crowd.calls.find_obstacles, (crowd, False))
    count = shorter_path(crowd, k, x, y, end_x, end_y, route)
    if ignores_robots:
        call(crowd.calls.find_obstacles, (crowd, True))
    return count


@subroutine
def shorter_path(crowd: CrowdState, k: int, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """`plan_path` among the present obstacles."""
    count = path_in(crowd, crowd.obstacles.for_space, crowd.obstacles.for_space_graph, x, y, end_x, end_y, route)
    size = path_length(route, count)
    if count > 0 and size <= _DETOUR * length(end_x - x, end_y - y):
        return count  # no other one is much shorter
    if crowd.walkers.shoulder[k] < 0.0:
        return count  # a long body does not pass sideways
    tight = np.empty((len(route), 2))
    other = path_in(crowd, crowd.obstacles.for_tight, crowd.obstacles.for_tight_graph, x, y, end_x, end_y, tight)
    if other == 0 or (count > 0 and size <= _DETOUR * path_length(tight, other)):
        return count
    for n in range(other):
        route[n, 0], route[n, 1] = tight[n, 0], tight[n, 1]
    return other


@subroutine
def path_past_people(crowd: CrowdState, k: int, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """`shorter_path` through the people and robots that stand, for a destination that they enclose."""
    obstacles = crowd.obstacles
    count, holes = obstacles.space.added.used[0], obstacles.space.hole_count[0]
    obstacles.space.hole_count[0] = 0
    use_added(obstacles, 0)
    size = shorter_path(crowd, k, x, y, end_x, end_y, route)
    obstacles.space.hole_count[0] = holes
    use_added(obstacles, count)
    return size


@subroutine
def planned(crowd: CrowdState, k: int, x: float, y: float, end_x: float, end_y: float, route: Array) -> int:
    """`plan_path`."""
    return int(call_for_int(crowd.calls.plan_path, (crowd, k, x, y, end_x, end_y, route)))


@kernel
def send(packed_state: Any, k: int, x: float, y: float) -> bool:
    """Send pedestrian k to a destination, m, where it stays; False if there is no path."""
    crowd = unpack(packed_state, CrowdState)
    journeys, routes = crowd.journeys, crowd.routes
    route = np.empty((LONGEST_PATH, 2))
    count = planned(crowd, k, x_of(crowd, k), y_of(crowd, k), x, y, route)
    if count == 0:
        return False
    set_path(routes, journeys, k, route, count, 1)
    routes.is_assigned[k], routes.is_stopping[k] = True, False
    journeys.spot[k, 0] = journeys.spot[k, 1] = math.nan
    return True


@subroutine
def try_to_send(crowd: CrowdState, k: int, x: float, y: float) -> bool:
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
def let_stand(
    crowd: CrowdState, k: int, x: float, y: float, facing_x: float, facing_y: float, posture: int,
    is_brief: bool,
) -> None:  # fmt: skip
    """`stand`."""
    call(crowd.calls.stand, (crowd, k, x, y, facing_x, facing_y, posture, is_brief))


@subroutine
def set_task(
    crowd: CrowdState, k: int, kind: int, x: float, y: float, facing_x: float, facing_y: float, target: int, until: int,
    has_arrived: bool,
) -> None:  # fmt: skip
    tasks = crowd.tasks
    tasks.kind[k], tasks.target[k], tasks.until[k], tasks.has_arrived[k] = kind, target, until, has_arrived
    tasks.position[k, 0], tasks.position[k, 1] = x, y
    tasks.facing[k, 0], tasks.facing[k, 1] = facing_x, facing_y


@subroutine
def draw_end(crowd: CrowdState, k: int, kind: int, tick: int) -> int:
    """The tick until which pedestrian k stays at a visit, a conversation or on a seat."""
    h = crowd.habits
    low, high = h.visit_low, h.visit_high
    if kind == TALK:
        low, high = h.talk_low, h.talk_high
    elif kind == SIT:
        low, high = h.sit_low, h.sit_high
    return tick + ticks(crowd, uniform_between(crowd.draws, k, COMPANY, low, high))


@subroutine
def choose(crowd: CrowdState, k: int, purpose: int, weights: Array) -> int:
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


@subroutine
def members_of(crowd: CrowdState, k: int) -> tuple[IntArray, int]:
    """Pedestrian k and its partners, and their number."""
    company = crowd.company
    members, size = np.empty(1 + company.partners.shape[1], dtype=np.int64), 1 + company.partner_count[k]
    members[0] = k
    for n in range(size - 1):
        members[n + 1] = company.partners[k, n]
    return members, size
