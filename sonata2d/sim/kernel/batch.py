"""Ticks of many worlds in one call."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ...agents.pedestrians.crowd_state import CrowdState
from ...core.at_goal import is_at_goal
from ...core.bounds import MAX_MAGNITUDE
from ...core.compiled.calls import call, call_for_int
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Bools, Floats, Ints, packed_at, unpack
from ...core.compiled.scalar import length, quantised, to_shoulder_line
from ...core.humans import ACTIVITY_ALONE, BODY_X, BODY_Y, X, Y
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.separation import DISTANCE
from .rules import ROBOT_RADIUS
from .step import Buffers
from .tick import DONE, SEATS

NO_COMMAND, OVER = 3, 4  # what `run_member` returns, besides what a tick needs

RUNNING, GOAL, CONTACT, TIMEOUT = range(4)  # outcomes
# Columns of `Member.measured`: gaps and distances in m; contacts of the last tick are 0 or 1.
GOAL_DISTANCE, CLEARANCE, WITH_HUMAN, WITH_OBJECT, WITH_WALL = range(5)
MEASURED_SIZE = 5


class Member(NamedTuple):
    """One world of many.

    Attributes:
        world, crowd, calls: packed `Buffers`, `CrowdState` and `TickCalls`.
        run_tick: address of the kernel.
        write: address of a kernel that writes an observation; zeros for none.
        sight: its packed `Sight`.
        row: of the `State`.
        activity: (N,) of int, scratch.
        is_present: (N,) of bool, scratch.
        is_wall: (M,) of bool, for each barrier whether it belongs to a wall or a door and not to an object.
        goal: (5,), see `core.at_goal`.
        ends_on: (2,) of bool, whether goal and contacts end an episode.
        clock: (2,) of int, ticks so far, and the last one.
        outcome: (1,) of int.
        measured: (5,), see above.
    """

    world: Ints
    crowd: Ints
    calls: Ints
    run_tick: Ints
    write: Ints
    sight: Ints
    row: Floats
    activity: Ints
    is_present: Bools
    is_wall: Bools
    goal: Floats
    ends_on: Bools
    clock: Ints
    outcome: Ints
    measured: Floats


@kernel
def step_member(packed_member: Any, vx: float, vy: float, omega: float, need: int) -> int:
    """Move a world by one tick, and observe it.

    Args:
        packed_member: packed `Member`.
        vx, vy, omega: command of the robot, body frame, m/s and rad/s.
        need: `DONE`, or what the last call returned.

    Returns:
        What the world needs to go on, see `run_tick`.
    """
    return _step(unpack(packed_member, Member), vx, vy, omega, need)


@kernel
def step_members(
    addresses: IntArray, commands: Array, is_skipped: BoolArray, needs: IntArray, first: int, end: int
) -> int:
    """`step_member` of many worlds.

    Args:
        addresses: (B,), of packed `Member`.
        commands: (B, 3), of the robots.
        is_skipped: (B,) of bool, worlds that stay as they are.
        needs: (B,) of int, is updated.
        first, end: the worlds from the first one to before the end.

    Returns:
        Number of worlds that need something.
    """
    waiting = 0
    for w in range(first, end):
        if not is_skipped[w]:
            member = unpack(packed_at(addresses[w]), Member)
            needs[w] = _step(member, commands[w, 0], commands[w, 1], commands[w, 2], needs[w])
            waiting += needs[w] != DONE
    return waiting


@kernel
def run_member(
    packed_member: Any, act: IntArray, memory: Any, rows: Array, commands: Array, count: IntArray, need: int
) -> int:
    """Move a world under a compiled controller until the interpreter is needed, and record its ticks.

    Args:
        packed_member: packed `Member`.
        act: address of a `KernelController.kernel`.
        memory: of the controller, packed.
        rows: (T, 13 + 9 N), `State.row` of each tick; is filled.
        commands: (T, 3), is filled.
        count: (2,), number of ticks in `rows`, which is updated, and `Company.version` in their first one.
        need: `DONE`, or what the last call returned.

    Returns:
        What the world needs to go on, see `run_tick`. `DONE`: the rows are full, or activities, interactions, contacts
        or people present may have changed. `NO_COMMAND`: the controller's command has to be asked for again, since a
        file cannot hold it. `OVER`: the episode is over.
    """
    member = unpack(packed_member, Member)
    world, crowd = unpack(member.world, Buffers), unpack(member.crowd, CrowdState)
    had_contact = world.guard.counts[2] != 0
    while count[0] < len(rows):
        n = count[0]
        if need == DONE:
            for column in range(len(member.row)):
                rows[n, column] = member.row[column]
            for k in range(len(member.is_present)):
                member.is_present[k] = not world.attendance.is_absent[k]
            call(act, (memory, member.clock[0], world.robot, world.humans, member.is_present, commands[n]))
            for axis in range(3):
                if not abs(commands[n, axis]) <= MAX_MAGNITUDE:
                    return NO_COMMAND
                commands[n, axis] = quantised(commands[n, axis])
        need = _step(member, commands[n, 0], commands[n, 1], commands[n, 2], need)
        if need != DONE:
            return need
        count[0] += 1
        if member.outcome[0] != RUNNING:
            return OVER
        has_contact = world.guard.counts[2] != 0
        if has_contact or had_contact or crowd.company.version[0] != count[1] or world.attendance.is_changed[0]:
            return DONE
    return DONE


@subroutine
def _step(member: Member, vx: float, vy: float, omega: float, need: int) -> int:
    number = member.clock[0]
    need = call_for_int(
        member.run_tick, (member.world, member.crowd, member.calls, number, vx, vy, omega, need == SEATS)
    )
    if need == DONE:
        member.clock[0] += 1
        _observe(member)
    return need


@kernel
def observe_member(packed_member: Any) -> None:
    """Measure and observe a world at the beginning of an episode."""
    _observe(unpack(packed_member, Member))


@subroutine
def _observe(member: Member) -> None:
    world, crowd = unpack(member.world, Buffers), unpack(member.crowd, CrowdState)
    _measure(member, world)
    member.outcome[0] = _outcome(member, world)
    if member.write[0] != 0:
        time = min(member.clock[0] / max(member.clock[1], 1), 1.0)
        _set_activities(member, world, crowd)
        call(
            member.write,
            (member.sight, member.row, member.is_present, member.activity, crowd.company.links,
             crowd.company.link_count[0], time),
        )  # fmt: skip


@subroutine
def gap_to_person(robot: Array, humans: Array, k: int, radius: float, shoulder: float) -> float:
    """Gap between the centre of the robot and pedestrian k, m; rows of `core.state` and `core.humans`."""
    dx, dy = humans[k, X] - robot[X], humans[k, Y] - robot[Y]
    dx, dy = to_shoulder_line(dx, dy, humans[k, BODY_X], humans[k, BODY_Y], shoulder)
    gap: float = length(dx, dy) - radius
    return gap


@subroutine
def _measure(member: Member, world: Buffers) -> None:
    """Distances and contacts."""
    robot, humans, guard, measured = world.robot, world.humans, world.guard, member.measured
    nearest = math.inf
    for k in range(len(humans)):
        if not world.attendance.is_absent[k]:
            gap = gap_to_person(robot, humans, k, guard.radius[k], guard.shoulder[k]) - world.rules[ROBOT_RADIUS]
            if len(world.body.core) > 1:
                person = humans[k, X], humans[k, Y], humans[k, BODY_X], humans[k, BODY_Y], guard.shoulder[k]
                call(world.gap_at, (world, *person))
                gap = world.body.found[DISTANCE] - world.body.rounding - guard.radius[k]
            nearest = min(nearest, gap)
    measured[GOAL_DISTANCE] = length(member.goal[0] - robot[X], member.goal[1] - robot[Y])
    measured[CLEARANCE] = nearest
    measured[WITH_HUMAN] = measured[WITH_OBJECT] = measured[WITH_WALL] = 0.0
    if guard.counts[2] != 0:
        for k in range(len(humans)):
            if guard.human_contact[k] != 0:
                measured[WITH_HUMAN] = 1.0
        for k in range(len(member.is_wall)):
            if guard.barrier_contact[k] != 0:
                measured[WITH_WALL if member.is_wall[k] else WITH_OBJECT] = 1.0


@subroutine
def _outcome(member: Member, world: Buffers) -> int:
    """As `sim.outcomes.outcome_at`."""
    if member.ends_on[0] and is_at_goal(member.goal, world.robot):
        return GOAL
    if member.ends_on[1] and world.guard.counts[2] != 0:
        return CONTACT
    return TIMEOUT if member.clock[0] >= member.clock[1] else RUNNING


@subroutine
def _set_activities(member: Member, world: Buffers, crowd: CrowdState) -> None:
    """Fill `activity` and `is_present`; while somebody is absent, people without a present partner are alone."""
    company, is_absent, any_absent = crowd.company, world.attendance.is_absent, False
    for k in range(len(is_absent)):
        member.is_present[k] = not is_absent[k]
        member.activity[k] = company.activity[k]
        any_absent |= is_absent[k]
    if not any_absent:
        return
    for k in range(len(is_absent)):
        is_alone = True
        for n in range(company.link_count[0]):
            source, destination = company.links[n, 0], company.links[n, 1]
            is_there = not is_absent[source] and (destination >= len(is_absent) or not is_absent[destination])
            if is_there and k in (source, destination):
                is_alone = False
        if is_alone:
            member.activity[k] = ACTIVITY_ALONE[company.activity[k]]
