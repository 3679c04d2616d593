"""Data sets in each other's company: resumed after a split, merged with packed copies, evaluated beside empty ones."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.collect.collection import manifest_of_runs
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.manifest import read_manifest, write_tree
from sonata2d.datasets.merge import merge_datasets
from sonata2d.datasets.split import split_dataset
from sonata2d.errors import RecordError
from sonata2d.scenegen.scenario.config import ScenarioConfig

QUICK = {"humans": 1, "tables": 0, "plants": 0, "relations": 0}


def made(folder: Path, episodes: int = 4, *, resume: bool = False, suffix: str = ".json", limit: float = 1.0) -> Path:
    config = ScenarioConfig(name=f"quick-{limit}", rules={"time_limit": limit}, **QUICK)
    generate_dataset(folder, config, "straight-to-goal", episodes=episodes, seed=3, resume=resume, suffix=suffix)
    return folder


def test_a_split_outlives_a_resumption_that_changes_nothing(tmp_path: Path) -> None:
    folder = made(tmp_path / "set")
    split = split_dataset(folder, {"train": 0.5, "test": 0.5})
    before = (folder / "manifest.json").read_bytes()
    made(folder, resume=True)
    assert (folder / "manifest.json").read_bytes() == before
    assert read_manifest(folder)["split"] == split
    made(folder, episodes=5, resume=True)
    assert read_manifest(folder)["split"] is None, "a part of the set is in no part of the split"


def test_the_same_episode_is_known_however_it_is_packed(tmp_path: Path) -> None:
    plain, packed = made(tmp_path / "plain"), made(tmp_path / "packed", suffix=".json.zst")
    with pytest.raises(RecordError, match="is the same episode as"):
        merge_datasets([plain, packed], tmp_path / "both")


def test_one_scene_under_two_scenarios_is_in_one_part(tmp_path: Path) -> None:
    merged = tmp_path / "both"
    merge_datasets([made(tmp_path / "a", limit=1.0), made(tmp_path / "b", limit=2.0)], merged)
    split = split_dataset(merged, {"train": 0.5, "test": 0.5})
    for number in range(4):
        parts = {part for part, names in split.items() for name in names if name.endswith(f"{number:06d}.json")}
        assert len(parts) == 1


def test_an_empty_set_beside_a_full_one_is_told_without_a_crash(tmp_path: Path) -> None:
    full, empty = made(tmp_path / "full"), tmp_path / "empty"
    empty.mkdir()
    write_tree(empty / "manifest.json", manifest_of_runs([]))
    result = CliRunner().invoke(main, ["evaluate", str(full), str(empty), "--json", "--no-rerun"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
