"""Which way past whoever stands in the way: a few directions are weighed by how far they get one."""

from __future__ import annotations

import numpy as np

from ...exact import PI, Array, exp, headings
from .headway import free_speed

ANGLES = (0.0, 25.0, -25.0, 50.0, -50.0, 75.0, -75.0)  # degrees from the way that one wants to go, left positive
_TURNS = headings(np.array(ANGLES) * (PI / 180.0))  # (K, 2)


def steered(
    dx: Array, dy: Array, direction: Array, desired_speed: Array, touching: Array, weight: Array,
    *, side: float, decision: float, queueing: float, breadth: float, distance: float, time: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Where to walk, and how fast, so as to get on best.

    Each direction promises the speed that its gap allows, times its cosine with the way. They are mixed by their
    promises, so that a small change of the world is a small change of the way.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        direction: (M, 2), unit vectors, or zero for who does not walk.
        desired_speed: (M,), m/s.
        touching, weight, breadth, distance, time: as in `free_speed`.
        side: m/s, by which directions to the right promise more.
        decision: m/s, the loss of promise at which a direction counts 1/e.
        queueing: 0..1, how little those who go the same way are walked round: 1 follows them, 0 overtakes.

    Returns:
        Unit vectors (M, 2), or zero; and (M,), m/s.

    Source: the idea is that of Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    limits = {"breadth": breadth, "distance": distance, "time": time}
    ahead, aside = dx * direction[:, 0] + dy * direction[:, 1], dx * direction[:, 1] - dy * direction[:, 0]
    free = free_speed(ahead, aside, touching, weight, **limits)
    held = np.flatnonzero((free < desired_speed) & (direction != 0.0).any(axis=1))
    if len(held) == 0:
        return direction, np.minimum(free, desired_speed)
    held = np.append(held, held[:1])  # an array one wide would be summed in another order
    promise = np.empty((len(ANGLES), len(held)))
    own, wanted = direction[held], desired_speed[held]
    ahead, aside, touching, weight = ahead[:, held], aside[:, held], touching[:, held], weight[:, held]
    alike = direction[:, 0, None] * own[:, 0] + direction[:, 1, None] * own[:, 1]
    in_the_way = weight * (1.0 - queueing * np.maximum(alike, 0.0))
    for k, (c, s) in enumerate(_TURNS.tolist()):
        there = free_speed(ahead * c - aside * s, ahead * s + aside * c, touching, in_the_way, **limits)
        promise[k] = np.minimum(there, wanted) * c - side * s
    share = exp((promise - np.maximum.reduce(promise, axis=0)) / decision)
    x, y = (np.add.reduce(share * _TURNS[:, k, None], axis=0) for k in (0, 1))
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    x, y = x / size, y / size
    way, pace = direction.copy(), np.minimum(free, desired_speed)
    way[held, 0], way[held, 1] = own[:, 0] * x - own[:, 1] * y, own[:, 1] * x + own[:, 0] * y
    pace[held] = np.minimum(
        free_speed(ahead * x - aside * y, ahead * y + aside * x, touching, weight, **limits), wanted
    )
    return way, pace
