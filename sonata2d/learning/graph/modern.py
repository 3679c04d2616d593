"""Graphs with the structure of the paper's, but features in SI units: exact velocities, heads, sizes, gaps.

The hub is the robot instead of the room: otherwise a graph in the world frame would not hold the robot's pose.
`inputs_of` scales the features for a network.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ...core.portable_math import Array, IntArray, arctan2, exp, unit_vectors
from ...core.scene import Scene
from ...record.record import EpisodeRecord
from .graph import INTERVAL, NODE_TYPES, Graph, NodeOrder, all_edges, wall_pieces
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

MODERN_FEATURES = (
    *(f"is_{kind}" if kind != "room" else "is_robot" for kind in NODE_TYPES),
    "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
    "near_x", "near_y", "gap",
)  # fmt: skip
_COLUMN = {name: k for k, name in enumerate(MODERN_FEATURES)}
# Columns of `_solids` and `_goal_and_walls`: x, y, theta, vx, vy, omega, head, length, width, radius.
_POSITION, _VELOCITY, _TURN_RATE, _HEAD, _SIZE, _RADIUS = slice(0, 2), slice(3, 5), 5, 6, slice(7, 9), 9

FRAMES = ("world", "robot", "goal")


def modern_graph(
    record: EpisodeRecord,
    tick: int,
    *,
    frame: Literal["world", "robot", "goal"] = "robot",
    instants: int = 3,
    interval: float = INTERVAL,
) -> Graph:
    """Return the graph of a recorded tick and earlier ones; see `graph_of_observations` for the features.

    Args:
        record: an episode of T frames.
        tick: of the newest instant, 0 to T; at T, the final state, the label is None.
        frame: frame of reference: `world`; `robot`, the robot's pose, x ahead; `goal`, at the goal, x in the direction
            from the robot's start to the goal.
        instants: number of instants, 1 or more; fewer are returned near the start of the episode.
        interval: time between instants, s; a multiple of the tick length.

    Returns:
        A graph labelled with the label of the frame, or with its command [vx, vy, omega] if it has no label.

    Raises:
        ValueError: tick, frame, instants or interval is out of range.
    """
    if frame not in FRAMES:
        raise ValueError(f"frame must be one of {', '.join(FRAMES)}, got {frame!r}")
    observations = [recorded_observation(record, at) for at in _ticks(record, tick, instants, interval)]
    scene, origin = record.scene(), np.zeros(3)
    if frame == "robot":
        origin = observations[0].robot[POSE]
    elif frame == "goal":
        goal, start = scene.goal, record.states.robot[0]
        origin = np.array([goal.x, goal.y, float(arctan2(goal.y - start[1], goal.x - start[0]))])
    label = record.labels[tick] if tick < len(record) else None
    return graph_of_observations(scene, observations, origin, label=label)


def graph_of_observations(
    scene: Scene, observations: Sequence[Observation], origin: Array, *, label: Any = None
) -> Graph:
    """Return the graph of observations of a recorded or a running episode.

    Nodes and edges are those of the paper, with the robot in the place of the room; the pedestrians are those who are
    present at every instant. Features: node type; age, s before the newest instant; position, m; direction; velocity,
    m/s and rad/s; direction of the head; length and width, m; the point of the outline that is nearest to the robot,
    m; and the gap between the outlines, m. Static nodes have zero velocity; the head of a node without a head faces
    ahead; a wall node has the length and the direction of its piece; the size of the goal is the distance at which it
    is reached.

    Args:
        scene: of the episode.
        observations: one or more, the newest first.
        origin: (3,), x, y, theta of the frame of reference of all instants, world frame.
        label: label of the graph.
    """
    present = always_present([*observations])
    wall_indices, pieces = wall_pieces(wall_ends(scene))
    nodes = NodeOrder(tuple(scene.humans[k].id for k in present), tuple(f.id for f in scene.furniture), wall_indices)
    dt, newest = scene.rules.dt, observations[0].tick
    blocks = [
        _features(scene, observation, present, pieces, origin, (newest - observation.tick) * dt)
        for observation in observations
    ]
    types = np.eye(len(NODE_TYPES))[[NODE_TYPES.index(kind) for kind in nodes.types]]
    features = np.concatenate([np.column_stack((types, block)) for block in blocks])
    edges, relation = all_edges(nodes, [observation.interactions for observation in observations])
    return Graph(
        feature_names=MODERN_FEATURES,
        features=features,
        node_type=np.array([NODE_TYPES.index(kind) for kind in nodes.types] * len(observations)),
        entity=np.array(nodes.entities * len(observations)),
        position=features[:, _COLUMN["x"] : _COLUMN["y"] + 1].copy(),
        instant=np.repeat(np.arange(len(observations)), len(nodes)),
        edges=edges,
        relation=relation,
        label=label,
        ticks=tuple(observation.tick for observation in observations),
    )


def _ticks(record: EpisodeRecord, tick: int, instants: int, interval: float) -> list[int]:
    """Ticks of the instants, the newest first."""
    dt = record.scene().rules.dt
    step = round(interval / dt) if 0.0 < interval < float("inf") else 0
    if not 0 <= tick <= len(record):
        raise ValueError(f"tick must be 0 to {len(record)}, got {tick}")
    if instants < 1 or step < 1 or abs(step * dt - interval) > 1e-6:
        raise ValueError(
            f"instants must be 1 or more, got {instants}; interval must be a multiple of {dt} s, got {interval}"
        )
    return [at for at in (tick - i * step for i in range(instants)) if at >= 0]


def _features(
    scene: Scene, observation: Observation, present: IntArray, pieces: Array, origin: Array, age: float
) -> Array:
    """(N, 15): all features but the type, for robot, pedestrians, objects, goal and walls of one instant."""
    bodies = np.concatenate([*_solids(scene, observation, present), _goal_and_walls(scene, pieces)])
    poses, size, radius = bodies[:, POSE], bodies[:, _SIZE], bodies[:, _RADIUS]
    near, gap = _nearest_points(poses, size, radius, observation.robot, scene.robot.radius)
    axes, direction, head = (
        unit_vectors(origin[THETA : THETA + 1])[0],
        unit_vectors(poses[:, THETA] - origin[THETA]),
        unit_vectors(bodies[:, _HEAD] - origin[THETA]),
    )
    position, nearest = (_rotate(points - origin[_POSITION], axes) for points in (bodies[:, _POSITION], near))
    velocity = np.column_stack((_rotate(bodies[:, _VELOCITY], axes), bodies[:, _TURN_RATE]))
    return np.column_stack((np.full(len(bodies), age), position, direction, velocity, head, size, nearest, gap))


def _solids(scene: Scene, observation: Observation, present: IntArray) -> tuple[Array, Array, Array]:
    """Rows of the robot, (1, 10), of P pedestrians, (P, 10), and of O objects, (O, 10)."""
    humans, furniture = observation.humans[present], furniture_poses(scene)
    human_radius = np.array([scene.humans[k].radius for k in present], dtype=float)
    # 0 for rectangles, whose corners `_nearest_points` computes from the size.
    object_radius = np.array([getattr(thing.shape, "radius", 0.0) for thing in scene.furniture], dtype=float)
    robot, radius = observation.robot, scene.robot.radius
    still = np.zeros((len(furniture), 3))
    return (
        np.array([[*robot, robot[THETA], 2 * radius, 2 * radius, radius]]),
        np.column_stack((humans, 2 * human_radius, 2 * human_radius, human_radius)),
        np.column_stack((furniture, still, furniture[:, THETA], furniture_sizes(scene), object_radius)),
    )


def _goal_and_walls(scene: Scene, pieces: Array) -> Array:
    """Rows of the goal and of the pieces of walls, (1 + M, 10)."""
    along, goal = pieces[:, 2:] - pieces[:, :2], scene.goal
    theta = arctan2(along[:, 1], along[:, 0])
    length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])
    zero = np.zeros((len(pieces), 1))
    walls = np.column_stack((pieces[:, :2] + along / 2, theta, zero, zero, zero, theta, length, zero, zero))
    size = 2 * goal.distance
    return np.concatenate(([[goal.x, goal.y, goal.theta, 0, 0, 0, goal.theta, size, size, goal.distance]], walls))


def _nearest_points(poses: Array, size: Array, radius: Array, robot: Array, robot_radius: float) -> tuple[Array, Array]:
    """Points of the outlines that are nearest to the robot's centre, (N, 2), and gaps between outlines, (N,).

    Args:
        poses: (N, 3), world frame; the first row is the robot's.
        size: (N, 2), length and width, m.
        radius: (N,), m; 0 for rectangles and walls.
        robot: (6,), state of the robot.
        robot_radius: m.
    """
    axes = unit_vectors(poses[:, THETA])
    dx, dy = robot[0] - poses[:, 0], robot[1] - poses[:, 1]
    # Every outline is a core, the centre of a disc or a rectangle, widened by the radius.
    half = np.where(radius[:, None] > 0.0, 0.0, size / 2)
    x = np.minimum(np.maximum(dx * axes[:, 0] + dy * axes[:, 1], -half[:, 0]), half[:, 0])
    y = np.minimum(np.maximum(dy * axes[:, 0] - dx * axes[:, 1], -half[:, 1]), half[:, 1])
    core = poses[:, :2] + np.column_stack((x * axes[:, 0] - y * axes[:, 1], x * axes[:, 1] + y * axes[:, 0]))
    to_x, to_y = robot[0] - core[:, 0], robot[1] - core[:, 1]
    distance = np.sqrt(to_x * to_x + to_y * to_y)
    scale = (radius / np.where(distance > 0.0, distance, 1.0))[:, None]
    gap = distance - radius - robot_radius
    gap[0] = 0.0
    return core + scale * np.column_stack((to_x, to_y)), gap


def _rotate(rows: Array, axes: Array) -> Array:
    """(n, 2) in axes whose x points along a unit vector."""
    c, s = axes
    return np.column_stack((rows[:, 0] * c + rows[:, 1] * s, rows[:, 1] * c - rows[:, 0] * s))


POSITION_SCALE = 5.0  # m, divides positions and distances
CLOSE, NEAR = 0.5, 2.0  # m, decay lengths of the gaps
LARGEST_DISTANCE = 10.0  # m, gaps and the goal's distance are clipped to it
_HUB, _GOAL = NODE_TYPES.index("room"), NODE_TYPES.index("goal")
INPUTS = (
    *MODERN_FEATURES[:5], "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
    "near_x", "near_y", "to_x", "to_y", "distance", "gap", "close", "near",
    "goal_x", "goal_y", "goal_distance", "own_vx", "own_vy", "own_omega",
)  # fmt: skip


def inputs_of(graph: Graph) -> Array:
    """Return the inputs of a network for a graph.

    The inputs of a graph of the paper are its features. Those of a modern graph in the robot's frame are `INPUTS`: the
    features up to the width, with scaled positions; the directions of a node's nearest point and of its centre; its
    distance; the gap, and exp(-gap / 0.5 m) and exp(-gap / 2 m); and, the same for all nodes, direction and distance
    of the goal, and the robot's velocity.

    Args:
        graph: of the paper, or a modern graph with N nodes in the robot's frame.

    Returns:
        (N, F).
    """
    if graph.feature_names != MODERN_FEATURES:
        return graph.features
    x = graph.features
    position = x[:, _COLUMN["x"] : _COLUMN["y"] + 1]
    distance, to = _length_and_direction(position)
    _, near = _length_and_direction(x[:, _COLUMN["near_x"] : _COLUMN["near_y"] + 1])
    gap = x[:, _COLUMN["gap"]]
    free = np.maximum(gap, 0.0)
    features = x[:, : _COLUMN["near_x"]].copy()
    features[:, _COLUMN["x"] : _COLUMN["y"] + 1] = position / POSITION_SCALE
    derived = np.column_stack(
        (
            near,
            to,
            distance / POSITION_SCALE,
            np.minimum(gap, LARGEST_DISTANCE) / NEAR,
            exp(-free / CLOSE),
            exp(-free / NEAR),
        )
    )
    goal, hub = (int(np.argmax(graph.node_type == kind)) for kind in (_GOAL, _HUB))
    own_velocity = x[hub, _COLUMN["vx"] : _COLUMN["omega"] + 1]
    shared = [*to[goal], min(distance[goal], LARGEST_DISTANCE) / POSITION_SCALE, *own_velocity]
    return np.column_stack((features, derived, np.tile(shared, (len(x), 1))))


def _length_and_direction(vectors: Array) -> tuple[Array, Array]:
    """(n,) lengths and (n, 2) unit vectors; a zero vector has the direction (0, 0)."""
    length = np.sqrt(vectors[:, 0] * vectors[:, 0] + vectors[:, 1] * vectors[:, 1])
    return length, vectors / np.maximum(length, 1e-6)[:, None]
