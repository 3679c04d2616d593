"""`moussaid2009`: the interaction model of Moussaïd et al. (2009), with the group forces of their paper of 2010."""

from __future__ import annotations

from typing import Any, NamedTuple

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import Vector, angle_of, exp, length
from ....core.portable_math import Array
from .base import KernelModel, Walkers, desired_acceleration, offset_of_group, wall_acceleration


class Moussaid2010(NamedTuple):
    """Parameters of the group forces.

    Source: Moussaïd et al., PLoS ONE 5 (2010) e10047, eqs 4-7; the distance of repulsion from the bodies' size.
    """

    gaze: float = 4.0  # β1, 1/(rad s)
    cohesion: float = 3.0  # β2, m/s^2
    repulsion: float = 1.0  # β3, m/s^2
    repulsion_distance: float = 0.55  # d0, m


@subroutine
def group_acceleration(walkers: Walkers, i: int, parameters: Moussaid2010) -> Vector:
    """Keep walking groups together: brake for members behind, approach the centre, keep a minimum distance.

    Args:
        walkers: all agents.
        i: index of the agent.
        parameters: of the group forces.

    Returns:
        m/s^2; zero for an agent without a group.

    Source: Moussaïd et al. (2010), eqs 4-7. The angle by which the head must turn beyond 90° to see the group's centre
    is replaced by the backward component of the unit vector to the centre, which equals the sine of that angle.
    """
    cx, cy, others = offset_of_group(walkers, i)
    if others == 0.0:
        return 0.0, 0.0
    cx, cy = cx / others, cy / others  # to the centre of the others
    distance = max(length(cx, cy), 1e-6)
    ux, uy = cx / distance, cy / distance
    behind = max(-(ux * walkers.desired_direction[i, 0] + uy * walkers.desired_direction[i, 1]), 0.0)
    # The threshold of eq. 5, (N - 1) / 2, applies to the distance from the centre of all N, the agent included.
    is_far = distance * others / (others + 1.0) > others / 2.0
    pull = parameters.cohesion if is_far else 0.0
    push_x, push_y = 0.0, 0.0
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j = walkers.neighbour[n]
        if walkers.group[j] == walkers.group[i]:
            dx, dy = walkers.position[j, 0] - walkers.position[i, 0], walkers.position[j, 1] - walkers.position[i, 1]
            d = length(dx, dy)
            if d < parameters.repulsion_distance:
                push = -parameters.repulsion / max(d, 1e-6)
                push_x += push * dx
                push_y += push * dy
    brake = -parameters.gaze * behind
    return (brake * walkers.velocity[i, 0] + pull * ux + push_x, brake * walkers.velocity[i, 1] + pull * uy + push_y)


_MEASURED_RADIUS = 0.20  # m, of the people that the model was fitted to


class Moussaid2009(NamedTuple):
    """Parameters, fitted to pairs that meet in a corridor (free walking, two people at a time).

    The forces vary over decimetres, so one evaluation per tick of 0.1 s suffices.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755 (PMC2839952), table 1 and eqs 3-7.
    """

    strength: float = 4.5  # A, m/s^2
    relative_velocity: float = 2.0  # λ, weight of the relative velocity in the interaction direction
    range_time: float = 0.35  # γ, s: range B = γ |D|
    angular_sideways: float = 2.0  # n
    angular_braking: float = 3.0  # n'
    side_bias: float = 0.005  # ε, 1/m: head-on encounters are evaded to the biased side
    relaxation_time: float = 0.54  # τ, s
    wall_strength: float = 3.0  # a, m/s^2
    wall_decay_length: float = 0.1  # b, m
    group: Moussaid2010 = Moussaid2010()


PARAMETERS = Moussaid2009()


@subroutine
def interaction_acceleration(
    dx: float, dy: float, ux: float, uy: float, excess_radius: float, weight: float, side: float,
    parameters: Moussaid2009,
) -> Vector:  # fmt: skip
    """Braking and sideways evasion in response to another agent.

    Args:
        dx, dy: vector to the other agent, m.
        ux, uy: velocity relative to the other agent, m/s.
        excess_radius: from `excess_radius_of`, m; subtracted from the distance of centres.
        weight: attention to the other agent, in [0, 1].
        side: +1 evades to the right when head-on, -1 to the left.
        parameters: of the model.

    Returns:
        m/s^2.

    Source: Moussaïd et al. (2009), eqs 3-7, d from centre to centre; the excess radius is ours, zero among people.
    """
    d = length(dx, dy)
    d = d if d > 1e-6 else 1.0
    ex, ey = dx / d, dy / d
    lam = parameters.relative_velocity  # λ
    tx, ty = lam * ux + ex, lam * uy + ey  # D
    size = max(length(tx, ty), 1e-6)
    tx, ty = tx / size, ty / size
    b = parameters.range_time * size  # B
    theta = angle_of(tx * ey - ty * ex, tx * ex + ty * ey) + (side * parameters.side_bias) * b  # θ + Bε
    spread = b * theta
    decay = max(d - excess_radius, 0.0) / b
    braking = exp(-decay - (parameters.angular_braking * spread) * (parameters.angular_braking * spread))
    sideways = exp(-decay - (parameters.angular_sideways * spread) * (parameters.angular_sideways * spread))
    braking = weight * (-parameters.strength) * braking
    sideways = weight * (parameters.strength if theta < 0.0 else -parameters.strength) * sideways  # -A K, K = sign θ
    return braking * tx - sideways * ty, braking * ty + sideways * tx


@subroutine
def excess_radius_of(radius: float, other_radius: float) -> float:
    """Excess of the radii of a pair over the radii of the people that the model was fitted to, m."""
    return max(radius + other_radius - 2.0 * _MEASURED_RADIUS, 0.0)


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Moussaid2009)
    p, position, velocity = parameters, walkers.position, walkers.velocity
    for i in range(len(position)):
        if not walkers.walks[i]:
            continue
        total_x, total_y = 0.0, 0.0
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            if walkers.attention[n] != 0.0:
                j = walkers.neighbour[n]
                dx, dy = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                ux, uy = velocity[i, 0] - velocity[j, 0], velocity[i, 1] - velocity[j, 1]
                excess_radius = excess_radius_of(walkers.radius[i], walkers.radius[j])
                x, y = interaction_acceleration(dx, dy, ux, uy, excess_radius, walkers.attention[n], side, p)
                total_x += x
                total_y += y
        wall = wall_acceleration(walkers, i, barriers, walkers.radius[i], p.wall_strength, p.wall_decay_length)
        direction = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
        drive = desired_acceleration(walkers, i, direction, p.relaxation_time)
        group = group_acceleration(walkers, i, p.group)
        acceleration[i, 0] = total_x + wall[0] + drive[0] + group[0]
        acceleration[i, 1] = total_y + wall[1] + drive[1] + group[1]


class Moussaid2009Model(KernelModel):
    """Driving force, interaction, walls and groups, as published.

    Valid for the conditions of the measurements: few people with room to evade. For crowds it is an extrapolation.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755; Moussaïd et al., PLoS ONE 5 (2010) e10047.
    """

    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
