"""Graphs for PyTorch Geometric, where that is installed."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ...errors import Sonata2dError
from .graph import NODE_TYPES, Graph


def to_data(graph: Graph) -> Any:
    """The graph as a `torch_geometric.data.Data`: x, edge_index, edge_type, node_type, instant, and y if it fits.

    Raises:
        Sonata2dError: PyTorch Geometric is not installed.
    """
    torch, data = _torch()
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
    """The graph as a `torch_geometric.data.HeteroData`: x and instant by type of node, edges by (from, relation, to).

    Raises:
        Sonata2dError: PyTorch Geometric is not installed.
    """
    torch, data = _torch()
    hetero, label = data.HeteroData(), _label(torch, graph)
    for kind in range(len(NODE_TYPES)):
        chosen = graph.node_type == kind
        hetero[NODE_TYPES[kind]].x = torch.tensor(graph.features[chosen], dtype=torch.float32)
        hetero[NODE_TYPES[kind]].instant = torch.tensor(graph.instant[chosen])
    for key, edges in typed_edges(graph).items():
        hetero[key].edge_index = torch.tensor(edges)
    if label is not None:
        hetero.y = label
    return hetero


def typed_edges(graph: Graph) -> dict[tuple[str, str, str], Any]:
    """Edges by (type of the node from, relation, type of the node to); (2, E) each, nodes counted within their type."""
    local = np.zeros(len(graph.node_type), dtype=np.int64)
    for kind in range(len(NODE_TYPES)):
        chosen = graph.node_type == kind
        local[chosen] = np.arange(int(chosen.sum()))
    names, ends = graph.relation_names, graph.node_type[graph.edges]
    found: dict[tuple[str, str, str], Any] = {}
    for start, relation, end in sorted(
        {*zip(ends[0].tolist(), graph.relation.tolist(), ends[1].tolist(), strict=True)}
    ):
        chosen = (ends[0] == start) & (ends[1] == end) & (graph.relation == relation)
        found[NODE_TYPES[start], names[relation], NODE_TYPES[end]] = local[graph.edges[:, chosen]]
    return found


def _label(torch: Any, graph: Graph) -> Any:
    """(1, n) of float32 where the label is n numbers; None where it is anything else."""
    values = np.asarray(graph.label)
    fits = values.dtype.kind in "fiub" and values.ndim <= 1
    return torch.tensor(values.reshape(1, -1), dtype=torch.float32) if fits else None


def _torch() -> tuple[ModuleType, ModuleType]:
    try:
        import torch
        import torch_geometric.data as data
    except ImportError as error:
        raise Sonata2dError("PyTorch Geometric is not installed; pip install torch torch_geometric") from error
    return torch, data
