"""Shoulders turn in narrow gaps: a body is broader than deep, and passes sideways where it does not pass straight.

People turn their shoulders if a gap is narrower than 1.3 times the breadth of their shoulders, and as far as they need
to keep this proportion.

Source: Warren & Whang, J. Exp. Psychol. Hum. Percept. Perform. 13 (1987) 371.
"""

from __future__ import annotations

import math

from ...core.compiled.kernel import subroutine
from ...core.compiled.scalar import RADIUS, angle_of, extent, towards
from ...core.portable_math import PI, Array
from .models.base import Walkers

APERTURE_RATIO = 1.3  # of a gap to the breadth of a body that passes it
MAXIMUM_TWIST = PI / 3  # rad, of the shoulders among people
MAXIMUM_TWIST_IN_GAP = 4.0 * PI / 9  # rad, between walls
_GAP_AHEAD = 0.35  # m, where walls are looked for besides the present position
_NEAR_BEHIND, _NEAR_AHEAD = 0.1, 0.7  # m, behind and ahead of the centre, between which other pedestrians count
_WALL_AHEAD = 0.2  # m, by which the nearest point of a wall can be off the line across the direction
_OPPOSITE = -0.8  # cosine of the angle between the directions to two walls, below which they form a gap
_BESIDE = 1.0  # m, to each side; what is farther away leaves room
_UNDECIDED = 0.1  # m, difference of the room at both sides below which a twist keeps its side


@subroutine
def wanted_twist(walkers: Walkers, i: int, barriers: Array, twist: float, side: float) -> float:
    """The angle by which agent i wants to turn its shoulders, rad; 0 where there is room.

    The shoulder on the side with less room goes back.

    Args:
        walkers: all agents, with their neighbours.
        i: index of an agent that walks.
        barriers: rows of `Barriers.table`.
        twist: the angle that it wanted before, rad.
        side: of the rules, +1 or -1: the shoulder that goes back where both sides are alike.
    """
    x, y, radius = walkers.position[i, 0], walkers.position[i, 1], walkers.radius[i]
    breadth, depth = 2.0 * (radius + walkers.shoulder[i]), 2.0 * radius
    if not breadth > depth:
        return 0.0
    ex, ey = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
    left, right = _BESIDE, _BESIDE  # free distance from the centre
    gap = 2.0 * _BESIDE  # between walls on opposite sides
    for n in range(2):
        px, py, wall_left, wall_right = x + ex * _GAP_AHEAD * n, y + ey * _GAP_AHEAD * n, _BESIDE, _BESIDE
        lx, ly, rx, ry = 0.0, 0.0, 0.0, 0.0  # unit vectors to the nearest walls
        for m in range(walkers.wall_start[i], walkers.wall_start[i + 1]):
            b = walkers.wall[m]
            dx, dy = towards(barriers, b, px, py)
            ahead, aside = dx * ex + dy * ey, ex * dy - ey * dx
            distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
            free = distance - barriers[b, RADIUS]
            if not (abs(ahead) < _WALL_AHEAD and free < _BESIDE):
                continue
            if aside > 0.0:
                if free < wall_left:
                    wall_left, lx, ly = free, dx / distance, dy / distance
            elif free < wall_right:
                wall_right, rx, ry = free, dx / distance, dy / distance
        left, right = min(left, wall_left), min(right, wall_right)
        if lx * rx + ly * ry < _OPPOSITE:
            gap = min(gap, wall_left + wall_right)
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        if walkers.attention[n] == 0.0:
            continue
        j = walkers.neighbour[n]
        dx, dy = walkers.position[j, 0] - x, walkers.position[j, 1] - y
        ahead, aside = dx * ex + dy * ey, ex * dy - ey * dx
        if -_NEAR_BEHIND < ahead < _NEAR_AHEAD and abs(aside) < _BESIDE:
            bx, by = walkers.body_direction[j, 0], walkers.body_direction[j, 1]
            half = walkers.radius[j] + extent(-ey, ex, bx, by, walkers.shoulder[j])
            if abs(aside) < half:
                continue  # ahead, not beside: it is followed or evaded
            free = abs(aside) - half
            if aside > 0.0:
                left = min(left, free)
            else:
                right = min(right, free)
    angle = min(_angle(left + right, breadth, depth), MAXIMUM_TWIST)
    angle = max(angle, min(_angle(gap, breadth, depth), MAXIMUM_TWIST_IN_GAP))
    if angle == 0.0:
        return 0.0
    sign = 1.0 if left < right else -1.0
    if abs(left - right) < _UNDECIDED:
        sign = side if twist == 0.0 else (1.0 if twist > 0.0 else -1.0)
    return sign * angle


@subroutine
def _angle(room: float, breadth: float, depth: float) -> float:
    """The angle at which a body has `APERTURE_RATIO` of its projected breadth in a room, m, or a right angle; rad."""
    cosine = max((room / APERTURE_RATIO - depth) / (breadth - depth), 0.0)
    return 0.0 if cosine >= 1.0 else angle_of(math.sqrt(1.0 - cosine * cosine), cosine)
