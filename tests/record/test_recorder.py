"""Recorders: content of the document, errors, rounding."""

from __future__ import annotations

import enum
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest
from hypothesis import given, settings, strategies as st

from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import Interaction, Wall
from sonata2d.core.geometry import Twist, canonical_angle, quantised
from sonata2d.core.humans import VY
from sonata2d.core.portable_math import angle_of, unit_vector
from sonata2d.core.relations import ACTIVITIES, AT_LAPTOP, TALKING
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Contact, ControllerInfo, Frame, Outcome, RobotState, Snapshot
from sonata2d.errors import RecordError
from sonata2d.record.canonical import rounded, rounded_rows, serialise, to_json_value
from sonata2d.record.models import Episode
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder, JsonRecorder
from sonata2d.record.validate import _FIXTURES

from .samples import CONTROLLER_INFO, people, robot_state, run, scene, snapshot

KEYS = (
    "format version id name family seed episode physics precision settings rules room walls objects doors queues places"
    " humans groups interactions robot goal social dropped controller labels contributor context branched_from columns"
    " activities outcome frames final software"
)
INTERACTIONS = (Interaction(1, AT_LAPTOP, 11), Interaction(2, TALKING, 3))
CONTACTS = (Contact("human", 1, True, False), Contact("wall", 0, False, False))
FRAME_KEYS = "tick time robot command executed guarded humans activity interactions contacts events"


def document_of(*frames: Frame, last: Snapshot, status: Any = "stopped") -> Any:
    recorder = EpisodeRecorder()
    recorder.open(last.scene, CONTROLLER_INFO)
    for frame in frames:
        recorder.on_frame(frame)
    recorder.close(last, Outcome(status, "by hand", last.tick, last.time))
    return json.loads(recorder.document())


def test_keys_are_in_a_fixed_order(episode: Path) -> None:
    document = json.loads(episode.read_bytes())
    assert " ".join(document) == KEYS
    assert all(" ".join(frame) == FRAME_KEYS for frame in document["frames"])
    assert len(document["frames"]) == 6
    assert document["id"] == "by-hand"


def test_every_frame_is_on_its_own_line(episode: Path) -> None:
    lines = episode.read_text().splitlines()
    assert sum(line.startswith('{"tick":') for line in lines) == 6


def test_a_frame_contains_the_result_of_its_own_command() -> None:
    of = scene()
    snapshots = [snapshot(of, 0)]
    for tick in (1, 2):
        state = robot_state(of, 0.1 * tick, moved=True)
        state = replace(state, executed=Twist(0.1 * tick, 0.0, 0.0), guarded=tick == 2)
        snapshots.append(snapshot(of, tick, robot=state))
    first, second, last = snapshots
    frames = document_of(Frame(first, Twist(0.5)), Frame(second, Twist(0.6)), last=last)["frames"]
    assert [frame["command"][0] for frame in frames] == [0.5, 0.6]
    assert [frame["executed"][0] for frame in frames] == [0.1, 0.2]
    assert [frame["guarded"] for frame in frames] == [False, True]


def test_later_changes_of_a_snapshot_do_not_change_the_recording() -> None:
    of, recorders = scene(), [EpisodeRecorder(), EpisodeRecorder()]
    for recorder, is_changed in zip(recorders, (False, True), strict=True):
        first = snapshot(of, 0)
        recorder.open(of, CONTROLLER_INFO)
        label = {"near": [1, 2]}
        recorder.on_frame(Frame(first, Twist(), label))
        if is_changed:
            first.humans.state[:] = 9.0
            first.humans.activity_index[:] = 0
            label["near"].append(3)
        recorder.close(snapshot(of, 1), Outcome("stopped", "", 1, 0.1))
    assert recorders[0].document() == recorders[1].document()


def test_two_recordings_of_an_episode_have_the_same_bytes() -> None:
    first, second = EpisodeRecorder(), EpisodeRecorder()
    run(first, labels=lambda tick: {"near": tick > 3})
    run(second, labels=lambda tick: {"near": np.bool_(tick > 3)})
    assert first.document() == second.document()


def test_a_frame_at_the_final_tick_is_replaced_by_the_final_state() -> None:
    of = scene()
    document = document_of(Frame(snapshot(of, 0), Twist()), Frame(snapshot(of, 1), Twist()), last=snapshot(of, 1))
    assert [frame["tick"] for frame in document["frames"]] == [0]
    assert document["final"]["tick"] == 1


def test_an_episode_without_frames_and_people_reads_back(tmp_path: Path) -> None:
    of = scene(humans=(), groups=(), interactions=())
    with JsonRecorder(tmp_path / "short.json") as recorder:
        run(recorder, of, ticks=0)
    record = read_episode(tmp_path / "short.json")
    assert (len(record), record.humans.shape, record.command.shape) == (0, (0, 0, 7), (0, 3))
    assert record.scene() == of


def test_a_scene_with_more_walls_than_a_file_may_hold_is_refused_at_its_start() -> None:
    many = replace(scene(), walls=(Wall((-1.0, 2.0), (1.0, 2.0)),) * 10_001)
    with pytest.raises(RecordError, match="cannot be recorded: walls: there are 10001; the limit is 10000"):
        EpisodeRecorder().open(many, CONTROLLER_INFO)
    bounded = {key for key, value in Episode.model_json_schema()["properties"].items() if "maxItems" in value}
    assert set(_FIXTURES) == bounded


@pytest.mark.parametrize("error", [ValueError("no way"), KeyboardInterrupt()])
def test_an_exception_loses_no_frame(tmp_path: Path, error: BaseException) -> None:
    path, of = tmp_path / "broken.json", scene()

    def record_and_raise() -> None:
        with JsonRecorder(path) as recorder:
            recorder.open(of, CONTROLLER_INFO)
            for tick in range(4):
                recorder.on_frame(Frame(snapshot(of, tick), Twist()))
            raise error

    with pytest.raises(type(error)):
        record_and_raise()
    record = read_episode(path)
    assert (len(record), record.outcome.status, record.outcome.tick) == (3, "error", 3)
    assert type(error).__name__ in record.outcome.reason


def test_an_episode_without_end_is_written_as_stopped(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "left.json") as recorder:
        recorder.open(scene(), CONTROLLER_INFO)
        recorder.on_frame(Frame(snapshot(scene(), 0), Twist()))
    assert read_episode(tmp_path / "left.json").outcome.status == "stopped"


def test_the_first_exception_is_raised_where_writing_fails_too(tmp_path: Path) -> None:
    bad = snapshot(scene(), 0)
    bad.humans.state[0, 0] = np.nan

    def record_and_raise() -> None:
        with JsonRecorder(tmp_path / "lost.json") as recorder:
            recorder.open(scene(), CONTROLLER_INFO)
            recorder.on_frame(Frame(bad, Twist()))
            raise ValueError("first")

    with pytest.raises(ValueError, match="first") as caught:
        record_and_raise()
    assert "x of human 1 is nan" in caught.value.__notes__[0]


def test_a_recorder_records_one_episode_only() -> None:
    recorder = EpisodeRecorder()
    with pytest.raises(RecordError, match="the episode is not complete"):
        recorder.document()
    run(recorder)
    with pytest.raises(RecordError, match="already"):
        recorder.open(scene(), CONTROLLER_INFO)


def test_a_number_that_is_not_finite_is_an_error_with_column_entity_and_tick() -> None:
    of = scene()
    snapshots = [snapshot(of, tick) for tick in range(3)]
    snapshots[1].humans.state[2, VY] = np.inf
    with pytest.raises(RecordError, match="vy of human 3 is inf at tick 1"):
        document_of(*(Frame(state, Twist()) for state in snapshots[:2]), last=snapshots[2])
    with pytest.raises(RecordError, match="omega of the command is nan at tick 0"):
        document_of(Frame(snapshots[0], Twist(0.0, 0.0, float("nan"))), last=snapshots[2])
    lost = robot_state(of, float("nan"), moved=True)
    with pytest.raises(RecordError, match="x of the robot is nan at tick 1"):
        document_of(Frame(snapshots[0], Twist()), last=snapshot(of, 1, robot=lost))
    with pytest.raises(RecordError, match="settings of the scene"):
        recorded_bytes(scene(settings={"a": float("inf")}))


def recorded_bytes(of: Scene) -> bytes:
    recorder = EpisodeRecorder()
    run(recorder, of)
    return recorder.document()


def test_the_row_of_an_absent_person_is_null(tmp_path: Path) -> None:
    of, path = scene(), tmp_path / "absent.json"
    first, second, last = (snapshot(of, tick) for tick in range(3))
    second = replace(second, humans=second.humans.select(np.array([0, 2])))
    with JsonRecorder(path) as recorder:
        recorder.open(of, CONTROLLER_INFO)
        for state in (first, second):
            recorder.on_frame(Frame(state, Twist()))
        recorder.close(last, Outcome("stopped", "", 2, 0.2))
    document = json.loads(path.read_bytes())
    assert [frame["humans"][1] is None for frame in document["frames"]] == [False, True]
    record = read_episode(path)
    assert record.present.tolist() == [[True] * 3, [True, False, True]]
    assert np.isnan(record.humans[1, 1]).all()
    assert record.snapshot(1).humans.id.tolist() == second.humans.id.tolist()
    assert record.snapshot(1).humans.row.tolist() == [0, 2]


NUMBER = st.floats(-1e4, 1e4)
UNIT_VECTOR = st.floats(-4.0, 4.0).map(unit_vector)
TEXT = st.sampled_from(["", "]],[[", "],[", ",", "[null,null,null,null,null,null,null]", "\n", "Zoë", '"']) | st.text()
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | NUMBER | TEXT,
    lambda values: st.lists(values, max_size=3) | st.dictionaries(TEXT, values, max_size=3),
)


@st.composite
def snapshots(draw: st.DrawFn, of: Scene, tick: int) -> Snapshot:
    """A snapshot with any numbers, in which any of the people may be absent."""
    count = len(of.humans)
    vectors = [
        [*draw(st.tuples(*[NUMBER] * 4)), *draw(UNIT_VECTOR), *draw(UNIT_VECTOR), draw(NUMBER)] for _ in range(count)
    ]
    activity = np.array([draw(st.integers(0, 5)) for _ in range(count)], dtype=np.int64)
    humans = replace(people(of, 0.0), state=np.array(vectors).reshape(count, 9), activity_index=activity)
    absent = draw(st.sets(st.integers(0, max(count - 1, 0))))
    executed = Twist(*draw(st.tuples(NUMBER, NUMBER, NUMBER)))
    position, velocity = draw(st.tuples(NUMBER, NUMBER)), draw(st.tuples(NUMBER, NUMBER))
    robot = RobotState(position, draw(UNIT_VECTOR), velocity, draw(NUMBER), executed, draw(st.booleans()), of.robot)
    chosen = [k for k in range(count) if k not in absent]
    return snapshot(
        of,
        tick,
        robot=robot,
        humans=humans.select(np.array(chosen, dtype=np.int64)),
        interactions=tuple(draw(st.lists(st.sampled_from(INTERACTIONS), max_size=2))),
        contacts=tuple(draw(st.lists(st.sampled_from(CONTACTS), max_size=2))),
        events=tuple(draw(st.lists(st.builds(DeviceEvent, TEXT, TEXT, st.floats(-1.0, 1.0)), max_size=2))),
    )


def state_in_file(state: Snapshot) -> dict[str, Any]:
    """What a file holds of a snapshot, computed one number at a time."""
    robot, people_rows = state.robot, {person.id: person for person in state.humans}
    row = [*robot.position, angle_of(robot.direction[1], robot.direction[0]), *robot.velocity, robot.omega]
    rows: list[Any] = []
    for human in state.scene.humans:
        if person := people_rows.get(human.id):
            pose, velocity = person.pose, person.velocity
            numbers = [pose.x, pose.y, pose.theta, *velocity, person.omega, person.head]
            rows.append([(canonical_angle if k in (2, 6) else quantised)(value) for k, value in enumerate(numbers)])
        else:
            rows.append(None)
    return {
        "tick": state.tick,
        "time": quantised(state.time),
        "robot": [(canonical_angle if k == 2 else quantised)(value) for k, value in enumerate(row)],
        "humans": rows,
        "activity": [
            ACTIVITIES.index(people_rows[human.id].activity) if human.id in people_rows else -1
            for human in state.scene.humans
        ],
        "interactions": [[i.src, i.relation, i.dst] for i in state.interactions],
        "contacts": [asdict(contact) for contact in state.contacts],
    }


@settings(max_examples=60)
@given(st.data())
def test_a_document_holds_what_each_frame_holds(data: st.DataObject) -> None:
    of = scene(humans=scene().humans[: data.draw(st.integers(0, 3))], groups=(), interactions=())
    states = [data.draw(snapshots(of, tick)) for tick in range(data.draw(st.integers(1, 4)))]
    frames = [Frame(s, Twist(*data.draw(st.tuples(NUMBER, NUMBER, NUMBER))), data.draw(JSON)) for s in states[:-1]]
    recorder = EpisodeRecorder()
    recorder.open(of, CONTROLLER_INFO)
    for frame in frames:
        recorder.on_frame(frame)
    recorder.close(states[-1], Outcome("stopped", "", len(frames), 0.1 * len(frames)))
    document = orjson.loads(recorder.document())
    expected = []
    for frame, after in zip(frames, states[1:], strict=True):
        values = state_in_file(frame.snapshot)
        executed, c = after.robot.executed, frame.command
        values["command"] = [quantised(value) for value in (c.vx, c.vy, c.omega)]
        values["executed"] = [quantised(value) for value in (executed.vx, executed.vy, executed.omega)]
        values |= {"guarded": after.robot.guarded, "events": [asdict(event) for event in frame.snapshot.events]}
        expected.append(values if frame.label is None else values | {"label": to_json_value(frame.label, "label")})
    assert document["frames"] == expected
    final = state_in_file(states[-1])
    events = [asdict(event) for event in states[-1].events]
    assert document["final"] == (final | {"events": events} if events else final)
    assert serialise(document) == recorder.document()


class Colour(enum.Enum):
    RED = 1


@pytest.mark.parametrize(
    ("label", "recorded"),
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
def test_labels_are_recorded_as_json_values(label: Any, recorded: Any) -> None:
    of = scene()
    frame = document_of(Frame(snapshot(of, 0), Twist(), label), last=snapshot(of, 1))["frames"][0]
    assert repr(frame["label"]) == repr(recorded)


@pytest.mark.parametrize(
    ("label", "message"),
    [
        ({1, 2}, "label at tick 0 contains a set"),
        ({"a": [Colour.RED]}, "label at tick 0 contains a Colour"),
        ({1: "a"}, "label at tick 0 has a key of type int"),
        ([float("nan")], "label at tick 0 contains nan"),
        (np.array([1 + 2j]), "label at tick 0 contains a complex"),
        (2**70, "label at tick 0 contains 1180591620717411303424"),
        ("\ud800", "label at tick 0 contains text that is not valid Unicode"),
        (np.datetime64("2025-01-01"), "label at tick 0 contains a date"),
    ],
)
def test_a_label_that_json_cannot_represent_is_an_error(label: Any, message: str) -> None:
    recorder = EpisodeRecorder()
    recorder.open(scene(), CONTROLLER_INFO)
    with pytest.raises(RecordError, match=message):
        recorder.on_frame(Frame(snapshot(scene(), 0), Twist(), label))
    recorder.close(snapshot(scene(), 0), Outcome("error", "", 0, 0.0))
    assert json.loads(recorder.document())["frames"] == []


def test_settings_are_not_rounded_and_the_meaning_of_labels_is_recorded(episode: Path) -> None:
    document = json.loads(episode.read_bytes())
    assert document["settings"]["tiny"] == 0.00001
    assert document["controller"] == {"path": "tests:Creep", "version": "1", "settings": {"speed": 0.5}}
    assert document["labels"] == CONTROLLER_INFO.labels


def test_the_context_is_that_of_the_scenario_unless_given() -> None:
    of = scene(settings={"context": "a ward at night"})
    for context, recorded in ((None, "a ward at night"), ("a bar", "a bar")):
        recorder = EpisodeRecorder(context=context)
        recorder.open(of, ControllerInfo("x"))
        recorder.close(snapshot(of, 0), Outcome("stopped", "", 0, 0.0))
        assert json.loads(recorder.document())["context"] == recorded


@given(st.lists(st.floats(-1e6, 1e6), min_size=1))
def test_rounding_is_idempotent_and_survives_json(values: list[float]) -> None:
    once = rounded(np.array(values))
    assert once.tolist() == [quantised(value) for value in values] == to_json_value(values, "values")
    assert rounded(once).tobytes() == once.tobytes()
    assert not (np.signbit(once) & (once == 0.0)).any()
    assert np.array(json.loads(json.dumps(once.tolist()))).tobytes() == once.tobytes()


@given(st.floats(-np.pi, np.pi, exclude_min=True))
def test_angles_are_canonical(angle: float) -> None:
    row = rounded_rows(np.array([[angle, angle]]), [1])[0]
    assert row[1] == canonical_angle(angle)
    assert -3.1416 < row[1] <= 3.1416


def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth - 1):
        value = [value]
    return value


def test_a_label_that_is_nested_too_deeply_is_refused_at_its_tick() -> None:
    assert to_json_value(nested(200), "label") == nested(200)
    for depth in (202, 800):
        with pytest.raises(RecordError, match="label at tick 3 is nested more than 200 deep"):
            to_json_value(nested(depth), "label at tick 3")
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(RecordError, match="or contains itself"):
        to_json_value({"a": endless}, "label")
