"""One tick of the world: the robot's drive, the physics substeps under the safety guard, and posture."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ...core.compiled import kernel, subroutine
from ...core.humans import BODY_X, BODY_Y, OMEGA, VX, VY, X, Y
from ...core.packing import Bools, Floats, Floats2, unpack
from ...core.portable_math import Array
from ...core.scalar import clipped, rotation
from ...core.state import EXECUTED_OMEGA, EXECUTED_VX, EXECUTED_VY, GUARDED
from .chipmunk import Engine, apply_forces, read_bodies, step_space, turn_torso
from .posture import turn
from .rules import (
    ACCELERATION,
    AHEAD,
    BACK,
    HOLONOMIC,
    SIDE,
    SIDEWAYS,
    SUBSTEP,
    SUBSTEPS,
    TICK,
    TURN,
    TURN_ACCELERATION,
)
from .safety import Guard, find_near, limited

MASS = 75.0  # kg, of a pedestrian and of the robot; only mass ratios matter

# Items of the scratch array `drive`: the twist of the drive in this tick (body frame), the sums of the executed
# velocities (body frame), and cosine and sine of the turn in a substep.
_VX, _VY, _OMEGA, _SUM_X, _SUM_Y, _COS, _SIN = range(7)
DRIVE_SIZE = 7


@subroutine
def _reachable_twist(vx: float, vy: float, omega: float, robot: Array, rules: Array) -> tuple[float, float, float]:
    """The twist nearest to a command that the robot's drive can reach within a tick; body frame, m/s and rad/s.

    Args:
        vx, vy, omega: command.
        robot: columns of `core.state`. The drive starts from the twist that it executed in the last tick, which does
            not contain displacements by contacts.
        rules: see `rules`. A unicycle has no sideways velocity.
    """
    now_x, now_y, now_omega = robot[EXECUTED_VX], robot[EXECUTED_VY], robot[EXECUTED_OMEGA]
    if rules[HOLONOMIC] == 0.0:
        vy = now_y = 0.0
    vx, vy = clipped(vx, -rules[BACK], rules[AHEAD]), clipped(vy, -rules[SIDEWAYS], rules[SIDEWAYS])
    omega = clipped(omega, -rules[TURN], rules[TURN])
    dx, dy, maximum = vx - now_x, vy - now_y, rules[ACCELERATION] * rules[TICK]
    change = math.sqrt(dx * dx + dy * dy)
    if change > maximum:
        vx, vy = now_x + dx * (maximum / change), now_y + dy * (maximum / change)
    turn_limit = rules[TURN_ACCELERATION] * rules[TICK]
    return vx, vy, now_omega + clipped(omega - now_omega, -turn_limit, turn_limit)


class Matter(NamedTuple):
    """All that moves, and what stops it.

    Attributes:
        engine: bodies, the robot last.
        guard: of the safety guard.
        robot: (13,), columns of `core.state`.
        humans: (N, 9), columns of `core.humans`.
        posture: (N, 3), see `posture`.
        drive: (7,), scratch, kept between the parts of a tick.
        rules: see `rules`.
        barriers: rows of `Barriers.table`.
        acceleration: (N, 2), m/s^2, of the pedestrians.
        is_absent: (N,), pedestrians without forces.
        facing, gaze: (N, 2), unit vectors of the desired headings and gazes.
    """

    engine: Engine
    guard: Guard
    robot: Floats
    humans: Floats2
    posture: Floats2
    drive: Floats
    rules: Floats
    barriers: Floats2
    acceleration: Floats2
    is_absent: Bools
    facing: Floats2
    gaze: Floats2


@kernel
def advance(
    packed_world: Any,
    vx: float,
    vy: float,
    omega: float,
    is_limited: bool,
    first: int,
    end: int,
) -> None:
    """Move the world from one substep of a tick to another.

    Args:
        packed_world: packed `Matter`. The robot is updated, the pedestrians only after the last substep of the tick.
        vx, vy, omega: twist of the robot's drive, body frame, m/s and rad/s.
        is_limited: whether to limit it to what the drive can reach within the tick.
        first, end: the substeps from the first one to before the end.
    """
    matter = unpack(packed_world, Matter)
    engine, guard, robot, humans, drive = matter.engine, matter.guard, matter.robot, matter.humans, matter.drive
    rules, barriers = matter.rules, matter.barriers
    count, h = humans.shape[0], rules[SUBSTEP]
    if first == 0:
        if is_limited:
            vx, vy, omega = _reachable_twist(vx, vy, omega, robot, rules)
        drive[_VX], drive[_VY], drive[_OMEGA], drive[_SUM_X], drive[_SUM_Y] = vx, vy, omega, 0.0, 0.0
        drive[_COS], drive[_SIN] = rotation(omega * h)
        robot[GUARDED] = 0.0
        find_near(guard, engine.bodies, barriers, rules)
        for k in range(count):
            turn_torso(engine, k, humans[k, BODY_X], humans[k, BODY_Y])
    for k in range(count):
        for axis in range(2):
            engine.forces[k, axis] = 0.0 if matter.is_absent[k] else matter.acceleration[k, axis] * MASS
    for _ in range(first, end):
        c, s = robot[BODY_X], robot[BODY_Y]
        wanted_x, wanted_y = drive[_VX] * c - drive[_VY] * s, drive[_VX] * s + drive[_VY] * c
        world_x, world_y, is_reduced = limited(guard, wanted_x, wanted_y, engine.bodies, barriers, rules, h)
        if is_reduced:
            robot[GUARDED] = 1.0
        engine.forces[count, 0] = (world_x - engine.bodies[count, VX]) * (MASS / h)
        engine.forces[count, 1] = (world_y - engine.bodies[count, VY]) * (MASS / h)
        drive[_SUM_X] = drive[_SUM_X] + world_x * c + world_y * s
        drive[_SUM_Y] = drive[_SUM_Y] + world_y * c - world_x * s
        apply_forces(engine)
        step_space(engine, h)
        x, y = c * drive[_COS] - s * drive[_SIN], s * drive[_COS] + c * drive[_SIN]
        norm = math.sqrt(x * x + y * y)
        robot[BODY_X], robot[BODY_Y] = x / norm, y / norm
        read_bodies(engine)
    if end == int(rules[SUBSTEPS]):
        robot[EXECUTED_VX], robot[EXECUTED_VY] = drive[_SUM_X] / rules[SUBSTEPS], drive[_SUM_Y] / rules[SUBSTEPS]
        robot[EXECUTED_OMEGA] = robot[OMEGA] = drive[_OMEGA]
        copy_bodies(engine.bodies, robot, humans)
        for k in range(count):
            turn(humans, matter.posture, k, matter.facing, matter.gaze, rules[SIDE], rules[TICK])


@subroutine
def copy_bodies(bodies: Array, robot: Array, humans: Array) -> None:
    """Copy positions and velocities from the engine's rows, the robot last, to the state."""
    count = humans.shape[0]
    for k in range(count):
        humans[k, X], humans[k, Y], humans[k, VX], humans[k, VY] = (
            bodies[k, X],
            bodies[k, Y],
            bodies[k, VX],
            bodies[k, VY],
        )
    robot[X], robot[Y], robot[VX], robot[VY] = (
        bodies[count, X],
        bodies[count, Y],
        bodies[count, VX],
        bodies[count, VY],
    )


@kernel
def read_state(packed_world: Any) -> None:
    """Read positions and velocities of all bodies of the packed `Matter` from the engine into its state."""
    matter = unpack(packed_world, Matter)
    read_bodies(matter.engine)
    copy_bodies(matter.engine.bodies, matter.robot, matter.humans)
