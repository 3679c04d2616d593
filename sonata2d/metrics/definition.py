"""What a metric is: a number of one run, with its unit, its formula and where the formula comes from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from .trajectory import Trajectory

DEFINITIONS_VERSION = 1  # of all metrics together; a changed formula raises it
METRICS_FORMAT = "sonata2d-metrics"
OURS = "sonata2d"

Better = Literal["more", "less", "neither"]
Function = Callable[[Trajectory], float | None]


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of one run.

    Attributes:
        name: as files and tables call it; a variant begins with whose it is, as in `hunavsim.stalled_time`.
        unit: SI, or `share` (0..1), `count`, `0/1`.
        better: which way a controller would want it to go.
        formula: in words and symbols, as docs/metrics.md shows it.
        source: paper or program that it is from; `sonata2d` where the definition is ours.
        function: gives the value of a run; None where it is not defined, as the clearance in a room without people.
        headline: whether short tables and the picture show it.
        variant_of: the metric of ours that it is to be compared with.
    """

    name: str
    unit: str
    better: Better
    formula: str
    source: str
    function: Function
    headline: bool = False
    variant_of: str | None = None

    def of(self, run: Trajectory) -> float | None:
        """The value of a run, rounded to 1e-6; None where it is not defined."""
        value = self.function(run)
        return None if value is None or not math.isfinite(value) else round(float(value), 6) + 0.0
