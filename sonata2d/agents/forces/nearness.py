"""Nobody likes another too near, least of all in front."""

from __future__ import annotations

import numpy as np

from ...exact import Array, exp


def nearness_acceleration(
    dx: Array,
    dy: Array,
    looking: Array,
    weight: Array,
    touching: Array,
    *,
    strength: float,
    reach: float,
    anisotropy: float,
) -> Array:
    """Push away from who is near now.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        looking: (M, 2), unit vectors that say where ahead is, or zero: then all sides weigh alike.
        weight: (M, M), how much column i minds row j.
        touching: (M, M), m, distance of their centres when they touch.
        strength: m/s2, at touch.
        reach: m, in which the push falls to 1/e.
        anisotropy: 0..1, how much those behind still count.

    Returns:
        (M, 2), m/s2, on column i.

    Source: Helbing & Johansson, Encyclopedia of Complexity (2009), Pedestrian, Crowd and Evacuation Dynamics, eqs 5-7.
    """
    d = np.maximum(np.sqrt(dx * dx + dy * dy), 0.01)
    cosine = (dx * looking[:, 0] + dy * looking[:, 1]) / d
    seen = anisotropy + (1.0 - anisotropy) * (0.5 + 0.5 * cosine)
    push = weight * seen * (-strength) * exp(np.minimum(touching - d, 0.0) / reach) / d
    return np.stack((np.add.reduce(push * dx, axis=0), np.add.reduce(push * dy, axis=0)), axis=1)
