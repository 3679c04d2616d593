"""The networks of `graph-policy`, inference only: relational graph convolution and graph attention in fixed point.

They compute what `RGCNConv` (sums, no root weight) and `GATv2Conv` of PyTorch Geometric compute, to the precision of
the fixed-point numbers.

Source: R-GCN, M. Schlichtkrull et al., ESWC 2018, eq. 2 (without the constant c); GATv2, S. Brody, U. Alon &
E. Yahav, ICLR 2022, eq. 7, with the relation's vector inside the non-linearity.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ..core.portable_math import Array, IntArray, exp
from .fixed_point import dot, leaky_relu, product, round_values, round_weights, scatter_sum, tanh
from .weights import Weights, layer_count

ATTENTION_SLOPE = 0.2  # of the leaky ReLU inside the attention, the default of GATv2Conv


class Network(Protocol):
    """A network that maps a graph to a command of the robot."""

    def __call__(self, x: Array, edges: IntArray, relation: IntArray) -> Array:
        """Return the output at the hub of the newest instant.

        Args:
            x: (N, F), inputs of the nodes; the first node is the hub of the newest instant.
            edges: (2, E), source and destination nodes.
            relation: (E,), relation of each edge.

        Returns:
            (3,), within ±1: fractions of the robot's limits ahead, sideways and turning.
        """
        ...


def network_of(weights: Weights) -> Network:
    """Build the network of weights that `read_weights` returned.

    Raises:
        ValueError: a weight is beyond ±32.
    """
    arrays = {name: round_weights(array) for name, array in weights.arrays.items()}
    return Rgcn(arrays) if weights.kind == "rgcn" else GatV2(arrays)


class Rgcn:
    """Relational graph convolutions with leaky ReLU between the layers and tanh at the end.

    Exact as long as the edges into a node times the width stay below 2^15: 650 nodes at a width of 50.

    Args:
        arrays: for each layer k `layer{k}.weight` (R, in, out) and `layer{k}.bias` (out,).
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        count = layer_count(arrays, "layer")
        self._layers = [(arrays[f"layer{k}.weight"], arrays[f"layer{k}.bias"]) for k in range(count)]

    def __call__(self, x: Array, edges: IntArray, relation: IntArray) -> Array:
        """See `Network`."""
        h, last = round_values(x), len(self._layers) - 1
        relations = [(r, *_adjacency(edges[:, relation == r], len(h))) for r in np.unique(relation).tolist()]
        for k, (weight, bias) in enumerate(self._layers):
            out = np.zeros((len(h), weight.shape[2])) + bias
            for r, destinations, adjacency in relations:
                out[destinations] += product(product(adjacency, h), weight[r])
            h = round_values(out if k == last else leaky_relu(out))
        return tanh(h[0])


class GatV2:
    """A dense encoder of each node, graph attention layers with residuals, and a dense head at the hub.

    Args:
        arrays: `encoder{k}` and `head{k}`, each with `.weight` (in, out) and `.bias` (out,); for each attention layer
            `conv{k}.source` and `conv{k}.target` likewise, `conv{k}.relation` (R, H C), `conv{k}.attention` (H, C) and
            `conv{k}.bias` (H C,), for H heads of width C.
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._arrays = arrays
        self._layer_count = layer_count(arrays, "conv")

    def __call__(self, x: Array, edges: IntArray, relation: IntArray) -> Array:
        """See `Network`."""
        encoded = h = self._dense("encoder", round_values(x), activate_last=True)
        for k in range(self._layer_count):
            h = round_values(h + leaky_relu(self._attention(f"conv{k}", h, edges, relation)))
        return tanh(self._dense("head", np.concatenate((h[:1], encoded[:1]), axis=1), activate_last=False)[0])

    def _linear(self, name: str, h: Array) -> Array:
        return product(h, self._arrays[f"{name}.weight"]) + self._arrays[f"{name}.bias"]

    def _dense(self, name: str, h: Array, *, activate_last: bool) -> Array:
        """Dense layers with leaky ReLU between them."""
        count = layer_count(self._arrays, name)
        for k in range(count):
            out = self._linear(f"{name}{k}", h)
            h = round_values(leaky_relu(out) if activate_last or k < count - 1 else out)
        return h

    def _attention(self, name: str, h: Array, edges: IntArray, relation: IntArray) -> Array:
        """(N, H C): the attention-weighted sum over the incoming edges of each node."""
        attention = self._arrays[f"{name}.attention"]
        shape, (start, end) = (-1, *attention.shape), edges
        source = round_values(self._linear(f"{name}.source", h)).reshape(shape)
        target = round_values(self._linear(f"{name}.target", h)).reshape(shape)
        relation_vector = self._arrays[f"{name}.relation"][relation].reshape(shape)
        hidden = round_values(leaky_relu(source[start] + target[end] + relation_vector, ATTENTION_SLOPE))
        score = dot(hidden, attention)  # (E, H)
        # Softmax over the incoming edges; the maximum is subtracted first, so that exp cannot overflow.
        highest = np.full((len(h), score.shape[1]), -np.inf)
        np.maximum.at(highest, end, score)
        coefficient = round_values(exp(score - highest[end]))
        coefficient = round_values(coefficient / np.maximum(scatter_sum(coefficient, end, len(h)), 1e-9)[end])
        out = scatter_sum(round_values(coefficient[:, :, None] * source[start]), end, len(h))
        return out.reshape(len(h), -1) + self._arrays[f"{name}.bias"]


def _adjacency(edges: IntArray, count: int) -> tuple[IntArray, Array]:
    """The K destinations of the edges of one relation, and the (K, count) matrix that sums over their sources."""
    destinations, row = np.unique(edges[1], return_inverse=True)
    adjacency = np.zeros((len(destinations), count))
    np.add.at(adjacency, (row, edges[0]), 1.0)  # counts duplicate edges
    return destinations, adjacency
