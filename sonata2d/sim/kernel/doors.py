"""Interior doors: who opens them, and the motion of their leaves, which stop before people and robots.

A leaf moves at the beginning of a tick, to a place that keeps `_MARGIN` from all bodies where they are then, and rests
during the tick. So it never pushes anybody, and a body that walks into it meets a wall.
"""

from __future__ import annotations

import math
from typing import Any

from ...core.barrier_grid import set_barrier
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import unpack
from ...core.compiled.scalar import clipped, gap, half_line, length, line_gap, quantised, to_line
from ...core.doors import HALF_THICKNESS
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.leaves import (
    ANYONE,
    CLOSED_X,
    CLOSED_Y,
    HINGE_X,
    HINGE_Y,
    HOLD,
    IS_HINGED,
    OPENED_BY,
    REQUEST,
    STEP,
    WIDTH,
    leaf_end,
    set_leaves,
)
from ...core.portable_math import Array
from .chipmunk import move_leaf
from .rules import ROBOT_RADIUS, TICK
from .step import Buffers, robot_at

# Ranges in m from the closed leaf to the centre of a body; our estimates, as standards leave them to the maker.
_SENSOR = 1.5  # of the sensor of an automatic door
_BY_HAND = 1.2  # at which people who face a door open it, and robots ask for it
_IN_DOORWAY = 0.6  # within which people and robots keep a door open that is not closed
_FACING = 0.5  # cosine of the angle between a person's heading and the direction to the door, at least
_STANDING_SPEED, _ASKING_TIME = 0.1, 1.0  # m/s and s, of a robot that asks for a door
_MARGIN = 0.05  # m, that a moving leaf keeps from bodies
_PATIENCE = 2.0  # s, after which a hinged leaf that is blocked tries the other side

TARGET, HELD, _BLOCKED, _ASKED = range(4)  # columns of `Doors.memory`: an opening, and times, s


@kernel
def move_doors(packed_world: Any) -> None:
    """Move the leaves of all doors by one tick.

    Args:
        packed_world: packed `Buffers` of the first robot; openings, leaves and barriers are updated.
    """
    world = unpack(packed_world, Buffers)
    doors, dt = world.doors, world.rules[TICK]
    for d in range(len(doors.frames)):
        memory, opening = doors.memory[d], doors.openings[d]
        side = _side_of_opener(world, d)
        if side != 0.0:
            memory[HELD] = doors.frames[d, HOLD]
            if memory[TARGET] == 0.0:
                memory[TARGET] = 1.0
                if doors.frames[d, IS_HINGED] != 0.0:
                    memory[TARGET] = -side if opening == 0.0 else math.copysign(1.0, opening)
        else:
            memory[HELD] -= dt
            if memory[HELD] <= 0.0:
                memory[TARGET] = 0.0
        step = doors.frames[d, STEP]
        wanted = quantised(opening + clipped(memory[TARGET] - opening, -step, step))
        if wanted == opening:
            memory[_BLOCKED] = 0.0
        elif _is_free(world, d, wanted):
            doors.openings[d], memory[_BLOCKED] = wanted, 0.0
        else:
            memory[_BLOCKED] += dt
            if memory[_BLOCKED] > _PATIENCE and doors.frames[d, IS_HINGED] != 0.0:
                memory[TARGET], memory[_BLOCKED] = -memory[TARGET], 0.0
    _place_leaves(world)


@kernel
def place_leaves(packed_world: Any) -> None:
    """Place the leaves of the packed `Buffers` according to their openings, at the start."""
    _place_leaves(unpack(packed_world, Buffers))


@subroutine
def _place_leaves(world: Buffers) -> None:
    doors = world.doors
    set_leaves(world.solids.table, doors.frames, doors.openings)
    for d in range(len(doors.frames)):
        x, y = leaf_end(doors.frames, d, doors.openings[d])
        move_leaf(world.engine, doors.shapes[d], doors.frames[d, HINGE_X], doors.frames[d, HINGE_Y], x, y)


@subroutine
def _side_of_opener(world: Buffers, d: int) -> float:
    """Where somebody is who opens a door, or keeps it open: 1 to the left of the closed leaf, -1 to the right; else 0.

    Of several the nearest one counts.
    """
    doors, humans, nearest, side = world.doors, world.humans, math.inf, 0.0
    memory, opened_by, is_ajar = doors.memory[d], doors.frames[d, OPENED_BY], doors.openings[d] != 0.0
    for k in range(len(humans)):
        if world.attendance.is_absent[k]:
            continue
        dx, dy, left = _to_doorway(doors.frames, d, humans[k, X], humans[k, Y])
        distance = length(dx, dy)
        opens = distance < _SENSOR
        if opened_by != ANYONE:
            ahead = humans[k, BODY_X] * dx + humans[k, BODY_Y] * dy
            opens = distance < _BY_HAND and ahead > _FACING * distance
        if distance < nearest and (opens or (is_ajar and distance < _IN_DOORWAY)):
            nearest, side = distance, left
    asks = False
    for r in range(len(world.robots)):
        own = robot_at(world, r)
        robot, radius = own.robot, own.rules[ROBOT_RADIUS]
        dx, dy, left = _to_doorway(doors.frames, d, robot[X], robot[Y])
        distance = length(dx, dy) - radius
        is_standing = length(robot[VX], robot[VY]) < _STANDING_SPEED
        asks = asks or (opened_by == REQUEST and is_standing and distance < _BY_HAND)
        opens = distance < _SENSOR
        if opened_by != ANYONE:
            has_asked = memory[_ASKED] > _ASKING_TIME - 0.5 * world.rules[TICK]
            opens = opened_by == REQUEST and distance < _BY_HAND and has_asked
        if distance < nearest and (opens or (is_ajar and distance < _IN_DOORWAY)):
            nearest, side = distance, left
    memory[_ASKED] = memory[_ASKED] + world.rules[TICK] if asks else 0.0
    return side


@subroutine
def _to_doorway(frames: Array, d: int, x: float, y: float) -> tuple[float, float, float]:
    """Vector from a point to the nearest point of the closed leaf of door d, m; and the side of the point, 1 or -1."""
    ux, uy, width = frames[d, CLOSED_X], frames[d, CLOSED_Y], frames[d, WIDTH]
    px, py = x - frames[d, HINGE_X], y - frames[d, HINGE_Y]
    dx, dy = to_line(px, py, ux * width, uy * width, 1.0 / (width * width))
    return dx, dy, 1.0 if ux * py - uy * px >= 0.0 else -1.0


@subroutine
def _is_free(world: Buffers, d: int, opening: float) -> bool:
    """Whether the leaf of door d can move to an opening: it does not come nearer to bodies that are too near."""
    doors, humans, guard, candidate = world.doors, world.humans, world.guard, world.doors.candidate
    table, row = world.solids.table, len(world.solids.table) - len(doors.frames) + d
    end_x, end_y = leaf_end(doors.frames, d, opening)
    set_barrier(candidate, 0, doors.frames[d, HINGE_X], doors.frames[d, HINGE_Y], end_x, end_y, HALF_THICKNESS)
    for k in range(len(humans)):
        if world.attendance.is_absent[k]:
            continue
        x, y = humans[k, X], humans[k, Y]
        dx, dy = half_line(humans[k, BODY_X], humans[k, BODY_Y], guard.shoulder[k])
        room = line_gap(candidate, 0, x + dx, y + dy, x - dx, y - dy) - guard.radius[k]
        if room < _MARGIN and room < line_gap(table, row, x + dx, y + dy, x - dx, y - dy) - guard.radius[k]:
            return False
    for r in range(len(world.robots)):
        own = robot_at(world, r)
        x, y = own.robot[X], own.robot[Y]
        room = gap(candidate, 0, x, y) - own.rules[ROBOT_RADIUS]
        if room < _MARGIN and room < gap(table, row, x, y) - own.rules[ROBOT_RADIUS]:
            return False
    return True
