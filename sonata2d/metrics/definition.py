"""The definition of a metric: one number of an episode, with its unit, formula and source."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from .trajectory import Trajectory

DEFINITIONS_VERSION = 2  # of all metrics together; raised when a formula changes
OURS = "sonata2d"  # source of a formula that is not published elsewhere

Better = Literal["more", "less", "neither"]
ARROWS: dict[Better, str] = {"more": "↑", "less": "↓", "neither": " "}
Function = Callable[[Trajectory], float | None]


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of an episode.

    Attributes:
        name: in files and tables; the variant of another project starts with the project, as in
            `hunavsim.stalled_time`.
        unit: an SI unit, `share` (a fraction, 0 to 1), `count` or `0/1`.
        better: `more`, `less` or `neither`: what a controller should achieve.
        formula: in words and symbols, as printed in docs/metrics.md.
        source: the paper or program that defines it; `sonata2d` for definitions of this package.
        function: computes the value; returns None where the metric is not defined, e.g. a distance to humans in an
            episode without humans.
        headline: whether the short table and the picture show it.
        variant_of: name of the metric of this package to compare a variant with.

    Raises:
        ValueError: `better` is another word.

    >>> duration = Metric("duration", "s", "less", "t_end - t_0", "mine", lambda trajectory: trajectory.time[-1])
    """

    name: str
    unit: str
    better: Better
    formula: str
    source: str
    function: Function = field(repr=False)
    headline: bool = False
    variant_of: str | None = None

    def __post_init__(self) -> None:
        if self.better not in ARROWS:
            raise ValueError(f"metric {self.name!r}: better is {self.better!r}; use {', '.join(ARROWS)}")

    def of(self, trajectory: Trajectory) -> float | None:
        """Compute the value for one episode, rounded to 1e-6; None where the metric is not defined or not finite."""
        value = self.function(trajectory)
        return None if value is None or not math.isfinite(value) else round(float(value), 6) + 0.0
