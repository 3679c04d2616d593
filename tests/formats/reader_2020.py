"""What the readers of `sonata` files build, by their published description: written for these tests."""

from __future__ import annotations

import math
from typing import Any

Tree = dict[str, Any]


def kept(frames: list[Tree], interval: float = 1.0) -> list[int]:
    """Frames at least this many seconds apart, from the first."""
    chosen = [0]
    for k, frame in enumerate(frames):
        if frame["timestamp"] - frames[chosen[-1]]["timestamp"] >= interval:
            chosen.append(k)
    return chosen


def wall_nodes(frame: Tree, piece: int = 400) -> int:
    lengths = (math.hypot(w["x1"] - w["x2"], w["y1"] - w["y2"]) for w in frame["walls"])
    return sum(int(100 * length / piece) + 1 for length in lengths)


def graph(frame: Tree) -> tuple[int, list[tuple[int, int]]]:
    """Number of nodes, and edges: ids are indices; room 0, goal after the entities, then the walls."""
    entities = sorted(entity["id"] for entity in frame["people"] + frame["objects"])
    assert entities == list(range(1, len(entities) + 1)), "ids are used as indices"
    goal = len(entities) + 1
    nodes = [0, *entities, goal, *range(goal + 1, goal + 1 + wall_nodes(frame))]
    edges = [(0, 0)] + [pair for node in nodes[1:] for pair in ((node, node), (node, 0), (0, node))]
    for tie in frame["interaction"]:
        edges += [(tie["dst"], tie["src"]), (tie["src"], tie["dst"])]
    return len(nodes), edges


def graphs(frames: list[Tree]) -> list[tuple[int, int]]:
    """Nodes and edges of each graph: up to three instants, newest first, each tied to the newest, node by node."""
    chosen, built = kept(frames), []
    for j in range(1, len(chosen)):
        instants = [graph(frames[k]) for k in reversed(chosen[max(0, j - 2) : j + 1])]
        newest = instants[0][0]
        nodes = sum(count for count, _ in instants)
        edges = sum(len(found) for _, found in instants) + 2 * newest * (len(instants) - 1)
        built.append((nodes, edges))
    return built
