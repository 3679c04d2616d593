"""How fast one may walk with somebody ahead: the one rule that queues, doors and full corridors rest on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import Array


@dataclass(frozen=True, slots=True)
class Strip:
    """What a walker needs ahead.

    Attributes:
        breadth: m, half of its width for two of a person's size.
        distance: m, gap that is left when all stand; below 0: they would touch before they stop.
        time: s, in which the gap beyond that would be walked.
    """

    breadth: float
    distance: float
    time: float


def free_speed(ahead: Array, aside: Array, touching: Array, weight: Array, strip: Strip) -> Array:
    """The speed at which nobody ahead is run into: the least over all of (gap - distance) / time.

    The gap is from outline to outline along the way; it grows without bound towards the edge of the strip, so that
    nobody counts of a sudden.

    Args:
        ahead, aside: (M, M), m, of row j from column i, along and across the way that i wants to go.
        touching: (M, M), m, how far apart their centres are when they touch.
        weight: (M, M), how much column i minds row j: gaps to those who count less seem wider.
        strip: what is needed ahead.

    Returns:
        (M,), m/s, 0 or more; inf where nobody is ahead.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge is ours.
    """
    edge = (aside * aside) / (strip.breadth * strip.breadth)
    share = weight * (1.0 - edge * edge)
    counts = (ahead > 0.0) & (share > 0.0)
    gap = (ahead - touching - strip.distance) / (np.where(counts, share, 1.0) * strip.time)
    least: Array = np.minimum.reduce(np.where(counts, gap, np.inf), axis=0)
    return np.maximum(least, 0.0)
