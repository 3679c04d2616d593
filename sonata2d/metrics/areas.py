"""Metrics of the rules of areas: where robots may not go, how fast they may drive, and in which direction."""

from __future__ import annotations

import numpy as np

from ..core.entities import Area
from ..core.geometry import Barriers, inside_rings
from ..core.portable_math import Array, BoolArray, unit_vector
from ..core.vectors import lengths
from .definition import metric
from .trajectory import Trajectory, gaps_to

_SLOW = 0.05  # m/s, up to which a robot may drift against a one-way direction
_SPEED_TOLERANCE = 0.02  # m/s, above a speed limit


@metric("s", "less", needs={"robot", "robot.radius"})
def no_go_time(trajectory: Trajectory) -> float | None:
    """Time during which the robot's outline is, at least in part, in areas where robots may not go.

    Not defined without such areas.
    """
    areas = [area for area in trajectory.scene.areas if area.no_go]
    return _time(trajectory, [_is_inside(trajectory, area) | _touches(trajectory, area) for area in areas])


@metric("s", "less", needs={"robot"})
def speeding_time(trajectory: Trajectory) -> float | None:
    """Time during which the robot's centre is in an area and faster than its speed limit (by more than 0.02 m/s).

    Not defined without areas with a speed limit.
    """
    speed, flags = lengths(trajectory.velocity), []
    for area in trajectory.scene.areas:
        if area.speed_limit is not None:
            flags.append(_is_inside(trajectory, area) & (speed > area.speed_limit + _SPEED_TOLERANCE))
    return _time(trajectory, flags)


@metric("s", "less", needs={"robot"})
def wrong_way_time(trajectory: Trajectory) -> float | None:
    """Time during which the robot's centre is in a one-way area and moves against its direction (by over 0.05 m/s).

    Not defined without one-way areas.
    """
    flags = []
    for area in trajectory.scene.areas:
        if area.one_way is not None:
            along = trajectory.velocity @ np.array(unit_vector(area.one_way))
            flags.append(_is_inside(trajectory, area) & (along < -_SLOW))
    return _time(trajectory, flags)


def _is_inside(trajectory: Trajectory, area: Area) -> BoolArray:
    """(L,), whether the robot's centre is in an area."""
    return inside_rings(trajectory.position, area.polygon, ())


def _touches(trajectory: Trajectory, area: Area) -> BoolArray:
    """(L,), whether the robot's outline meets the edges of an area."""
    touches: BoolArray = gaps_to(trajectory, Barriers.of(area.edges())).min(axis=0) < 0.0
    return touches


def _time(trajectory: Trajectory, flags: list[BoolArray]) -> float | None:
    """Time of the states, but the last one, in which one of the flags is true, s; None without flags."""
    if not flags:
        return None
    durations: Array = trajectory.durations
    return float(durations[np.logical_or.reduce(flags)[:-1]].sum())


METRICS = (no_go_time, speeding_time, wrong_way_time)
