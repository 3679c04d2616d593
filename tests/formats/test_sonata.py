"""`sonata`: what the readers of 2020 expect, up to the last bit that matters to them."""

from __future__ import annotations

import cmath
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.entities import Furniture, Goal, Human, Interaction, Robot
from sonata2d.core.geometry import Pose, Rectangle
from sonata2d.core.scene import Scene
from sonata2d.errors import RecordError
from sonata2d.formats import sonata
from sonata2d.formats.format import Options, exact_stamps
from sonata2d.record.layout import JsonDict
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder

from ..record import samples as by_hand

DEFAULT, ORIGINAL = Options(), Options(original=True)
SHARED = Path(__file__).parents[3] / "shared" / "data" / "formats" / "sonata.json"


# The graphs that readers of 2020 make of a file, by their published description; written for these tests.


def kept_frames(frames: list[JsonDict], interval: float = 1.0) -> list[int]:
    """Return the first frame and each that is at least `interval` seconds after the last kept one."""
    kept = [0]
    for k, frame in enumerate(frames):
        if frame["timestamp"] - frames[kept[-1]]["timestamp"] >= interval:
            kept.append(k)
    return kept


def wall_nodes(frame: JsonDict, piece: int = 400) -> int:
    lengths = (math.hypot(w["x1"] - w["x2"], w["y1"] - w["y2"]) for w in frame["walls"])
    return sum(int(100 * length / piece) + 1 for length in lengths)


def graph_of_frame(frame: JsonDict) -> tuple[int, list[tuple[int, int]]]:
    """Return the number of nodes, and the edges; ids are indices: room 0, entities, the goal, then the walls."""
    entities = sorted(entity["id"] for entity in frame["people"] + frame["objects"])
    assert entities == list(range(1, len(entities) + 1)), "ids are used as indices"
    goal = len(entities) + 1
    nodes = [0, *entities, goal, *range(goal + 1, goal + 1 + wall_nodes(frame))]
    edges = [(0, 0)] + [pair for node in nodes[1:] for pair in ((node, node), (node, 0), (0, node))]
    for interaction in frame["interaction"]:
        edges += [(interaction["dst"], interaction["src"]), (interaction["src"], interaction["dst"])]
    return len(nodes), edges


def graph_sizes(frames: list[JsonDict]) -> list[tuple[int, int]]:
    """Return nodes and edges of each graph: up to three instants, each joined to the newest one node by node."""
    kept, sizes = kept_frames(frames), []
    for j in range(1, len(kept)):
        instants = [graph_of_frame(frames[k]) for k in reversed(kept[max(0, j - 2) : j + 1])]
        newest = instants[0][0]
        nodes = sum(count for count, _ in instants)
        edges = sum(len(instant_edges) for _, instant_edges in instants) + 2 * newest * (len(instants) - 1)
        sizes.append((nodes, edges))
    return sizes


def exported(record: EpisodeRecord, options: Options = DEFAULT) -> list[JsonDict]:
    frames: list[JsonDict] = json.loads(sonata.export(record, options))
    return frames


def recorded(tmp_path: Path, scene: Scene, ticks: int = 30) -> EpisodeRecord:
    path = tmp_path / "made.json"
    with JsonRecorder(path) as recorder:
        by_hand.run(recorder, scene, ticks=ticks)
    return read_episode(path)


def simple_scene(**changes: Any) -> Scene:
    """Return a scene with a pedestrian and a table, with ids 1 and 2, and the robot at (-1, 0), heading along +x."""
    fields: dict[str, Any] = {
        "humans": (Human(1, Pose(2.0, 2.0, 0.0)),),
        "furniture": (Furniture(2, "table", Pose(1.0, -2.0, math.pi / 2), Rectangle(1.2, 0.8)),),
        "groups": (),
        "interactions": (),
    }
    return by_hand.scene(**{**fields, **changes})


@pytest.fixture
def no_interactions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the sample contacts and interactions: their pedestrians are not in the scenes of these tests."""
    monkeypatch.setattr(by_hand, "events_at", lambda tick: {})


def test_numbers_of_graphs_nodes_and_edges_follow_the_formulas(records: list[EpisodeRecord]) -> None:
    relations, families = set(), set()
    for record in records:
        scene, frames = record.scene(), exported(record)
        relations |= {interaction.relation for interaction in scene.interactions}
        families.add(scene.family)
        people, objects = len(scene.humans), len(scene.furniture)
        walls = sum(int(100 * math.dist(wall.start, wall.end) / 400) + 1 for wall in scene.walls)
        nodes = 2 + people + objects + walls
        native = record.document["frames"]
        kept = range(0, len(native), 10)  # ticks of 0.1 s, a second apart
        sizes = graph_sizes(frames)
        assert len(sizes) == len(kept) - 1 >= 1
        for j, size in enumerate(sizes):
            instants = [native[kept[j + 1 - i]] for i in range(min(j + 2, 3))]
            counts = [len(frame["interactions"]) for frame in instants]
            edges = sum(1 + 3 * (people + objects + 1 + walls) + 2 * count for count in counts)
            assert size == (len(counts) * nodes, edges + 2 * (len(counts) - 1) * nodes)
        assert all(isinstance(frame["ID"], str) for frame in frames)  # SNGNN2D-v2 reads it
    assert len(relations) == 5
    assert len(families) == 3


def test_velocities_are_the_previous_pose_minus_the_current_one(records: list[EpisodeRecord]) -> None:
    for record in records:
        frames, native = exported(record), record.document["frames"]
        objects = [(thing["id"], [thing["x"], thing["y"], thing["theta"]]) for thing in record.document["objects"]]
        ids = [human["id"] for human in record.document["humans"]]
        before: dict[int, tuple[float, float, float]] = {}
        for frame, state in zip(frames, native, strict=True):
            x, y, heading = state["robot"][:3]
            entities = [(id, row[:3]) for id, row in zip(ids, state["humans"], strict=True)] + objects
            written = {entity["id"]: entity for entity in frame["people"] + frame["objects"]}
            now = {}
            for id, (px, py, theta) in entities:
                offset = (complex(px, py) - complex(x, y)) * cmath.exp(-1j * heading)  # ahead + left i
                turn = (theta - heading + math.pi / 2) % (2 * math.pi)
                now[id] = (-offset.imag, offset.real, -turn)
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


@pytest.mark.usefixtures("no_interactions")
def test_frame_agrees_with_values_computed_by_hand(tmp_path: Path) -> None:
    """The robot heads along +x: points to its left have a negative x, and its own heading is a = -pi/2."""
    first = exported(recorded(tmp_path, simple_scene()))[0]
    person, table = first["people"][0], first["objects"][0]
    assert (person["x"], person["y"], person["a"]) == pytest.approx((-2.0, 3.0, -math.pi / 2))
    assert (table["x"], table["y"], table["size_x"], table["size_y"]) == pytest.approx((2.0, 2.0, 1.2, 0.8))
    assert abs(table["a"]) == pytest.approx(math.pi, abs=1e-4)  # faces the robot's left
    assert first["goal"] == [{"x": pytest.approx(0.0), "y": pytest.approx(4.0)}]
    assert first["command"] == [pytest.approx(3.5 * 0.5 / 0.8), 0.0, 0.0]
    assert all(isinstance(number, float) for number in first["command"])
    assert first["walls"][0] == pytest.approx({"x1": 4.0, "y1": -3.0, "x2": 4.0, "y2": 5.0})


@pytest.mark.usefixtures("no_interactions")
def test_commands_to_the_left_are_negative(tmp_path: Path) -> None:
    record = recorded(tmp_path, simple_scene())
    record = replace(record, command=np.tile((0.0, 0.25, 0.75), (len(record), 1)))
    assert exported(record)[0]["command"] == pytest.approx([0.0, -0.5, -2.0])


@pytest.mark.usefixtures("no_interactions")
def test_interaction_with_a_laptop_is_exported_with_its_table(tmp_path: Path) -> None:
    table = simple_scene().furniture[0]
    laptop = Furniture(3, "laptop", table.pose, Rectangle(0.35, 0.25), on=2)
    scene = simple_scene(furniture=(table, laptop), interactions=(Interaction(1, "human_laptop_interaction", 3),))
    frames = exported(recorded(tmp_path, scene))
    assert frames[0]["interaction"] == [{"src": 1, "relation": "human_laptop_interaction", "dst": 2}]


@given(st.floats(0.001, 1.0), st.integers(0, 10_000), st.integers(1, 1000))
def test_differences_of_stamps_are_never_below_the_true_ones(dt: float, tick: int, ticks: int) -> None:
    first, second = exact_stamps([tick, tick + ticks], dt).tolist()
    assert second - first >= dt * ticks * (1 - 1e-15)
    assert second == pytest.approx((tick + ticks) * dt, abs=2e-5)


def test_ten_thousand_stamps_rise_by_a_tick_in_floating_point() -> None:
    stamps = exact_stamps(np.arange(10_001), 0.1)
    assert (np.diff(stamps) >= 0.1).all()
    assert (stamps[10:] - stamps[:-10] >= 1.0).all()
    assert (np.diff(np.arange(10_001) * 0.1) < 0.1).any(), "decimal stamps would not"
    assert stamps[-1] - 1000.0 < 1e-5


def test_quirks_of_the_original_are_reproduced(records: list[EpisodeRecord]) -> None:
    jumps = 0
    for record in records:
        if any(interaction.relation == "human_object_interaction" for interaction in record.scene().interactions):
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
    assert jumps > 0, "va should jump by a whole turn in some frame"


@pytest.mark.usefixtures("no_interactions")
def test_episodes_that_readers_would_misinterpret_are_refused(tmp_path: Path) -> None:
    humans = (Human(5, Pose(2.0, 2.0)), Human(1, Pose(0.0, 3.0)))
    with pytest.raises(RecordError, match=r"ids are \[1, 5\], but readers of sonata use ids as indices and need 1..2"):
        exported(recorded(tmp_path, simple_scene(humans=humans, furniture=())))
    with pytest.raises(RecordError, match=r"1.9 s from first to last frame"):
        exported(recorded(tmp_path, simple_scene(), ticks=20))
    record = recorded(tmp_path, simple_scene())
    present = record.states.present.copy()
    present[7, 0] = False
    with pytest.raises(RecordError, match="human 1 is not present at tick 7"):
        exported(replace(record, states=replace(record.states, present=present)))
    time = record.states.time.copy()
    time[5] += 0.03
    with pytest.raises(RecordError, match=r"frame 5 was recorded at 0.53 s, not at 5 \* 0.1 s"):
        exported(replace(record, states=replace(record.states, time=time)))


def test_exported_file_reads_back_with_all_that_the_format_holds(records: list[EpisodeRecord], tmp_path: Path) -> None:
    """The format has no world frame, so the robot's observations are compared."""
    for record in records:
        path = tmp_path / "one.json"
        path.write_bytes(sonata.export(record, DEFAULT))
        (document,) = sonata.import_(path, DEFAULT)
        back = tmp_path / "back.json"
        back.write_bytes(json.dumps(document).encode())
        assert_same(exported(record), exported(read_episode(back)))
        assert document["imported"]["format"] == "sonata"
        assert "robot.limits" in document["imported"]["lacks"]


def assert_same(old: list[JsonDict], new: list[JsonDict]) -> None:
    """Compare frames up to 1e-4 m of rounding, and 5e-5 rad of the robot's theta at a distance of 10 m."""
    assert len(old) == len(new)
    for was, now in zip(old, new, strict=True):
        assert was["interaction"] == now["interaction"]
        assert now["command"] == pytest.approx(was["command"], abs=5e-4)
        assert now["timestamp"] == pytest.approx(was["timestamp"], abs=1e-4)
        for key in ("people", "objects", "walls", "goal"):
            for before, after in zip(was[key], now[key], strict=True):
                angles = {name: before[name] for name in ("a", "va") if name in before}
                for name, angle in angles.items():
                    assert math.remainder(after[name] - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-3)
                rest = {name: value for name, value in before.items() if name not in angles}
                assert {name: after[name] for name in rest} == pytest.approx(rest, abs=2e-3)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared sample file is not on this machine")
def test_foreign_file_reads_and_writes_back_the_same(tmp_path: Path) -> None:
    (document,) = sonata.import_(SHARED, DEFAULT)
    path = tmp_path / "made.json"
    path.write_bytes(json.dumps(document).encode())
    frames = json.loads(SHARED.read_bytes())
    start = frames[0]["timestamp"]
    frames = [frame | {"timestamp": frame["timestamp"] - start} for frame in frames]
    assert_same(frames, exported(read_episode(path)))


@pytest.mark.parametrize(
    ("frame", "kind", "key", "by", "message"),
    [
        (3, "walls", "x1", 0.5, r"its walls move by 0.\d\d m at frame 3"),
        (4, "goal", "y", 0.2, r"the goal has moved by 0.20 m at frame 4"),
    ],
)
def test_walls_and_goals_that_move_are_refused(
    records: list[EpisodeRecord], tmp_path: Path, frame: int, kind: str, key: str, by: float, message: str
) -> None:
    frames = exported(records[0])
    frames[frame][kind][0][key] += by
    path = tmp_path / "moved.json"
    path.write_text(json.dumps(frames))
    with pytest.raises(RecordError, match=message):
        list(sonata.import_(path, DEFAULT))


@pytest.mark.usefixtures("no_interactions")
def test_rotated_and_moved_scene_gives_the_same_frame(tmp_path: Path) -> None:
    first = exported(recorded(tmp_path, simple_scene()))[0]
    scene = simple_scene(
        robot=Robot(Pose(0.0, -1.0, math.pi / 2)),
        goal=Goal(0.0, 3.0),
        humans=(Human(1, Pose(-2.0, 2.0, math.pi / 2)),),
        furniture=(Furniture(2, "table", Pose(2.0, 1.0, math.pi), Rectangle(1.2, 0.8)),),
    )
    rotated = exported(recorded(tmp_path, scene))[0]
    for key in ("goal", "people", "objects"):
        assert rotated[key] == [pytest.approx(entity, abs=1e-4) for entity in first[key]]


@pytest.mark.parametrize("contributor", ["../../x", "/etc/x", "a\\b", "..", "con", "x\0y", "a" * 300])
def test_the_contributor_of_a_file_does_not_lead_to_another_folder(
    records: list[EpisodeRecord], tmp_path: Path, contributor: str
) -> None:
    record = replace(records[0], document={**records[0].document, "contributor": contributor})
    name = sonata.original_name(record)
    assert (tmp_path / name).parent == tmp_path
    assert not any(letter in name for letter in "/\\\0")
    assert len(name) < 128
