"""The look at a moment between two ticks, for pictures that come faster than ticks do."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.geometry import Point
from ..core.humans import BODY_X, GAZE_X, Humans, frozen
from ..core.portable_math import Array
from ..core.snapshot import RobotState, Snapshot

_LEAP = 1.0  # m between two ticks: who came back elsewhere, and did not walk there


def between(before: Snapshot, after: Snapshot, share: float) -> Snapshot:
    """The look at a share of the way from one tick to the next.

    Places and velocities go straight, directions turn the short way; all that cannot be blended is as after. Who is
    absent from either look is absent in between, and who leaps is where they arrive.

    Args:
        share: 0 for the look before, 1 for the one after; what lies beyond counts as the nearer of the two.
    """
    if share <= 0.0:
        return before
    if share >= 1.0:
        return after
    time = before.time + (after.time - before.time) * share
    return replace(
        after,
        time=time,
        humans=_humans_between(before.humans, after.humans, share),
        robot=_robot_between(before.robot, after.robot, share),
    )


def _humans_between(before: Humans, after: Humans, share: float) -> Humans:
    if before.row is None and after.row is None:
        was = now = np.arange(len(after))
    else:
        _, was, now = np.intersect1d(before.id, after.id, assume_unique=True, return_indices=True)
        was, now = was[np.argsort(now)], np.sort(now)
    start, end = before.state[was], after.state[now]
    state = start + (end - start) * share
    for column in (BODY_X, GAZE_X):
        pair = slice(column, column + 2)
        state[:, pair] = _turned(start[:, pair], end[:, pair], share)
    leaps = np.abs(end[:, :2] - start[:, :2]).sum(axis=1) > _LEAP
    state[leaps] = end[leaps]
    row: Any = now if after.row is None else after.row[now]
    everybody_is_there = before.row is None and after.row is None
    told = after.id[now], after.radius[now], after.activity_index[now]
    return Humans(frozen(state), *told, None if everybody_is_there else row)


def _turned(start: Array, end: Array, share: float) -> Array:
    """Unit vectors, (N, 2) each, at a share of the turn from one to the other, the short way."""
    along = start[:, 0] * end[:, 0] + start[:, 1] * end[:, 1]
    across = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    angle = np.arctan2(across, along) * share
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((start[:, 0] * c - start[:, 1] * s, start[:, 0] * s + start[:, 1] * c), axis=1)


def _robot_between(before: RobotState, after: RobotState, share: float) -> RobotState:
    def blend(a: Point, b: Point) -> Point:
        return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share

    (ax, ay), (bx, by) = before.direction, after.direction
    angle = math.atan2(ax * by - ay * bx, ax * bx + ay * by) * share
    c, s = math.cos(angle), math.sin(angle)
    return replace(
        after,
        position=blend(before.position, after.position),
        velocity=blend(before.velocity, after.velocity),
        direction=(ax * c - ay * s, ax * s + ay * c),
        omega=before.omega + (after.omega - before.omega) * share,
    )
