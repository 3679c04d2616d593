"""Metrics of distance to humans and obstacles, between outlines, over all states."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.portable_math import Array
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, SOCIAL_DISTANCE
from .definition import Metric
from .trajectory import Trajectory

THRESHOLDS = (0.3, 0.45, 0.5, 0.8, 1.2)  # m; several, since no single one is right for every culture and task
ZONES = {  # m, from the robot's outline to that of the nearest human
    "intimate": (0.0, INTIMATE_DISTANCE),
    "personal": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
    "social": (PERSONAL_DISTANCE, SOCIAL_DISTANCE),
    "public": (SOCIAL_DISTANCE, np.inf),
}

_HALL = "E. T. Hall, The Hidden Dimension (1966)"
_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


def human_clearance_min(trajectory: Trajectory) -> float | None:
    """Smallest clearance to a human, m; None without humans."""
    return float(trajectory.clearance.min()) if trajectory.has_humans else None


def human_clearance_mean(trajectory: Trajectory) -> float | None:
    """Mean clearance to the nearest human over the states with humans, m; None without humans."""
    occupied = trajectory.present.any(axis=1)
    return float(trajectory.clearance[occupied].mean()) if trajectory.has_humans else None


def obstacle_clearance_min(trajectory: Trajectory) -> float | None:
    """Smallest clearance to a wall or piece of furniture, m; None without obstacles."""
    return float(_obstacle_clearance(trajectory).min()) if len(trajectory.barrier_clearance) else None


def obstacle_clearance_mean(trajectory: Trajectory) -> float | None:
    """Mean clearance to the nearest wall or piece of furniture, m; None without obstacles."""
    return float(_obstacle_clearance(trajectory).mean()) if len(trajectory.barrier_clearance) else None


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


def _obstacle_clearance(trajectory: Trajectory) -> Array:
    """(L,), m, to the nearest obstacle; 0 where outlines overlap."""
    clearance: Array = np.maximum(trajectory.barrier_clearance.min(axis=0), 0.0)
    return clearance


METRICS = (
    Metric(
        "human_clearance_min", "m", "more",
        "min over states and people of d = max(0, |p − q| − r_robot − r_person), where q is the nearest point of the"
        " person's shoulder line",
        f"{_FRANCIS} (DH_min)", human_clearance_min, headline=True,
    ),
    Metric(
        "human_clearance_mean", "m", "more", "mean over states with people of min over people of d",
        "HuNavSim, avg_closest_person", human_clearance_mean,
    ),
    Metric(
        "obstacle_clearance_min", "m", "more",
        "min over states of the clearance to walls and furniture, at least 0",
        f"{_FRANCIS} (CD)", obstacle_clearance_min, headline=True,
    ),
    Metric(
        "obstacle_clearance_mean", "m", "more", "mean over states of the clearance to walls and furniture, at least 0",
        f"{_FRANCIS} (CD)", obstacle_clearance_mean,
    ),
    *(
        Metric(
            f"personal_space_compliance_{threshold:.2f}", "share", "more",
            f"fraction of states in which min over people of d ≥ {threshold:.2f} m; states without people count",
            f"{_FRANCIS} (SC)", partial(personal_space_compliance, threshold=threshold),
            headline=threshold == INTIMATE_DISTANCE,
        )
        for threshold in THRESHOLDS
    ),
    *(
        Metric(
            f"zone_{name}", "share", "neither" if name in ("social", "public") else "less",
            f"fraction of states in which {low:g} m ≤ min over people of d{'' if high == np.inf else f' < {high:g} m'}",
            _HALL, partial(zone_fraction, low=low, high=high),
        )
        for name, (low, high) in ZONES.items()
    ),
)  # fmt: skip
