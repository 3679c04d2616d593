"""What a graph is: nodes of five types at several instants, typed edges within and between these.

Source: the toolkit SONATA and its data set, by its authors' description; node and edge order as their loader's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...core.entities import Interaction
from ...core.portable_math import Array

NODE_TYPES = ("human", "object", "room", "wall", "goal")
# Within an instant: of a node with itself (S), then between types, named source_destination by their first letters.
RELATIONS = (
    "SG", "SO", "SP", "SR", "SW", "g_r", "o_p", "o_r", "p_o", "p_p", "p_r", "r_g", "r_o", "r_p", "r_w", "w_r",
)  # fmt: skip
_LETTER = {"human": "p", "object": "o", "room": "r", "wall": "w", "goal": "g"}
INTERVAL = 1.0  # s, at least, from an instant to the next
ROUNDING = 1e-6  # s, m: what a file's numbers may be off, added up


@dataclass(frozen=True, eq=False)
class Graph:
    """N nodes at each of k instants, the newest first, and E edges.

    Attributes:
        feature_names: of the F columns.
        features: (k N, F).
        node_type: (k N,) of int, into `NODE_TYPES`.
        entity: (k N,) of int: ids of people and objects, indices of walls, 0 for room and goal.
        position: (k N, 2), m, in the graph's frame of reference; where to draw a node.
        instant: (k N,) of int, 0 for the newest.
        edges: (2, E) of int, from and to.
        relation: (E,) of int: into `RELATIONS`, and beyond it, of instant i = 1, 2, …: 16 + 2 (i - 1) from a node to
            itself in the newest instant, 17 + 2 (i - 1) back.
        label: what the newest instant is labelled with; of the paper's graphs (3,).
        ticks: of the instants, the newest first.
    """

    feature_names: tuple[str, ...]
    features: Array
    node_type: Any
    entity: Any
    position: Array
    instant: Any
    edges: Any
    relation: Any
    label: Any
    ticks: tuple[int, ...]

    @property
    def relation_names(self) -> tuple[str, ...]:
        """A name for each number in `relation`."""
        between = (name for i in range(1, len(self.ticks)) for name in (f"t_m{i}_t_0", f"t_0_t_m{i}"))
        return (*RELATIONS, *between)


@dataclass(frozen=True, slots=True)
class Cast:
    """Who and what is a node, in order: the room, people, objects, the goal, walls (each in so many pieces).

    Attributes:
        people, objects: ids.
        pieces: the index of its wall, for each wall node.
    """

    people: tuple[int, ...]
    objects: tuple[int, ...]
    pieces: tuple[int, ...]

    def __len__(self) -> int:
        """N, the nodes of an instant."""
        return 2 + len(self.people) + len(self.objects) + len(self.pieces)

    @property
    def goal(self) -> int:
        """Index of the goal's node."""
        return 1 + len(self.people) + len(self.objects)

    @property
    def types(self) -> list[str]:
        """Of each node."""
        things = ["human"] * len(self.people) + ["object"] * len(self.objects)
        return ["room", *things, "goal", *["wall"] * len(self.pieces)]

    @property
    def entities(self) -> list[int]:
        """Id or index of each node."""
        return [0, *self.people, *self.objects, 0, *self.pieces]


def edges_within(cast: Cast, ties: Sequence[Interaction]) -> list[tuple[int, int, int]]:
    """From, to and relation of the edges of one instant: 1 + 3 (N - 1) + 2 I.

    Every node has one to itself, and all but the room one to the room and one from it; every interaction one each way.
    Interactions with whatever is no node, such as the robot, have none.
    """
    types = cast.types
    index = {id: k for k, id in enumerate((*cast.people, *cast.objects), 1)}
    edges = [(k, k, RELATIONS.index(f"S{_LETTER[kind].upper()}")) for k, kind in enumerate(types)]
    pairs = [pair for k in range(1, len(cast)) for pair in ((k, 0), (0, k))]
    for tie in ties:
        if tie.src in index and tie.dst in index:
            pairs += [(index[tie.dst], index[tie.src]), (index[tie.src], index[tie.dst])]
    for a, b in pairs:
        edges.append((a, b, RELATIONS.index(f"{_LETTER[types[a]]}_{_LETTER[types[b]]}")))
    return edges


def edges_of(cast: Cast, ties: Sequence[Sequence[Interaction]]) -> tuple[Any, Any]:
    """All edges, (2, E), and their relations, (E,): within each instant, and as a star from the newest to the others.

    Args:
        ties: the interactions of each instant, the newest first.
    """
    count = len(cast)
    edges: list[tuple[int, int, int]] = []
    for i, own in enumerate(ties):
        edges += [(a + i * count, b + i * count, relation) for a, b, relation in edges_within(cast, own)]
    for i in range(1, len(ties)):
        to_newest = len(RELATIONS) + 2 * (i - 1)
        for k in range(count):
            edges += [(k + i * count, k, to_newest), (k, k + i * count, to_newest + 1)]
    rows = np.array(edges, dtype=np.int64).reshape(-1, 3)
    return rows[:, :2].T.copy(), rows[:, 2].copy()


def wall_pieces(walls: Array, longest: float = 4.0) -> tuple[tuple[int, ...], Array]:
    """Walls cut into equal pieces, int(length / longest) + 1 of each.

    Args:
        walls: (W, 4), columns x1, y1, x2, y2, m.
        longest: m; a wall of just that length is cut in two.

    Returns:
        The index of each piece's wall, and (M, 4), the pieces' ends.
    """
    owner: list[int] = []
    ends: list[Array] = []
    for k, wall in enumerate(walls):
        dx, dy = (wall[2:] - wall[:2]).tolist()
        length = round(math.sqrt(dx * dx + dy * dy), 6)  # else walls of 4 or 8 m flip by a last digit
        count = int(length / longest) + 1
        cuts = wall[:2] + np.linspace(0.0, 1.0, count + 1)[:, None] * (wall[2:] - wall[:2])
        ends += [np.concatenate(pair) for pair in pairwise(cuts)]
        owner += [k] * count
    return tuple(owner), np.array(ends).reshape(-1, 4)
