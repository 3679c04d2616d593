"""Metrics of runs that a person drove in a browser: how late the driver saw the world."""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array
from .definition import metric
from .trajectory import Trajectory


@metric("s", "less", needs={"robot"})
def round_trip_median(trajectory: Trajectory) -> float | None:
    """Median over ticks of the time from the request of a tick to its answer, as the driver's browser measured it.

    Not defined for runs that were not driven in a browser.
    """
    times = _round_trips(trajectory)
    return float(np.median(times)) if len(times) else None


@metric("s", "less", needs={"robot"})
def round_trip_95(trajectory: Trajectory) -> float | None:
    """95th percentile of the same times."""
    times = _round_trips(trajectory)
    return float(np.percentile(times, 95)) if len(times) else None


def _round_trips(trajectory: Trajectory) -> Array:
    """The recorded round-trip times, s."""
    times = trajectory.record.round_trips[: len(trajectory)]
    return times[np.isfinite(times)]


METRICS = (round_trip_median, round_trip_95)
