"""Mirrored, merged and split data sets are valid, keep their bytes, and share no scene between parts."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from itertools import product
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given, strategies as st
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.collect.collection import Collection, manifest_of_runs
from sonata2d.datasets import generate_dataset, merge_datasets, mirror_dataset, verify, write_card
from sonata2d.datasets.manifest import read_manifest, row_of, write_json
from sonata2d.datasets.transforms.split import FRACTIONS, assign_parts, scene_key, split_dataset
from sonata2d.errors import DatasetWarning, RecordError
from sonata2d.record.reader import read_episode

from .conftest import QUICK

EPISODES = 12
HALVES = {"train": 0.5, "test": 0.5}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sets") / "one"
    generate_dataset(out, s2.ScenarioConfig(**QUICK), episodes=EPISODES, seed=3)
    return out


@pytest.fixture(scope="module")
def image(original: Path) -> Path:
    mirror_dataset(original, original.parent / "image")
    return original.parent / "image"


@pytest.fixture(scope="module")
def both(original: Path, image: Path) -> Path:
    """The originals and their mirror images, merged."""
    merge_datasets([original, image], original.parent / "both")
    return original.parent / "both"


def small_dataset(
    folder: Path, episodes: int = 4, *, resume: bool = False, suffix: str = ".json", limit: float = 1.0
) -> Path:
    config = s2.ScenarioConfig(
        name=f"quick-{limit}", rules={"time_limit": limit}, humans=1, tables=0, plants=0, relations=0
    )
    generate_dataset(folder, config, "straight-to-goal", episodes=episodes, seed=3, resume=resume, suffix=suffix)
    return folder


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_mirroring_a_data_set_twice_gives_the_same_folder(original: Path, tmp_path: Path) -> None:
    manifest = mirror_dataset(original, tmp_path / "image")
    assert verify(tmp_path / "image", replay=True) == []
    assert manifest["mirrored"]
    mirror_dataset(tmp_path / "image", tmp_path / "back")
    assert names(tmp_path / "back") == names(original) - {"run.jsonl"}
    for path in (tmp_path / "back").iterdir():
        assert path.read_bytes() == (original / path.name).read_bytes(), path.name


def test_a_failed_mirror_or_merge_leaves_no_files(original: Path, image: Path, tmp_path: Path) -> None:
    shutil.copytree(original, tmp_path / "bad")
    changed = tmp_path / "bad/000007.json"
    changed.write_bytes(changed.read_bytes().replace(b"timeout", b"stopped", 1))
    for derive in (
        lambda: mirror_dataset(tmp_path / "bad", tmp_path / "out"),
        lambda: merge_datasets([image, tmp_path / "bad"], tmp_path / "out"),
    ):
        with pytest.raises(RecordError, match=r"000007\.json was changed: its hash differs from the manifest"):
            derive()
        assert names(tmp_path) == {"bad"}


def test_an_existing_folder_is_never_overwritten(original: Path, image: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(RecordError, match="not empty"):
        mirror_dataset(original, tmp_path)
    with pytest.raises(RecordError, match="not empty"):
        merge_datasets([original, image], original)
    (tmp_path / "empty").mkdir()
    mirror_dataset(original, tmp_path / "empty")
    assert names(tmp_path) == {"mine.txt", "empty"}


def test_merging_keeps_bytes_settings_and_seeds(original: Path, both: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "one", s2.ScenarioConfig(name="other", rules={"time_limit": 1.0}), episodes=2, seed=99)
    merged = merge_datasets([both, tmp_path / "one"], tmp_path / "all")
    sources = [
        (s["name"], s["seed"], s["scenario"], s.get("mirrored", False), len(s["files"])) for s in merged["sources"]
    ]
    assert sources == [
        ("both__one", 3, "custom", False, EPISODES),
        ("both__image", 3, "custom", True, EPISODES),
        ("one", 99, "other", False, 2),
    ]
    assert merged == json.loads((tmp_path / "all/manifest.json").read_text())
    assert (tmp_path / "all/both__one__000004.json").read_bytes() == (original / "000004.json").read_bytes()
    assert verify(tmp_path / "all", replay=True) == []
    mirrored = mirror_dataset(tmp_path / "all", tmp_path / "image")
    assert [source.get("mirrored", False) for source in mirrored["sources"]] == [True, False, True]
    assert verify(tmp_path / "image") == []


def test_merged_files_are_named_by_the_folder_that_a_relative_path_means(
    original: Path, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (original / "sub").mkdir(exist_ok=True)
    monkeypatch.chdir(original / "sub")
    merged = merge_datasets(["..", image], tmp_path / "both")
    assert [source["name"] for source in merged["sources"]] == ["one", "image"]
    (original / "sub").rmdir()


def test_check_finds_a_merged_file_that_differs_from_its_source(both: Path, tmp_path: Path) -> None:
    shutil.copytree(both, tmp_path / "both")
    path = tmp_path / "both/manifest.json"
    manifest = json.loads(path.read_text())
    manifest["sources"][0]["seed"] = 5
    path.write_text(json.dumps(manifest))
    assert {(p.place, p.message) for p in verify(tmp_path / "both")} == {("seed", "differs from the manifest")}
    manifest["sources"][0]["seed"] = 3
    manifest["sources"][0]["files"].pop()
    manifest["split"] = {"train": ["one__000000.json", "one__000000.json", "none.json"]}
    path.write_text(json.dumps(manifest))
    assert [problem.place for problem in verify(tmp_path / "both")] == ["sources", "split", "split", "split", "tables"]


def test_the_same_episode_is_not_merged_twice_whatever_its_compression(original: Path, tmp_path: Path) -> None:
    shutil.copytree(original, tmp_path / "copy")
    plain, packed = small_dataset(tmp_path / "plain"), small_dataset(tmp_path / "packed", suffix=".json.zst")
    for pair in ([original, tmp_path / "copy"], [plain, packed]):
        with pytest.raises(RecordError, match="is the same episode as"):
            merge_datasets(pair, tmp_path / "out")
    with pytest.raises(RecordError, match="two or more"):
        merge_datasets([original], tmp_path / "out")


@pytest.mark.parametrize("seed", range(5))
def test_mirror_images_are_in_the_part_of_their_originals(both: Path, seed: int) -> None:
    split = split_dataset(both, seed=seed)
    part_of = {name: part for part, files in split.items() for name in files}
    assert len(part_of) == 2 * EPISODES
    for k in range(EPISODES):
        assert part_of[f"one__{k:06d}.json"] == part_of[f"image__{k:06d}-mirror.json"]
    assert all(split.values())
    assert read_manifest(both)["split"] == split
    assert verify(both) == []


def test_a_scene_with_another_controller_is_the_same_scene(original: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "other", s2.ScenarioConfig(**QUICK), "straight-to-goal", episodes=1, seed=3)
    first, second = read_episode(original / "000000.json"), read_episode(original / "000001.json")
    assert scene_key(read_episode(tmp_path / "other/000000.json")) == scene_key(first) != scene_key(second)


def test_a_scene_of_two_scenarios_is_in_one_part(tmp_path: Path) -> None:
    merged = tmp_path / "both"
    merge_datasets([small_dataset(tmp_path / "a", limit=1.0), small_dataset(tmp_path / "b", limit=2.0)], merged)
    split = split_dataset(merged, HALVES)
    for number in range(4):
        parts = {part for part, files in split.items() for name in files if name.endswith(f"{number:06d}.json")}
        assert len(parts) == 1


def test_a_split_depends_on_its_seed_and_leaves_the_episodes(original: Path, tmp_path: Path) -> None:
    shutil.copytree(original, tmp_path / "set")
    before = {path.name: path.read_bytes() for path in (tmp_path / "set").iterdir()}
    first = split_dataset(tmp_path / "set", seed=1)
    gone = {name for name in before if not (tmp_path / "set" / name).exists()}
    assert gone == {"episodes-00000.parquet", "frames-00000.parquet"}  # the parts have tables of their own
    changed = {name for name in before.keys() - gone if (tmp_path / "set" / name).read_bytes() != before[name]}
    assert changed == {"manifest.json", "README.md"}
    others = [split_dataset(tmp_path / "set", seed=seed) for seed in range(2, 8)]
    assert any(other != first for other in others)
    assert split_dataset(tmp_path / "set", seed=1) == first


def test_a_split_survives_a_resumption_without_new_episodes(tmp_path: Path) -> None:
    folder = small_dataset(tmp_path / "set")
    split = split_dataset(folder, HALVES)
    before = (folder / "manifest.json").read_bytes()
    small_dataset(folder, resume=True)
    assert (folder / "manifest.json").read_bytes() == before
    assert read_manifest(folder)["split"] == split
    small_dataset(folder, episodes=5, resume=True)
    assert read_manifest(folder)["split"] is None, "the new episode is in no part of the split"


def test_metadata_follow_the_manifest_through_every_command(original: Path, tmp_path: Path) -> None:
    """A validator compares the SHA-256 in croissant.json; what the author stated stays."""
    folder = tmp_path / "set"
    shutil.copytree(original, folder)
    write_card(folder, licence="mit", date="2026-05-01", creator="A Lab")
    for change in (
        lambda: split_dataset(folder),
        lambda: generate_dataset(folder, s2.ScenarioConfig(**QUICK), episodes=EPISODES + 1, seed=3, resume=True),
        lambda: write_card(folder),
    ):
        change()
        metadata = json.loads((folder / "croissant.json").read_text())
        digest = hashlib.sha256((folder / "manifest.json").read_bytes()).hexdigest()
        assert metadata["distribution"][0]["sha256"] == digest
        assert (metadata["license"], metadata["datePublished"], metadata["creator"]["name"]) == (
            "mit", "2026-05-01", "A Lab",
        )  # fmt: skip
        assert "license: mit" in (folder / "README.md").read_text()
        assert verify(folder) == []


def test_derived_data_sets_have_the_licence_of_their_sources(original: Path, tmp_path: Path) -> None:
    def licence(folder: Path) -> str:
        return (folder / "README.md").read_text().partition("license: ")[2].splitlines()[0]

    folder = tmp_path / "set"
    shutil.copytree(original, folder)
    write_card(folder, licence="mit")
    mirror_dataset(folder, tmp_path / "image")
    merge_datasets([folder, tmp_path / "image"], tmp_path / "same")
    merge_datasets([original, tmp_path / "image"], tmp_path / "mixed")
    assert [licence(tmp_path / name) for name in ("image", "same", "mixed")] == ["mit", "mit", "other"]


TABLES = re.compile(r"^configs:\n(?:(?:- |  ).*\n)*", re.MULTILINE)  # which follow the data set


def text_of(card: Path) -> str:
    return re.sub(TABLES, "", card.read_text())


def test_an_edited_card_stays_until_it_is_written_again(tmp_path: Path) -> None:
    folder = small_dataset(tmp_path / "set")
    card = folder / "README.md"
    split_dataset(folder, HALVES)
    written = card.read_text()
    assert 'path: "frames-train-*.parquet"' in written
    edited = written.replace("## Units", "## Notes of the author\nThe lab moved.\n\n## Units")
    card.write_text(edited)
    for change in (
        lambda: split_dataset(folder),
        lambda: small_dataset(folder, episodes=5, resume=True),
        lambda: generate_dataset(folder, s2.ScenarioConfig(**QUICK), episodes=1, overwrite=True),
    ):
        with pytest.warns(
            DatasetWarning, match=r"README\.md was edited, so its text stays as it is; write it again with `son"
        ):
            change()
        assert text_of(card) == re.sub(TABLES, "", edited)
    write_card(folder)
    assert "The lab moved" not in card.read_text()
    split_dataset(small_dataset(tmp_path / "other"), HALVES)  # silent again


def test_only_statements_that_are_not_valid_are_lost(tmp_path: Path) -> None:
    folder = small_dataset(tmp_path / "set")
    licence = "https://opensource.org/license/mit"
    write_card(folder, date="2026-05-01", creator="A Lab", organisation=True, url="https://a.example")
    path = folder / "croissant.json"
    metadata = json.loads(path.read_text()) | {"license": licence}
    path.write_text(json.dumps(metadata))
    split_dataset(folder, HALVES)
    written = json.loads(path.read_text())
    kept = ("license", "datePublished", "creator", "url")
    assert {key: written[key] for key in kept} == {key: metadata[key] for key in kept}
    assert written["creator"]["@type"] == "sc:Organization"
    assert f"license: other\nlicense_link: {licence}\n" in (folder / "README.md").read_text()
    assert verify(folder) == []
    path.write_text(json.dumps(written | {"datePublished": "soon", "url": 7}))
    with pytest.warns(DatasetWarning) as warned:
        split_dataset(folder)
    assert [str(one.message).removeprefix(f"{path}: ") for one in warned] == [
        "'soon' is not a date; use YYYY-MM-DD; this statement is not kept",
        "url must be a text, got 7; this statement is not kept",
    ]
    assert json.loads(path.read_text()).get("license") == licence
    assert "datePublished" not in json.loads(path.read_text())


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
    fractions=st.fixed_dictionaries({part: st.floats(0.05, 1.0) for part in FRACTIONS}),
)
def test_parts_have_their_fractions_to_within_a_unit(sizes: list[int], fractions: dict[str, float]) -> None:
    units = [tuple(f"{k}-{i}" for i in range(size)) for k, size in enumerate(sizes)]
    part_of = assign_parts(units, fractions)
    assert all(len({part_of[name] for name in unit}) == 1 for unit in units)
    counts = {part: sum(found == part for found in part_of.values()) for part in fractions}
    assert all(counts.values())
    for part, fraction in fractions.items():
        assert abs(counts[part] - fraction / sum(fractions.values()) * len(part_of)) <= 2 * max(sizes) + 1


def test_mirror_images_are_not_resumed(image: Path, tmp_path: Path) -> None:
    shutil.copytree(image, tmp_path / "image")
    with pytest.raises(RecordError, match="holds mirror images"):
        generate_dataset(tmp_path / "image", s2.ScenarioConfig(**QUICK), episodes=EPISODES + 1, seed=3, resume=True)


def test_collected_runs_can_be_mirrored_merged_and_split(original: Path, tmp_path: Path) -> None:
    rows = []
    for contributor, episode in product(("Ada", "Bo"), range(2)):
        path = tmp_path / f"driven/{contributor}__{episode}.json"
        scene = s2.generate(s2.ScenarioConfig(**QUICK), 5, episode)
        with s2.JsonRecorder(path, contributor=contributor) as recorder:
            s2.Episode(scene, s2.StraightToGoal(), observers=[recorder]).run()
        rows.append(row_of(read_episode(path)) | {"contributor": contributor})
    write_json(tmp_path / "driven/manifest.json", manifest_of_runs(rows))
    assert mirror_dataset(tmp_path / "driven", tmp_path / "image")["collected"]
    assert verify(tmp_path / "image", replay=True) == []
    with pytest.raises(RecordError, match="holds mirror images"):
        Collection(tmp_path / "image", "Ada", {})
    merged = merge_datasets([tmp_path / "driven", original, tmp_path / "image"], tmp_path / "all")
    assert merged["counts"]["contributor"] == {"Ada": 4, "Bo": 4}
    assert [source["seed"] for source in merged["sources"]] == [None, 3, None]
    assert verify(tmp_path / "all") == []
    parts_of_scene: dict[str, set[str]] = {}
    for part, files in split_dataset(tmp_path / "all").items():
        for name in files:
            parts_of_scene.setdefault(scene_key(read_episode(tmp_path / "all" / name)), set()).add(part)
    assert len(parts_of_scene) == EPISODES + 2  # both people drove in the same two scenes
    assert all(len(parts) == 1 for parts in parts_of_scene.values())


def test_an_empty_data_set_is_evaluated_without_a_crash(tmp_path: Path) -> None:
    full, empty = small_dataset(tmp_path / "full"), tmp_path / "empty"
    empty.mkdir()
    write_json(empty / "manifest.json", manifest_of_runs([]))
    result = CliRunner().invoke(main, ["evaluate", str(full), str(empty), "--json", "--no-rerun"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
