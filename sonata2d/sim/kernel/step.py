"""One tick of the world: the robots' drives, the physics substeps under the safety guard, and posture."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...agents.drives.base import DriveState
from ...core.barrier_grid import Solids, outline_gap
from ...core.compiled.calls import call
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Bools, Floats, Floats2, Ints, packed_at, unpack
from ...core.compiled.scalar import Vector, clipped, length, rotation, shoulder_line_distance, to_shoulder_line
from ...core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ...core.leaves import Doors
from ...core.portable_math import Array, BoolArray
from ...core.separation import DISTANCE
from ...core.state import EXECUTED_OMEGA, EXECUTED_VX, EXECUTED_VY, GUARDED
from .body import Body
from .chipmunk import Engine, apply_forces, place, read_bodies, step_space, turn_outline, turn_torso
from .posture import BODY_RATE, NECK, NECK_RATE, turn
from .presence import Attendance, begin_attendance, follow_tracks, update_attendance
from .rules import COUPLED, GUARD, HOLONOMIC, ROBOT_RADIUS, SIDE, SUBSTEP, SUBSTEPS, TICK
from .safety import Guard, find_near, limited

_FASTEST = 1e6  # m/s and rad/s, beyond which a drive is broken
MASS = 75.0  # kg, of a pedestrian
ROLLING_ACCELERATION = 1.5  # m/s^2, of pedestrians that cannot move sideways, along their headings; our estimate
TOUCHING = 0.01  # m, gap of outlines below which they press against each other
MAXIMUM_DEPTH = 0.005  # m, of overlap that a pressed body causes by turning
_BESIDE = 0.5  # m, gap of a wall beside a person that turns; those farther away leave room
STUCK_DEPTH = 0.02  # m, of a torso in a solid, which the engine moves out where there is room
ROBOT_MASS = 1e6  # kg; so large that contacts do not move the robot, and their impulse can still be read

# Items of the scratch array `drive`: the twist of the drive in this tick (body frame), the sums of the executed
# velocities (body frame), cosine and sine of half the turn in a substep, the velocity that the contacts of the last
# substep would have taken from a body of a pedestrian's mass (world frame), and the sum of the executed turn rates.
_VX, _VY, _OMEGA, _SUM_X, _SUM_Y, _COS, _SIN, _LOST_X, _LOST_Y, _SUM_OMEGA = range(10)
DRIVE_SIZE = 10


class Buffers(NamedTuple):
    """Buffers of the world: bodies, safety guard, state, barriers and commands.

    Attributes:
        engine: bodies, those of the R robots last.
        guard: of the safety guard.
        robots: (R,) of int, addresses of the packed buffers of all robots of the scene, which share all that is not of
            a single robot; the first robot comes first.
        number: of the robot in `robots`.
        commands: (R, 3), twists of the drives, body frame, m/s and rad/s.
        robot: (13,), columns of `core.state`.
        humans: (N, 9), columns of `core.humans`.
        posture: (N, 3), see `posture`.
        motion: (4,), x, y, vx, vy, m and m/s, of the robot after the last substep.
        drive: (10,), scratch, kept between substeps.
        rules: see `rules`.
        reach: address of `Drive.kernel`.
        drive_state: see there.
        body: outline of the robot.
        limit_motion: address of `shaped.limit_motion`; zeros for a single disc whose drive turns by itself.
        gap_at: address of `shaped.gap_at`; zeros for a disc.
        solids: walls and furniture, then the leaves of doors.
        doors: that move.
        acceleration: (N, 2), m/s^2, of the pedestrians.
        attendance: presence of the pedestrians; absent ones feel no force.
        sits_on: (N,) of int, see `CrowdCommands.seats`.
        may_overlap: (N,), pedestrians that may be inside solids: recorded ones, and those on seats.
        maximum_speed: (N,), m/s, of the pedestrians.
        facing, gaze: (N, 2), unit vectors of the desired headings and gazes.
        rolling: (K,) of int, pedestrians that cannot move sideways.
    """

    engine: Engine
    guard: Guard
    robots: Ints
    number: int
    commands: Floats2
    robot: Floats
    humans: Floats2
    posture: Floats2
    motion: Floats
    drive: Floats
    rules: Floats
    reach: Ints
    drive_state: DriveState
    body: Body
    limit_motion: Ints
    gap_at: Ints
    solids: Solids
    doors: Doors
    acceleration: Floats2
    attendance: Attendance
    sits_on: Ints
    may_overlap: Bools
    maximum_speed: Floats
    facing: Floats2
    gaze: Floats2
    rolling: Ints


@kernel
def advance(packed_world: Any, vx: float, vy: float, omega: float, is_limited: bool, first: int, end: int) -> None:
    """Move the world from one substep of a tick to another.

    Robots move one after the other in a substep, so that each of them keeps off the others where they are.

    Args:
        packed_world: packed `Buffers`, with the commands of the other robots. The robots are updated, the pedestrians
            only after the last substep of the tick.
        vx, vy, omega: twist of the first robot's drive, body frame, m/s and rad/s.
        is_limited: whether to limit the twists to what the drives can reach within the tick.
        first, end: the substeps from the first one to before the end.
    """
    buffers = unpack(packed_world, Buffers)
    engine, robots, rules, count = buffers.engine, len(buffers.robots), buffers.rules, len(buffers.humans)
    h = rules[SUBSTEP]
    if first == 0:
        command = buffers.commands[0]
        command[0], command[1], command[2] = vx, vy, omega
        if len(buffers.doors.openings) > 0:
            call(buffers.doors.move, (buffers,))
        for r in range(robots):
            _begin_motion(robot_at(buffers, r), is_limited)
        _turn_bodies(buffers)
    for k in range(count):
        for axis in range(2):
            engine.forces[k, axis] = 0.0 if buffers.attendance.is_absent[k] else buffers.acceleration[k, axis] * MASS
    for substep in range(first, end):
        _turn_torsos(buffers, int(rules[SUBSTEPS]) - substep)
        for r in range(robots):
            _move_robot(robot_at(buffers, r), h)
        _roll(buffers)
        apply_forces(engine)
        step_space(engine, h)
        read_bodies(engine)
        _limit_speeds(buffers)
        for r in range(robots):
            _keep_robot(robot_at(buffers, r))
    if end == int(rules[SUBSTEPS]):
        for r in range(robots):
            _end_motion(robot_at(buffers, r))
        _roll(buffers)
        copy_bodies(buffers)


@subroutine
def robot_at(buffers: Buffers, r: int) -> Buffers:
    """The buffers of robot r."""
    own: Buffers = unpack(packed_at(buffers.robots[r]), Buffers)
    return own


@subroutine
def body_row(buffers: Buffers) -> int:
    """The row of the robot in `Engine.bodies`."""
    return len(buffers.humans) + buffers.number


@subroutine
def _begin_motion(buffers: Buffers, is_limited: bool) -> None:
    """Find what the drive of a robot does in a tick, and what can come near."""
    robot, drive, rules, command = buffers.robot, buffers.drive, buffers.rules, buffers.commands[buffers.number]
    drive[_VX], drive[_VY], drive[_OMEGA] = command[0], 0.0 if rules[HOLONOMIC] == 0.0 else command[1], command[2]
    if is_limited:
        state, now = buffers.drive_state, robot[EXECUTED_VX : EXECUTED_OMEGA + 1]
        call(buffers.reach, (state.parameters, state.limits, state.memory, now, drive[:3], rules[TICK]))
        if not (abs(drive[_VX]) < _FASTEST and abs(drive[_VY]) < _FASTEST and abs(drive[_OMEGA]) < _FASTEST):
            raise ValueError("the robot's drive executes a velocity that is not finite; check its parameters")
    drive[_SUM_X], drive[_SUM_Y], drive[_SUM_OMEGA] = 0.0, 0.0, 0.0
    drive[_COS], drive[_SIN] = rotation(drive[_OMEGA] * rules[SUBSTEP] * 0.5)
    robot[GUARDED] = 0.0
    find_near(buffers.guard, buffers.engine.bodies, body_row(buffers), buffers.solids, rules)


@subroutine
def _end_motion(buffers: Buffers) -> None:
    """Note what a robot has executed in a tick."""
    robot, drive, rules = buffers.robot, buffers.drive, buffers.rules
    robot[EXECUTED_VX], robot[EXECUTED_VY] = drive[_SUM_X] / rules[SUBSTEPS], drive[_SUM_Y] / rules[SUBSTEPS]
    robot[EXECUTED_OMEGA] = robot[OMEGA] = drive[_OMEGA]
    if _is_shaped(buffers):
        robot[EXECUTED_OMEGA], robot[OMEGA] = drive[_SUM_OMEGA] / rules[SUBSTEPS], buffers.body.motion[2]


@subroutine
def _turn_bodies(buffers: Buffers) -> None:
    """Turn bodies and heads by one tick. People that are pressed turn only their heads if they lack the room.

    The engine can move a torso that turns out of its neighbours, but not out of a place that is too narrow: between the
    robot and others or walls, or, as a torso shows that is still deep in a solid, between solids.
    """
    count, torso = len(buffers.humans), buffers.guard.torso
    pressed = np.zeros(count, np.bool_)
    for k in range(count):
        pressed[k] = _robot_gap(buffers, k) < TOUCHING
    for j in np.flatnonzero(pressed):  # those who touch the robot press others
        for k in range(count):
            if not pressed[k]:
                pressed[k] = _gap(buffers, k, int(j), torso[k, 0], torso[k, 1]) < TOUCHING
    for k in range(count):
        _turn_body(buffers, k, pressed[k] or _is_stuck(buffers, k))


@subroutine
def _turn_body(buffers: Buffers, k: int, is_pressed: bool) -> None:
    """Turn body and head of pedestrian k by one tick; only its head if it is pressed and lacks the room."""
    humans, posture, facing, rules = buffers.humans, buffers.posture, buffers.facing, buffers.rules
    x, y, neck_rate, neck = humans[k, BODY_X], humans[k, BODY_Y], posture[k, NECK_RATE], posture[k, NECK]
    turn(humans, posture, k, facing, buffers.gaze, rules[SIDE], rules[TICK])
    if not is_pressed:
        return
    depth = _depth(buffers, k, x, y)
    if _depth(buffers, k, humans[k, BODY_X], humans[k, BODY_Y]) > max(depth, MAXIMUM_DEPTH):
        humans[k, BODY_X], humans[k, BODY_Y], facing[k, 0], facing[k, 1] = x, y, x, y
        posture[k, BODY_RATE], posture[k, NECK_RATE], posture[k, NECK] = 0.0, neck_rate, neck
        turn(humans, posture, k, facing, buffers.gaze, rules[SIDE], rules[TICK])


@subroutine
def _is_stuck(buffers: Buffers, k: int) -> bool:
    """Whether pedestrian k is so deep in a solid at the start of the tick that the engine cannot move it out."""
    if buffers.may_overlap[k] or buffers.attendance.is_absent[k]:
        return False
    guard, humans, torso = buffers.guard, buffers.humans, buffers.guard.torso
    body = torso[k, 0], torso[k, 1], guard.radius[k], guard.shoulder[k]
    return outline_gap(buffers.solids, humans[k, X], humans[k, Y], *body, 0.0) < -STUCK_DEPTH


@subroutine
def _robot_gap(buffers: Buffers, k: int) -> float:
    """Gap between the nearest robot and pedestrian k at the start of the tick, m."""
    humans, torso = buffers.humans, buffers.guard.torso
    return _gap_to_robots(buffers, k, humans[k, X], humans[k, Y], torso[k, 0], torso[k, 1])


@subroutine
def _gap_to_robots(buffers: Buffers, k: int, x: float, y: float, bx: float, by: float) -> float:
    """Gap between the nearest robot and pedestrian k at a position, m, with the heading (bx, by); m."""
    gap = math.inf
    for r in range(len(buffers.robots)):
        gap = min(gap, _gap_to_robot(robot_at(buffers, r), k, x, y, bx, by))
    return gap


@subroutine
def _gap_to_robot(buffers: Buffers, k: int, x: float, y: float, bx: float, by: float) -> float:
    """Gap between the robot and pedestrian k at a position, m, with the heading (bx, by); m."""
    guard, robot, radius = buffers.guard, buffers.robot, buffers.rules[ROBOT_RADIUS]
    dx, dy = to_shoulder_line(x - robot[X], y - robot[Y], bx, by, guard.shoulder[k])
    gap: float = length(dx, dy) - guard.radius[k] - radius
    if len(buffers.body.core) > 1 and gap < TOUCHING:  # within the circle around the outline
        call(buffers.gap_at, (buffers, x, y, bx, by, guard.shoulder[k]))
        gap = buffers.body.found[DISTANCE] - buffers.body.rounding - guard.radius[k]
    return gap


@subroutine
def _gap(buffers: Buffers, k: int, j: int, bx: float, by: float) -> float:
    """Gap between pedestrian k with the heading (bx, by) and pedestrian j, m; too large if they are far apart."""
    guard, humans, torso = buffers.guard, buffers.humans, buffers.guard.torso
    dx, dy, radii = humans[j, X] - humans[k, X], humans[j, Y] - humans[k, Y], guard.radius[k] + guard.radius[j]
    distance = length(dx, dy)
    if distance < radii + abs(guard.shoulder[k]) + abs(guard.shoulder[j]) + TOUCHING:
        body, other = (bx, by, guard.shoulder[k]), (torso[j, 0], torso[j, 1], guard.shoulder[j])
        distance = shoulder_line_distance(dx, dy, *body, *other)
    gap: float = distance - radii
    return gap


@subroutine
def _depth(buffers: Buffers, k: int, bx: float, by: float) -> float:
    """Room that pedestrian k lacks with the heading (bx, by), m: between robots and solids, or to other pedestrians."""
    guard, humans = buffers.guard, buffers.humans
    x, y, radius, shoulder = humans[k, X], humans[k, Y], guard.radius[k], guard.shoulder[k]
    to_robot = _gap_to_robots(buffers, k, x, y, bx, by)
    depth: float = -outline_gap(buffers.solids, x, y, bx, by, radius, shoulder, _BESIDE) - min(to_robot, 0.0)
    for j in range(len(humans)):
        if j != k:
            depth = max(depth, -_gap(buffers, k, j, bx, by))
    return depth


@subroutine
def _turn_torsos(buffers: Buffers, remaining: int) -> None:
    """Turn the torsos in the engine towards the pedestrians' headings, which they have after the remaining substeps.

    A torso that turned by a whole tick at once would lie several centimetres deep in its neighbours.
    """
    humans, torso = buffers.humans, buffers.guard.torso
    for k in range(len(humans)):
        x, y = humans[k, BODY_X], humans[k, BODY_Y]
        if remaining > 1:
            x, y = torso[k, 0] + (x - torso[k, 0]) / remaining, torso[k, 1] + (y - torso[k, 1]) / remaining
            norm = math.sqrt(x * x + y * y)
            x, y = x / norm, y / norm
        torso[k, 0], torso[k, 1] = x, y
        turn_torso(buffers.engine, k, x, y)


@subroutine
def _roll(buffers: Buffers) -> None:
    """Let pedestrians that cannot move sideways move along their headings, with a limited acceleration."""
    engine, bodies, torso = buffers.engine, buffers.engine.bodies, buffers.guard.torso
    limit = ROLLING_ACCELERATION * MASS
    for k in buffers.rolling:
        x, y = torso[k, 0], torso[k, 1]
        speed = bodies[k, VX] * x + bodies[k, VY] * y
        force = clipped(engine.forces[k, 0] * x + engine.forces[k, 1] * y, -limit, limit)
        bodies[k, VX], bodies[k, VY] = speed * x, speed * y
        engine.forces[k, 0], engine.forces[k, 1] = force * x, force * y
        place(engine, k, bodies[k, X], bodies[k, Y], speed * x, speed * y)


@subroutine
def _move_robot(buffers: Buffers, h: float) -> None:
    """Set the robot's motion in the next substep: a straight line in the direction of its heading in the middle of it.

    Args:
        buffers: its heading and executed velocity are updated.
        h: duration of the substep, s.
    """
    engine, robot, drive, rules = buffers.engine, buffers.robot, buffers.drive, buffers.rules
    row = body_row(buffers)
    omega, half_x, half_y = drive[_OMEGA], drive[_COS], drive[_SIN]
    if _is_shaped(buffers):
        call(buffers.limit_motion, (buffers, drive[_VX], drive[_VY], omega, h))
        motion = buffers.body.motion
        omega, push, is_reduced = motion[2], motion[3], motion[4] == 1.0
        half_x, half_y = rotation(omega * h * 0.5)
        c, s = _turned(robot[BODY_X], robot[BODY_Y], half_x, half_y)
        vx, vy = motion[0] * c - motion[1] * s, motion[0] * s + motion[1] * c
    else:
        c, s = _turned(robot[BODY_X], robot[BODY_Y], half_x, half_y)
        wanted_x, wanted_y = drive[_VX] * c - drive[_VY] * s, drive[_VX] * s + drive[_VY] * c
        (vx, vy), push, is_reduced = limited(buffers.guard, wanted_x, wanted_y, engine.bodies, buffers.solids, rules, h)
    if is_reduced:
        robot[GUARDED] = 1.0
    fraction = _unresisted_fraction(vx, vy, drive)
    vx, vy = vx * fraction, vy * fraction
    # The engine finds the robot where it will be at the end of the substep. Its velocity is 0 there, so that the robot
    # stops pedestrians but does not push them, unless a force gives it one.
    motion = buffers.motion
    motion[X], motion[Y] = engine.bodies[row, X] + vx * h, engine.bodies[row, Y] + vy * h
    place(engine, row, motion[X], motion[Y], 0.0, 0.0)
    drive[_LOST_X], drive[_LOST_Y] = vx * push, vy * push
    engine.forces[row, 0], engine.forces[row, 1] = vx * push * (ROBOT_MASS / h), vy * push * (ROBOT_MASS / h)
    ahead, left = vx * c + vy * s, vy * c - vx * s
    if rules[HOLONOMIC] == 0.0 and rules[COUPLED] == 0.0:
        left = 0.0  # not a rounding error
    drive[_SUM_X], drive[_SUM_Y] = drive[_SUM_X] + ahead, drive[_SUM_Y] + left
    c, s = _turned(c, s, half_x, half_y)
    drive[_SUM_OMEGA] += omega
    norm = math.sqrt(c * c + s * s)
    c, s = c / norm, s / norm
    robot[BODY_X], robot[BODY_Y] = c, s
    if len(engine.outline) > 0:
        turn_outline(engine, c, s)
    # The velocity turns with the body.
    motion[VX], motion[VY] = ahead * c - left * s, ahead * s + left * c


@subroutine
def _is_shaped(buffers: Buffers) -> bool:
    """Whether the robot is no disc, turns only as it moves, or is not alone."""
    return bool(buffers.limit_motion[0] != 0)


@subroutine
def _unresisted_fraction(vx: float, vy: float, drive: Array) -> float:
    """Fraction of the robot's velocity that is left if it pushes pedestrians: they slow it down, but do not move it.

    A robot of a pedestrian's mass would lose the velocity `_LOST_X`, `_LOST_Y`. Its length counts, not its component
    along the motion: a robot that drives along a wall also stops for a person between its side and the wall.
    """
    lost_x, lost_y = drive[_LOST_X], drive[_LOST_Y]
    if lost_x * vx + lost_y * vy <= 0.0:
        return 1.0
    return max(1.0 - math.sqrt((lost_x * lost_x + lost_y * lost_y) / (vx * vx + vy * vy)), 0.0)


@subroutine
def _turned(c: float, s: float, turn_x: float, turn_y: float) -> Vector:
    """A direction turned by an angle with a cosine and a sine."""
    return c * turn_x - s * turn_y, s * turn_x + c * turn_y


@subroutine
def _keep_robot(buffers: Buffers) -> None:
    """Undo what contacts did to the robot's body in the last substep, and note the impulse of a push."""
    bodies, drive = buffers.engine.bodies, buffers.drive
    row, ratio = body_row(buffers), 0.0
    if buffers.rules[GUARD] == 0.0:
        ratio = ROBOT_MASS / MASS
    drive[_LOST_X] = (drive[_LOST_X] - bodies[row, VX]) * ratio
    drive[_LOST_Y] = (drive[_LOST_Y] - bodies[row, VY]) * ratio
    _restore_robot(buffers)


@subroutine
def _restore_robot(buffers: Buffers) -> None:
    """Replace the robot's row of `Engine.bodies`, which contacts may have changed, by its own motion."""
    bodies, row = buffers.engine.bodies, body_row(buffers)
    for column in range(4):
        bodies[row, column] = buffers.motion[column]


@subroutine
def _limit_speeds(buffers: Buffers) -> None:
    """Limit the speeds of pedestrians to what contacts with people can explain."""
    engine, maximum_speed = buffers.engine, buffers.maximum_speed
    for k in range(len(maximum_speed)):
        vx, vy = engine.bodies[k, VX], engine.bodies[k, VY]
        square, maximum = vx * vx + vy * vy, maximum_speed[k]
        if square > maximum * maximum:
            fraction = maximum / math.sqrt(square)
            engine.bodies[k, VX], engine.bodies[k, VY] = vx * fraction, vy * fraction
            place(engine, k, engine.bodies[k, X], engine.bodies[k, Y], vx * fraction, vy * fraction)


@subroutine
def copy_bodies(buffers: Buffers) -> None:
    """Copy positions and velocities from the engine's rows to the state."""
    bodies, humans = buffers.engine.bodies, buffers.humans
    for column in range(4):  # x, y, vx, vy are the first columns of all
        for k in range(len(humans)):
            humans[k, column] = bodies[k, column]
    for r in range(len(buffers.robots)):
        own = robot_at(buffers, r)
        for column in range(4):
            own.robot[column] = bodies[body_row(own), column]


@kernel
def read_state(packed_world: Any) -> None:
    """Read positions and velocities of the pedestrians of the packed `Buffers` from the engine into its state."""
    buffers = unpack(packed_world, Buffers)
    read_bodies(buffers.engine)
    for r in range(len(buffers.robots)):
        _restore_robot(robot_at(buffers, r))
    copy_bodies(buffers)


@kernel
def begin(packed_world: Any) -> None:
    """Place the pedestrians of the packed `Buffers` that are not where they start, and read the state."""
    buffers = unpack(packed_world, Buffers)
    begin_attendance(buffers.attendance, buffers.engine, buffers.rules[TICK])
    copy_bodies(buffers)


@kernel
def track(packed_world: Any, tick: int) -> None:
    """Set the velocities of recorded pedestrians for a tick."""
    buffers = unpack(packed_world, Buffers)
    follow_tracks(buffers.attendance, buffers.engine, tick, buffers.rules[TICK])


@kernel
def enter_and_leave(packed_world: Any, tick: int, is_leaving: BoolArray, is_own_choice: BoolArray) -> bool:
    """Let pedestrians leave and enter, see `update_attendance`; those that enter have their initial headings."""
    buffers = unpack(packed_world, Buffers)
    own, humans = buffers.attendance, buffers.humans
    was_absent = own.is_absent.copy()
    if not update_attendance(own, buffers.engine, tick, buffers.rules[TICK], is_leaving, is_own_choice):
        return False
    for k in range(len(was_absent)):
        if was_absent[k] and not own.is_absent[k]:
            x, y = own.start[k, 4], own.start[k, 5]
            buffers.guard.torso[k, 0], buffers.guard.torso[k, 1] = x, y
            humans[k, BODY_X], humans[k, BODY_Y], humans[k, GAZE_X], humans[k, GAZE_Y] = x, y, x, y
            humans[k, OMEGA] = 0.0
            for column in range(3):
                buffers.posture[k, column] = 0.0
    copy_bodies(buffers)
    return True
