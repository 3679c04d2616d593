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
_WALL_PIECE = 4.0  # m; longer walls are divided into several nodes


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


class Nodes:
    """The nodes of one instant in order: the room, pedestrians, objects, the goal, pieces of walls.

    Args:
        present: (P,), indices in the scene of the pedestrians that are nodes.
        humans, objects: ids of the nodes.
        wall_indices: for each piece of a wall, the index of the wall.

    Attributes:
        goal: index of the goal's node.
    """

    def __init__(
        self, present: IntArray, humans: Sequence[int], objects: Sequence[int], wall_indices: Sequence[int]
    ) -> None:
        self.present, self.goal = present, 1 + len(humans) + len(objects)
        kinds = ["room", *["human"] * len(humans), *["object"] * len(objects), "goal", *["wall"] * len(wall_indices)]
        self._type = np.array([NODE_TYPES.index(kind) for kind in kinds])
        self._entity = np.array([0, *humans, *objects, 0, *wall_indices])
        self._index = {id: k for k, id in enumerate((*humans, *objects), 1)}
        self._letters = [_LETTER[kind] for kind in kinds]
        pairs = [(k, k, f"S{letter.upper()}") for k, letter in enumerate(self._letters)]
        for k, letter in enumerate(self._letters[1:], 1):
            pairs += [(k, 0, f"{letter}_r"), (0, k, f"r_{letter}")]
        self._static_edges = _edge_rows(pairs)
        self._edges_of: tuple[Any, ...] | None = None

    def __len__(self) -> int:
        """N, the number of nodes of an instant."""
        return len(self._type)

    def edges(self, interactions: Sequence[tuple[Interaction, ...]]) -> tuple[IntArray, IntArray]:
        """Return the edges within each instant, and between the newest instant and each older one.

        Within an instant, every node has a self-loop, every node but the room an edge to the room and one from it, and
        every interaction one edge in each direction: 1 + 3 (N - 1) + 2 I for I interactions. Interactions with an
        entity that is not a node, such as the robot, have no edges.

        Args:
            interactions: of each instant, the newest first.

        Returns:
            (2, E) edges and (E,) relations; they are kept for the next call.
        """
        if self._edges_of is None or self._edges_of[0] != interactions:
            self._edges_of = (interactions, *self._all_edges(interactions))
        _, edges, relation = self._edges_of
        return edges, relation

    def _all_edges(self, interactions: Sequence[tuple[Interaction, ...]]) -> tuple[IntArray, IntArray]:
        count, nodes = len(self), np.arange(len(self))
        parts = []
        for i, relations in enumerate(interactions):
            first = (i * count, i * count, 0)
            parts += [self._static_edges + first, self._interaction_edges(relations) + first]
        for i in range(1, len(interactions)):
            older, to_newest = nodes + i * count, np.full(count, len(RELATIONS) + 2 * (i - 1))
            pairs = np.array([[older, nodes, to_newest], [nodes, older, to_newest + 1]])
            parts.append(pairs.transpose(2, 0, 1).reshape(-1, 3))
        rows = np.concatenate(parts)
        return rows[:, :2].T.copy(), rows[:, 2].copy()

    def _interaction_edges(self, interactions: Sequence[Interaction]) -> IntArray:
        """(2 I, 3)."""
        index, letters, pairs = self._index, self._letters, []
        for interaction in interactions:
            if interaction.src in index and interaction.dst in index:
                a, b = index[interaction.src], index[interaction.dst]
                pairs += [(b, a, f"{letters[b]}_{letters[a]}"), (a, b, f"{letters[a]}_{letters[b]}")]
        return _edge_rows(pairs)

    def graph(
        self,
        names: tuple[str, ...],
        features: Array,
        position: Array,
        interactions: Sequence[tuple[Interaction, ...]],
        ticks: tuple[int, ...],
        label: Any,
    ) -> Graph:
        """Return a graph with these nodes at each of k instants; for the arguments see `Graph` and `edges`."""
        edges, relation = self.edges(interactions)
        return Graph(
            feature_names=names,
            features=features,
            node_type=np.tile(self._type, len(ticks)),
            entity=np.tile(self._entity, len(ticks)),
            position=position,
            instant=np.repeat(np.arange(len(ticks)), len(self)),
            edges=edges.copy(),
            relation=relation.copy(),
            label=label,
            ticks=ticks,
        )


def _edge_rows(edges: list[tuple[int, int, str]]) -> IntArray:
    """Source, destination and relation of edges, (E, 3)."""
    return np.array([(a, b, RELATIONS.index(name)) for a, b, name in edges], dtype=np.int64).reshape(-1, 3)


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
        count = int(length / _WALL_PIECE) + 1
        cuts = wall[:2] + np.linspace(0.0, 1.0, count + 1)[:, None] * (wall[2:] - wall[:2])
        ends += [np.concatenate(pair) for pair in pairwise(cuts)]
        indices += [k] * count
    return tuple(indices), np.array(ends).reshape(-1, 4)
