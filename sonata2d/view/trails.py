"""Past paths: the robot's coloured by time, the pedestrians' fading into the past.

Pictures draw each step as a stroke on any canvas (`draw_trails`). The window draws bands of a few tones directly on a
surface (`draw_fast_trails`), which is 3 times faster than strokes of the same tones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pygame

from ..core.portable_math import Array
from ..core.snapshot import Snapshot
from .brush import Brush
from .camera import Camera
from .palette import BLUE, FLOOR, PAPER, Colour, mixed, shaded, time_colour

_HUMAN_WIDTH, _ROBOT_WIDTH = 0.035, 0.07  # m
_MARK_INTERVAL = 5.0  # s, between the marks on the robot's trail
_TONES = 12  # of a fast trail
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
    def fraction(self) -> Array:
        """(T,): each time as a fraction of the span, 0 to 1."""
        if len(self.time) < 2:
            return np.zeros(len(self.time))
        return np.asarray((self.time - self.time[0]) / (self.time[-1] - self.time[0]), dtype=float)


def draw_trails(brush: Brush, trails: Trails | None) -> None:
    """Draw the pedestrians' paths, then the robot's on top, with time marks unless it is a tail; nothing for None."""
    if trails is None:
        return
    fraction = trails.fraction.tolist()
    _draw_paths(brush, trails.humans, [_human_colour(f) for f in fraction], _HUMAN_WIDTH)
    colours = [time_colour(f) for f in fraction]
    _draw_paths(brush, trails.robot[:, None], colours, _ROBOT_WIDTH)
    for k in [] if trails.is_tail else _marks(trails.time):
        place = (float(trails.robot[k, 0]), float(trails.robot[k, 1]))
        brush.disc(shaded(colours[k], 0.3), place, 0.065)
        brush.disc(PAPER, place, 0.038)


def _human_colour(fraction: float) -> Colour:
    """Colour of a pedestrian's path from its start (0) to its end (1)."""
    return mixed(FLOOR, BLUE, 0.06 + 0.4 * fraction**1.5)


def _draw_paths(brush: Brush, paths: Array, colours: list[Colour], width: float) -> None:
    """Draw each step in the colour of its end, with gaps where the agent was absent or re-entered elsewhere.

    Args:
        paths: (T, N, 2), m, of N agents.
        colours: of the T positions.
        width: m.
    """
    lengths = np.abs(np.diff(paths, axis=0)).sum(axis=2)
    walked = (lengths > 0.0) & (lengths < _MAX_STEP)
    for agent in np.flatnonzero(walked.any(axis=0)).tolist():
        steps = np.flatnonzero(walked[:, agent])
        path = paths[:, agent]
        brush.steps([colours[k + 1] for k in steps.tolist()], path[steps], path[steps + 1], width)


def _marks(time: Array) -> list[int]:
    """Indices at which another `_MARK_INTERVAL` has passed since the start."""
    passed = np.floor((time - time[:1]) / _MARK_INTERVAL + 1e-6)
    return [int(k) for k in np.flatnonzero(np.diff(passed) > 0) + 1]


def draw_fast_trails(brush: Brush, surface: pygame.Surface, trails: Trails | None) -> None:
    """Draw the pedestrians' paths, then the robot's on top, on the surface of the brush's canvas; nothing for None."""
    if trails is None:
        return
    camera, fraction = brush.camera, trails.fraction
    for path in np.swapaxes(trails.humans, 0, 1):
        _draw_bands(surface, camera, path, fraction, _human_colour, _HUMAN_WIDTH)
    _draw_bands(surface, camera, trails.robot, fraction, time_colour, _ROBOT_WIDTH)


def _draw_bands(
    surface: pygame.Surface,
    camera: Camera,
    path: Array,
    fraction: Array,
    colour: Callable[[float], Colour],
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
        tones = np.round(moments[1:] * (_TONES - 1))
        cuts = [0, *(np.flatnonzero(np.diff(tones)) + 1).tolist(), len(points) - 1]
        for first, last in pairwise(cuts):
            band = left[first : last + 1] + right[first : last + 1][::-1]
            tone = colour(float(tones[first]) / (_TONES - 1))
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
