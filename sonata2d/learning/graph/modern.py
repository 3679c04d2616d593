"""Graphs with the structure of the paper's, but features in SI units: exact velocities, heads, sizes, gaps.

The hub is the robot instead of the room: otherwise a graph in the world frame would not hold the robot's pose.
`inputs_of` scales the features for a network.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ...core.portable_math import Array, arctan2
from ...record.layout import ROW_THETA
from ...record.record import EpisodeRecord
from .features import INPUTS, MODERN_FEATURES
from .graph import INTERVAL, NODE_TYPES, Graph, Nodes
from .source import Observation, SceneNodes, recorded_observation, require_task

FRAMES = ("world", "robot", "goal")
_X, _GOAL = MODERN_FEATURES.index("x"), NODE_TYPES.index("goal")


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
        RecordError: the source of an imported episode has no robot or no goal.
    """
    require_task(record)
    record = record.with_robots_as_people()
    if frame not in FRAMES:
        raise ValueError(f"frame must be one of {', '.join(FRAMES)}, got {frame!r}")
    observations = [recorded_observation(record, at) for at in _ticks(record, tick, instants, interval)]
    scene, origin = record.scene(), np.zeros(3)
    if frame == "robot":
        origin = observations[0].robot[: ROW_THETA + 1]
    elif frame == "goal":
        (x, y), start = observations[0].goal[:ROW_THETA].tolist(), record.states.robot[0]
        origin = np.array([x, y, float(arctan2(y - start[1], x - start[0]))])
    label = record.labels[tick] if tick < len(record) else None
    return graph_of_observations(SceneNodes(scene), observations, origin, label=label)


def graph_of_observations(
    scene_nodes: SceneNodes, observations: Sequence[Observation], origin: Array, *, label: Any = None
) -> Graph:
    """Return the graph of observations of a recorded or a running episode.

    Nodes and edges are as in the paper, with the robot in the place of the room; the pedestrians that are present at
    every instant have nodes. Features: node type; age, s before the newest instant; position, m; direction; velocity,
    m/s and rad/s; direction of the head; length and width, m; the point of the outline that is nearest to the robot,
    m; and the gap between the outlines, m. Static nodes have zero velocity; the head of a node without a head faces
    ahead; a wall node has the length and the direction of its piece; the size of the goal is the distance at which it
    is reached. The goal and the leaves of doors, which are walls, are where they are at each instant.

    Args:
        scene_nodes: of the scene of the episode.
        observations: one or more, the newest first.
        origin: (3,), x, y, theta of the frame of reference of all instants, world frame.
        label: label of the graph.
    """
    nodes = scene_nodes.of(observations)
    features = modern_rows(scene_nodes, nodes, observations, origin)
    interactions = [observation.interactions for observation in observations]
    ticks = tuple(observation.tick for observation in observations)
    return nodes.graph(MODERN_FEATURES, features, features[:, _X : _X + 2].copy(), interactions, ticks, label)


def modern_rows(scene_nodes: SceneNodes, nodes: Nodes, observations: Sequence[Observation], origin: Array) -> Array:
    """Return the features of `graph_of_observations`; (k N, 20) for N nodes and k instants."""
    from .kernels import modern_features  # imported late: `MODERN_FEATURES` needs no compiler

    scene, count = scene_nodes.scene, len(nodes)
    rows = np.empty((len(observations) * count, len(MODERN_FEATURES)))
    for i, observation in enumerate(observations):
        modern_features(
            scene_nodes.at(observation)[0], nodes.goal, nodes.present, observation.humans, scene_nodes.radius,
            scene_nodes.shoulder, observation.robot, scene.robot.radius, origin,
            (observations[0].tick - observation.tick) * scene.rules.dt, rows[i * count : (i + 1) * count],
        )  # fmt: skip
    return rows


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


def inputs_of(graph: Graph) -> Array:
    """Return the inputs of a network for a graph.

    The inputs of a graph of the paper are its features. The inputs of a modern graph in the robot's frame are `INPUTS`:
    the features up to the width, with scaled positions; the directions of a node's nearest point and of its centre; its
    distance; the gap, and exp(-gap / 0.5 m) and exp(-gap / 2 m); and, the same for all nodes, direction and distance
    of the goal, and the robot's velocity.

    Args:
        graph: of the paper, or a modern graph with N nodes in the robot's frame.

    Returns:
        (N, F).
    """
    if graph.feature_names != MODERN_FEATURES:
        return graph.features
    return inputs_of_rows(graph.features, int(np.argmax(graph.node_type == _GOAL)))


def inputs_of_rows(rows: Array, goal: int) -> Array:
    """Return the inputs of a network for the features of a modern graph and the index of its goal."""
    from .kernels import modern_inputs

    inputs = np.empty((len(rows), len(INPUTS)))
    modern_inputs(rows, goal, inputs)
    return inputs
