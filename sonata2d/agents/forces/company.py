"""What keeps people who walk together beside one another, weakly, as the recorded ones do."""

from __future__ import annotations

import numpy as np

from ...exact import Array

FURTHEST = 1.0  # m, beyond which a lag or a distance pulls no harder


def company_acceleration(
    dx: Array, dy: Array, direction: Array, member: Array, bond: Array,
    *, cohesion: float, spacing: float, abreast: float,
) -> Array:  # fmt: skip
    """Draw level with the others of one's group, and close up to them.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        direction: (M, 2), unit vectors to where each wants to go, or zero.
        member: (M, M), 1 where row j walks in column i's group (not i itself), else 0.
        bond: (M,), 0..1, how much each keeps to the group.
        cohesion: 1/s2, pull to the centre of the others for each metre beyond where it would be if all were abreast.
        spacing: m, between neighbours abreast.
        abreast: 1/s2, pull along the way for each metre that they are ahead, or behind.

    Returns:
        (M, 2), m/s2, zero for who walks alone.

    Source: the aims are those of Moussaïd et al., PLoS ONE 5 (2010) e10047; the law is ours: who is behind hurries as
    much as who is ahead waits, so that a group keeps its pace.
    """
    count = np.maximum(np.add.reduce(member, axis=0), 1.0)
    wide = spacing * 0.5 * (count + 1.0)
    cx, cy = np.add.reduce(member * dx, axis=0) / count, np.add.reduce(member * dy, axis=0) / count
    ex, ey = direction[:, 0], direction[:, 1]
    lag = bond * abreast * np.minimum(np.maximum(cx * ex + cy * ey, -FURTHEST), FURTHEST)
    apart = np.sqrt(cx * cx + cy * cy)
    pull = bond * cohesion * np.minimum(np.maximum(apart - wide, 0.0), FURTHEST) / np.maximum(apart, 1e-6)
    return np.stack((lag * ex + pull * cx, lag * ey + pull * cy), axis=1)
