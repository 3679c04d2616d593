"""An episode as arrays in one frame of reference, for learning; measurement noise and subsampling of these arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..core.arguments import finite_number
from ..core.doors import leaf_lines
from ..core.entities import Interaction
from ..core.humans import frozen
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.vectors import wrap_angles
from .layout import interactions_from_rows
from .record import EpisodeRecord

Reference = Literal["world", "goal", "robot"]

X, Y, THETA, VX, VY, OMEGA, HEAD = range(7)  # columns of recorded rows; a row of the robot ends with OMEGA


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames and the final state of an episode with N pedestrians, W walls and O objects; SI, read-only arrays.

    Velocities are relative to the world and expressed in the axes of the frame of reference; the motion of the frame
    itself is not subtracted.

    Attributes:
        reference: the frame of reference.
        dt: time between states, s.
        time: (T + 1,), s.
        robot: (T + 1, 6), columns x, y, theta, vx, vy, omega.
        humans: (T + 1, N, 7), the same columns and head; NaN where not present.
        present: (T + 1, N) of bool.
        activity: (T + 1, N) of int, index into `relations.ACTIVITIES`; -1 where not present.
        goal: (T + 1, 3), columns x, y, theta.
        walls: (T + 1, W, 4), columns x1, y1, x2, y2; the leaves of interior doors are the last ones.
        objects: (T + 1, O, 3), columns x, y, theta, in the order of the scene.
        command, executed: (T, 3), columns vx, vy, omega; always in the body frame.
        interactions: for each state.
        labels: for each frame; the command if the episode has no labels.
    """

    reference: Reference
    dt: float
    time: Array
    robot: Array
    humans: Array
    present: BoolArray
    activity: IntArray
    goal: Array
    walls: Array
    objects: Array
    command: Array
    executed: Array
    interactions: tuple[tuple[Interaction, ...], ...]
    labels: tuple[Any, ...]

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.command)


def motion_of(record: EpisodeRecord) -> Motion:
    """The arrays of a recorded episode, world frame."""
    scene, states = record.scene(), record.states
    rows = [*record.document["frames"], record.document["final"]]
    lines = [(*wall.start, *wall.end) for wall in scene.walls]
    lines += [(*start, *end) for start, end, _ in scene.fixed_leaves]
    walls = np.array(lines, dtype=float).reshape(-1, 4)
    moving = leaf_lines(scene.moving_doors, states.doors)[..., :4]
    poses = [[thing.pose.x, thing.pose.y, thing.pose.theta] for thing in scene.furniture]
    objects = np.array(poses, dtype=float).reshape(-1, 3)
    return Motion(
        reference="world",
        dt=scene.rules.dt,
        time=states.time,
        robot=states.robot,
        humans=states.humans,
        present=states.present,
        activity=states.activity,
        goal=record.goals,
        walls=frozen(np.concatenate((_repeated(walls, len(rows)), moving), axis=1)),
        objects=_repeated(objects, len(rows)),
        command=record.command,
        executed=record.executed,
        interactions=tuple(interactions_from_rows(row["interactions"]) for row in rows),
        labels=tuple(record.labels),
    )


def _repeated(values: Array, count: int) -> Array:
    """Values of static things, repeated for each state; (...) to (count, ...)."""
    return frozen(np.broadcast_to(values, (count, *values.shape)).copy())


def with_pose_noise(
    motion: Motion, seed: int | Sequence[int], *, position: float = 0.05, angle: float = 0.05
) -> Motion:
    """Add independent normal errors to the poses of the pedestrians in every state.

    Velocities, the robot and static things stay exact. The same seed gives the same errors with every release of NumPy,
    up to the last bits of its logarithm and cosine.

    Args:
        motion: in any frame of reference.
        seed: seed of the errors, 0 or more; [seed, episode] gives each episode errors of its own.
        position: standard deviation of x and of y, m.
        angle: standard deviation of theta and of head, rad.

    Raises:
        ValueError: a standard deviation is negative or not finite.
    """
    position, angle = finite_number("position", position, 0.0), finite_number("angle", angle, 0.0)
    errors = _normal(seed, (*motion.humans.shape[:2], 4))
    humans = motion.humans.copy()
    humans[..., X : Y + 1] += position * errors[..., 0:2]
    for column, k in ((THETA, 2), (HEAD, 3)):
        humans[..., column] = wrap_angles(humans[..., column] + angle * errors[..., k])
    return replace(motion, humans=frozen(humans))


def _normal(seed: int | Sequence[int], shape: tuple[int, ...]) -> Array:
    """Standard normal numbers by the Box-Muller transform of raw PCG64 output, whose stream NumPy guarantees."""
    count = int(np.prod(shape))
    raw: Any = np.random.PCG64(np.random.SeedSequence(seed)).random_raw(2 * count)
    u = (raw >> np.uint64(11)) * 2.0**-53
    normal: Array = np.sqrt(-2.0 * np.log(1.0 - u[:count])) * np.cos(2.0 * np.pi * u[count:])
    return normal.reshape(shape)


_PER_STATE = ("time", "robot", "humans", "present", "activity", "goal", "walls", "objects", "interactions")


def subsampled(motion: Motion, every: int) -> Motion:
    """Keep every k-th state from the first; states after the last complete step are dropped.

    `command` and labels belong to the kept states. `executed` is the mean over the ticks up to the next kept state.

    Args:
        motion: T frames, in any frame of reference.
        every: number of ticks that become one; 1 changes nothing.

    Returns:
        T // every frames.

    Raises:
        ValueError: `every` is below 1 or above the number of frames.
    """
    if every < 1 or every > len(motion):
        raise ValueError(f"every must be 1 to {len(motion)}, the number of frames, got {every}")
    count = len(motion) // every
    states = slice(0, count * every + 1, every)
    frames = slice(0, count * every, every)
    return replace(
        motion,
        dt=motion.dt * every,
        **{key: getattr(motion, key)[states] for key in _PER_STATE},
        command=motion.command[frames],
        executed=frozen(np.mean(motion.executed[: count * every].reshape(count, every, 3), axis=1)),
        labels=motion.labels[frames],
    )
