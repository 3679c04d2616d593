"""Where robot and people went: the robot's way coloured by time, the people's fading into the past."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..core.portable_math import Array
from ..core.snapshot import Snapshot
from .brush import Brush
from .palette import BLUE, FLOOR, PAPER, Colour, mixed, shaded, time_colour

WAY_WIDTH, ROBOT_WIDTH = 0.035, 0.07  # m
_MARK_EVERY = 5.0  # s, a mark on the robot's trail
LEAP = 1.0  # m between two ticks: an entity that came back elsewhere, not one that walked


@dataclass(frozen=True)
class Trails:
    """The ways so far.

    Attributes:
        time: (T,), s.
        robot: (T, 2), m.
        humans: (T, N, 2), m; not finite where a person is absent.
        is_tail: whether these are but the last seconds, which then need no clock.
    """

    time: Array
    robot: Array
    humans: Array
    is_tail: bool = False

    @classmethod
    def of(cls, snapshots: Iterable[Snapshot], *, is_tail: bool = False) -> Trails:
        """Gather the ways from the snapshots of one episode."""
        rows = [
            (s.time, s.robot.position, s.humans.among_all(s.humans.position, len(s.scene.humans), np.nan))
            for s in snapshots
        ]
        people = len(rows[0][2]) if rows else 0
        return cls(
            np.array([time for time, _, _ in rows], dtype=float),
            np.array([robot for _, robot, _ in rows], dtype=float).reshape(len(rows), 2),
            np.array([humans for _, _, humans in rows], dtype=float).reshape(len(rows), people, 2),
            is_tail,
        )

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last moment, s; None without any."""
        return (float(self.time[0]), float(self.time[-1])) if len(self.time) else None

    @property
    def share(self) -> Array:
        """(T,): how far each moment lies from the first (0) to the last (1)."""
        if len(self.time) < 2:
            return np.zeros(len(self.time))
        return np.asarray((self.time - self.time[0]) / (self.time[-1] - self.time[0]), dtype=float)


def draw_trails(brush: Brush, trails: Trails) -> None:
    """Draw the people's ways, then the robot's over them."""
    share = trails.share
    for way in np.swapaxes(trails.humans, 0, 1):
        _draw_way(brush, way, [way_colour(float(s)) for s in share], WAY_WIDTH)
    colours = [time_colour(float(s)) for s in share]
    _draw_way(brush, trails.robot, colours, ROBOT_WIDTH)
    for k in [] if trails.is_tail else _marks(trails.time):
        place = (float(trails.robot[k, 0]), float(trails.robot[k, 1]))
        brush.disc(shaded(colours[k], 0.3), place, 0.065)
        brush.disc(PAPER, place, 0.038)


def way_colour(share: float) -> Colour:
    """Colour of a person's way from start (0) to end (1)."""
    return mixed(FLOOR, BLUE, 0.06 + 0.4 * share**1.5)


def _draw_way(brush: Brush, way: Array, colours: list[Colour], width: float) -> None:
    """One way, each piece in the colour of its end; gaps where someone was away or leapt."""
    points = [(float(x), float(y)) for x, y in way]
    steps = np.abs(np.diff(way, axis=0)).sum(axis=1)
    for k, step in enumerate(steps):
        if 0.0 < step < LEAP:
            brush.stroke(colours[k + 1], points[k : k + 2], width)


def _marks(time: Array) -> list[int]:
    """The ticks at which another `_MARK_EVERY` seconds have passed since the start."""
    passed = np.floor((time - time[:1]) / _MARK_EVERY + 1e-6)
    return [int(k) for k in np.flatnonzero(np.diff(passed) > 0) + 1]
