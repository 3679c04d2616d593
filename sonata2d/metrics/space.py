"""How much room did the robot leave to people and things? All between outlines, at every look."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..core.portable_math import Array
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, SOCIAL_DISTANCE
from .definition import Metric
from .trajectory import Trajectory

THRESHOLDS = (0.3, 0.45, 0.5, 0.8, 1.2)  # m; a sweep, since no single cut is right for every culture and task
ZONES = {
    "intimate": (0.0, INTIMATE_DISTANCE),
    "personal": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
    "social": (PERSONAL_DISTANCE, SOCIAL_DISTANCE),
    "public": (SOCIAL_DISTANCE, np.inf),
}

_HALL = "E. T. Hall, The Hidden Dimension (1966)"
_FRANCIS = "Francis et al., arXiv 2306.16740, table of metrics"


def human_clearance_min(run: Trajectory) -> float | None:
    """m, to the nearest person ever; None where nobody ever is."""
    return float(run.nearest.min()) if run.has_people else None


def human_clearance_mean(run: Trajectory) -> float | None:
    """m, mean over looks at which somebody is there, of the clearance to the nearest; None where nobody ever is."""
    there = run.present.any(axis=1)
    return float(run.nearest[there].mean()) if run.has_people else None


def obstacle_clearance_min(run: Trajectory) -> float | None:
    """m, to the nearest wall or piece of furniture ever; None where there is none."""
    return float(_obstacles(run).min()) if len(run.barrier_gaps) else None


def obstacle_clearance_mean(run: Trajectory) -> float | None:
    """m, mean over looks of the clearance to the nearest wall or piece of furniture; None where there is none."""
    return float(_obstacles(run).mean()) if len(run.barrier_gaps) else None


def personal_space_compliance(run: Trajectory, threshold: float) -> float | None:
    """Share of looks at which nobody is nearer than the threshold, m; None where nobody ever is."""
    return float((run.nearest >= threshold).mean()) if run.has_people else None


def zone_share(run: Trajectory, low: float, high: float) -> float | None:
    """Share of looks at which the nearest person is in [low, high), m; None where nobody ever is."""
    if not run.has_people:
        return None
    return float(((run.nearest >= low) & ((run.nearest < high) | (high == np.inf))).mean())


def _obstacles(run: Trajectory) -> Array:
    """(L,), m."""
    gaps: Array = np.maximum(run.barrier_gaps.min(axis=0), 0.0)
    return gaps


METRICS = (
    Metric(
        "human_clearance_min", "m", "more", "min over looks and people of d, d = max(0, |p − q| − r_robot − r_person)",
        f"{_FRANCIS} (DH_min)", human_clearance_min, headline=True,
    ),
    Metric(
        "human_clearance_mean", "m", "more", "mean over looks with people of min over people of d",
        "HuNavSim, avg_closest_person", human_clearance_mean,
    ),
    Metric(
        "obstacle_clearance_min", "m", "more",
        "min over looks of the gap from the robot's outline to walls and furniture, not below 0",
        f"{_FRANCIS} (CD)", obstacle_clearance_min, headline=True,
    ),
    Metric("obstacle_clearance_mean", "m", "more", "its mean over looks", f"{_FRANCIS} (CD)", obstacle_clearance_mean),
    *(
        Metric(
            f"personal_space_compliance_{threshold:.2f}", "share", "more",
            f"share of looks at which min over people of d ≥ {threshold:.2f} m; 1 where nobody is there at that look",
            f"{_FRANCIS} (SC)", partial(personal_space_compliance, threshold=threshold),
            headline=threshold == INTIMATE_DISTANCE,
        )
        for threshold in THRESHOLDS
    ),
    *(
        Metric(
            f"zone_{name}", "share", "neither" if name in ("social", "public") else "less",
            f"share of looks at which {low:g} m ≤ min over people of d{'' if high == np.inf else f' < {high:g} m'}",
            _HALL, partial(zone_share, low=low, high=high),
        )
        for name, (low, high) in ZONES.items()
    ),
)  # fmt: skip
