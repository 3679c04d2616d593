"""`socnav3`: exported files pass the published schema and need no repair by their readers."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.geometry import Disc, Pose, Rectangle, inside_polygon
from sonata2d.core.vectors import wrap_angle
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.errors import RecordError
from sonata2d.formats import occupancy, socnav3
from sonata2d.formats.api import export_to
from sonata2d.formats.format import Options
from sonata2d.formats.importing import encode_episode
from sonata2d.record.files import read_bytes
from sonata2d.record.layout import JsonDict
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord, record_from_document
from sonata2d.scenegen.scenario.load import preset_names

from ..record.conftest import episode  # noqa: F401

DEFAULT = Options()
SHARED = Path(__file__).parents[3] / "shared" / "data" / "formats" / "socnav3.json"

# The schema of SocNav3 trajectory files, written from the published list of fields.
NUMBER: JsonDict = {"type": "number"}


def json_object(required: JsonDict, optional: JsonDict | None = None) -> JsonDict:
    """Return the schema of an object with these keys; additional keys are allowed."""
    return {"type": "object", "properties": required | (optional or {}), "required": list(required)}


def number_keys(*names: str) -> JsonDict:
    return dict.fromkeys(names, NUMBER)


def array(items: JsonDict, **limits: int) -> JsonDict:
    return {"type": "array", "items": items, **limits}


POSE = number_keys("x", "y", "angle")
SHAPE = json_object({"type": {"enum": ["circle", "rectangle"]}} | number_keys("width", "length"))
GOAL = json_object(
    {"type": {"enum": ["go-to", "guide-to", "follow"]}, "human": {"type": ["null", "number"]}} | POSE,
    number_keys("pos_threshold", "angle_threshold"),
)
TYPES = {"enum": ["chair", "table", "plant", "tv", "shelf", "floor_lamp"]}
STEP = json_object(
    {
        "timestamp": NUMBER,
        "robot": json_object(POSE | number_keys("speed_x", "speed_y", "speed_a") | {"shape": SHAPE}),
        "people": array(json_object({"id": NUMBER} | POSE)),
        "objects": array(json_object({"id": NUMBER, "type": TYPES} | POSE | {"shape": SHAPE})),
        "goal": GOAL,
    }
)
GRID = json_object(
    number_keys("width", "height", "cell_size", "x_orig", "y_orig", "angle_orig")
    | {"data": array(array({"enum": [-1, 0, 1]}))}
)
SCHEMA = json_object(
    {"grid": GRID, "walls": array(array(NUMBER, minItems=4, maxItems=4)), "sequence": array(STEP)},
    {"metadata": {"type": "string"}, "context_description": {"type": "string"}, "label": NUMBER},
)


def exported(record: EpisodeRecord) -> JsonDict:
    file: JsonDict = json.loads(socnav3.export(record, DEFAULT))
    return file


def imported(file: JsonDict, tmp_path: Path) -> JsonDict:
    path = tmp_path / "one.json"
    path.write_text(json.dumps(file))
    (document,) = socnav3.import_(path, DEFAULT)
    return document


def test_exported_files_pass_the_published_schema(records: list[EpisodeRecord]) -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema", reason="fastjsonschema comes with the test extra")
    validate = fastjsonschema.compile(SCHEMA)
    for record in records:
        validate(exported(record))
    invalid = exported(records[0])
    invalid["sequence"][0]["objects"].append({"id": 99, "type": "laptop", "x": 0, "y": 0, "angle": 0})
    with pytest.raises(fastjsonschema.JsonSchemaValueException):
        validate(invalid)


def test_exported_files_need_no_repair(records: list[EpisodeRecord]) -> None:
    """The schema accepts these faults, but loaders fail on them."""
    for record in records:
        file = exported(record)
        stamps = [step["timestamp"] for step in file["sequence"]]
        assert all(0.1 <= b - a < 0.5 for a, b in pairwise(stamps))
        for step in file["sequence"]:
            assert {"pos_threshold", "angle_threshold"} <= set(step["goal"])
            assert {thing["type"] for thing in step["objects"]} <= set(socnav3.TYPES)
        assert all(map(math.isfinite, numbers(file)))
        assert file["context_description"] == (record.context or socnav3.DEFAULT_CONTEXT)


def numbers(tree: Any) -> list[float]:
    """Return all numbers of a tree."""
    if isinstance(tree, dict):
        return [number for value in tree.values() for number in numbers(value)]
    if isinstance(tree, list):
        return [number for value in tree for number in numbers(value)]
    return [float(tree)] if isinstance(tree, int | float) else []


def test_velocities_agree_with_the_change_of_poses(records: list[EpisodeRecord]) -> None:
    """Body-frame speeds of a step, against the finite difference from the step before, as readers compute it.

    Within a tick the robot turns by up to 0.15 rad, which is worth 0.05 m/s; where the guard limits the robot, it does
    so between two physics steps, and the difference is a mean of both.
    """
    ticks = 0
    for record in records:
        for before, after in pairwise(exported(record)["sequence"]):
            old, new, dt = before["robot"], after["robot"], after["timestamp"] - before["timestamp"]
            c, s = math.cos(new["angle"]), math.sin(new["angle"])
            vx, vy = (new["x"] - old["x"]) / dt, (new["y"] - old["y"]) / dt
            error = math.hypot(vx * c + vy * s - new["speed_x"], vy * c - vx * s - new["speed_y"])
            guarded = before["sonata2d"]["guarded"]
            assert error < (0.3 if guarded else 0.06)
            assert wrap_angle(new["angle"] - old["angle"]) / dt == pytest.approx(new["speed_a"], abs=0.003)
            ticks += not guarded
    assert ticks > 400


def test_values_outside_the_schema_are_under_extra_keys(records: list[EpisodeRecord]) -> None:
    for record in records:
        file, document = exported(record), record.document
        extras = file["sonata2d"]
        assert [thing["type"] for thing in extras["other_objects"]] == [
            thing["type"] for thing in document["objects"] if thing["type"] == "laptop"
        ]
        assert (extras["header"]["seed"], extras["header"]["version"]) == (document["seed"], document["version"])
        assert file["sequence"][0]["sonata2d"]["interactions"] == document["interactions"]
        rows = [[p["vx"], p["vy"], p["omega"], p["head"]] for p in file["sequence"][3]["people"]]
        assert rows == [row[3:] for row in document["frames"][3]["humans"]]
        assert [p["radius"] for p in file["sequence"][0]["people"]] == [h["radius"] for h in document["humans"]]


def test_exported_file_reads_back_to_the_byte_and_replays(records: list[EpisodeRecord], tmp_path: Path) -> None:
    for record in records:
        path = tmp_path / record.path.name
        data = encode_episode(imported(exported(record), tmp_path), path)
        assert data == read_bytes(record.path)
        path.write_bytes(data)
    assert check_replay(read_episode(tmp_path / records[0].path.name)) == []


def test_people_are_listed_while_present_and_read_back_to_the_byte(tmp_path: Path) -> None:
    """Readers match people by id and mask those who are in one of two steps only."""
    people = [{"x": 1.0, "y": 1.0, "enters": 0.5}, {"x": -1.0, "y": 2.0, "leaves": 1.0}, {"x": 1.0, "y": -1.0}]
    config = s2.ScenarioConfig(humans=0, tables=0, plants=0, relations=0, people=people, rules={"time_limit": 2.0})
    path = tmp_path / "coming.json"
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, 1), s2.StraightToGoal(), observers=[recorder]).run()
    record = read_episode(path)
    file, ids = exported(record), [human.id for human in record.scene().humans]
    listed = [[person["id"] for person in step["people"]] for step in file["sequence"]]
    assert listed == [[id for id, here in zip(ids, row, strict=True) if here] for row in record.states.present.tolist()]
    assert {len(people) for people in listed} == {2, 3}
    back = tmp_path / "back.json"
    back.write_bytes(encode_episode(imported(file, tmp_path), back))
    assert back.read_bytes() == path.read_bytes()
    assert check_replay(read_episode(back)) == []


@pytest.mark.parametrize("text", ["A robot is looking for the exit.", ""])
def test_given_context_replaces_that_of_the_episode(records: list[EpisodeRecord], text: str) -> None:
    for record in records[:2]:
        file = json.loads(socnav3.export(record, Options(context=text)))
        assert file.get("context_description", "") == text
        assert file["sonata2d"]["header"]["context"] == record.context
        assert socnav3.note(record, Options(context=text)) is None


def test_default_context_is_announced_once(folder: Path, tmp_path: Path) -> None:
    result = export_to(folder, "socnav3", tmp_path / "out")
    assert len(result.files) == 20
    (note,) = result.notes
    assert "'A robot is performing routine tasks in a home.'" in note
    assert "--context TEXT" in note
    assert note.endswith("(10 of 20 episodes)"), "the others have a context of their own"
    assert export_to(folder, "socnav3", tmp_path / "again", Options(context="A robot waits.")).notes == []


def test_objects_of_unlisted_types_are_written_as_a_given_type(episode: Path, tmp_path: Path) -> None:  # noqa: F811
    record = read_episode(episode)
    table, *others = record.document["objects"]
    document = record.document | {"objects": [table | {"type": "settee"}, *others]}
    settee = record_from_document(document, tmp_path / "settee.json")
    with pytest.raises(RecordError, match="--as settee=plant"):
        exported(settee)
    for types in ({"settee": "shelf"}, {"*": "shelf"}, {"settee": "shelf", "*": "plant"}):
        file = json.loads(socnav3.export(settee, Options(types=types)))
        written = [thing for thing in file["sequence"][0]["objects"] if thing["id"] == table["id"]]
        assert [thing["type"] for thing in written] == ["shelf"]
        assert [thing["type"] for thing in file["sonata2d"]["other_objects"]] == ["laptop"]
        assert imported(file, tmp_path)["objects"] == document["objects"], "the episode keeps its own types"
    with pytest.raises(RecordError, match="no objects of type 'bed'"):
        socnav3.export(settee, Options(types={"settee": "bed"}))


@pytest.mark.parametrize("preset", preset_names())
def test_every_preset_is_exported(preset: str, tmp_path: Path) -> None:
    config = s2.load_scenario(preset).changed(rules={"time_limit": 0.5})
    s2.generate_dataset(tmp_path / "out", config, "straight-to-goal", episodes=1)
    result = export_to(tmp_path / "out", "socnav3", tmp_path / "exported", Options(context="A robot waits."))
    assert (len(result.files), result.skipped, result.refused) == (1, [], [])
    if preset != "waiting-room":
        assert result.notes == []
        return
    (note,) = result.notes
    assert note.startswith("objects of unlisted types are written as similar ones: counter as table; choose")
    (counter,) = [
        thing for thing in s2.read_episode(tmp_path / "out/000000.json").scene().furniture if thing.type == "counter"
    ]
    objects = {thing["id"]: thing for thing in json.loads(result.files[0].read_text())["sequence"][0]["objects"]}
    assert objects[counter.id]["type"] == "table"
    assert sorted((objects[counter.id]["shape"]["length"], objects[counter.id]["shape"]["width"])) == [0.6, 2.4]
    chosen = Options(context="", types={"counter": "shelf"})
    again = export_to(tmp_path / "out", "socnav3", tmp_path / "again", chosen)
    assert again.notes == []
    objects = {thing["id"]: thing for thing in json.loads(again.files[0].read_text())["sequence"][0]["objects"]}
    assert objects[counter.id]["type"] == "shelf"


@pytest.mark.parametrize(
    ("label", "expected"),
    [(0.25, 0.25), ({"how good": 1}, 1.0), (True, None), (7, None), ("good", None), (None, None)],
)
def test_label_of_the_run_is_exported_if_it_is_from_0_to_1(
    records: list[EpisodeRecord], label: Any, expected: float | None
) -> None:
    record = replace(records[0], document=records[0].document | {"label": label})
    assert exported(record).get("label") == expected


def test_grid_agrees_with_the_room(records: list[EpisodeRecord]) -> None:
    rng = np.random.default_rng(3)
    for record in records:
        scene = record.scene()
        grid = occupancy.occupancy_grid(scene)
        cells = np.array(grid["data"])
        assert cells.shape == (grid["height"], grid["width"])
        points = rng.uniform(scene.outline.min(axis=0) - 0.2, scene.outline.max(axis=0) + 0.2, (2000, 2))
        column, row = (
            np.floor((points[:, k] - grid[key]) / grid["cell_size"]).astype(int)
            for k, key in enumerate(("x_orig", "y_orig"))
        )
        values = cells[row, column]
        gaps = scene.barriers.gaps(points).min(axis=0)
        unambiguous = np.abs(gaps) > 0.06  # farther from all edges than the size of a cell
        in_furniture = np.zeros(len(points), dtype=bool)
        for thing in scene.furniture:
            if thing.on is None:
                local = np.array([thing.pose.to_local((x, y)) for x, y in points.tolist()])
                half = (
                    (thing.shape.radius,) * 2 if isinstance(thing.shape, Disc)
                    else (thing.shape.length / 2, thing.shape.width / 2)
                )  # fmt: skip
                in_disc = np.hypot(*local.T) <= half[0] if isinstance(thing.shape, Disc) else True
                in_furniture |= (np.abs(local) <= half).all(axis=1) & in_disc
        inside = inside_polygon(points, scene.outline)
        assert (values[unambiguous & in_furniture] == occupancy.OCCUPIED).all()
        assert (values[unambiguous & ~in_furniture & inside] == occupancy.FREE).all()
        assert (values[unambiguous & ~inside] == occupancy.UNKNOWN).all()
        assert (cells == occupancy.OCCUPIED).any()


def test_episodes_that_readers_would_misinterpret_are_refused(episode: Path) -> None:  # noqa: F811
    record = read_episode(episode)
    table, *others = record.document["objects"]
    with pytest.raises(RecordError, match="object 10 is of type 'settee'"):
        exported(replace(record, document=record.document | {"objects": [table | {"type": "settee"}, *others]}))
    rules, states = record.document["rules"] | {"dt": 0.05}, replace(record.states, time=record.states.time / 2)
    with pytest.raises(RecordError, match=r"readers of socnav3 drop frames less than 0.1 s apart"):
        exported(replace(record, document=record.document | {"rules": rules}, states=states))
    robot = record.states.robot.copy()
    robot[2, 1] = np.nan
    with pytest.raises(RecordError, match="y of the robot is nan at tick 2"):
        exported(replace(record, states=replace(record.states, robot=robot)))


def foreign(**changes: Any) -> JsonDict:
    """Return a file of another program: a step every 0.25 s, a pedestrian who enters later, no extra keys."""
    goal = {"type": "go-to", "human": None, "x": 3, "y": 0, "angle": 0.5, "pos_threshold": 0.3, "angle_threshold": 0.4}
    circle = {"type": "circle", "width": 0.5, "length": 0.5}
    rectangle = {"type": "rectangle", "width": 0.5, "length": 1.5}
    table = {"id": 1, "type": "table", "x": -1, "y": 2, "angle": 1.0, "shape": rectangle}
    late = {"id": 4, "x": -2, "y": -2, "angle": 0}
    speeds = {"speed_x": 0.4, "speed_y": 0, "speed_a": 0}
    steps = [
        {
            "timestamp": 10 + 0.25 * t,
            "robot": {"x": 0.1 * t, "y": 0, "angle": 0, "shape": circle} | speeds,
            "people": [{"id": 0, "x": 2, "y": 1 + 0.05 * t, "angle": 1.5}] + [late] * (t > 1),
            "objects": [table],
            "goal": goal,
        }
        for t in range(5)
    ]
    walls = [[4, 4, 4, -4], [4, -4, -4, -4], [-4, -4, -4, 4], [-4, 4, 4, 4]]
    return {"grid": {}, "walls": walls, "sequence": steps, "label": 0.75} | changes


def test_foreign_file_becomes_an_episode_that_lists_missing_values(tmp_path: Path) -> None:
    document = imported(foreign(), tmp_path)
    path = tmp_path / "made.json"
    path.write_text(json.dumps(document))
    record = read_episode(path)
    assert record.scene().rules.dt == 0.25
    assert record.states.time.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert [human.id for human in record.scene().humans] == [1, 5], "id 0 is the robot's"
    assert record.states.present[:, 1].tolist() == [False, False, True, True, True]
    assert record.states.humans[:, 0, 4] == pytest.approx(0.2)
    assert (record.scene().goal.distance, record.scene().goal.angle, record.label) == (0.3, 0.4, 0.75)
    assert record.scene().robot.radius == 0.25
    table = record.scene().furniture[0]
    assert table.id not in (0, 1, 5)
    assert (table.type, table.pose, table.shape) == ("table", Pose(-1.0, 2.0, 1.0), Rectangle(length=1.5, width=0.5))
    assert sorted(record.document["room"]["polygon"]) == [[-4, -4], [-4, 4], [4, -4], [4, 4]]
    origin = record.document["imported"]
    assert {"seed", "settings", "physics", "frames.command", "frames.interactions", "humans.radius"} <= set(
        origin["lacks"]
    )
    assert {"frames.humans.velocity", "humans.id"} <= set(origin["derived"])
    assert verify(path) == []
    assert [problem.place for problem in check_replay(read_episode(path))] == ["replay"], (
        "it reports that it cannot be replayed"
    )


def test_numbers_beyond_the_limit_of_episode_files_are_refused(records: list[EpisodeRecord], tmp_path: Path) -> None:
    file = exported(records[0])
    file["sonata2d"]["header"]["walls"][0][0] = -1e300
    with pytest.raises(RecordError, match=r"walls.0.0: Input should be .* -100000000000, got -1e\+300"):
        encode_episode(imported(file, tmp_path), tmp_path / "one.json")


def test_goals_and_objects_that_move_or_disappear_are_refused(tmp_path: Path) -> None:
    moved = foreign()
    moved["sequence"][2] |= {"goal": moved["sequence"][2]["goal"] | {"x": 2.5}}
    with pytest.raises(RecordError, match="the goal has moved at step 2"):
        imported(moved, tmp_path)
    removed = foreign()
    removed["sequence"][3] |= {"objects": []}
    with pytest.raises(RecordError, match="objects appear or disappear at step 3"):
        imported(removed, tmp_path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"walls": [[1, 2, 3]]}, "walls must be numbers"),
        ({"walls": [[1, 2, 3, "4"]]}, "walls must be numbers"),
        ({"sequence": []}, "two steps or more"),
        ({"sequence": foreign()["sequence"][::-1]}, "timestamps must rise"),
        ({"label": {"a": float("inf")}}, "is not a socnav3 file"),
    ],
)
def test_damaged_file_is_refused_with_one_line(tmp_path: Path, changes: JsonDict, message: str) -> None:
    with pytest.raises(RecordError, match=message) as caught:
        imported(foreign(**changes), tmp_path)
    assert "\n" not in str(caught.value)


def test_walls_of_a_file_without_walls_are_given_by_another_file(tmp_path: Path) -> None:
    file = foreign()
    walls = file.pop("walls")
    source = tmp_path / "one.json"
    source.write_text(json.dumps(file))
    with pytest.raises(RecordError, match="it has no walls; pass a file of them"):
        next(socnav3.import_(source, DEFAULT))
    rows = "".join(",".join(map(str, wall)) + "\n" for wall in walls)
    for text, expected in ((rows, walls), ("", [])):
        (tmp_path / "walls.csv").write_text(f"x1,y1,x2,y2\n{text}")
        document = next(socnav3.import_(source, Options(walls=tmp_path / "walls.csv")))
        assert document["walls"] == expected
        assert "walls" in document["imported"]["derived"]
        encode_episode(document, source)


def test_repeated_ids_are_replaced_on_request(tmp_path: Path) -> None:
    file = foreign()
    for step in file["sequence"]:
        step["people"] = [person | {"id": 7} for person in step["people"]]
        step["objects"] = [thing | {"x": thing["x"] + dx} for thing in step["objects"] for dx in (0, 2)]
    with pytest.raises(RecordError, match="step 2 repeats one; pass --renumber"):
        imported(file, tmp_path)
    path = tmp_path / "one.json"
    document = next(socnav3.import_(path, Options(renumber=True)))
    unique = next(socnav3.import_(written(tmp_path / "two.json", foreign()), DEFAULT))
    assert [human["id"] for human in document["humans"]] == [7, 8]
    assert [row["humans"] for row in document["frames"]] == [row["humans"] for row in unique["frames"]]
    assert len({thing["id"] for thing in document["objects"]}) == len(document["objects"]) == 2
    file["sequence"][3]["people"].reverse()
    with pytest.raises(RecordError, match="change their order at step 3"):
        next(socnav3.import_(written(path, file), Options(renumber=True)))


def written(path: Path, file: JsonDict) -> Path:
    path.write_text(json.dumps(file))
    return path


@pytest.mark.skipif(not SHARED.exists(), reason="the shared sample file is not on this machine")
def test_shared_sample_is_read(tmp_path: Path) -> None:
    (document,) = socnav3.import_(SHARED, DEFAULT)
    steps = json.loads(SHARED.read_bytes())["sequence"]
    robot = [[step["robot"][key] for key in ("x", "y", "angle")] for step in steps]
    rows = [frame["robot"][:3] for frame in (*document["frames"], document["final"])]
    assert rows == [pytest.approx(row, abs=1e-4) for row in robot]
