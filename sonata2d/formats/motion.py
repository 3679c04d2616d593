"""Velocities, headings and rooms that follow from what a source tells: offline, never inside the loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..exact import Array
from ..humans import ACTIVITIES

MOVES = 0.1  # m/s; whoever is slower stands
_MEETS = 0.05  # m, ends of walls that are one corner


def turned_by(angle: Array) -> Array:
    """The same turns in (-pi, pi]; any shape, rad."""
    return np.asarray(np.pi - (np.pi - angle) % (2 * np.pi))


def velocities(time: Array, poses: Array) -> Array:
    """Backward differences, as a simulator's velocities are those of the last step; the first row looks ahead.

    Args:
        time: (T,), s, rising.
        poses: (T, …, 3), columns x, y, theta; NaN where not present.

    Returns:
        (T, …, 3), m/s, m/s, rad/s; 0 where nothing tells, NaN where not present.
    """
    rates = np.zeros(poses.shape)
    if len(poses) > 1:
        step = np.diff(time).reshape(-1, *([1] * (poses.ndim - 1)))
        change = np.diff(poses, axis=0)
        change[..., 2] = turned_by(change[..., 2])
        rates[1:] = change / step
        unknown = np.isnan(rates) & ~np.isnan(poses)  # they have just come, or are looked at first
        unknown[0] = True
        ahead = np.concatenate((rates[1:], np.zeros((1, *poses.shape[1:]))))
        rates = np.where(unknown, np.nan_to_num(ahead), rates)
    return np.where(np.isnan(poses), np.nan, rates)


def headings_along(velocity: Array) -> Array:
    """Where people face if they look where they go; whoever stands faces as before.

    Args:
        velocity: (T, N, 2), m/s; NaN where not present.

    Returns:
        (T, N), rad; NaN where not present; 0 for those who never move.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    theta = np.arctan2(velocity[..., 1], velocity[..., 0])
    known = speed > MOVES
    rows = np.arange(len(velocity))[:, None]
    last = np.maximum.accumulate(np.where(known, rows, -1), axis=0)
    first = np.where(known.any(axis=0), known.argmax(axis=0), 0)
    source = np.where(last < 0, first[None], last)
    faced = np.take_along_axis(np.where(known, theta, 0.0), source, axis=0)
    return np.where(np.isnan(speed), np.nan, faced)


def activity_of(velocity: Array) -> Any:
    """(T, N) of int into `humans.ACTIVITIES`, by speed alone; -1 where not present."""
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    moves = np.where(speed > MOVES, ACTIVITIES.index("walking"), ACTIVITIES.index("standing"))
    return np.where(np.isnan(speed), -1, moves)


def polygon_of(walls: Array) -> Array | None:
    """The room that walls close off, (K, 2), counter-clockwise; None if the first wall is no part of a closed line.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m, in any order and direction.
    """
    if len(walls) < 3:
        return None
    left = list(walls[1:])
    corners, end = [walls[0, 0:2]], walls[0, 2:4]
    while left and np.hypot(*(end - corners[0])) > _MEETS:
        gaps = [min(np.hypot(*(end - wall[k : k + 2])) for k in (0, 2)) for wall in left]
        nearest = int(np.argmin(gaps))
        if gaps[nearest] > _MEETS:
            return None
        wall = left.pop(nearest)
        corners.append(end)
        end = wall[2:4] if np.hypot(*(end - wall[0:2])) <= _MEETS else wall[0:2]
    ring = np.array(corners)
    if len(ring) < 3 or np.hypot(*(end - ring[0])) > _MEETS:
        return None
    x, y = ring.T
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    return ring if area > 0 else ring[::-1]


def box_round(points: Array, margin: float) -> Array:
    """The upright oblong round points, (4, 2), counter-clockwise; (M, 2), m."""
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
