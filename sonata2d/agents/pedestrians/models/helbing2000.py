"""`helbing2000`: the escape-panic model of Helbing, Farkas & Vicsek (2000), with body compression and friction."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import RADIUS, Vector, exp, length, towards
from ....core.portable_math import Array
from .base import KernelModel, Walkers, biased_direction, desired_acceleration


class Helbing2000(NamedTuple):
    """Parameters, chosen by the authors for escape panic at up to 5 m/s; not fitted to data.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487, methods.
    """

    strength: float = 2000.0  # A, N
    decay_length: float = 0.08  # B, m
    compression: float = 1.2e5  # k, kg/s^2
    friction: float = 2.4e5  # κ, kg/(m s)
    mass: float = 80.0  # m, kg
    relaxation_time: float = 0.5  # τ, s


PARAMETERS = Helbing2000()


@subroutine
def _pair_acceleration(nx: float, ny: float, overlap: float, wx: float, wy: float, parameters: Helbing2000) -> Vector:
    """Acceleration by an agent or a wall, ([A exp(overlap/B) + k g] n + κ g (w · t) t) / m.

    Args:
        nx, ny: n, unit vector away from the other.
        overlap: m; negative where the bodies do not touch.
        wx, wy: w, velocity of the other relative to the agent, m/s.
        parameters: of the model.

    Returns:
        m/s^2.

    Source: Helbing, Farkas & Vicsek (2000), eqs 2 and 3.
    """
    p, touching = parameters, max(overlap, 0.0)  # g
    decay = exp(abs(overlap) * (-1.0 / p.decay_length))
    social = 1.0 / max(decay, 1e-6) if overlap > 0.0 else decay  # `exp` accepts decays only
    push = (p.strength * social + p.compression * touching) / p.mass
    friction = (p.friction / p.mass) * touching * (wy * nx - wx * ny)  # w · t with t = (-n_y, n_x)
    return push * nx - friction * ny, push * ny + friction * nx


@subroutine
def contact_acceleration(walkers: Walkers, i: int, parameters: Helbing2000) -> Vector:
    """Repulsion of agent i from the others; compression and sliding friction where bodies touch.

    Args:
        walkers: all agents.
        i: index of the agent.
        parameters: of the model.

    Returns:
        m/s^2, summed in the order of the agents.

    Source: Helbing, Farkas & Vicsek (2000), eq. 2.
    """
    position, velocity, radius, shoulder = walkers.position, walkers.velocity, walkers.radius, walkers.shoulder
    own_radius = radius[i] + abs(shoulder[i])  # the agents are discs around the bodies
    total_x, total_y = 0.0, 0.0
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j, weight = walkers.neighbour[n], walkers.attention[n]
        if weight != 0.0:
            nx, ny = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
            d = length(nx, ny)
            distance = d if d > 1e-6 else 1.0  # at the same position: no direction, no force
            overlap = radius[j] + abs(shoulder[j]) + own_radius - d  # r_ij - d_ij
            wx, wy = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]  # v_j - v_i
            x, y = _pair_acceleration(nx / distance, ny / distance, overlap, wx, wy, parameters)
            total_x += weight * x
            total_y += weight * y
    return total_x, total_y


@subroutine
def wall_contact_acceleration(walkers: Walkers, i: int, barriers: Array, parameters: Helbing2000) -> Vector:
    """Repulsion of agent i from walls and furniture; compression and sliding friction where its body touches them.

    Args:
        walkers: all agents.
        i: index of the agent.
        barriers: (B, 8), rows of `Barriers.table`; each acts once, from its nearest point.
        parameters: of the model.

    Returns:
        m/s^2, summed in the order of the barriers.

    Source: Helbing, Farkas & Vicsek (2000), eq. 3.
    """
    vx, vy = walkers.velocity[i, 0], walkers.velocity[i, 1]
    radius = walkers.radius[i] + abs(walkers.shoulder[i])
    total_x, total_y = 0.0, 0.0
    for n in range(walkers.wall_start[i], walkers.wall_start[i + 1]):
        k = walkers.wall[n]
        x, y = towards(barriers, k, walkers.position[i, 0], walkers.position[i, 1])
        d = length(x, y)
        distance = d if d > 1e-6 else 1.0
        overlap = radius + barriers[k, RADIUS] - d  # r_i - d_iW
        x, y = _pair_acceleration(-x / distance, -y / distance, overlap, -vx, -vy, parameters)
        total_x += x
        total_y += y
    return total_x, total_y


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Helbing2000)
    for i in range(len(acceleration)):
        if walkers.walks[i]:
            others = contact_acceleration(walkers, i, parameters)
            walls = wall_contact_acceleration(walkers, i, barriers, parameters)
            direction = biased_direction(walkers.desired_direction[i, 0], walkers.desired_direction[i, 1], side)
            drive = desired_acceleration(walkers, i, direction, parameters.relaxation_time)
            acceleration[i, 0] = others[0] + walls[0] + drive[0]
            acceleration[i, 1] = others[1] + walls[1] + drive[1]


class Helbing2000Model(KernelModel):
    """Driving force, repulsion, compression and friction, as published.

    The engine's rigid bodies limit the overlap.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487.
    """

    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
    evaluations = 10
