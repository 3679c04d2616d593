"""`csv` and `trajnet`: pedestrian tracks, exported and imported."""

from __future__ import annotations

import copy
import json
import pickle
import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.datasets import verify
from sonata2d.errors import RecordError, UnsuitableEpisode
from sonata2d.formats import trajnet
from sonata2d.formats.api import TransferResult, export_to, import_from
from sonata2d.formats.estimates import POSITION, VELOCITY, VX, X
from sonata2d.formats.format import Format, Options
from sonata2d.learning.graph import paper_graphs
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder
from sonata2d.registry import FORMATS

REAL = Path(__file__).parents[3] / "shared" / "data" / "real"
# frame, ped, x, y: pedestrian 3 is always present, pedestrian 8 enters and leaves
COMING_AND_GOING = [
    (frame, ped, 0.1 * frame + ped, 2.0 * ped)
    for frame in range(0, 60, 10)
    for ped in (3, 8)
    if ped == 3 or 20 <= frame <= 40
]


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def imported(path: Path, **options: float) -> EpisodeRecord:
    out = path.parent / "made" / "one.json"
    result = import_from(path, path.suffix.replace(".ndjson", ".trajnet")[1:], out, Options(**options))
    assert result == TransferResult([out])
    return read_episode(out)


def refusal(path: Path, format: str = "csv", **options: float) -> str:
    """Return the only message of a refused import, which writes nothing."""
    result = import_from(path, format, path.parent / "made", Options(**options))
    assert result.files == []
    assert not (path.parent / "made").exists()
    (line,) = map(str, result.refused)
    assert "\n" not in line
    return line


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode of ten seconds."""
    path = tmp_path_factory.mktemp("long") / "long.json"
    config = s2.ScenarioConfig(standing=1, wandering=3, rules={"time_limit": 10.0, "ends_on": ["time"]})
    with JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, 3), s2.StraightToGoal(), observers=[recorder]).run()
    return path


def test_csv_keeps_the_positions_of_all_pedestrians(records: list[EpisodeRecord], tmp_path: Path) -> None:
    for record in records:
        result = export_to(record.path, "csv", tmp_path / "one.csv")
        if not record.scene().humans:
            assert "no pedestrian is in the episode" in str(result.skipped[0])
            continue
        back = imported(tmp_path / "one.csv")
        assert (back.states.humans[..., POSITION] == record.states.humans[..., POSITION]).all()
        assert [human.id for human in back.scene().humans] == [human.id for human in record.scene().humans]
        assert (back.states.time == record.states.time).all()
        assert np.hypot(*(back.states.humans - record.states.humans)[1:, :, VELOCITY].reshape(-1, 2).T).max() < 0.5


@pytest.mark.parametrize("row", ["{},{},{},{}", "{}\t{}\t{}\t{}", "{:.1f}  {:.1f} {} {}"])
def test_four_columns_without_header_are_read(tmp_path: Path, row: str) -> None:
    text = "\n".join(row.format(*cells) for cells in COMING_AND_GOING)
    record = imported(written(tmp_path / "four.csv", text), frame_time=0.04)
    assert record.scene().rules.dt == 0.4
    assert len(record) == 5
    assert [human.id for human in record.scene().humans] == [3, 8]
    assert record.states.present[:, 1].tolist() == [False, False, True, True, True, False]
    assert record.states.humans[:, 0, POSITION].tolist() == [[pytest.approx(k + 3), 6.0] for k in range(6)]
    assert record.states.humans[:, 0, VELOCITY] == pytest.approx(np.tile((2.5, 0.0), (6, 1)))
    assert record.states.humans[2:5, 1, VX] == pytest.approx([2.5] * 3), "a new pedestrian has a velocity at once"
    lacks = set(record.document["imported"]["lacks"])
    assert {"robot", "goal", "walls", "humans.radius", "humans.group", "physics", "frames.command"} <= lacks
    assert {"frames.robot", "humans.head"} <= lacks, "neither is drawn"
    derived = set(record.document["imported"]["derived"])
    assert {"frames.humans.theta", "frames.humans.velocity", "frames.activity"} <= derived
    assert verify(record.path) == []
    with pytest.raises(RecordError, match="graphs need a robot and a goal; not in its source: goal, robot"):
        paper_graphs(record)


def test_files_of_a_folder_that_are_not_imported_are_counted(tmp_path: Path) -> None:
    folder = tmp_path / "tracks"
    folder.mkdir()
    for name in ("a.csv", "b.txt", "c.dat"):
        written(folder / name, "\n".join("{},{},{},{}".format(*cells) for cells in COMING_AND_GOING))
    result = import_from(folder, "csv", tmp_path / "out", Options(frame_time=0.04))
    assert [path.name for path in result.files] == ["a.json"]
    assert result.notes == [f"2 files of {folder} do not end in .csv and are not read"]


def test_named_columns_give_time_groups_walls_and_speed(tmp_path: Path) -> None:
    rows = [(0.4 * f / 10, p, x, y, f, 7 if p == 3 else 7 * (p == 8)) for f, p, x, y in COMING_AND_GOING]
    text = "t,ped,x,y,frame,group\n" + "\n".join(",".join(map(str, row)) for row in rows)
    written(tmp_path / "own.obstacles.csv", "x1,y1,x2,y2\n0,-3,9,-3\n")
    written(tmp_path / "own.json", '{"desired_speed": 1.5}')
    scene = imported(written(tmp_path / "own.csv", text)).scene()
    assert scene.rules.dt == 0.4
    assert [(wall.start, wall.end) for wall in scene.walls] == [((0.0, -3.0), (9.0, -3.0))]
    assert [(group.id, group.kind, group.members) for group in scene.groups] == [(7, "walking", (3, 8))]
    assert {human.desired_speed for human in scene.humans} == {1.5}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,1,2,3\n1,1,2,3\n", "does not give the duration of a frame; pass it, e.g. --frame-time"),
        ("", "it is empty"),
        ("frame,ped,x\n0,1,2\n", "no column y"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n1,1,2\n", "row 2 has 3 cells, not the 5"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n1,1,2,inf,1\n", "must be finite"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n1,1.5,2,2,1\n", "ped must be integers"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n", "two frames or more|not proportional"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n1,1,2,3,1\n1,1,2,4,1\n", "two places in one frame"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n1,1,2,3,1\n2,1,2,4,9\n", "not proportional to its frame numbers"),
        ("frame,ped,x,y,t\n0,1,2,3,0\n2,1,2,3,2\n4,1,2,3,4\n5,1,2,4,5\n", "frame 5 is not a multiple of the most"),
        (
            "frame,ped,x,y,t\n0,1,2,3,0\n1,1,2,3,1\n1e10,1,2,4,1e10\n",
            "the limit is 63636 frames for an episode with 2 people",
        ),
    ],
)
def test_invalid_track_file_is_refused_with_one_line(tmp_path: Path, text: str, message: str) -> None:
    assert re.search(message, refusal(written(tmp_path / "bad.csv", text)))


def test_trajnet_scenes_are_complete_for_their_readers(long_run: Path, tmp_path: Path) -> None:
    out = tmp_path / "long.ndjson"
    assert export_to(long_run, "trajnet", out).refused == []
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    scenes = [line["scene"] for line in lines if "scene" in line]
    tracks = [line["track"] for line in lines if "track" in line]
    positions = {(track["f"], track["p"]): (track["x"], track["y"]) for track in tracks}
    record = read_episode(long_run)
    assert len(scenes) == len(record.scene().humans) == 4
    for scene in scenes:
        frames = [f for f, p in positions if p == scene["p"] and scene["s"] <= f <= scene["e"]]
        assert frames == list(range(0, 81, 4))
        assert scene["fps"] == 2.5
    for (f, p), position in positions.items():
        assert position == tuple(record.states.humans[f, p - 1, POSITION])
    back = imported(out)
    assert back.scene().rules.dt == 0.4
    assert (back.states.humans[..., POSITION] == record.states.humans[::4, :, POSITION]).all()


def test_trajnet_refuses_short_episodes_and_other_tick_lengths(folder: Path, tmp_path: Path) -> None:
    result = export_to(folder, "trajnet", tmp_path / "out")
    assert (result.files, result.refused, len(result.skipped)) == ([], [], 20)
    assert asdict(result)["skipped"][0]["file"] == result.skipped[0].file
    assert pickle.loads(pickle.dumps(result)) == copy.deepcopy(result) == result
    assert "no pedestrian is present for 8 s" in str(result.skipped[0])
    record = read_episode(folder / "000000.json")
    slow = record.document | {"rules": record.document["rules"] | {"dt": 0.15}}
    states = replace(record.states, time=record.states.tick * 0.15)
    with pytest.raises(RecordError, match=r"ticks of 0.15 s"):
        trajnet.export(replace(record, document=slow, states=states), Options())


def test_predictions_of_models_are_not_tracks(tmp_path: Path) -> None:
    lines = [{"track": {"f": 10 * k, "p": 5, "x": k, "y": 0.0}} for k in range(3)]
    lines += [
        {"track": {"f": 10 * k, "p": 6, "x": k, "y": 9.0, "prediction_number": 0, "scene_id": 1}} for k in range(3)
    ]
    path = written(tmp_path / "given.ndjson", "\n".join(map(json.dumps, lines)))
    record = imported(path)
    assert record.states.humans[:, 0, X].tolist() == [0.0, 1.0, 2.0]
    assert len(record.scene().humans) == 1
    assert record.states.time.tolist() == [0.0, 0.4, 0.8]


@pytest.mark.skipif(not REAL.exists(), reason="the recorded tracks are not on this machine")
@pytest.mark.parametrize("name", ["eth", "zara01", "corridor_uni"])
def test_real_tracks_become_an_episode(tmp_path: Path, name: str) -> None:
    result = import_from(REAL / f"{name}.csv", "csv", tmp_path)
    record = read_episode(result.files[0])
    rows = [line.split(",") for line in (REAL / f"{name}.csv").read_text().splitlines()[1:]]
    assert record.states.present.sum() == len(rows)
    frame, ped, x, y = (np.array([float(row[k]) for row in rows]) for k in (1, 3, 4, 5))
    column = np.searchsorted([human.id for human in record.scene().humans], ped)
    positions = record.states.humans[(frame - frame.min()).astype(int), column, POSITION]
    assert np.abs(positions - np.stack((x, y), axis=1)).max() < 1e-4
    assert verify(result.files[0]) == []
    assert record.scene().walls


def test_recipe_for_pedpy_uses_columns_of_exported_files(long_run: Path, tmp_path: Path) -> None:
    docs = (Path(__file__).parents[2] / "docs" / "formats.md").read_text("utf-8")
    recipe = docs.partition("import pandas\nfrom pedpy")[2].partition("```")[0]
    export_to(long_run, "csv", tmp_path)
    header, *_ = (tmp_path / "long.csv").read_text().splitlines()
    assert header == "frame,ped,x,y,t"
    assert re.findall(r"table\.(\w+)\.", recipe) == ["frame", "frame", "t", "t"]
    assert 'rename(columns={"ped": "id"})' in recipe
    assert 'table[["id", "frame", "x", "y"]]' in recipe
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    pytest.importorskip("pedpy", reason="pedpy is not installed")
    names: dict[str, object] = {"pandas": pandas}
    exec("import pandas\nfrom pedpy" + recipe.replace("there/000000", str(tmp_path / "long")), names)
    assert len(names["trajectories"].data) == len(names["table"])  # type: ignore[attr-defined, arg-type]


def test_errors_of_unsuitable_episodes_can_be_passed_between_processes() -> None:
    error = UnsuitableEpisode(Path("a.json"), "too short", "record more")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.cause) == (str(error), "record more") == ("a.json: too short; record more", error.cause)


def test_a_format_says_which_options_it_uses(long_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = []
    plug_in = Format("text", ".txt", export=lambda record, options: texts.append(options.context) or b"")
    monkeypatch.setattr(FORMATS, "load", lambda name, problem: plug_in)
    with pytest.raises(RecordError, match="the format text does not use the option context; leave it out"):
        export_to(long_run, "text", tmp_path, Options(context="A yard."))
    plug_in = replace(plug_in, options=frozenset({"context"}))
    export_to(long_run, "text", tmp_path, Options(context="A yard."))
    assert texts == ["A yard."]
