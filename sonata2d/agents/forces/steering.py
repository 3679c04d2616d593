"""Which way past whoever stands in the way: a few directions are weighed by how far they get one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import PI, Array, exp, headings
from .headway import Strip, free_speed

ANGLES = (0.0, 25.0, -25.0, 50.0, -50.0, 75.0, -75.0)  # degrees from the way that one wants to go, left positive
_TURNS = headings(np.array(ANGLES) * (PI / 180.0))  # (K, 2)


@dataclass(frozen=True, slots=True)
class Choice:
    """How a way is chosen.

    Attributes:
        outlook: s, that one looks ahead for a way.
        side: m/s, by which directions to the right promise more.
        habit: m/s, by which the direction that one goes already promises more: a side once taken is kept.
        decision: m/s, the loss of promise at which a direction counts 1/e.
        queueing: 0..1, how little those who go the same way are walked round: 1 follows them, 0 overtakes.
    """

    outlook: float
    side: float
    habit: float
    decision: float
    queueing: float


def steered(
    dx: Array, dy: Array, velocity: Array, direction: Array, desired_speed: Array, touching: Array, weight: Array,
    *, choice: Choice, strip: Strip,
) -> tuple[Array, Array]:  # fmt: skip
    """Where to walk, and how fast, so as to get on best.

    Each direction promises the speed that its gap allows, times its cosine with the way; who comes against one counts
    as so much nearer, and who goes away as so much farther off, as they walk in the outlook. Directions are mixed by
    their promises, so that a small change of the world is a small change of the way.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        direction: (M, 2), unit vectors, or zero for who does not walk.
        desired_speed: (M,), m/s.
        touching, weight, strip: as in `free_speed`.
        choice: how they choose.

    Returns:
        Unit vectors (M, 2), or zero; and (M,), m/s.

    Source: the idea is that of Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    ex, ey = direction[:, 0], direction[:, 1]
    ahead, aside = dx * ex + dy * ey, dx * ey - dy * ex
    vx, vy = velocity[:, 0, None] * choice.outlook, velocity[:, 1, None] * choice.outlook
    later, off = vx * ex + vy * ey, vx * ey - vy * ex  # m, that row j walks along and across the way of column i
    free = free_speed(ahead, aside, touching, weight, strip)
    soon = free_speed(_later(ahead, later), aside, touching, weight, strip)
    held = np.flatnonzero((np.minimum(free, soon) < desired_speed) & (direction != 0.0).any(axis=1))
    if len(held) == 0:
        return direction, np.minimum(free, desired_speed)
    held = np.append(held, held[:1])  # an array one wide would be summed in another order
    promise = np.empty((len(ANGLES), len(held)))
    own, wanted = direction[held], desired_speed[held]
    ahead, aside, touching, weight = ahead[:, held], aside[:, held], touching[:, held], weight[:, held]
    later, off = later[:, held], off[:, held]
    alike = direction[:, 0, None] * own[:, 0] + direction[:, 1, None] * own[:, 1]
    in_the_way = weight * (1.0 - choice.queueing * np.minimum(np.maximum(2.0 * alike, 0.0), 1.0))
    goes = _going(velocity[held], own)
    for k, (c, s) in enumerate(_TURNS.tolist()):
        there = _later(ahead * c - aside * s, later * c - off * s)
        speed = free_speed(there, ahead * s + aside * c, touching, in_the_way, strip)
        promise[k] = np.minimum(speed, wanted) * c - choice.side * s + choice.habit * (goes[:, 0] * c + goes[:, 1] * s)
    share = exp((promise - np.maximum.reduce(promise, axis=0)) / choice.decision)
    x, y = (np.add.reduce(share * _TURNS[:, k, None], axis=0) for k in (0, 1))
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    x, y = x / size, y / size
    way, pace = direction.copy(), np.minimum(free, desired_speed)
    way[held, 0], way[held, 1] = own[:, 0] * x - own[:, 1] * y, own[:, 1] * x + own[:, 0] * y
    there, across = ahead * x - aside * y, ahead * y + aside * x
    pace[held] = np.minimum(free_speed(there, across, touching, weight, strip), wanted)
    return way, pace


def _going(velocity: Array, own: Array) -> Array:
    """(B, 2): the way they go now, ahead and left of the way they want to go; below 1 m/s less than a unit vector."""
    x, y = velocity[:, 0], velocity[:, 1]
    size = np.maximum(np.sqrt(x * x + y * y), 1.0)
    return np.stack(((x * own[:, 0] + y * own[:, 1]) / size, (y * own[:, 0] - x * own[:, 1]) / size), axis=1)


def _later(ahead: Array, by: Array) -> Array:
    """How far ahead others count as being, m: those ahead stay ahead."""
    later: Array = np.where(ahead > 0.0, np.maximum(ahead + by, 1e-3), ahead)
    return later
