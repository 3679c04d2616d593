"""Stopping of the robot by walls, furniture and the safety guard; contacts, and who causes them.

The velocity towards each outline is limited to gap / h, so that a body that moves in steps of h stops at the surface. A
holonomic robot slides along it; a unicycle is slowed down along its heading, since its wheels do not slip.
Contacts are detected from gaps as well, and faults from wanted velocities: a robot that wants to move into an outline
that it touches is at fault even if the guard holds it back.

The outline of a pedestrian is the engine's, with its heading in the substep.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...core.barrier_grid import Solids, find_within, outline_gap
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Floats, Floats2, Ints
from ...core.compiled.scalar import ALONG_X, ALONG_Y, RADIUS, START_X, START_Y, Vector, clipped, to_shoulder_line
from ...core.humans import VX, VY, X, Y
from ...core.portable_math import Array
from ...core.snapshot import CLOSING_SPEED
from .rules import CONTACT_DISTANCE, GUARD, HOLONOMIC, HUMAN_RANGE, OWN_SPEED, ROBOT_RADIUS, TICK

FASTEST_PERSON = 2.5  # m/s, minimum of the speed that decides which pedestrians can come near within a tick
BARRIER_RANGE = 0.1  # m, added to the robot's own motion for the barriers that can come near within a tick
PUSH_DEPTH = 0.5  # of its motion in a substep: depth to which a robot without guard overlaps with pushed pedestrians
_EXCESS = 1e-9  # m/s, by which a velocity limit may be exceeded
_PASSES = 4  # over all limits, since keeping one can break another

NORMAL_X, NORMAL_Y, GAP, LIMIT, LEVER = range(5)  # columns of `Guard.separation`

# Bits of a contact in `Guard.human_contact` and `Guard.barrier_contact`.
TOUCHED, ROBOT_AT_FAULT, OTHER_AT_FAULT = 1, 2, 4


class Guard(NamedTuple):
    """State of the safety guard during a tick.

    Attributes:
        radius: (N,), m, half the depth of the pedestrians.
        shoulder: (N,), m, half the length of their shoulder lines.
        torso: (N, 2), unit vectors of their headings in the substep.
        human_contact: (N,) of int, the bits above, of contacts during the tick.
        barrier_contact: (B,) of int, the same for walls and furniture.
        robot_contact: (R,) of int, the same for the robots, of which the own one is 0.
        barrier_owner: (B,) of int, the first barrier of the same wall or object.
        near: (N + B + E,) of int, the pedestrians and then the barriers that can come near within the tick; then for
            each near side of another robot that robot's index.
        counts: (4,) of int, how many of them are pedestrians, and barriers; 1 if there was a contact in the tick; and
            how many are sides of robots.
        separation: (N + B + E, 5), scratch, for each near outline: unit vector from the robot to it, the gap, m, the
            maximum velocity of the robot towards it, m/s, and of an outline that turns, the velocity with which a turn
            rate of 1 rad/s moves the nearest point towards it, m/s.
    """

    radius: Floats
    shoulder: Floats
    torso: Floats2
    human_contact: Ints
    barrier_contact: Ints
    robot_contact: Ints
    barrier_owner: Ints
    near: Ints
    counts: Ints
    separation: Floats2


@subroutine
def find_near(guard: Guard, bodies: Array, row: int, solids: Solids, rules: Array) -> None:
    """Clear the contacts, and find the outlines that can come near within the tick.

    Args:
        guard: updated.
        bodies: as in `Engine`.
        row: of the robot in `bodies`.
        solids: walls and furniture.
        rules: see `rules`.
    """
    guard.human_contact[:] = 0
    guard.barrier_contact[:] = 0
    guard.robot_contact[:] = 0
    guard.counts[2] = 0
    x, y, vx, vy = bodies[row, X], bodies[row, Y], bodies[row, VX], bodies[row, VY]
    reach = max(math.sqrt(vx * vx + vy * vy), rules[OWN_SPEED]) * rules[TICK]
    count = 0
    for k in range(len(guard.human_contact)):
        dx, dy = bodies[k, X] - x, bodies[k, Y] - y
        widest = guard.radius[k] + abs(guard.shoulder[k]) + rules[ROBOT_RADIUS]
        if math.sqrt(dx * dx + dy * dy) - widest < reach + rules[HUMAN_RANGE]:
            guard.near[count] = k
            count += 1
    guard.counts[0] = count
    guard.counts[1] = find_within(solids, x, y, rules[ROBOT_RADIUS] + reach + BARRIER_RANGE, guard.near[count:])


@subroutine
def limited(
    guard: Guard, wanted_x: float, wanted_y: float, bodies: Array, solids: Solids, rules: Array, h: float
) -> tuple[Vector, float, bool]:
    """Reduce the robot's velocity so that no gap becomes negative within the substep; record contacts at its end.

    Without the guard, walls and furniture stop the robot all the same, and pedestrians only limit it so that it
    overlaps with them by at most `PUSH_DEPTH` of its motion in a substep.

    Args:
        guard: after `find_near`; contacts are added.
        wanted_x, wanted_y: velocity that the drive would set, m/s, world frame.
        bodies: (N + 1, 4), x, y, vx, vy with the robot last; m and m/s, world frame.
        solids: walls and furniture.
        rules: see `rules`.
        h: duration of the substep, s.

    Returns:
        Velocity, m/s, world frame; the fraction of it with which the robot pushes pedestrians, 0 under the guard; and
        whether the guard reduced it.
    """
    people, count, is_guarded = guard.counts[0], guard.counts[0] + guard.counts[1], rules[GUARD] != 0.0
    push = 0.0 if is_guarded else 1.0
    if count == 0:
        return (wanted_x, wanted_y), push, False
    last, separation, barriers = bodies.shape[0] - 1, guard.separation, solids.table
    px, py = bodies[last, X], bodies[last, Y]
    depth = 0.0 if is_guarded else PUSH_DEPTH * math.sqrt(wanted_x * wanted_x + wanted_y * wanted_y) * h
    for n in range(people):
        k = guard.near[n]
        x, y = bodies[k, X] + bodies[k, VX] * h, bodies[k, Y] + bodies[k, VY] * h  # at the end of the substep
        dx, dy = to_shoulder_line(x - px, y - py, guard.torso[k, 0], guard.torso[k, 1], guard.shoulder[k])
        allowed = depth
        if not is_guarded:  # a person that is pressed against something stops the robot
            torso, radius, shoulder = guard.torso[k], guard.radius[k], guard.shoulder[k]
            room = outline_gap(solids, x, y, torso[0], torso[1], radius, shoulder, depth)
            allowed = clipped(room, 0.0, depth)
        _separate(separation[n], dx, dy, guard.radius[k] + rules[ROBOT_RADIUS], allowed, h)
    for n in range(people, count):
        k = guard.near[n]
        ax, ay, dx, dy = barriers[k, START_X], barriers[k, START_Y], barriers[k, ALONG_X], barriers[k, ALONG_Y]
        square = dx * dx + dy * dy
        t = ((px - ax) * dx + (py - ay) * dy) / square if square > 0.0 else 0.0
        t = min(max(t, 0.0), 1.0)
        radii = barriers[k, RADIUS] + rules[ROBOT_RADIUS]
        _separate(separation[n], ax + t * dx - px, ay + t * dy - py, radii, 0.0, h)
    if rules[HOLONOMIC] != 0.0:
        (vx, vy), is_reduced = within_limits(separation, count, wanted_x, wanted_y)
    else:
        fraction = _fraction_within_limits(separation, count, wanted_x, wanted_y)
        vx, vy, is_reduced = wanted_x * fraction, wanted_y * fraction, fraction < 1.0
    square = vx * vx + vy * vy
    for n in range(count):
        k, nx, ny = guard.near[n], separation[n, NORMAL_X], separation[n, NORMAL_Y]
        towards = vx * nx + vy * ny
        remaining = separation[n, GAP] - towards * h
        if remaining >= rules[CONTACT_DISTANCE]:
            continue
        guard.counts[2] = 1
        if n >= people:
            edge = nearest_edge(guard, n, people, count)
            own_speed = wanted_x * separation[edge, NORMAL_X] + wanted_y * separation[edge, NORMAL_Y]
            guard.barrier_contact[k] |= faults_of(own_speed, 0.0)
            continue
        own_speed = wanted_x * nx + wanted_y * ny
        away = bodies[k, VX] * nx + bodies[k, VY] * ny
        guard.human_contact[k] |= faults_of(own_speed, -away)
        if remaining < 0.0 and towards > max(away, 0.0):
            # Half of the velocity difference, as in an inelastic collision of equal masses.
            push = min(push, max(1.0 - 0.5 * (towards - away) * towards / square, 0.0))
    return (vx, vy), push, is_reduced and is_guarded


@subroutine
def nearest_edge(guard: Guard, n: int, first: int, count: int) -> int:
    """The nearest edge of the object that near outline n belongs to; near barriers are those from `first` to `count`.

    A robot that slides along one side of a table also comes near to the end of the next one, but not by its own fault.
    """
    nearest, owner = n, guard.barrier_owner[guard.near[n]]
    for k in range(first, count):
        if guard.barrier_owner[guard.near[k]] == owner and guard.separation[k, GAP] < guard.separation[nearest, GAP]:
            nearest = k
    return nearest


@subroutine
def within_limits(separation: Array, count: int, vx: float, vy: float) -> tuple[Vector, bool]:
    """The velocity without what exceeds the limits of the first `count` outlines, and whether it was reduced."""
    for done in range(_PASSES):
        is_reduced = False
        for n in range(count):
            nx, ny = separation[n, NORMAL_X], separation[n, NORMAL_Y]
            excess = vx * nx + vy * ny - separation[n, LIMIT]
            if excess > _EXCESS:
                vx, vy, is_reduced = vx - excess * nx, vy - excess * ny, True
        if not is_reduced:
            return (vx, vy), done > 0
    return (0.0, 0.0), True  # wedged in: no velocity was found that keeps all limits


@subroutine
def _fraction_within_limits(separation: Array, count: int, vx: float, vy: float) -> float:
    """The largest fraction of a velocity, at most 1, that keeps the limits of the first `count` outlines.

    A unicycle is slowed down, not deflected.
    """
    fraction = 1.0
    for n in range(count):
        speed, limit = vx * separation[n, NORMAL_X] + vy * separation[n, NORMAL_Y], separation[n, LIMIT]
        if speed - limit > _EXCESS:
            fraction = min(fraction, limit / speed)
    return fraction


@subroutine
def faults_of(own_speed: float, other_speed: float) -> int:
    """The bits of a contact, from the speeds at which each side closes the gap, m/s."""
    bits = TOUCHED
    if own_speed > CLOSING_SPEED:
        bits |= ROBOT_AT_FAULT
    if other_speed > CLOSING_SPEED:
        bits |= OTHER_AT_FAULT
    return bits


@subroutine
def _separate(row: Array, dx: float, dy: float, radii: float, depth: float, h: float) -> None:
    """Fill a row of `Guard.separation`.

    Args:
        row: (4,), overwritten.
        dx, dy: from the robot's centre to the nearest point of the outline's core, m; if it is zero, x is the normal.
        radii: sum of the radii, m.
        depth: m, by which the outlines may overlap.
        h: duration of the substep, s.
    """
    distance = math.sqrt(dx * dx + dy * dy)
    row[NORMAL_X], row[NORMAL_Y] = (dx / distance, dy / distance) if distance > 0.0 else (1.0, 0.0)
    row[GAP] = distance - radii
    row[LIMIT] = max(row[GAP] + depth, 0.0) / h
