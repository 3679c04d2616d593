"""The same motion at a slower pace of looking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..humans import frozen
from .motion import Motion

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
