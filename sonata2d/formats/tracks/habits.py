"""Habits of recorded people that simulated ones get: how often and how long they stop, and how wide they go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.geometry import Barriers, quantised, segments_cross
from ...core.portable_math import Array
from .observations import Track, interpolated

_STEP, _SMOOTHED = 0.4, 3  # s, and positions over which the mean is taken
_WALKING_SPEED, _SETTING_OFF_SPEED, _STANDING_SPEED = 0.3, 0.5, 0.2  # m/s
_SHORTEST_STOP = 3  # steps
_FEWEST_WAYS = 10  # from which the deviation of their largest distances is estimated
_SHORTEST_WAY = 3.0  # m, from the first to the last position
_OWN_DETOUR = 0.037  # `Habits.detours` of simulated people without via points, who deviate from their course
_NORMAL = 1.4826  # ratio of the standard deviation of a normal distribution to the median of the absolute value


class Habits(NamedTuple):
    """Habits of the people of a recording, see `core.scene.Social`.

    Attributes:
        stops: in a minute of walking.
        stop_time: shortest and longest, s.
        detours: standard deviation of the largest distance from the straight line, as a fraction of its length.
    """

    stops: float
    stop_time: tuple[float, float]
    detours: float

    @property
    def settings(self) -> dict[str, object]:
        """Keys of the section `social` of a scenario, without those that change nothing."""
        found: dict[str, object] = {"detours": self.detours} if self.detours > 0.0 else {}
        return found | ({"stops": self.stops, "stop_time": list(self.stop_time)} if self.stops > 0.0 else {})

    @property
    def mean_stop(self) -> float:
        """Mean duration of a stop, s."""
        low, high = self.stop_time
        return low + (high - low) / 4.0


NONE = Habits(0.0, (quantised(_SHORTEST_STOP * _STEP), quantised(_SHORTEST_STOP * _STEP)), 0.0)


def habits_of(people: Sequence[Track], walls: Array) -> Habits:
    """Estimate the habits of recorded people.

    A stop lasts 1.2 s or longer, and the person walks before and after it. How wide people go is estimated from ways of
    3 m and more that no wall blocks; with fewer than ten of these, there are no habits.

    Args:
        people: their tracks.
        walls: (W, 4), x1, y1, x2, y2, m.
    """
    barriers = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in walls.tolist()])
    durations: list[float] = []
    detours, walked = [], 0.0
    for track in people:
        position = _smooth(track)
        if len(position) < 2:
            continue
        speed = np.hypot(*np.diff(position, axis=0).T) / _STEP
        walked += _STEP * float(np.count_nonzero(speed > _WALKING_SPEED))
        durations += _stops(speed)
        detour = _detour(position)
        if detour is not None and not _is_blocked(position, barriers):
            detours.append(detour)
    if len(detours) < _FEWEST_WAYS:
        return NONE
    detour = _NORMAL * float(np.median(detours))
    low = _SHORTEST_STOP * _STEP
    # the mean of the times, whose distribution is that of `Social.stop_time`
    high = low + 4.0 * (float(np.mean(durations)) - low) if durations else low
    return Habits(
        quantised(60.0 * len(durations) / walked if walked > 0.0 else 0.0),
        (quantised(low), quantised(max(high, low))),
        quantised(min(float(np.sqrt(max(detour**2 - _OWN_DETOUR**2, 0.0))), 1.0)),
    )


def stands_at_ends(track: Track) -> tuple[bool, bool]:
    """Whether a person that walks in between stands for a time after it comes into view, and before it is lost."""
    speed = np.hypot(*np.diff(_smooth(track), axis=0).T) / _STEP
    if len(speed) <= _SHORTEST_STOP or speed.max() < _SETTING_OFF_SPEED:
        return False, False
    first, last = speed[:_SHORTEST_STOP] < _STANDING_SPEED, speed[-_SHORTEST_STOP:] < _STANDING_SPEED
    return bool(first.all()), bool(last.all())


def _smooth(track: Track) -> Array:
    """Positions at steps of `_STEP`, (K, 2), m, as running means."""
    times = np.arange(track.time[0], track.time[-1] + 1e-9, _STEP)
    position = interpolated(times, track.time, track.position)
    if len(position) < _SMOOTHED:
        return position
    middle = (position[:-2] + position[1:-1] + position[2:]) / _SMOOTHED
    return np.concatenate([position[:1], middle, position[-1:]])


def _stops(speed: Array) -> list[float]:
    """Durations of the stops in a row of speeds, s."""
    edges = np.flatnonzero(np.diff(np.r_[0, speed < _STANDING_SPEED, 0]))
    return [
        _STEP * float(end - start + _SMOOTHED - 1)  # running means shorten a stop by a step at each end
        for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        if end - start >= _SHORTEST_STOP
        and speed[:start].max(initial=0.0) > _SETTING_OFF_SPEED
        and speed[end:].max(initial=0.0) > _SETTING_OFF_SPEED
    ]


def _detour(position: Array) -> float | None:
    """Largest distance of a way from its straight line, as a fraction of its length; None if it is too short."""
    way = position[-1] - position[0]
    size = float(np.hypot(way[0], way[1]))
    if size < _SHORTEST_WAY:
        return None
    off = position - position[0]
    return float(np.abs(way[0] * off[:, 1] - way[1] * off[:, 0]).max()) / (size * size)


def _is_blocked(position: Array, barriers: Barriers) -> bool:
    """Whether a wall crosses the straight line of a way."""
    return bool(segments_cross(position[:1], position[-1:], barriers).any())
