"""Interpolates between the snapshots of two ticks, for pictures that are drawn more often than ticks occur."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.humans import BODY_X, GAZE_X, Humans, X, Y, frozen
from ..core.portable_math import Array
from ..core.snapshot import RobotState, Snapshot

_MAX_STEP = 1.0  # m per tick; a pedestrian that moves farther has re-entered the scene elsewhere


def between(before: Snapshot, after: Snapshot, fraction: float) -> Snapshot:
    """The snapshot at a fraction of the time between two ticks.

    Positions and velocities are interpolated linearly, directions along the shorter arc; everything else is taken from
    `after`. A pedestrian that is absent from either snapshot is absent from the result, and one that re-enters
    elsewhere is at its new position.

    Args:
        fraction: 0 for `before`, 1 for `after`; other values are clipped to this range.
    """
    if fraction <= 0.0:
        return before
    if fraction >= 1.0:
        return after
    return replace(
        after,
        time=before.time + (after.time - before.time) * fraction,
        humans=_humans_between(before.humans, after.humans, fraction),
        robot=_robot_between(before.robot, after.robot, fraction),
        robots=tuple(_robot_between(*pair, fraction) for pair in zip(before.robots, after.robots, strict=True)),
    )


def _humans_between(before: Humans, after: Humans, fraction: float) -> Humans:
    all_present = before.row is None and after.row is None
    if all_present:
        was = now = np.arange(len(after))
    else:
        _, was, now = np.intersect1d(before.id, after.id, assume_unique=True, return_indices=True)
        was, now = was[np.argsort(now)], np.sort(now)  # in the order of `after`
    start, end = before.state[was], after.state[now]
    state = start + (end - start) * fraction
    for column in (BODY_X, GAZE_X):
        pair = slice(column, column + 2)
        state[:, pair] = _rotated(start[:, pair], end[:, pair], fraction)
    jumps = np.abs(end[:, X : Y + 1] - start[:, X : Y + 1]).sum(axis=1) > _MAX_STEP
    state[jumps] = end[jumps]
    row = None if all_present else now if after.row is None else after.row[now]
    return Humans(
        frozen(state),
        after.id[now],
        after.radius[now],
        after.shoulder[now],
        after.activity_index[now],
        after.kind[now],
        row,
    )


def _rotated(start: Array, end: Array, fraction: float) -> Array:
    """Unit vectors at a fraction of the shorter arc from `start` to `end`, all (N, 2)."""
    along = start[:, 0] * end[:, 0] + start[:, 1] * end[:, 1]
    across = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    angle = np.arctan2(across, along) * fraction
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((start[:, 0] * c - start[:, 1] * s, start[:, 0] * s + start[:, 1] * c), axis=1)


def _robot_between(before: RobotState, after: RobotState, fraction: float) -> RobotState:
    start, end = (np.array((*robot.position, *robot.velocity, robot.omega)) for robot in (before, after))
    x, y, vx, vy, omega = (start + (end - start) * fraction).tolist()
    ((dx, dy),) = _rotated(np.array([before.direction]), np.array([after.direction]), fraction).tolist()
    return replace(after, position=(x, y), velocity=(vx, vy), direction=(dx, dy), omega=omega)
