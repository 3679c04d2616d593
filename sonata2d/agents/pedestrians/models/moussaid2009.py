"""`moussaid2009`: the interaction law of Moussaïd et al. (2009), with the group forces of their paper of 2010."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import Array, arctan2, exp
from ....core.scene import Scene
from .base import Walkers, desired_acceleration, wall_acceleration


@dataclass(frozen=True, slots=True)
class Moussaid2010:
    """Source: Moussaïd et al., PLoS ONE 5 (2010) e10047, eqs 4-7; the distance of repulsion from the bodies' size."""

    gaze: float = 4.0  # β1, 1/(rad s)
    cohesion: float = 3.0  # β2, m/s2
    repulsion: float = 1.0  # β3, m/s2
    repulsion_distance: float = 0.55  # d0, m


def group_acceleration(position: Array, velocity: Array, looking: Array, member: Array, law: Moussaid2010) -> Array:
    """Keep groups together: slow down for those behind, close up, but not too near.

    Args:
        position: (N, 2), m.
        velocity: (N, 2), m/s.
        looking: (N, 2), unit vectors where people want to go.
        member: (N, N), 1 where row j walks in column i's group (not i itself), else 0.
        law: the parameters.

    Returns:
        (N, 2), m/s2; zero for who walks alone.

    Source: Moussaïd et al. (2010), eqs 4-7. The angle that the head must turn to see the group's centre beyond
    90° is taken as the part of the unit vector to it that points backwards, which equals its sine.
    """
    others = np.add.reduce(member, axis=0)
    count = np.maximum(others, 1.0)
    dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))
    cx, cy = (np.add.reduce(member * d, axis=0) / count for d in (dx, dy))  # to the centre of the others
    apart = np.maximum(np.sqrt(cx * cx + cy * cy), 1e-6)
    ux, uy = cx / apart, cy / apart
    behind = np.maximum(-(ux * looking[:, 0] + uy * looking[:, 1]), 0.0)
    # the threshold of eq. 5, (N - 1) / 2, is measured to the centre of all N, itself included
    pull = np.where((others > 0.0) & (apart * others / (others + 1.0) > others / 2.0), law.cohesion, 0.0)
    d = np.sqrt(dx * dx + dy * dy)
    push = member * np.where(d < law.repulsion_distance, -law.repulsion, 0.0) / np.maximum(d, 1e-6)
    brake = -law.gaze * np.where(others > 0.0, behind, 0.0)
    return np.stack(
        (
            brake * velocity[:, 0] + pull * ux + np.add.reduce(push * dx, axis=0),
            brake * velocity[:, 1] + pull * uy + np.add.reduce(push * dy, axis=0),
        ),
        axis=1,
    )


PERSON_RADIUS = 0.20  # m, of those for whom the law holds as it stands


@dataclass(frozen=True, slots=True)
class Moussaid2009:
    """The law's parameters, fitted to pairs who meet in a corridor (free walking, two people at a time).

    Its forces change over decimetres, so once a tick of 0.1 s is often enough.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755 (PMC2839952), table 1 and eqs 3-7.
    """

    strength: float = 4.5  # A, m/s2
    relative_velocity: float = 2.0  # λ, weight of the relative velocity in the interaction's direction
    reach: float = 0.35  # γ, s: range B = γ |D|
    angular_sideways: float = 2.0  # n
    angular_braking: float = 3.0  # n'
    side_bias: float = 0.005  # ε, 1/m: head-on, evade to the biased side
    relaxation_time: float = 0.54  # τ, s
    wall_strength: float = 3.0  # a, m/s2
    wall_reach: float = 0.1  # b, m


def interaction_acceleration(
    position: Array, velocity: Array, weight: Array, bulk: Array, side: int, law: Moussaid2009
) -> Array:
    """Give way to one another.

    Args:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        weight: (M, M), how much column i minds row j, 0..1; zero on the diagonal.
        bulk: (M, M), m, from `bulk_of`: how much nearer than their centres tell two are, for their size.
        side: +1 evades to the right when head-on, -1 to the left.
        law: the parameters.

    Returns:
        (M, 2), m/s2, on column i from all rows j, summed in the order of j.

    Source: Moussaïd et al. (2009), eqs 3-7, d from centre to centre; the bulk is ours, zero among people.
    """
    ex, ey = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
    d = np.sqrt(ex * ex + ey * ey)
    d = np.where(d > 1e-6, d, 1.0)
    ex, ey = ex / d, ey / d
    lam = law.relative_velocity  # λ
    tx, ty = (lam * (velocity[None, :, k] - velocity[:, None, k]) + e for k, e in ((0, ex), (1, ey)))  # D
    size = np.maximum(np.sqrt(tx * tx + ty * ty), 1e-6)
    tx, ty = tx / size, ty / size
    reach = law.reach * size  # B
    theta = arctan2(tx * ey - ty * ex, tx * ex + ty * ey) + (side * law.side_bias) * reach  # θ + Bε
    spread = reach * theta
    decay = np.maximum(d - bulk, 0.0) / reach
    braking = exp(-decay - (law.angular_braking * spread) * (law.angular_braking * spread))
    sideways = exp(-decay - (law.angular_sideways * spread) * (law.angular_sideways * spread))
    braking = weight * (-law.strength) * braking
    sideways = weight * np.where(theta < 0.0, law.strength, -law.strength) * sideways  # -A K, K = sign θ
    return np.stack(
        (
            np.add.reduce(braking * tx - sideways * ty, axis=0),
            np.add.reduce(braking * ty + sideways * tx, axis=0),
        ),
        axis=1,
    )


def bulk_of(radius: Array) -> Array:
    """(M, M), m, by how much the radii (M,) of two together exceed those of two people."""
    bulk: Array = np.maximum(radius[:, None] + radius[None, :] - 2.0 * PERSON_RADIUS, 0.0)
    return bulk


class Moussaid2009Model:
    """Drive, giving way, walls and groups, as published.

    Valid where it was measured: few people with room to give way. In a crowd it is an extrapolation.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755; Moussaïd et al., PLoS ONE 5 (2010) e10047.
    """

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side = scene.barriers, scene.rules.side
        self._law, self._group_law = Moussaid2009(), Moussaid2010()
        self._bulk = bulk_of(np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float))

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity = self._law, walkers.position, walkers.velocity
        total = interaction_acceleration(position, velocity, walkers.weight, self._bulk, self._side, law)
        total += wall_acceleration(
            position, walkers.radius, self._barriers, strength=law.wall_strength, reach=law.wall_reach
        )
        total += desired_acceleration(
            velocity, walkers.desired_direction, walkers.desired_speed, relaxation_time=law.relaxation_time
        )
        if walkers.member is not None:
            total += group_acceleration(position, velocity, walkers.desired_direction, walkers.member, self._group_law)
        return total
