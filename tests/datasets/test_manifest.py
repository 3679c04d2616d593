"""A data set is whole episodes, a manifest, a card and a log."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from sonata2d.datasets import manifest as dataset
from sonata2d.datasets.card import card
from sonata2d.datasets.manifest import DatasetSpec, Entry
from sonata2d.datasets.progress import log
from sonata2d.errors import RecordError
from sonata2d.record.files import read_bytes
from sonata2d.record.recorder import EpisodeRecorder

from ..record.samples import AUTHOR, run, scene

SETTINGS = {"name": "by-hand", "tiny": 0.00001}


def plan(episodes: int = 3, **changes: Any) -> DatasetSpec:
    given: dict[str, Any] = {"name": "by-hand", "settings": SETTINGS, "seed": 7, "author": AUTHOR}
    return DatasetSpec(**{**given, "episodes": episodes, **changes})


def document(episode: int) -> bytes:
    recorder = EpisodeRecorder(id=f"{episode:06d}")
    run(recorder, scene(episode=episode), ticks=3 + episode)
    return recorder.document()


def made(folder: Path, of: DatasetSpec, *, resume: bool = False, most: int | None = None) -> dict[int, Entry]:
    """Make what is missing of a data set, or the first of it; then finish, unless it was cut off."""
    dataset.start(folder, of, resume=resume)
    entries, _ = dataset.existing(folder, of, {})
    for episode in range(of.episodes if most is None else most):
        if episode not in entries:
            entries[episode] = dataset.store(folder, of, episode, document(episode))
    if most is None:
        dataset.finish(folder, of, entries.values())
    return entries


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_the_manifest_lists_what_is_there(tmp_path: Path, suffix: str) -> None:
    made(tmp_path / "set", plan(suffix=suffix))
    manifest = dataset.read_manifest(tmp_path / "set")
    assert manifest["complete"]
    assert manifest["counts"] == {"outcome": {"stopped": 3}, "family": {"by-hand/square": 3}}
    assert [file["ticks"] for file in manifest["files"]] == [3, 4, 5]
    for file in manifest["files"]:
        data = (tmp_path / "set" / file["name"]).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (file["bytes"], file["sha256"])
    assert read_bytes(tmp_path / "set" / f"000001{suffix}") == document(1)


def test_a_resumed_data_set_is_the_same_bytes(tmp_path: Path) -> None:
    made(tmp_path / "whole", plan())
    folder = tmp_path / "resumed"
    made(folder, plan(), most=2)
    assert not dataset.read_manifest(folder)["complete"]
    (folder / "000001.json").write_bytes(document(1)[:500])
    (folder / ".sonata2d-killed.tmp").write_bytes(b"half")
    made(folder, plan(), resume=True)
    assert contents(folder) == contents(tmp_path / "whole")


def test_more_episodes_may_be_asked_for_later(tmp_path: Path) -> None:
    made(tmp_path / "whole", plan(4))
    made(tmp_path / "grown", plan(2))
    made(tmp_path / "grown", plan(4), resume=True)
    assert contents(tmp_path / "grown") == contents(tmp_path / "whole")
    with pytest.raises(RecordError, match="episodes 4 there, 2 asked"):
        dataset.start(tmp_path / "grown", plan(2), resume=True)


def test_only_whole_episodes_of_the_plan_count(tmp_path: Path) -> None:
    dataset.start(tmp_path, plan(4))
    for episode in range(3):
        dataset.store(tmp_path, plan(), episode, document(episode))
    (tmp_path / "000001.json").write_bytes(document(1)[:-40])
    (tmp_path / "000002.json").write_bytes(document(0))
    (tmp_path / "000003.json").write_bytes(document(3).replace(b'"status":"stopped"', b'"status":"error"'))
    entries, faults = dataset.existing(tmp_path, plan(4), {})
    assert list(entries) == [0]
    for fault, told in zip(faults, ("not whole JSON", "its episode differs", "ended in an error"), strict=True):
        assert told in fault
    assert not dataset.existing(tmp_path, plan(4, seed=8), {})[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 8}, "seed 7 there, 8 asked"),
        ({"name": "other"}, "name 'by-hand' there, 'other' asked"),
        ({"settings": {**SETTINGS, "tiny": 1.0}}, "settings tiny 1e-05 there, 1.0 asked"),
    ],
)
def test_another_data_set_is_not_resumed(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    made(tmp_path, plan())
    before = contents(tmp_path)
    with pytest.raises(RecordError, match=message):
        dataset.start(tmp_path, plan(**change), resume=True)
    with pytest.raises(RecordError, match="holds a data set already"):
        dataset.start(tmp_path, plan())
    assert contents(tmp_path) == before


def test_a_folder_of_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("all of it")
    with pytest.raises(RecordError, match="not empty"):
        dataset.start(tmp_path, plan())
    with pytest.raises(RecordError, match=r"thesis\.tex is a file"):
        dataset.start(tmp_path / "thesis.tex", plan())
    assert (tmp_path / "thesis.tex").read_text() == "all of it"


def test_the_card_has_front_matter_and_tells_how_it_was_made(tmp_path: Path) -> None:
    made(tmp_path, plan())
    text = (tmp_path / "README.md").read_text("utf-8")
    _, front, body = text.split("---\n", 2)
    told = yaml.safe_load(front)
    assert (told["license"], told["task_categories"]) == ("cc-by-4.0", ["robotics"])
    assert told["size_categories"] == ["n<1K"]
    assert "social-navigation" in told["tags"]
    assert "sonata2d generate" in body
    assert "| stopped | 3 |" in body


def test_the_card_tells_who_is_recorded_and_leaves_the_licence_open(tmp_path: Path) -> None:
    people = [{"track": [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]}, {"x": 1.0, "y": 2.0, "track": None}]
    made(tmp_path, plan())
    manifest = dataset.read_manifest(tmp_path) | {"settings": {"people": people}}
    _, front, body = card(manifest).split("---\n", 2)
    told = yaml.safe_load(front)
    assert told["license"] == "other"
    assert "synthetic" not in told["tags"]
    assert "1 of the 2 people that the scenario lists are recorded" in body
    assert "The people are simulated" not in body
    simulated = card(manifest | {"settings": {"people": people[1:]}})
    assert "- synthetic" in simulated
    assert "recorded" not in simulated
    assert "among recorded and simulated people" in card(manifest | {"collected": True})
    assert "among simulated people" in card(manifest | {"collected": True, "settings": None})


def test_the_log_only_grows_and_is_no_part_of_the_set(tmp_path: Path) -> None:
    made(tmp_path, plan())
    before = (tmp_path / "manifest.json").read_bytes()
    for seconds in (1.5, 2.5):
        log(tmp_path, seconds=seconds, host="here", command=("sonata2d", "generate"))
    lines = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert [line["seconds"] for line in lines] == [1.5, 2.5]
    assert (tmp_path / "manifest.json").read_bytes() == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "not whole JSON"),
        (b"[]", "no sonata2d-dataset manifest"),
        (b'{"format": "sonata2d-dataset", "version": 2}', "version 2, this sonata2d reads up to 1; upgrade"),
        (None, "holds no manifest.json"),
    ],
)
def test_a_manifest_that_cannot_be_used_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / "manifest.json").write_bytes(content)
    with pytest.raises(RecordError, match=message):
        dataset.read_manifest(tmp_path)
