"""Evaluations as one HTML file that needs no network, no script and no further package: tables, plots, film strips."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader

from ..errors import RenderError
from ..record import write_atomically
from ..record.software import software
from ..version import PHYSICS_VERSION
from .catalogue import FAMILIES, METRICS
from .chart import COLOURS
from .definition import DEFINITIONS_VERSION, Metric
from .endings import KINDS, endings, kinds_of
from .extremes import BEST_RULE, WORST_RULE
from .measure import Evaluation
from .plots import panel
from .strips import extremes
from .summary import LEVEL
from .table import ARROWS, MARK, differs, number

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
