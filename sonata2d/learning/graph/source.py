"""The data of a graph: observations of a recorded or a running episode, and the static nodes of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ...core.entities import Interaction
from ...core.geometry import Disc
from ...core.humans import frozen
from ...core.portable_math import Array, BoolArray, IntArray, arctan2, unit_vectors
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from ...errors import RecordError, SceneError
from ...record.layout import HUMAN_NAMES, ROBOT_NAMES, ROW_HEAD, ROW_THETA, ROW_X, interactions_from_rows
from ...record.record import EpisodeRecord
from .features import AXIS_X, AXIS_Y, COLUMNS, LENGTH, RADIUS, WIDTH
from .graph import Nodes, wall_pieces


@dataclass(frozen=True, eq=False)
class Observation:
    """The state at one tick, for N pedestrians of the scene; SI units, world frame; read-only arrays.

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
    from .kernels import observe  # imported late: reading files needs no compiler

    robot, humans, count = snapshot.robot, snapshot.humans, len(snapshot.scene.humans)
    rows, present = np.empty((count, len(HUMAN_NAMES))), np.empty(count, dtype=bool)
    robot_row = np.empty(len(ROBOT_NAMES))
    robot_state = (*robot.position, *robot.direction, *robot.velocity, robot.omega)
    observe(humans.state, _all_rows(count) if humans.row is None else humans.row, robot_state, rows, present, robot_row)
    return Observation(snapshot.tick, frozen(robot_row), frozen(rows), frozen(present), snapshot.interactions)


@cache
def _all_rows(count: int) -> IntArray:
    return frozen(np.arange(count))


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


def require_task(record: EpisodeRecord) -> None:
    """Require a recorded robot and one goal: graphs describe the task of the robot.

    Raises:
        RecordError: the source of an imported episode has none, or the goal moves.
    """
    if record.scene().goal.moves:
        raise RecordError(
            f"{record.path}: graphs have one goal, and that of the task {record.scene().goal.task!r} moves"
        )
    missing = sorted({"robot", "goal"} & record.scene().unmeasured)
    if missing:
        raise RecordError(f"{record.path}: graphs need a robot and a goal; not in its source: {', '.join(missing)}")


class SceneNodes:
    """The nodes of all graphs of a scene, prepared once.

    Args:
        scene: of the episode.

    Attributes:
        fixed: (O + 1 + M, 12), objects, goal and pieces of walls: x, y, theta, zero velocity, direction of the head,
            size, radius, unit vector of theta; world frame.
        pieces: (M, 4), ends of the pieces of walls, m, world frame.
        radius, shoulder: (H,), of all pedestrians, m; see `Humans`.

    Raises:
        SceneError: the scene has interior doors that open and close; walls of graphs do not move.
    """

    def __init__(self, scene: Scene) -> None:
        if scene.moving_doors:
            raise SceneError(f"{scene.title} has doors that open and close, and walls of graphs do not move")
        self.scene = scene
        leaves = [door.leaf(door.opening)[:2] for door in scene.interior_doors]
        ends = [*((wall.start, wall.end) for wall in scene.walls), *leaves]
        walls = np.array(ends, dtype=float).reshape(-1, 4)
        self._wall_indices, self.pieces = wall_pieces(walls)
        self.fixed = frozen(np.concatenate((_object_and_goal_rows(scene), _wall_rows(self.pieces))))
        self.radius, self.shoulder = scene.human_table.radius, scene.human_table.shoulder
        self._nodes: tuple[bytes, Nodes] | None = None  # of the last observations, by presence

    def of(self, observations: Sequence[Observation]) -> Nodes:
        """Return the nodes at some ticks; the pedestrians that are present at all of them have nodes."""
        present = observations[0].present
        for observation in observations[1:]:
            present = present & observation.present
        key = present.tobytes()
        if self._nodes is None or self._nodes[0] != key:
            rows = np.flatnonzero(present)
            humans = [self.scene.humans[k].id for k in rows]
            objects = [thing.id for thing in self.scene.furniture]
            self._nodes = key, Nodes(rows, humans, objects, self._wall_indices)
        return self._nodes[1]


def _object_and_goal_rows(scene: Scene) -> Array:
    """The objects, and the goal as a disc of the distance at which it is reached."""
    goal = scene.goal
    poses = [(thing.pose.x, thing.pose.y, thing.pose.theta) for thing in scene.furniture]
    poses.append((goal.x, goal.y, goal.theta))
    shapes = [*(thing.shape for thing in scene.furniture), Disc(goal.distance)]
    sizes = [shape.sides for shape in shapes]
    return _fixed_rows(poses, sizes, [s.radius if isinstance(s, Disc) else 0.0 for s in shapes])


def _wall_rows(pieces: Array) -> Array:
    along = pieces[:, 2:] - pieces[:, :2]
    poses = np.column_stack((pieces[:, :2] + along / 2, arctan2(along[:, 1], along[:, 0])))
    return _fixed_rows(poses, np.column_stack((lengths(along), np.zeros(len(pieces)))), np.zeros(len(pieces)))


def _fixed_rows(poses: Any, sizes: Any, radius: Any) -> Array:
    """Rows of `SceneNodes.fixed` of n nodes, from (n, 3), (n, 2) and (n,)."""
    rows = np.zeros((len(radius), COLUMNS))
    rows[:, ROW_X : ROW_THETA + 1] = np.reshape(poses, (-1, 3))
    rows[:, ROW_HEAD] = rows[:, ROW_THETA]
    rows[:, LENGTH : WIDTH + 1] = np.reshape(sizes, (-1, 2))
    rows[:, RADIUS] = radius
    rows[:, AXIS_X : AXIS_Y + 1] = unit_vectors(rows[:, ROW_THETA])
    return rows
