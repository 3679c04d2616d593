"""`farina2017`: the headed social force model of Farina et al. (2017): pedestrians walk where they face."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import Vector, length
from ....core.portable_math import Array
from .base import KernelModel, Walkers, biased_direction, desired_acceleration, offset_of_group
from .helbing2000 import Helbing2000, contact_acceleration, wall_contact_acceleration


class Farina2017(NamedTuple):
    """Parameters, chosen by the authors. They draw masses from 60 to 90 kg; the mean is used here.

    Source: Farina, Fontanelli, Garulli, Giannitrapani & Prattichizzo, PLoS ONE 12(1) (2017) e0169734; the group's
    distances are from the program that the authors published.
    """

    contact: Helbing2000 = Helbing2000(mass=75.0)  # A, B, k1, k2, m, τ
    sideways_fraction: float = 1.0  # k^o, of the forces from others, sideways
    sideways_damping: float = 500.0  # k^d, kg/s
    group_ahead: float = 200.0  # k1^g, N
    group_sideways: float = 200.0  # k2^g, N
    group_ahead_distance: float = 1.0  # d^f, m to the group's centre, within which there is no pull
    group_sideways_distance: float = 0.5  # d^o, m


PARAMETERS = Farina2017()


@subroutine
def headed_acceleration(
    drive: Vector, others: Vector, velocity: Vector, body_direction: Vector, parameters: Farina2017
) -> Vector:
    """Combine forces in the body frame: all of them ahead, only those from others sideways, with damping.

    Args:
        drive: m/s^2, world frame, the driving force f⁰ / m.
        others: m/s^2, world frame, the forces from agents and walls fᵉ / m.
        velocity: m/s, world frame.
        body_direction: unit vector.
        parameters: of the model.

    Returns:
        m/s^2, world frame.

    Source: Farina et al. (2017), the inputs u^f = (f⁰ + fᵉ) · r^f and u^o = k^o fᵉ · r^o - k^d v^o.
    """
    hx, hy = body_direction[0], body_direction[1]
    ahead = (drive[0] + others[0]) * hx + (drive[1] + others[1]) * hy
    slip = velocity[1] * hx - velocity[0] * hy  # v^o
    aside = parameters.sideways_fraction * (others[1] * hx - others[0] * hy)
    aside = aside - (parameters.sideways_damping / parameters.contact.mass) * slip
    return ahead * hx - aside * hy, ahead * hy + aside * hx


@subroutine
def headed_group_acceleration(walkers: Walkers, i: int, body_direction: Vector, parameters: Farina2017) -> Vector:
    """Constant pull towards the group's centre, ahead and sideways, where it is farther than a threshold.

    Args:
        walkers: all agents.
        i: index of the agent.
        body_direction: unit vector, of agent i.
        parameters: of the model.

    Returns:
        m/s^2, world frame; zero for an agent without a group.

    Source: Farina et al. (2017), group cohesion; p is the vector to the centre of the group, the agent included.
    """
    px, py, others = offset_of_group(walkers, i)
    if others == 0.0:
        return 0.0, 0.0
    px, py = px / (others + 1.0), py / (others + 1.0)  # p
    distance = max(length(px, py), 1e-6)
    hx, hy = body_direction[0], body_direction[1]
    ahead, aside = px * hx + py * hy, py * hx - px * hy
    pull, close = 0.0, 0.0
    if abs(ahead) > parameters.group_ahead_distance:
        pull = parameters.group_ahead * ahead / distance / parameters.contact.mass
    if abs(aside) > parameters.group_sideways_distance:
        close = parameters.group_sideways * aside / distance / parameters.contact.mass
    return pull * hx - close * hy, pull * hy + close * hx


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Farina2017)
    contact = parameters.contact
    for i in range(len(acceleration)):
        if not walkers.walks[i]:
            continue
        agents = contact_acceleration(walkers, i, contact)
        walls = wall_contact_acceleration(walkers, i, barriers, contact)
        others = agents[0] + walls[0], agents[1] + walls[1]
        direction = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
        drive = desired_acceleration(walkers, i, direction, contact.relaxation_time)
        # Bias the body, not the drive: the sideways component of the drive has no effect in this model.
        body_direction = biased_direction(walkers.body_direction[i, 0], walkers.body_direction[i, 1], side)
        velocity = walkers.velocity[i, 0], walkers.velocity[i, 1]
        total = headed_acceleration(drive, others, velocity, body_direction, parameters)
        group = headed_group_acceleration(walkers, i, body_direction, parameters)
        acceleration[i, 0] = total[0] + group[0]
        acceleration[i, 1] = total[1] + group[1]


class Farina2017Model(KernelModel):
    """The forces of Helbing et al. (2000) in the body frame, and group cohesion, as published.

    The world turns the bodies towards the desired direction (`headed`), not the model.

    Source: Farina et al., PLoS ONE 12(1) (2017) e0169734.
    """

    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
    evaluations = 10
    headed = True
