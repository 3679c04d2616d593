"""The plots of the evaluation page: shares of episodes, and means with intervals on a common axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .definition import Metric
from .measurement import Evaluation
from .plots import EVENTS, Share, share_of
from .summary import Summary

# --- Shares of episodes ---


@dataclass(frozen=True, slots=True)
class Shares:
    """In which share of the episodes something happened, for each evaluation; None where it is not defined."""

    metric: Metric
    rows: list[Share | None]

    @property
    def constant(self) -> str | None:
        """`no` or `every` if it happened in no or in every episode of all evaluations, so that all bars are equal."""
        fractions = {share.fraction for share in self.rows if share is not None}
        return {0.0: "no", 1.0: "every"}.get(fractions.pop()) if len(fractions) == 1 else None


def shares(evaluations: Sequence[Evaluation], metric: Metric) -> Shares | None:
    """The shares of episodes of a metric that is 0 or 1, or counts events; None for others, or if it is not defined."""
    rows = [share_of(one, metric) for one in evaluations]
    return Shares(metric, rows) if any(rows) else None


def constant_of(evaluations: Sequence[Evaluation], metric: Metric) -> float | None:
    """The value of a measure that is the same in all episodes of all evaluations, so that a plot would be empty."""
    values = {value for one in evaluations for value in one.values(metric.name)}
    return values.pop() if len(values) == 1 and metric.unit not in EVENTS else None


# --- Plots of means and intervals ---


@dataclass(frozen=True, slots=True)
class Axis:
    """A horizontal axis from `low` to `high` with ticks, as (position in per cent, text)."""

    low: float
    high: float
    ticks: list[tuple[float, str]]

    @classmethod
    def of(cls, values: Sequence[float]) -> Axis:
        """An axis that holds all values, with a margin of 5 % at both ends and two to five round ticks."""
        low, high = min(values), max(values)
        if high - low < 1e-9:  # a single value: extend the axis to zero, or to one
            low, high = min(low, 0.0), max(high, 0.0) or float(low == 0.0)
        margin = 0.05 * (high - low)
        bare = cls(low - margin, high + margin, [])
        return cls(bare.low, bare.high, [(bare.at(tick), f"{tick:g}") for tick in _round_numbers(low, high)])

    def at(self, value: float) -> float:
        """Position of a value, per cent of the axis."""
        return round(100.0 * (value - self.low) / (self.high - self.low), 2)


def _round_numbers(low: float, high: float) -> list[float]:
    """Two to five multiples of 1, 2 or 5 times a power of ten within [low, high]."""
    power = 10.0 ** math.floor(math.log10(high - low))
    for step in (power * factor for factor in (0.1, 0.2, 0.5, 1.0, 2.0)):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < 5:
            return [round(k * step, 12) for k in range(first, last + 1)]
    return [low, high]


@dataclass(frozen=True, slots=True)
class Panel:
    """The plot of one metric: for each evaluation its summary and quartiles, (25 %, 75 %) or None."""

    metric: Metric
    axis: Axis
    rows: list[tuple[Summary, tuple[float, float] | None]]


def panel(evaluations: Sequence[Evaluation], metric: Metric) -> Panel | None:
    """The plot of a measure; None if it is not defined in any episode, the same in all, or shown as shares."""
    if metric.unit in EVENTS or constant_of(evaluations, metric) is not None:
        return None
    rows = [(one.summary(metric.name), _quartiles(one, metric)) for one in evaluations]
    shown: list[float] = []
    for summary, quartiles in rows:
        shown += [] if summary.mean is None else [summary.mean, *(summary.interval or ()), *(quartiles or ())]
    return Panel(metric, Axis.of(shown), rows) if shown else None


def _quartiles(evaluation: Evaluation, metric: Metric) -> tuple[float, float] | None:
    """First and third quartile over episodes; None for metrics that are not defined."""
    values = evaluation.values(metric.name)
    if not values:
        return None
    low, high = np.quantile(values, (0.25, 0.75)).tolist()
    return low, high
