"""Graphs as PyTorch Geometric data, where that package is installed, and as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...core.files.optional import optional
from ...core.geometry import as_point
from ...errors import Sonata2dError
from .graph import NODE_TYPES, RELATIONS, Graph

_INTERACTIONS = {RELATIONS.index(name) for name in ("p_p", "p_o", "o_p")}


def to_data(graph: Graph) -> Any:
    """Convert a graph to `torch_geometric.data.Data`.

    Returns:
        Data with x (float32), edge_index, edge_type, node_type, instant, and y (1, n) if the label is n numbers.

    Raises:
        Sonata2dError: PyTorch Geometric is not installed.
    """
    torch, data = optional("torch", Sonata2dError), optional("torch_geometric.data", Sonata2dError)
    label = _label(torch, graph)
    return data.Data(
        x=torch.tensor(graph.features, dtype=torch.float32),
        edge_index=torch.tensor(graph.edges),
        edge_type=torch.tensor(graph.relation),
        node_type=torch.tensor(graph.node_type),
        instant=torch.tensor(graph.instant),
        **({} if label is None else {"y": label}),
    )


def to_hetero(graph: Graph) -> Any:
    """Convert a graph to `torch_geometric.data.HeteroData`.

    Returns:
        HeteroData with x and instant per node type, edge_index per (source type, relation, destination type), and y
        (1, n) if the label is n numbers.

    Raises:
        Sonata2dError: PyTorch Geometric is not installed.
    """
    torch, data = optional("torch", Sonata2dError), optional("torch_geometric.data", Sonata2dError)
    hetero, label = data.HeteroData(), _label(torch, graph)
    for kind in range(len(NODE_TYPES)):
        selected = graph.node_type == kind
        hetero[NODE_TYPES[kind]].x = torch.tensor(graph.features[selected], dtype=torch.float32)
        hetero[NODE_TYPES[kind]].instant = torch.tensor(graph.instant[selected])
    for key, edges in _typed_edges(graph).items():
        hetero[key].edge_index = torch.tensor(edges)
    if label is not None:
        hetero.y = label
    return hetero


def _typed_edges(graph: Graph) -> dict[tuple[str, str, str], Any]:
    """Group the edges by type.

    Returns:
        (2, E) edges by (source type, relation, destination type); nodes are numbered within their type.
    """
    index_in_type = np.zeros(len(graph.node_type), dtype=np.int64)
    for kind in range(len(NODE_TYPES)):
        selected = graph.node_type == kind
        index_in_type[selected] = np.arange(int(selected.sum()))
    names, ends = graph.relation_names, graph.node_type[graph.edges]
    groups: dict[tuple[str, str, str], Any] = {}
    for start, relation, end in sorted(
        {*zip(ends[0].tolist(), graph.relation.tolist(), ends[1].tolist(), strict=True)}
    ):
        selected = (ends[0] == start) & (ends[1] == end) & (graph.relation == relation)
        groups[NODE_TYPES[start], names[relation], NODE_TYPES[end]] = index_in_type[graph.edges[:, selected]]
    return groups


def _label(torch: Any, graph: Graph) -> Any:
    """The label as a (1, n) float32 tensor if it is n numbers; else None."""
    values = np.asarray(graph.label)
    is_numeric = values.dtype.kind in "fiub" and values.ndim <= 1
    return torch.tensor(values.reshape(1, -1), dtype=torch.float32) if is_numeric else None


def save_graph(path: str | Path, graph: Graph, *, dt: float, title: str = "") -> None:
    """Draw the instants of a graph side by side, the newest on the left, in the graph's frame of reference.

    Self-loops, and edges between instants, which join each node with itself, are not drawn.

    Args:
        path: output file; ends in .png.
        graph: of the paper, or a modern graph.
        dt: tick length, s.
        title: text above the picture.

    Raises:
        RenderError: the graph has no nodes, or the file cannot be written.
    """
    from ...view.annotations import value_text
    from ...view.graph_picture import Panel, network_picture
    from ...view.stills import save_surface

    count = len(graph.node_type) // len(graph.ticks)
    hub = "robot" if "is_robot" in graph.feature_names else "room"
    kinds = [hub if NODE_TYPES[kind] == "room" else NODE_TYPES[kind] for kind in graph.node_type.tolist()]
    panels = []
    for i, tick in enumerate(graph.ticks):
        selected = (graph.instant[graph.edges] == i).all(axis=0)
        pairs, relation = (graph.edges[:, selected] - i * count).T.tolist(), graph.relation[selected].tolist()
        edges = [((a, b), kind) for (a, b), kind in zip(pairs, relation, strict=True) if a != b]
        nodes = range(i * count, (i + 1) * count)
        panels.append(
            Panel(
                title=f"{tick * dt:.1f} s" + ("" if i == 0 else f"   ({(graph.ticks[0] - tick) * dt:.1f} s before)"),
                nodes=[(kinds[k], _text(kinds[k], int(graph.entity[k])), as_point(graph.position[k])) for k in nodes],
                edges=[pair for pair, kind in edges if kind not in _INTERACTIONS],
                interactions=[pair for pair, kind in edges if kind in _INTERACTIONS],
            )
        )
    label = value_text(None if graph.label is None else np.asarray(graph.label).tolist())
    picture = network_picture(panels, f"{title}   {len(graph.edges[0])} edges, label {label}".strip())
    save_surface(picture, path)


def _text(kind: str, entity: int) -> str:
    """The id of a pedestrian or object; walls, room and goal are recognised by their colour."""
    return str(entity) if kind in ("human", "object") else ""
