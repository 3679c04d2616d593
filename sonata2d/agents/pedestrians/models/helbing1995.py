"""`helbing1995`: the social force model of Helbing & Molnár (1995), with elliptical repulsion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import Array, exp
from ....core.scene import Scene
from .base import Walkers, desired_acceleration, leaning, wall_acceleration

_THIN = 1e-3  # m: on the line of another's step the ellipse has no width, and the force no direction


@dataclass(frozen=True, slots=True)
class Helbing1995:
    """The law's parameters, chosen by its authors to look right; fitted to no data.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, section III.
    """

    repulsion: float = 2.1  # V0, m2/s2
    reach: float = 0.3  # σ, m
    step_time: float = 2.0  # Δt, s: a step is this times the speed
    sight_cosine: float = -0.17364817766693033  # cos φ, 2 φ = 200°
    out_of_sight: float = 0.5  # c, weight of whom one does not see
    wall_repulsion: float = 10.0  # U0, m2/s2
    wall_reach: float = 0.2  # R, m
    relaxation_time: float = 0.5  # τ, s


def step_acceleration(position: Array, velocity: Array, looking: Array, weight: Array, law: Helbing1995) -> Array:
    """Keep clear of one another and of where the others step next.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        looking: (M, 2), unit vectors where each wants to go, along which they step and see.
        weight: (M, M), how much column i minds row j, 0..1; zero on the diagonal.
        law: the parameters.

    Returns:
        (M, 2), m/s2, on column i from all rows j, summed in the order of j.

    Source: Helbing & Molnár (1995), eqs 3, 4, 8 and 9: f = -∇ V0 exp(-b/σ), b the smaller half axis of the ellipse
    whose foci are the other's place and that place one step on.
    """
    speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])
    step = law.step_time * speed  # v_β Δt
    rx, ry = (position[None, :, k] - position[:, None, k] for k in (0, 1))  # r_αβ, to i (column, α) from j (row, β)
    sx, sy = (r - (step * looking[:, k])[:, None] for k, r in ((0, rx), (1, ry)))
    near, far = _size(rx, ry), _size(sx, sy)
    both = near + far
    b = 0.5 * np.sqrt(np.maximum(both * both - (step * step)[:, None], 0.0))
    b = np.maximum(b, _THIN)
    size = weight * (law.repulsion / law.reach) * exp(b * (-1.0 / law.reach)) * both / (4.0 * b)  # V0/σ e^(-b/σ) |∇b|
    fx, fy = size * (rx / near + sx / far), size * (ry / near + sy / far)
    ahead = -(fx * looking[None, :, 0] + fy * looking[None, :, 1])  # e · (-f), eq. 8
    seen = np.where(ahead >= law.sight_cosine * np.sqrt(fx * fx + fy * fy), 1.0, law.out_of_sight)
    return np.stack((np.add.reduce(seen * fx, axis=0), np.add.reduce(seen * fy, axis=0)), axis=1)


def _size(x: Array, y: Array) -> Array:
    size: Array = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    return size


class Helbing1995Model:
    """Drive, the others' next steps, and walls, as published; people are points, and nobody is attracted.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282; the limit of 1.3 times the desired speed is the crowd's.
    """

    evaluations = 2
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Helbing1995()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, direction = self._law, walkers.position, walkers.desired_direction
        stays = (direction[:, 0] == 0.0) & (direction[:, 1] == 0.0)
        looking = np.where(stays[:, None], walkers.body_direction, direction)
        total = step_acceleration(position, walkers.velocity, looking, walkers.weight, law)
        total += wall_acceleration(  # U0 e^(-r/R), r from the centre: a person is a point
            position,
            np.zeros_like(walkers.radius),
            self._barriers,
            strength=law.wall_repulsion / law.wall_reach,
            reach=law.wall_reach,
        )
        total += desired_acceleration(
            walkers.velocity,
            leaning(direction, self._side),
            walkers.desired_speed,
            relaxation_time=law.relaxation_time,
        )
        return total
