"""Places that pedestrians use: doors, seats and queues."""

from __future__ import annotations

import numpy as np

from ....core.compiled.calls import call
from ....core.compiled.kernel import subroutine
from ....core.compiled.scalar import length
from ....core.philox import uniform_between
from ..crowd_state import COMPANY, CrowdState
from ..social.company import QUEUEING, SITTING
from ..social.tasks import EXIT, NO_TASK, QUEUE, RISING, SEATED, SIT, TURNING
from .acts import choose, draw_end, is_open, let_stand, set_task, ticks, try_to_send, x_of, y_of

_DOOR_REACH = 0.12  # m, beyond the place before a door, in which a pedestrian disappears
_STANDS_AGAIN = 0.12  # m, from the place beside the seat
_REACTION_LOW, _REACTION_HIGH = 0.3, 0.9  # s, after which a pedestrian follows when the place ahead is free
_AT_HEAD = 0.3  # m, from the first place of a queue, within which the first pedestrian is served
_ROOM_AT_HEAD = 0.6  # m, from the first place, at which the one that was served makes room for the next
AHEAD = 3.0  # m, distance of the point that a standing pedestrian faces


@subroutine
def _in_door(crowd: CrowdState, d: int, x: float, y: float) -> tuple[float, float]:
    """A point relative to a door: into the room, and to the left; m."""
    door = crowd.fixtures.door[d]
    dx, dy = x - door[0], y - door[1]
    return dx * door[2] + dy * door[3], dy * door[2] - dx * door[3]


@subroutine
def advance_exit(crowd: CrowdState, k: int) -> None:
    """Let pedestrian k leave if it has reached its door; those that follow it then go there by themselves."""
    routes, tasks = crowd.routes, crowd.tasks
    d = tasks.target[k]
    if not crowd.is_present[k]:
        tasks.kind[k] = NO_TASK
        return
    ahead, left = _in_door(crowd, d, x_of(crowd, k), y_of(crowd, k))
    if not (ahead < crowd.habits.door_depth + _DOOR_REACH and abs(left) < crowd.fixtures.door[d, 4] / 2):
        return
    tasks.is_leaving[k], tasks.kind[k] = True, NO_TASK
    for follower in range(len(tasks.kind)):
        if follower != k and routes.leader[follower] == k:
            routes.leader[follower] = routes.first[follower] = follower
            if tasks.kind[follower] != NO_TASK:
                try_to_send(crowd, follower, tasks.position[follower, 0], tasks.position[follower, 1])


@subroutine
def start_exit(crowd: CrowdState, k: int) -> bool:
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
    d = choose(crowd, k, COMPANY, weights)
    if d < 0:
        return False
    door, depth = fixtures.door[d], crowd.habits.door_depth
    _, left = _in_door(crowd, d, x_of(crowd, k), y_of(crowd, k))
    left = min(max(left, -door[5]), door[5])
    x, y = door[0] + depth * door[2] - left * door[3], door[1] + depth * door[3] + left * door[2]
    if not try_to_send(crowd, k, x, y):
        return False
    for member in range(len(crowd.tasks.kind)):
        if (member == k or crowd.routes.leader[member] == k) and crowd.is_present[member]:
            set_task(crowd, member, EXIT, x, y, door[0], door[1], d, 0, False)
            crowd.routes.is_exiting[member] = True
    return True


@subroutine
def place_beside(crowd: CrowdState, s: int) -> tuple[bool, float, float]:
    """Whether a place beside a seat is free, and the first one, m."""
    seat = crowd.fixtures.seat[s]
    for n in range(3):
        x, y = seat[4 + 2 * n], seat[5 + 2 * n]
        if is_open(crowd, x, y, x, y):
            return True, x, y
    return False, 0.0, 0.0


@subroutine
def stand_at_seat(crowd: CrowdState, k: int, x: float, y: float, posture: int) -> None:
    """Pedestrian k stands or sits at a place, m, and faces the direction of its seat."""
    seat = crowd.fixtures.seat[crowd.tasks.target[k]]
    let_stand(crowd, k, x, y, x + AHEAD * seat[2], y + AHEAD * seat[3], posture, False)


@subroutine
def sit_down(crowd: CrowdState, k: int) -> None:
    fixtures = crowd.fixtures
    s = crowd.tasks.target[k]
    stand_at_seat(crowd, k, fixtures.seat[s, 0], fixtures.seat[s, 1], SITTING)
    crowd.tasks.sits_on[k] = fixtures.seat_piece[s]


@subroutine
def advance_seat(crowd: CrowdState, k: int, tick: int) -> None:
    """Turn the back to the seat, sit, get up to the place beside it, and leave."""
    tasks = crowd.tasks
    if tasks.phase[k] == TURNING:
        if tick >= tasks.until[k]:
            tasks.phase[k] = SEATED
            sit_down(crowd, k)
            tasks.until[k] = draw_end(crowd, k, SIT, tick)
    elif tasks.phase[k] == SEATED:
        if tick >= tasks.until[k]:
            has_place, x, y = place_beside(crowd, tasks.target[k])
            if has_place:  # else it waits until there is room to stand
                tasks.position[k, 0], tasks.position[k, 1], tasks.phase[k] = x, y, RISING
                stand_at_seat(crowd, k, x, y, SITTING)
    elif length(x_of(crowd, k) - tasks.position[k, 0], y_of(crowd, k) - tasks.position[k, 1]) < _STANDS_AGAIN:
        call(crowd.calls.leave, (crowd, k, tick))


@subroutine
def tail_of(crowd: CrowdState, q: int) -> int:
    """The first slot behind the last pedestrian in a queue."""
    size = crowd.lines.size[q]
    return int(crowd.lines.slot[q, size - 1]) + 1 if size > 0 else 0


@subroutine
def slot_place(crowd: CrowdState, q: int, number: int) -> tuple[float, float]:
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
    x, y = slot_place(crowd, q, number)
    ux, uy = crowd.fixtures.queue[q, 0], crowd.fixtures.queue[q, 1]
    let_stand(crowd, k, x, y, x + AHEAD * ux, y + AHEAD * uy, QUEUEING, False)


@subroutine
def join_line(crowd: CrowdState, q: int, k: int) -> None:
    """Pedestrian k takes the first slot behind the last one."""
    lines = crowd.lines
    size = lines.size[q]
    lines.slot[q, size], lines.member[q, size], lines.move_at[q, size] = tail_of(crowd, q), k, -1
    lines.size[q] += 1
    _stand_in_line(crowd, q, k, lines.slot[q, size])


@subroutine
def advance_line(crowd: CrowdState, q: int, tick: int) -> int:
    """Let the pedestrians in a queue move up; the one that leaves it because it was served, or -1."""
    fixtures, lines = crowd.fixtures, crowd.lines
    ahead = -1  # slot of the member in front
    head_x, head_y = fixtures.slot[q, 0, 0], fixtures.slot[q, 0, 1]
    for n in range(lines.size[q]):
        k, slot = lines.member[q, n], lines.slot[q, n]
        if slot - 1 > ahead and (slot > 1 or _has_room_at_head(crowd, q)):
            if lines.move_at[q, n] < 0:
                reaction = uniform_between(crowd.draws, k, COMPANY, _REACTION_LOW, _REACTION_HIGH)
                lines.move_at[q, n] = tick + ticks(crowd, reaction)
            elif tick >= lines.move_at[q, n]:
                lines.slot[q, n], lines.move_at[q, n], crowd.tasks.is_changed[0] = slot - 1, -1, True
                _stand_in_line(crowd, q, k, slot - 1)
        ahead = lines.slot[q, n]
    if lines.size[q] == 0 or lines.slot[q, 0] > 0:
        return -1
    first = lines.member[q, 0]
    if lines.served_at[q] < 0:
        if length(x_of(crowd, first) - head_x, y_of(crowd, first) - head_y) < _AT_HEAD:
            low, high = fixtures.queue[q, 2], fixtures.queue[q, 3]
            lines.served_at[q] = tick + ticks(crowd, uniform_between(crowd.draws, first, COMPANY, low, high))
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
    if k >= 0 and length(x_of(crowd, k) - slot[0], y_of(crowd, k) - slot[1]) > _ROOM_AT_HEAD:
        lines.last_served[q] = -1
    return bool(lines.last_served[q] < 0)


@subroutine
def follow_tail(crowd: CrowdState, k: int) -> bool:
    """Send pedestrian k to the end of its queue if that has moved; False if it cannot join any more."""
    tasks = crowd.tasks
    q = tasks.target[k]
    if tasks.kind[k] != QUEUE:
        return True
    tail = tail_of(crowd, q)
    if tail >= crowd.fixtures.capacity[q]:
        return False
    x, y = slot_place(crowd, q, tail)
    if x == tasks.position[k, 0] and y == tasks.position[k, 1]:
        return True
    tasks.position[k, 0], tasks.position[k, 1] = x, y
    return try_to_send(crowd, k, x, y)
