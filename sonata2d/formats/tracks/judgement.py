"""Judgement of recorded tracks: whether people can have walked so, or whether units, times or ids are wrong."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from ...core.files.limits import MAX_PERSON_SPEED
from ...core.portable_math import Array
from ...record.layout import JsonDict
from .observations import LENGTHS, Track, Tracks

_WINDOW = 0.1  # s, at least, over which a speed is measured: shorter steps show the noise of the tracker
_ACCELERATION_WINDOW = 0.4  # s
_WALKING = 0.3  # m/s; slower steps do not count for the median speed
_USUAL_MEDIAN = (0.4, 2.2)  # m/s, of people who walk: U. Weidmann (1993) has a mean of 1.34, deviation 0.26
_MAX_ACCELERATION = 10.0  # m/s^2; sprinters start with 6, and trackers add noise
_MAX_EXTENT = 1000.0  # m, of the area of a recording
_NEAREST, _CLOSE_SHARE = 0.2, 0.05  # m between centres, less than a body is deep; share of positions
RARE = 0.01  # share of too high speeds, or of jumps, up to which these are faults of single tracks
_MAX_ROBOT_SPEED = 15.0  # m/s
_SAMPLES = 200  # times at which distances between people are measured


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """Facts about recorded tracks, by which a reader sees whether they were understood.

    Attributes:
        persons: number of people.
        frames: number of times from the first to the last observation.
        interval: time between them, s.
        median_speed: of people while they walk, m/s; None if nobody walks.
        largest_speed: m/s.
        width, depth: of the area in which people were, m.
        robot: whether the file has a robot's track.
        walls: number of walls.
        doubts: reasons why units, times or ids may be wrong; empty for plausible tracks.
        notes: remarks on what was left out or repaired.
    """

    persons: int
    frames: int
    interval: float
    median_speed: float | None
    largest_speed: float
    width: float
    depth: float
    robot: bool
    walls: int
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def to_json(self) -> JsonDict:
        """The attributes as JSON values, numbers with 4 digits after the point."""
        values = asdict(self) | {"doubts": list(self.doubts), "notes": list(self.notes)}
        return {name: round(value, 4) if isinstance(value, float) else value for name, value in values.items()}


def judged(tracks: Tracks) -> TrackSummary:
    """Summarise tracks, and refuse those that no people can walk.

    Raises:
        ValueError: more than one speed in a hundred is above 8 m/s; the message names the probable cause.
    """
    if not tracks.people:
        raise ValueError("; ".join(["it holds no track of a person", *tracks.notes]))
    moves = [(track, *_velocities(track, _WINDOW)) for track in tracks.people]
    speeds = [np.hypot(*velocity.T) for _, velocity, _ in moves]
    pooled = np.concatenate(speeds) if speeds else np.zeros(0)
    walking = pooled[pooled > _WALKING]
    median = float(np.median(walking)) if len(walking) else None
    largest = float(pooled.max(initial=0.0))
    places = np.concatenate([track.position for track in tracks.people])
    extent = np.ptp(places, axis=0)
    share = float((pooled > MAX_PERSON_SPEED).mean()) if len(pooled) else 0.0
    if share > RARE:
        worst = int(np.argmax([speed.max(initial=0.0) for speed in speeds]))
        reason = _too_fast(tracks.people[worst], speeds[worst], median or 0.0, pooled)
        raise ValueError("; ".join([reason, *tracks.doubts]))
    doubts = list(tracks.doubts)
    if share:
        doubts.append(
            f"{share:.2%} of the speeds are above {MAX_PERSON_SPEED:g} m/s, faster than people run; the largest is"
            f" {largest:.1f} m/s: some tracks have faults"
        )
    if median is not None and not _USUAL_MEDIAN[0] <= median <= _USUAL_MEDIAN[1]:
        doubts.append(
            f"the median speed of walking people is {median:.2f} m/s, {'fast' if median > 1 else 'slow'} for walking;"
            " check the frame rate and the unit"
        )
    elif median is None and len(pooled):
        doubts.append(f"nobody walks, with {tracks.interval:g} s between frames; check the frame rate and the unit")
    if sudden := _sudden(tracks):
        doubts.append(sudden)
    if extent.max() > _MAX_EXTENT:
        doubts.append(f"the area is {extent[0]:.0f} m x {extent[1]:.0f} m; check the unit")
    close = _close_share(tracks)
    if close > _CLOSE_SHARE:
        doubts.append(
            f"{close:.0%} of the positions are within {_NEAREST:g} m of another person's, closer than bodies"
            " allow; check the unit and the ids"
        )
    if tracks.robot is not None:
        fastest = float(np.hypot(*_velocities(tracks.robot, _WINDOW)[0].T).max(initial=0.0))
        if fastest > _MAX_ROBOT_SPEED:
            doubts.append(f"the robot moves at up to {fastest:.0f} m/s; check its track")
    times = [(track.time[0], track.time[-1]) for track in tracks.people]
    duration = max(end for _, end in times) - min(start for start, _ in times)
    return TrackSummary(
        persons=len(tracks.people),
        frames=round(duration / tracks.interval) + 1,
        interval=tracks.interval,
        median_speed=median,
        largest_speed=largest,
        width=float(extent[0]),
        depth=float(extent[1]),
        robot=tracks.robot is not None,
        walls=len(tracks.walls),
        doubts=tuple(doubts),
        notes=tracks.notes,
    )


def _velocities(track: Track, window: float) -> tuple[Array, Array]:
    """Velocities over the fewest steps that take `window` s or more; (K - n, 2), m/s, and the times they begin, s."""
    if len(track.time) < 2:
        return np.zeros((0, 2)), np.zeros(0)
    step = track.time[1] - track.time[0]
    n = min(max(int(np.ceil(window / step - 1e-6)), 1), len(track.time) - 1)
    velocity = (track.position[n:] - track.position[:-n]) / (n * step)
    return np.asarray(velocity), track.time[:-n]


def _too_fast(track: Track, speed: Array, median: float, pooled: Array) -> str:
    """Message about the fastest person, with the probable cause."""
    k = int(np.argmax(speed))
    share = float((pooled > MAX_PERSON_SPEED).mean())
    text = (
        f"person {track.id} jumps at {speed[k]:.1f} m/s at {track.time[k]:.6g} s, faster than people run"
        f" ({MAX_PERSON_SPEED:g} m/s)"
    )
    if share < 0.05:
        return f"{text}; correct the track: ids are exchanged there, or one id stands for two people"
    units = [name for name in ("cm", "mm", "ft") if _USUAL_MEDIAN[0] <= median * LENGTHS[name] <= _USUAL_MEDIAN[1]]
    of_unit = f" (--unit {units[0]} gives a median of {median * LENGTHS[units[0]]:.2f} m/s)" if units else ""
    return (
        f"{text}; the median speed is {median:.1f} m/s: check the unit{of_unit}, the frame rate, and that the"
        " columns are not exchanged (--columns)"
    )


def _sudden(tracks: Tracks) -> str | None:
    """Remark on the largest change of velocity, if no person's legs can cause it."""
    worst = (0.0, 0, 0.0)
    for track in tracks.people:
        velocity, time = _velocities(track, _ACCELERATION_WINDOW)
        n = len(track.time) - len(velocity)
        if len(velocity) > n:
            rate = np.hypot(*(velocity[n:] - velocity[:-n]).T) / (time[n] - time[0])
            k = int(np.argmax(rate))
            worst = max(worst, (float(rate[k]), track.id, float(time[k + n])))
    rate, id, at = worst
    if rate <= _MAX_ACCELERATION:
        return None
    return f"person {id} accelerates with {rate:.1f} m/s² at {at:.6g} s; check the ids, which may be exchanged there"


def _close_share(tracks: Tracks) -> float:
    """Share of positions within `_NEAREST` of another person, at some times."""
    times = np.concatenate([track.time for track in tracks.people])
    places = np.concatenate([track.position for track in tracks.people])
    stamp = np.floor(times / tracks.interval + 0.25).astype(np.int64)  # different for all positions of a person
    distinct = np.unique(stamp)
    chosen = distinct[np.linspace(0, len(distinct) - 1, min(_SAMPLES, len(distinct))).astype(int)]
    order = np.argsort(stamp, kind="stable")
    begins, ends = np.searchsorted(stamp[order], chosen), np.searchsorted(stamp[order], chosen, "right")
    close = count = 0
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        at = places[order[begin:end]][:2000]  # more people than that at once are a sample, too
        distance = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
        np.fill_diagonal(distance, np.inf)
        close += int((distance.min(axis=1, initial=np.inf) < _NEAREST).sum())
        count += len(at)
    return close / count
