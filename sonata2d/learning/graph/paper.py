"""Graphs of the SONATA paper: up to three instants a second apart, in the robot frame, 42 features per node.

Positions and velocities are those of the original's recorder: x to the robot's right, y ahead, angles clockwise from
the right; velocities are the previous position minus the current one, each in the robot frame of its own tick.

Source: the SONATA toolkit and its data set; see "Learn from graphs" in docs/how-to.md for what agrees with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ...core.portable_math import Array, IntArray, unit_vector, unit_vectors
from ...core.scene import Scene
from ...core.vectors import wrap_angles
from ...record.record import EpisodeRecord
from .graph import INTERVAL, NODE_TYPES, ROUNDING, Graph, NodeOrder, all_edges, wall_pieces
from .source import (
    POSE,
    THETA,
    Observation,
    always_present,
    furniture_poses,
    furniture_sizes,
    recorded_observation,
    wall_ends,
)

_MOVING = ("x_pos", "y_pos", "a_vel", "x_vel", "y_vel", "orientation_sin", "orientation_cos")
_HUMAN = ("hum_x_pos", "hum_y_pos", "human_a_vel", "human_x_vel", "human_y_vel", "hum_orientation_sin",
          "hum_orientation_cos", "hum_dist", "hum_inv_dist")  # fmt: skip
_OBJECT = tuple(f"obj_{name}" for name in (*_MOVING, "x_size", "y_size", "dist", "inv_dist"))
_ROOM = ("room_humans", "room_humans2")
_WALL = tuple(f"wall_{name}" for name in ("x_pos", "y_pos", *_MOVING[5:], "dist", "inv_dist"))
_GOAL = ("goal_x_pos", "goal_y_pos", "goal_dist", "goal_inv_dist")
_INSTANT, _TIME = ("is_t_0", "is_t_m1", "is_t_m2"), ("is_first_frame", "time_left")  # of all nodes
FEATURES = (*NODE_TYPES, *_INSTANT, *_TIME, *_HUMAN, *_OBJECT, *_ROOM, *_WALL, *_GOAL)

INSTANTS = 3
LABEL_SIGNS = np.array([1.0, -1.0, -1.0])  # labels point right and clockwise, twists left and counter-clockwise
SCALE = 10.0  # m, m/tick, rad/tick: divides positions and velocities
CROWD = 15.0  # pedestrians: divides their number


def kept_ticks(time: Array, interval: float = INTERVAL) -> list[int]:
    """Select ticks that are at least `interval` apart: the first, then each that is long enough after the last one.

    Args:
        time: (T,), s.
        interval: s.
    """
    kept = [0] if len(time) else []
    for tick in range(1, len(time)):
        if time[tick] - time[kept[-1]] >= interval - ROUNDING:
            kept.append(tick)
    return kept


def paper_graphs(record: EpisodeRecord) -> list[Graph]:
    """Return the graphs of an episode in order: one for each kept tick but the first, with up to two earlier ones.

    The first kept tick is in no graph, as it has no velocities. So graph j has min(j + 1, 3) instants.
    The label is the label of the frame if that is a twist, else the command, as fractions of the robot's limits: ahead,
    right, clockwise.

    Args:
        record: an episode; one that is shorter than a second gives no graphs.
    """
    kept, scene, labels = kept_ticks(record.time), record.scene(), record.labels
    observation = cache(lambda tick: recorded_observation(record, tick))
    graphs = []
    for j in range(1, len(kept)):
        ticks = kept[max(j - INSTANTS + 1, 1) : j + 1][::-1]
        label = command_fractions(scene, labels[ticks[0]], record.command[ticks[0]])
        pairs = [(observation(tick), observation(tick - 1)) for tick in ticks]
        graphs.append(paper_graph(scene, pairs, is_first=ticks[-1] == kept[1], label=label))
    return graphs


def paper_graph(
    scene: Scene,
    instants: Sequence[tuple[Observation, Observation]],
    *,
    is_first: bool = False,
    label: Array | None = None,
) -> Graph:
    """Return the graph of one to three instants of a recorded or a running episode.

    `is_first_frame` marks the oldest instant if `is_first`; `time_left` is 1 / (tick + 1); both are the same for all
    nodes of an instant. The pedestrians are those who are present at every instant and at the ticks before.

    Args:
        scene: of the episode.
        instants: the newest first: each observation with that of the tick before, from which velocities are computed.
        is_first: whether the oldest instant is the first of the episode.
        label: label of the graph.

    Returns:
        For k instants, P pedestrians, O objects, M wall nodes and I interactions each: N = 2 + P + O + M nodes and
        1 + 3 (N - 1) + 2 I edges per instant, and 2 (k - 1) N edges between them.
    """
    present = always_present([observation for pair in instants for observation in pair])
    wall_indices, pieces = wall_pieces(wall_ends(scene))
    nodes = NodeOrder(tuple(scene.humans[k].id for k in present), tuple(f.id for f in scene.furniture), wall_indices)
    builder = _FeatureBuilder(scene, nodes, present, pieces)
    oldest = len(instants) - 1
    blocks = [builder.features(i, *pair, is_first=is_first and i == oldest) for i, pair in enumerate(instants)]
    edges, relation = all_edges(nodes, [current.interactions for current, _ in instants])
    return Graph(
        feature_names=FEATURES,
        features=np.concatenate(blocks),
        node_type=np.array([NODE_TYPES.index(kind) for kind in nodes.types] * len(instants)),
        entity=np.array(nodes.entities * len(instants)),
        position=np.concatenate([builder.position(current) for current, _ in instants]),
        instant=np.repeat(np.arange(len(instants)), len(nodes)),
        edges=edges,
        relation=relation,
        label=label,
        ticks=tuple(current.tick for current, _ in instants),
    )


def command_fractions(scene: Scene, label: Any, command: Array) -> Array:
    """Return a twist as fractions of the robot's limits.

    Args:
        scene: of the episode.
        label: of the frame; used as the twist if it is three numbers.
        command: (3,), used otherwise.

    Returns:
        (3,), ahead, right, clockwise.
    """
    limits, values = scene.robot.limits, np.asarray(label)
    twist = values if values.shape == (3,) and values.dtype.kind in "fi" else command
    return np.asarray(twist * (LABEL_SIGNS / np.array([limits.ahead, limits.sideways, limits.turn])), dtype=float)


def to_robot_frame(points: Array, pose: Array) -> Array:
    """Transform world points into the frame of a pose with x to the right and y ahead; (n, 2) and (3,) to (n, 2)."""
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    c, s = unit_vector(float(pose[THETA]))
    return np.column_stack((dx * s - dy * c, dx * c + dy * s))


def _poses_in_robot_frame(poses: Array, robot: Array) -> Array:
    """(n, 3), x, y, theta, in the original's robot frame: x, y, and the angle clockwise from the right."""
    angle = -wrap_angles(poses[:, THETA] - robot[THETA] + np.pi / 2)
    return np.column_stack((to_robot_frame(poses, robot), angle))


@dataclass(frozen=True, eq=False)
class _FeatureBuilder:
    """Computes features and positions of the nodes of an instant.

    Attributes:
        scene: of the episode.
        nodes: their order.
        present: (P,), indices of the pedestrians that are nodes.
        pieces: (M, 4), ends of the pieces of walls, m, world frame.
    """

    scene: Scene
    nodes: NodeOrder
    present: IntArray
    pieces: Array

    def features(self, instant: int, current: Observation, before: Observation, *, is_first: bool) -> Array:
        """(N, 42)."""
        humans, goal = len(self.nodes.humans), self.nodes.goal
        rows = np.zeros((len(self.nodes), len(FEATURES)))
        types = [NODE_TYPES.index(kind) for kind in self.nodes.types]
        rows[np.arange(len(rows)), types] = 1.0
        _fill(rows, slice(None), _INSTANT[instant : instant + 1], np.ones((len(rows), 1)))
        _fill(rows, slice(None), _TIME, np.array([[float(is_first), 1.0 / (current.tick + 1)]]))
        moving = self._moving(current, before)
        _fill(rows, slice(1, 1 + humans), _HUMAN, moving[:humans])
        objects = np.concatenate((moving[humans:, :7], furniture_sizes(self.scene), moving[humans:, 7:]), axis=1)
        _fill(rows, slice(1 + humans, goal), _OBJECT, objects)
        crowding = humans / CROWD
        _fill(rows, slice(0, 1), _ROOM, np.array([[crowding, crowding * crowding]]))
        _fill(rows, slice(goal, goal + 1), _GOAL, _with_distance(self._goal(current) / SCALE))
        _fill(rows, slice(goal + 1, None), _WALL, self._walls(current))
        return rows

    def position(self, current: Observation) -> Array:
        """(N, 2), m, x to the robot's right, y ahead; the room is at the robot."""
        ends = self._ends(current)
        middle = (ends[:, :2] + ends[:, 2:]) / 2
        bodies = to_robot_frame(self._poses(current), current.robot)
        return np.concatenate((np.zeros((1, 2)), bodies, self._goal(current), middle))

    def _poses(self, observation: Observation) -> Array:
        """(P + O, 3), poses of pedestrians and objects, world frame."""
        return np.concatenate((observation.humans[self.present, POSE], furniture_poses(self.scene)))

    def _goal(self, observation: Observation) -> Array:
        """(1, 2), m, robot frame."""
        return to_robot_frame(np.array([[self.scene.goal.x, self.scene.goal.y]]), observation.robot)

    def _ends(self, observation: Observation) -> Array:
        """(M, 4), ends of the pieces of walls, m, robot frame."""
        return np.concatenate([to_robot_frame(self.pieces[:, k : k + 2], observation.robot) for k in (0, 2)], axis=1)

    def _walls(self, observation: Observation) -> Array:
        """(M, 6), see `_WALL`."""
        ends = self._ends(observation)
        along = ends[:, 2:] - ends[:, :2]
        length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])[:, None]
        middle = _with_distance((ends[:, :2] + ends[:, 2:]) / 2 / SCALE)
        # The unit vector (right, ahead) is the sine and cosine of the angle from straight ahead.
        return np.column_stack((middle[:, :2], along / length, middle[:, 2:]))

    def _moving(self, current: Observation, before: Observation) -> Array:
        """(P + O, 9): position, va, vx, vy, sin, cos, distance and 1 - distance of pedestrians and objects."""
        now = _poses_in_robot_frame(self._poses(current), current.robot)
        change = _poses_in_robot_frame(self._poses(before), before.robot) - now
        change[:, THETA] = wrap_angles(change[:, THETA])
        position, direction = _with_distance(now[:, :2] / SCALE), unit_vectors(now[:, THETA])
        return np.column_stack((position[:, :2], change[:, [2, 0, 1]] / SCALE, direction[:, [1, 0]], position[:, 2:]))


def _with_distance(position: Array) -> Array:
    """(n, 4): the position, its distance, and 1 - distance."""
    distance = np.sqrt(position[:, 0] * position[:, 0] + position[:, 1] * position[:, 1])
    return np.column_stack((position, distance, 1.0 - distance))


def _fill(rows: Array, nodes: slice, names: tuple[str, ...], values: Array) -> None:
    """Write the values of consecutive features of some nodes."""
    start = FEATURES.index(names[0])
    rows[nodes, start : start + len(names)] = values
