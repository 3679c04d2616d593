"""What a recorder writes."""

from __future__ import annotations

import enum
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.core.geometry import Twist, canonical_angle, quantised
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Author, Frame, Outcome, Snapshot
from sonata2d.errors import RecordError
from sonata2d.record.canonical import plain, rounded, rounded_rows
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder, JsonRecorder

from .samples import AUTHOR, robot_state, run, scene, snapshot

KEYS = (
    "format version id name family seed episode physics precision settings rules room walls objects humans groups"
    " interactions robot goal social dropped controller labels contributor context branched_from columns activities"
    " outcome frames final software"
)
FRAME_KEYS = "tick time robot command executed guarded humans activity interactions contacts events"


def document_of(*frames: Frame, last: Snapshot, status: Any = "stopped") -> Any:
    recorder = EpisodeRecorder()
    recorder.open(last.scene, AUTHOR)
    for frame in frames:
        recorder.note(frame)
    recorder.close(last, Outcome(status, "by hand", last.tick, last.time))
    return json.loads(recorder.document())


def test_keys_stand_in_their_order(episode: Path) -> None:
    document = json.loads(episode.read_bytes())
    assert " ".join(document) == KEYS
    assert all(" ".join(frame) == FRAME_KEYS for frame in document["frames"])
    assert len(document["frames"]) == 6
    assert document["id"] == "by-hand"


def test_every_frame_stands_on_a_line_of_its_own(episode: Path) -> None:
    lines = episode.read_text().splitlines()
    assert sum(line.startswith('{"tick":') for line in lines) == 6


def test_a_frame_tells_what_came_of_its_own_command() -> None:
    of = scene()
    looks = [snapshot(of, 0)]
    for tick in (1, 2):
        state = robot_state(of, 0.1 * tick, moved=True)
        done = Twist(0.1 * tick, 0.0, 0.0)
        moved = type(state)(state.position, state.direction, state.velocity, 0.0, done, tick == 2, state.body)
        looks.append(snapshot(of, tick, robot=moved))
    frames = document_of(Frame(looks[0], Twist(0.5)), Frame(looks[1], Twist(0.6)), last=looks[2])["frames"]
    assert [frame["command"][0] for frame in frames] == [0.5, 0.6]
    assert [frame["executed"][0] for frame in frames] == [0.1, 0.2]
    assert [frame["guarded"] for frame in frames] == [False, True]


def test_what_is_noted_is_copied() -> None:
    of, recorders = scene(), [EpisodeRecorder(), EpisodeRecorder()]
    for recorder, spoilt in zip(recorders, (False, True), strict=True):
        look = snapshot(of, 0)
        recorder.open(of, AUTHOR)
        label = {"near": [1, 2]}
        recorder.note(Frame(look, Twist(), label))
        if spoilt:
            look.humans.state[:] = 9.0
            look.humans.activity_index[:] = 0
            label["near"].append(3)
        recorder.close(snapshot(of, 1), Outcome("stopped", "", 1, 0.1))
    assert recorders[0].document() == recorders[1].document()


def test_two_recordings_are_the_same_bytes() -> None:
    first, second = EpisodeRecorder(), EpisodeRecorder()
    run(first, labels=lambda tick: {"near": tick > 3})
    run(second, labels=lambda tick: {"near": np.bool_(tick > 3)})
    assert first.document() == second.document()


def test_a_frame_after_which_nothing_moved_is_the_final_look() -> None:
    of = scene()
    document = document_of(Frame(snapshot(of, 0), Twist()), Frame(snapshot(of, 1), Twist()), last=snapshot(of, 1))
    assert [frame["tick"] for frame in document["frames"]] == [0]
    assert document["final"]["tick"] == 1


def test_an_episode_of_no_frames_and_no_people_can_be_told(tmp_path: Path) -> None:
    of = scene(humans=(), groups=(), interactions=())
    with JsonRecorder(tmp_path / "short.json") as recorder:
        run(recorder, of, ticks=0)
    record = read_episode(tmp_path / "short.json")
    assert (len(record), record.humans.shape, record.command.shape) == (0, (0, 0, 7), (0, 3))
    assert record.scene() == of


@pytest.mark.parametrize("error", [ValueError("no way"), KeyboardInterrupt()])
def test_an_error_loses_no_frame(tmp_path: Path, error: BaseException) -> None:
    path, of = tmp_path / "broken.json", scene()

    def break_off() -> None:
        with JsonRecorder(path) as recorder:
            recorder.open(of, AUTHOR)
            for tick in range(4):
                recorder.note(Frame(snapshot(of, tick), Twist()))
            raise error

    with pytest.raises(type(error)):
        break_off()
    record = read_episode(path)
    assert (len(record), record.outcome.status, record.outcome.tick) == (3, "error", 3)
    assert type(error).__name__ in record.outcome.reason


def test_an_episode_that_is_left_early_is_written_as_stopped(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "left.json") as recorder:
        recorder.open(scene(), AUTHOR)
        recorder.note(Frame(snapshot(scene(), 0), Twist()))
    assert read_episode(tmp_path / "left.json").outcome.status == "stopped"


def test_an_error_stays_the_one_raised_where_writing_fails_too(tmp_path: Path) -> None:
    bad = snapshot(scene(), 0)
    bad.humans.state[0, 0] = np.nan

    def break_off() -> None:
        with JsonRecorder(tmp_path / "lost.json") as recorder:
            recorder.open(scene(), AUTHOR)
            recorder.note(Frame(bad, Twist()))
            raise ValueError("first")

    with pytest.raises(ValueError, match="first") as caught:
        break_off()
    assert "x of human 1 is nan" in caught.value.__notes__[0]


def test_a_recorder_holds_one_episode() -> None:
    recorder = EpisodeRecorder()
    with pytest.raises(RecordError, match="no whole episode"):
        recorder.document()
    run(recorder)
    with pytest.raises(RecordError, match="already"):
        recorder.open(scene(), AUTHOR)


def test_an_unfinite_number_is_told_with_column_entity_and_tick() -> None:
    of = scene()
    looks = [snapshot(of, tick) for tick in range(3)]
    looks[1].humans.state[2, 3] = np.inf
    with pytest.raises(RecordError, match="vy of human 3 is inf at tick 1"):
        document_of(*(Frame(look, Twist()) for look in looks[:2]), last=looks[2])
    with pytest.raises(RecordError, match="omega of the command is nan at tick 0"):
        document_of(Frame(looks[0], Twist(0.0, 0.0, float("nan"))), last=looks[2])
    lost = robot_state(of, float("nan"), moved=True)
    with pytest.raises(RecordError, match="x of the robot is nan at tick 1"):
        document_of(Frame(looks[0], Twist()), last=snapshot(of, 1, robot=lost))
    with pytest.raises(RecordError, match="settings of the scene"):
        run_and_write(scene(settings={"a": float("inf")}))


def run_and_write(of: Scene) -> bytes:
    recorder = EpisodeRecorder()
    run(recorder, of)
    return recorder.document()


def test_who_is_not_present_is_null(tmp_path: Path) -> None:
    of, path = scene(), tmp_path / "absent.json"
    looks = [snapshot(of, tick) for tick in range(3)]
    looks[1] = replace(looks[1], humans=looks[1].humans.only(np.array([0, 2])))
    with JsonRecorder(path) as recorder:
        recorder.open(of, AUTHOR)
        for look in looks[:2]:
            recorder.note(Frame(look, Twist()))
        recorder.close(looks[2], Outcome("stopped", "", 2, 0.2))
    document = json.loads(path.read_bytes())
    assert [frame["humans"][1] is None for frame in document["frames"]] == [False, True]
    record = read_episode(path)
    assert record.present.tolist() == [[True] * 3, [True, False, True]]
    assert np.isnan(record.humans[1, 1]).all()
    assert record.snapshot(1).humans.id.tolist() == looks[1].humans.id.tolist()
    assert record.snapshot(1).humans.row.tolist() == [0, 2]


class Colour(enum.Enum):
    RED = 1


@pytest.mark.parametrize(
    ("label", "told"),
    [
        (np.float32(0.1), 0.1),
        (np.array([[1, 2]]), [[1, 2]]),
        ({"near": np.bool_(True), "who": (1, np.int64(2))}, {"near": True, "who": [1, 2]}),
        (-0.00001, 0.0),
        (False, False),
        ("text", "text"),
        ({"nothing": None}, {"nothing": None}),
    ],
)
def test_labels_are_told_as_json_has_them(label: Any, told: Any) -> None:
    of = scene()
    frame = document_of(Frame(snapshot(of, 0), Twist(), label), last=snapshot(of, 1))["frames"][0]
    assert repr(frame["label"]) == repr(told)


@pytest.mark.parametrize(
    ("label", "message"),
    [
        ({1, 2}, "label at tick 0 holds a set"),
        ({"a": [Colour.RED]}, "label at tick 0 holds a Colour"),
        ({1: "a"}, "label at tick 0 has a key of type int"),
        ([float("nan")], "label at tick 0 holds nan"),
        (np.array([1 + 2j]), "label at tick 0 holds a complex"),
        (2**70, "label at tick 0 holds 1180591620717411303424"),
        ("\ud800", "label at tick 0 holds text that is no Unicode"),
        (np.datetime64("2025-01-01"), "label at tick 0 holds a date"),
    ],
)
def test_a_label_that_json_cannot_hold_is_refused_at_its_tick(label: Any, message: str) -> None:
    recorder = EpisodeRecorder()
    recorder.open(scene(), AUTHOR)
    with pytest.raises(RecordError, match=message):
        recorder.note(Frame(snapshot(scene(), 0), Twist(), label))
    recorder.close(snapshot(scene(), 0), Outcome("error", "", 0, 0.0))
    assert json.loads(recorder.document())["frames"] == []


def test_settings_keep_every_digit_and_meanings_are_noted(episode: Path) -> None:
    document = json.loads(episode.read_bytes())
    assert document["settings"]["tiny"] == 0.00001
    assert document["controller"] == {"path": "tests:Creep", "version": "1", "settings": {"speed": 0.5}}
    assert document["labels"] == AUTHOR.labels


def test_the_scenario_context_is_noted_unless_another_is_given() -> None:
    of = scene(settings={"context": "a ward at night"})
    for asked, told in ((None, "a ward at night"), ("a bar", "a bar")):
        recorder = EpisodeRecorder(context=asked)
        recorder.open(of, Author("x"))
        recorder.close(snapshot(of, 0), Outcome("stopped", "", 0, 0.0))
        assert json.loads(recorder.document())["context"] == told


@given(st.lists(st.floats(-1e6, 1e6), min_size=1))
def test_rounding_has_one_form(values: list[float]) -> None:
    once = rounded(np.array(values))
    assert once.tolist() == [quantised(value) for value in values] == plain(values, "values")
    assert rounded(once).tobytes() == once.tobytes()
    assert not (np.signbit(once) & (once == 0.0)).any()
    assert np.array(json.loads(json.dumps(once.tolist()))).tobytes() == once.tobytes()


@given(st.floats(-np.pi, np.pi, exclude_min=True))
def test_angles_have_one_form(angle: float) -> None:
    row = rounded_rows(np.array([[angle, angle]]), [1])[0]
    assert row[1] == canonical_angle(angle)
    assert -3.1416 < row[1] <= 3.1416
