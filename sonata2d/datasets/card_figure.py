"""Statistics over the episodes of a data set, and the figure of the data card that shows them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.files.locations import make_folder
from ..core.files.whole_file import whole_file
from ..core.geometry import to_shoulder_line
from ..core.portable_math import Array, IntArray, unit_vectors
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.vectors import lengths
from ..errors import RenderError
from ..record.record import EpisodeRecord
from .motion import THETA, VX, VY, X, Y

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELL_SIZE, MAP_MARGIN = 0.2, 0.3  # m: side of the cells of maps, free space around the rooms
MAXIMUM_SPEED, MAXIMUM_CLEARANCE = 2.5, 5.0  # m/s and m: upper ends of the histograms
SPEED_EDGES, CLEARANCE_EDGES = np.linspace(0.0, MAXIMUM_SPEED, 51), np.linspace(0.0, MAXIMUM_CLEARANCE, 101)
BLUE, ORANGE = "#0072b2", "#d55e00"  # palette of Okabe & Ito, as in all figures of sonata2d
_BLUES, _ORANGES = ("#8cc4e8", BLUE, "#062b4d"), ("#f4b183", ORANGE, "#4a1505")  # few to many; all visible on white

Cells = Counter[tuple[int, int]]  # number of frames by cell; cell (i, j) begins at (i, j) * CELL_SIZE, m


_MINIMUM_AXIS = 0.3  # of the range of a histogram that is always shown


def _zeros(*edges: Array) -> IntArray:
    return np.zeros(tuple(len(each) - 1 for each in edges), dtype=np.int64)


@dataclass(slots=True)
class EpisodeStatistics:
    """Counts over all frames; the memory use depends on the area of the rooms, not on the number of episodes.

    Attributes:
        robot, pedestrians: number of frames per 0.2 m cell, world frame.
        rooms: smallest and largest x, smallest and largest y of all rooms, m; None before a room was added.
        robot_speed, pedestrian_speed: (50,), number of frames per bin of `SPEED_EDGES`; the last bin includes all
            higher speeds.
        clearance: (100,), number of frames per bin of `CLEARANCE_EDGES` by the clearance, in m, between the robot and
            the nearest pedestrian; the last bin includes all larger clearances.
        outcomes: number of episodes by outcome.
        frames, empty_frames: number of frames, and of frames without a pedestrian.
        robot_speed_sum, pedestrian_speed_sum: sum of all speeds, m/s.
        intimate, personal: number of frames with a clearance below that distance.
    """

    robot: Cells = field(default_factory=Counter)
    pedestrians: Cells = field(default_factory=Counter)
    rooms: tuple[float, float, float, float] | None = None
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
        self.robot.update(_position_counts(robot))
        self.pedestrians.update(_position_counts(pedestrians))
        self._add_room(record)
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

    def _add_room(self, record: EpisodeRecord) -> None:
        outline = record.scene().outline
        if not len(outline):
            return
        (x0, y0), (x1, y1) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
        a0, a1, b0, b1 = self.rooms or (x0, x1, y0, y1)
        self.rooms = min(a0, x0), max(a1, x1), min(b0, y0), max(b1, y1)


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
    radii, shoulder = scene.human_table.radius, scene.human_table.shoulder
    offset = record.humans[..., X : Y + 1] - record.robot[:, None, X : Y + 1]
    gaps = lengths(to_shoulder_line(offset, unit_vectors(record.humans[..., THETA]), shoulder))
    gaps = gaps - radii - scene.robot.radius
    nearest: Array = np.maximum(np.where(record.present, gaps, np.inf).min(axis=1), 0.0)
    return nearest


def _position_counts(rows: Array) -> dict[tuple[int, int], int]:
    places = np.floor(rows[:, X : Y + 1] / CELL_SIZE).astype(np.int64)
    cells, counts = np.unique(places, axis=0, return_counts=True)
    return {(i, j): count for (i, j), count in zip(cells.tolist(), counts.tolist(), strict=True)}


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
    bounds = map_bounds(statistics)
    _draw_map(panels[0, 0], statistics.robot, bounds, "Positions of the robot (frames)", _ORANGES)
    _draw_map(panels[0, 1], statistics.pedestrians, bounds, "Positions of the pedestrians (frames)", _BLUES)
    _draw_outcomes(panels[0, 2], statistics.outcomes)
    _draw_histogram(panels[1, 0], statistics.robot_speed, SPEED_EDGES, "Speed of the robot (m/s)", ORANGE)
    _draw_histogram(panels[1, 1], statistics.pedestrian_speed, SPEED_EDGES, "Speed of the pedestrians (m/s)", BLUE)
    _draw_histogram(panels[1, 2], statistics.clearance, CLEARANCE_EDGES, "Nearest pedestrian (m)", ORANGE)
    for distance, zone in ((INTIMATE_DISTANCE, "intimate"), (PERSONAL_DISTANCE, "personal")):
        panels[1, 2].axvline(distance, color="#444444", linewidth=0.8, linestyle="--")
        place = {"rotation": 90, "va": "top", "ha": "left", "transform": panels[1, 2].get_xaxis_transform()}
        plate = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6}
        panels[1, 2].text(distance + 0.05, 0.97, zone, fontsize=7, bbox=plate, **place)
    FigureCanvasAgg(figure)
    try:
        make_folder(path.parent)
        with whole_file(path) as temporary:
            figure.savefig(temporary, metadata={"Software": None})  # the same data give the same bytes
    except OSError as error:
        raise RenderError(f"{path} cannot be written: {error.strerror or error}") from error


def map_bounds(statistics: EpisodeStatistics) -> tuple[float, float, float, float]:
    """Smallest and largest x, smallest and largest y of a map that holds all rooms and positions, m."""
    cells = np.array([*statistics.robot, *statistics.pedestrians], dtype=float).reshape(-1, 2)
    corners = [cells * CELL_SIZE, (cells + 1.0) * CELL_SIZE]
    if statistics.rooms is not None:
        corners.append(np.array(statistics.rooms).reshape(2, 2).T)
    points = np.concatenate(corners)
    if not len(points):
        return -2.0, 2.0, -2.0, 2.0
    (x0, y0), (x1, y1) = (points.min(axis=0) - MAP_MARGIN).tolist(), (points.max(axis=0) + MAP_MARGIN).tolist()
    return x0, x1, y0, y1


def _draw_map(
    panel: Axes, cells: Cells, bounds: tuple[float, float, float, float], title: str, ramp: tuple[str, ...]
) -> None:
    """A heat map; white for empty cells. Its colours follow the square root of the counts, which shows rare cells."""
    from matplotlib.colors import LinearSegmentedColormap, PowerNorm

    (low, bottom), (right, top) = ([math.floor(bounds[k + n] / CELL_SIZE) for k in (0, 2)] for n in (0, 1))
    counts = np.zeros((top - bottom + 1, right - low + 1))
    for (i, j), count in cells.items():
        counts[j - bottom, i - low] = count
    image = panel.imshow(
        np.ma.masked_equal(counts, 0),
        origin="lower",
        extent=(CELL_SIZE * low, CELL_SIZE * (right + 1), CELL_SIZE * bottom, CELL_SIZE * (top + 1)),
        cmap=LinearSegmentedColormap.from_list("counts", ramp),
        norm=PowerNorm(0.5, vmin=0.0, vmax=max(counts.max(), 1.0)),
        interpolation="nearest",
    )
    panel.set(xlim=bounds[:2], ylim=bounds[2:], xlabel="x (m)", ylabel="y (m)")
    panel.set_title(title, fontsize=9)
    panel.figure.colorbar(image, ax=panel, fraction=0.05, pad=0.02).ax.tick_params(labelsize=7)


def _draw_histogram(panel: Axes, counts: IntArray, edges: Array, label: str, colour: str) -> None:
    percentages = 100.0 * counts / max(counts.sum(), 1)
    panel.bar(edges[:-1], percentages, width=np.diff(edges), align="edge", color=colour)
    occupied = np.flatnonzero(counts)
    right = edges[min(occupied[-1] + 2, len(edges) - 1)] if len(occupied) else edges[-1]
    panel.set(xlabel=label, ylabel="% of frames", xlim=(edges[0], max(right, _MINIMUM_AXIS * edges[-1])))


def _draw_outcomes(panel: Axes, outcomes: dict[str, int]) -> None:
    from matplotlib.ticker import MaxNLocator

    names = sorted(outcomes, key=lambda name: (outcomes[name], name))
    bars = panel.barh(names, [outcomes[name] for name in names], height=0.6, color=BLUE)
    panel.set_ylim(-0.7, max(len(names), 3) - 0.3)
    panel.bar_label(bars, padding=3, fontsize=8)
    panel.set_title("Outcomes (episodes)", fontsize=9)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.margins(x=0.18)
