"""Metrics of distance to humans and obstacles, between outlines, over all states."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.portable_math import Array
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, SOCIAL_DISTANCE
from .definition import BODIES, OBSTACLES, Metric, metric
from .trajectory import Trajectory

THRESHOLDS = (0.3, 0.45, 0.5, 0.8, 1.2)  # m; several, since no single one is right for every culture and task
ZONES = {  # m, between the outlines of the robot and of the nearest human
    "intimate": (0.0, INTIMATE_DISTANCE),
    "personal": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
    "social": (PERSONAL_DISTANCE, SOCIAL_DISTANCE),
    "public": (SOCIAL_DISTANCE, np.inf),
}

_HALL = "E. T. Hall, The Hidden Dimension (1966)"
_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


@metric("m", "more", needs=BODIES, headline=True)
def human_clearance_min(trajectory: Trajectory) -> float | None:
    """Min over states and people of d = max(0, |p − q| − r_robot − r_person); not defined without people.

    Here q is the nearest point of the person's shoulder line.

    Source: Francis et al., arXiv 2306.16740, table of metrics (DH_min).
    """
    return float(trajectory.clearance.min()) if trajectory.has_humans else None


@metric("m", "more", needs=BODIES)
def human_clearance_mean(trajectory: Trajectory) -> float | None:
    """Mean over states with people of min over people of d; not defined without people.

    Source: HuNavSim, avg_closest_person.
    """
    occupied = trajectory.present.any(axis=1)
    return float(trajectory.clearance[occupied].mean()) if trajectory.has_humans else None


@metric("m", "more", needs=OBSTACLES, headline=True)
def obstacle_clearance_min(trajectory: Trajectory) -> float | None:
    """Min over states of the clearance to walls and furniture, at least 0; not defined without walls and furniture.

    Source: Francis et al., arXiv 2306.16740, table of metrics (CD).
    """
    clearance = _obstacle_clearance(trajectory)
    return None if clearance is None else float(clearance.min())


@metric("m", "more", needs=OBSTACLES)
def obstacle_clearance_mean(trajectory: Trajectory) -> float | None:
    """Mean over states of the clearance to walls and furniture, at least 0; not defined without walls and furniture.

    Source: Francis et al., arXiv 2306.16740, table of metrics (CD).
    """
    clearance = _obstacle_clearance(trajectory)
    return None if clearance is None else float(clearance.mean())


def personal_space_compliance(trajectory: Trajectory, threshold: float) -> float | None:
    """Fraction of the states with no human nearer than `threshold` (m); None without humans."""
    return float((trajectory.clearance >= threshold).mean()) if trajectory.has_humans else None


def zone_fraction(trajectory: Trajectory, low: float, high: float) -> float | None:
    """Fraction of the states with the nearest human's clearance in [low, high), m; None without humans.

    With `high` infinite, states without humans count.
    """
    if not trajectory.has_humans:
        return None
    clearance = trajectory.clearance
    return float(((clearance >= low) & ((clearance < high) | (high == np.inf))).mean())


def _obstacle_clearance(trajectory: Trajectory) -> Array | None:
    """(L,), m, to the nearest obstacle, 0 where outlines overlap; None without obstacles."""
    clearance = trajectory.barrier_clearance
    return np.maximum(clearance.min(axis=0), 0.0) if len(clearance) else None


_COMPLIANCE = tuple(
    Metric(
        f"personal_space_compliance_{threshold:.2f}", "share", "more",
        f"Fraction of states in which min over people of d ≥ {threshold:.2f} m; states without people count,"
        " but an episode without people has no value",
        f"{_FRANCIS} (SC)", partial(personal_space_compliance, threshold=threshold),
        headline=threshold == INTIMATE_DISTANCE, needs=BODIES,
    )
    for threshold in THRESHOLDS
)  # fmt: skip
_ZONES = tuple(
    Metric(
        f"zone_{name}", "share", "neither" if name in ("social", "public") else "less",
        f"Fraction of states in which {low:g} m ≤ min over people of d{'' if high == np.inf else f' < {high:g} m'}; not"
        " defined without people",
        _HALL, partial(zone_fraction, low=low, high=high), needs=BODIES,
    )
    for name, (low, high) in ZONES.items()
)  # fmt: skip
METRICS = (
    human_clearance_min, human_clearance_mean, obstacle_clearance_min, obstacle_clearance_mean, *_COMPLIANCE, *_ZONES,
)  # fmt: skip
