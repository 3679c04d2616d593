"""The networks of `graph-policy`, forward only: relational graph convolution and graph attention, in fixed point.

They compute what PyTorch Geometric's `RGCNConv` (sums, no root weight) and `GATv2Conv` do, to the fixed point's
precision.

Sources: R-GCN, M. Schlichtkrull et al., ESWC 2018, eq. 2 (without the constant c); GATv2, S. Brody, U. Alon &
E. Yahav, ICLR 2022, eq. 7, with the relation's vector inside the non-linearity.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from ..core.portable_math import Array, exp
from .fixed_point import dots, leaky, product, summed, tanh, values, weights
from .weights import Weights, layers

ATTENTION_SLOPE = 0.2  # of the leaky ReLU within the attention, as GATv2Conv's


class Network(Protocol):
    """Answers what the hub of the newest instant should do."""

    def __call__(self, x: Array, edges: Any, relation: Any) -> Array:
        """The answer.

        Args:
            x: (N, F), inputs of the nodes; the first is the hub of the newest instant.
            edges: (2, E) of int, from and to.
            relation: (E,) of int.

        Returns:
            (3,), within ±1.
        """
        ...


def network_of(found: Weights) -> Network:
    """The network that the weights are of; what `read_weights` gives fits."""
    arrays = {name: weights(array) for name, array in found.arrays.items()}
    return Rgcn(arrays) if found.kind == "rgcn" else GatV2(arrays)


class Rgcn:
    """Layers of relational graph convolution, leaky ReLU between them, tanh at the end.

    Exact as long as the edges into a node times the numbers of a node stay under 2^15: 650 nodes at a width of 50.

    Args:
        arrays: of each layer k `layer{k}.weight` (R, in, out) and `layer{k}.bias` (out,).
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._layers = [(arrays[f"layer{k}.weight"], arrays[f"layer{k}.bias"]) for k in range(layers(arrays, "layer"))]

    def __call__(self, x: Array, edges: Any, relation: Any) -> Array:
        """See `Network`."""
        h, last = values(x), len(self._layers) - 1
        kinds = [(kind, *_gathering(edges[:, relation == kind], len(h))) for kind in np.unique(relation).tolist()]
        for k, (weight, bias) in enumerate(self._layers):
            out = np.zeros((len(h), weight.shape[2])) + bias
            for kind, to, gather in kinds:
                out[to] += product(product(gather, h), weight[kind])
            h = values(out if k == last else leaky(out))
        return tanh(h[0])


class GatV2:
    """An encoder of nodes, layers of graph attention with residuals, and a head at the hub.

    Args:
        arrays: `encoder{k}`, `head{k}`, each with `.weight` (in, out) and `.bias`; of each attention layer
            `conv{k}.source` and `conv{k}.target`, alike, `conv{k}.relation` (R, H C), `conv{k}.attention` (H, C) and
            `conv{k}.bias` (H C,).
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._arrays = arrays
        self._layers = layers(arrays, "conv")

    def __call__(self, x: Array, edges: Any, relation: Any) -> Array:
        """See `Network`."""
        first = h = self._dense("encoder", values(x), bend_last=True)
        for k in range(self._layers):
            h = values(h + leaky(self._attended(f"conv{k}", h, edges, relation)))
        return tanh(self._dense("head", np.concatenate((h[:1], first[:1]), axis=1), bend_last=False)[0])

    def _linear(self, name: str, h: Array) -> Array:
        return product(h, self._arrays[f"{name}.weight"]) + self._arrays[f"{name}.bias"]

    def _dense(self, name: str, h: Array, *, bend_last: bool) -> Array:
        """Fully connected layers with leaky ReLU between them."""
        count = layers(self._arrays, name)
        for k in range(count):
            out = self._linear(f"{name}{k}", h)
            h = values(leaky(out) if bend_last or k < count - 1 else out)
        return h

    def _attended(self, name: str, h: Array, edges: Any, relation: Any) -> Array:
        """(N, H C): what each node takes from those that point to it."""
        attention = self._arrays[f"{name}.attention"]
        shape, (start, end) = (-1, *attention.shape), edges
        source = values(self._linear(f"{name}.source", h)).reshape(shape)
        target = values(self._linear(f"{name}.target", h)).reshape(shape)
        tie = self._arrays[f"{name}.relation"][relation].reshape(shape)
        bent = values(leaky(source[start] + target[end] + tie, ATTENTION_SLOPE))
        score = dots(bent, attention)  # (E, H)
        highest = np.full((len(h), score.shape[1]), -np.inf)
        np.maximum.at(highest, end, score)
        share = values(exp(score - highest[end]))
        share = values(share / np.maximum(summed(share, end, len(h)), 1e-9)[end])
        taken = summed(values(share[:, :, None] * source[start]), end, len(h))
        return taken.reshape(len(h), -1) + self._arrays[f"{name}.bias"]


def _gathering(edges: Any, count: int) -> tuple[Any, Array]:
    """The nodes that edges of a relation point to, (K,), and (K, count) to sum what they take of (count, …)."""
    to, row = np.unique(edges[1], return_inverse=True)
    gather = np.zeros((len(to), count))
    np.add.at(gather, (row, edges[0]), 1.0)  # an edge may be there twice
    return to, gather
