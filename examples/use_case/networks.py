"""The networks in PyTorch Geometric: the paper's, and one with graph attention; export to the weights of `GraphPolicy`.

Shapes: S graphs with N nodes and E edges in all; edges count the nodes of the whole batch.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, one_hot
from torch_geometric.nn import GATv2Conv, RGCNConv

from sonata2d.learning import Weights, write_weights
from sonata2d.learning.weights import GRAPHS

(PAPER_INPUTS, PAPER_RELATIONS), (INPUTS, RELATIONS) = GRAPHS["paper"], GRAPHS["modern"]
SIZES = (PAPER_INPUTS, 50, 40, 30, 15, 3)


class SparseRGCNConv(RGCNConv):
    """`RGCNConv` that multiplies only the rows that have edges of a relation: the same sums, several times as fast."""

    def forward(self, x: Tensor, edge_index: Tensor, edge_type: Tensor) -> Tensor:
        """(N, in) to (N, out), as `RGCNConv.forward` without its options."""
        # Each pair of relation and destination node gets one row: the sum of its sources, multiplied once. The keys
        # are sorted, so the rows of a relation are contiguous.
        keys = edge_type * len(x) + edge_index[1]
        unique, row = torch.unique(keys, return_inverse=True)
        gathered = x.new_zeros(len(unique), x.shape[1]).index_add_(0, row, x[edge_index[0]])
        ends = torch.searchsorted(unique, torch.arange(1, self.num_relations + 1, device=x.device) * len(x)).tolist()
        weight = (self.comp @ self.weight.view(self.num_bases, -1)).view(-1, *self.weight.shape[1:])
        rows = [gathered[a:b] @ weight[k] for k, (a, b) in enumerate(zip([0, *ends], ends, strict=False)) if b > a]
        return x.new_zeros(len(x), self.out_channels).index_add_(0, unique % len(x), torch.cat(rows)) + self.bias


class PaperNetwork(nn.Module):
    """R-GCN 42-50-40-30-15-3 with 20 bases and sums, leaky ReLU, tanh; the output is read at the newest room node.

    Source: B. Baghel et al., "A Toolkit to Generate Social Navigation Datasets", WAF 2020 (SONATA).
    """

    kind, graph = "rgcn", "paper"

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.ModuleList(
            SparseRGCNConv(a, b, PAPER_RELATIONS, num_bases=20, aggr="add", root_weight=False)
            for a, b in pairwise(SIZES)
        )

    def forward(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> Tensor:
        """Return the commands of S graphs.

        Args:
            x: (N, 42), inputs of the nodes.
            edges: (2, E), source and destination nodes.
            relation: (E,), relation of each edge.
            hub: (S,), the node of each graph at which the output is read.

        Returns:
            (S, 3), within ±1: fractions of the robot's limits.
        """
        for layer in self.layers[:-1]:
            x = leaky_relu(layer(x, edges, relation))
        return torch.tanh(self.layers[-1](x, edges, relation))[hub]

    def scale_weights(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> None:
        """Scale the initial weights of each layer to an output of unit variance, of the last one to a tenth of its std.

        Otherwise sums over sixty nodes saturate the last tanh, and its gradient vanishes.

        Args:
            x, edges, relation, hub: a batch, as of `forward`.

        Source: D. Mishkin & J. Matas, "All you need is a good init", ICLR 2016.
        """
        with torch.no_grad():
            for layer in self.layers:
                is_last = layer is self.layers[-1]
                out = layer(x, edges, relation)
                layer.weight /= (out[hub] if is_last else out).std() * (10.0 if is_last else 1.0)
                x = leaky_relu(layer(x, edges, relation))

    def arrays(self) -> Mapping[str, Tensor]:
        """Return the weights as `sonata2d.learning.network.Rgcn` takes them."""
        arrays = {}
        for k, layer in enumerate(self.layers):
            arrays[f"layer{k}.weight"] = torch.einsum("rb,bio->rio", layer.comp, layer.weight)
            arrays[f"layer{k}.bias"] = layer.bias
        return arrays


class AttentionNetwork(nn.Module):
    """Two dense layers for each node, three of GATv2 by relation with residuals, two dense layers at the robot's node.

    Args:
        width: of the hidden layers.
        heads: of each attention layer; divides `width`.
        layers: number of attention layers.
    """

    kind, graph = "gatv2", "modern"

    def __init__(self, width: int = 64, heads: int = 4, layers: int = 3) -> None:
        super().__init__()
        self.encoder = nn.ModuleList([nn.Linear(INPUTS, width), nn.Linear(width, width)])
        self.convs = nn.ModuleList(
            GATv2Conv(width, width // heads, heads, edge_dim=RELATIONS, add_self_loops=False) for _ in range(layers)
        )
        self.head = nn.ModuleList([nn.Linear(2 * width, width), nn.Linear(width, 3)])

    def scale_weights(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> None:
        """Do nothing: PyTorch's initial weights train well in this network."""

    def forward(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> Tensor:
        """Return the commands of S graphs; (N, 31) to (S, 3), as `PaperNetwork.forward`."""
        for dense in self.encoder:
            x = leaky_relu(dense(x))
        encoded, edge_features = x, one_hot(relation, RELATIONS).to(x.dtype)
        for conv in self.convs:
            x = x + leaky_relu(conv(x, edges, edge_features))
        hidden = leaky_relu(self.head[0](torch.cat((x[hub], encoded[hub]), dim=1)))
        return torch.tanh(self.head[1](hidden))

    def arrays(self) -> Mapping[str, Tensor]:
        """Return the weights as `sonata2d.learning.network.GatV2` takes them."""
        arrays = {}
        for name, part in (("encoder", self.encoder), ("head", self.head)):
            for k, dense in enumerate(part):
                arrays |= _dense_arrays(f"{name}{k}", dense)
        for k, conv in enumerate(self.convs):
            arrays |= _dense_arrays(f"conv{k}.source", conv.lin_l) | _dense_arrays(f"conv{k}.target", conv.lin_r)
            arrays[f"conv{k}.relation"] = conv.lin_edge.weight.T
            arrays |= {f"conv{k}.attention": conv.att[0], f"conv{k}.bias": conv.bias}
        return arrays


NETWORKS = {"paper": PaperNetwork, "attention": AttentionNetwork}


def _dense_arrays(name: str, dense: Any) -> dict[str, Tensor]:
    return {f"{name}.weight": dense.weight.T, f"{name}.bias": dense.bias}


def export(network: PaperNetwork | AttentionNetwork, path: Path, note: Mapping[str, Any]) -> None:
    """Write the weights of a network to a file that `--controller` accepts.

    Args:
        network: a trained network.
        path: ends in .npz.
        note: how the weights were made, for human readers.
    """
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in network.arrays().items()}
    write_weights(path, Weights(network.graph, network.kind, arrays, note))
