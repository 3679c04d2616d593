"""Graphs of the SONATA paper: up to three instants a second apart, in the robot frame, 42 features per node.

Positions and velocities follow the original's recorder: x to the robot's right, y ahead, angles clockwise from
the right; velocities are the previous position minus the current one, each in the robot frame of its own tick.

Source: the SONATA toolkit and its data set; docs/how-to/graphs.md compares the graphs with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from ...core.portable_math import Array
from ...core.scene import Scene
from ...record.record import EpisodeRecord
from .features import FEATURES, INSTANTS
from .graph import INTERVAL, ROUNDING, Graph, Nodes
from .source import Observation, SceneNodes, recorded_observation, require_task

LABEL_SIGNS = np.array([1.0, -1.0, -1.0])  # labels point right and clockwise, twists left and counter-clockwise


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


def paper_graphs(record: EpisodeRecord, *, skip_first: bool = False) -> list[Graph]:
    """Return the graphs of an episode in order: one for each kept tick but the first, with up to two earlier ones.

    As in the original's loader, the first kept tick has no graph of its own, but is an instant of the next two, with
    zero velocities. So graph j has min(j + 2, 3) instants. The label is the label of the frame if that is a twist, else
    the command, as fractions of the robot's limits: ahead, right, clockwise.

    Args:
        record: an episode; one that is shorter than a second gives no graphs.
        skip_first: leave the first kept tick out of all graphs, so that graph j has min(j + 1, 3) instants. This is
            what `GraphPolicy` reads while it drives, and what the networks of examples/use_case are trained on.

    Raises:
        RecordError: the source of an imported episode has no robot or no goal.
    """
    require_task(record)
    record = record.with_robots_as_people()
    kept, scene, labels = kept_ticks(record.time), record.scene(), record.labels
    scene_nodes, observation = SceneNodes(scene), cache(lambda tick: recorded_observation(record, tick))
    first, graphs = int(skip_first), []
    for j in range(1, len(kept)):
        ticks = kept[max(j - INSTANTS + 1, first) : j + 1][::-1]
        label = command_fractions(scene, labels[ticks[0]], record.command[ticks[0]])
        # The first tick has no predecessor: it is paired with itself, which gives zero velocities.
        pairs = [(observation(tick), observation(max(tick - 1, 0))) for tick in ticks]
        graphs.append(paper_graph(scene_nodes, pairs, is_first=ticks[-1] == kept[first], label=label))
    return graphs


def paper_graph(
    scene_nodes: SceneNodes,
    instants: Sequence[tuple[Observation, Observation]],
    *,
    is_first: bool = False,
    label: Array | None = None,
) -> Graph:
    """Return the graph of one to three instants of a recorded or a running episode.

    `is_first_frame` marks the oldest instant if `is_first`; `time_left` is 1 / (tick + 1); both are the same for all
    nodes of an instant. The pedestrians that are present at every instant and at the ticks before have nodes.

    Args:
        scene_nodes: of the scene of the episode.
        instants: the newest first: each observation with the one of the tick before, for the velocities.
        is_first: whether the oldest instant is the first of the episode.
        label: label of the graph.

    Returns:
        For k instants, P pedestrians, O objects, M wall nodes and I interactions each: N = 2 + P + O + M nodes and
        1 + 3 (N - 1) + 2 I edges per instant, and 2 (k - 1) N edges between them.
    """
    nodes = nodes_of_instants(scene_nodes, instants)
    features, position = paper_rows(scene_nodes, nodes, instants, is_first=is_first)
    interactions = [current.interactions for current, _ in instants]
    return nodes.graph(FEATURES, features, position, interactions, tuple(now.tick for now, _ in instants), label)


def nodes_of_instants(scene_nodes: SceneNodes, instants: Sequence[tuple[Observation, Observation]]) -> Nodes:
    """Return the nodes of `paper_graph`."""
    return scene_nodes.of([observation for pair in instants for observation in pair])


def paper_rows(
    scene_nodes: SceneNodes, nodes: Nodes, instants: Sequence[tuple[Observation, Observation]], *, is_first: bool
) -> tuple[Array, Array]:
    """Return features and positions of `paper_graph`; (k N, 42) and (k N, 2) for N nodes and k instants."""
    from .kernels import paper_features  # imported late: `FEATURES` needs no compiler

    count, oldest = len(nodes), len(instants) - 1
    rows, position = np.empty((len(instants) * count, len(FEATURES))), np.empty((len(instants) * count, 2))
    for i, (current, before) in enumerate(instants):
        selected, (fixed, pieces) = slice(i * count, (i + 1) * count), scene_nodes.at(current)
        paper_features(
            fixed, nodes.goal, pieces, nodes.present, current.humans, before.humans,
            current.robot, before.robot, i, float(is_first and i == oldest), current.tick, rows[selected],
            position[selected],
        )  # fmt: skip
    return rows, position


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
