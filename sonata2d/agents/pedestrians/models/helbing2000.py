"""`helbing2000`: the escape-panic model of Helbing, Farkas & Vicsek (2000), with body compression and friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.geometry import Barriers
from ....core.portable_math import Array, exp
from ....core.scene import Scene
from .base import Walkers, biased_directions, desired_acceleration, pair_weights


@dataclass(frozen=True, slots=True)
class Helbing2000:
    """Parameters, chosen by the authors for escape panic at up to 5 m/s; not fitted to data.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487, methods.
    """

    strength: float = 2000.0  # A, N
    decay_length: float = 0.08  # B, m
    compression: float = 1.2e5  # k, kg/s^2
    friction: float = 2.4e5  # κ, kg/(m s)
    mass: float = 80.0  # m, kg
    relaxation_time: float = 0.5  # τ, s


def contact_acceleration(
    position: Array, velocity: Array, radius: Array, weight: Array, parameters: Helbing2000
) -> Array:
    """Repulsion between agents; compression and sliding friction where bodies touch.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        weight: (M, M), row j, column i: how much i attends to j, in [0, 1]; zero on the diagonal.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, on agent i from all agents j, summed in the order of j.

    Source: Helbing, Farkas & Vicsek (2000), eq. 2.
    """
    nx, ny = (position[None, :, k] - position[:, None, k] for k in (0, 1))  # to i (column) from j (row)
    d = np.sqrt(nx * nx + ny * ny)
    distance = np.where(d > 1e-6, d, 1.0)  # at the same position: no direction, no force
    overlap = radius[:, None] + radius[None, :] - d  # r_ij - d_ij
    wx, wy = (velocity[:, None, k] - velocity[None, :, k] for k in (0, 1))  # v_j - v_i
    x, y = _contact_terms(nx / distance, ny / distance, overlap, wx, wy, parameters)
    return np.stack((np.add.reduce(weight * x, axis=0), np.add.reduce(weight * y, axis=0)), axis=1)


def wall_contact_acceleration(
    position: Array, velocity: Array, radius: Array, barriers: Barriers, parameters: Helbing2000
) -> Array:
    """Repulsion from walls and furniture; compression and sliding friction where a body touches them.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        radius: (M,), m.
        barriers: thick segments; each acts once, from its nearest point.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, summed in the order of the barriers.

    Source: Helbing, Farkas & Vicsek (2000), eq. 3.
    """
    x, y = barriers.towards(position)
    d = np.sqrt(x * x + y * y)
    distance = np.where(d > 1e-6, d, 1.0)
    overlap = radius + barriers.radius[:, None] - d  # r_i - d_iW
    x, y = _contact_terms(-x / distance, -y / distance, overlap, -velocity[:, 0], -velocity[:, 1], parameters)
    return np.stack((np.add.reduce(x, axis=0), np.add.reduce(y, axis=0)), axis=1)


def _contact_terms(
    nx: Array, ny: Array, overlap: Array, wx: Array, wy: Array, parameters: Helbing2000
) -> tuple[Array, Array]:
    """Acceleration of each pair, ([A exp(overlap/B) + k g] n + κ g (w · t) t) / m.

    Args:
        nx, ny: n, unit vectors away from the other.
        overlap: m; negative where the bodies do not touch.
        wx, wy: w, velocity of the other relative to the agent, m/s.
        parameters: of the model.
    """
    touching = np.maximum(overlap, 0.0)  # g
    decay = exp(np.abs(overlap) * (-1.0 / parameters.decay_length))
    social = np.where(overlap > 0.0, 1.0 / np.maximum(decay, 1e-6), decay)  # `exp` accepts decays only
    push = (parameters.strength * social + parameters.compression * touching) / parameters.mass
    friction = (parameters.friction / parameters.mass) * touching * (wy * nx - wx * ny)  # w · t with t = (-n_y, n_x)
    return push * nx - friction * ny, push * ny + friction * nx


class Helbing2000Model:
    """Driving force, repulsion, compression and friction, as published.

    The engine's rigid bodies limit the overlap.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487.
    """

    evaluations = 10
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._parameters = scene.barriers, scene.rules.side, Helbing2000()

    def acceleration(self, walkers: Walkers) -> Array:
        parameters, position, velocity, radius = self._parameters, walkers.position, walkers.velocity, walkers.radius
        total = contact_acceleration(position, velocity, radius, pair_weights(walkers), parameters)
        total += wall_contact_acceleration(position, velocity, radius, self._barriers, parameters)
        total += desired_acceleration(
            velocity,
            biased_directions(walkers.desired_direction, self._side),
            walkers.desired_speed,
            relaxation_time=parameters.relaxation_time,
        )
        return total
