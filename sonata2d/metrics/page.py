"""The evaluation page: one HTML file with tables, plots and film strips."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..errors import RenderError
from ..record.files import write_atomically
from ..record.layout import software
from ..record.reader import read_episode
from ..version import PHYSICS_VERSION
from ..view.strips import filmstrip
from .catalogue import FAMILIES, METRICS
from .definition import DEFINITIONS_VERSION, Metric
from .measurement import Evaluation, Measured
from .plots import COLOURS
from .summary import LEVEL
from .table import ARROWS, KINDS, MARK, cell, differs, endings, kinds_of, number
from .trajectory import Touch, Trajectory

COMPLIANCE = f"personal_space_compliance_{INTIMATE_DISTANCE:.2f}"

BEST_RULE = (
    f"Best: the goal was reached; nothing was touched; nobody was nearer than {INTIMATE_DISTANCE:g} m, and no group or"
    f" interaction was cut; but somebody was met, nearer than {PERSONAL_DISTANCE:g} m. Of these runs the one with the"
    " highest SPL (to 0.01), and of equals the closest meeting. Where no run does all that, one that does the most from"
    " the start of the list."
)
WORST_RULE = (
    "Worst: the run with the most touches of people by the robot's fault; without any, one that did not reach the goal;"
    " then one that touched a wall or furniture; then the lowest personal-space compliance; then the lowest SPL."
)


def best_of(runs: Sequence[Measured]) -> Measured:
    """The run that `BEST_RULE` tells; the first of equals."""
    return max(runs, key=_goodness)


def worst_of(runs: Sequence[Measured]) -> Measured:
    """The run that `WORST_RULE` tells; the first of equals."""
    return max(runs, key=_badness)


def why_best(run: Measured) -> str:
    """What made it the best, or what even the best lacks."""
    reached, untouched, kept, met, *_ = _goodness(run)
    if not reached:
        return "no run reached the goal; this one is the nearest to it by the rule"
    lacks = [
        text
        for is_so, text in (
            (untouched, "something was touched"),
            (kept, "somebody's space was intruded upon"),
            (met, f"nobody was met within {PERSONAL_DISTANCE:g} m"),
        )
        if not is_so
    ]
    if lacks:
        return f"goal reached, though {' and '.join(lacks)}: no run did better; SPL {_value(run, 'spl'):.2f}"
    return f"goal reached past people, nothing touched, nobody's space intruded upon; SPL {_value(run, 'spl'):.2f}"


def why_worst(run: Measured) -> str:
    """What made it the worst."""
    touches, missed, things, intruded, _ = _badness(run)
    if touches:
        return f"touched people by its own fault: {touches:.0f} time{'s' if touches > 1 else ''}"
    if missed:
        return "did not reach the goal"
    if things:
        return f"touched walls or furniture: {things:.0f} time{'s' if things > 1 else ''}"
    if intruded:
        return f"nearer than {INTIMATE_DISTANCE:g} m to somebody in {100.0 * intruded:.0f} % of its looks"
    return f"the lowest SPL, {_value(run, 'spl'):.2f}; it reached the goal, touched nothing and kept its distance"


def _goodness(run: Measured) -> tuple[bool, bool, bool, bool, float, float]:
    """More is better, the first thing first."""
    nearest = _value(run, "human_clearance_min", PERSONAL_DISTANCE)
    between = _value(run, "group_intrusion") + _value(run, "interaction_intrusion")
    return (
        _value(run, "success") > 0.0,
        _value(run, "collisions") == 0.0,
        between == 0.0 and _value(run, COMPLIANCE, 1.0) == 1.0,
        nearest < PERSONAL_DISTANCE,
        round(_value(run, "spl"), 2),
        -nearest,
    )


def _badness(run: Measured) -> tuple[float, bool, float, float, float]:
    """More is worse, the first thing first."""
    return (
        _value(run, "robot_on_person"),
        _value(run, "success", 1.0) == 0.0,
        _value(run, "wall_collisions") + _value(run, "object_collisions"),
        1.0 - _value(run, COMPLIANCE, 1.0),
        -_value(run, "spl"),
    )


def _value(run: Measured, name: str, otherwise: float = 0.0) -> float:
    """A metric of a run; something else where it is not defined."""
    value = run.values.get(name)
    return otherwise if value is None else value


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
    run = Trajectory(record)
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


def _event(run: Trajectory) -> tuple[int, str] | None:
    """The look that tells most, and what happens then: the first touch by the robot's fault, any touch, a meeting."""
    by_rank = sorted(run.touches, key=lambda touch: (not touch.robot_at_fault, touch.kind != "human", touch.first))
    if by_rank:
        return by_rank[0].first, _described(by_rank[0])
    return (int(np.argmin(run.nearest)), "nearest") if run.has_people else None


def _described(touch: Touch) -> str:
    what = {"human": "person", "object": "furniture", "wall": "wall"}[touch.kind]
    return f"touches {what}" if touch.robot_at_fault else f"touched by {what}"


def _looks(count: int, event: int | None) -> list[int]:
    """`MOMENTS` looks of so many, evenly spread; the inner one nearest to the event is the event."""
    looks = [round(k) for k in np.linspace(0, count - 1, MOMENTS)]
    if event is not None and event not in looks:
        looks[min(range(1, MOMENTS - 1), key=lambda k: abs(looks[k] - event))] = event
    return sorted(set(looks))


def _facts(measured: Measured, run: Trajectory) -> str:
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


FEW = 20  # runs, below which intervals are too narrow
_BESIDES = ("collisions", "object_collisions", "wall_collisions", "person_on_robot")  # the headline ones


def page_metrics() -> tuple[Metric, ...]:
    """Those that a page shows unless others are asked for: the headline ones, and every class of collision."""
    return tuple(metric for metric in METRICS.values() if metric.headline or metric.name in _BESIDES)


def refuse_page(path: Path) -> None:
    """Say before the work whether a page could be written.

    Raises:
        RenderError: its name does not end in .html.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise RenderError(f"{path}: a page of metrics ends in .html")


def save_page(
    path: str | Path,
    evaluations: Sequence[Evaluation],
    files: Sequence[Sequence[Path]] | None = None,
    metrics: Sequence[Metric] | None = None,
) -> None:
    """Write evaluations side by side as a page.

    Args:
        path: `.html`.
        evaluations: one or more, each with its column and colour.
        files: where the runs of each evaluation are recorded, in the order of its runs; without them there are no
            film strips.
        metrics: rows of the table and panels; `page_metrics()` unless given.

    Raises:
        RenderError: the page's name does not end in .html.
        RecordError: a file cannot be read, or the page not written.
    """
    path, shown = Path(path), page_metrics() if metrics is None else metrics
    refuse_page(path)
    strips = [extremes(one.runs, where) for one, where in zip(evaluations, files, strict=True)] if files else []
    kinds, names = kinds_of(evaluations), short_names([one.label for one in evaluations])
    page = _template().render(
        title=", ".join(names),
        about=_about(evaluations),
        resamples=max(one.resamples for one in evaluations),
        few=FEW if any(len(one.runs) < FEW for one in evaluations) else None,
        level=LEVEL,
        names=names,
        kinds={kind: KINDS[kind] for kind in kinds},
        endings=[(name, len(one.runs), endings(one, kinds)) for name, one in zip(names, evaluations, strict=True)],
        families=_families(evaluations, shown),
        panels=[found for metric in shown if (found := panel(evaluations, metric))],
        strips=list(zip(names, strips, strict=True)) if strips else [],
        rules=(BEST_RULE, WORST_RULE),
        arrows=ARROWS,
        mark=MARK,
        colours=COLOURS[:-1],  # the last is black, which the page takes from its ink
    )
    write_atomically(path, page.encode())


@dataclass(frozen=True, slots=True)
class Cell:
    """What the table says of one metric of one evaluation; `mark` is best, alike or nothing."""

    mean: str
    interval: str
    n: int
    mark: str
    differs: bool


def cells(evaluations: Sequence[Evaluation], metric: Metric) -> list[Cell]:
    """One metric of each evaluation, with what is to be said of them side by side."""
    first, found = evaluations[0], []
    for one, mark in zip(evaluations, _marks(evaluations, metric), strict=True):
        summary = one.summary(metric.name)
        ends = ", ".join(map(number, summary.interval)) if summary.interval else ""
        mean = "–" if summary.mean is None else number(summary.mean)
        apart = one is not first and differs(one.less(first, metric.name))
        found.append(Cell(mean, f"[{ends}]" if ends else "", summary.n, mark, apart))
    return found


def _marks(evaluations: Sequence[Evaluation], metric: Metric) -> list[str]:
    """`best` for the best mean; `alike` where, run by run in the same scenes, it is not told apart from that one."""
    means = [one.summary(metric.name).mean for one in evaluations]
    known = [mean for mean in means if mean is not None]
    if metric.better == "neither" or len(set(known)) < 2:
        return [""] * len(means)
    top = max(known) if metric.better == "more" else min(known)
    leader = evaluations[means.index(top)]
    return [
        "best" if mean == top else "alike" if mean is not None and _is_alike(one, leader, metric) else ""
        for one, mean in zip(evaluations, means, strict=True)
    ]


def _is_alike(one: Evaluation, other: Evaluation, metric: Metric) -> bool:
    """Whether the interval of their difference holds zero; False if they share too few scenes to say."""
    difference = one.less(other, metric.name)
    return difference.interval is not None and not differs(difference)


def _families(
    evaluations: Sequence[Evaluation], shown: Sequence[Metric]
) -> list[tuple[str, list[tuple[Metric, list[Cell]]]]]:
    """Rows of the table by family; variants of other programs come last."""
    own = [(name, [metric for metric in shown if metric in family]) for name, family in FAMILIES.items()]
    named = [*own, ("The same names elsewhere", [metric for metric in shown if metric.variant_of])]
    return [(name, [(metric, cells(evaluations, metric)) for metric in metrics]) for name, metrics in named if metrics]


def _about(evaluations: Sequence[Evaluation]) -> Mapping[str, Any]:
    """What was measured, and with what."""
    tools = {"metric definitions": DEFINITIONS_VERSION, "physics": PHYSICS_VERSION, **software()}
    return {
        "rows": [
            (
                one.label,
                len(one.runs),
                ", ".join(sorted({run.name for run in one.runs})),
                _told({run.seed for run in one.runs}),
                _told({run.episode for run in one.runs}),
            )
            for one in evaluations
        ],
        "shared": len(set.intersection(*({run.scene for run in one.runs} for one in evaluations))),
        "pooled": len({run.name for one in evaluations for run in one.runs}) > 1,
        "versions": ", ".join(f"{name} {version}" for name, version in tools.items()),
    }


def short_names(labels: Sequence[str]) -> list[str]:
    """Labels without the folders that they all begin and end with.

    >>> short_names(["runs/orca/office", "runs/mine/office"])
    ['orca', 'mine']
    """
    parts = [re.split(r"[/\\]", label) for label in labels]
    for side in (0, -1):
        while len(parts) > 1 and all(len(own) > 1 for own in parts) and len({own[side] for own in parts}) == 1:
            parts = [own[1:] if side == 0 else own[:-1] for own in parts]
    return ["/".join(own) for own in parts]


def _told(numbers: set[int]) -> str:
    """`0..19` for a whole stretch, `1, 4, 9` for a few, else how many."""
    order = sorted(numbers)
    if len(order) > 2 and order[-1] - order[0] == len(order) - 1:
        return f"{order[0]}..{order[-1]}"
    return ", ".join(map(str, order)) if len(order) <= 5 else f"{len(order)} of {order[0]}..{order[-1]}"


def _template() -> Any:
    return Environment(
        loader=PackageLoader(__package__, "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    ).get_template("page.html")
