"""What a network reads of a graph: its features, scaled, with a few numbers derived from them."""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array, exp
from .graph.graph import NODE_TYPES, Graph
from .graph.modern import MODERN_FEATURES

REACH = 5.0  # m, what places are divided by
CLOSE, NEAR = 0.5, 2.0  # m: of the gaps' decays
FAR = 10.0  # m, beyond which no gap is told

_AT = {name: k for k, name in enumerate(MODERN_FEATURES)}
_HUB, _GOAL = NODE_TYPES.index("room"), NODE_TYPES.index("goal")
INPUTS = (
    *MODERN_FEATURES[:5], "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
    "near_x", "near_y", "to_x", "to_y", "distance", "gap", "close", "near",
    "goal_x", "goal_y", "goal_distance", "own_vx", "own_vy", "own_omega",
)  # fmt: skip


def inputs_of(graph: Graph) -> Array:
    """(N, F) of a graph: a paper's graph as it is; of a modern one in the robot's frame `INPUTS`.

    Those are its features; the directions of a node's middle and of its nearest place, its distance, and decays of
    the gap; and, alike for all nodes, the direction and distance of the goal and the robot's velocity.

    Args:
        graph: of either kind.
    """
    if graph.feature_names != MODERN_FEATURES:
        return graph.features
    x = graph.features
    place, nearest = x[:, _AT["x"] : _AT["y"] + 1], x[:, _AT["near_x"] : _AT["near_y"] + 1]
    distance, to = _unit(place)
    _, near = _unit(nearest)
    gap = x[:, _AT["gap"]]
    free = np.maximum(gap, 0.0)
    told = x[:, : _AT["near_x"]].copy()
    told[:, _AT["x"] : _AT["y"] + 1] = place / REACH
    own = np.column_stack(
        (near, to, distance / REACH, np.minimum(gap, FAR) / NEAR, exp(-free / CLOSE), exp(-free / NEAR))
    )
    goal, hub = (int(np.argmax(graph.node_type == kind)) for kind in (_GOAL, _HUB))
    shared = [*to[goal], min(distance[goal], FAR) / REACH, *x[hub, _AT["vx"] : _AT["omega"] + 1]]
    return np.column_stack((told, own, np.tile(shared, (len(x), 1))))


def _unit(vectors: Array) -> tuple[Array, Array]:
    """(n,) lengths and (n, 2) directions; of no length, none."""
    length = np.sqrt(vectors[:, 0] * vectors[:, 0] + vectors[:, 1] * vectors[:, 1])
    return length, vectors / np.maximum(length, 1e-6)[:, None]
