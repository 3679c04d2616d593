"""Small motions of standing pedestrians: they shift their weight, turn a little, and look round or at who passes.

The figures are ours; people who stand change their posture several times a minute (Duarte & Zatsiorsky, Motor Control 3
(1999) 28).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...core.barrier_grid import Solids, is_within
from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Floats2, Ints, zeros
from ...core.compiled.scalar import Vector, length, rotation, unit_or
from ...core.humans import BODY_X, BODY_Y, X, Y
from ...core.philox import Draws, uniform_between
from ...core.portable_math import Array
from .models.base import Walkers

POSTURES = 4  # purpose of the random numbers
_SHIFT, _TURN = 0.04, 0.2  # m ahead and to the left, and rad, by which a posture differs at most
_POSTURE_TIME = (4.0, 12.0)  # s, from one posture to the next
ARGUING_RESTLESSNESS = 2.5  # of people who argue; invented, since no measurement was found
_ROOM = 0.1  # m, from walls and furniture around a body that shifts
_LOOK_TIME, _LOOK_PAUSE = (0.8, 2.0), (3.0, 9.0)  # s, of a look to the side, and between two
_LOOK_ANGLE = 1.2  # rad, by which it deviates from the body at most
_PASSING_RANGE, _PASSING_COSINE = 3.0, -0.2  # m, and cosine of the angle from the body, of walkers that are looked at


class Idling(NamedTuple):
    """Small motions of N pedestrians while they stand, for kernels.

    Attributes:
        shift: (N, 2), m, from the place where each one stands.
        turn: (N, 2), cosine and sine of the turn of its body.
        posture_until: (N,) of int, tick.
        look: (N, 2), cosine and sine of the angle from body to head; 1, 0 between two looks.
        looks_at: (N,) of int, index of the walker that is looked at; -1 for none.
        look_until: (N,) of int, tick.
    """

    shift: Floats2
    turn: Floats2
    posture_until: Ints
    look: Floats2
    looks_at: Ints
    look_until: Ints


def initial_idling(count: int) -> Idling:
    """The state at the start of an episode: everybody stands straight."""
    ahead = np.tile([1.0, 0.0], (count, 1))
    return zeros(Idling, count, turn=ahead.copy(), look=ahead, looks_at=np.full(count, -1))


@subroutine
def change_posture(
    idling: Idling, k: int, tick: int, x: float, y: float, walkers: Walkers, size: float, solids: Solids, draws: Draws,
    restlessness: float, side: float, dt: float,
) -> None:  # fmt: skip
    """Let pedestrian k, which stands at (x, y), m, take another posture when it is time.

    Args:
        idling, draws: updated.
        k: index of the pedestrian.
        tick: that begins.
        x, y: where it stands, m.
        walkers: directions of the bodies.
        size: radius of the circle around its body, m.
        solids: walls and furniture.
        restlessness: factor of the frequency and of the size of the changes.
        side: of the rules, +1 or -1: a mirrored scene gives the mirrored posture.
        dt: tick, s.
    """
    if tick < idling.posture_until[k]:
        return
    pause = uniform_between(draws, k, POSTURES, _POSTURE_TIME[0], _POSTURE_TIME[1])
    idling.posture_until[k] = tick + max(int(pause / restlessness / dt), 1)
    ahead = restlessness * uniform_between(draws, k, POSTURES, -_SHIFT, _SHIFT)
    left = restlessness * side * uniform_between(draws, k, POSTURES, -_SHIFT, _SHIFT)
    bx, by = walkers.body_direction[k, 0], walkers.body_direction[k, 1]
    idling.shift[k, 0], idling.shift[k, 1] = ahead * bx - left * by, ahead * by + left * bx
    idling.turn[k, 0], idling.turn[k, 1] = rotation(side * uniform_between(draws, k, POSTURES, -_TURN, _TURN))
    if is_within(solids, x, y, size + _ROOM):
        idling.shift[k, 0] = idling.shift[k, 1] = 0.0


@subroutine
def stand_straight(idling: Idling, k: int) -> None:
    """End the small motions of pedestrian k, which walks."""
    idling.shift[k, 0] = idling.shift[k, 1] = idling.turn[k, 1] = 0.0
    idling.turn[k, 0], idling.look[k, 0], idling.look[k, 1], idling.looks_at[k] = 1.0, 1.0, 0.0, -1


@subroutine
def look_round(
    idling: Idling, k: int, tick: int, humans: Array, walkers: Walkers, facing_x: float, facing_y: float, draws: Draws,
    side: float, dt: float,
) -> Vector:  # fmt: skip
    """The direction in which pedestrian k looks, which stands and has nothing to look at; a unit vector.

    Args:
        idling, draws: updated.
        k: index of the pedestrian.
        tick: that begins.
        humans: columns of `core.humans`.
        walkers: of whom one that passes is looked at.
        facing_x, facing_y: direction that the body turns to, unit vector.
        side: of the rules, +1 or -1.
        dt: tick, s.
    """
    if tick >= idling.look_until[k]:
        was_ahead = idling.look[k, 0] == 1.0 and idling.looks_at[k] < 0
        low, high = _LOOK_TIME if was_ahead else _LOOK_PAUSE
        idling.look_until[k] = tick + max(int(uniform_between(draws, k, POSTURES, low, high) / dt), 1)
        idling.looks_at[k], idling.look[k, 0], idling.look[k, 1] = -1, 1.0, 0.0
        if was_ahead:
            idling.looks_at[k] = _nearest_passing(k, humans, walkers)
            angle = side * uniform_between(draws, k, POSTURES, -_LOOK_ANGLE, _LOOK_ANGLE)
            idling.look[k, 0], idling.look[k, 1] = rotation(angle)
    other = idling.looks_at[k]
    if other >= 0:
        return unit_or(humans[other, X] - humans[k, X], humans[other, Y] - humans[k, Y], 0.3, facing_x, facing_y)
    c, s = idling.look[k, 0], idling.look[k, 1]
    return facing_x * c - facing_y * s, facing_x * s + facing_y * c


@subroutine
def _nearest_passing(k: int, humans: Array, walkers: Walkers) -> int:
    """The nearest walker in view of pedestrian k; -1 without one."""
    nearest, least = -1, _PASSING_RANGE
    for n in range(walkers.neighbour_start[k], walkers.neighbour_start[k + 1]):
        j = walkers.neighbour[n]
        dx, dy = humans[j, X] - humans[k, X], humans[j, Y] - humans[k, Y]
        distance = length(dx, dy)
        is_ahead = dx * humans[k, BODY_X] + dy * humans[k, BODY_Y] > _PASSING_COSINE * distance
        if walkers.walks[j] and walkers.attention[n] > 0.0 and distance < least and is_ahead:
            nearest, least = int(j), distance
    return nearest
