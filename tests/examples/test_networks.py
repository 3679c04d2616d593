"""The use case's networks, where PyTorch Geometric is installed: what is trained is what drives."""

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

from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.split import split_dataset
from sonata2d.learning.graph.modern import inputs_of, modern_graph
from sonata2d.learning.graph.paper import paper_graphs
from sonata2d.learning.network import network_of
from sonata2d.learning.policy import GraphPolicy
from sonata2d.learning.weights import read_weights
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario

from .test_use_case import USE_CASE

pytestmark = pytest.mark.filterwarnings("ignore")  # of PyTorch's own


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
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
    folder = tmp_path_factory.mktemp("runs") / "data"
    generate_dataset(folder, load_scenario("sonata-2020"), episodes=12, seed=3)
    split_dataset(folder, {"train": 0.6, "dev": 0.2, "test": 0.2})
    return folder


@pytest.mark.parametrize("name", ["paper", "attention"])
def test_what_is_trained_is_what_drives(modules: dict[str, ModuleType], data: Path, tmp_path: Path, name: str) -> None:
    import torch

    out = modules["train"].train(name, [data], tmp_path / name, epochs=2)
    network = modules["networks"].NETWORKS[name]()
    network.load_state_dict(torch.load(out / "best.pt", weights_only=True))
    ours = network_of(read_weights((out / "policy.npz").resolve()))
    record = read_episode(data / "000001.json")
    for graph in paper_graphs(record) if name == "paper" else [modern_graph(record, k, instants=1) for k in (0, 20)]:
        x, edges, relation = inputs_of(graph), graph.edges, graph.relation
        told = [torch.tensor(array) for array in (x.astype(np.float32), edges, relation, np.zeros(1, dtype=int))]
        with torch.no_grad():
            wanted = network(*told).numpy()[0]
        assert ours(x, edges, relation) == pytest.approx(wanted, abs=5e-3)
    assert GraphPolicy(out / "policy.npz").settings()["sha256"]


def test_the_sparse_layer_gives_what_the_whole_one_gives(modules: dict[str, ModuleType]) -> None:
    import torch
    from torch_geometric.nn import RGCNConv

    torch.manual_seed(1)
    sizes: Any = (6, 5, 4)
    layer = modules["networks"].SparseRGCNConv(*sizes, num_bases=3, aggr="add", root_weight=False)
    whole = RGCNConv(*sizes, num_bases=3, aggr="add", root_weight=False)
    whole.load_state_dict(layer.state_dict())
    x, edges, relation = torch.randn(9, 6), torch.randint(9, (2, 40)), torch.randint(4, (40,))
    assert torch.allclose(layer(x, edges, relation), whole(x, edges, relation), atol=1e-6)


def test_a_part_without_runs_is_told_before_the_training(
    modules: dict[str, ModuleType], data: Path, tmp_path: Path
) -> None:
    generate_dataset(tmp_path / "whole", load_scenario("empty"), "straight-to-goal", episodes=1)
    with pytest.raises(ValueError, match="whole has no runs for dev"):
        modules["train"].train("attention", [tmp_path / "whole"], tmp_path / "out")


def test_a_mean_tells_of_how_many_runs_it_is(modules: dict[str, ModuleType]) -> None:
    mean = modules["report"].mean
    assert mean([1.0] * 8) == "1.000 [1.000, 1.000]"
    assert mean([1.0] * 7 + [None]) == "1.000 [1.000, 1.000] (n=7)"
    assert mean([None, None]) == "not defined"


def test_a_training_that_was_stopped_ends_with_the_same_bytes(
    modules: dict[str, ModuleType], data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = modules["train"]
    whole = train.train("attention", [data], tmp_path / "whole", epochs=4)
    keep, calls = train._Run._keep, []

    def interrupted(run: Any) -> None:
        keep(run)
        calls.append(run.epoch)
        if len(calls) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(train._Run, "_keep", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train.train("attention", [data], tmp_path / "parted", epochs=4)
    parted = train.train("attention", [data], tmp_path / "parted", epochs=4)
    assert calls == [1, 2, 3, 4]
    assert (parted / "policy.npz").read_bytes() == (whole / "policy.npz").read_bytes()
    told = [json.loads((folder / "training.json").read_text()) for folder in (whole, parted)]
    assert told[0]["error"] == told[1]["error"]
    assert told[0]["log"] == told[1]["log"]
