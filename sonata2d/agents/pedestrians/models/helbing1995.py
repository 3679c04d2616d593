"""`helbing1995`: the social force model of Helbing & Molnár (1995), with elliptical repulsion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import Array, exp
from ....core.scene import Scene
from .base import Walkers, biased_directions, desired_acceleration, pair_weights, wall_acceleration

_MINIMUM_HALF_AXIS = 1e-3  # m: on the line of the other's step the ellipse degenerates and the force has no direction


@dataclass(frozen=True, slots=True)
class Helbing1995:
    """Parameters, chosen by the authors for realistic appearance; not fitted to data.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, section III.
    """

    repulsion: float = 2.1  # V0, m^2/s^2
    decay_length: float = 0.3  # σ, m
    step_time: float = 2.0  # Δt, s: the length of a step is this times the speed
    sight_cosine: float = -0.17364817766693033  # cos φ, 2 φ = 200°
    weight_out_of_sight: float = 0.5  # c
    wall_repulsion: float = 10.0  # U0, m^2/s^2
    wall_decay_length: float = 0.2  # R, m
    relaxation_time: float = 0.5  # τ, s


def elliptical_acceleration(
    position: Array, velocity: Array, step_direction: Array, weight: Array, parameters: Helbing1995
) -> Array:
    """Repulsion from the other agents and from where they step next.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        step_direction: (M, 2), unit vectors along which agents step and see.
        weight: (M, M), row j, column i: how much i attends to j, in [0, 1]; zero on the diagonal.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, on agent i from all agents j, summed in the order of j.

    Source: Helbing & Molnár (1995), eqs 3, 4, 8 and 9: f = -∇ V0 exp(-b/σ), b the semi-minor axis of the ellipse
    whose foci are the other's position and its position one step later.
    """
    speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])
    step = parameters.step_time * speed  # v_β Δt
    rx, ry = (position[None, :, k] - position[:, None, k] for k in (0, 1))  # r_αβ, to i (column, α) from j (row, β)
    sx, sy = (r - (step * step_direction[:, k])[:, None] for k, r in ((0, rx), (1, ry)))
    near, far = _length(rx, ry), _length(sx, sy)
    both = near + far
    b = 0.5 * np.sqrt(np.maximum(both * both - (step * step)[:, None], 0.0))
    b = np.maximum(b, _MINIMUM_HALF_AXIS)
    v0, sigma = parameters.repulsion, parameters.decay_length
    size = weight * (v0 / sigma) * exp(b * (-1.0 / sigma)) * both / (4.0 * b)  # V0/σ e^(-b/σ) |∇b|
    fx, fy = size * (rx / near + sx / far), size * (ry / near + sy / far)
    ahead = -(fx * step_direction[None, :, 0] + fy * step_direction[None, :, 1])  # e · (-f), eq. 8
    in_sight = ahead >= parameters.sight_cosine * np.sqrt(fx * fx + fy * fy)
    sight = np.where(in_sight, 1.0, parameters.weight_out_of_sight)
    return np.stack((np.add.reduce(sight * fx, axis=0), np.add.reduce(sight * fy, axis=0)), axis=1)


def _length(x: Array, y: Array) -> Array:
    length: Array = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    return length


class Helbing1995Model:
    """Driving force, elliptical repulsion and walls, as published; agents are points, and attractions are left out.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282. Its limit of 1.3 times the desired speed is applied by
    `Crowd`, to every model.
    """

    evaluations = 2
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._parameters = scene.barriers, scene.rules.side, Helbing1995()

    def acceleration(self, walkers: Walkers) -> Array:
        parameters, position, direction = self._parameters, walkers.position, walkers.desired_direction
        stands = (direction[:, 0] == 0.0) & (direction[:, 1] == 0.0)
        step_direction = np.where(stands[:, None], walkers.body_direction, direction)
        total = elliptical_acceleration(position, walkers.velocity, step_direction, pair_weights(walkers), parameters)
        total += wall_acceleration(  # U0 e^(-r/R), r from the centre: an agent is a point
            position,
            np.zeros_like(walkers.radius),
            self._barriers,
            strength=parameters.wall_repulsion / parameters.wall_decay_length,
            decay_length=parameters.wall_decay_length,
        )
        total += desired_acceleration(
            walkers.velocity,
            biased_directions(direction, self._side),
            walkers.desired_speed,
            relaxation_time=parameters.relaxation_time,
        )
        return total
