"""Statistics of a data set's episodes, and the figure of the data card that shows them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.portable_math import Array
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..errors import RenderError
from ..record.record import EpisodeRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH, CELL = 12.0, 0.2  # m: the maps go from -REACH to REACH
FASTEST, FARTHEST = 2.5, 5.0  # m/s and m: the ends of the distributions
_EDGES = np.linspace(-REACH, REACH, round(2 * REACH / CELL) + 1)
SPEEDS, CLEARANCES = np.linspace(0.0, FASTEST, 51), np.linspace(0.0, FARTHEST, 101)


@dataclass(slots=True)
class Survey:
    """Counts over all frames; memory does not grow with the number of episodes.

    Attributes:
        robot, people: (120, 120), frames in each cell of 0.2 m, world frame; the first axis is x.
        robot_speed, people_speed: (50,), frames in each class of `SPEEDS`; the last one holds all that is faster.
        clearance: (100,), frames in each class of `CLEARANCES` by the gap from robot to nearest person, m; the last one
            holds all that is farther.
        outcomes: episodes by outcome.
        frames, alone: how many; those without a person.
        robot_sum, people_sum: m/s, of all speeds.
        intimate, personal: frames in which the robot was within that distance of a person.
    """

    robot: Any = field(default_factory=lambda: np.zeros((len(_EDGES) - 1,) * 2, dtype=np.int64))
    people: Any = field(default_factory=lambda: np.zeros((len(_EDGES) - 1,) * 2, dtype=np.int64))
    robot_speed: Any = field(default_factory=lambda: np.zeros(len(SPEEDS) - 1, dtype=np.int64))
    people_speed: Any = field(default_factory=lambda: np.zeros(len(SPEEDS) - 1, dtype=np.int64))
    clearance: Any = field(default_factory=lambda: np.zeros(len(CLEARANCES) - 1, dtype=np.int64))
    outcomes: dict[str, int] = field(default_factory=dict)
    frames: int = 0
    alone: int = 0
    robot_sum: float = 0.0
    people_sum: float = 0.0
    intimate: int = 0
    personal: int = 0

    def add(self, record: EpisodeRecord) -> None:
        """Count an episode in."""
        there = record.present
        self.robot += _map(record.robot[:, :2])
        self.people += _map(record.humans[there][:, :2])
        robot, people = (np.hypot(rows[:, 3], rows[:, 4]) for rows in (record.robot, record.humans[there]))
        self.robot_speed += _classes(robot, SPEEDS)
        self.people_speed += _classes(people, SPEEDS)
        self.robot_sum, self.people_sum = self.robot_sum + float(robot.sum()), self.people_sum + float(people.sum())
        gaps = clearances(record)
        self.intimate += int((gaps < INTIMATE_DISTANCE).sum())
        self.personal += int((gaps < PERSONAL_DISTANCE).sum())
        self.clearance += _classes(gaps[np.isfinite(gaps)], CLEARANCES)
        self.outcomes[record.outcome.status] = self.outcomes.get(record.outcome.status, 0) + 1
        self.frames += len(record)
        self.alone += int(np.isinf(gaps).sum())


def surveyed(records: Iterable[EpisodeRecord]) -> Survey:
    """The survey of some episodes, read one at a time."""
    survey = Survey()
    for record in records:
        survey.add(record)
    return survey


def clearances(record: EpisodeRecord) -> Array:
    """(T,), m, from the robot's outline to the nearest person's; infinite where nobody is."""
    scene = record.scene()
    if not scene.humans:
        return np.full(len(record), np.inf)
    radii = np.array([human.radius for human in scene.humans])
    apart = record.humans[..., :2] - record.robot[:, None, :2]
    gaps = np.hypot(apart[..., 0], apart[..., 1]) - radii - scene.robot.radius
    nearest: Array = np.maximum(np.where(record.present, gaps, np.inf).min(axis=1), 0.0)
    return nearest


def _map(places: Array) -> Any:
    counts, _, _ = np.histogram2d(places[:, 0], places[:, 1], bins=(_EDGES, _EDGES))
    return counts.astype(np.int64)


def _classes(values: Array, edges: Array) -> Any:
    """How many values are in each class; what lies beyond the last one is counted in it."""
    return np.histogram(np.minimum(values, np.nextafter(edges[-1], 0.0)), bins=edges)[0]


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
