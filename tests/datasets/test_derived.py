"""Mirrored, split and merged data sets are whole, prove themselves, and share no scene between parts."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import sonata2d as s2
from sonata2d.collect.collection import Collection, manifest_of_runs
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.manifest import entry_of, read_manifest, write_tree
from sonata2d.datasets.merge import merge_datasets
from sonata2d.datasets.mirror import mirror_dataset
from sonata2d.datasets.split import SHARES, dealt, scene_key, split_dataset
from sonata2d.datasets.verification import verify
from sonata2d.errors import RecordError
from sonata2d.record.reader import read_episode

from .conftest import QUICK

EPISODES = 12


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sets") / "one"
    generate_dataset(out, s2.ScenarioConfig(**QUICK), episodes=EPISODES, seed=3)
    return out


@pytest.fixture(scope="module")
def both(made: Path) -> Path:
    """Originals and mirror images together."""
    mirror_dataset(made, made.parent / "twin")
    merge_datasets([made, made.parent / "twin"], made.parent / "both")
    return made.parent / "both"


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_data_set_mirrored_twice_is_the_same_folder(made: Path, tmp_path: Path) -> None:
    twin = mirror_dataset(made, tmp_path / "twin")
    assert verify(tmp_path / "twin", replay=True) == []
    assert twin["mirrored"]
    mirror_dataset(tmp_path / "twin", tmp_path / "back")
    assert names(tmp_path / "back") == names(made) - {"run.jsonl"}
    for path in (tmp_path / "back").iterdir():
        assert path.read_bytes() == (made / path.name).read_bytes(), path.name


def test_nothing_is_left_of_a_mirror_or_a_merger_that_fails(made: Path, both: Path, tmp_path: Path) -> None:
    shutil.copytree(made, tmp_path / "bad")
    victim = tmp_path / "bad/000007.json"
    victim.write_bytes(victim.read_bytes().replace(b"timeout", b"stopped", 1))
    for make in (
        lambda: mirror_dataset(tmp_path / "bad", tmp_path / "out"),
        lambda: merge_datasets([made.parent / "twin", tmp_path / "bad"], tmp_path / "out"),
    ):
        with pytest.raises(RecordError, match=r"000007\.json is not what the manifest says"):
            make()
        assert names(tmp_path) == {"bad"}


def test_an_existing_folder_is_never_written_into(made: Path, both: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(RecordError, match="not empty"):
        mirror_dataset(made, tmp_path)
    with pytest.raises(RecordError, match="not empty"):
        merge_datasets([made, made.parent / "twin"], made)
    (tmp_path / "empty").mkdir()
    mirror_dataset(made, tmp_path / "empty")
    assert names(tmp_path) == {"mine.txt", "empty"}


def test_a_merger_keeps_bytes_settings_and_seeds(made: Path, both: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "one", s2.ScenarioConfig(name="other", rules={"time_limit": 1.0}), episodes=2, seed=99)
    merged = merge_datasets([both, tmp_path / "one"], tmp_path / "all")
    told = [(s["name"], s["seed"], s["scenario"], s.get("mirrored", False), len(s["files"])) for s in merged["sources"]]
    assert told == [
        ("both__one", 3, "custom", False, EPISODES),
        ("both__twin", 3, "custom", True, EPISODES),
        ("one", 99, "other", False, 2),
    ]
    assert merged == json.loads((tmp_path / "all/manifest.json").read_text())
    assert (tmp_path / "all/both__one__000004.json").read_bytes() == (made / "000004.json").read_bytes()
    assert verify(tmp_path / "all", replay=True) == []
    twin = mirror_dataset(tmp_path / "all", tmp_path / "twin")
    assert [source.get("mirrored", False) for source in twin["sources"]] == [True, False, True]
    assert verify(tmp_path / "twin") == []


def test_check_finds_a_merged_file_that_is_not_of_its_source(both: Path, tmp_path: Path) -> None:
    shutil.copytree(both, tmp_path / "both")
    path = tmp_path / "both/manifest.json"
    manifest = json.loads(path.read_text())
    manifest["sources"][0]["seed"] = 5
    path.write_text(json.dumps(manifest))
    assert {(p.place, p.message) for p in verify(tmp_path / "both")} == {("seed", "differs from the manifest's")}
    manifest["sources"][0]["seed"] = 3
    manifest["sources"][0]["files"].pop()
    manifest["split"] = {"train": ["one__000000.json", "one__000000.json", "none.json"]}
    path.write_text(json.dumps(manifest))
    assert [problem.place for problem in verify(tmp_path / "both")] == ["sources", "split", "split"]


def test_the_same_episode_is_not_merged_twice(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made, tmp_path / "copy")
    with pytest.raises(RecordError, match="is the same episode as"):
        merge_datasets([made, tmp_path / "copy"], tmp_path / "out")
    with pytest.raises(RecordError, match="two or more"):
        merge_datasets([made], tmp_path / "out")


@pytest.mark.parametrize("seed", range(5))
def test_mirror_images_are_in_the_part_of_their_originals(both: Path, seed: int) -> None:
    split = split_dataset(both, seed=seed)
    place = {name: part for part, files in split.items() for name in files}
    assert len(place) == 2 * EPISODES
    for k in range(EPISODES):
        assert place[f"one__{k:06d}.json"] == place[f"twin__{k:06d}-mirror.json"]
    assert all(split.values())
    assert read_manifest(both)["split"] == split
    assert verify(both) == []


def test_another_controller_in_the_same_scene_is_the_same_scene(made: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "other", s2.ScenarioConfig(**QUICK), "straight-to-goal", episodes=1, seed=3)
    first, second = read_episode(made / "000000.json"), read_episode(made / "000001.json")
    assert scene_key(read_episode(tmp_path / "other/000000.json")) == scene_key(first) != scene_key(second)


def test_a_split_is_made_again_by_its_seed_and_changes_nothing_else(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made, tmp_path / "set")
    before = {path.name: path.read_bytes() for path in (tmp_path / "set").iterdir()}
    first = split_dataset(tmp_path / "set", seed=1)
    assert {path for path, data in before.items() if (tmp_path / "set" / path).read_bytes() != data} == {
        "manifest.json"
    }
    others = [split_dataset(tmp_path / "set", seed=seed) for seed in range(2, 8)]
    assert any(other != first for other in others)
    assert split_dataset(tmp_path / "set", seed=1) == first


def test_whole_families_stay_in_one_part(both: Path) -> None:
    split = split_dataset(both, {"train": 2.0, "test": 1.0}, whole_families=True)
    family = {row["name"]: row["family"] for row in read_manifest(both)["files"]}
    train, test = ({family[name] for name in files} for files in split.values())
    assert train
    assert test
    assert not train & test
    with pytest.raises(RecordError, match="too few for 9 parts"):
        split_dataset(both, dict.fromkeys("abcdefghi", 1.0), whole_families=True)
    with pytest.raises(ValueError, match="positive"):
        split_dataset(both, {"train": 0.0})


@given(
    sizes=st.lists(st.integers(1, 4), min_size=3, max_size=60),
    shares=st.fixed_dictionaries({part: st.floats(0.05, 1.0) for part in SHARES}),
)
def test_parts_get_their_shares_to_within_a_unit(sizes: list[int], shares: dict[str, float]) -> None:
    units = [tuple(f"{k}-{i}" for i in range(size)) for k, size in enumerate(sizes)]
    place = dealt(units, shares)
    assert all(len({place[name] for name in unit}) == 1 for unit in units)
    got = {part: sum(found == part for found in place.values()) for part in shares}
    assert all(got.values())
    for part, share in shares.items():
        assert abs(got[part] - share / sum(shares.values()) * len(place)) <= 2 * max(sizes) + 1


def test_mirror_images_are_not_resumed(made: Path, both: Path, tmp_path: Path) -> None:
    shutil.copytree(made.parent / "twin", tmp_path / "twin")
    with pytest.raises(RecordError, match="holds mirror images"):
        generate_dataset(tmp_path / "twin", s2.ScenarioConfig(**QUICK), episodes=EPISODES + 1, seed=3, resume=True)


def test_runs_that_people_drove_are_mirrored_merged_and_split_too(made: Path, tmp_path: Path) -> None:
    rows = []
    for who, episode in product(("Ada", "Bo"), range(2)):
        path = tmp_path / f"driven/{who}__{episode}.json"
        with s2.JsonRecorder(path, contributor=who) as recorder:
            s2.Episode(
                s2.generate(s2.ScenarioConfig(**QUICK), 5, episode), s2.StraightToGoal(), observers=[recorder]
            ).run()
        rows.append(asdict(entry_of(read_episode(path))) | {"contributor": who})
    write_tree(tmp_path / "driven/manifest.json", manifest_of_runs(rows))
    twin = mirror_dataset(tmp_path / "driven", tmp_path / "twin")
    assert twin["collected"]
    assert verify(tmp_path / "twin", replay=True) == []
    with pytest.raises(RecordError, match="holds mirror images"):
        Collection(tmp_path / "twin", "Ada", {})
    merged = merge_datasets([tmp_path / "driven", made, tmp_path / "twin"], tmp_path / "all")
    assert merged["counts"]["contributor"] == {"Ada": 4, "Bo": 4}
    assert [source["seed"] for source in merged["sources"]] == [None, 3, None]
    assert verify(tmp_path / "all") == []
    place = {name: part for part, files in split_dataset(tmp_path / "all").items() for name in files}
    scenes: dict[str, set[str]] = {}
    for name, part in place.items():
        scenes.setdefault(scene_key(read_episode(tmp_path / "all" / name)), set()).add(part)
    assert len(scenes) == EPISODES + 2  # both people drove in the same two scenes
    assert all(len(parts) == 1 for parts in scenes.values())
