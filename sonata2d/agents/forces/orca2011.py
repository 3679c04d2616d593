"""Which velocities keep clear of others: the half-planes of optimal reciprocal collision avoidance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...exact import Array
from ...geometry import Barriers

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
