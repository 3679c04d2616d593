"""The same motion seen from elsewhere: from the goal, from the robot, from anywhere."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ..core.humans import frozen
from ..core.portable_math import Array, arctan2, unit_vectors
from ..core.vectors import wrap_angles
from .motion import Motion, Reference

_TURN = 2 * np.pi


def seen_from(motion: Motion, origin: Any, reference: Reference) -> Motion:
    """A motion as it is seen from a pose of its own frame of reference, or from one for each look.

    Args:
        motion: as it is seen now.
        origin: (3,) or (T + 1, 3), columns x, y, theta: where the new frame's origin lies, and its x axis points.
        reference: what to call the new frame.

    Raises:
        ValueError: origin has another shape, or is not finite.
    """
    looks = len(motion.robot)
    origins = np.array(origin, dtype=float)
    if origins.shape not in ((3,), (looks, 3)) or not np.isfinite(origins).all():
        raise ValueError(f"origin must be finite, of shape (3,) or ({looks}, 3), got shape {origins.shape}")
    origins = np.broadcast_to(origins, (looks, 3))
    axes = unit_vectors(origins[:, 2])
    starts, ends = (_poses(motion.walls[..., k : k + 2], origins, axes) for k in (0, 2))
    return replace(
        motion,
        reference=reference,
        robot=frozen(_poses(motion.robot, origins, axes)),
        humans=frozen(_poses(motion.humans, origins, axes)),
        goal=frozen(_poses(motion.goal, origins, axes)),
        walls=frozen(np.concatenate((starts, ends), axis=-1)),
        objects=frozen(_poses(motion.objects, origins, axes)),
    )


def goal_frame(motion: Motion, centre: Literal["goal", "robot"] = "goal") -> Motion:
    """The motion seen along the way to the goal.

    Args:
        motion: in any frame of reference that does not move.
        centre: `goal`: the origin is the goal, x points there from the robot's first place, and nothing moves that
            stands; `robot`: at each look the origin is the robot, and x points to the goal.

    Where robot and goal coincide x stays as it is.

    Source: of `robot`, Y. F. Chen et al., ICRA 2017 (CADRL), the robot-centric frame.
    """
    there = motion.goal[:, :2] - motion.robot[:, :2]
    along = arctan2(there[:, 1], there[:, 0])
    if centre == "robot":
        return seen_from(motion, np.column_stack((motion.robot[:, :2], along)), "goal")
    return seen_from(motion, np.array([*motion.goal[0, :2], along[0]]), "goal")


def robot_frame(motion: Motion) -> Motion:
    """The motion seen by the robot: at each look the origin is the robot, x is ahead and y to its left."""
    return seen_from(motion, motion.robot[:, :3], "robot")


def world_frame(motion: Motion, origin: Any) -> Motion:
    """The inverse of `seen_from`, to rounding.

    Args:
        motion: as it is seen from `origin`.
        origin: as it was given.
    """
    origins = np.array(origin, dtype=float).reshape(-1, 3)
    axes = unit_vectors(origins[:, 2])
    x, y = origins[:, 0], origins[:, 1]
    back = np.column_stack((-(x * axes[:, 0] + y * axes[:, 1]), x * axes[:, 1] - y * axes[:, 0], -origins[:, 2]))
    return seen_from(motion, back if np.ndim(origin) > 1 else back[0], "world")


def _poses(rows: Array, origins: Array, axes: Array) -> Array:
    """Rows x, y (theta (vx, vy, omega (head))) seen from the origins; (looks, …, columns)."""
    shape = (len(rows),) + (1,) * (rows.ndim - 2)
    c, s = axes[:, 0].reshape(shape), axes[:, 1].reshape(shape)
    seen = rows.copy()
    dx, dy = rows[..., 0] - origins[:, 0].reshape(shape), rows[..., 1] - origins[:, 1].reshape(shape)
    seen[..., 0], seen[..., 1] = dx * c + dy * s, dy * c - dx * s
    for k in (2, 6):
        if rows.shape[-1] > k:
            seen[..., k] = wrap_angles(rows[..., k] - origins[:, 2].reshape(shape))
    if rows.shape[-1] > 4:
        vx, vy = rows[..., 3], rows[..., 4]
        seen[..., 3], seen[..., 4] = vx * c + vy * s, vy * c - vx * s
    return seen
