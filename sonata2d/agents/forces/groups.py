"""What keeps people who walk together beside one another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import Array


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
