"""Statistics over the episodes of a data set, and the figure of the data card that shows them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.portable_math import Array, IntArray
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.whole_file import whole_file
from ..errors import RenderError
from ..record.record import EpisodeRecord
from .motion import VX, VY, X, Y

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAP_EXTENT, CELL_SIZE = 12.0, 0.2  # m: maps cover -MAP_EXTENT to MAP_EXTENT in x and y
MAXIMUM_SPEED, MAXIMUM_CLEARANCE = 2.5, 5.0  # m/s and m: upper ends of the histograms
SPEED_EDGES, CLEARANCE_EDGES = np.linspace(0.0, MAXIMUM_SPEED, 51), np.linspace(0.0, MAXIMUM_CLEARANCE, 101)
_MAP_EDGES = np.linspace(-MAP_EXTENT, MAP_EXTENT, round(2 * MAP_EXTENT / CELL_SIZE) + 1)
BLUE, ORANGE = "#0072b2", "#d55e00"  # palette of Okabe & Ito, as in all figures of sonata2d


def _zeros(*edges: Array) -> IntArray:
    return np.zeros(tuple(len(each) - 1 for each in edges), dtype=np.int64)


@dataclass(slots=True)
class EpisodeStatistics:
    """Counts over all frames; the memory use does not depend on the number of episodes.

    Attributes:
        robot, pedestrians: (120, 120), number of frames per 0.2 m cell, world frame; the first axis is x.
        robot_speed, pedestrian_speed: (50,), number of frames per bin of `SPEED_EDGES`; the last bin includes all
            higher speeds.
        clearance: (100,), number of frames per bin of `CLEARANCE_EDGES` by the clearance, in m, between the robot and
            the nearest pedestrian; the last bin includes all larger clearances.
        outcomes: number of episodes by outcome.
        frames, empty_frames: number of frames, and of frames without a pedestrian.
        robot_speed_sum, pedestrian_speed_sum: sum of all speeds, m/s.
        intimate, personal: number of frames with a clearance below that distance.
    """

    robot: IntArray = field(default_factory=lambda: _zeros(_MAP_EDGES, _MAP_EDGES))
    pedestrians: IntArray = field(default_factory=lambda: _zeros(_MAP_EDGES, _MAP_EDGES))
    robot_speed: IntArray = field(default_factory=lambda: _zeros(SPEED_EDGES))
    pedestrian_speed: IntArray = field(default_factory=lambda: _zeros(SPEED_EDGES))
    clearance: IntArray = field(default_factory=lambda: _zeros(CLEARANCE_EDGES))
    outcomes: dict[str, int] = field(default_factory=dict)
    frames: int = 0
    empty_frames: int = 0
    robot_speed_sum: float = 0.0
    pedestrian_speed_sum: float = 0.0
    intimate: int = 0
    personal: int = 0

    def add(self, record: EpisodeRecord) -> None:
        """Add the frames of an episode."""
        robot, pedestrians = record.robot, record.humans[record.present]
        self.robot += _position_counts(robot)
        self.pedestrians += _position_counts(pedestrians)
        robot_speed, pedestrian_speed = (np.hypot(rows[:, VX], rows[:, VY]) for rows in (robot, pedestrians))
        self.robot_speed += _bin_counts(robot_speed, SPEED_EDGES)
        self.pedestrian_speed += _bin_counts(pedestrian_speed, SPEED_EDGES)
        self.robot_speed_sum += float(robot_speed.sum())
        self.pedestrian_speed_sum += float(pedestrian_speed.sum())
        nearest = clearances(record)
        self.intimate += int((nearest < INTIMATE_DISTANCE).sum())
        self.personal += int((nearest < PERSONAL_DISTANCE).sum())
        self.clearance += _bin_counts(nearest[np.isfinite(nearest)], CLEARANCE_EDGES)
        self.outcomes[record.outcome.status] = self.outcomes.get(record.outcome.status, 0) + 1
        self.frames += len(record)
        self.empty_frames += int(np.isinf(nearest).sum())


def collect_statistics(records: Iterable[EpisodeRecord]) -> EpisodeStatistics:
    """Statistics over episodes, which are read one at a time."""
    statistics = EpisodeStatistics()
    for record in records:
        statistics.add(record)
    return statistics


def clearances(record: EpisodeRecord) -> Array:
    """Clearance between the robot and the nearest pedestrian, (T,), m; infinite in frames without pedestrians."""
    scene = record.scene()
    if not scene.humans:
        return np.full(len(record), np.inf)
    radii = np.array([human.radius for human in scene.humans])
    offset = record.humans[..., X : Y + 1] - record.robot[:, None, X : Y + 1]
    gaps = np.hypot(offset[..., 0], offset[..., 1]) - radii - scene.robot.radius
    nearest: Array = np.maximum(np.where(record.present, gaps, np.inf).min(axis=1), 0.0)
    return nearest


def _position_counts(rows: Array) -> IntArray:
    counts, _, _ = np.histogram2d(rows[:, X], rows[:, Y], bins=(_MAP_EDGES, _MAP_EDGES))
    return counts.astype(np.int64)


def _bin_counts(values: Array, edges: Array) -> IntArray:
    """Histogram of values; the last bin includes all values beyond it."""
    counts: IntArray = np.histogram(np.minimum(values, np.nextafter(edges[-1], 0.0)), bins=edges)[0]
    return counts


def require_matplotlib() -> None:
    """Check that figures can be drawn.

    Raises:
        RenderError: matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise RenderError("the figures of the card need matplotlib; pip install 'sonata2d[plots]' or use --no-figures")


def draw_statistics(path: Path, statistics: EpisodeStatistics, title: str) -> None:
    """Write a figure: position maps, histograms of speed and clearance, and outcomes.

    Raises:
        RenderError: matplotlib is not installed, or the file cannot be written.
    """
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 6.0), dpi=150, layout="constrained")
    panels = figure.subplots(2, 3)
    figure.suptitle(title, fontsize=11, parse_math=False)
    extent = _visible_extent(statistics.robot + statistics.pedestrians)
    _draw_map(panels[0, 0], statistics.robot, extent, "Positions of the robot")
    _draw_map(panels[0, 1], statistics.pedestrians, extent, "Positions of the pedestrians")
    _draw_outcomes(panels[0, 2], statistics.outcomes)
    _draw_histogram(panels[1, 0], statistics.robot_speed, SPEED_EDGES, "Speed of the robot (m/s)", ORANGE)
    _draw_histogram(panels[1, 1], statistics.pedestrian_speed, SPEED_EDGES, "Speed of the pedestrians (m/s)", BLUE)
    _draw_histogram(panels[1, 2], statistics.clearance, CLEARANCE_EDGES, "Nearest pedestrian (m)", ORANGE)
    for distance, zone in ((INTIMATE_DISTANCE, "intimate"), (PERSONAL_DISTANCE, "personal")):
        panels[1, 2].axvline(distance, color="#444444", linewidth=0.8, linestyle="--")
        top = panels[1, 2].get_ylim()[1]
        panels[1, 2].text(distance + 0.06, 0.97 * top, zone, fontsize=7, rotation=90, va="top")
    FigureCanvasAgg(figure)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            figure.savefig(temporary, metadata={"Software": None})  # the same data give the same bytes
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def _visible_extent(counts: IntArray) -> float:
    """Largest distance of an occupied cell from the centre along x or y, in m, plus a margin."""
    occupied = np.argwhere(counts)
    if not len(occupied):
        return 2.0
    centre = counts.shape[0] / 2
    return float(min(np.abs(occupied + 0.5 - centre).max() * (MAP_EXTENT / centre) + 0.4, MAP_EXTENT))


def _draw_map(panel: Axes, counts: IntArray, extent: float, title: str) -> None:
    """A heat map; white for empty cells, square root of the counts so that rarely used cells are visible."""
    intensity = np.sqrt(np.ma.masked_equal(counts.T, 0) / max(counts.max(), 1))
    bounds = (-MAP_EXTENT, MAP_EXTENT, -MAP_EXTENT, MAP_EXTENT)
    panel.imshow(intensity, origin="lower", extent=bounds, cmap="viridis_r", vmin=0.0, vmax=1.0)
    panel.set(xlim=(-extent, extent), ylim=(-extent, extent), xlabel="x (m)", ylabel="y (m)")
    panel.set_title(title, fontsize=9)


def _draw_histogram(panel: Axes, counts: IntArray, edges: Array, label: str, colour: str) -> None:
    percentages = 100.0 * counts / max(counts.sum(), 1)
    panel.bar(edges[:-1], percentages, width=np.diff(edges), align="edge", color=colour)
    panel.set(xlabel=label, ylabel="% of frames", xlim=(edges[0], edges[-1]))


def _draw_outcomes(panel: Axes, outcomes: dict[str, int]) -> None:
    names = sorted(outcomes, key=lambda name: (outcomes[name], name))
    bars = panel.barh(names, [outcomes[name] for name in names], height=0.6, color=BLUE)
    panel.set_ylim(-0.7, max(len(names), 3) - 0.3)
    panel.bar_label(bars, padding=3, fontsize=8)
    panel.set_title("Outcomes (episodes)", fontsize=9)
    panel.margins(x=0.18)
