"""The velocity nearest to a wish that keeps to half-planes: a small linear program, in plain floats.

Constraints are taken in the order in which they come: chance has no part in it, so the same constraints give the same
bits. (Taken in random order the expected time is linear; the optimum is the same in any order.)

Source: the incremental algorithm of de Berg, Cheong, van Kreveld & Overmars, Computational Geometry (3rd ed., 2008),
chapter 4, as van den Berg et al. (2011) use it for ORCA.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...geometry import Point

HalfPlane = tuple[float, float, float]  # a, b, c of a x + b y >= c

_PARALLEL = 1e-9
_FAR = 1e6  # m/s: the velocity nearest to a point so far off is the one furthest in its direction


def chosen_velocity(hard: Sequence[HalfPlane], soft: Sequence[HalfPlane], wish: Point, most: float) -> Point:
    """The velocity nearest to a wish; where not all can be kept to, the one whose worst breach of the soft is least.

    Args:
        hard: half-planes to be kept to in any case, m/s.
        soft: half-planes with normals of length 1, to be kept to if possible, m/s.
        wish: m/s.
        most: m/s, the greatest speed.

    Returns:
        m/s; where not even the hard can be kept to, the best for those that come first.
    """
    velocity, kept = nearest_velocity([*hard, *soft], wish, most)
    if kept < len(hard) + len(soft):
        return _least_breach(hard, soft, velocity, max(kept - len(hard), 0), most)
    return velocity


def nearest_velocity(planes: Sequence[HalfPlane], wish: Point, most: float) -> tuple[Point, int]:
    """The velocity nearest to a wish within half-planes and the greatest speed.

    Args:
        planes: half-planes, m/s.
        wish: m/s.
        most: m/s.

    Returns:
        The velocity, m/s, and how many of the half-planes, from the first on, could be kept to together.
    """
    size = math.sqrt(wish[0] * wish[0] + wish[1] * wish[1])
    part = most / size if size > most else 1.0
    x, y = wish[0] * part, wish[1] * part
    for k, (a, b, c) in enumerate(planes):
        if a * x + b * y >= c:
            continue
        found = _on_edge(planes, k, wish, most)
        if found is None:
            return (x, y), k
        x, y = found
    return (x, y), len(planes)


def _on_edge(planes: Sequence[HalfPlane], k: int, wish: Point, most: float) -> Point | None:
    """The same on the edge of half-plane k, kept to those before it; None where there is no such velocity."""
    a, b, c = planes[k]
    size = math.sqrt(a * a + b * b)
    a, b, c = a / size, b / size, c / size
    room = most * most - c * c
    if room < 0.0:
        return None
    high = math.sqrt(room)
    low = -high  # the edge is (a, b) c + (b, -a) t
    for e, f, g in planes[:k]:
        slope, lack = e * b - f * a, g - c * (e * a + f * b)
        if abs(slope) <= _PARALLEL:
            if lack > _PARALLEL:
                return None
        elif slope > 0.0:
            low = max(low, lack / slope)
        else:
            high = min(high, lack / slope)
        if low > high:
            return None
    t = min(max(wish[0] * b - wish[1] * a, low), high)
    return a * c + b * t, b * c - a * t


def _least_breach(hard: Sequence[HalfPlane], soft: Sequence[HalfPlane], start: Point, first: int, most: float) -> Point:
    """The velocity whose worst breach of the soft half-planes is least.

    It solves for velocity and breach d, n·v + d >= c: a program in three dimensions. A half-plane that is breached by
    more than d so far holds with equality at the new optimum, which leaves a program in two: to go furthest along its
    normal while no earlier one is breached by more.
    """
    (x, y), breach = start, 0.0
    for k in range(first, len(soft)):
        a, b, c = soft[k]
        if c - (a * x + b * y) <= breach:
            continue
        rivals = [(e - a, f - b, g - c) for e, f, g in soft[:k] if abs(e - a) + abs(f - b) > _PARALLEL]
        planes = [*hard, *rivals]
        found, kept = nearest_velocity(planes, (a * _FAR, b * _FAR), most)
        if kept == len(planes):  # else rounding is at work: stay with what there is
            x, y = found
        breach = max(breach, c - (a * x + b * y))
    return x, y
