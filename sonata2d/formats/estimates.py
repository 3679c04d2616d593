"""Estimates of values that foreign recordings lack: velocities, headings, activities, rooms and radii."""

from __future__ import annotations

import numpy as np

from ..core.entities import PERSON_RADIUS
from ..core.geometry import Barriers
from ..core.portable_math import Array, IntArray
from ..core.relations import ACTIVITIES
from ..core.vectors import lengths, wrap_angles
from ..record.canonical import rounded

# Columns of recorded states: x, y, theta, vx, vy, omega, and for pedestrians head.
X, Y, THETA, VX, VY = range(5)
POSITION, POSE, VELOCITY = slice(0, 2), slice(0, 3), slice(3, 5)

WALKING_SPEED = 0.1  # m/s; a slower pedestrian stands
_CORNER_TOLERANCE = 0.05  # m; ends of walls nearer than this are one corner
_OVERLAP, _SMALLEST_RADIUS = 0.02, 0.05  # m


def velocities(time: Array, poses: Array) -> Array:
    """Return velocities as backward differences of poses, as a simulator gives the velocities of the last step.

    The first frame of an entity has no predecessor and takes the velocity of the next frame.

    Args:
        time: (T,), s, rising.
        poses: (T, ..., 3), columns x, y, theta; NaN where absent.

    Returns:
        (T, ..., 3), m/s, m/s, rad/s; 0 where unknown, NaN where absent.
    """
    rates = np.zeros(poses.shape)
    if len(poses) > 1:
        step = np.diff(time).reshape(-1, *([1] * (poses.ndim - 1)))
        change = np.diff(poses, axis=0)
        change[..., THETA] = wrap_angles(change[..., THETA])
        rates[1:] = change / step
        unknown = np.isnan(rates) & ~np.isnan(poses)  # present now, but not in the frame before
        unknown[0] = True
        following = np.concatenate((rates[1:], np.zeros((1, *poses.shape[1:]))))
        rates = np.where(unknown, np.nan_to_num(following), rates)
    return np.where(np.isnan(poses), np.nan, rates)


def with_velocities(time: Array, poses: Array) -> Array:
    """Return states of pedestrians from their poses: velocities as differences, heads that face ahead.

    Args:
        time: (T,), s, rising.
        poses: (T, N, 3), columns x, y, theta; NaN where absent.

    Returns:
        (T, N, 7), columns x, y, theta, vx, vy, omega, head.
    """
    return np.concatenate((poses, velocities(time, poses), poses[..., THETA : THETA + 1]), axis=-1)


def elapsed(stamps: Array, noun: str) -> Array:
    """Return times from the first time stamp, s.

    Args:
        stamps: (T,), s.
        noun: what a stamp belongs to, for the error message: `frame` or `step`.

    Raises:
        ValueError: the stamps do not rise.
    """
    steps = np.diff(stamps)
    if not (steps > 5e-5).all():
        raise ValueError(f"timestamps must rise, {noun} {int(np.argmin(steps)) + 1} does not")
    return np.asarray(stamps - stamps[0])


def room_around(walls: Array, points: Array) -> Array:
    """Return the corners of the room: of the walls that enclose it, else of a box around walls and points.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m.
        points: (M, 2), m; NaN where absent.

    Returns:
        (K, 2), counter-clockwise, m.
    """
    polygon = polygon_of(walls)
    points = np.concatenate((points[~np.isnan(points[:, X])], walls.reshape(-1, 2)))
    return bounding_box(points, 1.0) if polygon is None else polygon


def headings_along(velocity: Array) -> Array:
    """Return headings along the velocities; a pedestrian who stands keeps the last heading.

    Args:
        velocity: (T, N, 2), m/s; NaN where absent.

    Returns:
        (T, N), rad; NaN where absent; 0 for pedestrians who never move.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    theta = np.arctan2(velocity[..., 1], velocity[..., 0])
    moving = speed > WALKING_SPEED
    frames = np.arange(len(velocity))[:, None]
    last = np.maximum.accumulate(np.where(moving, frames, -1), axis=0)
    first = np.where(moving.any(axis=0), moving.argmax(axis=0), 0)
    source = np.where(last < 0, first[None], last)  # before the first motion, its heading is used
    heading = np.take_along_axis(np.where(moving, theta, 0.0), source, axis=0)
    return np.where(np.isnan(speed), np.nan, heading)


def activity_of(velocity: Array) -> IntArray:
    """Derive activities, walking or standing, from speeds.

    Args:
        velocity: (T, N, 2), m/s; NaN where absent.

    Returns:
        (T, N), indices into `relations.ACTIVITIES`; -1 where absent.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    activity = np.where(speed > WALKING_SPEED, ACTIVITIES.index("walking"), ACTIVITIES.index("standing"))
    return np.where(np.isnan(speed), -1, activity)


def polygon_of(walls: Array) -> Array | None:
    """Find the room that walls enclose.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m, in any order and direction.

    Returns:
        (K, 2), corners, counter-clockwise; None if the first wall is not part of a closed line.
    """
    distinct = np.array(list(dict.fromkeys(map(tuple, walls.tolist())))).reshape(-1, 2, 2)  # both ends of each wall
    if len(distinct) < 3:
        return None
    unused = np.ones(len(distinct), dtype=bool)
    unused[0] = False
    corners, end = [distinct[0, 0]], distinct[0, 1]
    # Append the wall that continues at the open end until the line returns to the first corner.
    while len(corners) < len(distinct) and lengths(end - corners[0]) > _CORNER_TOLERANCE:
        gaps = np.where(unused[:, None], lengths(distinct - end), np.inf)
        index, side = np.unravel_index(int(gaps.argmin()), gaps.shape)
        if gaps[index, side] > _CORNER_TOLERANCE:
            return None
        unused[index] = False
        corners.append(end)
        end = distinct[index, 1 - side]
    ring = np.array(corners)
    if len(ring) < 3 or lengths(end - ring[0]) > _CORNER_TOLERANCE:
        return None
    x, y = ring.T
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    return ring if area > 0 else ring[::-1]


def bounding_box(points: Array, margin: float) -> Array:
    """Return the corners of the axis-aligned box around points, widened by a margin.

    Args:
        points: (M, 2), m.
        margin: m.

    Returns:
        (4, 2), counter-clockwise, m.
    """
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def fitting_radii(positions: Array, walls: Array) -> list[float]:
    """Choose radii for pedestrians without recorded radii.

    The default radius is reduced where a pedestrian comes nearer to another one or to a wall, so that no check reports
    overlapping outlines when the outlines are unknown.

    Args:
        positions: (T, N, 2 or more), columns x, y, ...; NaN where absent.
        walls: (W, 4), x1, y1, x2, y2, m.

    Returns:
        (N,), m.
    """
    barriers = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in np.asarray(walls).tolist()])
    clearance = np.full(positions.shape[1], np.inf)
    for frame in positions[..., POSITION]:
        present = np.flatnonzero(~np.isnan(frame[:, X]))
        points = frame[present]
        distance = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        np.fill_diagonal(distance, np.inf)
        free = distance.min(axis=1, initial=np.inf) / 2
        if len(barriers) and len(points):
            free = np.minimum(free, barriers.gaps(points).min(axis=0))
        clearance[present] = np.minimum(clearance[present], free)
    radii = np.clip(clearance + _OVERLAP, _SMALLEST_RADIUS, PERSON_RADIUS)
    return [float(radius) for radius in rounded(radii)]
