"""The networks of `graph-policy`, inference only: relational graph convolution and graph attention in fixed point.

Their results equal `RGCNConv` (sums, no root weight) and `GATv2Conv` of PyTorch Geometric to the precision of the
fixed-point numbers.

Source: R-GCN, M. Schlichtkrull et al., ESWC 2018, eq. 2 (without the constant c); GATv2, S. Brody, U. Alon &
E. Yahav, ICLR 2022, eq. 7, with the relation's vector inside the non-linearity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ..core.compiled.kernel import kernel
from ..core.compiled.scalar import exp
from ..core.portable_math import Array, BoolArray, IntArray
from .fixed_point import SLOPE, activate, leaky_relu, product, round_weights, rounded, tanh
from .weights import Weights, layer_count

_ATTENTION_SLOPE = 0.2  # of the leaky ReLU inside the attention, the default of GATv2Conv
_LINEAR = 1.0  # slope of a leaky ReLU that changes nothing


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
    arrays = {name: np.ascontiguousarray(round_weights(array)) for name, array in weights.arrays.items()}
    return Rgcn(arrays) if weights.kind == "rgcn" else GatV2(arrays)


class Rgcn:
    """Relational graph convolutions with leaky ReLU between the layers and tanh at the end.

    Exact as long as the edges into a node times the width stay below 2^15: 650 nodes at a width of 50.

    Args:
        arrays: for each layer k `layer{k}.weight` (R, in, out) and `layer{k}.bias` (out,).
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._layers = [(list(weight), bias) for weight, bias in _layers(arrays, "layer")]  # a weight per relation

    def __call__(self, x: Array, edges: IntArray, relation: IntArray) -> Array:
        """See `Network`."""
        h, edges, relation = _rounded_graph(x, edges, relation)
        needed = _needed_nodes(edges, relation, len(h), len(self._layers[0][0]), len(self._layers))
        for k, (weights, bias) in enumerate(self._layers):
            # The edges of one relation into one node share a row: the sum of their sources, multiplied once.
            rows, destination, ends = _gather(h, edges, relation, needed[k], len(weights))
            out, start = np.empty((len(rows), len(bias))), 0
            for weight, end in zip(weights, ends.tolist(), strict=True):
                if end > start:
                    product(rows[start:end], weight, out[start:end])
                start = end
            h = _scatter(out, destination, len(h))
            activate(h, bias, _LINEAR if k == len(self._layers) - 1 else SLOPE)
        return np.array([tanh(value) for value in h[0].tolist()])


class GatV2:
    """A dense encoder of each node, graph attention layers with residuals, and a dense head at the hub.

    Args:
        arrays: `encoder{k}` and `head{k}`, each with `.weight` (in, out) and `.bias` (out,); for each attention layer
            `conv{k}.source` and `conv{k}.target` likewise, `conv{k}.relation` (R, H C), `conv{k}.attention` (H, C) and
            `conv{k}.bias` (H C,), for H heads of width C.
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._encoder, self._head = _layers(arrays, "encoder"), _layers(arrays, "head")
        names = ("source.weight", "source.bias", "target.weight", "target.bias", "relation", "attention", "bias")
        self._attention = [[arrays[f"conv{k}.{name}"] for name in names] for k in range(layer_count(arrays, "conv"))]
        self._relations = len(arrays["conv0.relation"]) if self._attention else 0

    def __call__(self, x: Array, edges: IntArray, relation: IntArray) -> Array:
        """See `Network`."""
        h, edges, relation = _rounded_graph(x, edges, relation)
        for weight, bias in self._encoder:
            h = _dense(h, weight, bias, SLOPE)
        encoded = h[:1].copy()
        needed = _needed_nodes(edges, relation, len(h), self._relations, len(self._attention))
        for layer, is_needed in zip(self._attention, needed, strict=True):
            source_weight, source_bias, target_weight, target_bias, relation_vector, attention, bias = layer
            source = _dense(h, source_weight, source_bias, _LINEAR)
            target = _dense(h, target_weight, target_bias, _LINEAR)
            _attend(h, source, target, relation_vector, attention, bias, edges, relation, is_needed)
        h = np.concatenate((h[:1], encoded), axis=1)
        for k, (weight, bias) in enumerate(self._head):
            h = _dense(h, weight, bias, _LINEAR if k == len(self._head) - 1 else SLOPE)
        return np.array([tanh(value) for value in h[0].tolist()])


def _layers(arrays: Mapping[str, Array], name: str) -> list[tuple[Array, Array]]:
    """Weight and bias of each layer of a name."""
    return [(arrays[f"{name}{k}.weight"], arrays[f"{name}{k}.bias"]) for k in range(layer_count(arrays, name))]


def _dense(h: Array, weight: Array, bias: Array, slope: float) -> Array:
    """A dense layer with leaky ReLU; (n, in) to (n, out)."""
    out = product(h, weight)
    activate(out, bias, slope)
    return out


def _rounded_graph(x: Array, edges: IntArray, relation: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Rounded inputs, edges and relations as arrays that kernels take."""
    h = np.array(x, dtype=float)
    activate(h, np.zeros(h.shape[1]), _LINEAR)
    return h, np.ascontiguousarray(edges, dtype=np.int64), np.ascontiguousarray(relation, dtype=np.int64)


@kernel
def _needed_nodes(edges: IntArray, relation: IntArray, count: int, relations: int, layers: int) -> BoolArray:
    """Find the nodes whose values influence the hub after the last layer.

    Args:
        edges: (2, E), source and destination.
        relation: (E,).
        count: number of nodes.
        relations: number of relations.
        layers: number of layers.

    Returns:
        (layers, count), whether the output of a layer at a node is needed.

    Raises:
        IndexError: an edge has a node or a relation that does not exist.
    """
    for e in range(len(relation)):
        if not (min(edges[0, e], edges[1, e]) >= 0 and max(edges[0, e], edges[1, e]) < count):
            raise IndexError("an edge joins nodes that the graph does not have")
        if layers > 0 and not 0 <= relation[e] < relations:
            raise IndexError("an edge has a relation that the network does not have")
    needed = np.zeros((layers, count), dtype=np.bool_)
    for k in range(layers - 1, -1, -1):
        if k == layers - 1:
            needed[k, 0] = True
            continue
        for i in range(count):
            needed[k, i] = needed[k + 1, i]
        for e in range(len(relation)):
            if needed[k + 1, edges[1, e]]:
                needed[k, edges[0, e]] = True
    return needed


@kernel
def _gather(
    h: Array, edges: IntArray, relation: IntArray, needed: BoolArray, relations: int
) -> tuple[Array, IntArray, IntArray]:
    """Sum up the sources of the edges of each relation into each node.

    Args:
        h: (N, width), rounded values.
        edges: (2, E), source and destination.
        relation: (E,).
        needed: (N,), whether the sums at a node are needed.
        relations: number of relations.

    Returns:
        (K, width) sums, ordered by relation and node; (K,) their nodes; and for each relation the end of its rows.
    """
    count, width = h.shape
    row_of = np.zeros((relations, count), dtype=np.int64)  # 1 + row; 0: none
    for e in range(len(relation)):
        if needed[edges[1, e]]:
            row_of[relation[e], edges[1, e]] = 1
    destination, ends, total = np.empty(len(relation), dtype=np.int64), np.empty(relations, dtype=np.int64), 0
    for r in range(relations):
        for i in range(count):
            if row_of[r, i] > 0:
                destination[total] = i
                total += 1
                row_of[r, i] = total
        ends[r] = total
    rows = np.zeros((total, width))
    for e in range(len(relation)):
        if needed[edges[1, e]]:
            source, row = edges[0, e], row_of[relation[e], edges[1, e]] - 1
            for c in range(width):
                rows[row, c] += h[source, c]
    return rows, destination[:total], ends


@kernel
def _scatter(rows: Array, destination: IntArray, count: int) -> Array:
    """Add up rows by node; (K, width) and (K,) to (count, width)."""
    out = np.zeros((count, rows.shape[1]))
    for k in range(len(destination)):
        for c in range(rows.shape[1]):
            out[destination[k], c] += rows[k, c]
    return out


@kernel
def _attend(
    h: Array,
    source: Array,
    target: Array,
    relation_vector: Array,
    attention: Array,
    bias: Array,
    edges: IntArray,
    relation: IntArray,
    needed: BoolArray,
) -> None:
    """Add to each needed node the activated, attention-weighted sum over its incoming edges, for H heads of width C.

    Args:
        h: (N, H C), changed in place.
        source, target: (N, H C), transformed values at both ends of an edge.
        relation_vector: (R, H C).
        attention: (H, C).
        bias: (H C,).
        edges: (2, E), source and destination.
        relation: (E,).
        needed: (N,).
    """
    (count, width), (heads, size) = h.shape, attention.shape
    hidden, score = np.empty(width), np.empty((len(relation), heads))
    highest, total, out = np.empty((count, heads)), np.zeros((count, heads)), np.zeros((count, heads, size))
    source_of_head, flat_out = source.reshape((count, heads, size)), out.reshape((count, width))
    for i in range(count):
        for k in range(heads):
            highest[i, k] = -math.inf
    for e in range(len(relation)):
        start, end, r = edges[0, e], edges[1, e], relation[e]
        if needed[end]:
            for c in range(width):
                value = source[start, c] + target[end, c] + relation_vector[r, c]
                hidden[c] = rounded(leaky_relu(value, _ATTENTION_SLOPE))
            for k in range(heads):
                dot = 0.0
                for c in range(size):
                    dot += hidden[k * size + c] * attention[k, c]
                score[e, k], highest[end, k] = dot, max(highest[end, k], dot)
    # Softmax over the incoming edges; the maximum is subtracted first, so that exp cannot overflow.
    for e in range(len(relation)):
        end = edges[1, e]
        if needed[end]:
            for k in range(heads):
                score[e, k] = rounded(exp(score[e, k] - highest[end, k]))
                total[end, k] += score[e, k]
    for e in range(len(relation)):
        start, end = edges[0, e], edges[1, e]
        if needed[end]:
            for k in range(heads):
                coefficient = rounded(score[e, k] / max(total[end, k], 1e-9))
                for c in range(size):
                    out[end, k, c] += rounded(coefficient * source_of_head[start, k, c])
    for i in range(count):
        if needed[i]:
            for c in range(width):
                h[i, c] = rounded(h[i, c] + leaky_relu(flat_out[i, c] + bias[c], SLOPE))
