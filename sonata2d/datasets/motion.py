"""An episode as arrays, in one frame of reference or another: what learning takes, and what transforms change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..core.entities import Interaction
from ..core.humans import frozen
from ..core.portable_math import Array
from ..record.layout import interactions_of
from ..record.record import EpisodeRecord

Reference = Literal["world", "goal", "robot"]


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames and the final look, N people, W walls, O things; SI, arrays read-only.

    Velocities are the world's, in the axes of the frame of reference: a frame that moves adds none of its own.

    Attributes:
        reference: what the numbers are seen from.
        dt: s between looks.
        time: (T + 1,), s.
        robot: (T + 1, 6), columns x, y, theta, vx, vy, omega.
        humans: (T + 1, N, 7), the same and head; NaN where not present.
        present: (T + 1, N) of bool.
        activity: (T + 1, N) of int, into `humans.ACTIVITIES`; -1 where not present.
        goal: (T + 1, 3), columns x, y, theta.
        walls: (T + 1, W, 4), columns x1, y1, x2, y2.
        objects: (T + 1, O, 3), columns x, y, theta, in the scene's order.
        command, executed: (T, 3), columns vx, vy, omega; body frame, whatever the frame of reference.
        interactions: of each look.
        labels: of each frame; the command where there is none.
    """

    reference: Reference
    dt: float
    time: Array
    robot: Array
    humans: Array
    present: Any
    activity: Any
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
    """A recorded episode as arrays, world frame."""
    scene, looks = record.scene(), record.looks
    told = [*record.document["frames"], record.document["final"]]
    goal = np.array([scene.goal.x, scene.goal.y, scene.goal.theta], dtype=float)
    walls = np.array([[*wall.start, *wall.end] for wall in scene.walls], dtype=float).reshape(-1, 4)
    poses = [[thing.pose.x, thing.pose.y, thing.pose.theta] for thing in scene.furniture]
    objects = np.array(poses, dtype=float).reshape(-1, 3)
    return Motion(
        reference="world",
        dt=scene.rules.dt,
        time=looks.time,
        robot=looks.robot,
        humans=looks.humans,
        present=looks.present,
        activity=looks.activity,
        goal=_at_each_look(goal, len(told)),
        walls=_at_each_look(walls, len(told)),
        objects=_at_each_look(objects, len(told)),
        command=record.command,
        executed=record.executed,
        interactions=tuple(interactions_of(look["interactions"]) for look in told),
        labels=tuple(record.labels),
    )


def _at_each_look(rows: Array, looks: int) -> Array:
    """What stands still, seen at each look; (…) to (looks, …)."""
    return frozen(np.broadcast_to(rows, (looks, *rows.shape)).copy())
