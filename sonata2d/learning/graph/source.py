"""What graphs are made from: looks, of a recorded episode or of one that is under way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.entities import Interaction
from ...core.geometry import Disc
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...record.layout import interactions_of
from ...record.record import EpisodeRecord


@dataclass(frozen=True, eq=False)
class Look:
    """The world at a tick; N people of the scene, SI, world frame.

    Attributes:
        robot: (6,), columns x, y, theta, vx, vy, omega.
        humans: (N, 7), the same and head; NaN where not present.
        present: (N,) of bool.
        ties: the interactions as they stand.
    """

    tick: int
    robot: Array
    humans: Array
    present: Any
    ties: tuple[Interaction, ...]


def look_of(snapshot: Snapshot) -> Look:
    """A snapshot as a look."""
    robot, humans, count = snapshot.robot, snapshot.humans, len(snapshot.scene.humans)
    rows = np.column_stack((humans.position, humans.theta, humans.velocity, humans.omega, humans.head))
    return Look(
        tick=snapshot.tick,
        robot=np.array([*robot.position, robot.pose.theta, *robot.velocity, robot.omega]),
        humans=humans.among_all(rows, count, np.nan),
        present=humans.among_all(np.ones(len(humans), dtype=bool), count, False),
        ties=snapshot.interactions,
    )


def recorded_look(record: EpisodeRecord, tick: int) -> Look:
    """The look at a frame of a record, counted from 0; T is the final one."""
    looks, document = record.looks, record.document
    told = document["frames"][tick] if tick < len(record) else document["final"]
    return Look(
        tick=tick,
        robot=looks.robot[tick],
        humans=looks.humans[tick],
        present=looks.present[tick],
        ties=interactions_of(told["interactions"]),
    )


def people_at(looks: list[Look]) -> Any:
    """Indices of the people who are there at every one of the looks: nodes of different instants must match."""
    return np.flatnonzero(np.logical_and.reduce([look.present for look in looks]))


def thing_poses(scene: Scene) -> Array:
    """(O, 3), x, y, theta of the furniture, m, m, rad, world frame."""
    poses = [(thing.pose.x, thing.pose.y, thing.pose.theta) for thing in scene.furniture]
    return np.array(poses, dtype=float).reshape(-1, 3)


def thing_sizes(scene: Scene) -> Array:
    """(O, 2), m: lengths along a thing's own x and y."""
    shapes = [thing.shape for thing in scene.furniture]
    sizes = [(2 * s.radius, 2 * s.radius) if isinstance(s, Disc) else (s.length, s.width) for s in shapes]
    return np.array(sizes, dtype=float).reshape(-1, 2)


def wall_ends(scene: Scene) -> Array:
    """(W, 4), x1, y1, x2, y2, m, world frame."""
    return np.array([(*wall.start, *wall.end) for wall in scene.walls], dtype=float).reshape(-1, 4)
