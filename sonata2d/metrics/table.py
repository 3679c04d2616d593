"""Text tables of evaluations side by side, and the shares of outcomes with Wilson intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .definition import Metric
from .measurement import Evaluation, Measured
from .summary import Interval, Summary, wilson_interval

KINDS = {
    "goal": "goal reached, nothing touched",
    "goal-touch": "goal reached after a touch",
    "timeout": "time ran out",
    "contact": "ended by a contact",
    "stopped": "stopped by the controller or a person",
    "regenerate": "asked for another scene",
    "error": "error in the controller",
}


@dataclass(frozen=True, slots=True)
class Ending:
    """How many runs ended in one way.

    Attributes:
        kind: a key of `KINDS`.
        count, share: of the runs.
        before: share of those that the kinds before it have, for bars end to end.
        interval: of the share.
    """

    kind: str
    count: int
    share: float
    before: float
    interval: Interval


def endings(evaluation: Evaluation, kinds: Sequence[str]) -> list[Ending]:
    """Counts of these kinds, in this order; none for an evaluation without runs."""
    runs = len(evaluation.runs)
    counts = Counter(map(_kind, evaluation.runs))
    found: list[Ending] = []
    for kind in kinds if runs else ():
        before = found[-1].before + found[-1].share if found else 0.0
        found.append(Ending(kind, counts[kind], counts[kind] / runs, before, wilson_interval(counts[kind], runs)))
    return found


def kinds_of(evaluations: Sequence[Evaluation]) -> list[str]:
    """The ways in which any run ended."""
    there = {_kind(run) for one in evaluations for run in one.runs}
    return [kind for kind in KINDS if kind in there]


def _kind(run: Measured) -> str:
    touched = run.outcome == "goal" and run.values.get("success_strict") == 0.0
    return "goal-touch" if touched else run.outcome


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
