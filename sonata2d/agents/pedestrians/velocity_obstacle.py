"""Evasion of one moving disc: the nearest velocity outside its velocity obstacle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.geometry import Barriers
from ...core.portable_math import Array
from ...core.vectors import lengths

HORIZON, FULL_HORIZON = 5.0, 3.0  # s to the closest approach: evasion begins at the first and is complete at the second
BEHIND_BONUS = 0.25  # m/s, cost advantage of passing behind the disc
HABIT_BONUS = 0.25  # m/s, cost advantage of the side chosen before
MINIMUM_SPEED_FRACTION = 0.6  # of the relative speed, for agents that are too near and walk round the disc
WALL_TIME = 0.5  # s, within which an evading agent must not reach a wall
RETREAT_RATE = 0.8  # 1/s, rate at which agents that are too near restore the distance

VelocityLimit = Callable[[Array], Array]  # (N, 2) to (N, 2), m/s


def limit_by_walls(position: Array, radius: Array, barriers: Barriers) -> VelocityLimit:
    """A function that limits velocities, (N, 2), m/s, towards walls and furniture to gap / `WALL_TIME`.

    For each agent it considers the two barriers that are violated most, which is enough for a corner.

    Args:
        position: (N, 2), m.
        radius: (N,), m.
        barriers: thick segments.
    """
    if not len(barriers):
        return lambda velocity: velocity
    rows, cached = np.arange(len(position)), list[tuple[Array, Array, Array]]()

    def limit(velocity: Array) -> Array:
        if not cached:  # computed on first use: in most ticks the function is not called
            x, y = barriers.towards(position)
            distance = np.maximum(np.sqrt(x * x + y * y), 1e-6)
            gap = np.maximum(distance - barriers.radius[:, None] - radius, 0.0)
            cached.append((x / distance, y / distance, gap / WALL_TIME))
        x, y, maximum = cached[0]
        for _ in range(2):
            excess = velocity[:, 0] * x + velocity[:, 1] * y - maximum
            worst = excess.argmax(axis=0)
            reduction = np.maximum(excess[worst, rows], 0.0)
            velocity = velocity - np.stack((x[worst, rows] * reduction, y[worst, rows] * reduction), axis=1)
        return velocity

    return limit


def evasive_velocity(
    offset: Array,
    preferred: Array,
    disc_velocity: Array,
    distance: Array,
    previous_side: Array,
    side: int,
    limit: VelocityLimit = lambda velocity: velocity,
) -> tuple[Array, Array]:
    """The velocities nearest to the preferred ones that pass a moving disc at a given distance.

    With p the vector to the disc, R the distance to keep, u the preferred velocity and v the disc's velocity, w = u - v
    is the relative velocity. The agent would come nearer than R where w lies within the cone around p whose half-angle
    has the sine R/|p|. Then w is projected onto one edge l of that cone: u' = v + l (l·w). Of the two edges the one
    that changes u less is taken, with a bonus for passing behind the disc and for the previous side, and a penalty for
    what walls forbid. An agent that is nearer than R and still approaches walks round the disc and backs off.

    Args:
        offset: (N, 2), m, from each agent to the disc.
        preferred: (N, 2), m/s.
        disc_velocity: (2,), m/s.
        distance: (N,), m, the distance of centres to keep.
        previous_side: (N,), the side chosen in the previous tick: +1 to the left of p, -1 to the right, 0 none.
        side: +1 passes on the right where both sides cost the same, -1 on the left.
        limit: limits velocities by walls, (N, 2) to (N, 2), m/s.

    Returns:
        Velocities (N, 2), m/s, and the side chosen, (N,), 0 where the preferred velocity is kept.

    Source: Fiorini & Shiller, Int. J. Robotics Research 17 (1998) 760, for the velocity obstacle.
    """
    relative = preferred - disc_velocity
    centre_distance = np.maximum(lengths(offset), 1e-6)
    p = offset / centre_distance[:, None]
    closing, across = _dot(relative, p), _cross(p, relative)
    speed = np.maximum(lengths(relative), 1e-6)
    miss_distance = np.abs(across) * centre_distance / speed
    time = closing * centre_distance / (speed * speed)  # to the closest approach
    conflict = (closing > 0.0) & (miss_distance < distance) & (time < HORIZON)
    if not conflict.any():
        return preferred, np.zeros(len(preferred))
    sine = np.minimum(distance / centre_distance, 1.0)
    cosine = np.sqrt(1.0 - sine * sine)
    behind = _cross(p, np.zeros_like(p) + disc_velocity)  # > 0: the disc moves to the left, so the right is behind it
    retreat = (centre_distance - distance) * RETREAT_RATE
    edges = [_edge_velocity(p, relative, cosine, sine, sign, retreat, speed) for sign in (1.0, -1.0)]
    costs = [
        lengths(edge - relative)
        + lengths(limit(disc_velocity + edge) - disc_velocity - edge)
        + BEHIND_BONUS * (sign * behind > 0.05)
        - HABIT_BONUS * (previous_side == sign)
        + 1e-6 * (sign * side > 0.0)
        for edge, sign in zip(edges, (1.0, -1.0), strict=True)
    ]
    chosen = np.where(costs[0] < costs[1], 1.0, -1.0)
    fraction = np.minimum((HORIZON - time) / (HORIZON - FULL_HORIZON), 1.0)[:, None]
    edge = np.where((chosen > 0.0)[:, None], edges[0], edges[1])
    velocity = np.where(conflict[:, None], preferred + (disc_velocity + edge - preferred) * fraction, preferred)
    return velocity, np.where(conflict, chosen, 0.0)


def _edge_velocity(
    p: Array, relative: Array, cosine: Array, sine: Array, sign: float, retreat: Array, speed: Array
) -> Array:
    """The relative velocity (N, 2) along the cone's left (sign 1) or right (sign -1) edge.

    Where `retreat`, m/s, is negative, the agent is too near: it walks round the disc and backs off at that speed.
    """
    left = np.stack((-p[:, 1], p[:, 0]), axis=1) * sign
    edge = p * cosine[:, None] + left * sine[:, None]
    along = np.maximum(_dot(edge, relative), 0.0)
    around = np.maximum(along, MINIMUM_SPEED_FRACTION * speed)
    is_too_near = retreat < 0.0
    velocity: Array = edge * np.where(is_too_near, around, along)[:, None]
    return velocity + p * np.minimum(retreat, 0.0)[:, None]


def _dot(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
