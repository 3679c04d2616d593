"""The picture of an evaluation for print: one panel per metric with every episode, means and confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.portable_math import Array
from ..core.whole_file import whole_file
from ..errors import RenderError
from .definition import ARROWS, Metric
from .measurement import Evaluation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES = (".png", ".pdf", ".svg")
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")  # Okabe & Ito
COLUMNS = 3
_PANEL = (2.4, 0.55)  # inches: width of a panel, height without its rows
_ROW = 0.24  # inches, height of one evaluation


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
        metrics: one panel each; metrics that are not defined in any episode are left out.
        title: above all panels.

    Raises:
        RenderError: the picture cannot be drawn or written, or no metric is defined in any episode.
    """
    path = Path(path)
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
        values = np.array(one.values(metric.name), dtype=float)
        panel.plot(values, row + _jitter(values), ".", color=colour, alpha=0.4, markersize=3.5, markeredgewidth=0)
        if summary.mean is None:
            continue
        if summary.interval is not None:
            panel.plot(summary.interval, (row, row), "-", color=colour, linewidth=2, solid_capstyle="butt")
        panel.plot([summary.mean], [row], "o", color=colour, markersize=4.5)
    unit = "" if metric.unit in ("0/1", "share", "count") else f" ({metric.unit})"
    panel.set_title(f"{metric.name.replace('_', ' ')}{unit} {ARROWS[metric.better]}".rstrip(), fontsize=7.5, loc="left")
    labels = [one.label for one in evaluations] if labelled else [""] * len(evaluations)
    panel.set_yticks(range(len(evaluations)), labels, parse_math=False)  # labels are paths, and may hold dollar signs
    panel.set_ylim(len(evaluations) - 0.5, -0.5)
    panel.tick_params(labelsize=7, length=2)
    panel.grid(axis="x", linewidth=0.4, color="#dddddd")
    panel.spines[["top", "right", "left"]].set_visible(False)
    if metric.unit == "0/1":
        panel.set_xlim(-0.05, 1.05)


def _jitter(values: Array) -> Array:
    """(n,), vertical offsets that separate equal values; fixed, so that an episode has the same offset everywhere."""
    steps = np.arange(len(values), dtype=np.float64) * 0.6180339887498949
    offsets: Array = (steps % 1.0 - 0.5) * 0.5
    return offsets
