"""Variants of a recorded motion: measurement noise and subsampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.humans import frozen
from ..core.portable_math import Array
from ..core.vectors import wrap_angles
from .motion import Motion


def with_pose_noise(
    motion: Motion, seed: int | Sequence[int], *, position: float = 0.05, angle: float = 0.05
) -> Motion:
    """People's poses with normal errors, independent of one another and from look to look.

    Velocities, the robot and what stands still stay exact. The same seed gives the same errors with every release of
    NumPy, to the last bits of its logarithm and cosine.

    Args:
        motion: in any frame of reference.
        seed: of the errors, 0 or more; give [seed, episode] where many episodes must not share their errors.
        position: m, standard deviation of x and of y.
        angle: rad, standard deviation of theta and of head.

    Raises:
        ValueError: a deviation is negative or not finite.
    """
    for name, value in (("position", position), ("angle", angle)):
        if not 0.0 <= value < np.inf:
            raise ValueError(f"{name} must be a standard deviation, 0 or more, got {value}")
    errors = _normal(seed, (*motion.humans.shape[:2], 4))
    humans = motion.humans.copy()
    humans[..., 0:2] += position * errors[..., 0:2]
    for column, k in ((2, 2), (6, 3)):
        humans[..., column] = wrap_angles(humans[..., column] + angle * errors[..., k])
    return replace(motion, humans=frozen(humans))


def _normal(seed: int | Sequence[int], shape: tuple[int, ...]) -> Array:
    """Normal numbers of mean 0 and deviation 1, by Box and Muller, from raw numbers whose stream NumPy promises."""
    count = int(np.prod(shape))
    raw: Any = np.random.PCG64(np.random.SeedSequence(seed)).random_raw(2 * count)
    u = (raw >> np.uint64(11)) * 2.0**-53
    normal: Array = np.sqrt(-2.0 * np.log(1.0 - u[:count])) * np.cos(2.0 * np.pi * u[count:])
    return normal.reshape(shape)


_LOOKS = ("time", "robot", "humans", "present", "activity", "goal", "walls", "objects", "interactions")


def subsampled(motion: Motion, every: int) -> Motion:
    """Every so many-th look, from the first; what comes after the last whole span is left out.

    Poses and velocities are those of the looks that stay. `command` and labels are what was answered at these looks;
    `executed` is the mean of what the drive carried out from one to the next.

    Args:
        motion: T frames, in any frame of reference.
        every: how many ticks make one; 1 changes nothing.

    Returns:
        T // every frames.

    Raises:
        ValueError: every is below 1, or longer than the motion.
    """
    if every < 1 or every > len(motion):
        raise ValueError(f"every must be 1 to {len(motion)}, the frames there are, got {every}")
    count = len(motion) // every
    spans = slice(0, count * every + 1, every)
    starts = slice(0, count * every, every)
    return replace(
        motion,
        dt=motion.dt * every,
        **{key: getattr(motion, key)[spans] for key in _LOOKS},
        command=motion.command[starts],
        executed=frozen(np.mean(motion.executed[: count * every].reshape(count, every, 3), axis=1)),
        labels=motion.labels[starts],
    )
