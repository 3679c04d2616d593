"""`orca2011`: optimal reciprocal collision avoidance (van den Berg et al., 2011)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....core.geometry import Barriers, Point
from ....core.portable_math import Array
from ....core.scene import Scene
from .base import Walkers, leaning

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


_NOWHERE = 1e-9


@dataclass(frozen=True, slots=True)
class Orca2011:
    """The law's parameters. Its authors leave them to the user; these are usual for people.

    Source: van den Berg, Guy, Lin & Manocha, "Reciprocal n-body collision avoidance", Robotics Research (ISRR 2009),
    STAR 70, Springer (2011) 3.
    """

    horizon: float = 2.0  # τ, s, to people and the robot
    wall_horizon: float = 1.0  # s, to walls and furniture
    hurry: float = 1.3  # v_max over desired speed


@dataclass(frozen=True, slots=True)
class HalfPlanes:
    """Of each walker (column), the velocities v allowed by each other thing (row): x v_x + y v_y >= least.

    Attributes:
        x, y: (K, M), unit normals.
        least: (K, M), m/s.
        counts: (K, M) of bool; false where there is nothing to keep clear of.
    """

    x: Array
    y: Array
    least: Array
    counts: Any


def reciprocal_half_planes(
    position: Array, velocity: Array, radius: Array, weight: Array, share: Array, *, horizon: float, dt: float
) -> HalfPlanes:
    """The velocities by which each keeps clear of each other, if the others do their share.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        weight: (M, M), how much column i minds row j, 0..1; 0 leaves the pair out.
        share: (M, M), the part of the evasion from row j that column i takes on: 1/2, or all.
        horizon: s, for which the velocity shall be safe.
        dt: s, within which those who overlap shall be apart.

    Returns:
        (M, M) half-planes.

    Source: van den Berg et al. (2011), section 4: u is the least change of the relative velocity that leaves the
    velocity obstacle VO^τ, n its outward normal there; v >= v_A + u/2 along n.
    """
    px, py = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
    vx, vy = (velocity[None, :, k] - velocity[:, None, k] for k in (0, 1))  # of i, as j sees it
    r = radius[:, None] + radius[None, :]
    square = px * px + py * py
    leg = np.sqrt(np.maximum(square - r * r, 0.0))
    arc_x, arc_y, arc_change = _off_the_arc(px, py, vx, vy, r, np.where(leg > 0.0, horizon, dt))
    hand = np.where(px * vy - py * vx > 0.0, 1.0, -1.0)  # which leg of the cone is nearer: +1 the left
    safe = np.maximum(square, _NOWHERE)
    lx, ly = (px * leg - hand * py * r) / safe, (py * leg + hand * px * r) / safe  # along that leg
    on_leg = (leg > 0.0) & ((vx * lx + vy * ly) * horizon >= leg)
    nx, ny = np.where(on_leg, -hand * ly, arc_x), np.where(on_leg, hand * lx, arc_y)
    change = np.where(on_leg, -(vx * nx + vy * ny), arc_change)  # u · n
    least = nx * velocity[None, :, 0] + ny * velocity[None, :, 1] + share * weight * change
    return HalfPlanes(nx, ny, least, (weight > 0.0) & (nx * nx + ny * ny > 0.5))


def _off_the_arc(px: Array, py: Array, vx: Array, vy: Array, r: Array, time: Array) -> tuple[Array, Array, Array]:
    """Normal and size of the change that leaves the disc of velocities that would touch at the end of the time."""
    wx, wy = vx - px / time, vy - py / time
    size = np.sqrt(wx * wx + wy * wy)
    middle = size <= _NOWHERE  # in its very middle: straight back
    wx, wy = np.where(middle, -px, wx), np.where(middle, -py, wy)
    length = np.maximum(np.sqrt(wx * wx + wy * wy), _NOWHERE)
    return wx / length, wy / length, r / time - size


def wall_half_planes(position: Array, radius: Array, barriers: Barriers, *, horizon: float, dt: float) -> HalfPlanes:
    """The velocities by which each keeps clear of walls and furniture.

    Args:
        position: (M, 2), m.
        radius: (M,), m.
        barriers: K thick segments.
        horizon: s, for which the velocity shall be safe.
        dt: s, within which who is in a wall shall be out of it.

    Returns:
        (K, M) half-planes. Standing still is always allowed, but to who is in a wall.

    Source: van den Berg et al. (2011), static obstacles: the optimisation velocity is 0, whose nearest point of the
    obstacle in velocity space is the obstacle's nearest point over the horizon.
    """
    x, y = barriers.towards(position)
    d = np.sqrt(x * x + y * y)
    gap = d - barriers.radius[:, None] - radius
    apart = np.maximum(d, _NOWHERE)
    return HalfPlanes(-x / apart, -y / apart, -gap / np.where(gap > 0.0, horizon, dt), d > _NOWHERE)


class Orca2011Model:
    """Each takes the velocity nearest to the one they want among those that are safe for a while; groups are ignored.

    Who stays, as the robot in the crowd's eyes, and who does not mind one, evades nobody: others do it all.

    Source: van den Berg, Guy, Lin & Manocha, Robotics Research, STAR 70, Springer (2011) 3.
    """

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._dt, self._law = scene.barriers, scene.rules.side, scene.rules.dt, Orca2011()

    def acceleration(self, walkers: Walkers) -> Array:
        """As the protocol says: what brings the chosen velocity about within the tick."""
        law, direction = self._law, walkers.desired_direction
        walks = ((direction[:, 0] != 0.0) | (direction[:, 1] != 0.0)) & (walkers.desired_speed > 0.0)
        evades = (walkers.weight.T > 0.0) & walks[:, None]  # row j does its share towards column i
        people = reciprocal_half_planes(
            walkers.position,
            walkers.velocity,
            walkers.radius,
            walkers.weight,
            np.where(evades, 0.5, 1.0),
            horizon=law.horizon,
            dt=self._dt,
        )
        walls = wall_half_planes(
            walkers.position, walkers.radius, self._barriers, horizon=law.wall_horizon, dt=self._dt
        )
        most = law.hurry * walkers.desired_speed
        wish = (leaning(direction, self._side) * walkers.desired_speed[:, None]).tolist()
        hard, soft = _of_each(walls, most), _of_each(people, most)
        chosen = np.zeros_like(walkers.velocity)
        for i in np.flatnonzero(walks).tolist():
            chosen[i] = chosen_velocity(hard[i], soft[i], (wish[i][0], wish[i][1]), float(most[i]))
        return (chosen - walkers.velocity) / self._dt


def _of_each(planes: HalfPlanes, most: Array) -> list[list[HalfPlane]]:
    """The half-planes of each walker that some velocity up to the greatest speed breaks, in the order of the rows."""
    column, row = np.nonzero((planes.counts & (planes.least > -most)).T)
    kept = np.stack((planes.x[row, column], planes.y[row, column], planes.least[row, column]), axis=1).tolist()
    lists: list[list[HalfPlane]] = [[] for _ in most]
    for i, (a, b, c) in zip(column.tolist(), kept, strict=True):
        lists[i].append((a, b, c))
    return lists
