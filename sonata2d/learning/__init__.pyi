from .inputs import inputs_of as inputs_of
from .network import Network as Network
from .policy import GraphPolicy as GraphPolicy
from .weights import Weights as Weights
from .weights import read_weights as read_weights
from .weights import write_weights as write_weights
