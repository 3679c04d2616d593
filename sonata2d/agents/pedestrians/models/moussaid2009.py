"""`moussaid2009`: the interaction model of Moussaïd et al. (2009), with the group forces of their paper of 2010."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import Array, arctan2, exp
from ....core.scene import Scene
from .base import Walkers, desired_acceleration, pair_weights, wall_acceleration


@dataclass(frozen=True, slots=True)
class Moussaid2010:
    """Parameters of the group forces.

    Source: Moussaïd et al., PLoS ONE 5 (2010) e10047, eqs 4-7; the distance of repulsion from the bodies' size.
    """

    gaze: float = 4.0  # β1, 1/(rad s)
    cohesion: float = 3.0  # β2, m/s^2
    repulsion: float = 1.0  # β3, m/s^2
    repulsion_distance: float = 0.55  # d0, m


def group_acceleration(
    position: Array, velocity: Array, direction: Array, member: Array, parameters: Moussaid2010
) -> Array:
    """Keep walking groups together: brake for members behind, approach the centre, keep a minimum distance.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        direction: (M, 2), desired directions, unit vectors.
        member: (M, M), 1 where two agents walk in one group, else 0; 0 on the diagonal.
        parameters: of the group forces.

    Returns:
        (M, 2), m/s^2; zero for agents without a group.

    Source: Moussaïd et al. (2010), eqs 4-7. The angle by which the head must turn beyond 90° to see the group's centre
    is replaced by the backward component of the unit vector to the centre, which equals the sine of that angle.
    """
    others = np.add.reduce(member, axis=0)
    count = np.maximum(others, 1.0)
    dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))
    cx, cy = (np.add.reduce(member * d, axis=0) / count for d in (dx, dy))  # to the centre of the others
    distance = np.maximum(np.sqrt(cx * cx + cy * cy), 1e-6)
    ux, uy = cx / distance, cy / distance
    behind = np.maximum(-(ux * direction[:, 0] + uy * direction[:, 1]), 0.0)
    # The threshold of eq. 5, (N - 1) / 2, applies to the distance from the centre of all N, the agent included.
    is_far = (others > 0.0) & (distance * others / (others + 1.0) > others / 2.0)
    pull = np.where(is_far, parameters.cohesion, 0.0)
    d = np.sqrt(dx * dx + dy * dy)
    push = member * np.where(d < parameters.repulsion_distance, -parameters.repulsion, 0.0) / np.maximum(d, 1e-6)
    brake = -parameters.gaze * np.where(others > 0.0, behind, 0.0)
    return np.stack(
        (
            brake * velocity[:, 0] + pull * ux + np.add.reduce(push * dx, axis=0),
            brake * velocity[:, 1] + pull * uy + np.add.reduce(push * dy, axis=0),
        ),
        axis=1,
    )


MEASURED_RADIUS = 0.20  # m, of the people that the model was fitted to


@dataclass(frozen=True, slots=True)
class Moussaid2009:
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


def interaction_acceleration(
    position: Array, velocity: Array, weight: Array, excess_radius: Array, side: int, parameters: Moussaid2009
) -> Array:
    """Braking and sideways evasion in response to the other agents.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        weight: (M, M), row j, column i: how much i attends to j, in [0, 1]; zero on the diagonal.
        excess_radius: (M, M), m, from `pair_excess_radius`; subtracted from the distance of centres.
        side: +1 evades to the right when head-on, -1 to the left.
        parameters: of the model.

    Returns:
        (M, 2), m/s^2, on agent i from all agents j, summed in the order of j.

    Source: Moussaïd et al. (2009), eqs 3-7, d from centre to centre; the excess radius is ours, zero among people.
    """
    ex, ey = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
    d = np.sqrt(ex * ex + ey * ey)
    d = np.where(d > 1e-6, d, 1.0)
    ex, ey = ex / d, ey / d
    lam = parameters.relative_velocity  # λ
    tx, ty = (lam * (velocity[None, :, k] - velocity[:, None, k]) + e for k, e in ((0, ex), (1, ey)))  # D
    size = np.maximum(np.sqrt(tx * tx + ty * ty), 1e-6)
    tx, ty = tx / size, ty / size
    b = parameters.range_time * size  # B
    theta = arctan2(tx * ey - ty * ex, tx * ex + ty * ey) + (side * parameters.side_bias) * b  # θ + Bε
    spread = b * theta
    decay = np.maximum(d - excess_radius, 0.0) / b
    braking = exp(-decay - (parameters.angular_braking * spread) * (parameters.angular_braking * spread))
    sideways = exp(-decay - (parameters.angular_sideways * spread) * (parameters.angular_sideways * spread))
    braking = weight * (-parameters.strength) * braking
    sideways = weight * np.where(theta < 0.0, parameters.strength, -parameters.strength) * sideways  # -A K, K = sign θ
    return np.stack(
        (
            np.add.reduce(braking * tx - sideways * ty, axis=0),
            np.add.reduce(braking * ty + sideways * tx, axis=0),
        ),
        axis=1,
    )


def pair_excess_radius(radius: Array) -> Array:
    """How much the radii of each pair exceed those of the people that the model was fitted to, m; (M,) to (M, M)."""
    excess: Array = np.maximum(radius[:, None] + radius[None, :] - 2.0 * MEASURED_RADIUS, 0.0)
    return excess


class Moussaid2009Model:
    """Driving force, interaction, walls and groups, as published.

    Valid for the conditions of the measurements: few people with room to evade. For crowds it is an extrapolation.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755; Moussaïd et al., PLoS ONE 5 (2010) e10047.
    """

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side = scene.barriers, scene.rules.side
        self._parameters, self._group_parameters = Moussaid2009(), Moussaid2010()
        radius = np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float)
        self._excess_radius = pair_excess_radius(radius)

    def acceleration(self, walkers: Walkers) -> Array:
        parameters, position, velocity = self._parameters, walkers.position, walkers.velocity
        total = interaction_acceleration(
            position, velocity, pair_weights(walkers), self._excess_radius, self._side, parameters
        )
        total += wall_acceleration(
            position,
            walkers.radius,
            self._barriers,
            strength=parameters.wall_strength,
            decay_length=parameters.wall_decay_length,
        )
        total += desired_acceleration(
            velocity, walkers.desired_direction, walkers.desired_speed, relaxation_time=parameters.relaxation_time
        )
        if walkers.member is not None:
            direction, member = walkers.desired_direction, walkers.member
            total += group_acceleration(position, velocity, direction, member, self._group_parameters)
        return total
