"""Giving way before it is needed: people keep off the places where the others will be."""

from __future__ import annotations

import numpy as np

from ...exact import Array, exp


def anticipation_acceleration(
    dx: Array,
    dy: Array,
    velocity: Array,
    weight: Array,
    touching: Array,
    *,
    strength: float,
    reach: float,
    horizon: float,
    side: float,
) -> Array:
    """Push away from where each other will be when both are nearest, if they go on as they do.

    Whom one does not come nearer to counts for nothing, and who is closed in on slowly for little.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        weight: (M, M), how much column i minds row j.
        touching: (M, M), m, distance of their centres when they touch.
        strength: m/s2, where the outlines would touch.
        reach: m, in which the push falls to 1/e.
        horizon: s until then, in which it falls to 1/e.
        side: m, by which the others are seen off to one side, + for the left: who meets head-on evades to the right.

    Returns:
        (M, 2), m/s2, on column i.

    Source: Zanlungo, Ikeda & Kanda, EPL 93 (2011) 68005, eqs 5-7, with a time to the nearest approach for each pair.
    """
    ux, uy = (velocity[:, None, k] - velocity[None, :, k] for k in (0, 1))  # of j as seen from i
    square = ux * ux + uy * uy
    closing = np.maximum(-(dx * ux + dy * uy), 0.0)
    t = np.minimum(closing / np.maximum(square, 1e-4), 10.0)
    closing = np.minimum(closing / np.maximum(np.sqrt(dx * dx + dy * dy), 0.01), 1.0)  # m/s, 1 counts in full
    fx, fy = dx + ux * t, dy + uy * t  # from i to j at the nearest approach
    if side:
        speed = np.sqrt(np.maximum(square, 1e-6))
        off = side * np.where(t > 0.0, 1.0, 0.0) / speed
        fx, fy = fx + uy * off, fy - ux * off  # to the left of the way on which j is met
    d = np.maximum(np.sqrt(fx * fx + fy * fy), 0.01)
    near = exp(np.minimum(touching - d, 0.0) / reach - t / horizon)
    push = weight * closing * (-strength) * near / d
    return np.stack((np.add.reduce(push * fx, axis=0), np.add.reduce(push * fy, axis=0)), axis=1)
