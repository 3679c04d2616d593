"""Controllers that were learned: networks over graphs, run in NumPy alone, to the same bits on every processor."""

from .graph_policy import GraphPolicy
from .inputs import inputs_of
from .network import Network
from .weights import Weights, read_weights, write_weights

__all__ = ["GraphPolicy", "Network", "Weights", "inputs_of", "read_weights", "write_weights"]
