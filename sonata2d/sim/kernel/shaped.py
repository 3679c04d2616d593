"""The safety guard of robots that are not discs, that turn only as they move, or that share a scene with other robots.

As `safety.limited` for a disc, with three differences: an outline that turns moves its corners; after velocity and turn
rate were limited by the nearest points, the pose at the end of the substep is tried; and the outlines of other robots
are in the way, where they are at that moment. Robots are rigid and do not push each other, with or without the guard.
"""

from __future__ import annotations

from typing import Any

from ...core.barrier_grid import outline_gap
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import unpack
from ...core.compiled.scalar import END_X, END_Y, RADIUS, START_X, START_Y, Vector, clipped, half_line, length, rotation
from ...core.humans import BODY_X, BODY_Y, VX, VY, X, Y
from ...core.portable_math import Array
from ...core.separation import ARM_X, ARM_Y, DISTANCE, NORMAL_X, NORMAL_Y, place_corners, separate
from .body import ALLOWED, START_GAP, Body
from .rules import CONTACT_DISTANCE, COUPLED, GUARD, HOLONOMIC, ROBOT_RADIUS
from .safety import (
    GAP,
    LEVER,
    LIMIT,
    NORMAL_X as OUT_X,
    NORMAL_Y as OUT_Y,
    PUSH_DEPTH,
    Guard,
    faults_of,
    nearest_edge,
    within_limits,
)
from .step import Buffers, body_row, robot_at

_HALVINGS = 10  # of the interval in which the largest fraction of a motion is searched
_TOLERANCE = 1e-7  # m, by which an outline may come too near


@kernel
def gap_at(packed_world: Any, x: float, y: float, body_x: float, body_y: float, shoulder: float) -> None:
    """Find the separation of the robot and the shoulder line of a person at the start of a tick, into `Body.found`.

    Args:
        packed_world: packed `Buffers`.
        x, y: position of the person, m.
        body_x, body_y: unit vector of its heading.
        shoulder: half the length of its shoulder line, m.
    """
    world = unpack(packed_world, Buffers)
    body, robot = world.body, world.robot
    place_corners(body.core, robot[X], robot[Y], robot[BODY_X], robot[BODY_Y], body.corners)
    dx, dy = half_line(body_x, body_y, shoulder)
    separate(body.corners, x + dx, y + dy, x - dx, y - dy, body.found)


@kernel
def limit_motion(packed_world: Any, ahead: float, left: float, omega: float, h: float) -> None:
    """Reduce the robot's motion so that no gap becomes negative in a substep; record contacts; fill `Body.motion`.

    The turn is limited first, then the velocity: a robot at a wall can turn away from it. A drive that turns only as it
    moves has both reduced by the same factor.

    Args:
        packed_world: packed `Buffers`, after `find_near`.
        ahead, left: velocity that the drive would set, m/s, body frame in the middle of the substep.
        omega: turn rate that the drive would set, rad/s.
        h: duration of the substep, s.
    """
    world = unpack(packed_world, Buffers)
    guard, body, rules = world.guard, world.body, world.rules
    motion, is_guarded = body.motion, rules[GUARD] != 0.0
    motion[0], motion[1], motion[2] = ahead, left, omega
    motion[3], motion[4] = 0.0 if is_guarded else 1.0, 0.0
    speed = length(ahead, left) + abs(omega) * rules[ROBOT_RADIUS]
    _find_robots(world, speed * h + rules[CONTACT_DISTANCE])
    count = _near_count(guard)
    if count == 0:
        return
    _find_targets(world, speed, h)
    if rules[COUPLED] == 0.0:
        _limit_turn(guard, motion, count)
    _limit_velocity(world, h)
    _try_motion(world, h)
    is_reduced = motion[0] != ahead or motion[1] != left or motion[2] != omega
    motion[4] = 1.0 if is_reduced and is_guarded else 0.0
    _note_contacts(world, ahead, left, omega, h)


@subroutine
def _near_count(guard: Guard) -> int:
    """Number of near outlines."""
    count: int = guard.counts[0] + guard.counts[1] + guard.counts[3]
    return count


@subroutine
def _find_robots(world: Buffers, reach: float) -> None:
    """Add the sides of other robots that are nearer than the reach, m, to the near outlines."""
    guard, body, bodies = world.guard, world.body, world.engine.bodies
    first, row, count = guard.counts[0] + guard.counts[1], body_row(world), 0
    for r in range(len(world.robots)):
        if r == world.number:
            continue
        other = robot_at(world, r)
        radii = world.rules[ROBOT_RADIUS] + other.rules[ROBOT_RADIUS]
        x, y = other.motion[X], other.motion[Y]  # where it is in this substep, if it has moved already
        if length(x - bodies[row, X], y - bodies[row, Y]) - radii > reach:
            continue
        core, corners = other.body.core, other.body.corners
        place_corners(core, x, y, other.robot[BODY_X], other.robot[BODY_Y], corners)
        for side in range(len(core)):
            target, end = body.target[first + count], (side + 1) % len(core)
            target[START_X], target[START_Y] = corners[side, 0], corners[side, 1]
            target[END_X], target[END_Y] = corners[end, 0], corners[end, 1]
            target[RADIUS], target[ALLOWED] = other.body.rounding, 0.0
            guard.near[first + count] = r
            count += 1
    guard.counts[3] = count


@subroutine
def _find_targets(world: Buffers, speed: float, h: float) -> None:
    """Fill `Body.target` and `Guard.separation` for the near outlines, of a robot with a speed, m/s, at its corners."""
    guard, body, robot, rules, solids = world.guard, world.body, world.robot, world.rules, world.solids
    bodies, people, solid = world.engine.bodies, guard.counts[0], guard.counts[0] + guard.counts[1]
    own, target, barriers = body_row(world), body.target, solids.table
    depth = 0.0 if rules[GUARD] != 0.0 else PUSH_DEPTH * h * speed
    place_corners(body.core, bodies[own, X], bodies[own, Y], robot[BODY_X], robot[BODY_Y], body.corners)
    for n in range(_near_count(guard)):
        k, row = guard.near[n], target[n]
        if n < people:
            x, y = bodies[k, X] + bodies[k, VX] * h, bodies[k, Y] + bodies[k, VY] * h  # at the end of the substep
            torso, radius, shoulder = guard.torso[k], guard.radius[k], guard.shoulder[k]
            dx, dy = half_line(torso[0], torso[1], shoulder)
            row[START_X], row[START_Y], row[END_X], row[END_Y] = x + dx, y + dy, x - dx, y - dy
            row[RADIUS], row[ALLOWED] = radius, 0.0
            if depth > 0.0:  # a person that is pressed against something stops the robot
                room = outline_gap(solids, x, y, torso[0], torso[1], radius, shoulder, depth)
                row[ALLOWED] = clipped(room, 0.0, depth)
        elif n < solid:
            for column in range(RADIUS + 1):  # the same columns
                row[column] = barriers[k, column]
            row[ALLOWED] = 0.0
        _separate_from(body, n, bodies[own, X], bodies[own, Y], guard.separation[n])
        row[START_GAP] = guard.separation[n, GAP]
        guard.separation[n, LIMIT] = max(row[START_GAP] + row[ALLOWED], 0.0) / h


@subroutine
def _separate_from(body: Body, n: int, x: float, y: float, row: Array) -> None:
    """Fill a row of `Guard.separation`, but for its limit, with the robot's corners placed around (x, y), m."""
    target, found = body.target[n], body.found
    separate(body.corners, target[START_X], target[START_Y], target[END_X], target[END_Y], found)
    row[OUT_X], row[OUT_Y] = found[NORMAL_X], found[NORMAL_Y]
    row[GAP] = found[DISTANCE] - body.rounding - target[RADIUS]
    row[LEVER] = (found[ARM_X] - x) * found[NORMAL_Y] - (found[ARM_Y] - y) * found[NORMAL_X]


@subroutine
def _velocity(robot: Array, ahead: float, left: float, omega: float, h: float) -> Vector:
    """The velocity in the world frame of a motion that turns: along the heading in the middle of the substep."""
    turn_x, turn_y = rotation(omega * h * 0.5)
    c, s = robot[BODY_X] * turn_x - robot[BODY_Y] * turn_y, robot[BODY_Y] * turn_x + robot[BODY_X] * turn_y
    return ahead * c - left * s, ahead * s + left * c


@subroutine
def _limit_turn(guard: Guard, motion: Array, count: int) -> None:
    """Scale the turn rate until it keeps all limits by itself."""
    fraction = 1.0
    for n in range(count):
        speed = motion[2] * guard.separation[n, LEVER]
        if speed > guard.separation[n, LIMIT]:
            fraction = min(fraction, guard.separation[n, LIMIT] / speed)
    motion[2] *= fraction


@subroutine
def _limit_velocity(world: Buffers, h: float) -> None:
    """Limit the velocity by what the turn leaves of the limits: without what exceeds them, or scaled.

    A drive that turns only as it moves has its turn rate scaled as well.
    """
    guard, robot, motion = world.guard, world.robot, world.body.motion
    count, is_coupled = _near_count(guard), world.rules[COUPLED] != 0.0
    vx, vy = _velocity(robot, motion[0], motion[1], motion[2], h)
    fraction = 1.0
    for n in range(count):
        row = guard.separation[n]
        speed = vx * row[OUT_X] + vy * row[OUT_Y]
        if is_coupled:
            speed += motion[2] * row[LEVER]
        else:
            row[LIMIT] = max(row[LIMIT] - motion[2] * row[LEVER], 0.0)
        if speed > row[LIMIT]:
            fraction = min(fraction, row[LIMIT] / speed)
    if fraction == 1.0:
        return
    if is_coupled:
        for item in range(3):
            motion[item] *= fraction
    elif world.rules[HOLONOMIC] == 0.0:
        motion[0] *= fraction
    else:
        (vx, vy), _ = within_limits(guard.separation, count, vx, vy)
        unit_x, unit_y = _velocity(robot, 1.0, 0.0, motion[2], h)
        motion[0], motion[1] = vx * unit_x + vy * unit_y, vy * unit_x - vx * unit_y


@subroutine
def _try_motion(world: Buffers, h: float) -> None:
    """Scale the motion until the robot can be where it ends: other corners may come near than at its start."""
    motion, is_coupled = world.body.motion, world.rules[COUPLED] != 0.0
    ahead, left, omega = motion[0], motion[1], motion[2]
    if _fits(world, ahead, left, omega, h):
        return
    # With the turn alone where that is possible, else by the turn alone, the velocity being 0.
    keeps_turn = not is_coupled and omega != 0.0 and _fits(world, 0.0, 0.0, omega, h)
    keeps_velocity = not is_coupled and not keeps_turn and _fits(world, ahead, left, 0.0, h)
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        of_velocity, of_turn = 1.0 if keeps_velocity else middle, 1.0 if keeps_turn else middle
        if _fits(world, ahead * of_velocity, left * of_velocity, omega * of_turn, h):
            low = middle
        else:
            high = middle
    of_velocity, of_turn = 1.0 if keeps_velocity else low, 1.0 if keeps_turn else low
    motion[0], motion[1], motion[2] = ahead * of_velocity, left * of_velocity, omega * of_turn


@subroutine
def _fits(world: Buffers, ahead: float, left: float, omega: float, h: float) -> bool:
    """Whether the robot overlaps with nothing more than it is allowed to, or did before, at the end of a motion."""
    guard, body = world.guard, world.body
    x, y = _place_at_end(world, ahead, left, omega, h)
    for n in range(_near_count(guard)):
        _separate_from(body, n, x, y, guard.separation[n])
        if guard.separation[n, GAP] < min(body.target[n, START_GAP], -body.target[n, ALLOWED]) - _TOLERANCE:
            return False
    return True


@subroutine
def _place_at_end(world: Buffers, ahead: float, left: float, omega: float, h: float) -> Vector:
    """Place the robot's corners where they are at the end of a motion; its centre there, m."""
    robot, bodies, body = world.robot, world.engine.bodies, world.body
    row = body_row(world)
    vx, vy = _velocity(robot, ahead, left, omega, h)
    x, y = bodies[row, X] + vx * h, bodies[row, Y] + vy * h
    turn_x, turn_y = rotation(omega * h)
    c, s = robot[BODY_X] * turn_x - robot[BODY_Y] * turn_y, robot[BODY_Y] * turn_x + robot[BODY_X] * turn_y
    place_corners(body.core, x, y, c, s, body.corners)
    return x, y


@subroutine
def _note_contacts(world: Buffers, ahead: float, left: float, omega: float, h: float) -> None:
    """Record the contacts at the end of the motion, faults by the wanted motion; and what the robot pushes."""
    guard, body, bodies, motion = world.guard, world.body, world.engine.bodies, world.body.motion
    people, solid, count = guard.counts[0], guard.counts[0] + guard.counts[1], _near_count(guard)
    wanted_x, wanted_y = _velocity(world.robot, ahead, left, omega, h)
    vx, vy = _velocity(world.robot, motion[0], motion[1], motion[2], h)
    x, y = _place_at_end(world, motion[0], motion[1], motion[2], h)
    for n in range(count):
        _separate_from(body, n, x, y, guard.separation[n])
    for n in range(count):
        k, row = guard.near[n], guard.separation[n]
        if row[GAP] >= world.rules[CONTACT_DISTANCE]:
            continue
        guard.counts[2] = 1
        if n >= solid:
            _note_robot(world, n, wanted_x, wanted_y, omega)
            continue
        if n >= people:
            row = guard.separation[nearest_edge(guard, n, people, solid)]
            own_speed = wanted_x * row[OUT_X] + wanted_y * row[OUT_Y] + omega * row[LEVER]
            guard.barrier_contact[k] |= faults_of(own_speed, 0.0)
            continue
        own_speed = wanted_x * row[OUT_X] + wanted_y * row[OUT_Y] + omega * row[LEVER]
        away = bodies[k, VX] * row[OUT_X] + bodies[k, VY] * row[OUT_Y]
        guard.human_contact[k] |= faults_of(own_speed, -away)
        towards, square = vx * row[OUT_X] + vy * row[OUT_Y] + motion[2] * row[LEVER], vx * vx + vy * vy
        if row[GAP] < 0.0 and towards > max(away, 0.0) and square > 0.0:
            # Half of the velocity difference, as in an inelastic collision of equal masses.
            motion[3] = min(motion[3], max(1.0 - 0.5 * (towards - away) * towards / square, 0.0))


@subroutine
def _note_robot(world: Buffers, n: int, wanted_x: float, wanted_y: float, omega: float) -> None:
    """Record the contact with the robot to which near outline n belongs, for both of them; faults by its nearest side.

    Args:
        world: buffers of the robot that moves.
        n: index of the outline.
        wanted_x, wanted_y: velocity that its drive would set, m/s, world frame.
        omega: turn rate that its drive would set, rad/s.
    """
    guard, r = world.guard, world.guard.near[n]
    for k in range(_near_count(guard) - guard.counts[3], _near_count(guard)):
        if guard.near[k] == r and guard.separation[k, GAP] < guard.separation[n, GAP]:
            return
    row, other = guard.separation[n], robot_at(world, r)
    own_speed = wanted_x * row[OUT_X] + wanted_y * row[OUT_Y] + omega * row[LEVER]
    other_speed = -(other.motion[VX] * row[OUT_X] + other.motion[VY] * row[OUT_Y])
    guard.robot_contact[r] |= faults_of(own_speed, other_speed)
    other.guard.robot_contact[world.number] |= faults_of(other_speed, own_speed)
    other.guard.counts[2] = 1
