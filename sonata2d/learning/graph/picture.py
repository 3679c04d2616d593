"""A graph as a PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...view.network import Panel, network_picture
from ...view.still import save_surface
from .graph import NODE_TYPES, RELATIONS, Graph

_TIES = {RELATIONS.index(name) for name in ("p_p", "p_o", "o_p")}


def save_graph(path: str | Path, graph: Graph, *, dt: float, title: str = "") -> None:
    """Draw the instants of a graph side by side, the newest to the left, in its own frame of reference.

    Edges of a node to itself and those between instants, which join each node with itself, are left out.

    Args:
        path: ends in .png.
        graph: of the paper's kind or modern.
        dt: s, the tick.
        title: above it.

    Raises:
        RenderError: the picture cannot be drawn or written.
    """
    count = len(graph.node_type) // len(graph.ticks)
    hub = "robot" if "is_robot" in graph.feature_names else "room"
    kinds = [hub if NODE_TYPES[kind] == "room" else NODE_TYPES[kind] for kind in graph.node_type.tolist()]
    panels = []
    for i, tick in enumerate(graph.ticks):
        chosen = (graph.instant[graph.edges] == i).all(axis=0)
        pairs, relation = (graph.edges[:, chosen] - i * count).T.tolist(), graph.relation[chosen].tolist()
        joined = [((a, b), kind) for (a, b), kind in zip(pairs, relation, strict=True) if a != b]
        rows = range(i * count, (i + 1) * count)
        panels.append(
            Panel(
                title=f"{tick * dt:.1f} s" + ("" if i == 0 else f"   ({(graph.ticks[0] - tick) * dt:.1f} s before)"),
                nodes=[(kinds[k], _text(kinds[k], int(graph.entity[k])), _place(graph, k)) for k in rows],
                edges=[pair for pair, kind in joined if kind not in _TIES],
                ties=[pair for pair, kind in joined if kind in _TIES],
            )
        )
    label = np.asarray(graph.label).tolist() if graph.label is not None else "none"
    network = network_picture(panels, f"{title}   {len(graph.edges[0])} edges, label {label}".strip())
    save_surface(network, path)


def _text(kind: str, entity: int) -> str:
    """People and things by their ids; walls, room and goal by their colour."""
    return str(entity) if kind in ("human", "object") else ""


def _place(graph: Graph, k: int) -> tuple[float, float]:
    x, y = graph.position[k].tolist()
    return x, y
