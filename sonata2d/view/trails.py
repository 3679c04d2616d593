"""Past paths: the robot's coloured by time, the pedestrians' in a colour each that fades into the past."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..core.geometry import Point
from ..core.portable_math import Array, BoolArray
from ..core.snapshot import Snapshot
from .brush import Brush
from .palette import FLOOR, OTHER_ROBOT, PAPER, PATHS, Colour, mixed, shaded, time_colour

_HUMAN_WIDTH, _OTHER_WIDTH, _ROBOT_WIDTH = 0.035, 0.05, 0.07  # m
MARK_INTERVAL = 5.0  # s, between the marks on the robot's trail
_TONES = 12  # of a pedestrian's path; the robot's has a tone a step
_MAX_STEP = 1.0  # m per tick; an agent that moves farther has re-entered the scene elsewhere


@dataclass(frozen=True)
class Trails:
    """Past positions of all agents.

    Attributes:
        time: (T,), s.
        robot: (T, 2), m.
        humans: (T, N, 2), m; not finite where a pedestrian is absent.
        robots: (T, M, 2), m, of the other robots; may be empty.
        is_tail: whether these are only the last seconds; then pictures show no time marks.
    """

    time: Array
    robot: Array
    humans: Array
    is_tail: bool = False
    robots: Array = field(default_factory=lambda: np.zeros((0, 0, 2)))

    @classmethod
    def of(cls, snapshots: Iterable[Snapshot], *, is_tail: bool = False) -> Trails:
        """Collect the positions from the snapshots of one episode."""
        snapshots = [*snapshots]
        count = len(snapshots[0].scene.humans) if snapshots else 0
        humans = [s.humans.expand(s.humans.position, count, np.nan) for s in snapshots]
        return cls(
            np.array([s.time for s in snapshots], dtype=float),
            np.array([s.robot.position for s in snapshots], dtype=float).reshape(len(snapshots), 2),
            np.array(humans, dtype=float).reshape(len(snapshots), count, 2),
            is_tail,
            _positions_of_others(snapshots),
        )

    @property
    def has_marks(self) -> bool:
        """Whether the robot's path is drawn with time marks."""
        return not self.is_tail and len(_marks(self.time)) > 0

    @property
    def fraction(self) -> Array:
        """(T,): each time as a fraction of the span, 0 to 1."""
        if len(self.time) < 2 or self.time[0] == self.time[-1]:
            return np.zeros(len(self.time))
        return np.asarray((self.time - self.time[0]) / (self.time[-1] - self.time[0]), dtype=float)


def _positions_of_others(snapshots: Sequence[Snapshot]) -> Array:
    """(T, M, 2), m, of the other robots."""
    count = len(snapshots[0].robots) if snapshots else 0
    return np.array([[robot.position for robot in s.robots] for s in snapshots]).reshape(len(snapshots), count, 2)


def draw_trails(brush: Brush, trails: Trails | None, *, robot: bool = True) -> None:
    """Draw the paths of pedestrians and robots, the first robot's on top, with time marks unless it is a tail.

    Nothing is drawn for None.

    Args:
        robot: whether to draw the robot's path.
    """
    if trails is None:
        return
    fraction = trails.fraction
    tone = np.round(fraction * (_TONES - 1)).astype(int).tolist()
    who, step = np.nonzero(_walked(trails.humans).T)  # the steps of the first pedestrian, then of the next one
    colours = [human_tones(n)[tone[t + 1]] for n, t in zip(who.tolist(), step.tolist(), strict=True)]
    brush.steps(colours, trails.humans[step, who], trails.humans[step + 1, who], _HUMAN_WIDTH)
    if not robot:
        return
    who, step = np.nonzero(_walked(trails.robots).T)
    brush.steps([OTHER_ROBOT] * len(who), trails.robots[step, who], trails.robots[step + 1, who], _OTHER_WIDTH)
    colours = [time_colour(part) for part in fraction.tolist()]
    (step,) = np.nonzero(_walked(trails.robot))
    brush.steps([colours[t + 1] for t in step.tolist()], trails.robot[step], trails.robot[step + 1], _ROBOT_WIDTH)
    for t in [] if trails.is_tail else _marks(trails.time):
        _draw_mark(brush, colours[t], (float(trails.robot[t, 0]), float(trails.robot[t, 1])))


def _draw_mark(brush: Brush, colour: Colour, place: Point) -> None:
    """Draw a time mark on the robot's path: a white disc with a rim that is darker than the path."""
    brush.disc(shaded(colour, 0.3), place, 0.065)
    brush.disc(PAPER, place, 0.038)


def draw_mark_sample(brush: Brush) -> None:
    """Draw a piece of the robot's path, 0.4 m long, with a time mark, around the brush."""
    _draw_sample(brush, _ROBOT_TONES, 0.0, 0.07)
    _draw_mark(brush, _ROBOT_TONES[_TONES // 2], (0.0, 0.0))


def draw_path_samples(brush: Brush, *, robot: bool) -> None:
    """Draw pieces of paths, 0.4 m long, around the brush: the robot's, if it is to be drawn, above two others.

    The widths equal the widths of paths at a common scale, so that they can be recognised.
    """
    across = (0.12, 0.0, -0.12) if robot else (0.08, -0.08)
    samples = [*([(_ROBOT_TONES, 0.07)] if robot else []), *((human_tones(n), 0.035) for n in (0, 1))]
    for left, (tones, width) in zip(across, samples, strict=True):
        _draw_sample(brush, tones, left, width)


def _draw_sample(brush: Brush, tones: Sequence[Colour], left: float, width: float) -> None:
    """Draw a straight path of 0.4 m at a distance to the left of the brush, m."""
    x = np.linspace(-0.2, 0.2, len(tones) + 1)
    points = np.stack((x, np.full(len(x), left)), axis=1)
    brush.steps(tones, points[:-1], points[1:], width)


def human_tones(index: int) -> list[Colour]:
    """Tones of the path of the pedestrian with this index in the scene, from its pale start to its end."""
    return _HUMAN_TONES[index % len(PATHS)]


_ROBOT_TONES = [time_colour(k / (_TONES - 1)) for k in range(_TONES)]
_HUMAN_TONES = [[mixed(FLOOR, colour, 0.15 + 0.6 * k / (_TONES - 1)) for k in range(_TONES)] for colour in PATHS]


def _walked(paths: Array) -> BoolArray:
    """(T - 1, ...): whether each step of (T, ..., 2) positions, m, was walked, rather than absent or re-entered."""
    lengths = np.abs(np.diff(paths, axis=0)).sum(axis=-1)
    walked: BoolArray = (lengths > 0.0) & (lengths < _MAX_STEP)
    return walked


def _marks(time: Array) -> list[int]:
    """Indices at which another `MARK_INTERVAL` has passed since the start."""
    passed = np.floor((time - time[:1]) / MARK_INTERVAL + 1e-6)
    return [int(k) for k in np.flatnonzero(np.diff(passed) > 0) + 1]
