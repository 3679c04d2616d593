"""`sonata`: what the readers of 2020 expect, to the last bit that they would trip over."""

from __future__ import annotations

import cmath
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.core.entities import Furniture, Goal, Human, Interaction, Robot
from sonata2d.core.geometry import Pose, Rectangle
from sonata2d.core.scene import Scene
from sonata2d.errors import RecordError
from sonata2d.formats import sonata
from sonata2d.formats import sonata as sonata_reader
from sonata2d.formats.base import Options
from sonata2d.formats.timestamps import exact_stamps
from sonata2d.record.layout import Tree
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder

from ..record import samples as by_hand
from . import reader_2020

PLAIN, ORIGINAL = Options(), Options(original=True)
SHARED = Path(__file__).parents[3] / "shared" / "data" / "formats" / "sonata.json"


def exported(record: EpisodeRecord, options: Options = PLAIN) -> list[Tree]:
    frames: list[Tree] = json.loads(sonata.export(record, options))
    return frames


def recorded(tmp_path: Path, scene: Scene, ticks: int = 30) -> EpisodeRecord:
    path = tmp_path / "made.json"
    with JsonRecorder(path) as recorder:
        by_hand.run(recorder, scene, ticks=ticks)
    return read_episode(path)


def plain_scene(**changes: Any) -> Scene:
    """Somebody and a table, numbered as readers need it, robot at (-1, 0) heading for +x."""
    given: dict[str, Any] = {
        "humans": (Human(1, Pose(2.0, 2.0, 0.0)),),
        "furniture": (Furniture(2, "table", Pose(1.0, -2.0, math.pi / 2), Rectangle(1.2, 0.8)),),
        "groups": (),
        "interactions": (),
    }
    return by_hand.scene(**{**given, **changes})


def without_ties(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ties by hand are of people that these scenes do not have."""
    monkeypatch.setattr(by_hand, "extras", lambda tick: {})


def test_graphs_are_as_many_and_as_large_as_the_formulas_say(records: list[EpisodeRecord]) -> None:
    relations, families = set(), set()
    for record in records:
        scene, frames = record.scene(), exported(record)
        relations |= {tie.relation for tie in scene.interactions}
        families.add(scene.family)
        people, things = len(scene.humans), len(scene.furniture)
        walls = sum(int(100 * math.dist(wall.start, wall.end) / 400) + 1 for wall in scene.walls)
        nodes = 2 + people + things + walls
        looks = record.document["frames"]
        chosen = range(0, len(looks), 10)  # ticks of 0.1 s, a second apart
        built = reader_2020.graphs(frames)
        assert len(built) == len(chosen) - 1 >= 1
        for j, found in enumerate(built):
            instants = [looks[chosen[j + 1 - i]] for i in range(min(j + 2, 3))]
            ties = [len(look["interactions"]) for look in instants]
            edges = sum(1 + 3 * (people + things + 1 + walls) + 2 * tied for tied in ties)
            assert found == (len(ties) * nodes, edges + 2 * (len(ties) - 1) * nodes)
        assert all(isinstance(frame["ID"], str) for frame in frames)  # SNGNN2D-v2 looks for it
    assert len(relations) == 5
    assert len(families) == 3


def test_velocities_are_previous_minus_current_of_the_native_file(records: list[EpisodeRecord]) -> None:
    for record in records:
        frames, told = exported(record), record.document["frames"]
        objects = [(thing["id"], [thing["x"], thing["y"], thing["theta"]]) for thing in record.document["objects"]]
        ids = [human["id"] for human in record.document["humans"]]
        before: dict[int, tuple[float, float, float]] = {}
        for frame, look in zip(frames, told, strict=True):
            x, y, heading = look["robot"][:3]
            entities = [(id, row[:3]) for id, row in zip(ids, look["humans"], strict=True)] + objects
            written = {entity["id"]: entity for entity in frame["people"] + frame["objects"]}
            now = {}
            for id, (px, py, theta) in entities:
                seen = (complex(px, py) - complex(x, y)) * cmath.exp(-1j * heading)  # ahead + left i
                turn = (theta - heading + math.pi / 2) % (2 * math.pi)
                now[id] = (-seen.imag, seen.real, -turn)
                entity = written[id]
                assert (entity["x"], entity["y"]) == pytest.approx(now[id][:2], abs=1e-9)
                assert cmath.exp(1j * entity["a"]) == pytest.approx(cmath.exp(1j * now[id][2]), abs=1e-9)
                old = before.get(id, now[id])
                assert (entity["vx"], entity["vy"]) == pytest.approx(
                    (old[0] - now[id][0], old[1] - now[id][1]), abs=1e-9
                )
                assert cmath.exp(1j * entity["va"]) == pytest.approx(cmath.exp(1j * (old[2] - now[id][2])), abs=1e-9)
                assert abs(entity["va"]) <= math.pi
            before = now


def test_a_frame_by_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot heads for +x: what is at its left has a negative x, and whoever faces as it does has a = -pi/2."""
    without_ties(monkeypatch)
    first = exported(recorded(tmp_path, plain_scene()))[0]
    person, table = first["people"][0], first["objects"][0]
    assert (person["x"], person["y"], person["a"]) == pytest.approx((-2.0, 3.0, -math.pi / 2))
    assert (table["x"], table["y"], table["size_x"], table["size_y"]) == pytest.approx((2.0, 2.0, 1.2, 0.8))
    assert abs(table["a"]) == pytest.approx(math.pi, abs=1e-4)  # faces the robot's left
    assert first["goal"] == [{"x": pytest.approx(0.0), "y": pytest.approx(4.0)}]
    assert first["command"] == [pytest.approx(3.5 * 0.5 / 0.8), 0.0, 0.0]
    assert all(isinstance(number, float) for number in first["command"])
    assert first["walls"][0] == pytest.approx({"x1": 4.0, "y1": -3.0, "x2": 4.0, "y2": 5.0})


def test_a_turn_to_the_left_is_negative_and_a_step_to_the_left_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_ties(monkeypatch)
    record = recorded(tmp_path, plain_scene())
    record = replace(record, command=np.tile((0.0, 0.25, 0.75), (len(record), 1)))
    assert exported(record)[0]["command"] == pytest.approx([0.0, -0.5, -2.0])


def test_a_laptop_is_tied_by_its_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_ties(monkeypatch)
    table = plain_scene().furniture[0]
    laptop = Furniture(3, "laptop", table.pose, Rectangle(0.35, 0.25), on=2)
    scene = plain_scene(furniture=(table, laptop), interactions=(Interaction(1, "human_laptop_interaction", 3),))
    frames = exported(recorded(tmp_path, scene))
    assert frames[0]["interaction"] == [{"src": 1, "relation": "human_laptop_interaction", "dst": 2}]


@given(st.floats(0.001, 1.0), st.integers(0, 10_000), st.integers(1, 1000))
def test_stamps_never_fall_short(dt: float, tick: int, ahead: int) -> None:
    first, second = exact_stamps([tick, tick + ahead], dt).tolist()
    assert second - first >= dt * ahead * (1 - 1e-15)
    assert second == pytest.approx((tick + ahead) * dt, abs=2e-5)


def test_ten_thousand_stamps_rise_by_a_tick_in_floating_point() -> None:
    stamps = exact_stamps(np.arange(10_001), 0.1)
    assert (np.diff(stamps) >= 0.1).all()
    assert (stamps[10:] - stamps[:-10] >= 1.0).all()
    assert (np.diff(np.arange(10_001) * 0.1) < 0.1).any(), "plain stamps would not"
    assert stamps[-1] - 1000.0 < 1e-5


def test_the_original_is_reproduced_quirk_by_quirk(records: list[EpisodeRecord]) -> None:
    jumps = 0
    for record in records:
        if any(tie.relation == "human_object_interaction" for tie in record.scene().interactions):
            with pytest.raises(RecordError, match="human_object_interaction"):
                sonata.export(record, ORIGINAL)
            continue
        data = sonata.export(record, ORIGINAL)
        frames = json.loads(data)
        assert data.decode() == json.dumps(frames, indent=4, sort_keys=True)
        keys = ["command", "goal", "interaction", "objects", "people", "timestamp", "walls"]
        assert all(list(frame) == keys for frame in frames)
        assert all(frame["command"][1] == 0 and type(frame["command"][1]) is int for frame in frames)
        stamps = np.array([frame["timestamp"] for frame in frames])
        steps = np.diff(stamps)
        assert stamps[0] > 1.5e9
        assert (steps > 0.1).all()
        assert {0.1, 0.2} >= set(np.round(steps, 5).tolist())
        jumps += sum(abs(e["va"]) > math.pi for frame in frames for e in frame["people"] + frame["objects"])
        assert sonata.original_name(record) == f"default__2020-07-17__{15 + record.episode:02d}:33:20.json" or (
            record.episode >= 9
        )
    assert jumps > 0, "va should jump by a whole turn somewhere"


def test_what_would_mislead_readers_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_ties(monkeypatch)
    with pytest.raises(RecordError, match=r"ids are \[1, 5\], and readers of sonata need 1..2"):
        exported(
            recorded(tmp_path, plain_scene(humans=(Human(5, Pose(2.0, 2.0)), Human(1, Pose(0.0, 3.0))), furniture=()))
        )
    with pytest.raises(RecordError, match=r"1.9 s from first to last frame"):
        exported(recorded(tmp_path, plain_scene(), ticks=20))
    record = recorded(tmp_path, plain_scene())
    present = record.looks.present.copy()
    present[7, 0] = False
    with pytest.raises(RecordError, match="human 1 is not present at tick 7"):
        exported(replace(record, looks=replace(record.looks, present=present)))
    time = record.looks.time.copy()
    time[5] += 0.03
    with pytest.raises(RecordError, match=r"frame 5 is of 0.53 s"):
        exported(replace(record, looks=replace(record.looks, time=time)))


def test_a_file_reads_back_as_all_that_the_format_carries(records: list[EpisodeRecord], tmp_path: Path) -> None:
    """The world frame is not carried, so what is compared is what the robot saw."""
    for record in records:
        path = tmp_path / "one.json"
        path.write_bytes(sonata.export(record, PLAIN))
        (document,) = sonata_reader.import_(path, PLAIN)
        back = tmp_path / "back.json"
        back.write_bytes(json.dumps(document).encode())
        assert_same(exported(record), exported(read_episode(back)))
        assert document["imported"]["format"] == "sonata"
        assert "robot.limits" in document["imported"]["lacks"]


def assert_same(old: list[Tree], new: list[Tree]) -> None:
    """Numbers to 1e-4 m of rounding, and 5e-5 rad of the robot's theta at the end of 10 m."""
    assert len(old) == len(new)
    for was, now in zip(old, new, strict=True):
        assert was["interaction"] == now["interaction"]
        assert now["command"] == pytest.approx(was["command"], abs=5e-4)
        assert now["timestamp"] == pytest.approx(was["timestamp"], abs=1e-4)
        for key in ("people", "objects", "walls", "goal"):
            for before, after in zip(was[key], now[key], strict=True):
                turned = {name: before[name] for name in ("a", "va") if name in before}
                for name, angle in turned.items():
                    assert math.remainder(after[name] - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-3)
                rest = {name: value for name, value in before.items() if name not in turned}
                assert {name: after[name] for name in rest} == pytest.approx(rest, abs=2e-3)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared sample file is not on this machine")
def test_a_file_of_another_hand_reads_and_writes_back_the_same(tmp_path: Path) -> None:
    (document,) = sonata_reader.import_(SHARED, PLAIN)
    path = tmp_path / "made.json"
    path.write_bytes(json.dumps(document).encode())
    frames = json.loads(SHARED.read_bytes())
    start = frames[0]["timestamp"]
    frames = [frame | {"timestamp": frame["timestamp"] - start} for frame in frames]
    assert_same(frames, exported(read_episode(path)))


@pytest.mark.parametrize(
    ("frame", "kind", "key", "by", "told"),
    [
        (3, "walls", "x1", 0.5, r"its walls move by 0.\d\d m at frame 3"),
        (4, "goal", "y", 0.2, r"the goal has moved by 0.20 m at frame 4"),
    ],
)
def test_walls_and_goals_that_move_are_refused(
    records: list[EpisodeRecord], tmp_path: Path, frame: int, kind: str, key: str, by: float, told: str
) -> None:
    frames = exported(records[0])
    frames[frame][kind][0][key] += by
    path = tmp_path / "moved.json"
    path.write_text(json.dumps(frames))
    with pytest.raises(RecordError, match=told):
        list(sonata_reader.import_(path, PLAIN))


def test_goal_and_robot_are_those_of_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A world turned and moved as a whole looks the same to the robot."""
    without_ties(monkeypatch)
    first = exported(recorded(tmp_path, plain_scene()))[0]
    scene = plain_scene(
        robot=Robot(Pose(0.0, -1.0, math.pi / 2)),
        goal=Goal(0.0, 3.0),
        humans=(Human(1, Pose(-2.0, 2.0, math.pi / 2)),),
        furniture=(Furniture(2, "table", Pose(2.0, 1.0, math.pi), Rectangle(1.2, 0.8)),),
    )
    turned = exported(recorded(tmp_path, scene))[0]
    for key in ("goal", "people", "objects"):
        assert turned[key] == [pytest.approx(entity, abs=1e-4) for entity in first[key]]
