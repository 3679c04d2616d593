"""`helbing2000`: the escape-panic model of Helbing, Farkas & Vicsek (2000), with body compression and friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.geometry import Barriers
from ....core.portable_math import Array, exp
from ....core.scene import Scene
from .base import Walkers, desired_acceleration, leaning


@dataclass(frozen=True, slots=True)
class Helbing2000:
    """The law's parameters, chosen by its authors for escape panic at up to 5 m/s; fitted to no data.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487, methods.
    """

    strength: float = 2000.0  # A, N
    reach: float = 0.08  # B, m
    compression: float = 1.2e5  # k, kg/s2
    friction: float = 2.4e5  # κ, kg/(m s)
    mass: float = 80.0  # m, kg
    relaxation_time: float = 0.5  # τ, s


def pressing_acceleration(position: Array, velocity: Array, radius: Array, weight: Array, law: Helbing2000) -> Array:
    """Keep apart; where bodies touch, press and rub.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        weight: (M, M), how much column i minds row j, 0..1; zero on the diagonal.
        law: the parameters.

    Returns:
        (M, 2), m/s2, on column i from all rows j, summed in the order of j.

    Source: Helbing, Farkas & Vicsek (2000), eq. 2.
    """
    nx, ny = (position[None, :, k] - position[:, None, k] for k in (0, 1))  # to i (column) from j (row)
    d = np.sqrt(nx * nx + ny * ny)
    apart = np.where(d > 1e-6, d, 1.0)  # in one place: no direction, no force
    overlap = radius[:, None] + radius[None, :] - d  # r_ij - d_ij
    wx, wy = (velocity[:, None, k] - velocity[None, :, k] for k in (0, 1))  # v_j - v_i
    x, y = _pressed(nx / apart, ny / apart, overlap, wx, wy, law)
    return np.stack((np.add.reduce(weight * x, axis=0), np.add.reduce(weight * y, axis=0)), axis=1)


def pressing_wall_acceleration(
    position: Array, velocity: Array, radius: Array, barriers: Barriers, law: Helbing2000
) -> Array:
    """Keep off walls and furniture; where a body touches them, press and rub.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        barriers: thick segments, each of which counts once, by its nearest point.
        law: the parameters.

    Returns:
        (M, 2), m/s2, summed in the order of the barriers.

    Source: Helbing, Farkas & Vicsek (2000), eq. 3.
    """
    x, y = barriers.towards(position)
    d = np.sqrt(x * x + y * y)
    apart = np.where(d > 1e-6, d, 1.0)
    overlap = radius + barriers.radius[:, None] - d  # r_i - d_iW
    x, y = _pressed(-x / apart, -y / apart, overlap, -velocity[:, 0], -velocity[:, 1], law)
    return np.stack((np.add.reduce(x, axis=0), np.add.reduce(y, axis=0)), axis=1)


def _pressed(nx: Array, ny: Array, overlap: Array, wx: Array, wy: Array, law: Helbing2000) -> tuple[Array, Array]:
    """[A exp(overlap/B) + k g] n + κ g (w · t) t, over m: n away from the other, w how the other slides past."""
    touching = np.maximum(overlap, 0.0)  # g
    decay = exp(np.abs(overlap) * (-1.0 / law.reach))
    social = np.where(overlap > 0.0, 1.0 / np.maximum(decay, 1e-6), decay)  # `exp` is for decays alone
    push = (law.strength * social + law.compression * touching) / law.mass
    rub = (law.friction / law.mass) * touching * (wy * nx - wx * ny)  # w · t with t = (-n_y, n_x)
    return push * nx - rub * ny, push * ny + rub * nx


class Helbing2000Model:
    """Drive, pressing and rubbing, as published; the engine's rigid bodies limit how deep the pressing goes.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487.
    """

    evaluations = 10
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Helbing2000()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, radius = self._law, walkers.position, walkers.velocity, walkers.radius
        total = pressing_acceleration(position, velocity, radius, walkers.weight, law)
        total += pressing_wall_acceleration(position, velocity, radius, self._barriers, law)
        total += desired_acceleration(
            velocity,
            leaning(walkers.desired_direction, self._side),
            walkers.desired_speed,
            relaxation_time=law.relaxation_time,
        )
        return total
