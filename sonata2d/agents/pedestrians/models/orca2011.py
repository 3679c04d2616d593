"""`orca2011`: optimal reciprocal collision avoidance (van den Berg et al., 2011)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....core.geometry import Barriers, Point
from ....core.portable_math import Array, BoolArray
from ....core.scene import Scene
from .base import Walkers, biased_directions, pair_weights

HalfPlane = tuple[float, float, float]  # a, b, c of a x + b y >= c

_PARALLEL = 1e-9
_FAR = 1e6  # m/s: the velocity nearest to a point this far off is the extreme one in that direction


def choose_velocity(
    hard: Sequence[HalfPlane], soft: Sequence[HalfPlane], preferred: Point, maximum_speed: float
) -> Point:
    """The permitted velocity nearest to the preferred one.

    If not all constraints can be satisfied, the velocity that minimises the worst violation of the soft ones.

    Args:
        hard: half-planes that are satisfied first, m/s.
        soft: half-planes with unit normals, satisfied if possible, m/s.
        preferred: m/s.
        maximum_speed: m/s.

    Returns:
        Velocity, m/s. If even the hard constraints conflict, it satisfies those that come first.
    """
    velocity, satisfied = nearest_velocity([*hard, *soft], preferred, maximum_speed)
    if satisfied < len(hard) + len(soft):
        return _minimise_violation(hard, soft, velocity, max(satisfied - len(hard), 0), maximum_speed)
    return velocity


def nearest_velocity(planes: Sequence[HalfPlane], preferred: Point, maximum_speed: float) -> tuple[Point, int]:
    """The velocity nearest to the preferred one within half-planes and the maximum speed.

    Args:
        planes: half-planes, m/s.
        preferred: m/s.
        maximum_speed: m/s.

    Returns:
        The velocity, m/s, and how many of the half-planes, from the first on, can be satisfied together.
    """
    size = math.sqrt(preferred[0] * preferred[0] + preferred[1] * preferred[1])
    scale = maximum_speed / size if size > maximum_speed else 1.0
    x, y = preferred[0] * scale, preferred[1] * scale
    for k, (a, b, c) in enumerate(planes):
        if a * x + b * y >= c:
            continue
        found = _nearest_on_edge(planes, k, preferred, maximum_speed)
        if found is None:
            return (x, y), k
        x, y = found
    return (x, y), len(planes)


def _nearest_on_edge(planes: Sequence[HalfPlane], k: int, preferred: Point, maximum_speed: float) -> Point | None:
    """The nearest velocity on the edge of half-plane k that satisfies all earlier ones; None if there is none."""
    a, b, c = planes[k]
    size = math.sqrt(a * a + b * b)
    a, b, c = a / size, b / size, c / size
    square = maximum_speed * maximum_speed - c * c
    if square < 0.0:  # the edge lies outside the disc of permitted speeds
        return None
    high = math.sqrt(square)
    low = -high  # the edge is (a, b) c + (b, -a) t, low <= t <= high
    for e, f, g in planes[:k]:
        slope, deficit = e * b - f * a, g - c * (e * a + f * b)
        if abs(slope) <= _PARALLEL:
            if deficit > _PARALLEL:
                return None
        elif slope > 0.0:
            low = max(low, deficit / slope)
        else:
            high = min(high, deficit / slope)
        if low > high:
            return None
    t = min(max(preferred[0] * b - preferred[1] * a, low), high)
    return a * c + b * t, b * c - a * t


def _minimise_violation(
    hard: Sequence[HalfPlane], soft: Sequence[HalfPlane], start: Point, first: int, maximum_speed: float
) -> Point:
    """The velocity that minimises the worst violation of the soft half-planes.

    Solves for the velocity v and the violation d, n·v + d >= c: a linear program in three dimensions. A half-plane that
    is violated by more than the current d holds with equality at the new optimum. This leaves a program in two
    dimensions: go as far as possible along its normal while no earlier half-plane is violated by more.

    Args:
        hard, soft, maximum_speed: as in `choose_velocity`.
        start: initial velocity, m/s, which satisfies the soft half-planes before `first`.
        first: index of the first soft half-plane to process.
    """
    (x, y), violation = start, 0.0
    for k in range(first, len(soft)):
        a, b, c = soft[k]
        if c - (a * x + b * y) <= violation:
            continue
        equal_violation = [(e - a, f - b, g - c) for e, f, g in soft[:k] if abs(e - a) + abs(f - b) > _PARALLEL]
        planes = [*hard, *equal_violation]
        found, satisfied = nearest_velocity(planes, (a * _FAR, b * _FAR), maximum_speed)
        if satisfied == len(planes):  # otherwise a rounding error: keep the current velocity
            x, y = found
        violation = max(violation, c - (a * x + b * y))
    return x, y


_TINY = 1e-9


@dataclass(frozen=True, slots=True)
class Orca2011:
    """Parameters. The authors leave them to the user; these are common values for people.

    Source: van den Berg, Guy, Lin & Manocha, "Reciprocal n-body collision avoidance", Robotics Research (ISRR 2009),
    STAR 70, Springer (2011) 3.
    """

    horizon: float = 2.0  # τ, s, to other agents
    wall_horizon: float = 1.0  # s, to walls and furniture
    maximum_speed_ratio: float = 1.3  # v_max / desired speed


@dataclass(frozen=True, slots=True)
class HalfPlanes:
    """The velocities v that each obstacle (row) permits to each agent (column): x v_x + y v_y >= minimum.

    Attributes:
        x, y: (K, M), unit normals.
        minimum: (K, M), m/s.
        is_active: (K, M), False where there is nothing to avoid.
    """

    x: Array
    y: Array
    minimum: Array
    is_active: BoolArray


def reciprocal_half_planes(
    position: Array, velocity: Array, radius: Array, weight: Array, evasion: Array, *, horizon: float, dt: float
) -> HalfPlanes:
    """The velocities with which each agent avoids each other one if both take on their parts of the evasion.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        weight: (M, M), row j, column i: how much i attends to j, in [0, 1]; 0 leaves the pair out.
        evasion: (M, M), the part of the evasion of agent j (row) that agent i (column) takes on: 1/2, or 1.
        horizon: time for which the velocity must be free of collisions, s.
        dt: time within which overlapping agents must separate, s.

    Returns:
        (M, M) half-planes.

    Source: van den Berg et al. (2011), section 4: u is the smallest change of the relative velocity that leaves the
    velocity obstacle VO^τ, n its outward normal there; v >= v_A + u/2 along n.
    """
    px, py = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
    vx, vy = (velocity[None, :, k] - velocity[:, None, k] for k in (0, 1))  # of i relative to j
    r = radius[:, None] + radius[None, :]
    square = px * px + py * py
    leg = np.sqrt(np.maximum(square - r * r, 0.0))  # length of the cone's tangent; 0 for overlapping agents
    arc_x, arc_y, arc_change = _change_to_leave_disc(px, py, vx, vy, r, np.where(leg > 0.0, horizon, dt))
    side = np.where(px * vy - py * vx > 0.0, 1.0, -1.0)  # the nearer leg of the cone: +1 the left one
    safe_square = np.maximum(square, _TINY)
    lx, ly = (px * leg - side * py * r) / safe_square, (py * leg + side * px * r) / safe_square  # along that leg
    on_leg = (leg > 0.0) & ((vx * lx + vy * ly) * horizon >= leg)
    nx, ny = np.where(on_leg, -side * ly, arc_x), np.where(on_leg, side * lx, arc_y)
    change = np.where(on_leg, -(vx * nx + vy * ny), arc_change)  # u · n
    minimum = nx * velocity[None, :, 0] + ny * velocity[None, :, 1] + evasion * weight * change
    return HalfPlanes(nx, ny, minimum, (weight > 0.0) & (nx * nx + ny * ny > 0.5))


def _change_to_leave_disc(
    px: Array, py: Array, vx: Array, vy: Array, r: Array, time: Array
) -> tuple[Array, Array, Array]:
    """Normal and size of the change of velocity that leaves the disc of velocities colliding exactly at `time`."""
    wx, wy = vx - px / time, vy - py / time
    size = np.sqrt(wx * wx + wy * wy)
    is_centre = size <= _TINY  # every normal is equally near: go straight back
    wx, wy = np.where(is_centre, -px, wx), np.where(is_centre, -py, wy)
    length = np.maximum(np.sqrt(wx * wx + wy * wy), _TINY)
    return wx / length, wy / length, r / time - size


def wall_half_planes(position: Array, radius: Array, barriers: Barriers, *, horizon: float, dt: float) -> HalfPlanes:
    """The velocities with which each agent avoids walls and furniture.

    Args:
        position: (M, 2), m.
        radius: (M,), m.
        barriers: K thick segments.
        horizon: time for which the velocity must be free of collisions, s.
        dt: time within which an agent that overlaps a wall must leave it, s.

    Returns:
        (K, M) half-planes. Standing still is always permitted, except to agents that overlap a wall.

    Source: van den Berg et al. (2011), static obstacles: the optimisation velocity is 0, whose nearest point of the
    obstacle in velocity space is the obstacle's nearest point over the horizon.
    """
    x, y = barriers.towards(position)
    d = np.sqrt(x * x + y * y)
    gap = d - barriers.radius[:, None] - radius
    distance = np.maximum(d, _TINY)
    return HalfPlanes(-x / distance, -y / distance, -gap / np.where(gap > 0.0, horizon, dt), d > _TINY)


class Orca2011Model:
    """Each agent takes the velocity nearest to its desired one that is free of collisions for a while.

    Groups are ignored. Agents that stand (as the robot does, for the crowd) or do not attend to another agent do not
    evade it; the other one does the whole evasion.

    Source: van den Berg, Guy, Lin & Manocha, Robotics Research, STAR 70, Springer (2011) 3.
    """

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._dt = scene.barriers, scene.rules.side, scene.rules.dt
        self._parameters = Orca2011()

    def acceleration(self, walkers: Walkers) -> Array:
        """The acceleration that reaches the chosen velocities within the tick, (M, 2), m/s^2."""
        parameters, direction = self._parameters, walkers.desired_direction
        walks = ((direction[:, 0] != 0.0) | (direction[:, 1] != 0.0)) & (walkers.desired_speed > 0.0)
        evades = (walkers.attention > 0.0) & walks[:, None]  # agent j (row) evades agent i (column)
        agents = reciprocal_half_planes(
            walkers.position,
            walkers.velocity,
            walkers.radius,
            pair_weights(walkers),
            np.where(evades, 0.5, 1.0),
            horizon=parameters.horizon,
            dt=self._dt,
        )
        walls = wall_half_planes(
            walkers.position, walkers.radius, self._barriers, horizon=parameters.wall_horizon, dt=self._dt
        )
        maximum = parameters.maximum_speed_ratio * walkers.desired_speed
        preferred = (biased_directions(direction, self._side) * walkers.desired_speed[:, None]).tolist()
        hard, soft = _relevant_planes(walls, maximum), _relevant_planes(agents, maximum)
        velocity = np.zeros_like(walkers.velocity)
        for i in np.flatnonzero(walks).tolist():
            x, y = preferred[i]
            velocity[i] = choose_velocity(hard[i], soft[i], (x, y), float(maximum[i]))
        return (velocity - walkers.velocity) / self._dt


def _relevant_planes(planes: HalfPlanes, maximum_speed: Array) -> list[list[HalfPlane]]:
    """For each agent the half-planes that a velocity up to the maximum speed can violate, in the order of rows."""
    column, row = np.nonzero((planes.is_active & (planes.minimum > -maximum_speed)).T)
    values = np.stack((planes.x[row, column], planes.y[row, column], planes.minimum[row, column]), axis=1).tolist()
    lists: list[list[HalfPlane]] = [[] for _ in maximum_speed]
    for i, (a, b, c) in zip(column.tolist(), values, strict=True):
        lists[i].append((a, b, c))
    return lists
