from .graph.features import INPUTS as INPUTS
from .graph.modern import inputs_of as inputs_of
from .graph_samples import GraphSamples as GraphSamples
from .network import Network as Network
from .policy import GraphPolicy as GraphPolicy
from .weights import Weights as Weights, read_weights as read_weights, write_weights as write_weights
