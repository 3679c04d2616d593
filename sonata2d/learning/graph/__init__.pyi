from .convert import save_graph as save_graph, to_data as to_data, to_hetero as to_hetero
from .graph import NODE_TYPES as NODE_TYPES, RELATIONS as RELATIONS, Graph as Graph
from .modern import MODERN_FEATURES as MODERN_FEATURES, modern_graph as modern_graph
from .paper import FEATURES as FEATURES, kept_ticks as kept_ticks, paper_graphs as paper_graphs
