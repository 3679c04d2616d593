"""Evaluations side by side, as lines of text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .definition import Metric
from .measure import Evaluation
from .summary import Summary

ARROWS = {"more": "↑", "less": "↓", "neither": " "}
MARK = "*"  # the interval of the difference to the first, scene by scene, leaves out zero


def table(evaluations: Sequence[Evaluation], metrics: Sequence[Metric]) -> list[str]:
    """A line for each metric: its name, which way is better, and of each evaluation mean and interval.

    A `*` tells that it differs from the first evaluation: the bootstrap interval of the difference, run by run in the
    same scenes, leaves out zero. Where a metric is not defined in every run, (n) tells in how many.
    """
    rows = [("metric", "", "unit", *(one.label for one in evaluations))]
    rows += [(m.name, ARROWS[m.better], m.unit, *_cells(evaluations, m.name)) for m in metrics]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _cells(evaluations: Sequence[Evaluation], name: str) -> Iterator[str]:
    first = evaluations[0]
    for one in evaluations:
        told = cell(one.summary(name), len(one.runs))
        yield told + (MARK if one is not first and differs(one.less(first, name)) else "")


def cell(summary: Summary, runs: int) -> str:
    """`0.95 [0.85, 1.00]`, with `(n=12)` if it is not defined in every run."""
    if summary.mean is None:
        return "not defined"
    interval = summary.interval
    told = f"{number(summary.mean)}" + (f" [{number(interval.low)}, {number(interval.high)}]" if interval else "")
    return told if summary.n == runs else f"{told} (n={summary.n})"


def differs(difference: Summary) -> bool:
    """Whether the interval of a difference leaves out zero."""
    interval = difference.interval
    return interval is not None and not interval.low <= 0.0 <= interval.high


def number(value: float) -> str:
    """Two or three digits that count; of 0 and 1 themselves no more than that."""
    if value in (0.0, 1.0):
        return f"{value:.0f}"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2f}" if abs(value) >= 0.1 else f"{value:.3f}"
