"""`farina2017`: the headed social force model of Farina et al. (2017): pedestrians walk where they face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ....core.portable_math import Array
from ....core.scene import Scene
from .base import Walkers, biased_directions, desired_acceleration, pair_weights
from .helbing2000 import Helbing2000, contact_acceleration, wall_contact_acceleration


@dataclass(frozen=True, slots=True)
class Farina2017:
    """Parameters, chosen by the authors. They draw masses from 60 to 90 kg; the mean is used here.

    Source: Farina, Fontanelli, Garulli, Giannitrapani & Prattichizzo, PLoS ONE 12(1) (2017) e0169734; the group's
    distances are those of the program that the authors published.
    """

    contact: Helbing2000 = field(default_factory=lambda: Helbing2000(mass=75.0))  # A, B, k1, k2, m, τ
    sideways_fraction: float = 1.0  # k^o, of the forces from others, sideways
    sideways_damping: float = 500.0  # k^d, kg/s
    group_ahead: float = 200.0  # k1^g, N
    group_sideways: float = 200.0  # k2^g, N
    group_ahead_distance: float = 1.0  # d^f, m to the group's centre, within which there is no pull
    group_sideways_distance: float = 0.5  # d^o, m


def headed_acceleration(
    drive: Array, others: Array, velocity: Array, body_direction: Array, parameters: Farina2017
) -> Array:
    """Combine forces in the body frame: all of them ahead, only those from others sideways, with damping.

    Args:
        drive: (M, 2), m/s^2, world frame, the driving force f⁰ / m.
        others: (M, 2), m/s^2, world frame, the forces from agents and walls fᵉ / m.
        velocity: (M, 2), m/s, world frame.
        body_direction: (M, 2), unit vectors.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, world frame.

    Source: Farina et al. (2017), the inputs u^f = (f⁰ + fᵉ) · r^f and u^o = k^o fᵉ · r^o - k^d v^o.
    """
    hx, hy = body_direction[:, 0], body_direction[:, 1]
    ahead = (drive[:, 0] + others[:, 0]) * hx + (drive[:, 1] + others[:, 1]) * hy
    slip = velocity[:, 1] * hx - velocity[:, 0] * hy  # v^o
    aside = parameters.sideways_fraction * (others[:, 1] * hx - others[:, 0] * hy)
    aside = aside - (parameters.sideways_damping / parameters.contact.mass) * slip
    return np.stack((ahead * hx - aside * hy, ahead * hy + aside * hx), axis=1)


def headed_group_acceleration(position: Array, body_direction: Array, member: Array, parameters: Farina2017) -> Array:
    """Constant pull towards the group's centre, ahead and sideways, where it is farther than a threshold.

    Args:
        position: (M, 2), m.
        body_direction: (M, 2), unit vectors.
        member: (M, M), 1 where two agents walk in one group, else 0; 0 on the diagonal.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, world frame; zero for agents without a group.

    Source: Farina et al. (2017), group cohesion; p is the vector to the centre of the group, the agent included.
    """
    count = np.add.reduce(member, axis=0) + 1.0
    dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))
    px, py = (np.add.reduce(member * d, axis=0) / count for d in (dx, dy))  # p
    distance = np.maximum(np.sqrt(px * px + py * py), 1e-6)
    hx, hy = body_direction[:, 0], body_direction[:, 1]
    ahead, aside = px * hx + py * hy, py * hx - px * hy
    pull = np.where(np.abs(ahead) > parameters.group_ahead_distance, parameters.group_ahead, 0.0) * ahead / distance
    aside_force = np.where(np.abs(aside) > parameters.group_sideways_distance, parameters.group_sideways, 0.0)
    close = aside_force * aside / distance
    pull, close = pull / parameters.contact.mass, close / parameters.contact.mass
    return np.stack((pull * hx - close * hy, pull * hy + close * hx), axis=1)


class Farina2017Model:
    """The forces of Helbing et al. (2000) in the body frame, and group cohesion, as published.

    The world turns the bodies towards the desired direction (`headed`), not the model.

    Source: Farina et al., PLoS ONE 12(1) (2017) e0169734.
    """

    evaluations = 10
    headed = True

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._parameters = scene.barriers, scene.rules.side, Farina2017()

    def acceleration(self, walkers: Walkers) -> Array:
        parameters, position, velocity, radius = self._parameters, walkers.position, walkers.velocity, walkers.radius
        contact = parameters.contact
        others = contact_acceleration(position, velocity, radius, pair_weights(walkers), contact)
        others += wall_contact_acceleration(position, velocity, radius, self._barriers, contact)
        drive = desired_acceleration(
            velocity, walkers.desired_direction, walkers.desired_speed, relaxation_time=contact.relaxation_time
        )
        # Bias the body, not the drive: the sideways component of the drive has no effect in this model.
        body_direction = biased_directions(walkers.body_direction, self._side)
        total = headed_acceleration(drive, others, velocity, body_direction, parameters)
        if walkers.member is not None:
            total += headed_group_acceleration(position, body_direction, walkers.member, parameters)
        return total
