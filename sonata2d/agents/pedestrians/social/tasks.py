"""`Tasks`: what pedestrians do between two walks to random places; and the queues and meetings that result."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....core.compiled.packing import Bools, Floats2, Ints, Ints2, zeros
from ....core.scene import Scene

NO_TASK, VISIT, TALK, STAY, SIT, QUEUE, EXIT = range(7)  # values of `Tasks.kind`
TURNING, SEATED, RISING = range(3)  # values of `Tasks.phase` after arrival at a seat


class Tasks(NamedTuple):
    """A visit, a conversation, a pause, a rest on a seat, a time in a queue, or the way out of each of N pedestrians.

    Attributes:
        kind: (N,) of int, see above.
        position: (N, 2), where to stand, m; for a seat the place beside it; for a door where to leave.
        facing: (N, 2), the point to face, m.
        target: (N,) of int: the object of a visit, the seat, queue or door, a row of `Fixtures`; for a conversation the
            pedestrian to join; -1 for none.
        until: (N,) of int, tick at which the task ends, or, on the way there, at which it is given up.
        has_arrived: (N,) of bool, False on the way to the position.
        phase: (N,) of int, of a rest on a seat.
        last: (N,) of int, kind of the last task.
        may_queue_from: (N,) of int, tick, of those who were served.
        has_walked: (N,) of bool, no task since the last walk: may take one on the next arrival.
        may_take_part: (N,) of bool, pedestrians that take part in social life.
        may_meet: (N,) of bool, pedestrians that stop to talk when they meet others: the same, and those with goals.
        may_lead_out: (N,) of bool, wandering members of groups, which leave together.
        sits_on: (N,) of int, index in the scene's furniture of each pedestrian's seat from sitting down until it stands
            again; -1 for none.
        is_leaving: (N,) of bool, pedestrians that have reached the door through which they leave, in this tick.
        is_changed: (1,) of bool, whether other people stand than at the last update of the obstacles.
    """

    kind: Ints
    position: Floats2
    facing: Floats2
    target: Ints
    until: Ints
    has_arrived: Bools
    phase: Ints
    last: Ints
    may_queue_from: Ints
    has_walked: Bools
    may_take_part: Bools
    may_meet: Bools
    may_lead_out: Bools
    sits_on: Ints
    is_leaving: Bools
    is_changed: Bools


class Lines(NamedTuple):
    """The pedestrians in Q queues, the first one first.

    Each has a slot, counted from the head, and may step forward when the slot in front of it is free; the first one is
    served while it stands at the head.

    Attributes:
        size: (Q,) of int, number of pedestrians.
        member: (Q, C) of int.
        slot: (Q, C) of int, of each member, ascending.
        move_at: (Q, C) of int, tick at which each member steps forward; -1 if it does not.
        served_at: (Q,) of int, tick at which the service of the first member ends; -1 if it has not begun.
        last_served: (Q,) of int, row of the pedestrian that was served last, until it has left the head; else -1.
    """

    size: Ints
    member: Ints2
    slot: Ints2
    move_at: Ints2
    served_at: Ints
    last_served: Ints


class Meetings(NamedTuple):
    """Pairs of pedestrians that have met since they were last apart.

    Attributes:
        start: (N + 1,) of int, where the pedestrians that each one has met begin in `other`.
        other: (K,) of int, ascending, each pair at its first pedestrian.
        is_begun: (1,) of bool, False before the first tick.
    """

    start: Ints
    other: Ints
    is_begun: Bools


def tasks_of(scene: Scene, stays: Bools) -> Tasks:
    """No tasks, at the start of an episode."""
    humans, count = scene.humans, len(scene.humans)
    grouped = {member for group in scene.groups if group.kind == "walking" for member in group.members}
    is_grouped = np.array([human.id in grouped for human in humans], dtype=bool)
    has_own_path = np.array([human.behaviour in ("walking", "recorded") for human in humans], dtype=bool)
    walks = np.array([human.behaviour == "walking" for human in humans], dtype=bool)
    wanders = np.array([human.behaviour == "wandering" for human in humans], dtype=bool)
    return zeros(
        Tasks,
        count,
        target=np.full(count, -1),
        has_walked=np.ones(count, dtype=bool),
        may_take_part=~is_grouped & ~has_own_path & stays,
        may_meet=~is_grouped & ((wanders & stays) | walks),
        may_lead_out=is_grouped & wanders & stays,
        sits_on=np.full(count, -1),
        is_changed=np.ones(1, dtype=bool),
    )


def lines_of(scene: Scene) -> Lines:
    """Empty queues."""
    count = len(scene.queues)
    shape = count, max((queue.capacity for queue in scene.queues), default=1) + len(scene.humans)
    return Lines(
        np.zeros(count, dtype=np.int64), np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64),
        np.full(shape, -1), np.full(count, -1), np.full(count, -1),
    )  # fmt: skip
