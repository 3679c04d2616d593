"""Episodes read back equal; damaged files are refused with one line."""

from __future__ import annotations

import json
import pickle
import random
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.core.entities import Group
from sonata2d.core.scene import Social
from sonata2d.core.snapshot import Outcome
from sonata2d.errors import InvalidFileError, RecordError
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder, JsonRecorder

from .samples import CONTROLLER_INFO, run, scene

SUFFIXES = (".json", ".json.gz", ".json.zst")


def rewrite(path: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    """Change the document of a file in place; returns the path."""
    document = json.loads(path.read_bytes())
    change(document)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_episode_reads_back_equal(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"by-hand{suffix}"
    with JsonRecorder(path, contributor="Zoë", context="a ward", branched_from=("old", 3)) as recorder:
        recorded = run(recorder, labels=lambda tick: {"near": True} if tick else None)
    record = read_episode(path)
    assert record.scene() == scene()
    assert record.controller_info == CONTROLLER_INFO
    assert record.outcome == Outcome("stopped", "by hand", 6, 0.6)
    assert (record.id, record.contributor, record.context) == ("by-hand", "Zoë", "a ward")
    assert record.document["branched_from"] == {"id": "old", "tick": 3}
    for frame, original in zip(record.frames(), recorded, strict=True):
        read, expected = frame.snapshot, original.snapshot
        assert (frame.command, frame.label) == (original.command, original.label)
        assert (read.tick, read.time) == (expected.tick, expected.time)
        assert read.interactions == expected.interactions
        assert (read.contacts, read.events) == (expected.contacts, expected.events)
        assert np.abs(read.humans.state - expected.humans.state).max() < 1e-4
        assert (read.humans.id.tolist(), read.humans.radius.tolist()) == ([1, 2, 3], [0.2] * 3)


def test_recording_a_read_episode_gives_the_same_bytes(episode: Path) -> None:
    record, recorder = read_episode(episode), EpisodeRecorder(id="by-hand")
    recorder.open(record.scene(), record.controller_info)
    for frame in record.frames():
        recorder.on_frame(frame)
    recorder.close(record.snapshot(-1), record.outcome)
    assert recorder.document() == episode.read_bytes()


def test_formations_read_back(tmp_path: Path) -> None:
    path = tmp_path / "groups.json"
    with JsonRecorder(path) as recorder:
        run(recorder, scene(groups=(Group(1, "talking", (1, 2), "l"),)))
    assert read_episode(path).scene().groups == (Group(1, "talking", (1, 2), "l"),)


def test_arrays_have_one_row_per_frame_and_are_read_only(episode: Path) -> None:
    record = read_episode(episode)
    assert len(record) == 6
    assert record.robot.shape == (6, 6)
    assert record.humans.shape == (6, 3, 7)
    assert record.present.shape == record.activity.shape == (6, 3)
    assert record.command.shape == record.executed.shape == (6, 3)
    assert record.guarded.shape == record.time.shape == record.tick.shape == (6,)
    assert record.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert record.states.time[-1] == 0.6
    assert np.array_equal(record.humans, [frame["humans"] for frame in record.document["frames"]])
    with pytest.raises(ValueError, match="read-only"):
        record.humans[0] = 0.0


def test_the_command_is_the_label_of_a_frame_without_label(episode: Path, tmp_path: Path) -> None:
    assert read_episode(episode).labels == [[0.5, 0.0, 0.0]] * 6
    with JsonRecorder(tmp_path / "labelled.json") as recorder:
        run(recorder, ticks=2, labels=lambda tick: {"tick": tick})
    assert read_episode(tmp_path / "labelled.json").labels == [{"tick": 0}, {"tick": 1}]


def test_a_record_is_a_sequence_of_the_snapshots_of_its_frames(episode: Path) -> None:
    record = read_episode(episode)
    assert [snapshot.tick for snapshot in record] == list(range(6))
    assert len(record) == 6
    assert (record[2].tick, record[-1].tick, record[np.int64(3)].tick) == (2, 5, 3)
    assert [snapshot.tick for snapshot in record[1:5:2]] == [1, 3]
    with pytest.raises(IndexError, match=r"frame 6 of <EpisodeRecord .*: the numbers are 0 to 5"):
        record[6]
    with pytest.raises(TypeError, match="got 'x'"):
        record["x"]  # type: ignore[call-overload]


def test_snapshots_include_the_final_state(episode: Path) -> None:
    record = read_episode(episode)
    assert [snapshot.tick for snapshot in record.snapshots()] == list(range(7))
    assert record.snapshot(-1).tick == 6
    assert record.snapshot(3).robot.executed.vx == 0.5
    with pytest.raises(IndexError):
        record.snapshot(7)


def test_unknown_keys_are_ignored_and_kept_in_the_document(episode: Path) -> None:
    def add(document: dict[str, Any]) -> None:
        for part in (document, document["goal"], document["humans"][0], document["frames"][0], document["rules"]):
            part["unknown"] = 1

    record = read_episode(rewrite(episode, add))
    assert record.scene() == scene()
    assert record.document["unknown"] == 1


def test_a_newer_format_version_is_refused(episode: Path) -> None:
    rewrite(episode, lambda document: document.update(version=3))
    with pytest.raises(RecordError, match="written by format version 3, this sonata2d reads up to 2; upgrade sonata2d"):
        read_episode(episode)


def test_a_file_of_an_earlier_release_is_refused_with_the_release_that_reads_it(episode: Path) -> None:
    def as_in_0_2(document: dict[str, Any]) -> None:
        document["physics"] = 2
        for key in ("doors", "queues", "places"):
            del document[key]

    rewrite(episode, as_in_0_2)
    with pytest.raises(RecordError, match=r"json has physics version 2; sonata2d 0\.2\.0 is the last release that"):
        read_episode(episode)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not valid JSON"),
        (b"hello", "not valid JSON"),
        (b"\xff\xfe", "not valid JSON"),
        (b"[1, 2]", "its format is a JSON list"),
        (b'{"frame": 1}', "its format is None"),
        (b'{"format": "sonata2d-episode", "version": "' + b"x" * 5000 + b'"}', "version: got .{,70}$"),
        (b'{"format": "sonata2d-episode"}', "has no valid format version"),
        (b'{"format": "sonata2d-episode", "version": 1}', "id: is missing .and at least 32 more;"),
        (b"\x1f\x8b123", "cannot be read"),
        (b"\x28\xb5\x2f\xfd123", "cannot be read"),
    ],
)
def test_a_file_that_is_not_an_episode_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "odd.json"
    path.write_bytes(content)
    with pytest.raises(RecordError, match=message) as caught:
        read_episode(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="No such file"):
        read_episode(tmp_path / "none.json")


def set_value(*keys: Any) -> Callable[[dict[str, Any]], None]:
    """Return a function that sets a value in a document; arguments: the keys that lead there, then the value."""
    *path, last, value = keys

    def change(document: Any) -> None:
        for key in path:
            document = document[key]
        document[last] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        set_value("frames", 1, "robot", [1.0, 2.0]),
        set_value("frames", 1, "robot", 0, "1.0"),
        set_value("frames", 1, "robot", None),
        set_value("frames", 1, "humans", 0, None),
        set_value("frames", 1, "humans", 0, 3, None),
        set_value("frames", 1, "humans", []),
        set_value("frames", 1, "activity", ["a", "b", "c"]),
        set_value("frames", 1, "activity", 0, -1),
        set_value("frames", 1, "command", {}),
        set_value("frames", 1, "tick", "one"),
        set_value("frames", 1, 5),
        set_value("frames", 5),
        set_value("final", []),
        set_value("humans", None),
        set_value("walls", [[1, 2]]),
        set_value("goal", {"x": 1.0}),
        set_value("objects", 0, "shape", {"type": "star"}),
        set_value("rules", "ends_on", 4),
        set_value("social", asdict(Social(pause=(9.0, 2.0)))),
        set_value("social", asdict(Social(stop_time=(9.0, 2.0)))),
        set_value("outcome", None),
        lambda document: document.pop("robot"),
        lambda document: document["frames"][2].pop("executed"),
    ],
)
def test_a_damaged_document_is_an_error_that_names_the_file(episode: Path, change: Callable[[Any], object]) -> None:
    rewrite(episode, change)
    with pytest.raises(RecordError) as caught:
        read_episode(episode)
    assert str(episode) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (set_value("context", {}), "context: Input should be a valid string"),
        (set_value("columns", "robot", 0, "name", "u"), "columns.robot: must be x, y, theta"),
        (set_value("groups", 0, "members", [2, 9]), "member 9 of group 5 is not a human"),
        (set_value("humans", 0, "id", 0), "id 0 is used 2 times"),
        (set_value("humans", 0, "id", 2**60), "humans.0.id: Input should be less than or equal to"),
        (set_value("humans", 0, "behaviour", "recorded"), "human 1 is recorded but has no track"),
        (set_value("humans", 0, "seat", 99), "human 1 sits on 99, which is not a seat"),
        (set_value("humans", 0, "queue", 1), "human 1 stands in queue 1, which does not exist"),
        (set_value("rules", "substeps", 10**9), "rules.substeps: Input should be less than or equal to 1000"),
        (set_value("activities", ["walking", "standing"]), "activities: must be in the order standing, walking"),
        (set_value("frames", 3, "tick", 4), "frames.3: tick should be 3, is 4"),
        (set_value("frames", 3, "time", 9.5), r"frames.4.time: is 0.4 s, but 9.5 s in the state before"),
        (set_value("frames", 3, "activity", 0, 8), "frames.3.activity.0: 8 is not in the list"),
        (set_value("room", "polygon", [[0.0, 0.0]] * 100_000), "room.polygon: List should have at most 10000 items"),
        (set_value("walls", [[0.0, 0.0, 1.0, 0.0]] * 10_001), "walls: List should have at most 10000 items"),
        (set_value("frames", 3, "robot", 0, 1e200), "frames.3.robot.0: Input should be less than"),
        (set_value("frames", 3, "interactions", [[1, "talking", 9]]), "talking of 1 and 9: unknown entity"),
        (set_value("frames", 3, "label", json.loads("[" * 300 + "]" * 300)), "frames: values are nested more than 250"),
        (
            set_value(
                "frames", 3, "contacts", [{"kind": "wall", "id": 4, "robot_at_fault": True, "other_at_fault": False}]
            ),
            "frames.3.contacts: there is no wall 4",
        ),
        (
            lambda document: document.update(
                label=3,
                label_spec={
                    "kind": "classes", "when": "run", "name": "a", "question": "", "classes": ["x"], "ends": ["", ""]
                },
            ),
            "label: 3 is not a valid a",
        ),
    ],
)  # fmt: skip
def test_what_code_behind_the_reader_relies_on_is_checked(
    episode: Path, change: Callable[[Any], object], message: str
) -> None:
    rewrite(episode, change)
    with pytest.raises(InvalidFileError) as caught:
        read_episode(episode)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_findings_of_all_parts_are_listed_and_survive_a_worker_process(episode: Path) -> None:
    rewrite(episode, lambda document: document.update(seed="7", walls=None))
    with pytest.raises(InvalidFileError, match="and at least 1 more") as caught:
        read_episode(episode)
    assert [place for place, _ in caught.value.findings] == ["seed", "walls"]
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.findings) == (str(caught.value), caught.value.findings)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_truncated_file_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cut{suffix}"
    with JsonRecorder(path) as recorder:
        run(recorder)
    data = path.read_bytes()
    for end in [*range(0, len(data) - 2, 97), len(data) - 2]:
        path.write_bytes(data[:end])
        with pytest.raises(RecordError):
            read_episode(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_flipped_bit_is_refused_or_harmless(tmp_path: Path, suffix: str) -> None:
    path, rng = tmp_path / f"flipped{suffix}", random.Random(1)
    with JsonRecorder(path) as recorder:
        run(recorder)
    data = path.read_bytes()
    for _ in range(300):
        damaged = bytearray(data)
        damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        try:
            record = read_episode(path)
            list(record.frames())
        except RecordError:
            continue
        assert len(record) == 6 or suffix == ".json"


def test_of_a_list_with_many_faults_the_first_is_found(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "a.json") as recorder:
        run(recorder)
    rewrite(tmp_path / "a.json", lambda document: document.update(frames=[{}] * 1000, objects=[{}] * 1000))
    with pytest.raises(InvalidFileError) as caught:
        read_episode(tmp_path / "a.json")
    lists = {tuple(place.split(".")[:2]) for place, _ in caught.value.findings}
    assert lists == {("frames", "0"), ("objects", "0")}
