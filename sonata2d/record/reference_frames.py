"""Changes of the frame of reference of a motion: seen from the goal, from the robot, or from any pose."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..core.humans import frozen
from ..core.portable_math import Array, arctan2, unit_vectors
from ..core.vectors import wrap_angles
from .motion import HEAD, THETA, VX, VY, Motion, Reference, X, Y


def seen_from(motion: Motion, origin: ArrayLike, reference: Reference) -> Motion:
    """Express a motion in a new frame of reference, fixed or moving.

    Args:
        motion: in its present frame of reference.
        origin: (3,), or (T + 1, 3) for a moving frame; columns x, y, theta: position of the new origin and angle of the
            new x axis in the present frame.
        reference: name of the new frame.

    Raises:
        ValueError: `origin` has another shape or is not finite.
    """
    count = len(motion.robot)
    origins = np.array(origin, dtype=float)
    if origins.shape not in ((3,), (count, 3)) or not np.isfinite(origins).all():
        raise ValueError(f"origin must be finite and of shape (3,) or ({count}, 3), got shape {origins.shape}")
    origins = np.broadcast_to(origins, (count, 3))
    axes = unit_vectors(origins[:, THETA])
    starts, ends = (_transformed(motion.walls[..., k : k + 2], origins, axes) for k in (0, 2))
    return replace(
        motion,
        reference=reference,
        robot=frozen(_transformed(motion.robot, origins, axes)),
        humans=frozen(_transformed(motion.humans, origins, axes)),
        goal=frozen(_transformed(motion.goal, origins, axes)),
        walls=frozen(np.concatenate((starts, ends), axis=-1)),
        objects=frozen(_transformed(motion.objects, origins, axes)),
    )


def goal_frame(motion: Motion, centre: Literal["goal", "robot"] = "goal") -> Motion:
    """Express a motion in a frame whose x axis points from the robot to the goal.

    If robot and goal coincide, the x axis stays unchanged.

    Args:
        motion: in a fixed frame of reference.
        centre: `goal`: a fixed frame with the goal as origin and the x axis along the line from the robot's initial
            position; `robot`: a moving frame with the robot as origin.

    Source: for `robot`, Y. F. Chen et al., ICRA 2017 (CADRL), the robot-centric frame.
    """
    to_goal = motion.goal[:, X : Y + 1] - motion.robot[:, X : Y + 1]
    bearing = arctan2(to_goal[:, Y], to_goal[:, X])
    if centre == "robot":
        return seen_from(motion, np.column_stack((motion.robot[:, X : Y + 1], bearing)), "goal")
    return seen_from(motion, np.array([*motion.goal[0, X : Y + 1], bearing[0]]), "goal")


def robot_frame(motion: Motion) -> Motion:
    """Express a motion in the body frame of the robot: x is forward, y is left."""
    return seen_from(motion, motion.robot[:, X : THETA + 1], "robot")


def world_frame(motion: Motion, origin: ArrayLike) -> Motion:
    """The inverse of `seen_from`, up to rounding.

    Args:
        motion: in the frame at `origin`.
        origin: (3,) or (T + 1, 3), as passed to `seen_from`.
    """
    origins = np.array(origin, dtype=float).reshape(-1, 3)
    axes = unit_vectors(origins[:, THETA])
    x, y = origins[:, X], origins[:, Y]
    inverse = np.column_stack((-(x * axes[:, X] + y * axes[:, Y]), x * axes[:, Y] - y * axes[:, X], -origins[:, THETA]))
    return seen_from(motion, inverse if np.ndim(origin) > 1 else inverse[0], "world")


def _transformed(rows: Array, origins: Array, axes: Array) -> Array:
    """Rows in new frames of reference.

    Args:
        rows: (T, ..., C), the first C recorded columns: points have 2, poses 3, robot rows 6, pedestrian rows 7.
        origins: (T, 3), columns x, y, theta.
        axes: (T, 2), unit vectors of the new x axes.
    """
    shape = (len(rows),) + (1,) * (rows.ndim - 2)
    c, s = axes[:, X].reshape(shape), axes[:, Y].reshape(shape)
    result = rows.copy()
    dx, dy = rows[..., X] - origins[:, X].reshape(shape), rows[..., Y] - origins[:, Y].reshape(shape)
    result[..., X], result[..., Y] = dx * c + dy * s, dy * c - dx * s
    for column in (THETA, HEAD):
        if rows.shape[-1] > column:
            result[..., column] = wrap_angles(rows[..., column] - origins[:, THETA].reshape(shape))
    if rows.shape[-1] > VY:
        vx, vy = rows[..., VX], rows[..., VY]
        result[..., VX], result[..., VY] = vx * c + vy * s, vy * c - vx * s
    return result
