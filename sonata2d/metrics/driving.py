"""Metrics of runs that a person drove in a browser: how late the driver saw the world."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..core.portable_math import Array
from .definition import OURS, Metric
from .trajectory import Trajectory


def round_trip(trajectory: Trajectory, reduce: Callable[[Array], float]) -> float | None:
    """A statistic of the round-trip times, s; None where none was recorded."""
    times = trajectory.record.round_trips[: len(trajectory)]
    known = times[np.isfinite(times)]
    return float(reduce(known)) if len(known) else None


METRICS = (
    Metric(
        "round_trip_median", "s", "less",
        "median over ticks of the time from the request of a tick to its answer, as the driver's browser measured it;"
        " not defined for runs that were not driven in a browser",
        OURS, partial(round_trip, reduce=np.median),
    ),
    Metric(
        "round_trip_95", "s", "less", "95th percentile of the same times",
        OURS, partial(round_trip, reduce=lambda times: float(np.percentile(times, 95))),
    ),
)  # fmt: skip
