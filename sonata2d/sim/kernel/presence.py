"""Pedestrians that enter and leave, and recorded ones that follow their tracks.

The physics space keeps the same bodies from start to end. An absent pedestrian is parked far outside the room, at a
place of its own; it feels no force and is in no snapshot.

A recorded pedestrian has a kinematic body: forces do not move it, it passes through walls, the robot and other recorded
pedestrians, and it pushes aside all other pedestrians. Its velocity is set once per tick such that it is on its track
at every tick, up to rounding in the last digit.
"""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Ints
from ...core.compiled.scalar import length
from ...core.humans import X, Y
from ...core.portable_math import Array, BoolArray
from ...core.scene import Scene
from .chipmunk import Engine, place

ENTRY_OVERLAP = 0.04  # m, of the circles around two bodies: with a larger one, the pedestrian that enters waits
ENTRY_GAP = 0.05  # m, gap that a wandering pedestrian, as those that come through doors, waits for
_NEVER = -1


class Attendance(NamedTuple):
    """Presence of N pedestrians in the room, and the ticks at which they enter and leave.

    Attributes:
        is_absent: (N,) of bool.
        is_changed: (2,) of bool: whether a pedestrian has entered or left, and whether one ever can by its schedule.
        waits: (N,) of bool: pedestrians that have not entered yet.
        enters, leaves: (N,) of int, ticks; -1 for never.
        start: (N, 6), position, velocity and direction of the heading when a pedestrian enters.
        parking: (N, 2), places of the absent, m.
        radius: (N + R,), m, of the circles around the bodies, those of the robots last.
        minimum: (N,), m, least gap of these circles when a pedestrian enters.
        party: (N,) of int; pedestrians with the same number enter only if there is room for all; -1 for alone.
        track_start: (N + 1,) of int, first place of each pedestrian in `track`; the number of places last.
        track: (K, 2), m, a place for each tick from entering on.
    """

    is_absent: Bools
    is_changed: Bools
    waits: Bools
    enters: Ints
    leaves: Ints
    start: Floats2
    parking: Floats2
    radius: Floats
    minimum: Floats
    party: Ints
    track_start: Ints
    track: Floats2


def attendance_of(scene: Scene) -> Attendance:
    """Attendance at the start, before `begin_attendance`.

    Raises:
        ValueError: a recorded pedestrian has no track.
    """
    humans, count = scene.humans, len(scene.humans)
    tracks = [human.track if human.behaviour == "recorded" else () for human in humans]
    for human, track in zip(humans, tracks, strict=True):
        if human.behaviour == "recorded" and not track:
            raise ValueError(f"human {human.id} is recorded, but has no track; give a position for each tick")
    parties: dict[tuple[int, int], int] = {}
    return Attendance(
        is_absent=np.zeros(count, dtype=bool),
        is_changed=np.array([False, any(h.enters > 0 or h.leaves is not None for h in humans)]),
        waits=np.array([human.enters > 0 for human in humans], dtype=bool),
        enters=np.array([human.enters for human in humans], dtype=np.int64),
        leaves=np.array([_NEVER if h.leaves is None else h.leaves for h in humans], dtype=np.int64),
        start=np.array([(*h.pose.position, *h.velocity, *h.pose.direction) for h in humans]).reshape(count, 6),
        parking=np.array(scene.parking, dtype=float).reshape(count, 2),
        radius=np.array([*scene.human_table.circumradius, *(robot.radius for robot, _ in scene.tasks)]),
        minimum=np.array([ENTRY_GAP if h.behaviour == "wandering" else -ENTRY_OVERLAP for h in humans]),
        party=np.array(
            [
                parties.setdefault((h.group, h.enters), len(parties))
                if h.group is not None and h.enters > 0 and h.behaviour == "wandering"
                else _NEVER
                for h in humans
            ],
            dtype=np.int64,
        ),
        track_start=np.array([*accumulate(map(len, tracks), initial=0)], dtype=np.int64),
        track=np.array([point for track in tracks for point in track], dtype=float).reshape(-1, 2),
    )


@subroutine
def is_recorded(own: Attendance, k: int) -> bool:
    """Whether pedestrian k follows a track."""
    return bool(own.track_start[k + 1] > own.track_start[k])


@subroutine
def _track_position(own: Attendance, k: int, tick: int) -> tuple[float, float]:
    """Position of a recorded pedestrian at a tick, m; its first or last one outside the track."""
    size = own.track_start[k + 1] - own.track_start[k]
    n = own.track_start[k] + min(max(tick - own.enters[k], 0), size - 1)
    return own.track[n, 0], own.track[n, 1]


@subroutine
def follow_tracks(own: Attendance, engine: Engine, tick: int, dt: float) -> None:
    """Set the velocities of recorded pedestrians that lead to their places at the next tick."""
    for k in range(len(own.is_absent)):
        if is_recorded(own, k) and not own.is_absent[k]:
            x, y = engine.bodies[k, X], engine.bodies[k, Y]
            next_x, next_y = _track_position(own, k, tick + 1)
            place(engine, k, x, y, (next_x - x) / dt, (next_y - y) / dt)


@subroutine
def begin_attendance(own: Attendance, engine: Engine, dt: float) -> None:
    """Place the recorded pedestrians on their tracks, and park those that enter later."""
    for k in range(len(own.is_absent)):
        if own.waits[k]:
            own.is_changed[0] = True
            _park(own, engine, k)
        elif is_recorded(own, k):
            _place(own, engine, k, own.enters[k], dt)


@subroutine
def update_attendance(
    own: Attendance, engine: Engine, tick: int, dt: float, is_leaving: BoolArray, is_own_choice: BoolArray
) -> bool:
    """Let pedestrians leave and enter at the start of a tick; whether any did.

    Args:
        own: is updated.
        engine: `Engine.bodies` are those after the last tick; bodies and rows of those that move are updated.
        tick: that starts.
        dt: s.
        is_leaving, is_own_choice: (N,), pedestrians that have reached the goal, or the door, at which they leave.
    """
    own.is_changed[0] = False
    # Pedestrians leave first, because they may make room for others that enter at the same place.
    for k in range(len(own.is_absent)):
        is_due = own.leaves[k] != _NEVER and tick >= own.leaves[k]
        if not own.is_absent[k] and (is_due or is_leaving[k] or is_own_choice[k]):
            _park(own, engine, k)
            own.is_changed[0] = True
    for k in range(len(own.is_absent)):
        if own.waits[k] and _may_enter(own, k, tick, engine.bodies):
            _place(own, engine, k, tick, dt)
            own.waits[k] = False
            own.is_changed[0] = True
    return bool(own.is_changed[0])


@subroutine
def _may_enter(own: Attendance, k: int, tick: int, rows: Array) -> bool:
    """Whether a pedestrian is due, and there is room for it and for those that enter together with it."""
    # A pedestrian that finds no room until it should have left never appears; tracks are followed in any case.
    if tick < own.enters[k] or (own.leaves[k] != _NEVER and tick >= own.leaves[k]):
        return False
    if is_recorded(own, k):
        return True
    for other in range(len(own.is_absent)):
        is_of_party = other == k or (own.party[k] != _NEVER and own.party[other] == own.party[k])
        if is_of_party and own.is_absent[other] and not _has_room(own, other, rows):
            return False
    return True


@subroutine
def _has_room(own: Attendance, k: int, rows: Array) -> bool:
    """Whether there is space for a pedestrian that enters, however it and the others turn."""
    for j in range(len(rows)):
        if j >= len(own.is_absent) or not own.is_absent[j]:
            gap = length(rows[j, X] - own.start[k, 0], rows[j, Y] - own.start[k, 1]) - own.radius[j] - own.radius[k]
            if not gap > own.minimum[k]:
                return False
    return True


@subroutine
def _place(own: Attendance, engine: Engine, k: int, tick: int, dt: float) -> None:
    """Place a pedestrian in the room: at its initial pose, or on its track."""
    own.is_absent[k] = False
    x, y, vx, vy = own.start[k, 0], own.start[k, 1], own.start[k, 2], own.start[k, 3]
    if is_recorded(own, k):
        x, y = _track_position(own, k, tick)
        next_x, next_y = _track_position(own, k, tick + 1)
        vx, vy = (next_x - x) / dt, (next_y - y) / dt
    _move(engine, k, x, y, vx, vy)


@subroutine
def _park(own: Attendance, engine: Engine, k: int) -> None:
    own.is_absent[k] = True
    _move(engine, k, own.parking[k, 0], own.parking[k, 1], 0.0, 0.0)


@subroutine
def _move(engine: Engine, k: int, x: float, y: float, vx: float, vy: float) -> None:
    """Move a body, and its row: pedestrians that enter later in the same tick keep off this one."""
    place(engine, k, x, y, vx, vy)
    row = engine.bodies[k]
    row[0], row[1], row[2], row[3] = x, y, vx, vy
