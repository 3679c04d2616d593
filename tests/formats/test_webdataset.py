"""`webdataset`: samples of arrays, which WebDataset and Hugging Face `datasets` read."""

from __future__ import annotations

import io
import tarfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.core.relations import RELATIONS
from sonata2d.formats import export_to
from sonata2d.record.files import read_stored

VISITED = s2.ScenarioConfig(standing=(0, 2), wandering=(0, 2), tables=1, at_laptop=(0, 1), plants=0,
                            doors=[{"inflow": 8}], rules={"time_limit": 8.0})  # fmt: skip


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("webdataset") / "runs"
    s2.generate_dataset(folder, VISITED, episodes=7, seed=5, shard_size=3, progress=False)
    return folder


def samples_in(folder: Path) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = defaultdict(dict)
    for path in sorted(folder.glob("*.tar")):
        with tarfile.open(path) as archive:
            for member in archive:
                file = archive.extractfile(member)
                assert file is not None
                key, _, name = member.name.partition(".")
                data = file.read()
                found[key][name] = orjson.loads(data) if name == "json" else np.load(io.BytesIO(data))
    return dict(found)


def test_a_sample_has_the_arrays_of_an_episode(runs: Path, tmp_path: Path) -> None:
    result = export_to(runs, "webdataset", tmp_path / "arrays")
    assert [file.name for file in result.files] == ["shard-000000.tar"]
    samples = samples_in(tmp_path / "arrays")
    assert len(samples) == 7
    for record, sample in zip(s2.Dataset(runs), samples.values(), strict=True):
        count = len(record)
        assert sample["json"]["outcome"] == record.outcome.status
        assert sample["json"]["frames"] == count
        for name, expected in (("robot", record.robot), ("command", record.command), ("time", record.time)):
            assert sample[f"{name}.npy"] == pytest.approx(expected, abs=1e-5)
        humans = sample["humans.npy"]
        assert humans.shape == (count, len(record.scene().humans), 7)
        assert (np.isfinite(humans[..., 0]) == record.states.present[:count]).all()
        assert humans == pytest.approx(record.states.humans[:count], abs=1e-5, nan_ok=True)
        assert sample["walls.npy"].shape == (len(record.scene().walls), 4)
        rows = [
            [tick, src, RELATIONS.index(relation), dst]
            for tick, frame in enumerate(record.document["frames"]) for src, relation, dst in frame["interactions"]
        ]  # fmt: skip
        assert sample["interactions.npy"].tolist() == rows


def test_parts_have_the_samples_of_the_whole_and_replace_a_former_export(runs: Path, tmp_path: Path) -> None:
    export_to(runs, "webdataset", tmp_path / "whole")
    for size, count in ((2, 4), (5, 2)):
        result = export_to(runs, "webdataset", tmp_path / "parts", shard_size=size)
        assert len(result.files) == len(list((tmp_path / "parts").iterdir())) == count
    whole, parts = (samples_in(tmp_path / name) for name in ("whole", "parts"))
    assert [*whole] == [*parts]
    assert all((whole[key]["robot.npy"] == parts[key]["robot.npy"]).all() for key in whole)


def test_keys_are_unique_and_other_files_stay(runs: Path, tmp_path: Path) -> None:
    (tmp_path / "named").mkdir()
    for name, file in zip(("a.b", "a_b"), s2.Dataset(runs).files, strict=False):
        (tmp_path / "named" / f"{name}.json").write_bytes(read_stored(file))
    (tmp_path / "arrays").mkdir()
    (tmp_path / "arrays" / "shard-train-000000.tar").write_bytes(b"mine")
    export_to(tmp_path / "named", "webdataset", tmp_path / "arrays", shard_size=1)
    assert (tmp_path / "arrays" / "shard-train-000000.tar").read_bytes() == b"mine"
    (tmp_path / "arrays" / "shard-train-000000.tar").unlink()
    assert [*samples_in(tmp_path / "arrays")] == ["a%2Eb", "a_b"]


@pytest.mark.parametrize("scenario", [VISITED, s2.load_scenario("empty")])
def test_hugging_face_streams_the_samples(
    scenario: s2.ScenarioConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    runs = s2.generate_dataset(tmp_path / "runs", scenario, episodes=7, seed=1, progress=False)
    export_to(runs, "webdataset", tmp_path / "arrays", shard_size=4)
    loaded = datasets.load_dataset(
        "webdataset", data_files={"train": str(tmp_path / "arrays/*.tar")}, split="train", cache_dir=str(tmp_path)
    )
    assert loaded["__key__"][:] == [f"{k:06d}" for k in range(7)]
    for record, sample in zip(runs, loaded, strict=True):
        assert np.array(sample["robot.npy"]) == pytest.approx(record.robot, abs=1e-5)
        assert sample["json"]["task"].startswith("Go to ")
