"""A film strip of one run: some moments as pictures, when each was, and what there is to say of the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..record import read_episode
from ..view import filmstrip
from .extremes import COMPLIANCE, best_of, why_best, why_worst, worst_of
from .measure import Measured
from .run import Run
from .touch import Touch

MOMENTS = 6


@dataclass(frozen=True, slots=True)
class Strip:
    """One run in pictures.

    Attributes:
        title: what it is an example of.
        why: the rule's reason.
        facts: metrics of the run, as text.
        origin: scenario, seed, episode, file.
        driver: of the robot, as the file tells it.
        moments: when, and what is special then; and a PNG within a URL.
    """

    title: str
    why: str
    facts: str
    origin: str
    driver: str
    moments: list[tuple[str, str]]


def extremes(runs: Sequence[Measured], files: Sequence[Path]) -> list[Strip]:
    """The best and the worst of some runs; the only one, if best and worst are the same.

    Args:
        runs: what was measured.
        files: where each of them is recorded.

    Raises:
        RecordError: a file cannot be read.
    """
    if not runs:
        return []
    where = dict(zip(map(id, runs), files, strict=True))
    best, worst = best_of(runs), worst_of(runs)
    if best is worst:
        return [_strip("best and worst", why_best(best), best, where[id(best)])]
    return [
        _strip("best", why_best(best), best, where[id(best)]),
        _strip("worst", why_worst(worst), worst, where[id(worst)]),
    ]


def _strip(title: str, why: str, measured: Measured, file: Path) -> Strip:
    record = read_episode(file)
    run = Run(record)
    event = _event(run)
    looks = _looks(len(run), None if event is None else event[0])
    urls = filmstrip([record.snapshot(k) for k in range(len(run))], looks)
    return Strip(
        title=title,
        why=why,
        facts=_facts(measured, run),
        origin=f"{measured.name}, seed {measured.seed} / episode {measured.episode}, {measured.file}",
        driver=record.author.path,
        moments=[
            (f"{run.time[k]:.1f} s" + (f", {event[1]}" if event and k == event[0] else ""), url)
            for k, url in zip(looks, urls, strict=True)
        ],
    )


def _event(run: Run) -> tuple[int, str] | None:
    """The look that tells most, and what happens then: the first touch by the robot's fault, any touch, a meeting."""
    by_rank = sorted(run.touches, key=lambda touch: (not touch.robot_at_fault, touch.kind != "human", touch.first))
    if by_rank:
        return by_rank[0].first, _told(by_rank[0])
    return (int(np.argmin(run.nearest)), "nearest") if run.has_people else None


def _told(touch: Touch) -> str:
    what = {"human": "person", "object": "furniture", "wall": "wall"}[touch.kind]
    return f"touches {what}" if touch.robot_at_fault else f"touched by {what}"


def _looks(count: int, event: int | None) -> list[int]:
    """`MOMENTS` looks of so many, evenly spread; the inner one nearest to the event is the event."""
    looks = [round(k) for k in np.linspace(0, count - 1, MOMENTS)]
    if event is not None and event not in looks:
        looks[min(range(1, MOMENTS - 1), key=lambda k: abs(looks[k] - event))] = event
    return sorted(set(looks))


def _facts(measured: Measured, run: Run) -> str:
    """The outcome, and the metrics by which runs are chosen."""
    outcome = run.record.outcome
    texts = [f"outcome: {outcome.status} at {outcome.time:.1f} s"]
    for name, text in (
        ("spl", "SPL {:.2f}"),
        ("human_clearance_min", "nearest person {:.2f} m"),
        (COMPLIANCE, "personal space compliance {:.2f}"),
        ("interaction_intrusion", "interaction intrusion {:.2f}"),
        ("robot_on_person", "touches of people by its fault {:.0f}"),
    ):
        value = measured.values.get(name)
        texts += [] if value is None else [text.format(value)]
    return ", ".join(texts)
