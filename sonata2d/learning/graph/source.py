"""The data of a graph: observations of a recorded or a running episode, and the static nodes of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ...core.doors import leaf_lines
from ...core.entities import Interaction
from ...core.geometry import Disc
from ...core.humans import frozen
from ...core.portable_math import Array, BoolArray, IntArray, arctan2, unit_vectors
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.vectors import lengths
from ...errors import RecordError
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
        goal: (3,), x, y, theta.
        openings: (D,), of the interior doors that move.
    """

    tick: int
    robot: Array
    humans: Array
    present: BoolArray
    interactions: tuple[Interaction, ...]
    goal: Array
    openings: Array


def observation_of(snapshot: Snapshot) -> Observation:
    """Return the observation of a snapshot of a running episode."""
    from .kernels import observe  # imported late: reading files needs no compiler

    robot, humans, count = snapshot.robot, snapshot.humans, len(snapshot.scene.humans)
    rows, present = np.empty((count, len(HUMAN_NAMES))), np.empty(count, dtype=bool)
    robot_row = np.empty(len(ROBOT_NAMES))
    robot_state = (*robot.position, *robot.direction, *robot.velocity, robot.omega)
    observe(humans.state, _all_rows(count) if humans.row is None else humans.row, robot_state, rows, present, robot_row)
    goal, doors = snapshot.goal, snapshot.doors if snapshot.scene.interior_doors else ()
    return Observation(
        snapshot.tick, frozen(robot_row), frozen(rows), frozen(present), snapshot.interactions,
        np.array([goal.x, goal.y, goal.theta]), np.array([each.opening for each in doors if each.door.moves]),
    )  # fmt: skip


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
        goal=record.goals[tick],
        openings=states.doors[tick],
    )


def require_task(record: EpisodeRecord) -> None:
    """Require a recorded robot and a goal: graphs describe the task of the robot.

    Raises:
        RecordError: the source of an imported episode has none.
    """
    missing = sorted({"robot", "goal"} & record.scene().unmeasured)
    if missing:
        raise RecordError(f"{record.path}: graphs need a robot and a goal; not in its source: {', '.join(missing)}")


class SceneNodes:
    """The nodes of all graphs of a scene, prepared once.

    Args:
        scene: of the episode.

    Attributes:
        radius, shoulder: (H,), of all pedestrians, m; see `Humans`.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        leaves = [door.leaf(door.opening)[:2] for door in scene.interior_doors if not door.moves]
        ends = [*((wall.start, wall.end) for wall in scene.walls), *leaves]
        indices, pieces = wall_pieces(np.array(ends, dtype=float).reshape(-1, 4))
        doors = scene.moving_doors  # each of their leaves is one piece, after those of walls
        self._wall_indices = (*indices, *range(len(ends), len(ends) + len(doors)))
        self._pieces = np.concatenate((pieces, np.zeros((len(doors), 4))))
        self._fixed = np.concatenate((_object_and_goal_rows(scene), _wall_rows(self._pieces)))
        self._changes = scene.goal.moves or bool(doors)
        self.radius, self.shoulder = scene.human_table.radius, scene.human_table.shoulder
        self._nodes: tuple[bytes, Nodes] | None = None  # of the last observations, by presence

    def at(self, observation: Observation) -> tuple[Array, Array]:
        """The nodes that are no pedestrians, at a tick.

        Returns:
            (O + 1 + M, 12), objects, goal, and pieces of walls and leaves of doors: x, y, theta, zero velocity,
            direction of the head, size, radius, unit vector of theta; world frame; and (M, 4), ends of the pieces, m.
        """
        if not self._changes:
            return self._fixed, self._pieces
        rows, pieces, doors = self._fixed.copy(), self._pieces.copy(), self.scene.moving_doors
        goal = len(self.scene.furniture)
        rows[goal, ROW_X : ROW_THETA + 1], rows[goal, ROW_HEAD] = observation.goal, observation.goal[ROW_THETA]
        rows[goal, AXIS_X : AXIS_Y + 1] = unit_vectors(observation.goal[ROW_THETA:])[0]
        if doors:
            pieces[-len(doors) :] = leaf_lines(doors, observation.openings[None])[0, :, :4]
            rows[-len(doors) :] = _wall_rows(pieces[-len(doors) :], [door.pose.theta for door in doors])
        return rows, pieces

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


def _wall_rows(pieces: Array, theta: Any = 0.0) -> Array:
    """Rows of `SceneNodes.at` of pieces of walls, (M, 4), m; `theta` is the direction of those without length, rad."""
    along, size = pieces[:, 2:] - pieces[:, :2], lengths(pieces[:, 2:] - pieces[:, :2])
    heading = np.where(size > 0.0, arctan2(along[:, 1], along[:, 0]), theta)
    poses = np.column_stack((pieces[:, :2] + along / 2, heading))
    return _fixed_rows(poses, np.column_stack((size, np.zeros(len(pieces)))), np.zeros(len(pieces)))


def _fixed_rows(poses: Any, sizes: Any, radius: Any) -> Array:
    """Rows of `SceneNodes.fixed` of n nodes, from (n, 3), (n, 2) and (n,)."""
    rows = np.zeros((len(radius), COLUMNS))
    rows[:, ROW_X : ROW_THETA + 1] = np.reshape(poses, (-1, 3))
    rows[:, ROW_HEAD] = rows[:, ROW_THETA]
    rows[:, LENGTH : WIDTH + 1] = np.reshape(sizes, (-1, 2))
    rows[:, RADIUS] = radius
    rows[:, AXIS_X : AXIS_Y + 1] = unit_vectors(rows[:, ROW_THETA])
    return rows
