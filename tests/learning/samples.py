"""Networks with random weights, for tests that compute every number of the result."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonata2d.core.portable_math import Array, IntArray
from sonata2d.learning.graph.features import FEATURES, INPUTS
from sonata2d.learning.graph.graph import RELATIONS
from sonata2d.learning.weights import Weights, write_weights

INPUTS_OF = {"paper": len(FEATURES), "modern": len(INPUTS)}
RELATIONS_OF = {"paper": len(RELATIONS) + 4, "modern": len(RELATIONS)}
ALL = [(graph, kind) for graph in ("paper", "modern") for kind in ("rgcn", "gatv2")]


def random_weights(graph: str = "paper", kind: str = "rgcn", seed: int = 0) -> Weights:
    rng = np.random.default_rng(seed)
    sizes = _rgcn(graph) if kind == "rgcn" else _gatv2(graph)
    scale = 0.05 if kind == "rgcn" else 0.3
    return Weights(graph, kind, {name: rng.normal(0.0, scale, size) for name, size in sizes.items()}, {"seed": seed})


def weights_file(path: Path, graph: str = "paper", kind: str = "rgcn", seed: int = 0) -> Path:
    """Write random weights to a file and return its path."""
    write_weights(path, random_weights(graph, kind, seed))
    return path


def random_graph(graph: str, seed: int, nodes: int = 23, edges: int = 120) -> tuple[Array, IntArray, IntArray]:
    """Return inputs (N, F), edges (2, E) and relations (E,); some nodes have no incoming edges, some edges repeat."""
    rng = np.random.default_rng(seed)
    x = rng.normal(0.0, 1.0, (nodes, INPUTS_OF[graph]))
    ends = rng.integers(0, [[nodes], [nodes - 3]], (2, edges))
    return x, ends, rng.integers(0, RELATIONS_OF[graph], edges)


def _rgcn(graph: str) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays."""
    widths = (INPUTS_OF[graph], 12, 7, 3)
    shapes: dict[str, tuple[int, ...]] = {}
    for k in range(3):
        shapes[f"layer{k}.weight"] = (RELATIONS_OF[graph], widths[k], widths[k + 1])
        shapes[f"layer{k}.bias"] = (widths[k + 1],)
    return shapes


def _gatv2(graph: str) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays."""
    width, heads = 12, 3
    shapes: dict[str, tuple[int, ...]] = {}
    dense = {
        "encoder0": (INPUTS_OF[graph], width),
        "encoder1": (width, width),
        "head0": (2 * width, 8),
        "head1": (8, 3),
    }
    for k in range(2):
        dense |= {f"conv{k}.source": (width, width), f"conv{k}.target": (width, width)}
        shapes |= {f"conv{k}.relation": (RELATIONS_OF[graph], width), f"conv{k}.bias": (width,)}
        shapes[f"conv{k}.attention"] = (heads, width // heads)
    for name, (start, end) in dense.items():
        shapes |= {f"{name}.weight": (start, end), f"{name}.bias": (end,)}
    return shapes
