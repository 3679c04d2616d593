"""Episodes as graphs, for learning: the paper's own, and a modern variant; in NumPy or for PyTorch Geometric."""

from .graph import NODE_TYPES, RELATIONS, Graph
from .modern import MODERN_FEATURES, modern_graph
from .paper import FEATURES, kept_ticks, paper_graphs
from .pyg import to_data, to_hetero

__all__ = [
    "FEATURES",
    "MODERN_FEATURES",
    "NODE_TYPES",
    "RELATIONS",
    "Graph",
    "kept_ticks",
    "modern_graph",
    "paper_graphs",
    "to_data",
    "to_hetero",
]
