"""Streams give every episode once, in an order that the seed determines."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.datasets import stream as module
from sonata2d.learning import GraphSamples
from sonata2d.learning.graph import modern_graph, paper_graphs
from sonata2d.record.reader import read_episodes

from .test_generate import QUICK

pytestmark = pytest.mark.usefixtures("kept_processes")

EPISODES = 40


@pytest.fixture(scope="module", params=[None, 9])
def dataset(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> s2.Dataset:
    """Files, and shards."""
    out = tmp_path_factory.mktemp("stream") / "set"
    return s2.generate_dataset(out, QUICK, "straight-to-goal", episodes=EPISODES, seed=5, shard_size=request.param)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BLOCK", 4)


def numbers(stream: Any) -> list[int]:
    return [record.episode for record in stream]


def test_without_a_buffer_the_order_is_that_of_the_data_set(dataset: s2.Dataset) -> None:
    assert numbers(dataset.stream()) == list(range(EPISODES))
    assert numbers(dataset[5:12].stream()) == list(range(5, 12))
    assert numbers(dataset.stream(workers=2)) == list(range(EPISODES))


def test_an_order_depends_on_seed_and_epoch_only(dataset: s2.Dataset) -> None:
    stream = dataset.stream(shuffle=8, seed=1)
    first = numbers(stream)
    assert sorted(first) == list(range(EPISODES))
    assert first != sorted(first)
    assert numbers(stream) == first
    assert numbers(dataset.stream(shuffle=8, seed=1, workers=2)) == first
    stream.epoch = 1
    assert sorted(numbers(stream)) == list(range(EPISODES))
    assert numbers(stream) != first
    assert numbers(dataset.stream(shuffle=8, seed=2)) != first
    assert numbers(dataset.stream(shuffle=8, seed=1, epoch=1)) == numbers(stream)


def test_a_larger_buffer_mixes_more(dataset: s2.Dataset) -> None:
    def adjacent(buffer: int) -> int:
        order = numbers(dataset.stream(shuffle=buffer, seed=3))
        return sum(b == a + 1 for a, b in pairwise(order))

    assert adjacent(1) >= EPISODES - EPISODES // 4  # blocks only
    assert adjacent(16) < adjacent(1) / 2


def test_parts_share_the_episodes(dataset: s2.Dataset) -> None:
    parts = [numbers(dataset.stream(shuffle=8, seed=1, part=(k, 3))) for k in range(3)]
    assert sorted(number for part in parts for number in part) == list(range(EPISODES))
    assert all(len(part) >= 12 for part in parts)


def tagged(record: s2.EpisodeRecord) -> Iterator[tuple[int, int]]:
    yield from ((record.episode, tick) for tick in range(0, len(record), 10))


def test_a_transformation_gives_any_number_of_samples(dataset: s2.Dataset) -> None:
    samples = list(dataset.stream(tagged))
    assert samples[:2] == [(0, 0), (0, 10)]
    assert {episode for episode, _ in samples} == set(range(EPISODES))
    shuffled = list(dataset.stream(tagged, shuffle=30, seed=1, workers=2))
    assert sorted(shuffled) == samples
    assert shuffled == list(dataset.stream(tagged, shuffle=30, seed=1))
    assert list(dataset.stream(lambda record: ())) == []


def test_graphs_are_made_on_the_fly(dataset: s2.Dataset) -> None:
    found = list(dataset[:3].stream(GraphSamples()))
    records = list(dataset[:3])
    assert [graph.ticks[0] for graph in found][:2] == [0, 10]
    expected = modern_graph(records[0], 10)
    assert np.array_equal(found[1].features, expected.features)
    paper = list(dataset[:3].stream(GraphSamples("paper"), workers=2))
    assert len(paper) == sum(len(paper_graphs(record)) for record in records)


def test_observations_and_actions_are_those_of_the_environment(dataset: s2.Dataset) -> None:
    gymnasium = pytest.importorskip("gymnasium")
    from sonata2d.gym import EnvSamples, Flat

    env = Flat(gymnasium.make("sonata2d/SocialNav-v0", scenario=QUICK))
    samples = list(dataset[:1].stream(EnvSamples(env)))
    observation, _ = env.reset(seed=5)
    for recorded, action in samples:
        np.testing.assert_allclose(recorded, observation, atol=2e-3)
        observation, *_ = env.step(action)
    assert len(samples) == len(dataset[0])


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"transform": 3}, TypeError, "transform is a function of a record, got 3"),
        ({"shuffle": -1}, ValueError, "shuffle must be 0 or more"),
        ({"seed": 1.5}, TypeError, "seed must be a whole number"),
        ({"part": 3}, TypeError, r"part is a pair \(k, n\), got 3"),
        ({"part": (2, 2)}, ValueError, r"the parts are \(0, 2\) to \(1, 2\)"),
    ],
)
def test_wrong_arguments_are_one_error(dataset: s2.Dataset, options: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        dataset.stream(**options)


def test_members_of_a_shard_in_a_store_are_read_at_once(dataset: s2.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("upath")
    from sonata2d.core.files.locations import file_names, location, put_content
    from sonata2d.record import shard_file

    store = location(f"memory://stream-{dataset.path.parent.name}")
    for name in file_names(dataset.path):
        put_content(store / name, (dataset.path / name).read_bytes())
    requests = []
    read = shard_file.content_of
    monkeypatch.setattr(shard_file, "content_of", lambda *where: requests.append(where) or read(*where))
    remote = s2.Dataset(str(store))
    filesystem: Any = type(remote.path.fs)  # type: ignore[attr-defined]
    info, looks = filesystem.info, []
    monkeypatch.setattr(filesystem, "info", lambda self, path, **options: looks.append(path) or info(self, path))
    assert numbers(remote.stream()) == list(range(EPISODES))
    if remote.manifest is not None and "shards" in remote.manifest:
        ranges = [where for where in requests if len(where) == 3]
        assert len(ranges) <= EPISODES / 4 + 5
        assert len(looks) <= EPISODES  # four a shard
        looks.clear()
        assert len(remote.filter(outcome=["goal", "timeout", "contact"])) > 0
        assert len(looks) <= len(remote.manifest["shards"])  # their manifests are read
    scattered = [remote.files[k] for k in (0, 8, 3)]
    assert [record.episode for record in read_episodes(scattered)] == [0, 8, 3]


def test_pytorch_gets_the_same_items_each_time(dataset: s2.Dataset) -> None:
    torch = pytest.importorskip("torch")

    def epoch(workers: int, number: int = 0) -> list[tuple[int, int]]:
        samples = dataset.stream(tagged, shuffle=10, seed=4, epoch=number).to_torch()
        loader = torch.utils.data.DataLoader(samples, batch_size=None, num_workers=workers)
        return [tuple(map(int, item)) for item in loader]

    assert sorted(epoch(0)) == sorted(epoch(2)) == sorted(dataset.stream(tagged))
    assert epoch(2) == epoch(2)
    assert epoch(0) == epoch(0) == list(dataset.stream(tagged, shuffle=10, seed=4))
    samples = dataset.stream(tagged, shuffle=10, seed=4).to_torch()
    assert len(list(pickle.loads(pickle.dumps(samples)))) == len(epoch(0))  # as to processes that are spawned
    loader = torch.utils.data.DataLoader(samples, batch_size=None, num_workers=2, persistent_workers=True)
    for number in (0, 1):
        samples.set_epoch(number)
        assert [tuple(map(int, item)) for item in loader] == epoch(2, number)
    assert epoch(0, 1) != epoch(0)
    first = next(iter(dataset.stream().to_torch()))
    assert first["robot"].shape[1] == 6
