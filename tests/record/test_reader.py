"""What is written reads back equal; what is damaged is refused in one line."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.core.entities import Group
from sonata2d.core.snapshot import Outcome
from sonata2d.errors import RecordError
from sonata2d.record import reader
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder, JsonRecorder

from .samples import AUTHOR, run, scene

SUFFIXES = (".json", ".json.gz", ".json.zst")


def rewritten(path: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    """The file with a change made to its document."""
    document = json.loads(path.read_bytes())
    change(document)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_reads_back_equal(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"by-hand{suffix}"
    with JsonRecorder(path, contributor="Zoë", context="a ward", branched_from=("old", 3)) as recorder:
        told = run(recorder, labels=lambda tick: {"near": True} if tick else None)
    record = read_episode(path)
    assert record.scene() == scene()
    assert record.author == AUTHOR
    assert record.outcome == Outcome("stopped", "by hand", 6, 0.6)
    assert (record.id, record.contributor, record.context) == ("by-hand", "Zoë", "a ward")
    assert record.document["branched_from"] == {"id": "old", "tick": 3}
    for frame, original in zip(record.frames(), told, strict=True):
        look, seen = frame.snapshot, original.snapshot
        assert (frame.command, frame.label) == (original.command, original.label)
        assert (look.tick, look.time) == (seen.tick, seen.time)
        assert (look.interactions, look.contacts, look.events) == (seen.interactions, seen.contacts, seen.events)
        assert np.abs(look.humans.state - seen.humans.state).max() < 1e-4
        assert (look.humans.id.tolist(), look.humans.radius.tolist()) == ([1, 2, 3], [0.2] * 3)


def test_reading_and_recording_again_gives_the_same_bytes(episode: Path) -> None:
    record, recorder = read_episode(episode), EpisodeRecorder(id="by-hand")
    recorder.open(record.scene(), record.author)
    for frame in record.frames():
        recorder.note(frame)
    recorder.close(record.snapshot(-1), record.outcome)
    assert recorder.document() == episode.read_bytes()


def test_formations_are_kept_and_older_files_without_them_are_read(tmp_path: Path) -> None:
    path = tmp_path / "groups.json"
    with JsonRecorder(path) as recorder:
        run(recorder, scene(groups=(Group(1, "talking", (1, 2), "l"),)))
    assert read_episode(path).scene().groups == (Group(1, "talking", (1, 2), "l"),)
    older = rewritten(path, lambda document: document["groups"][0].pop("formation"))
    assert read_episode(older).scene().groups == (Group(1, "talking", (1, 2)),)


def test_arrays_have_a_row_for_each_frame(episode: Path) -> None:
    record = read_episode(episode)
    assert len(record) == 6
    assert record.robot.shape == (6, 6)
    assert record.humans.shape == (6, 3, 7)
    assert record.present.shape == record.activity.shape == (6, 3)
    assert record.command.shape == record.executed.shape == (6, 3)
    assert record.guarded.shape == record.time.shape == record.tick.shape == (6,)
    assert record.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert record.looks.time[-1] == 0.6
    assert np.array_equal(record.humans, [frame["humans"] for frame in record.document["frames"]])
    with pytest.raises(ValueError, match="read-only"):
        record.humans[0] = 0.0


def test_the_command_is_the_label_where_there_is_none(episode: Path, tmp_path: Path) -> None:
    assert read_episode(episode).labels == [[0.5, 0.0, 0.0]] * 6
    with JsonRecorder(tmp_path / "labelled.json") as recorder:
        run(recorder, ticks=2, labels=lambda tick: {"tick": tick})
    assert read_episode(tmp_path / "labelled.json").labels == [{"tick": 0}, {"tick": 1}]


def test_snapshots_are_all_looks(episode: Path) -> None:
    record = read_episode(episode)
    assert [look.tick for look in record.snapshots()] == list(range(7))
    assert record.snapshot(-1).tick == 6
    assert record.snapshot(3).robot.executed.vx == 0.5
    with pytest.raises(IndexError):
        record.snapshot(7)


def test_keys_of_later_writers_are_passed_over(episode: Path) -> None:
    def add(document: dict[str, Any]) -> None:
        for part in (document, document["goal"], document["humans"][0], document["frames"][0], document["rules"]):
            part["of_tomorrow"] = 1

    record = read_episode(rewritten(episode, add))
    assert record.scene() == scene()
    assert record.document["of_tomorrow"] == 1


def test_a_newer_version_is_refused_by_name(episode: Path) -> None:
    rewritten(episode, lambda document: document.update(version=2))
    with pytest.raises(RecordError, match="written by format version 2, this sonata2d reads up to 1; upgrade sonata2d"):
        read_episode(episode)


def test_an_older_version_is_migrated(episode: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def from_0(document: dict[str, Any]) -> dict[str, Any]:
        return {**document, "humans": document["people"]}

    rewritten(episode, lambda document: document.update(version=0, people=document.pop("humans")))
    with pytest.raises(RecordError, match="version 0, which never was"):
        read_episode(episode)
    monkeypatch.setitem(reader.MIGRATIONS, 0, from_0)
    assert read_episode(episode).scene() == scene()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not whole JSON"),
        (b"hello", "not whole JSON"),
        (b"\xff\xfe", "not whole JSON"),
        (b"[1, 2]", "its format is a JSON list"),
        (b'{"frame": 1}', "its format is None"),
        (b'{"format": "sonata2d-episode"}', "does not say its format version"),
        (b'{"format": "sonata2d-episode", "version": 1}', "'frames' is missing"),
        (b"\x1f\x8b123", "cannot be read"),
        (b"\x28\xb5\x2f\xfd123", "cannot be read"),
    ],
)
def test_what_is_no_episode_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "odd.json"
    path.write_bytes(content)
    with pytest.raises(RecordError, match=message) as caught:
        read_episode(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="No such file"):
        read_episode(tmp_path / "none.json")


def _set(*keys: Any) -> Callable[[dict[str, Any]], None]:
    """Sets the last of the arguments at the place that the others name."""
    *way, last, value = keys

    def change(document: Any) -> None:
        for key in way:
            document = document[key]
        document[last] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        _set("frames", 1, "robot", [1.0, 2.0]),
        _set("frames", 1, "robot", 0, "1.0"),
        _set("frames", 1, "robot", None),
        _set("frames", 1, "humans", 0, None),
        _set("frames", 1, "humans", 0, 3, None),
        _set("frames", 1, "humans", []),
        _set("frames", 1, "activity", ["a", "b", "c"]),
        _set("frames", 1, "activity", 0, -1),
        _set("frames", 1, "command", {}),
        _set("frames", 1, "tick", "one"),
        _set("frames", 1, 5),
        _set("frames", 5),
        _set("final", []),
        _set("humans", None),
        _set("walls", [[1, 2]]),
        _set("goal", {"x": 1.0}),
        _set("objects", 0, "shape", {"type": "star"}),
        _set("rules", "ends_on", 4),
        _set("outcome", None),
        lambda document: document.pop("robot"),
        lambda document: document["frames"][2].pop("executed"),
    ],
)
def test_a_wrong_type_is_one_error_that_names_the_file(episode: Path, change: Callable[[Any], object]) -> None:
    rewritten(episode, change)
    with pytest.raises(RecordError) as caught:
        read_episode(episode)
    assert str(episode) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_cut_short_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cut{suffix}"
    with JsonRecorder(path) as recorder:
        run(recorder)
    whole = path.read_bytes()
    for end in [*range(0, len(whole) - 2, 97), len(whole) - 2]:
        path.write_bytes(whole[:end])
        with pytest.raises(RecordError):
            read_episode(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_flipped_bit_is_refused_or_harmless(tmp_path: Path, suffix: str) -> None:
    path, chance = tmp_path / f"flipped{suffix}", random.Random(1)
    with JsonRecorder(path) as recorder:
        run(recorder)
    whole = path.read_bytes()
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
        path.write_bytes(damaged)
        try:
            record = read_episode(path)
            list(record.frames())
        except RecordError:
            continue
        assert len(record) == 6 or suffix == ".json"
