"""Choice of another way round a passage before which people queue."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....core.barrier_grid import set_barrier
from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import END_X, END_Y, START_X, START_Y
from ....core.portable_math import Array
from ..crowd_state import CrowdState
from ..passages import first_on_path, people_ahead, width_of
from ..wayfinding import LONGEST_PATH, path_length, set_path, use_added
from .acts import shorter_path, ticks, x_of, y_of

_INTERVAL = 2.0  # s, between two looks at the queue of one pedestrian
_FLOW = 1.9  # 1/(m s), of a passage; Seyfried et al., Transportation Science 43 (2009) 395
_GAIN = 3.0  # s, that another way must save
_MOST_SEARCHES = 2  # for other ways in a tick, which bounds its duration in large crowds


@kernel
def avoid_queues(packed_state: Any, tick: int) -> None:
    """Let pedestrians take another way if it is faster than to queue before the next passage on theirs.

    A way takes the time of walking, or longer where the people ahead need more time to pass. Members of a group stay
    on the way of their group.

    Args:
        packed_state: packed `CrowdState`, updated.
        tick: that begins.
    """
    crowd = unpack(packed_state, CrowdState)
    routes = crowd.routes
    period, searches, count = max(ticks(crowd, _INTERVAL), 1), 0, routes.walkers[0]
    route = np.empty((LONGEST_PATH, 2))
    for n in range(count):
        k = routes.order[(n + tick) % count]  # another one is first in each tick
        is_free = crowd.walkers.group[k] < 0 and crowd.is_present[k] and crowd.company.is_walking[k]
        if (tick + k) % period != 0 or not is_free or crowd.intentions.preferred_speed[k] <= 0.0:
            continue
        rest = _rest_of_path(crowd, k, route)
        if rest < 2 or routes.is_partial[k]:
            continue
        g, delay = _delay(crowd, k, route, rest)
        if g < 0 or delay < _GAIN:
            continue
        present = path_length(route, rest) / crowd.intentions.preferred_speed[k] + delay
        end_x, end_y, searches = route[rest - 1, 0], route[rest - 1, 1], searches + 1
        size = _path_without(crowd, k, g, end_x, end_y, route)
        if size > 0:
            other = path_length(route, size) / crowd.intentions.preferred_speed[k]
            if other + _delay(crowd, k, route, size)[1] < present - _GAIN:
                set_path(routes, crowd.journeys, k, route, size, 1)
        if searches == _MOST_SEARCHES:
            break


@subroutine
def _rest_of_path(crowd: CrowdState, k: int, route: Array) -> int:
    """Write the rest of the path of pedestrian k, from where it is, into a route, (R, 2), m; the number of points."""
    routes, count = crowd.routes, 1
    route[0, 0], route[0, 1] = x_of(crowd, k), y_of(crowd, k)
    for n in range(max(routes.next[k], 0), routes.length[k]):
        route[count, 0], route[count, 1] = routes.path[k, n, 0], routes.path[k, n, 1]
        count += 1
    return count


@subroutine
def _delay(crowd: CrowdState, k: int, route: Array, count: int) -> tuple[int, float]:
    """The first passage on a route of pedestrian k, -1 without one, and the time for which it waits there, s."""
    g, _, distance = first_on_path(crowd.passages, route[0, 0], route[0, 1], route, 1, count, math.inf)
    if g < 0 or distance <= 0.0:
        return -1, 0.0
    waiting = people_ahead(crowd.passages, g, k, distance) / (_FLOW * width_of(crowd.passages, g))
    return g, max(float(waiting - distance / crowd.intentions.preferred_speed[k]), 0.0)


@subroutine
def _path_without(crowd: CrowdState, k: int, g: int, end_x: float, end_y: float, route: Array) -> int:
    """The path of pedestrian k that does not lead through passage g: the number of points, 0 without such a path."""
    obstacles, gate = crowd.obstacles, crowd.passages.gates.table[g]
    added = obstacles.space.added
    if added.used[0] == len(added.table):
        return 0
    set_barrier(added.table, added.used[0], gate[START_X], gate[START_Y], gate[END_X], gate[END_Y], 0.0)
    use_added(obstacles, added.used[0] + 1)
    count = shorter_path(crowd, k, x_of(crowd, k), y_of(crowd, k), end_x, end_y, route)
    use_added(obstacles, added.used[0] - 1)
    return count
