"""What graphs are made from: observations of a recorded or a running episode, and the static parts of its scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.entities import Interaction
from ...core.geometry import Disc
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...record.layout import interactions_from_rows
from ...record.record import EpisodeRecord

# Columns of the states of robot and pedestrians: x, y, theta, vx, vy, omega, and for pedestrians head.
THETA, POSE = 2, slice(0, 3)


@dataclass(frozen=True, eq=False)
class Observation:
    """The state at one tick, for N pedestrians of the scene; SI units, world frame.

    Attributes:
        tick: number of the tick.
        robot: (6,), columns x, y, theta, vx, vy, omega.
        humans: (N, 7), the same columns and head; NaN where absent.
        present: (N,).
        interactions: that hold at the tick.
    """

    tick: int
    robot: Array
    humans: Array
    present: BoolArray
    interactions: tuple[Interaction, ...]


def observation_of(snapshot: Snapshot) -> Observation:
    """Return the observation of a snapshot of a running episode."""
    robot, humans, count = snapshot.robot, snapshot.humans, len(snapshot.scene.humans)
    rows = np.column_stack((humans.position, humans.theta, humans.velocity, humans.omega, humans.head))
    return Observation(
        tick=snapshot.tick,
        robot=np.array([*robot.position, robot.pose.theta, *robot.velocity, robot.omega]),
        humans=humans.expand(rows, count, np.nan),
        present=humans.expand(np.ones(len(humans), dtype=bool), count, False),
        interactions=snapshot.interactions,
    )


def recorded_observation(record: EpisodeRecord, tick: int) -> Observation:
    """Return the observation of a recorded tick, 0 to T; T is the final state."""
    states, document = record.states, record.document
    frame = document["frames"][tick] if tick < len(record) else document["final"]
    return Observation(
        tick=tick,
        robot=states.robot[tick],
        humans=states.humans[tick],
        present=states.present[tick],
        interactions=interactions_from_rows(frame["interactions"]),
    )


def always_present(observations: list[Observation]) -> IntArray:
    """Return the indices of the pedestrians who are present in all observations: nodes of all instants must match."""
    return np.flatnonzero(np.logical_and.reduce([observation.present for observation in observations]))


def furniture_poses(scene: Scene) -> Array:
    """Return x, y, theta of the furniture; (O, 3), m, m, rad, world frame."""
    poses = [(thing.pose.x, thing.pose.y, thing.pose.theta) for thing in scene.furniture]
    return np.array(poses, dtype=float).reshape(-1, 3)


def furniture_sizes(scene: Scene) -> Array:
    """Return the lengths of the furniture along its own x and y; (O, 2), m."""
    shapes = [thing.shape for thing in scene.furniture]
    sizes = [(2 * s.radius, 2 * s.radius) if isinstance(s, Disc) else (s.length, s.width) for s in shapes]
    return np.array(sizes, dtype=float).reshape(-1, 2)


def wall_ends(scene: Scene) -> Array:
    """Return x1, y1, x2, y2 of the walls; (W, 4), m, world frame."""
    return np.array([(*wall.start, *wall.end) for wall in scene.walls], dtype=float).reshape(-1, 4)
