"""The figures of a data card, on one page."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RenderError
from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from .survey import CLEARANCES, REACH, SPEEDS, Survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE = "#0072b2", "#d55e00"  # of Okabe & Ito's palette, as in all pictures here


def refuse_without_plots() -> None:
    """Say early if figures cannot be drawn.

    Raises:
        RenderError: matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise RenderError("the card's figures need matplotlib; pip install 'sonata2d[plots]', or ask for none")


def draw_survey(path: Path, survey: Survey, title: str) -> None:
    """Draw maps of robot and people, distributions of speed and clearance, and outcomes.

    Raises:
        RenderError: the picture cannot be written.
    """
    refuse_without_plots()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 6.0), dpi=150, layout="constrained")
    panels = figure.subplots(2, 3)
    figure.suptitle(title, fontsize=11)
    shown = _reach(survey.robot + survey.people)
    for panel, counts, name in ((panels[0, 0], survey.robot, "robot"), (panels[0, 1], survey.people, "people")):
        _draw_map(panel, counts, shown, f"Where the {name} {'was' if name == 'robot' else 'were'}")
    _draw_outcomes(panels[0, 2], survey.outcomes)
    _draw_classes(panels[1, 0], survey.robot_speed, SPEEDS, "Robot's speed (m/s)", ORANGE)
    _draw_classes(panels[1, 1], survey.people_speed, SPEEDS, "People's speed (m/s)", BLUE)
    _draw_classes(panels[1, 2], survey.clearance, CLEARANCES, "Gap to the nearest person (m)", ORANGE)
    for distance, word in ((INTIMATE_DISTANCE, "intimate"), (PERSONAL_DISTANCE, "personal")):
        panels[1, 2].axvline(distance, color="#444444", linewidth=0.8, linestyle="--")
        top = panels[1, 2].get_ylim()[1]
        panels[1, 2].text(distance + 0.06, 0.97 * top, word, fontsize=7, rotation=90, va="top")
    FigureCanvasAgg(figure)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata={"Software": None})  # the same data give the same bytes
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def _reach(counts: Any) -> float:
    """How far from the middle anything was, m, and a little more."""
    place = np.argwhere(counts)
    if not len(place):
        return 2.0
    middle = counts.shape[0] / 2
    return float(min(np.abs(place + 0.5 - middle).max() * (REACH / middle) + 0.4, REACH))


def _draw_map(panel: Axes, counts: Any, shown: float, title: str) -> None:
    """A heat map; white where nobody ever was, by the root so that rare places are seen."""
    share = np.sqrt(np.ma.masked_equal(counts.T, 0) / max(counts.max(), 1))
    panel.imshow(share, origin="lower", extent=(-REACH, REACH, -REACH, REACH), cmap="viridis_r", vmin=0.0, vmax=1.0)
    panel.set(xlim=(-shown, shown), ylim=(-shown, shown), xlabel="x (m)", ylabel="y (m)")
    panel.set_title(title, fontsize=9)


def _draw_classes(panel: Axes, counts: Any, edges: Any, label: str, colour: str) -> None:
    """A distribution; the last class holds all beyond it."""
    share = 100.0 * counts / max(counts.sum(), 1)
    panel.bar(edges[:-1], share, width=np.diff(edges), align="edge", color=colour)
    panel.set(xlabel=label, ylabel="% of frames", xlim=(edges[0], edges[-1]))


def _draw_outcomes(panel: Axes, outcomes: dict[str, int]) -> None:
    names = sorted(outcomes, key=lambda name: (outcomes[name], name))
    bars = panel.barh(names, [outcomes[name] for name in names], height=0.6, color=BLUE)
    panel.set_ylim(-0.7, max(len(names), 3) - 0.3)
    panel.bar_label(bars, padding=3, fontsize=8)
    panel.set_title("Outcomes (episodes)", fontsize=9)
    panel.margins(x=0.18)
