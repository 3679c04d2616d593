"""The picture of an evaluation for print: one panel per metric with every episode, means and confidence intervals."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.files.locations import location
from ..core.files.whole_file import whole_file
from ..core.portable_math import Array
from ..errors import RenderError
from .definition import ARROWS, Metric
from .measurement import Evaluation
from .summary import Interval, wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES = (".png", ".pdf", ".svg")
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # Okabe & Ito
COLUMNS = 3
EVENTS = ("0/1", "count")  # units of metrics that are shown as shares of episodes
_MAX_NAME = 26  # characters of a name in pictures and pages
_PANEL = (2.4, 0.55)  # inches: width of a panel, height without its rows
_ROW = 0.24  # inches, height of one evaluation


def short_names(labels: Sequence[str]) -> list[str]:
    """Shorten labels of evaluations for pictures and pages, as long as they remain different.

    Folders with which all labels begin or end are left out, of a class only its name is used, and long names are
    shortened in the middle.

    >>> short_names(["runs/orca/office", "runs/mine/office"])
    ['orca', 'mine']
    >>> short_names(["./controllers/polite.py:Polite", "orca"])
    ['Polite', 'orca']
    """
    parts = [re.split(r"[/\\]", label) for label in labels]
    for side in (0, -1):
        while len(parts) > 1 and all(len(own) > 1 for own in parts) and len({own[side] for own in parts}) == 1:
            parts = [own[1:] if side == 0 else own[:-1] for own in parts]
    names = ["/".join(own) for own in parts]
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


@dataclass(frozen=True, slots=True)
class Share:
    """In how many of the episodes in which a metric is defined something happened, and the share's Wilson interval."""

    count: int
    total: int
    interval: Interval

    @property
    def fraction(self) -> float:
        return self.count / self.total


def share_of(evaluation: Evaluation, metric: Metric) -> Share | None:
    """In which share of the episodes a metric that is 0 or 1, or counts events, is not 0; None for other metrics."""
    values = evaluation.values(metric.name) if metric.unit in EVENTS else []
    if not values:
        return None
    count = sum(value > 0.0 for value in values)
    return Share(count, len(values), wilson_interval(count, len(values)))


def check_picture_path(path: Path) -> None:
    """Check that a picture can be drawn before any work is done.

    Raises:
        RenderError: the suffix is unknown, or matplotlib is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise RenderError(f"{path}: the name of a picture of metrics must end in {', '.join(SUFFIXES)}")
    if find_spec("matplotlib") is None:
        raise RenderError("a picture of metrics needs matplotlib; pip install 'sonata2d[plots]'")


def chart(path: str | Path, evaluations: Sequence[Evaluation], metrics: Sequence[Metric], *, title: str = "") -> None:
    """Draw evaluations side by side.

    Args:
        path: of the picture, ending in .png, .pdf or .svg.
        evaluations: one or more; each has the same colour in all panels.
        metrics: one panel each; metrics that are not defined in any episode are left out. Those that are 0 or 1, or
            count events, are shown as shares of episodes, the others with every episode.
        title: above all panels.

    Raises:
        RenderError: the picture cannot be drawn or written, or no metric is defined in any episode.
    """
    path = location(path)
    check_picture_path(path)
    shown = [metric for metric in metrics if any(one.summary(metric.name).n for one in evaluations)]
    if not shown:
        raise RenderError("nothing to draw: none of the metrics is defined in any episode; choose others")
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    rows = -(-len(shown) // COLUMNS)
    height = rows * (_PANEL[1] + len(evaluations) * _ROW) + (0.4 if title else 0.1)
    figure = Figure(figsize=(_PANEL[0] * COLUMNS + 1.2, height), layout="constrained")
    if title:
        figure.suptitle(title, fontsize=9, parse_math=False)
    panels = [figure.add_subplot(rows, COLUMNS, k + 1) for k in range(len(shown))]
    for k, (panel, metric) in enumerate(zip(panels, shown, strict=True)):
        _draw(panel, evaluations, metric, labelled=k % COLUMNS == 0)
    # files without time stamps and, for SVG, without random ids: the same numbers give the same bytes
    metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
    try:
        with rc_context({"svg.hashsalt": "sonata2d"}), whole_file(path) as temporary:
            figure.savefig(temporary, dpi=200, metadata=metadata)
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def _draw(panel: Axes, evaluations: Sequence[Evaluation], metric: Metric, *, labelled: bool) -> None:
    """Draw one metric: a row for each evaluation, the first on top."""
    for row, one in enumerate(evaluations):
        colour, summary = COLOURS[row % len(COLOURS)], one.summary(metric.name)
        if metric.unit in EVENTS:
            _draw_share(panel, row, share_of(one, metric), colour)
            continue
        values = np.array(one.values(metric.name), dtype=float)
        panel.plot(values, row + _jitter(values), ".", color=colour, alpha=0.4, markersize=3.5, markeredgewidth=0)
        if summary.mean is None:
            continue
        if summary.interval is not None:
            panel.plot(summary.interval, (row, row), "-", color=colour, linewidth=2, solid_capstyle="butt")
        panel.plot([summary.mean], [row], "o", color=colour, markersize=4.5)
    unit = {"0/1": "", "share": "", "count": ", at least one"}.get(metric.unit, f" ({metric.unit})")
    panel.set_title(f"{metric.name.replace('_', ' ')}{unit} {ARROWS[metric.better]}".rstrip(), fontsize=7.5, loc="left")
    names = short_names([one.label for one in evaluations]) if labelled else [""] * len(evaluations)
    panel.set_yticks(range(len(evaluations)), names, parse_math=False)  # labels are paths, and may hold dollar signs
    panel.set_ylim(len(evaluations) - 0.5, -0.5)
    panel.tick_params(labelsize=7, length=2)
    panel.grid(axis="x", linewidth=0.4, color="#dddddd")
    panel.spines[["top", "right", "left"]].set_visible(False)
    if metric.unit in EVENTS:
        panel.set_xlim(0.0, 100.0)
        panel.set_xticks((0.0, 50.0, 100.0), ("0 %", "50 %", "100 %"))


def _draw_share(panel: Axes, row: int, share: Share | None, colour: str) -> None:
    """Draw a share of episodes as a bar with its confidence interval and the numbers, per cent."""
    if share is None:
        return
    panel.barh(row, 100.0 * share.fraction, height=0.62, color=colour, alpha=0.75, linewidth=0)
    low, high = (100.0 * end for end in share.interval)
    panel.plot((low, high), (row, row), "-", color="#222222", linewidth=1)
    right = max(high, 100.0 * share.fraction)
    text = f"{share.count} of {share.total}"
    x = right + 2.0 if right < 72.0 else 2.0  # beside the interval, or on the bar if there is no space
    panel.text(x, row, text, fontsize=6, va="center", color="#111111")


def _jitter(values: Array) -> Array:
    """(n,), vertical offsets that separate equal values; fixed, so that an episode has the same offset everywhere."""
    steps = np.arange(len(values), dtype=np.float64) * 0.6180339887498949
    offsets: Array = (steps % 1.0 - 0.5) * 0.5
    return offsets
