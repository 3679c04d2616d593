"""The same motion as a tracker might have seen it: people's poses with an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..exact import Array
from ..humans import frozen
from .frames import wrapped_angles
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
        humans[..., column] = wrapped_angles(humans[..., column] + angle * errors[..., k])
    return replace(motion, humans=frozen(humans))


def _normal(seed: int | Sequence[int], shape: tuple[int, ...]) -> Array:
    """Normal numbers of mean 0 and deviation 1, by Box and Muller, from raw numbers whose stream NumPy promises."""
    count = int(np.prod(shape))
    raw: Any = np.random.PCG64(np.random.SeedSequence(seed)).random_raw(2 * count)
    u = (raw >> np.uint64(11)) * 2.0**-53
    normal: Array = np.sqrt(-2.0 * np.log(1.0 - u[:count])) * np.cos(2.0 * np.pi * u[count:])
    return normal.reshape(shape)
