"""How fast one may walk with somebody ahead: the one rule that queues, doors and full corridors rest on."""

from __future__ import annotations

import numpy as np

from ...exact import Array


def free_speed(
    ahead: Array, aside: Array, touching: Array, weight: Array, *, breadth: float, distance: float, time: float
) -> Array:
    """The speed at which nobody ahead is run into: the least over all of (gap - distance) / time.

    The gap is from outline to outline along the way; it grows without bound towards the edge of the strip that the
    walker needs, so that nobody counts of a sudden.

    Args:
        ahead, aside: (M, M), m, of row j from column i, along and across the way that i wants to go.
        touching: (M, M), m, how far apart their centres are when they touch.
        weight: (M, M), how much column i minds row j: gaps to those who count less seem wider.
        breadth: m, half of the strip's width for two of person's size.
        distance: m, gap that is left when all stand.
        time: s, in which the gap beyond that would be walked.

    Returns:
        (M,), m/s, 0 or more; inf where nobody is ahead.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge is ours.
    """
    edge = (aside * aside) / (breadth * breadth)
    share = weight * (1.0 - edge * edge)
    counts = (ahead > 0.0) & (share > 0.0)
    gap = (ahead - touching - distance) / (np.where(counts, share, 1.0) * time)
    least: Array = np.minimum.reduce(np.where(counts, gap, np.inf), axis=0)
    return np.maximum(least, 0.0)
