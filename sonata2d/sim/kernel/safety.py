"""The robot's safety guard: limits its velocity by the gaps around it, and detects contacts and who causes them.

The velocity towards each outline is limited to gap / h, so that a body that moves in steps of h stops at the surface.
Contacts are detected from gaps as well, and faults from wanted velocities: a robot that wants to move into an outline
that it touches is at fault even if the guard holds it back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...core.compiled import subroutine
from ...core.humans import VX, VY, X, Y
from ...core.packing import Floats, Floats2, Ints
from ...core.portable_math import Array
from ...core.scalar import ALONG_X, ALONG_Y, RADIUS, START_X, START_Y, Vector, gap
from ...core.snapshot import CLOSING_SPEED
from .rules import CONTACT_DISTANCE, GUARD, HUMAN_RANGE, OWN_SPEED, ROBOT_RADIUS, TICK

FASTEST_PERSON = 2.5  # m/s, minimum of the speed that decides which pedestrians can come near within a tick
BARRIER_RANGE = 0.1  # m, added to the robot's own motion for the barriers that can come near within a tick
_EXCESS = 1e-9  # m/s, by which a velocity limit may be exceeded
_PASSES = 4  # over all limits, since keeping one can break another

# Bits of a contact in `Guard.human_contact` and `Guard.barrier_contact`.
TOUCHED, ROBOT_AT_FAULT, OTHER_AT_FAULT = 1, 2, 4


class Guard(NamedTuple):
    """What the safety guard knows during a tick.

    Attributes:
        radius: (N,), m, of the pedestrians.
        human_contact: (N,) of int, the bits above, of contacts during the tick.
        barrier_contact: (B,) of int, the same for walls and furniture.
        near: (N + B,) of int, the pedestrians and then the barriers that can come near within the tick.
        counts: (3,) of int, how many of them are pedestrians, and barriers; and 1 if there was a contact in the tick.
        separation: (N + B, 3), scratch: unit vector from the robot to each near outline, and the gap, m.
    """

    radius: Floats
    human_contact: Ints
    barrier_contact: Ints
    near: Ints
    counts: Ints
    separation: Floats2


@subroutine
def find_near(guard: Guard, bodies: Array, barriers: Array, rules: Array) -> None:
    """Clear the contacts, and find the outlines that can come near within the tick; bodies as in `Engine`."""
    guard.human_contact[:] = 0
    guard.barrier_contact[:] = 0
    guard.counts[2] = 0
    last = bodies.shape[0] - 1
    x, y, vx, vy = bodies[last, X], bodies[last, Y], bodies[last, VX], bodies[last, VY]
    own = max(math.sqrt(vx * vx + vy * vy), rules[OWN_SPEED]) * rules[TICK]
    found = 0
    for k in range(last):
        dx, dy = bodies[k, X] - x, bodies[k, Y] - y
        if math.sqrt(dx * dx + dy * dy) - guard.radius[k] - rules[ROBOT_RADIUS] < own + rules[HUMAN_RANGE]:
            guard.near[found] = k
            found += 1
    guard.counts[0] = found
    for k in range(barriers.shape[0]):
        if gap(barriers, k, x, y) - rules[ROBOT_RADIUS] < own + BARRIER_RANGE:
            guard.near[found] = k
            found += 1
    guard.counts[1] = found - guard.counts[0]


@subroutine
def limited(
    guard: Guard, wanted_x: float, wanted_y: float, bodies: Array, barriers: Array, rules: Array, h: float
) -> tuple[float, float, bool]:
    """Reduce the robot's velocity so that no gap becomes negative within the next substep; record contacts.

    Args:
        guard: after `find_near`; contacts are added.
        wanted_x, wanted_y: velocity that the drive would set, m/s, world frame.
        bodies: (N + 1, 4), x, y, vx, vy with the robot last; m and m/s, world frame.
        barriers: rows of `Barriers.table`.
        rules: see `rules`.
        h: duration of the substep, s.

    Returns:
        Velocity, m/s, world frame, and whether it was reduced.
    """
    humans, count = guard.counts[0], guard.counts[0] + guard.counts[1]
    if count == 0:
        return wanted_x, wanted_y, False
    last = bodies.shape[0] - 1
    # the position from which on the new velocity acts
    px, py = bodies[last, X] + bodies[last, VX] * h, bodies[last, Y] + bodies[last, VY] * h
    for n in range(humans):
        k = guard.near[n]
        vx, vy = bodies[k, VX], bodies[k, VY]
        radii = guard.radius[k] + rules[ROBOT_RADIUS]
        nx, ny, apart = _separation(bodies[k, X] + vx * h - px, bodies[k, Y] + vy * h - py, radii)
        guard.separation[n, 0], guard.separation[n, 1], guard.separation[n, 2] = nx, ny, apart
        if apart < rules[CONTACT_DISTANCE]:
            guard.human_contact[k] |= _faults(wanted_x * nx + wanted_y * ny, -(vx * nx + vy * ny))
            guard.counts[2] = 1
    for n in range(humans, count):
        k = guard.near[n]
        ax, ay, dx, dy = barriers[k, START_X], barriers[k, START_Y], barriers[k, ALONG_X], barriers[k, ALONG_Y]
        square = dx * dx + dy * dy
        t = ((px - ax) * dx + (py - ay) * dy) / square if square > 0.0 else 0.0
        t = min(max(t, 0.0), 1.0)
        radii = barriers[k, RADIUS] + rules[ROBOT_RADIUS]
        nx, ny, apart = _separation(ax + t * dx - px, ay + t * dy - py, radii)
        guard.separation[n, 0], guard.separation[n, 1], guard.separation[n, 2] = nx, ny, apart
        if apart < rules[CONTACT_DISTANCE]:
            guard.barrier_contact[k] |= _faults(wanted_x * nx + wanted_y * ny, 0.0)
            guard.counts[2] = 1
    if rules[GUARD] == 0.0:  # contacts are recorded all the same
        return wanted_x, wanted_y, False
    (vx, vy), is_reduced = _within_limits(guard.separation, count, wanted_x, wanted_y, h)
    return vx, vy, is_reduced


@subroutine
def _within_limits(separation: Array, count: int, vx: float, vy: float, h: float) -> tuple[Vector, bool]:
    """The velocity reduced to gap / h towards each of the first `count` outlines, and whether it was reduced."""
    for done in range(_PASSES):
        is_reduced = False
        for n in range(count):
            nx, ny = separation[n, 0], separation[n, 1]
            excess = vx * nx + vy * ny - max(separation[n, 2], 0.0) / h
            if excess > _EXCESS:
                vx, vy, is_reduced = vx - excess * nx, vy - excess * ny, True
        if not is_reduced:
            return (vx, vy), done > 0
    return (0.0, 0.0), True  # wedged in: no velocity was found that keeps all limits


@subroutine
def _faults(own_speed: float, other_speed: float) -> int:
    """The bits of a contact, from the speeds at which each side closes the gap, m/s."""
    bits = TOUCHED
    if own_speed > CLOSING_SPEED:
        bits |= ROBOT_AT_FAULT
    if other_speed > CLOSING_SPEED:
        bits |= OTHER_AT_FAULT
    return bits


@subroutine
def _separation(dx: float, dy: float, radii: float) -> tuple[float, float, float]:
    """Unit vector along (dx, dy), and its length less `radii`; along x for the null vector."""
    distance = math.sqrt(dx * dx + dy * dy)
    if distance > 0.0:
        return dx / distance, dy / distance, distance - radii
    return 1.0, 0.0, -radii
