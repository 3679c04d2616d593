"""How walkers give way to one another: the interaction law measured by Moussaïd et al. (2009)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import Array, arctan2, exp

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
