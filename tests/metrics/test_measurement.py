"""Measuring data sets: what is kept, what the same scenes are, and that it is quick enough to be used."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.core.proxemics import obstacle_clearance, times_to_collision
from sonata2d.datasets.check import check_dataset
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.mirror import mirror_dataset
from sonata2d.datasets.verification import files_of
from sonata2d.errors import MetricError, RecordError
from sonata2d.metrics.catalogue import ALL, METRICS, headline, named
from sonata2d.metrics.definition import DEFINITIONS_VERSION
from sonata2d.metrics.interop import VARIANTS
from sonata2d.metrics.measurement import Evaluation, Measured, episode_files, keep, measure_files, scene_hash
from sonata2d.metrics.table import cell, differs, table
from sonata2d.record.reader import read_episode

from ..conftest import room
from .samples import record, stay

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short episodes."""
    out = tmp_path_factory.mktemp("sets") / "demo"
    config = s2.load_scenario("sonata-2020")
    config = config.model_copy(update={"rules": config.rules.model_copy(update={"time_limit": 3.0})})
    generate_dataset(out, config, "straight-to-goal", episodes=3, seed=4)
    return out


def run(scene: int, **values: float | None) -> Measured:
    return Measured(f"{scene}.json", "0" * 64, "s", "s/l", 1, scene, str(scene), "goal", values)


def test_metrics_lie_beside_the_episodes_and_the_data_set_stays_proven(dataset: Path) -> None:
    measured = measure_files(episode_files(dataset))
    path = keep(dataset, Evaluation("demo", measured))
    told = json.loads(path.read_text())
    assert path.name == "metrics.json"
    assert (told["format"], told["version"]) == ("sonata2d-metrics", DEFINITIONS_VERSION)
    assert [episode["file"] for episode in told["episodes"]] == ["000000.json", "000001.json", "000002.json"]
    first = told["episodes"][0]
    assert first["sha256"] == hashlib.sha256((dataset / "000000.json").read_bytes()).hexdigest()
    assert first["values"].keys() == ALL.keys() == told["metrics"].keys()
    assert told["summary"]["all"]["success"]["n"] == 3
    succeeded = sum(episode["values"]["success"] for episode in told["episodes"])
    assert told["summary"]["successful"]["success"]["n"] == succeeded
    families = told["summary"]["by_family"]
    assert sum(family["success"]["n"] for family in families.values()) == 3
    assert check_dataset(dataset) == []


def test_clearances_and_times_are_those_that_controllers_see(dataset: Path) -> None:
    seen = 0
    for file, told in zip(episode_files(dataset), measure_files(episode_files(dataset), rerun=False), strict=True):
        looks = list(read_episode(file).snapshots())
        clearance, obstacles = min(map(s2.clearance, looks)), min(map(obstacle_clearance, looks))
        soonest = min(float(times_to_collision(look).min(initial=math.inf)) for look in looks)
        assert told.values["human_clearance_min"] == defined(max(clearance, 0.0))
        assert told.values["obstacle_clearance_min"] == defined(max(obstacles, 0.0))
        assert told.values["time_to_collision_min"] == defined(soonest)
        seen += math.isfinite(clearance) + math.isfinite(soonest)
    assert seen > 1


def defined(number: float) -> object:
    return pytest.approx(number, abs=1e-6) if math.isfinite(number) else None


def test_a_folder_without_manifest_takes_metrics_for_no_episode(dataset: Path, tmp_path: Path) -> None:
    for name in ("000000.json", "000001.json"):
        (tmp_path / name).write_bytes((dataset / name).read_bytes())
    (tmp_path / "metrics.json").write_text("{}")
    assert files_of(tmp_path) == [tmp_path / "000000.json", tmp_path / "000001.json"]


def test_workers_do_not_change_a_number(dataset: Path) -> None:
    files, done = episode_files(dataset), []
    assert measure_files(files, workers=2, advance=done.append) == measure_files(files)
    assert done == [1, 1, 1]


def test_a_mirror_image_is_another_scene_with_the_same_numbers(dataset: Path, tmp_path: Path) -> None:
    mirror_dataset(dataset, tmp_path / "image")
    images = measure_files(episode_files(tmp_path / "image"))
    for own, image in zip(measure_files(episode_files(dataset)), images, strict=True):
        assert own.scene != image.scene
        for name in METRICS.keys() - {"shortest_length", "spl", "stl"}:
            assert image.values[name] == pytest.approx(own.values[name], abs=2e-6), name


def test_scenes_are_told_apart_by_what_is_in_them_and_not_by_who_drives(dataset: Path, tmp_path: Path) -> None:
    config = s2.load_scenario("sonata-2020")
    config = config.model_copy(update={"rules": config.rules.model_copy(update={"time_limit": 3.0})})
    longer = config.model_copy(update={"rules": config.rules.model_copy(update={"time_limit": 3.1})})
    for name, scenario in (("other-driver", config), ("longer", longer)):
        generate_dataset(tmp_path / name, scenario, "social-force", episodes=3, seed=4)
    own, same, longer_ones = (
        [one.scene for one in measure_files(episode_files(folder), rerun=False)]
        for folder in (dataset, tmp_path / "other-driver", tmp_path / "longer")
    )
    assert own == same
    hashes = {scene_hash(record(replace(room(), seed=seed), stay(0, 0, 2))) for seed in (1, 2)}  # people choose by it
    assert len(hashes) == 2
    assert len({*own, *longer_ones}) == 6


def test_what_is_no_episode_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="holds no episode files"):
        episode_files(tmp_path)


def test_metrics_are_had_by_name_family_or_all() -> None:
    assert [metric.name for metric in named(["spl", "success", "spl"])] == ["spl", "success"]
    assert {metric.name for metric in named(["socnav3"])} == {m.name for m in VARIANTS if m.name.startswith("socnav3.")}
    assert named(["all"]) == tuple(METRICS.values())
    with pytest.raises(MetricError, match="did you mean 'success'"):
        named(["sucess"])


def test_every_metric_says_what_it_is() -> None:
    for metric in ALL.values():
        assert metric.unit
        assert metric.formula
        assert metric.source
        assert metric.better in ("more", "less", "neither")
    assert 10 <= len(headline()) <= 20


def test_differences_are_taken_in_the_same_scenes() -> None:
    first = Evaluation("a", [run(0, t=1.0), run(1, t=2.0), run(2, t=9.0)])
    second = Evaluation("b", [run(1, t=4.0), run(0, t=3.0), run(3, t=0.0)])
    told = second.less(first, "t")
    assert (told.n, told.mean) == (2, 2.0)
    assert differs(told)
    assert not differs(first.less(first, "t"))


def test_the_table_tells_mean_interval_n_and_what_differs() -> None:
    """Alike but for a shift of 1: every difference is 1, so that its interval leaves out 0."""
    first = Evaluation("a", [run(k, path_length=float(k), spl=None) for k in range(4)])
    second = Evaluation("b", [run(k, path_length=k + 1.0, spl=0.5 if k == 0 else None) for k in range(4)])
    head, length, weighted = table([first, second], named(["path_length", "spl"]))
    assert head.split() == ["metric", "unit", "a", "b"]
    assert length.startswith("path_length  ↓  m")
    assert "1.50 [" in length
    assert length.endswith("]*")
    assert "not defined" in weighted
    assert weighted.endswith("0.50 (n=1)")
    assert cell(first.summary("path_length"), 4).count("n=") == 0


def test_the_example_of_the_page_runs(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs/metrics.md").read_text("utf-8")
    monkeypatch.chdir(dataset.parent)  # the data set is called demo, as there
    names: dict[str, dict[str, float | None]] = {}
    exec(page.split("```python")[1].split("```")[0], names)
    assert names["values"].keys() == ALL.keys()


def test_docs_tell_the_definitions_as_they_are() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "docs/generate_metrics.py", "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    page = (ROOT / "docs/metrics.md").read_text("utf-8")
    assert all(f"`{name}`" in page for name in ALL)
