"""The evaluation page: one self-contained HTML file with outcomes, metrics, plots and film strips.

This module computes the numbers; the template evaluation_page.html holds texts and layout.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..core.notebook import Advance
from ..errors import RenderError
from ..record.layout import software_versions
from ..record.reader import read_episode
from ..version import PHYSICS_VERSION
from ..view.stills import filmstrip
from . import fleet
from .catalogue import FAMILIES, METRICS
from .definition import ARROWS, DEFINITIONS_VERSION, Metric
from .evaluation import EVENTS, MARK, Evaluation, Measured
from .exemplars import BEST, COMPLIANCE, WORST, best_of, why_best, why_worst, worst_of
from .summary import FEW, LEVEL, Share
from .templates import render
from .trajectory import Trajectory

_OUTCOMES = {  # text and colour
    "goal": ("goal reached without collision", "#009e73"),
    "goal-collision": ("goal reached after a collision", "#56b4e9"),
    "timeout": ("time limit reached", "#e69f00"),
    "contact": ("ended by a contact", "#d55e00"),
    "stopped": ("stopped by the controller or a person", "#cc79a7"),
    "regenerate": ("new scene requested", "#f0e442"),
    "error": ("error in the controller", "#8b929c"),
}
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # of evaluations: Okabe & Ito
_MAX_NAME = 26  # characters of the name of an evaluation
_MOMENTS = 6  # pictures of a film strip
_COLLISIONS = ("collisions", "object_collisions", "wall_collisions", "person_on_robot")  # beside the headline metrics


def page_metrics() -> tuple[Metric, ...]:
    """The metrics of a page by default: the headline metrics and every class of collision."""
    return tuple(metric for metric in METRICS.values() if metric.headline or metric.name in _COLLISIONS)


def check_page_path(path: Path) -> None:
    """Check the path of a page before any work is done.

    Raises:
        RenderError: the path does not end in .html or .htm.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise RenderError(f"{path}: the name of an evaluation page must end in .html")


def page_of(
    evaluations: Sequence[Evaluation],
    files: Sequence[Sequence[Path]] | None = None,
    metrics: Sequence[Metric] | None = None,
    advance: Advance = lambda step: None,
) -> str:
    """A page that shows evaluations side by side, as HTML.

    Args:
        evaluations: one or more, each shown as one column and one colour.
        files: for each evaluation the files of its episodes, in the same order; without files the page has no film
            strips.
        metrics: the metrics to show; `page_metrics()` by default.
        advance: called with 1 when the film strips of an evaluation are drawn.

    Raises:
        RecordError: an episode file cannot be read.
    """
    shown = (*page_metrics(), *fleet.METRICS) if metrics is None else metrics  # those that are not defined are left out
    strips = []
    for evaluation, evaluation_files in zip(evaluations, files, strict=True) if files else ():
        strips.append(_film_strips(evaluation.episodes, evaluation_files))
        advance(1)
    kinds = outcome_kinds(evaluations)
    defined = [metric for metric in shown if any(evaluation.values(metric.name) for evaluation in evaluations)]
    constants = {metric: constant_of(evaluations, metric) for metric in defined}
    versions = {"metric definitions": DEFINITIONS_VERSION, "physics": PHYSICS_VERSION, **software_versions()}
    return render(
        "evaluation_page.html",
        evaluations=evaluations,
        episodes=[episode for evaluation in evaluations for episode in evaluation.episodes],
        names=short_names([evaluation.label for evaluation in evaluations]),
        number_range=number_range,
        versions=versions,
        common_scenes=set.intersection(*(evaluation.scenes for evaluation in evaluations)),
        few=FEW,
        level=f"{100 * LEVEL:.0f} %",
        outcomes={kind: _OUTCOMES[kind] for kind in kinds},
        outcome_shares=[outcome_shares(evaluation, kinds) for evaluation in evaluations],
        families=_families(shown),
        marks=partial(marks, evaluations),
        events=EVENTS,
        plotted=[metric for metric, value in constants.items() if value is None],
        constants={metric: value for metric, value in constants.items() if value is not None},
        axis_of=partial(axis_of, evaluations),
        strips=strips,
        best=BEST,
        worst=WORST,
        compliance=COMPLIANCE,
        arrows=ARROWS,
        mark=MARK,
        colours=_COLOURS,
    )


def number_range(numbers: Iterable[int]) -> str:
    """`0..19` for consecutive numbers, `1, 4, 9` for up to five others, else `6 of 0..19`."""
    order = sorted(set(numbers))
    if len(order) > 2 and order[-1] - order[0] == len(order) - 1:
        return f"{order[0]}..{order[-1]}"
    return ", ".join(map(str, order)) if len(order) <= 5 else f"{len(order)} of {order[0]}..{order[-1]}"


def outcome_kinds(evaluations: Sequence[Evaluation]) -> list[str]:
    """The outcomes that occur, in the order of `_OUTCOMES`."""
    kinds = {_outcome_kind(episode) for evaluation in evaluations for episode in evaluation.episodes}
    return [kind for kind in _OUTCOMES if kind in kinds]


def outcome_shares(evaluation: Evaluation, kinds: Sequence[str]) -> dict[str, Share]:
    """Share of the episodes with each outcome, in the order of `kinds`; empty for an evaluation without episodes."""
    total = len(evaluation.episodes)
    counts = Counter(map(_outcome_kind, evaluation.episodes))
    return {kind: Share(counts[kind], total) for kind in kinds} if total else {}


def _outcome_kind(episode: Measured) -> str:
    collided = episode.outcome == "goal" and episode.values.get("success_strict") == 0.0
    return "goal-collision" if collided else episode.outcome


def _families(metrics: Sequence[Metric]) -> dict[str, list[Metric]]:
    """The metrics by family; variants of other projects come last."""
    families = {name: [metric for metric in metrics if metric in family] for name, family in FAMILIES.items()}
    families["Variants of other programs"] = [metric for metric in metrics if metric.variant_of]
    return {name: members for name, members in families.items() if members}


def short_names(labels: Sequence[str]) -> list[str]:
    """Shorten labels of evaluations, as long as they remain different.

    Folders with which all labels begin or end are left out, of a class only its name is used, and long names are
    shortened in the middle.

    >>> short_names(["runs/orca/office", "runs/mine/office"])
    ['orca', 'mine']
    >>> short_names(["./controllers/polite.py:Polite", "orca"])
    ['Polite', 'orca']
    """
    parts = [re.split(r"[/\\]", label) for label in labels]
    for side in (0, -1):
        while len(parts) > 1 and all(len(part) > 1 for part in parts) and len({part[side] for part in parts}) == 1:
            parts = [part[1:] if side == 0 else part[:-1] for part in parts]
    names = ["/".join(part) for part in parts]
    for shorten in (_class_name, _middle_left_out):
        shorter = [shorten(name) for name in names]
        names = [short if shorter.count(short) == 1 else name for short, name in zip(shorter, names, strict=True)]
    return names


def _class_name(name: str) -> str:
    """`Polite` for `./polite.py:Polite` and `package.polite:Polite`, and of both parts of `driver+labeller`."""
    return "+".join(re.sub(r"^.*:(?=[^\W\d]\w*$)", "", part) for part in name.split("+"))


def _middle_left_out(name: str) -> str:
    half = (_MAX_NAME - 1) // 2
    return name if len(name) <= _MAX_NAME else f"{name[:half]}…{name[-half:]}"


# --- Table of metrics ---


def marks(evaluations: Sequence[Evaluation], metric: Metric) -> list[str]:
    """The mark of each evaluation in the table row of a metric.

    Returns:
        `best` for the best mean, `equal` if a mean does not differ significantly from the best, else empty; always
        empty if the metric is defined in different numbers of episodes, whose means cannot be compared.
    """
    summaries = [evaluation.summary(metric.name) for evaluation in evaluations]
    means = [summary.mean for summary in summaries]
    defined = [mean for mean in means if mean is not None]
    # no best without a preferred direction, if all are equal, or if the means are over different numbers of episodes
    if metric.better == "neither" or len(set(defined)) < 2 or len({summary.n for summary in summaries} - {0}) > 1:
        return [""] * len(means)
    best = max(defined) if metric.better == "more" else min(defined)
    leader = evaluations[means.index(best)]

    def mark(evaluation: Evaluation, mean: float | None) -> str:
        if mean is None or mean == best:
            return "" if mean is None else "best"
        difference = evaluation.difference(leader, metric.name)
        # without an interval there are too few common scenes to call them equal
        return "equal" if difference.interval is not None and not difference.excludes_zero else ""

    return [mark(evaluation, mean) for evaluation, mean in zip(evaluations, means, strict=True)]


# --- Plots ---


def constant_of(evaluations: Sequence[Evaluation], metric: Metric) -> float | None:
    """The value of a metric that is the same in all episodes of all evaluations, so that a plot would be empty.

    Of a metric of events, whether they happened.
    """
    values = {value for evaluation in evaluations for value in evaluation.values(metric.name)}
    if metric.unit in EVENTS:
        values = {float(value > 0.0) for value in values}
    return values.pop() if len(values) == 1 else None


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


def axis_of(evaluations: Sequence[Evaluation], metric: Metric) -> Axis:
    """The axis of the plot of a measure, with its means, intervals and quartiles."""
    summaries = [evaluation.summary(metric.name) for evaluation in evaluations]
    ends = [summary.interval or () for summary in summaries]
    ends += [evaluation.quartiles(metric.name) or () for evaluation in evaluations]
    means = [summary.mean for summary in summaries if summary.mean is not None]
    return Axis.of([*means, *(value for pair in ends for value in pair)])


def _round_numbers(low: float, high: float) -> list[float]:
    """Two to five multiples of 1, 2 or 5 times a power of ten within [low, high]."""
    power = 10.0 ** math.floor(math.log10(high - low))
    for step in (power * factor for factor in (0.1, 0.2, 0.5, 1.0, 2.0)):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < 5:
            return [round(k * step, 12) for k in range(first, last + 1)]
    return [low, high]


# --- Film strips of the best and the worst episode ---


def _film_strips(episodes: Sequence[Measured], files: Sequence[Path]) -> list[dict[str, Any]]:
    """Film strips of the best and the worst episode; a single strip if they are the same.

    Args:
        episodes: the measured episodes.
        files: the file of each.

    Returns:
        For each strip its `title`, `why` the `episode` was chosen, its `duration` (s), the path of the `controller`,
        and `moments`: time (s) and event of each picture, and the picture as a data URL.

    Raises:
        RecordError: a file cannot be read.
    """
    if not episodes:
        return []
    path = dict(zip(map(id, episodes), files, strict=True))
    best, worst = best_of(episodes), worst_of(episodes)
    if best is worst:
        return [_strip("best and worst", why_best(best), best, path[id(best)])]
    return [
        _strip("best", why_best(best), best, path[id(best)]),
        _strip("worst", why_worst(worst), worst, path[id(worst)]),
    ]


def _strip(title: str, why: str, episode: Measured, file: Path) -> dict[str, Any]:
    record = read_episode(file)
    trajectory = Trajectory(record)
    event, event_text = _event(trajectory)
    indices = _moments(len(trajectory), event)
    pictures = filmstrip([record.snapshot(index) for index in range(len(trajectory))], indices)
    moments = [
        (float(trajectory.time[index]), event_text if index == event else "", picture)
        for index, picture in zip(indices, pictures, strict=True)
    ]
    facts = {"title": title, "why": why, "episode": episode, "controller": record.controller_info.path}
    return facts | {"duration": record.outcome.time, "moments": moments}


def _event(trajectory: Trajectory) -> tuple[int | None, str]:
    """Index and description of the most informative state.

    This is the first collision: of collisions caused by the robot, else with humans, else of any. Without collisions it
    is the state of the smallest clearance to a human; None without humans.
    """
    if trajectory.collisions:
        first = min(trajectory.collisions, key=lambda c: (not c.robot_at_fault, c.kind != "human", c.first))
        other = {"human": "person", "object": "furniture", "robot": "another robot"}.get(first.kind, first.kind)
        return first.first, f"collision with {other}" + (", caused by the robot" if first.robot_at_fault else "")
    return (int(np.argmin(trajectory.clearance)), "nearest") if trajectory.has_humans else (None, "")


def _moments(count: int, event: int | None) -> list[int]:
    """Evenly spaced indices below `count`, at most `_MOMENTS`; the inner one nearest to the event is moved there."""
    indices = [round(index) for index in np.linspace(0, count - 1, _MOMENTS)]
    if event is not None and event not in indices:
        indices[min(range(1, _MOMENTS - 1), key=lambda k: abs(indices[k] - event))] = event
    return sorted(set(indices))
