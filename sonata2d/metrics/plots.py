"""The picture of an evaluation for print: one panel per metric with means, intervals and shares, as on the page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.files.locations import location
from ..core.files.whole_file import whole_file
from ..errors import RenderError
from .definition import ARROWS, Metric
from .evaluation import EVENTS, Evaluation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".pdf", ".svg")
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # Okabe & Ito
_COLUMNS = 3  # number of panels side by side
_MAX_NAME = 26  # characters of a name in pictures and pages
_PANEL_INCHES = (2.4, 0.55)  # width of a panel, height without its rows
_ROW_INCHES = 0.24  # height of one evaluation


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
        evaluations, metrics, title: as for `figure_of`.

    Raises:
        RenderError: the picture cannot be drawn or written, or no metric is defined in any episode.
    """
    path = location(path)
    check_picture_path(path)
    from matplotlib import rc_context

    figure = figure_of(evaluations, metrics, title=title)
    # files without time stamps and, for SVG, without random ids: the same numbers give the same bytes
    metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
    try:
        with rc_context({"svg.hashsalt": "sonata2d"}), whole_file(path) as temporary:
            figure.savefig(temporary, dpi=200, metadata=metadata)
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def figure_of(evaluations: Sequence[Evaluation], metrics: Sequence[Metric], *, title: str = "") -> Figure:
    """A figure with one panel for each metric.

    Args:
        evaluations: one or more; each has the same colour in all panels.
        metrics: metrics that are not defined in any episode are left out. Metrics that are 0 or 1, or count events,
            are shown as shares of episodes with Wilson intervals; of others a dot is the mean, a thick line its
            interval and a thin line the middle half of the episodes.
        title: above all panels.

    Raises:
        RenderError: no metric is defined in any episode.
    """
    shown = [metric for metric in metrics if any(evaluation.values(metric.name) for evaluation in evaluations)]
    if not shown:
        raise RenderError("nothing to draw: none of the metrics is defined in any episode; choose others")
    from matplotlib.figure import Figure

    rows = -(-len(shown) // _COLUMNS)
    height = rows * (_PANEL_INCHES[1] + len(evaluations) * _ROW_INCHES) + (0.4 if title else 0.1)
    figure = Figure(figsize=(_PANEL_INCHES[0] * _COLUMNS + 1.2, height), layout="constrained")
    if title:
        figure.suptitle(title, fontsize=9, parse_math=False)
    names = short_names([evaluation.label for evaluation in evaluations])
    for k, metric in enumerate(shown):
        panel = figure.add_subplot(rows, _COLUMNS, k + 1)
        for row, evaluation in enumerate(evaluations):
            _draw(panel, row, evaluation, metric)
        unit = {"0/1": "", "share": "", "count": ", at least one"}.get(metric.unit, f" ({metric.unit})")
        heading = f"{metric.name.replace('_', ' ')}{unit} {ARROWS[metric.better]}".rstrip()
        panel.set_title(heading, fontsize=7.5, loc="left")
        # labels are paths, and may hold dollar signs
        panel.set_yticks(range(len(names)), names if k % _COLUMNS == 0 else [""] * len(names), parse_math=False)
        panel.set_ylim(len(names) - 0.5, -0.5)
        panel.tick_params(labelsize=7, length=2)
        panel.grid(axis="x", linewidth=0.4, color="#dddddd")
        panel.spines[["top", "right", "left"]].set_visible(False)
    return figure


def _draw(panel: Axes, row: int, evaluation: Evaluation, metric: Metric) -> None:
    """Draw one metric of one evaluation: a bar for a share of episodes, else mean, interval and quartiles."""
    colour, level = COLOURS[row % len(COLOURS)], (row, row)
    if metric.unit in EVENTS:
        panel.set_xticks((0.0, 0.5, 1.0), ("0 %", "50 %", "100 %"))
        panel.set_xlim(0.0, 1.0)
        if share := evaluation.share(metric.name):
            panel.barh(row, share.fraction, height=0.62, color=colour, alpha=0.75, linewidth=0)
            panel.plot(share.interval, level, "-", color="#222222", linewidth=1)
        return
    summary, quartiles = evaluation.summary(metric.name), evaluation.quartiles(metric.name)
    for ends, width in ((quartiles, 1), (summary.interval, 3)):
        if ends is not None:
            panel.plot(ends, level, "-", color=colour, linewidth=width, solid_capstyle="butt")
    if summary.mean is not None:
        panel.plot([summary.mean], [row], "o", color=colour, markersize=4.5)
