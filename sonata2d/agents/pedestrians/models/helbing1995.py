"""`helbing1995`: the social force model of Helbing & Molnár (1995), with elliptical repulsion."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import Vector, exp, length
from ....core.portable_math import Array
from .base import KernelModel, Walkers, biased_direction, desired_acceleration, wall_acceleration

_MINIMUM_HALF_AXIS = 1e-3  # m: on the line of the other's step the ellipse degenerates and the force has no direction


class Helbing1995(NamedTuple):
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


PARAMETERS = Helbing1995()


@subroutine
def _step_direction(walkers: Walkers, i: int) -> Vector:
    """Unit vector along which an agent steps and sees: its desired direction, or its heading if it stands."""
    x, y = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
    if x == 0.0 and y == 0.0:
        return walkers.body_direction[i, 0], walkers.body_direction[i, 1]
    return x, y


@subroutine
def next_step(walkers: Walkers, i: int, parameters: Helbing1995) -> tuple[float, float, float]:
    """The next step of an agent: v Δt e (x, y) and v Δt, m."""
    x, y = _step_direction(walkers, i)
    size = parameters.step_time * length(walkers.velocity[i, 0], walkers.velocity[i, 1])
    return size * x, size * y, size


@subroutine
def elliptical_acceleration(
    rx: float, ry: float, step_x: float, step_y: float, step: float, direction: Vector, weight: float,
    parameters: Helbing1995,
) -> Vector:  # fmt: skip
    """Repulsion of an agent α from another one, β, and from where β steps next.

    Args:
        rx, ry: r_αβ, vector from β to α, m.
        step_x, step_y, step: `next_step` of β, m.
        direction: unit vector along which α sees.
        weight: attention of α to β, in [0, 1].
        parameters: of the model.

    Returns:
        m/s^2.

    Source: Helbing & Molnár (1995), eqs 3, 4, 8 and 9: f = -∇ V0 exp(-b/σ), b the semi-minor axis of the ellipse
    whose foci are the other's position and its position one step later.
    """
    sx, sy = rx - step_x, ry - step_y
    near, far = max(length(rx, ry), 1e-6), max(length(sx, sy), 1e-6)
    both = near + far
    b = 0.5 * math.sqrt(max(both * both - step * step, 0.0))
    b = max(b, _MINIMUM_HALF_AXIS)
    v0, sigma = parameters.repulsion, parameters.decay_length
    size = weight * (v0 / sigma) * exp(b * (-1.0 / sigma)) * both / (4.0 * b)  # V0/σ e^(-b/σ) |∇b|
    fx, fy = size * (rx / near + sx / far), size * (ry / near + sy / far)
    ahead = -(fx * direction[0] + fy * direction[1])  # e · (-f), eq. 8
    in_sight = ahead >= parameters.sight_cosine * length(fx, fy)
    sight = 1.0 if in_sight else parameters.weight_out_of_sight
    return sight * fx, sight * fy


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Helbing1995)
    p, position = parameters, walkers.position
    step = np.empty((len(position), 3))
    for j in range(len(position)):
        step[j, 0], step[j, 1], step[j, 2] = next_step(walkers, j, p)
    for i in range(len(position)):
        if not walkers.walks[i]:
            continue
        sight_direction = _step_direction(walkers, i)
        total_x, total_y = 0.0, 0.0
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            if walkers.attention[n] != 0.0:
                j = walkers.neighbour[n]
                rx, ry = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
                x, y = elliptical_acceleration(
                    rx, ry, step[j, 0], step[j, 1], step[j, 2], sight_direction, walkers.attention[n], p
                )
                total_x += x
                total_y += y
        # U0 e^(-r/R), r from the centre: an agent is a point
        strength = p.wall_repulsion / p.wall_decay_length
        wall = wall_acceleration(walkers, i, barriers, 0.0, strength, p.wall_decay_length)
        direction = biased_direction(walkers.desired_direction[i, 0], walkers.desired_direction[i, 1], side)
        drive = desired_acceleration(walkers, i, direction, p.relaxation_time)
        acceleration[i, 0] = total_x + wall[0] + drive[0]
        acceleration[i, 1] = total_y + wall[1] + drive[1]


class Helbing1995Model(KernelModel):
    """Driving force, elliptical repulsion and walls, as published; agents are points, and attractions are left out.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282. Its limit of 1.3 times the desired speed is applied by
    `Crowd`, to every model.
    """

    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
    evaluations = 2
