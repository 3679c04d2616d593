"""Past paths: the robot's coloured by time, the pedestrians' in a colour each that fades into the past.

Pictures draw each step as a stroke on any canvas (`draw_trails`). The window draws bands of a few tones directly on a
surface (`draw_fast_trails`), which is 3 times faster than strokes of the same tones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pygame

from ..core.geometry import Point
from ..core.portable_math import Array, BoolArray
from ..core.snapshot import Snapshot
from .brush import Brush
from .palette import FLOOR, PAPER, PATHS, Colour, mixed, shaded, time_colour
from .projection import Camera

_HUMAN_WIDTH, _ROBOT_WIDTH = 0.035, 0.07  # m
MARK_INTERVAL = 5.0  # s, between the marks on the robot's trail
_TONES = 12  # of a path; the robot's has a tone a step where it is not drawn fast
_MAX_STEP = 1.0  # m per tick; an agent that moves farther has re-entered the scene elsewhere


@dataclass(frozen=True)
class Trails:
    """Past positions of all agents.

    Attributes:
        time: (T,), s.
        robot: (T, 2), m.
        humans: (T, N, 2), m; not finite where a pedestrian is absent.
        is_tail: whether these are only the last seconds; then pictures show no time marks.
    """

    time: Array
    robot: Array
    humans: Array
    is_tail: bool = False

    @classmethod
    def of(cls, snapshots: Iterable[Snapshot], *, is_tail: bool = False) -> Trails:
        """Collect the positions from the snapshots of one episode."""
        rows = [
            (s.time, s.robot.position, s.humans.expand(s.humans.position, len(s.scene.humans), np.nan))
            for s in snapshots
        ]
        count = len(rows[0][2]) if rows else 0
        return cls(
            np.array([time for time, _, _ in rows], dtype=float),
            np.array([robot for _, robot, _ in rows], dtype=float).reshape(len(rows), 2),
            np.array([humans for _, _, humans in rows], dtype=float).reshape(len(rows), count, 2),
            is_tail,
        )

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last time, s; None without positions."""
        return (float(self.time[0]), float(self.time[-1])) if len(self.time) else None

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


def draw_trails(brush: Brush, trails: Trails | None, *, robot: bool = True) -> None:
    """Draw the pedestrians' paths, then the robot's on top, with time marks unless it is a tail; nothing for None.

    Args:
        robot: whether to draw the robot's path.
    """
    if trails is None:
        return
    fraction = trails.fraction.tolist()
    indices = [round(f * (_TONES - 1)) for f in fraction]
    for k, (path, walked) in enumerate(zip(np.swapaxes(trails.humans, 0, 1), _walked(trails.humans).T, strict=True)):
        tones = human_tones(k)
        _draw_path(brush, path, walked, [tones[index] for index in indices], _HUMAN_WIDTH)
    if not robot:
        return
    colours = [time_colour(f) for f in fraction]
    _draw_path(brush, trails.robot, _walked(trails.robot), colours, _ROBOT_WIDTH)
    for k in [] if trails.is_tail else _marks(trails.time):
        _draw_mark(brush, colours[k], (float(trails.robot[k, 0]), float(trails.robot[k, 1])))


def _draw_mark(brush: Brush, colour: Colour, place: Point) -> None:
    """Draw a time mark on the robot's path: a white disc with a rim that is darker than the path."""
    brush.disc(shaded(colour, 0.3), place, 0.065)
    brush.disc(PAPER, place, 0.038)


def draw_mark_sample(brush: Brush) -> None:
    """Draw a piece of the robot's path, 0.4 m long, with a time mark, around the brush."""
    x = np.linspace(-0.2, 0.2, _TONES + 1)
    points = np.stack((x, np.zeros(len(x))), axis=1)
    brush.steps(_ROBOT_TONES, points[:-1], points[1:], 0.07)
    _draw_mark(brush, _ROBOT_TONES[_TONES // 2], (0.0, 0.0))


def draw_path_samples(brush: Brush, *, robot: bool) -> None:
    """Draw pieces of paths, 0.4 m long, around the brush: the robot's, if it is to be drawn, above those of two people.

    The widths are those of paths at a common scale, so that they can be recognised.
    """
    across = (0.12, 0.0, -0.12) if robot else (0.08, -0.08)
    samples = [*([(_ROBOT_TONES, 0.07)] if robot else []), *((human_tones(k), 0.035) for k in (0, 1))]
    for left, (tones, width) in zip(across, samples, strict=True):
        x = np.linspace(-0.2, 0.2, _TONES + 1)
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


def _draw_path(brush: Brush, path: Array, walked: BoolArray, colours: Sequence[Colour], width: float) -> None:
    """Draw each step that was walked, in the colour of its end.

    Args:
        path: (T, 2), m.
        walked: (T - 1,).
        colours: of the T positions.
        width: m.
    """
    steps = np.flatnonzero(walked)
    if len(steps):
        brush.steps([colours[k + 1] for k in steps.tolist()], path[steps], path[steps + 1], width)


def _marks(time: Array) -> list[int]:
    """Indices at which another `MARK_INTERVAL` has passed since the start."""
    passed = np.floor((time - time[:1]) / MARK_INTERVAL + 1e-6)
    return [int(k) for k in np.flatnonzero(np.diff(passed) > 0) + 1]


def draw_fast_trails(brush: Brush, surface: pygame.Surface, trails: Trails | None, *, robot: bool = True) -> None:
    """Draw the same as `draw_trails`, without time marks, on the surface of the brush's canvas."""
    if trails is None:
        return
    camera, fraction = brush.camera, trails.fraction
    for k, path in enumerate(np.swapaxes(trails.humans, 0, 1)):
        _draw_bands(surface, camera, path, fraction, human_tones(k), _HUMAN_WIDTH)
    if robot:
        _draw_bands(surface, camera, trails.robot, fraction, _ROBOT_TONES, _ROBOT_WIDTH)


def _draw_bands(
    surface: pygame.Surface,
    camera: Camera,
    path: Array,
    fraction: Array,
    tones: Sequence[Colour],
    width: float,
) -> None:
    for run in _continuous_runs(path):
        points, moments = _distinct_pixels(path[run], fraction[run], camera)
        if len(points) < 2:
            continue
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.sqrt((along * along).sum(axis=1, keepdims=True)), 1e-9)
        normal = np.stack((-along[:, 1], along[:, 0]), axis=1) * max(width * camera.scale / 2, 1.0)
        left, right = (points + normal).tolist(), (points - normal).tolist()
        indices = np.round(moments[1:] * (_TONES - 1)).astype(int)
        cuts = [0, *(np.flatnonzero(np.diff(indices)) + 1).tolist(), len(points) - 1]
        for first, last in pairwise(cuts):
            band = left[first : last + 1] + right[first : last + 1][::-1]
            tone = tones[int(indices[first])]
            pygame.draw.polygon(surface, tone, band)
            pygame.draw.aalines(surface, tone, False, left[first : last + 1])
            pygame.draw.aalines(surface, tone, False, right[first : last + 1])


def _continuous_runs(path: Array) -> Iterator[slice]:
    """Index ranges in which the agent was present and did not re-enter elsewhere."""
    steps = np.abs(np.diff(path, axis=0)).sum(axis=1)
    walked = np.concatenate(([False], steps < _MAX_STEP, [False])).astype(int)  # False for steps that are not finite
    starts, ends = np.flatnonzero(np.diff(walked) > 0), np.flatnonzero(np.diff(walked) < 0)
    for start, end in zip(starts, ends, strict=True):
        yield slice(int(start), int(end) + 1)


def _distinct_pixels(path: Array, fraction: Array, camera: Camera) -> tuple[Array, Array]:
    """Points in pixels without those at the position of their predecessor, and their fractions of the time span."""
    x, y = camera.to_pixels((path[:, 0], path[:, 1]))  # type: ignore[arg-type]  # works for arrays as for numbers
    points = np.stack((x, y), axis=1)
    moved = np.concatenate(([True], np.abs(np.diff(points, axis=0)).sum(axis=1) > 0.5))
    return points[moved], fraction[moved]
