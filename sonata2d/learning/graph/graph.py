"""The graph of a situation: nodes of five types at one or more instants, typed edges within and between the instants.

Source: the SONATA toolkit and its data set, by its authors' description; nodes and edges in the order of its loader.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.entities import Interaction
from ...core.portable_math import Array, IntArray

NODE_TYPES = ("human", "object", "room", "wall", "goal")
# Within an instant: first the self-loops (S), then edges between types, named source_destination by initial letters.
RELATIONS = (
    "SG", "SO", "SP", "SR", "SW", "g_r", "o_p", "o_r", "p_o", "p_p", "p_r", "r_g", "r_o", "r_p", "r_w", "w_r",
)  # fmt: skip
_LETTER = {"human": "p", "object": "o", "room": "r", "wall": "w", "goal": "g"}
INTERVAL = 1.0  # s, minimum between two instants
ROUNDING = 1e-6  # s, m: accumulated rounding of numbers from files
WALL_PIECE = 4.0  # m; longer walls are divided into several nodes


@dataclass(frozen=True, eq=False)
class Graph:
    """A graph with N nodes at each of k instants, the newest instant first, and E edges.

    Attributes:
        feature_names: names of the F features.
        features: (k N, F).
        node_type: (k N,), indices into `NODE_TYPES`.
        entity: (k N,), ids of pedestrians and objects, indices of walls, 0 for room and goal.
        position: (k N, 2), m, in the graph's frame of reference; where to draw a node.
        instant: (k N,), 0 for the newest instant.
        edges: (2, E), source and destination nodes.
        relation: (E,), indices into `RELATIONS`; edges between instants have higher numbers: for the older instant
            i = 1, 2, ..., 16 + 2 (i - 1) from a node to itself in the newest instant, 17 + 2 (i - 1) back.
        label: label of the newest instant; (3,) for graphs of the paper.
        ticks: of the instants, the newest first.
    """

    feature_names: tuple[str, ...]
    features: Array
    node_type: IntArray
    entity: IntArray
    position: Array
    instant: IntArray
    edges: IntArray
    relation: IntArray
    label: Any
    ticks: tuple[int, ...]

    @property
    def relation_names(self) -> tuple[str, ...]:
        """The name of each number in `relation`."""
        between = (name for i in range(1, len(self.ticks)) for name in (f"t_m{i}_t_0", f"t_0_t_m{i}"))
        return (*RELATIONS, *between)


@dataclass(frozen=True, slots=True)
class NodeOrder:
    """The nodes of one instant in order: the room, pedestrians, objects, the goal, pieces of walls.

    Attributes:
        humans, objects: ids.
        wall_indices: for each piece of a wall, the index of the wall.
    """

    humans: tuple[int, ...]
    objects: tuple[int, ...]
    wall_indices: tuple[int, ...]

    def __len__(self) -> int:
        """N, the number of nodes of an instant."""
        return 2 + len(self.humans) + len(self.objects) + len(self.wall_indices)

    @property
    def goal(self) -> int:
        """Index of the goal's node."""
        return 1 + len(self.humans) + len(self.objects)

    @property
    def types(self) -> list[str]:
        """Type of each node."""
        entities = ["human"] * len(self.humans) + ["object"] * len(self.objects)
        return ["room", *entities, "goal", *["wall"] * len(self.wall_indices)]

    @property
    def entities(self) -> list[int]:
        """Id or index of each node."""
        return [0, *self.humans, *self.objects, 0, *self.wall_indices]


def edges_within(nodes: NodeOrder, interactions: Sequence[Interaction]) -> list[tuple[int, int, int]]:
    """Return the edges of one instant: 1 + 3 (N - 1) + 2 I for I interactions.

    Every node has a self-loop, every node but the room an edge to the room and one from it, and every interaction one
    edge in each direction. Interactions with an entity that is not a node, such as the robot, have no edges.

    Returns:
        Source, destination and relation of each edge.
    """
    types = nodes.types
    index = {id: k for k, id in enumerate((*nodes.humans, *nodes.objects), 1)}
    edges = [(k, k, RELATIONS.index(f"S{_LETTER[kind].upper()}")) for k, kind in enumerate(types)]
    pairs = [pair for k in range(1, len(nodes)) for pair in ((k, 0), (0, k))]
    for interaction in interactions:
        src, dst = interaction.src, interaction.dst
        if src in index and dst in index:
            pairs += [(index[dst], index[src]), (index[src], index[dst])]
    for a, b in pairs:
        edges.append((a, b, RELATIONS.index(f"{_LETTER[types[a]]}_{_LETTER[types[b]]}")))
    return edges


def all_edges(nodes: NodeOrder, interactions: Sequence[Sequence[Interaction]]) -> tuple[IntArray, IntArray]:
    """Return the edges within each instant, and between the newest instant and each older one.

    Args:
        nodes: the same for all instants.
        interactions: of each instant, the newest first.

    Returns:
        (2, E) edges and (E,) relations.
    """
    count = len(nodes)
    edges: list[tuple[int, int, int]] = []
    for i, own in enumerate(interactions):
        edges += [(a + i * count, b + i * count, relation) for a, b, relation in edges_within(nodes, own)]
    for i in range(1, len(interactions)):
        to_newest = len(RELATIONS) + 2 * (i - 1)
        for k in range(count):
            edges += [(k + i * count, k, to_newest), (k, k + i * count, to_newest + 1)]
    rows = np.array(edges, dtype=np.int64).reshape(-1, 3)
    return rows[:, :2].T.copy(), rows[:, 2].copy()


def wall_pieces(walls: Array) -> tuple[tuple[int, ...], Array]:
    """Divide walls into int(length / 4 m) + 1 equal pieces each; a wall of exactly 4 m into two.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m.

    Returns:
        M indices of the walls, and (M, 4), the ends of the pieces, m.
    """
    indices: list[int] = []
    ends: list[Array] = []
    for k, wall in enumerate(walls):
        dx, dy = (wall[2:] - wall[:2]).tolist()
        length = round(math.sqrt(dx * dx + dy * dy), 6)  # else the last bit decides for walls of 4 or 8 m
        count = int(length / WALL_PIECE) + 1
        cuts = wall[:2] + np.linspace(0.0, 1.0, count + 1)[:, None] * (wall[2:] - wall[:2])
        ends += [np.concatenate(pair) for pair in pairwise(cuts)]
        indices += [k] * count
    return tuple(indices), np.array(ends).reshape(-1, 4)
