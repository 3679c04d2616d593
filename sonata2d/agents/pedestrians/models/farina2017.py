"""`farina2017`: the headed social force model of Farina et al. (2017): pedestrians walk where they face."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ....core.portable_math import Array
from ....core.scene import Scene
from .base import Walkers, desired_acceleration, leaning
from .helbing2000 import Helbing2000, pressing_acceleration, pressing_wall_acceleration


@dataclass(frozen=True, slots=True)
class Farina2017:
    """The law's parameters; its authors chose them, and draw masses from 60 to 90 kg, of which this is the middle.

    Source: Farina, Fontanelli, Garulli, Giannitrapani & Prattichizzo, PLoS ONE 12(1) (2017) e0169734; the group's
    distances are those of the program that its authors published.
    """

    pressing: Helbing2000 = field(default_factory=lambda: Helbing2000(mass=75.0))  # A, B, k1, k2, m, τ
    sideways_share: float = 1.0  # k^o, of the forces of others, sideways
    sideways_damping: float = 500.0  # k^d, kg/s
    group_ahead: float = 200.0  # k1^g, N
    group_sideways: float = 200.0  # k2^g, N
    group_ahead_distance: float = 1.0  # d^f, m to the group's centre, within which nothing pulls
    group_sideways_distance: float = 0.5  # d^o, m


def headed_acceleration(drive: Array, others: Array, velocity: Array, body_direction: Array, law: Farina2017) -> Array:
    """Follow all forces ahead, and sideways only what others do, damped.

    Args:
        drive: (M, 2), m/s2, world frame, of one's own wish, f⁰ / m.
        others: (M, 2), m/s2, world frame, of people and walls, fᵉ / m.
        velocity: (M, 2), m/s, world frame.
        body_direction: (M, 2), unit vectors of the bodies.
        law: the parameters.

    Returns:
        (M, 2), m/s2, world frame.

    Source: Farina et al. (2017), the inputs u^f = (f⁰ + fᵉ) · r^f and u^o = k^o fᵉ · r^o - k^d v^o.
    """
    hx, hy = body_direction[:, 0], body_direction[:, 1]
    ahead = (drive[:, 0] + others[:, 0]) * hx + (drive[:, 1] + others[:, 1]) * hy
    slip = velocity[:, 1] * hx - velocity[:, 0] * hy  # v^o
    aside = law.sideways_share * (others[:, 1] * hx - others[:, 0] * hy)
    aside = aside - (law.sideways_damping / law.pressing.mass) * slip
    return np.stack((ahead * hx - aside * hy, ahead * hy + aside * hx), axis=1)


def headed_group_acceleration(position: Array, body_direction: Array, member: Array, law: Farina2017) -> Array:
    """Close up with one's group: a steady pull ahead or sideways to its centre while that is far in that direction.

    Args:
        position: (M, 2), m.
        body_direction: (M, 2), unit vectors of the bodies.
        member: (M, M), 1 where row j walks in column i's group (not i itself), else 0.
        law: the parameters.

    Returns:
        (M, 2), m/s2, world frame; zero for who walks alone.

    Source: Farina et al. (2017), group cohesion; p the way to the centre of the group, oneself included.
    """
    count = np.add.reduce(member, axis=0) + 1.0
    dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))
    px, py = (np.add.reduce(member * d, axis=0) / count for d in (dx, dy))  # p
    size = np.maximum(np.sqrt(px * px + py * py), 1e-6)
    hx, hy = body_direction[:, 0], body_direction[:, 1]
    ahead, aside = px * hx + py * hy, py * hx - px * hy
    pull = np.where(np.abs(ahead) > law.group_ahead_distance, law.group_ahead, 0.0) * ahead / size
    close = np.where(np.abs(aside) > law.group_sideways_distance, law.group_sideways, 0.0) * aside / size
    pull, close = pull / law.pressing.mass, close / law.pressing.mass
    return np.stack((pull * hx - close * hy, pull * hy + close * hx), axis=1)


class Farina2017Model:
    """The forces of Helbing et al. (2000) in the body's frame, and groups, as published.

    How bodies turn is the world's affair: they turn to where their owners want to go (`headed`).

    Source: Farina et al., PLoS ONE 12(1) (2017) e0169734.
    """

    evaluations = 10
    headed = True

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Farina2017()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, radius = self._law, walkers.position, walkers.velocity, walkers.radius
        others = pressing_acceleration(position, velocity, radius, walkers.weight, law.pressing)
        others += pressing_wall_acceleration(position, velocity, radius, self._barriers, law.pressing)
        drive = desired_acceleration(
            velocity, walkers.desired_direction, walkers.desired_speed, relaxation_time=law.pressing.relaxation_time
        )
        body_direction = leaning(
            walkers.body_direction, self._side
        )  # a drive that leans would not do: aside it counts for nothing
        total = headed_acceleration(drive, others, velocity, body_direction, law)
        if walkers.member is not None:
            total += headed_group_acceleration(position, body_direction, walkers.member, law)
        return total
