from .attributes import with_attributes as with_attributes
from .convert import save_graph as save_graph, to_data as to_data, to_hetero as to_hetero
from .features import FEATURES as FEATURES, MODERN_FEATURES as MODERN_FEATURES
from .graph import NODE_TYPES as NODE_TYPES, RELATIONS as RELATIONS, Graph as Graph
from .modern import modern_graph as modern_graph
from .paper import kept_ticks as kept_ticks, paper_graphs as paper_graphs
