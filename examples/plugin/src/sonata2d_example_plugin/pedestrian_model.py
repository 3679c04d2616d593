"""A pedestrian model: isotropic exponential repulsion, the "circular specification" of the social force model."""

from __future__ import annotations

from typing import Any, NamedTuple

from sonata2d import Array
from sonata2d.agents.pedestrians.models.base import KernelModel, Walkers, desired_acceleration, wall_acceleration
from sonata2d.core.compiled.kernel import kernel, subroutine
from sonata2d.core.compiled.packing import unpack
from sonata2d.core.compiled.scalar import Vector, exp, length


class Circular(NamedTuple):
    """Parameters: round numbers, not calibrated."""

    strength: float = 3.0  # m/s^2, at contact of the outlines
    decay_length: float = 0.3  # m
    wall_strength: float = 3.0  # m/s^2
    wall_decay_length: float = 0.1  # m
    relaxation_time: float = 0.5  # s


PARAMETERS = Circular()


@subroutine
def circular_acceleration(x: float, y: float, contact_distance: float, parameters: Circular) -> Vector:
    """Repulsion of an agent from another one.

    Args:
        x, y: vector from the other agent, m.
        contact_distance: distance of centres at contact, m.
        parameters: of the model.

    Returns:
        m/s^2.

    Source: A. Johansson, D. Helbing & P. K. Shukla, Advances in Complex Systems 10 (2007) 271, circular specification.
    """
    distance = max(length(x, y), 1e-6)
    gap = max(distance - contact_distance, 0.0)
    push = parameters.strength * exp(-gap / parameters.decay_length) / distance
    return push * x, push * y


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, p = unpack(packed_walkers, Walkers), unpack(packed_parameters, Circular)
    position, radius = walkers.position, walkers.radius
    for i in range(len(position)):
        if not walkers.walks[i]:
            continue
        total_x, total_y = 0.0, 0.0
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j, attention = walkers.neighbour[n], walkers.attention[n]
            dx, dy = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
            x, y = circular_acceleration(dx, dy, radius[i] + radius[j], p)
            total_x += attention * x
            total_y += attention * y
        direction = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
        drive = desired_acceleration(walkers, i, direction, p.relaxation_time)
        wall = wall_acceleration(walkers, i, barriers, radius[i], p.wall_strength, p.wall_decay_length)
        acceleration[i, 0] = total_x + drive[0] + wall[0]
        acceleration[i, 1] = total_y + drive[1] + wall[1]


class CircularModel(KernelModel):
    """Accelerates pedestrians towards their desired velocity, away from each other and from walls.

    The kernel uses `+ - * /`, `sqrt` and the functions of `sonata2d.core.compiled.scalar` only, and adds in a
    fixed order, so that an episode has the same bits on every processor.
    """

    evaluations = 1  # force evaluations in a tick of 0.1 s; stiff models need more
    headed = False  # pedestrians need not walk where their bodies face
    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
