"""The networks agree with their papers to the precision of the fixed-point numbers, and always give the same bits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from sonata2d.core.portable_math import Array
from sonata2d.learning.fixed_point import BLOCK, LARGEST_VALUE, UNIT, product, round_weights, rounded
from sonata2d.learning.network import network_of
from sonata2d.learning.weights import Weights

from .samples import ALL, RELATIONS_OF, random_graph, random_weights

Row = list[float]


def leaky_relu(row: Row, slope: float = 0.01) -> Row:
    return [v if v > 0.0 else slope * v for v in row]


def linear(row: Row, weight: Any, bias: Any) -> Row:
    return [bias[j] + sum(row[i] * weight[i][j] for i in range(len(row))) for j in range(len(bias))]


def reference_rgcn(arrays: Mapping[str, Any], x: Any, edges: Any, relation: Any) -> Row:
    """Schlichtkrull et al. 2018, eq. 2, without constant and self-loop: node by node, edge by edge."""
    h, count = [list(row) for row in x], sum(name.endswith("weight") for name in arrays)
    for k in range(count):
        weight, bias = arrays[f"layer{k}.weight"], arrays[f"layer{k}.bias"]
        out = [list(bias) for _ in h]
        for start, end, kind in zip(*edges, relation, strict=True):
            sent = linear(h[start], weight[kind], [0.0] * len(bias))
            out[end] = [a + b for a, b in zip(out[end], sent, strict=True)]
        h = [row if k == count - 1 else leaky_relu(row) for row in out]
    return [math.tanh(v) for v in h[0]]


def reference_gatv2(arrays: Mapping[str, Any], x: Any, edges: Any, relation: Any) -> Row:
    """Brody et al. 2022, eq. 7, with the relation's vector inside: node by node, head by head."""

    def dense(name: str, row: Row) -> Row:
        return linear(row, arrays[f"{name}.weight"], arrays[f"{name}.bias"])

    h = first = [leaky_relu(dense("encoder1", leaky_relu(dense("encoder0", list(row))))) for row in x]
    for k in range(2):
        attention, relation_vector = arrays[f"conv{k}.attention"], arrays[f"conv{k}.relation"]
        source, target = ([dense(f"conv{k}.{side}", row) for row in h] for side in ("source", "target"))
        heads, size = attention.shape
        new = []
        for node, row in enumerate(h):
            incoming = [(a, r) for a, b, r in zip(*edges, relation, strict=True) if b == node]
            out = list(arrays[f"conv{k}.bias"])
            for head in range(heads):
                columns = range(head * size, (head + 1) * size)
                scores = []
                for a, r in incoming:
                    hidden = leaky_relu([source[a][c] + target[node][c] + relation_vector[r][c] for c in columns], 0.2)
                    scores.append(sum(attention[head][c] * hidden[c] for c in range(size)))
                total = sum(map(math.exp, scores))
                for c in columns:
                    terms = zip(scores, incoming, strict=True)
                    out[c] += sum(math.exp(score) / total * source[a][c] for score, (a, _) in terms)
            new.append([a + b for a, b in zip(row, leaky_relu(out), strict=True)])
        h = new
    return [math.tanh(v) for v in dense("head1", leaky_relu(dense("head0", h[0] + first[0])))]


@pytest.mark.parametrize(("graph", "kind"), ALL)
@pytest.mark.parametrize("seed", range(3))
def test_network_agrees_with_its_paper(graph: str, kind: str, seed: int) -> None:
    weights, (x, edges, relation) = random_weights(graph, kind, seed), random_graph(graph, seed)
    answer = network_of(weights)(x, edges, relation)
    reference = reference_rgcn if kind == "rgcn" else reference_gatv2
    assert answer == pytest.approx(reference(weights.arrays, x, edges, relation), abs=3e-3)
    assert np.abs(answer).max() > 0.05


@pytest.mark.filterwarnings("ignore")  # of PyTorch itself, when it is imported
@pytest.mark.parametrize("seed", range(2))
def test_rgcn_agrees_with_pytorch_geometric(seed: int) -> None:
    torch, nn = pytest.importorskip("torch"), pytest.importorskip("torch_geometric.nn")
    weights, (x, edges, relation) = random_weights("paper", "rgcn", seed), random_graph("paper", seed)
    h, ends, kinds = (torch.from_numpy(np.ascontiguousarray(part)) for part in (x, edges, relation))
    for k in range(3):
        weight, bias = weights.arrays[f"layer{k}.weight"], weights.arrays[f"layer{k}.bias"]
        layer = nn.RGCNConv(*weight.shape[1:], len(weight), aggr="add", root_weight=False).double()
        layer.weight.data, layer.bias.data = torch.from_numpy(weight), torch.from_numpy(bias)
        h = layer(h, ends, kinds)
        h = torch.tanh(h) if k == 2 else torch.nn.functional.leaky_relu(h)
    assert network_of(weights)(x, edges, relation) == pytest.approx(h[0].tolist(), abs=3e-3)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(2))
def test_gatv2_agrees_with_pytorch_geometric(seed: int) -> None:
    torch, nn = pytest.importorskip("torch"), pytest.importorskip("torch_geometric.nn")
    weights, (x, edges, relation) = random_weights("modern", "gatv2", seed), random_graph("modern", seed)
    arrays = {name: torch.from_numpy(array) for name, array in weights.arrays.items()}
    ends, activation = torch.from_numpy(np.ascontiguousarray(edges)), torch.nn.functional.leaky_relu
    kinds = torch.nn.functional.one_hot(torch.from_numpy(relation), RELATIONS_OF["modern"]).double()

    def dense(name: str, h: Any) -> Any:
        return h @ arrays[f"{name}.weight"] + arrays[f"{name}.bias"]

    h = first = activation(dense("encoder1", activation(dense("encoder0", torch.from_numpy(x)))))
    for k in range(2):
        layer = nn.GATv2Conv(12, 4, 3, edge_dim=RELATIONS_OF["modern"], add_self_loops=False).double()
        for side, part in ((layer.lin_l, "source"), (layer.lin_r, "target")):
            side.weight.data, side.bias.data = arrays[f"conv{k}.{part}.weight"].T, arrays[f"conv{k}.{part}.bias"]
        layer.lin_edge.weight.data, layer.att.data = arrays[f"conv{k}.relation"].T, arrays[f"conv{k}.attention"][None]
        layer.bias.data = arrays[f"conv{k}.bias"]
        h = h + activation(layer(h, ends, kinds))
    expected = torch.tanh(dense("head1", activation(dense("head0", torch.cat((h[0], first[0]))))))
    assert network_of(weights)(x, edges, relation) == pytest.approx(expected.tolist(), abs=3e-3)


@pytest.mark.parametrize(("graph", "kind"), ALL)
def test_order_of_edges_and_nodes_changes_no_bit(graph: str, kind: str) -> None:
    rng, network = np.random.default_rng(5), network_of(random_weights(graph, kind, 4))
    x, edges, relation = random_graph(graph, 4, nodes=60, edges=500)
    x[:, 3] *= 40.0  # some values are clipped
    answer = network(x, edges, relation)
    for _ in range(5):
        order, place = rng.permutation(len(relation)), np.concatenate(([0], 1 + rng.permutation(len(x) - 1)))
        new_index = np.argsort(place)
        assert network(x[place], new_index[edges[:, order]], relation[order]).tolist() == answer.tolist()


@pytest.mark.parametrize(("graph", "kind"), ALL)
def test_order_of_summation_changes_no_bit(graph: str, kind: str) -> None:
    """The partial sums of any BLAS are among those of all orders of the inputs."""
    rng, weights = np.random.default_rng(6), random_weights(graph, kind, 6)
    x, edges, relation = random_graph(graph, 6)
    first = "layer0.weight" if kind == "rgcn" else "encoder0.weight"
    answer = network_of(weights)(x, edges, relation)
    for _ in range(5):
        order = rng.permutation(x.shape[1])
        arrays = {**weights.arrays, first: np.take(weights.arrays[first], order, axis=-2)}
        again = network_of(Weights(graph, kind, arrays, {}))(x[:, order], edges, relation)
        assert again.tolist() == answer.tolist()


def round_values(values: Array) -> Array:
    return np.array([rounded(value) for value in values.ravel().tolist()]).reshape(values.shape)


def test_values_are_clipped_and_rounded_half_to_even() -> None:
    """Python's `round` rounds half to even, and multiplying by a power of two is exact."""
    rng = np.random.default_rng(1)
    ties = (rng.integers(-(2**19), 2**19, 500) + 0.5) * UNIT
    values = [*rng.normal(0.0, 30.0, 500).tolist(), *ties.tolist(), 0.0, 64.0, -64.0, 1e300, -1e300]
    for value in values:
        assert rounded(value) == round(max(min(value, LARGEST_VALUE), -LARGEST_VALUE) / UNIT) * UNIT


def test_product_is_exact_up_to_the_documented_length() -> None:
    rng = np.random.default_rng(7)
    a, b = round_values(rng.uniform(63.0, 65.0, 2**15)), round_weights(rng.uniform(7.0, 8.0, 2**15))
    assert a.max() == 64.0
    exact = sum(int(p / UNIT) * int(q / UNIT) for p, q in zip(a.tolist(), b.tolist(), strict=True))
    assert exact < 2**53
    sequential = 0.0
    for p, q in zip(a.tolist()[::-1], b.tolist()[::-1], strict=True):
        sequential += p * q
    assert float(product(a[None], b[:, None])[0, 0]) == sequential == exact * UNIT * UNIT


def test_large_product_is_the_same_in_blocks() -> None:
    rng = np.random.default_rng(8)
    a, b = round_values(rng.normal(0.0, 9.0, (1000, 64))), round_weights(rng.uniform(-8.0, 8.0, (64, 50)))
    assert a.size * b.shape[1] > 10 * BLOCK
    out = np.empty((1000, 50))
    assert product(a, b, out) is out
    assert np.array_equal(out, a @ b)
    assert np.array_equal(product(a[:, ::-1].copy(), b[::-1].copy()), a @ b)


def test_isolated_nodes_do_not_change_the_answer() -> None:
    for graph, kind in ALL:
        network, (x, edges, relation) = network_of(random_weights(graph, kind)), random_graph(graph, 8)
        with_isolated = np.concatenate((x, 9.0 * np.ones((4, x.shape[1]))))
        assert network(with_isolated, edges, relation).tolist() == network(x, edges, relation).tolist()


def test_graph_without_edges_has_an_answer() -> None:
    for graph, kind in ALL:
        x, no_edges = random_graph(graph, 9)[0], np.zeros((2, 0), dtype=np.int64)
        answer = network_of(random_weights(graph, kind))(x, no_edges, no_edges[0])
        assert np.isfinite(answer).all()


def test_edges_beyond_the_graph_or_the_relations_are_refused() -> None:
    for graph, kind in ALL:
        network, (x, edges, relation) = network_of(random_weights(graph, kind)), random_graph(graph, 10)
        for node in (-1, len(x)):
            for end in (0, 1):
                wrong = edges.copy()
                wrong[end, 5] = node
                with pytest.raises(IndexError, match="nodes that the graph does not have"):
                    network(x, wrong, relation)
        for number in (-1, RELATIONS_OF[graph]):
            wrong = relation.copy()
            wrong[5] = number
            with pytest.raises(IndexError, match="a relation that the network does not have"):
                network(x, edges, wrong)
