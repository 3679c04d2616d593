"""Evaluations as one page for a paper: a panel for each metric, in it every run, and the mean with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.portable_math import Array
from ..errors import RenderError
from .definition import Metric
from .measurement import Evaluation
from .table import ARROWS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES = (".png", ".pdf", ".svg")
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # Okabe & Ito: for all eyes
COLUMNS = 3
_PANEL = (2.4, 0.55)  # inches: width of a panel, height without its rows
_ROW = 0.24  # inches for each evaluation


def refuse_picture(path: Path) -> None:
    """Say early if a picture cannot be drawn.

    Raises:
        RenderError: its suffix is unknown, or matplotlib is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise RenderError(f"{path}: a picture of metrics ends in {', '.join(SUFFIXES)}")
    if find_spec("matplotlib") is None:
        raise RenderError("pictures of metrics need matplotlib; pip install 'sonata2d[plots]'")


def chart(path: str | Path, evaluations: Sequence[Evaluation], metrics: Sequence[Metric], *, title: str = "") -> None:
    """Draw evaluations side by side.

    Args:
        path: `.png`, `.pdf` or `.svg`.
        evaluations: one or more; each keeps its colour through all panels.
        metrics: one panel each; those that are defined in no run are left out.
        title: above all panels.

    Raises:
        RenderError: the picture cannot be drawn or written, or none of the metrics is defined in any run.
    """
    path = Path(path)
    refuse_picture(path)
    shown = [metric for metric in metrics if any(one.summary(metric.name).n for one in evaluations)]
    if not shown:
        raise RenderError("there is nothing to draw: none of these metrics is defined in any run")
    figure, panels = _page(len(shown), len(evaluations), title)
    for place, (panel, metric) in enumerate(zip(panels, shown, strict=True)):
        _draw(panel, evaluations, metric, labelled=place % COLUMNS == 0)
    from matplotlib import rc_context

    try:
        with rc_context({"svg.hashsalt": "sonata2d"}):  # else an SVG has random ids
            figure.savefig(path, dpi=200, metadata=_undated(path))
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def _page(panels: int, rows: int, title: str) -> tuple[Any, list[Axes]]:
    """A figure with as many panels, left to right and down."""
    from matplotlib.figure import Figure

    down = -(-panels // COLUMNS)
    height = down * (_PANEL[1] + rows * _ROW) + (0.4 if title else 0.1)
    figure = Figure(figsize=(_PANEL[0] * COLUMNS + 1.2, height), layout="constrained")
    if title:
        figure.suptitle(title, fontsize=9)
    return figure, [figure.add_subplot(down, COLUMNS, place + 1) for place in range(panels)]


def _draw(panel: Axes, evaluations: Sequence[Evaluation], metric: Metric, *, labelled: bool) -> None:
    """One metric: a row for each evaluation, the first on top."""
    for row, one in enumerate(evaluations):
        colour, summary = COLOURS[row % len(COLOURS)], one.summary(metric.name)
        values = np.array([v for run in one.runs if (v := run.values.get(metric.name)) is not None], dtype=float)
        panel.plot(values, row + _spread(values), ".", color=colour, alpha=0.4, markersize=3.5, markeredgewidth=0)
        if summary.mean is None:
            continue
        if summary.interval is not None:
            panel.plot(summary.interval, (row, row), "-", color=colour, linewidth=2, solid_capstyle="butt")
        panel.plot([summary.mean], [row], "o", color=colour, markersize=4.5)
    unit = "" if metric.unit in ("0/1", "share", "count") else f" ({metric.unit})"
    panel.set_title(f"{metric.name.replace('_', ' ')}{unit} {ARROWS[metric.better]}".rstrip(), fontsize=7.5, loc="left")
    panel.set_yticks(
        range(len(evaluations)), [one.label for one in evaluations] if labelled else [""] * len(evaluations)
    )
    panel.set_ylim(len(evaluations) - 0.5, -0.5)
    panel.tick_params(labelsize=7, length=2)
    panel.grid(axis="x", linewidth=0.4, color="#dddddd")
    panel.spines[["top", "right", "left"]].set_visible(False)
    if metric.unit == "0/1":
        panel.set_xlim(-0.05, 1.05)


def _spread(values: Array) -> Array:
    """Offsets that keep equal values apart: the same run has the same offset in every picture."""
    steps = np.arange(len(values), dtype=np.float64) * 0.6180339887498949
    offsets: Array = (steps % 1.0 - 0.5) * 0.5
    return offsets


def _undated(path: Path) -> dict[str, None]:
    """What keeps the time out of a file, so that the same numbers give the same picture."""
    return {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
