"""The folder protocol of a data set: episode files, a manifest and a log; resumption gives the same bytes."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from sonata2d.datasets.card.write import write_manifest_and_card
from sonata2d.datasets.generate.batches import existing_batches
from sonata2d.datasets.generate.episodes import packed_episode
from sonata2d.datasets.generate.progress import append_to_log
from sonata2d.datasets.generate.specification import DatasetSpec, manifest_of
from sonata2d.datasets.generate.start import start_dataset
from sonata2d.datasets.manifest import MANIFEST, files_of, read_manifest, write_json
from sonata2d.datasets.manifest.models import Manifest
from sonata2d.datasets.manifest.write import counts_of
from sonata2d.errors import RecordError
from sonata2d.record.files import read_bytes
from sonata2d.record.recorder import EpisodeRecorder

from ..record.samples import CONTROLLER_INFO, run, scene

SETTINGS = {"name": "by-hand", "tiny": 0.00001}


def spec(episodes: int = 3, **changes: Any) -> DatasetSpec:
    values: dict[str, Any] = {"name": "by-hand", "settings": SETTINGS, "seed": 7, "controller_info": CONTROLLER_INFO}
    return DatasetSpec(**{**values, "episodes": episodes, **changes})


def recorded(episode: int) -> EpisodeRecorder:
    recorder = EpisodeRecorder(id=f"{episode:06d}")
    run(recorder, scene(episode=episode), ticks=3 + episode)
    return recorder


def document(episode: int) -> bytes:
    return recorded(episode).document()


def store_episode(folder: Path, spec: DatasetSpec, episode: int) -> dict[str, Any]:
    row, data = packed_episode(spec, episode, recorded(episode))
    (folder / row["name"]).write_bytes(data)
    return row


def dataset_in(folder: Path, spec: DatasetSpec, *, resume: bool = False, stop_after: int | None = None) -> None:
    """Generate the missing episodes of a data set; with `stop_after` only the first ones, as if interrupted."""
    listed = start_dataset(folder, spec, resume=resume)
    rows = {batch.number: batch.row for batch in existing_batches(folder, spec, listed)[0]}
    for episode in range(spec.episodes if stop_after is None else stop_after):
        if episode not in rows:
            rows[episode] = store_episode(folder, spec, episode)
    if stop_after is None:
        listed_rows = [row for _, row in sorted(rows.items()) if row is not None]
        manifest = manifest_of(spec, listed_rows, counts_of(listed_rows), {}, complete=True)
        write_manifest_and_card(folder, manifest)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_the_manifest_lists_the_files(tmp_path: Path, suffix: str) -> None:
    dataset_in(tmp_path / "set", spec(suffix=suffix))
    manifest = read_manifest(tmp_path / "set")
    assert manifest["complete"]
    assert manifest["counts"] == {"outcome": {"stopped": 3}, "family": {"by-hand/square": 3}}
    assert [file["ticks"] for file in manifest["files"]] == [3, 4, 5]
    for file in manifest["files"]:
        data = (tmp_path / "set" / file["name"]).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (file["bytes"], file["sha256"])
    assert read_bytes(tmp_path / "set" / f"000001{suffix}") == document(1)


def test_a_resumed_data_set_has_the_same_bytes(tmp_path: Path) -> None:
    dataset_in(tmp_path / "whole", spec())
    folder = tmp_path / "resumed"
    dataset_in(folder, spec(), stop_after=2)
    assert not read_manifest(folder)["complete"]
    (folder / "000001.json").write_bytes(document(1)[:500])
    (folder / ".sonata2d-killed.tmp").write_bytes(b"half")
    dataset_in(folder, spec(), resume=True)
    assert contents(folder) == contents(tmp_path / "whole")


def test_resumption_can_add_episodes_but_not_remove_them(tmp_path: Path) -> None:
    dataset_in(tmp_path / "whole", spec(4))
    dataset_in(tmp_path / "grown", spec(2))
    dataset_in(tmp_path / "grown", spec(4), resume=True)
    assert contents(tmp_path / "grown") == contents(tmp_path / "whole")
    with pytest.raises(RecordError, match="episodes 4 stored, 2 requested"):
        start_dataset(tmp_path / "grown", spec(2), resume=True)


def test_only_complete_episodes_of_the_specification_are_reused(tmp_path: Path) -> None:
    start_dataset(tmp_path, spec(4))
    for episode in range(3):
        store_episode(tmp_path, spec(), episode)
    (tmp_path / "000001.json").write_bytes(document(1)[:-40])
    (tmp_path / "000002.json").write_bytes(document(0))
    (tmp_path / "000003.json").write_bytes(document(3).replace(b'"status":"stopped"', b'"status":"error"'))
    batches, faults = existing_batches(tmp_path, spec(4))
    assert [batch.number for batch in batches] == [0]
    for fault, message in zip(faults, ("not valid JSON", "its episode differs", "ended in an error"), strict=True):
        assert message in str(fault)
    assert not existing_batches(tmp_path, spec(4, seed=8))[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 8}, "seed 7 stored, 8 requested"),
        ({"name": "other"}, "name 'by-hand' stored, 'other' requested"),
        ({"settings": {**SETTINGS, "tiny": 1.0}}, r"settings\.tiny 1e-05 stored, 1.0 requested"),
    ],
)
def test_another_data_set_is_not_resumed(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    dataset_in(tmp_path, spec())
    before = contents(tmp_path)
    with pytest.raises(RecordError, match=message):
        start_dataset(tmp_path, spec(**change), resume=True)
    with pytest.raises(RecordError, match="already holds a data set"):
        start_dataset(tmp_path, spec())
    assert contents(tmp_path) == before


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("all of it")
    with pytest.raises(RecordError, match="not empty"):
        start_dataset(tmp_path, spec())
    with pytest.raises(RecordError, match=r"thesis\.tex is a file"):
        start_dataset(tmp_path / "thesis.tex", spec())
    assert (tmp_path / "thesis.tex").read_text() == "all of it"


def test_the_log_grows_and_is_not_part_of_the_manifest(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    before = (tmp_path / "manifest.json").read_bytes()
    for seconds in (1.5, 2.5):
        append_to_log(tmp_path, seconds=seconds, host="here", command=("sonata2d", "generate"))
    lines = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert [line["seconds"] for line in lines] == [1.5, 2.5]
    assert (tmp_path / "manifest.json").read_bytes() == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "not valid JSON"),
        (b"[]", "not a sonata2d-dataset manifest"),
        (b'{"format": "sonata2d-dataset", "version": 3}', "version 3, this sonata2d reads up to 2; upgrade"),
        (None, "has no manifest.json"),
    ],
)
def test_an_unusable_manifest_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    if content is not None:
        (tmp_path / "manifest.json").write_bytes(content)
    with pytest.raises(RecordError, match=message):
        read_manifest(tmp_path)


def test_a_number_of_episodes_that_no_list_has_is_refused(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    manifest = json.loads((tmp_path / MANIFEST).read_bytes())
    write_json(tmp_path / MANIFEST, {**manifest, "episodes": 1 << 63})
    with pytest.raises(RecordError, match="episodes: Input should be less than 9223372036854775808"):
        read_manifest(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_named_pipe_in_place_of_the_log_is_refused(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    os.mkfifo(tmp_path / "run.jsonl")
    with pytest.raises(RecordError, match=r"run\.jsonl cannot be written: it is a named pipe, not a file"):
        append_to_log(tmp_path, seconds=1.0)


def test_of_a_list_with_many_faults_the_first_is_found(tmp_path: Path) -> None:
    manifest = {"files": [{}] * 1000, "sources": [{}] * 1000}
    with pytest.raises(ValidationError) as caught:
        Manifest.model_validate(manifest)
    assert {error["loc"][1] for error in caught.value.errors() if len(error["loc"]) > 1} == {0}


def test_overwriting_removes_no_file_that_only_the_manifest_names(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    (tmp_path / "thesis.tex").write_text("mine")
    manifest = read_manifest(tmp_path)
    row = manifest["files"][0] | {"name": "thesis.tex"}
    write_json(tmp_path / "manifest.json", manifest | {"files": [*manifest["files"], row]})
    start_dataset(tmp_path, spec(), overwrite=True)
    assert {path.name for path in tmp_path.iterdir()} == {"thesis.tex", "manifest.json", "scenario.json"}


def test_a_long_manifest_is_validated_in_full_and_of_its_first_files_one_must_exist(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec(1))
    manifest = read_manifest(tmp_path)
    row = manifest["files"][0]
    rows = [row | {"name": f"{number:06d}.json", "episode": number} for number in range(2500)]
    write_json(tmp_path / MANIFEST, manifest | {"files": rows})
    assert len(files_of(tmp_path)) == 2500
    (tmp_path / "000000.json").unlink()
    with pytest.raises(RecordError, match=r"lists 2500 files, but 000000\.json to 000009\.json are missing"):
        files_of(tmp_path)
    rows[2300]["ticks"] = -1
    write_json(tmp_path / MANIFEST, manifest | {"files": rows})
    with pytest.raises(RecordError, match=r"files\.2300\.ticks"):
        read_manifest(tmp_path)
