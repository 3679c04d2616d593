"""Evasion of one moving disc: the nearest velocity outside its velocity obstacle."""

from __future__ import annotations

import math

from ...core.compiled.kernel import subroutine
from ...core.compiled.scalar import Vector, length
from ...core.portable_math import Array

_HORIZON, _FULL_HORIZON = 4.0, 2.4  # s to the closest approach: where evasion begins, and where it is complete
_SWERVING = 3.0  # cost of a change across the agent's own direction over that of a change along it
_WALKING_SPEED = 0.5  # m/s, from which on a swerve costs so much
_BEHIND_BONUS = 0.15  # m/s, cost advantage of passing behind the disc
_HABIT_BONUS = 0.25  # m/s, cost advantage of the side chosen before
_MINIMUM_SPEED_FRACTION = 0.6  # of the relative speed, for agents that are too near and walk round the disc
WALL_TIME = 0.5  # s, within which an evading agent must not reach a wall
_RETREAT_RATE = 0.8  # 1/s, rate at which agents that are too near restore the distance


@subroutine
def limited_by_walls(walls: Array, vx: float, vy: float) -> Vector:
    """Limit a velocity towards walls and furniture to gap / `WALL_TIME`, m/s.

    The two barriers that are violated most are considered, which is enough for a corner.
    """
    for _ in range(2):
        worst, reduction = -1, 0.0
        for k in range(walls.shape[0]):
            excess = vx * walls[k, 0] + vy * walls[k, 1] - walls[k, 2]
            if excess > reduction:
                worst, reduction = k, excess
        if worst >= 0:
            vx, vy = vx - walls[worst, 0] * reduction, vy - walls[worst, 1] * reduction
    return vx, vy


@subroutine
def in_conflict(x: float, y: float, vx: float, vy: float, distance: float) -> bool:
    """Whether an agent would come nearer to the disc than the distance within `_HORIZON`.

    Args:
        x, y: from the agent to the disc, m.
        vx, vy: velocity of the agent relative to the disc, m/s.
        distance: of centres to keep, m.
    """
    size = max(math.sqrt(x * x + y * y), 1e-6)
    px, py = x / size, y / size
    closing, across = vx * px + vy * py, px * vy - py * vx
    speed = max(math.sqrt(vx * vx + vy * vy), 1e-6)
    miss_distance = abs(across) * size / speed
    time = closing * size / (speed * speed)
    return closing > 0.0 and miss_distance < distance and time < _HORIZON


@subroutine
def evasive_velocity(
    x: float, y: float, preferred_x: float, preferred_y: float, disc_vx: float, disc_vy: float, distance: float,
    previous_side: float, side: float, walls: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """The velocity nearest to the preferred one that passes a moving disc at a given distance, if `in_conflict`.

    With p the vector to the disc, R the distance to keep, u the preferred velocity and v the disc's velocity, w = u - v
    is the relative velocity. The agent would come nearer than R where w lies within the cone around p whose half-angle
    has the sine R/|p|. Then w is moved to the nearest point of one edge l of that cone, u' = v + a l, where changes
    across u count more than those along it: people rather slow down than swerve. Of the two edges the one that changes
    u less is taken, with a bonus for passing behind the disc and for the previous side, and a penalty for what walls
    forbid. An agent that is nearer than R and still approaches walks round the disc and backs off.

    Args:
        x, y: m, from the agent to the disc.
        preferred_x, preferred_y: m/s.
        disc_vx, disc_vy: m/s.
        distance: m, the distance of centres to keep.
        previous_side: the side chosen in the previous tick: +1 to the left of p, -1 to the right, 0 none.
        side: +1 passes on the right where both sides cost the same, -1 on the left.
        walls: from `fill_walls`.

    Returns:
        Velocity (x, y), m/s, and the side chosen.

    Source: Fiorini & Shiller, Int. J. Robotics Research 17 (1998) 760, for the velocity obstacle.
    """
    wx, wy = preferred_x - disc_vx, preferred_y - disc_vy  # relative velocity
    centre_distance = max(math.sqrt(x * x + y * y), 1e-6)
    px, py = x / centre_distance, y / centre_distance
    speed = max(math.sqrt(wx * wx + wy * wy), 1e-6)
    time = (wx * px + wy * py) * centre_distance / (speed * speed)  # to the closest approach
    sine = min(distance / centre_distance, 1.0)
    cosine = math.sqrt(1.0 - sine * sine)
    behind = px * disc_vy - py * disc_vx  # > 0: the disc moves to the left, so the right is behind it
    own = length(preferred_x, preferred_y)
    # Unit vector of the course, and relative cost of a change across it; all directions cost the same at rest.
    cost_x, cost_y = (preferred_x / own, preferred_y / own) if own > 1e-6 else (px, py)
    metric = (cost_x, cost_y, 1.0 + (_SWERVING - 1.0) * min(own / _WALKING_SPEED, 1.0))
    retreat = (centre_distance - distance) * _RETREAT_RATE
    best, chosen, edge_x, edge_y = 0.0, 0.0, 0.0, 0.0
    for n in range(2):
        sign = 1.0 - 2.0 * n
        ex, ey = _edge_velocity(px, py, wx, wy, cosine, sine, sign, retreat, speed, metric)
        lx, ly = limited_by_walls(walls, disc_vx + ex, disc_vy + ey)
        lx, ly = lx - disc_vx - ex, ly - disc_vy - ey
        cost = _size(ex - wx, ey - wy, metric)
        cost = cost + math.sqrt(lx * lx + ly * ly)
        cost = cost + (_BEHIND_BONUS if sign * behind > 0.05 else 0.0)
        cost = cost - (_HABIT_BONUS if previous_side == sign else 0.0)
        cost = cost + (1e-6 if sign * side > 0.0 else 0.0)
        if n == 0 or not best < cost:
            best, chosen, edge_x, edge_y = cost, sign, ex, ey
    fraction = min((_HORIZON - time) / (_HORIZON - _FULL_HORIZON), 1.0)
    return (
        preferred_x + (disc_vx + edge_x - preferred_x) * fraction,
        preferred_y + (disc_vy + edge_y - preferred_y) * fraction,
        chosen,
    )


@subroutine
def _edge_velocity(
    px: float, py: float, wx: float, wy: float, cosine: float, sine: float, sign: float, retreat: float, speed: float,
    metric: tuple[float, float, float],
) -> Vector:  # fmt: skip
    """The relative velocity along the cone's left (sign 1) or right (sign -1) edge, m/s.

    Where `retreat`, m/s, is negative, the agent is too near: it walks round the disc and backs off at that speed.
    """
    lx, ly = -py * sign, px * sign
    ex, ey = px * cosine + lx * sine, py * cosine + ly * sine
    c, s, across = metric
    dot = (ex * c + ey * s) * (wx * c + wy * s) + across * across * (ey * c - ex * s) * (wy * c - wx * s)
    size = _size(ex, ey, metric)
    along = max(dot / (size * size), 0.0)
    if retreat < 0.0:
        along = max(along, _MINIMUM_SPEED_FRACTION * speed)
    back = min(retreat, 0.0)
    return ex * along + px * back, ey * along + py * back


@subroutine
def _size(x: float, y: float, metric: tuple[float, float, float]) -> float:
    """Size of a change of velocity, where changes across a direction, (x, y), count by a factor, the third number."""
    return length(x * metric[0] + y * metric[1], metric[2] * (y * metric[0] - x * metric[1]))
