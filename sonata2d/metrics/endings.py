"""How runs ended: counts and shares, with intervals that hold even where all runs ended alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from .measure import Evaluation, Measured
from .summary import Interval, wilson_interval

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
