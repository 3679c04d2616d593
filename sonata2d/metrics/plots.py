"""Means and intervals as places on an axis, in per cent of its width: what a page needs to draw them as lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .definition import Metric
from .measure import Evaluation
from .table import cell

_MARGIN = 0.05  # of the axis, free at either end


@dataclass(frozen=True, slots=True)
class Axis:
    """What is drawn from left to right.

    Attributes:
        low, high: ends.
        ticks: where a line stands, in per cent, and what it says.
    """

    low: float
    high: float
    ticks: list[tuple[float, str]]

    @classmethod
    def of(cls, values: Sequence[float]) -> Axis:
        """One that holds all values, with two to five round ticks."""
        low, high = min(values), max(values)
        if high - low < 1e-9:
            low, high = min(low, 0.0), max(high, 0.0) or float(low == 0.0)
        free = _MARGIN * (high - low)
        bare = cls(low - free, high + free, [])
        return cls(bare.low, bare.high, [(bare.at(tick), f"{tick:g}") for tick in _round_between(low, high)])

    def at(self, value: float) -> float:
        """Its place, per cent."""
        return round(100.0 * (value - self.low) / (self.high - self.low), 2)

    def both(self, ends: tuple[float, float] | None) -> tuple[float, float] | None:
        """The places of two ends, if there are any."""
        return None if ends is None else (self.at(ends[0]), self.at(ends[1]))


@dataclass(frozen=True, slots=True)
class Row:
    """One evaluation in a panel: places in per cent; ends are None where there are too few runs for them."""

    label: str
    text: str
    mean: float | None
    interval: tuple[float, float] | None
    middle: tuple[float, float] | None  # half of all runs lie there


@dataclass(frozen=True, slots=True)
class Panel:
    """One metric, all evaluations on one axis."""

    metric: Metric
    axis: Axis
    rows: list[Row]


def panel(evaluations: Sequence[Evaluation], metric: Metric) -> Panel | None:
    """The panel of a metric; None if it is defined in no run."""
    halves = [_middle_half(one, metric) for one in evaluations]
    summaries = [one.summary(metric.name) for one in evaluations]
    found = [value for half in halves for value in half or ()]
    for summary in summaries:
        found += [] if summary.mean is None else [summary.mean, *(summary.interval or ())]
    if not found:
        return None
    axis = Axis.of([0.0, 1.0] if metric.unit == "0/1" else found)
    rows = [
        Row(
            label=one.label,
            text=cell(summary, len(one.runs)),
            mean=None if summary.mean is None else axis.at(summary.mean),
            interval=axis.both(summary.interval),
            middle=axis.both(half),
        )
        for one, summary, half in zip(evaluations, summaries, halves, strict=True)
    ]
    return Panel(metric, axis, rows)


def _middle_half(one: Evaluation, metric: Metric) -> tuple[float, float] | None:
    """First and third quartile over runs; None for what is only 0 or 1, or never defined."""
    values = [value for run in one.runs if (value := run.values.get(metric.name)) is not None]
    if not values or metric.unit == "0/1":
        return None
    low, high = np.quantile(values, (0.25, 0.75)).tolist()
    return low, high


def _round_between(low: float, high: float) -> list[float]:
    """Two to five multiples of 1, 2 or 5 times a power of ten, from low to high."""
    power = 10.0 ** math.floor(math.log10(high - low))
    for step in (power * share for share in (0.1, 0.2, 0.5, 1.0, 2.0)):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < 5:
            return [round(k * step, 12) for k in range(first, last + 1)]
    return [low, high]
