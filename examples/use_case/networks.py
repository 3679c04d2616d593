"""The paper's network and a better one, in PyTorch Geometric; and how their weights become those of `graph-policy`."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, one_hot
from torch_geometric.nn import GATv2Conv, RGCNConv

from sonata2d.learning.weights import GRAPHS, Weights, write_weights

(PAPER_INPUTS, PAPER_RELATIONS), (INPUTS, RELATIONS) = GRAPHS["paper"], GRAPHS["modern"]
SIZES = (PAPER_INPUTS, 50, 40, 30, 15, 3)


class SparseRGCNConv(RGCNConv):
    """`RGCNConv` that multiplies only the rows that have edges of a relation: the same sums, several times as fast."""

    def forward(self, x: Tensor, edge_index: Tensor, edge_type: Tensor) -> Tensor:
        """(N, in) to (N, out), as `RGCNConv.forward` without its options."""
        keys = edge_type * len(x) + edge_index[1]
        found, row = torch.unique(keys, return_inverse=True)
        gathered = x.new_zeros(len(found), x.shape[1]).index_add_(0, row, x[edge_index[0]])
        ends = torch.searchsorted(found, torch.arange(1, self.num_relations + 1, device=x.device) * len(x)).tolist()
        weight = (self.comp @ self.weight.view(self.num_bases, -1)).view(-1, *self.weight.shape[1:])
        rows = [gathered[a:b] @ weight[k] for k, (a, b) in enumerate(zip([0, *ends], ends, strict=False)) if b > a]
        return x.new_zeros(len(x), self.out_channels).index_add_(0, found % len(x), torch.cat(rows)) + self.bias


class PaperNetwork(nn.Module):
    """R-GCN 42-50-40-30-15-3 with 20 bases and sums, leaky ReLU, tanh; read at the newest room.

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
        """(N, 42) to (S, 3)."""
        for layer in self.layers[:-1]:
            x = leaky_relu(layer(x, edges, relation))
        return torch.tanh(self.layers[-1](x, edges, relation))[hub]

    def settle(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> None:
        """Scale each layer's first weights so that what it gives has unit variance, the last one's a tenth of that.

        Sums over sixty nodes would else leave the last tanh saturated, with no gradient to learn from. Source: D.
        Mishkin & J. Matas, "All you need is a good init", ICLR 2016.
        """
        with torch.no_grad():
            for layer in self.layers:
                last = layer is self.layers[-1]
                out = layer(x, edges, relation)
                layer.weight /= (out[hub] if last else out).std() * (10.0 if last else 1.0)
                x = leaky_relu(layer(x, edges, relation))

    def arrays(self) -> Mapping[str, Tensor]:
        """As `sonata2d.learning.network.Rgcn` takes them."""
        found = {}
        for k, layer in enumerate(self.layers):
            found[f"layer{k}.weight"] = torch.einsum("rb,bio->rio", layer.comp, layer.weight)
            found[f"layer{k}.bias"] = layer.bias
        return found


class AttentionNetwork(nn.Module):
    """Two dense layers for each node, three of graph attention by relation, with residuals, two dense at the robot."""

    kind, graph = "gatv2", "modern"

    def __init__(self, width: int = 64, heads: int = 4, layers: int = 3) -> None:
        super().__init__()
        self.encoder = nn.ModuleList([nn.Linear(INPUTS, width), nn.Linear(width, width)])
        self.convs = nn.ModuleList(
            GATv2Conv(width, width // heads, heads, edge_dim=RELATIONS, add_self_loops=False) for _ in range(layers)
        )
        self.head = nn.ModuleList([nn.Linear(2 * width, width), nn.Linear(width, 3)])

    def settle(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> None:
        """The first weights are well as they are."""

    def forward(self, x: Tensor, edges: Tensor, relation: Tensor, hub: Tensor) -> Tensor:
        """(N, F) to (S, 3)."""
        for dense in self.encoder:
            x = leaky_relu(dense(x))
        first, told = x, one_hot(relation, RELATIONS).to(x.dtype)
        for conv in self.convs:
            x = x + leaky_relu(conv(x, edges, told))
        seen = leaky_relu(self.head[0](torch.cat((x[hub], first[hub]), dim=1)))
        return torch.tanh(self.head[1](seen))

    def arrays(self) -> Mapping[str, Tensor]:
        """As `sonata2d.learning.network.GatV2` takes them."""
        found = {}
        for name, part in (("encoder", self.encoder), ("head", self.head)):
            for k, dense in enumerate(part):
                found |= _dense(f"{name}{k}", dense)
        for k, conv in enumerate(self.convs):
            found |= _dense(f"conv{k}.source", conv.lin_l) | _dense(f"conv{k}.target", conv.lin_r)
            found[f"conv{k}.relation"] = conv.lin_edge.weight.T
            found |= {f"conv{k}.attention": conv.att[0], f"conv{k}.bias": conv.bias}
        return found


NETWORKS = {"paper": PaperNetwork, "attention": AttentionNetwork}


def _dense(name: str, dense: Any) -> dict[str, Tensor]:
    return {f"{name}.weight": dense.weight.T, f"{name}.bias": dense.bias}


def export(network: PaperNetwork | AttentionNetwork, path: Path, note: Mapping[str, Any]) -> None:
    """Write what the network has learned so that `--controller path` drives with it."""
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in network.arrays().items()}
    write_weights(path, Weights(network.graph, network.kind, arrays, note))
