"""A tick of the whole world, people and physics, as one kernel."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...agents.pedestrians.crowd_state import CrowdState
from ...core.compiled.calls import FLAG, FLAGS, FLOAT, INT, PACKED, address_of, call, call_for_flag
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Ints, unpack
from ...core.portable_math import IntArray
from ...core.scene import Scene
from .rules import SUBSTEPS
from .step import Buffers, advance, enter_and_leave, robot_at, track

DONE, LONGER_LISTS, SEATS = range(3)  # what a tick needs to go on


class TickCalls(NamedTuple):
    """Addresses of the kernels of the physics."""

    track: Ints
    advance: Ints
    enter_and_leave: Ints


def may_change(scene: Scene) -> bool:
    """Whether pedestrians can enter or leave."""
    return bool(scene.doors) or any(h.enters > 0 or h.leaves is not None or h.exits for h in scene.humans)


def tick_calls(scene: Scene) -> TickCalls:
    """The addresses of the kernels of the physics that a scene needs: others are not compiled, and have zeros."""
    humans, nothing = scene.humans, np.zeros(2, dtype=np.int64)
    has_tracks = any(human.track for human in humans)
    return TickCalls(
        track=address_of(track, PACKED, INT) if has_tracks else nothing,
        advance=address_of(advance, PACKED, FLOAT, FLOAT, FLOAT, FLAG, INT, INT),
        enter_and_leave=address_of(enter_and_leave, PACKED, INT, FLAGS, FLAGS) if may_change(scene) else nothing,
    )


@kernel
def run_tick(
    packed_world: Any, packed_crowd: Any, packed_calls: Any, number: int, vx: float, vy: float, omega: float,
    is_decided: bool,
) -> int:  # fmt: skip
    """Move the world by one tick.

    Args:
        packed_world, packed_crowd, packed_calls: packed `Buffers`, `CrowdState` and `TickCalls`.
        number: of the tick.
        vx, vy, omega: command of the first robot, body frame, m/s and rad/s; as those of other robots, which are in
            `Buffers.commands`, it is limited to what the drive can reach.
        is_decided: go on with a tick that returned `SEATS`.

    Returns:
        `DONE`; `LONGER_LISTS`: nothing has changed, see `CrowdState.needed`; `SEATS`: pedestrians have decided to sit
        down or have got up, and the filters of their shapes have to be set before the tick can go on.
    """
    world, crowd = unpack(packed_world, Buffers), unpack(packed_crowd, CrowdState)
    calls = unpack(packed_calls, TickCalls)
    if not is_decided:
        _note_presence(world, crowd)
        for r in range(len(world.robots)):
            crowd.robots.state[r] = robot_at(world, r).robot
        for d in range(len(world.doors.openings)):
            crowd.doorways.openings[d] = world.doors.openings[d]
        if not call_for_flag(crowd.calls.prepare, (crowd, number, world.humans)):
            return LONGER_LISTS
        call(crowd.calls.accelerate, (crowd,))
        for k in range(len(world.sits_on)):
            if world.sits_on[k] != crowd.tasks.sits_on[k]:
                return SEATS
    intentions, substeps = crowd.intentions, int(world.rules[SUBSTEPS])
    for k in range(len(world.sits_on)):
        for axis in range(2):
            world.facing[k, axis], world.gaze[k, axis] = intentions.facing[k, axis], intentions.gaze[k, axis]
    if len(world.attendance.track) > 0:
        call(calls.track, (world, number))
    interval = max(substeps // crowd.law.evaluations, 1)
    for first in range(0, substeps, interval):
        if first > 0:
            call(crowd.calls.refresh, (crowd, world.engine.bodies))
        for k in range(len(world.sits_on)):
            for axis in range(2):
                world.acceleration[k, axis] = intentions.acceleration[k, axis]
        call(calls.advance, (world, vx, vy, omega, True, first, min(first + interval, substeps)))
    if _may_change(world, crowd):
        call_for_flag(calls.enter_and_leave, (world, number + 1, crowd.routes.is_leaving, crowd.tasks.is_leaving))
    return DONE


@subroutine
def _note_presence(world: Buffers, crowd: CrowdState) -> None:
    """Copy the presence of the pedestrians into the state of the crowd."""
    if world.attendance.is_changed[0]:
        for k in range(len(crowd.is_present)):
            crowd.is_present[k] = not world.attendance.is_absent[k]
        call(crowd.calls.update_partners, (crowd,))


@subroutine
def _may_change(world: Buffers, crowd: CrowdState) -> bool:
    """Whether pedestrians can enter or leave at the end of the tick."""
    world.attendance.is_changed[0] = False
    if world.attendance.is_changed[1]:
        return True
    for k in range(len(crowd.is_present)):
        if crowd.routes.is_leaving[k] or crowd.tasks.is_leaving[k]:
            return True
    return False


def run_tick_address() -> IntArray:
    """The address of `run_tick`."""
    return address_of(run_tick, PACKED, PACKED, PACKED, INT, FLOAT, FLOAT, FLOAT, FLAG)
