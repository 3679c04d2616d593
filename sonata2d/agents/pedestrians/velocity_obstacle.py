"""A course past one moving disc at a wanted distance: the nearest velocity outside its velocity obstacle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.geometry import Barriers
from ...core.portable_math import Array
from ...core.vectors import lengths

HORIZON, LATEST = 5.0, 3.0  # s to the closest approach: from the one on a course is changed, from the other in full
BEHIND = 0.25  # m/s, by which a larger change of course is preferred for passing behind
KEEP = 0.25  # m/s, by which it is for the side chosen before
AROUND = 0.6  # share of the pace that is kept by who is too near and goes round
AT_WALL = 0.5  # s, in which nobody on a changed course gets to a wall
BACK = 0.8  # 1/s, by which who is too near makes room


def held_by_walls(position: Array, radius: Array, barriers: Barriers) -> Callable[[Array], Array]:
    """What walls and furniture leave of velocities, (N, 2), m/s: to each of them no faster than gap / `AT_WALL`.

    Two of them are minded, those that are most in the way: enough for a corner.
    """
    if not len(barriers):
        return lambda velocity: velocity
    everybody, found = np.arange(len(position)), list[tuple[Array, Array, Array]]()

    def held(velocity: Array) -> Array:
        if not found:  # most of the time nobody asks
            x, y = barriers.towards(position)
            apart = np.maximum(np.sqrt(x * x + y * y), 1e-6)
            found.append((x / apart, y / apart, np.maximum(apart - barriers.radius[:, None] - radius, 0.0) / AT_WALL))
        x, y, most = found[0]
        for _ in range(2):
            excess = velocity[:, 0] * x + velocity[:, 1] * y - most
            worst = excess.argmax(axis=0)
            less = np.maximum(excess[worst, everybody], 0.0)
            velocity = velocity - np.stack((x[worst, everybody] * less, y[worst, everybody] * less), axis=1)
        return velocity

    return held


def course_past(
    apart: Array,
    wish: Array,
    velocity: Array,
    room: Array,
    passing: Array,
    side: int,
    held: Callable[[Array], Array] = lambda velocity: velocity,
) -> tuple[Array, Array]:
    """The velocities nearest to the wished ones that pass a moving disc at a distance.

    With p the vector to the disc, R the distance to keep, u the wish and v the disc's velocity, w = u − v is the way
    relative to it. It comes nearer than R where w lies within the cone round p whose half-angle has the sine R/|p|.
    Then w is projected onto one edge l of that cone: u′ = v + l (l·w). Of the two edges the one that changes u less is
    taken, with a bonus for passing behind the disc and for the side taken before, and a loss for what walls forbid.
    Who is nearer than R, and would come nearer still, goes round and backs off.

    Args:
        apart: (N, 2), m, from each person to the disc.
        wish: (N, 2), m/s.
        velocity: (2,), m/s, of the disc.
        room: (N,), m, from centre to centre.
        passing: (N,), the side taken before: +1 to the left of p, -1 to the right, 0 none.
        side: +1 passes on the right where both sides are alike, -1 on the left.
        held: what walls leave of velocities, (N, 2), m/s.

    Returns:
        (N, 2), m/s, and the side taken, (N,), 0 where the wish stands.

    Source: Fiorini & Shiller, Int. J. Robotics Research 17 (1998) 760, for the velocity obstacle.
    """
    way = wish - velocity
    distance = np.maximum(lengths(apart), 1e-6)
    p = apart / distance[:, None]
    closing, across = _dot(way, p), _cross(p, way)
    pace = np.maximum(lengths(way), 1e-6)
    miss = np.abs(across) * distance / pace
    until = closing * distance / (pace * pace)
    meets = (closing > 0.0) & (miss < room) & (until < HORIZON)
    if not meets.any():
        return wish, np.zeros(len(wish))
    sine = np.minimum(room / distance, 1.0)
    cosine = np.sqrt(1.0 - sine * sine)
    behind = _cross(p, np.zeros_like(p) + velocity)  # > 0: the disc goes to the left, so the right is behind it
    edges = [_edge(p, way, cosine, sine, sign, (distance - room) * BACK, pace) for sign in (1.0, -1.0)]
    costs = [
        lengths(edge - way)
        + lengths(held(velocity + edge) - velocity - edge)
        + BEHIND * (sign * behind > 0.05)
        - KEEP * (passing == sign)
        + 1e-6 * (sign * side > 0.0)
        for edge, sign in zip(edges, (1.0, -1.0), strict=True)
    ]
    taken = np.where(costs[0] < costs[1], 1.0, -1.0)
    part = np.minimum((HORIZON - until) / (HORIZON - LATEST), 1.0)[:, None]
    edge = np.where((taken > 0.0)[:, None], edges[0], edges[1])
    new = np.where(meets[:, None], wish + (velocity + edge - wish) * part, wish)
    return new, np.where(meets, taken, 0.0)


def _edge(p: Array, way: Array, cosine: Array, sine: Array, sign: float, inside: Array, pace: Array) -> Array:
    """The relative way (N, 2) along the cone's left (sign 1) or right edge; for who is inside, round and off."""
    left = np.stack((-p[:, 1], p[:, 0]), axis=1) * sign
    edge = p * cosine[:, None] + left * sine[:, None]
    along = np.maximum(_dot(edge, way), 0.0)
    round_ = np.maximum(along, AROUND * pace)
    is_inside = inside < 0.0
    off: Array = edge * np.where(is_inside, round_, along)[:, None]
    return off + p * np.minimum(inside, 0.0)[:, None]


def _dot(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
