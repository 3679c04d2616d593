"""The networks of the use case, if PyTorch Geometric is installed: export, deterministic training, report."""

from __future__ import annotations

import importlib
import json
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sonata2d import generate_dataset, load_scenario, read_episode
from sonata2d.datasets import split_dataset
from sonata2d.learning import GraphPolicy, inputs_of, read_weights
from sonata2d.learning.graph import modern_graph, paper_graphs
from sonata2d.learning.network import network_of

from .test_use_case import USE_CASE

pytestmark = pytest.mark.filterwarnings("ignore")  # warnings of PyTorch


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The modules of the use case, including those that import PyTorch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("torch_geometric", reason="not installed; pip install 'sonata2d[learn]'")
        sys.path.insert(0, str(USE_CASE))
        names = ("samples", "networks", "train", "evaluate", "report")
        yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(USE_CASE))
    for name in names:
        del sys.modules[name]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small data set with the three parts."""
    folder = tmp_path_factory.mktemp("runs") / "data"
    generate_dataset(folder, load_scenario("sonata-2020"), episodes=12, seed=3)
    split_dataset(folder, {"train": 0.6, "dev": 0.2, "test": 0.2})
    return folder


@pytest.mark.parametrize("name", ["paper", "attention"])
def test_exported_weights_give_the_outputs_of_the_trained_network(
    modules: dict[str, ModuleType], data: Path, tmp_path: Path, name: str
) -> None:
    import torch

    out = modules["train"].train(name, [data], tmp_path / name, epochs=2)
    network = modules["networks"].NETWORKS[name]()
    network.load_state_dict(torch.load(out / "best.pt", weights_only=True))
    exported = network_of(read_weights((out / "policy.npz").resolve()))
    record = read_episode(data / "000001.json")
    for graph in paper_graphs(record) if name == "paper" else [modern_graph(record, k, instants=1) for k in (0, 20)]:
        x, edges, relation = inputs_of(graph), graph.edges, graph.relation
        inputs = [torch.tensor(array) for array in (x.astype(np.float32), edges, relation, np.zeros(1, dtype=int))]
        with torch.no_grad():
            wanted = network(*inputs).numpy()[0]
        assert exported(x, edges, relation) == pytest.approx(wanted, abs=5e-3)
    assert GraphPolicy(out / "policy.npz").settings()["sha256"]


def test_sparse_layer_equals_rgcnconv(modules: dict[str, ModuleType]) -> None:
    import torch
    from torch_geometric.nn import RGCNConv

    torch.manual_seed(1)
    sizes: Any = (6, 5, 4)
    sparse = modules["networks"].SparseRGCNConv(*sizes, num_bases=3, aggr="add", root_weight=False)
    dense = RGCNConv(*sizes, num_bases=3, aggr="add", root_weight=False)
    dense.load_state_dict(sparse.state_dict())
    x, edges, relation = torch.randn(9, 6), torch.randint(9, (2, 40)), torch.randint(4, (40,))
    assert torch.allclose(sparse(x, edges, relation), dense(x, edges, relation), atol=1e-6)


def test_part_without_runs_is_an_error_before_training(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    generate_dataset(tmp_path / "whole", load_scenario("empty"), "straight-to-goal", episodes=1)
    with pytest.raises(ValueError, match="whole has no runs for dev"):
        modules["train"].train("attention", [tmp_path / "whole"], tmp_path / "out")


def test_mean_shows_the_number_of_defined_values(modules: dict[str, ModuleType]) -> None:
    mean_with_interval = modules["report"].mean_with_interval
    assert mean_with_interval([1.0] * 8) == "1.000 [1.000, 1.000]"
    assert mean_with_interval([1.0] * 7 + [None]) == "1.000 [1.000, 1.000] (n=7)"
    assert mean_with_interval([None, None]) == "not defined"


def test_interrupted_training_ends_with_the_same_bytes(
    modules: dict[str, ModuleType], data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = modules["train"]
    uninterrupted = train.train("attention", [data], tmp_path / "whole", epochs=4)
    save_state, epochs = train._Training._save_state, []

    def save_and_interrupt(training: Any) -> None:
        save_state(training)
        epochs.append(training.epoch)
        if len(epochs) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(train._Training, "_save_state", save_and_interrupt)
    with pytest.raises(KeyboardInterrupt):
        train.train("attention", [data], tmp_path / "parted", epochs=4)
    continued = train.train("attention", [data], tmp_path / "parted", epochs=4)
    assert epochs == [1, 2, 3, 4]
    assert (continued / "policy.npz").read_bytes() == (uninterrupted / "policy.npz").read_bytes()
    results = [json.loads((folder / "training.json").read_text()) for folder in (uninterrupted, continued)]
    assert results[0]["error"] == results[1]["error"]
    assert results[0]["log"] == results[1]["log"]
