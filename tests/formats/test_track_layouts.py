"""The reader of recorded tracks: every layout gives the same people, times and positions, by both doors."""

from __future__ import annotations

import re
import shutil
import sqlite3
import warnings
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.datasets import verify
from sonata2d.errors import RecordError
from sonata2d.formats.api import export_to, import_from
from sonata2d.formats.format import Options
from sonata2d.formats.from_tracks import scenario_from_tracks
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord

from .layouts import LAYOUTS, PEOPLE, ROWS, STEP, Layout, jupedsim, magni, sdd, table, vadere, vsp

Facts = dict[str, Any]
TWO_ROWS = "frame,ped,x,y\n0,1,2,1\n1,1,2,3\n"


def imported(path: Path, **options: Any) -> tuple[EpisodeRecord, Facts]:
    out = path.parent / "made" / "one.json"
    result = import_from(path, "tracks", out, Options(**options))
    assert [str(omission) for omission in result.refused] == []
    assert verify(out) == []
    return read_episode(out), result.tracks[out]


def tracks_of(record: EpisodeRecord) -> dict[int, np.ndarray]:
    """Return t, x, y of each person."""
    states, found = record.states, {}
    for k, human in enumerate(record.scene().humans):
        seen = states.present[:, k]
        found[human.id] = np.column_stack((states.time[seen], states.humans[seen, k, :2]))
    return found


def refusals(path: Path, **options: Any) -> str:
    """Return the message with which both doors refuse a file."""
    result = import_from(path, "tracks", path.parent / "made", Options(**options))
    (line,) = map(str, result.refused)
    with pytest.raises(RecordError) as error:
        scenario_from_tracks(path, **options)
    assert str(error.value) == line
    assert "\n" not in line
    return line


def text_file(folder: Path, text: str, name: str = "tracks.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def rows_file(folder: Path, rows: list[tuple[Any, ...]]) -> Path:
    return text_file(folder, "\n".join(["frame,ped,x,y", *(",".join(map(str, row)) for row in rows)]))


def walk(first: int, last: int, person: int, x: float, y: float = 0.0, speed: float = 1.25) -> list[tuple[Any, ...]]:
    """Return rows of a person who walks in +x at 10 frames a second."""
    return [(k, person, round(x + 0.1 * speed * (k - first), 4), y) for k in range(first, last)]


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
def test_every_layout_gives_the_same_people_times_and_positions(tmp_path: Path, layout: Layout) -> None:
    path = tmp_path / layout.name
    layout.write(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        config = scenario_from_tracks(path, **layout.options, seconds=100.0)
    of_scenario = {person.id: np.array(person.track) for person in config.people}
    record, facts = imported(path, **layout.options)
    for found in (tracks_of(record), of_scenario):
        if path.suffix == ".vsp":  # people have no ids, but an order
            found = dict(zip(PEOPLE, found.values(), strict=True))
        assert list(found) == list(PEOPLE)
        for person, truth in PEOPLE.items():
            assert found[person][[0, -1], 0] == pytest.approx(truth[[0, -1], 0], abs=1e-3)
            for column in (1, 2):
                at_truth = np.interp(truth[:, 0], found[person][:, 0], found[person][:, column])
                assert at_truth == pytest.approx(truth[:, column], abs=1e-3)
    assert facts["persons"] == 3
    assert facts["median_speed"] == pytest.approx(1.25, abs=0.01)
    assert facts["doubts"] == []


def test_walls_of_a_file_become_walls(tmp_path: Path) -> None:
    jupedsim(tmp_path / "a.sqlite")
    vadere(tmp_path / "b.traj")
    outline = {(-6.0, -4.0), (8.0, -4.0), (8.0, 4.0), (-6.0, 4.0)}
    for name, hole in (("a.sqlite", {(2.0, -3.0), (3.0, -3.0), (3.0, -2.0)}), ("b.traj", {(2.0, -3.0), (3.0, -2.5)})):
        record, facts = imported(tmp_path / name)
        corners = {wall.start for wall in record.scene().walls}
        assert outline | hole <= corners
        assert facts["walls"] == len(record.scene().walls) == 7 + (name == "b.traj")
        assert "walls" not in record.document["imported"]["lacks"]
        config = scenario_from_tracks(tmp_path / name)
        assert {tuple(corner) for corner in config.room.polygon} == outline, "walls that enclose everybody are the room"


def test_walls_given_by_the_user_replace_those_of_the_file(tmp_path: Path) -> None:
    jupedsim(tmp_path / "a.sqlite")
    walls = text_file(tmp_path, "x1,y1,x2,y2\n-6,5,6,5\n", "mine.csv")
    record, _ = imported(tmp_path / "a.sqlite", walls=walls)
    assert [(wall.start, wall.end) for wall in record.scene().walls] == [((-6.0, 5.0), (6.0, 5.0))]


def test_the_track_of_a_robot_becomes_the_robot(tmp_path: Path) -> None:
    magni(tmp_path / "m.csv")
    record, facts = imported(tmp_path / "m.csv")
    assert facts["robot"]
    assert record.states.robot[:, 0].tolist() == pytest.approx([1.0 + 0.2 * k for k in range(20)])
    assert record.states.robot[1:, 3] == pytest.approx(np.full(19, 0.5)), "0.2 m in 0.4 s"
    lacks = record.document["imported"]["lacks"]
    assert "robot" not in lacks
    assert "goal" in lacks
    config = scenario_from_tracks(tmp_path / "m.csv")
    assert config.robot.pose == pytest.approx((1.0, 3.0, 0.0))
    assert config.goal.position == pytest.approx((4.8, 3.0))
    assert {person.id for person in config.people} == {1, 2, 5}
    rows = [(*row, "pedestrian") for row in walk(0, 20, 1, 0.0)] + [(*row, "robot") for row in walk(0, 20, 2, 0.0, 2.0)]
    rows += [(*row, "cyclist") for row in walk(0, 20, 3, 0.0, 4.0)]
    text = "\n".join(["frame,id,x,y,type", *(",".join(map(str, row)) for row in rows)])
    record, facts = imported(text_file(tmp_path, text), frame_rate=10)
    assert [human.id for human in record.scene().humans] == [1]
    assert record.states.robot[0, :2].tolist() == [0.0, 2.0]
    assert facts["notes"] == ["tracks of others than people are left out: 1 cyclist"]


def test_pixels_need_a_scale(tmp_path: Path) -> None:
    sdd(tmp_path / "annotations.txt")
    vsp(tmp_path / "ucy.vsp")
    for name in ("annotations.txt", "ucy.vsp"):
        message = refusals(tmp_path / name)
        assert "its positions are pixels; give --unit METRES, the length of a pixel, or --homography FILE" in message
    matrix = text_file(tmp_path, "0 0.02 1.5\n0.02 0 0\n0 0 1\n", "matrix.txt")
    record, _ = imported(tmp_path / "ucy.vsp", homography=matrix)
    assert tracks_of(record)[1][:, 1:] == pytest.approx(PEOPLE[1][:, (2, 1)] + (1.5, 0.0), abs=1e-3)
    shutil.copy(matrix, tmp_path / "H.txt")
    record, facts = imported(tmp_path / "ucy.vsp")
    assert tracks_of(record)[1][:, 1:] == pytest.approx(PEOPLE[1][:, (2, 1)] + (1.5, 0.0), abs=1e-3)
    assert facts["notes"] == ["positions are mapped to the ground by H.txt beside it"]
    folder = tmp_path / "gates" / "video3"
    folder.mkdir(parents=True)
    sdd(folder / "annotations.txt")
    scales = text_file(tmp_path, "gates:\n   video3:\n      scale: 0.05\n      certainty: 1.0\n", "scales.yaml")
    record, _ = imported(folder / "annotations.txt", homography=scales)
    assert tracks_of(record)[2][:, 1:] == pytest.approx(PEOPLE[2][:, 1:], abs=1e-3)
    assert "gives no scale of" in refusals(tmp_path / "annotations.txt", homography=scales)


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (
            [(k, p, 100 * x, 100 * y) for k, p, x, y in ROWS],
            r"check the unit \(--unit cm gives a median of 1\.\d\d m/s\)",
        ),
        ([(p, k, x, y) for k, p, x, y in ROWS for k in (k % 3,)], "in two places in one frame"),
        ([(k, 3 - p if k > 10 and p < 3 else p, 9 * x, y) for k, p, x, y in ROWS], "faster than people run"),
    ],
)
def test_what_nobody_can_walk_is_refused_by_both_doors(tmp_path: Path, rows: list[tuple[Any, ...]], text: str) -> None:
    assert re.search(text, refusals(rows_file(tmp_path, rows), frame_time=STEP))


def test_a_wrong_frame_rate_gives_a_warning(tmp_path: Path) -> None:
    path = rows_file(tmp_path, walk(0, 40, 1, 0.0) + walk(0, 40, 2, 0.0, 2.0))
    _, facts = imported(path, frame_rate=10)
    assert facts["doubts"] == []
    _, facts = imported(path, frame_rate=20)
    assert facts["median_speed"] == 2.5
    assert facts["doubts"] == [
        "the median speed of walking people is 2.50 m/s, fast for walking; check the frame rate and the unit"
    ]
    with pytest.warns(UserWarning, match="is 2.50 m/s, fast for walking"):
        scenario_from_tracks(path, frame_rate=20)
    with pytest.warns(UserWarning, match="nobody walks, with 1 s between frames; check the frame rate and the unit"):
        scenario_from_tracks(path, frame_rate=1)


def test_short_gaps_are_bridged_and_empty_cells_are_absence(tmp_path: Path) -> None:
    rows = walk(0, 60, 1, 0.0)
    for holes in (
        [row for row in rows if not 20 <= row[0] < 30],
        [row if not 20 <= row[0] < 30 else (*row[:2], "nan", "nan") for row in rows],
        [row if not 20 <= row[0] < 30 else (*row[:2], "", "") for row in rows],
    ):
        record, facts = imported(rows_file(tmp_path, holes), frame_rate=10)
        assert tracks_of(record)[1][:, 1] == pytest.approx([row[2] for row in rows], abs=1e-4)
        assert facts["notes"][-1] == "gaps of up to 2 s are bridged by straight lines: 10 positions"
        (person,) = scenario_from_tracks(rows_file(tmp_path, holes), frame_rate=10).people
        assert [x for _, x, _ in person.track] == pytest.approx([row[2] for row in rows], abs=1e-4)


def test_after_a_long_gap_or_elsewhere_an_id_is_another_person(tmp_path: Path) -> None:
    long = walk(0, 20, 7, 0.0) + walk(60, 80, 7, 5.0)
    far = walk(0, 20, 7, 0.0) + walk(25, 45, 7, 12.0)
    for rows, begin in ((long, 6.0), (far, 2.5)):
        record, facts = imported(rows_file(tmp_path, rows + walk(0, 80, 8, 0.0, 3.0)), frame_rate=10)
        found = tracks_of(record)
        assert list(found) == [7, 8, 9]
        assert found[9][0].tolist() == pytest.approx([begin, rows[20][2], 0.0])
        assert "person 7 is not observed from 1.9 to" in facts["notes"][0]
        config = scenario_from_tracks(rows_file(tmp_path, rows), frame_rate=10)
        assert [person.id for person in config.people] == [7, 8]


def test_gaps_outside_the_time_window_do_not_matter(tmp_path: Path) -> None:
    rows = walk(0, 40, 1, 0.0) + walk(500, 510, 2, 0.0) + walk(513, 530, 2, 1.625)
    (person,) = scenario_from_tracks(rows_file(tmp_path, rows), frame_rate=10, seconds=20.0).people
    assert person.id == 1


def test_frames_may_shift_while_nobody_is_in_view(tmp_path: Path) -> None:
    rows = [(6 * k, 1, 0.5 * k, 0.0) for k in range(11)] + [(171 + 6 * k, 2, 0.5 * k, 1.0) for k in range(11)]
    record, facts = imported(rows_file(tmp_path, rows), frame_rate=15)
    found = tracks_of(record)
    for person, first in ((1, 0.0), (2, 11.2)):
        assert found[person][:, 0] == pytest.approx(first + 0.4 * np.arange(11), abs=1e-4)
        assert found[person][:, 1] == pytest.approx(0.5 * np.arange(11))
    assert facts["notes"] == ["frames are shifted by up to 0.2 s to even steps, at times when nobody is in view"]
    people = {person.id: person.track for person in scenario_from_tracks(tmp_path / "tracks.csv", frame_rate=15).people}
    assert people[2][0] == pytest.approx((171 / 15, 0.0, 1.0)), "a scenario keeps the observed times"


@pytest.mark.parametrize("rate", [7.0, 15.0, 29.97, 30.0, 100.0])
def test_any_frame_rate_gives_episodes_that_pass_check_and_are_exported_again(tmp_path: Path, rate: float) -> None:
    rows = [(k, 1, round(1.2 * k / rate, 4), 0.0) for k in range(300)]
    record, _ = imported(rows_file(tmp_path, rows), frame_rate=rate)
    assert record.states.time == pytest.approx(np.arange(300) / rate, abs=1e-4)
    assert export_to(record.path, "csv", tmp_path / "again.csv").files == [tmp_path / "again.csv"]
    again, _ = imported(tmp_path / "again.csv")
    assert again.states.time == pytest.approx(record.states.time, abs=1.1e-4)


def test_people_between_the_frames_of_others_are_moved_to_these(tmp_path: Path) -> None:
    rows = [(2 * k, 1, 0.2 * k, 0.0) for k in range(30)] + [(2 * k + 1, 2, 0.2 * k, 2.0) for k in range(5, 25)]
    record, facts = imported(rows_file(tmp_path, rows), frame_rate=12.5)
    found = tracks_of(record)[2]
    assert found[:, 0] == pytest.approx(0.16 * np.arange(6, 25))
    assert found[:, 1] == pytest.approx(0.2 * (np.arange(6, 25) - 0.5))
    assert facts["notes"] == ["19 positions between the frames of others are moved to these, on straight lines"]
    people = {
        person.id: person.track for person in scenario_from_tracks(tmp_path / "tracks.csv", frame_rate=12.5).people
    }
    assert people[2][0] == pytest.approx((0.88, 1.0, 2.0)), "a scenario keeps the observed times"


def test_uneven_times_are_moved_to_even_ones(tmp_path: Path) -> None:
    shifts = (0.0, 0.03, -0.02, 0.01)
    times = [0.1 * k + shifts[k % 4] for k in range(40)]
    text = "\n".join(["time,id,x,y", *(f"{t:.3f},1,{1.3 * t:.4f},0" for t in times)])
    record, facts = imported(text_file(tmp_path, text))
    (track,) = tracks_of(record).values()
    assert np.diff(track[:, 0]) == pytest.approx(np.full(len(track) - 1, 0.1), abs=3e-3)
    assert track[:, 1] == pytest.approx(1.3 * track[:, 0], abs=2e-3), "the speed is constant"
    assert "are moved to even ones" in facts["notes"][0]


def test_repeated_rows_count_once_and_two_places_name_the_person(tmp_path: Path) -> None:
    rows = walk(0, 30, 1, 0.0) + walk(0, 30, 2, 0.0, 2.0)
    record, facts = imported(rows_file(tmp_path, rows + rows[10:12]), frame_rate=10)
    assert len(record) == 29
    assert facts["notes"] == ["2 rows repeated: what is there twice counts once"]
    message = refusals(rows_file(tmp_path, [*rows, (12, 2, 0.5, 9.0)]), frame_rate=10)
    assert (
        "person 2 is in two places in one frame, 12: (1.5, 2) and (0.5, 9); give the second person another id"
        in message
    )


@pytest.mark.parametrize(("absent", "jumps"), [({1}, 6), ({1, 2, 3, 4, 5}, 30)])
def test_a_position_that_marks_missing_observations_is_named(tmp_path: Path, absent: set[int], jumps: int) -> None:
    """Few absences are cut out of the tracks, with a doubt; with many of them the file is refused."""
    rows = [
        (k, p, *((-999, -999) if k in (10, 11, 40, 60) and p in absent else (0.12 * k, p)))
        for k in range(160)
        for p in range(1, 6)
    ]
    path = text_file(tmp_path, "\n".join(["frame,ped,x,y", *(",".join(map(str, row)) for row in rows)]))
    remark = f"{jumps} jumps begin or end at the position (-999, -999) m; if it marks missing observations, leave"
    if len(absent) > 1:
        assert remark in refusals(path, frame_rate=10.0)
    else:
        assert remark in imported(path, frame_rate=10.0)[1]["doubts"][0]


def test_rare_jumps_divide_a_track_and_are_doubted(tmp_path: Path) -> None:
    rows = walk(0, 100, 1, 0.0) + [(k, 1, x + 3.0, y) for k, _, x, y in walk(100, 200, 1, 12.5)]
    record, facts = imported(rows_file(tmp_path, rows), frame_rate=10)
    assert list(tracks_of(record)) == [1, 2]
    assert facts["doubts"] == ["person 1 jumps between 9.9 and 10 s, faster than people run; what follows has a new id"]


def test_exchanged_ids_are_doubted(tmp_path: Path) -> None:
    a, b = walk(0, 300, 1, 0.0, speed=1.2), walk(0, 300, 2, 0.0, 2.0, speed=1.2)
    every_fourth = [row for row in a + b if row[0] % 4 == 0]
    rows = [(k, 3 - p if k >= 200 else p, x, y) for k, p, x, y in every_fourth]
    _, facts = imported(rows_file(tmp_path, rows), frame_rate=10)
    assert len(facts["doubts"]) == 1
    assert re.search(r"person \d accelerates with 1\d\.\d m/s² at [\d.]+ s; check the ids", facts["doubts"][0])


def test_people_closer_than_bodies_are_doubted(tmp_path: Path) -> None:
    rows = walk(0, 40, 1, 0.0) + walk(0, 40, 2, 0.0, 0.1)
    _, facts = imported(rows_file(tmp_path, rows), frame_rate=10)
    (doubt,) = facts["doubts"]
    assert doubt.startswith(
        "100% of the positions are within 0.2 m of another person's, closer than bodies allow; check"
    )


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("1 2 3\n2 3 4\n", {}, "3 columns without names; name them, e.g. --columns frame,ped,x,y"),
        ("1 1 0 0\n2 2 0 0\n", {}, "may be frame and id or id and frame; say which, e.g. --columns id,frame,x,y"),
        ("frame,who,x,y\n0,1,2,3\n1,1,2,3\n", {}, "no column ped; its columns are frame, who, x, y; name them"),
        ("a,b,c,d\n0,1,2,3\n1,1,2,3\n", {"columns": ("frame", "ped", "x")}, "rows have 4 cells, but 3 columns are"),
        ("0,1,2,3\n1,1,2,3\n", {"columns": ("frame", "ped", "x", "gaze")}, "the column 'gaze' is unknown; name"),
        ("frame,ped,x,y\n0,1,2,oh\n1,1,2,3\n", {"frame_rate": 1}, "row 1 has 'oh' in the column y, which must"),
        ("frame,ped,x,y\n0,,2,1\n1,1,2,3\n", {"frame_rate": 1}, "row 1 has no id of a person"),
        (TWO_ROWS, {"frame_rate": 1, "frame_time": 1}, "the frame time or the frame rate, not both"),
        (TWO_ROWS, {"frame_rate": 1, "unit": "px"}, "unit 'px' is unknown; give metres per pixel"),
        (TWO_ROWS, {"frame_rate": 1, "unit": "-1"}, "unit '-1' is unknown; use m, cm"),
        ('{"track": {"f": 0, "p": 1, "x": 0, "y": 0, "prediction_number": 0}}', {}, "1 prediction of a model, but no"),
        ('{"track": {"f": 0, "p": 1, "x": 0, "y": 0}}', {"columns": ("x", "y")}, "columns can be named in tables of"),
        ("frame,id,x,y,type\n0,1,0,0,robot\n1,1,1,0,robot\n", {"frame_rate": 1}, "it holds no track of a person"),
        ("\0\1\2", {}, "it is not text, nor a data base of JuPedSim"),
    ],
)  # fmt: skip
def test_unclear_files_are_refused_with_the_remedy(
    tmp_path: Path, text: str, options: dict[str, Any], message: str
) -> None:
    assert message in refusals(text_file(tmp_path, text), **options)


def test_damaged_files_of_each_layout_are_refused(tmp_path: Path) -> None:
    jupedsim(tmp_path / "a.sqlite")
    whole = (tmp_path / "a.sqlite").read_bytes()
    (tmp_path / "cut.sqlite").write_bytes(whole[:5000])
    assert "data base of JuPedSim" in refusals(tmp_path / "cut.sqlite")
    with closing(sqlite3.connect(tmp_path / "other.sqlite")) as base:
        base.execute("CREATE TABLE trips (id)")
        base.commit()
    assert "it has no table metadata" in refusals(tmp_path / "other.sqlite")
    row = '0 1 2 3 4 5 0 0 0 "Pedestrian"\n'
    assert "row 2 has 11 cells" in refusals(text_file(tmp_path, row + row.strip() + " 1\n", "a.txt"))
    assert "not x, y, frame and gaze" in refusals(
        text_file(tmp_path, "1 - the number of splines\n2 - Num of control points\na b c d - x\n", "a.vsp"), unit="1"
    )
    assert "no column simtime" in refusals(text_file(tmp_path, "#IDXCOL=2\npedestrianId startX-PID1\n1 2\n", "a.traj"))
    head = "FILE_ID,x\nFrame,Time,LO1 Centroid_X,LO1 Centroid_Y\n1,0.0,1,2\n"
    assert "no visible helmet" in refusals(text_file(tmp_path, head, "b.csv"))
    lone = text_file(tmp_path, "0.02 nan 1", "scale.txt")
    assert "must hold a matrix of 3 x 3 numbers, or one number" in refusals(
        text_file(tmp_path, "frame,ped,x,y\n0,1,2,1\n"), homography=lone
    )


def test_a_folder_of_tracks_is_imported_file_by_file(tmp_path: Path) -> None:
    folder = tmp_path / "all"
    folder.mkdir()
    for layout in LAYOUTS:
        if not layout.options:
            layout.write(folder / layout.name)
    text_file(folder, "frame,ped,x,y,t\n0,1,0,0,0\n", "one_row.csv")
    result = import_from(folder, "tracks", tmp_path / "out")
    assert sorted(path.stem for path in result.files) == sorted(
        layout.name.split(".")[0] for layout in LAYOUTS if not layout.options
    )
    assert [omission.file.name for omission in result.refused] == ["one_row.csv"]
    assert {facts["persons"] for facts in result.tracks.values()} == {3}


def test_a_table_is_written_beside_the_walls(tmp_path: Path) -> None:
    table("frame,ped,x,y", "{f},{p},{x},{y}")(tmp_path / "own.csv")
    text_file(tmp_path, "x1,y1,x2,y2\n-6,-3,6,-3\n", "own.obstacles.csv")
    record, facts = imported(tmp_path / "own.csv", frame_rate=25)
    assert facts["walls"] == len(record.scene().walls) == 1


@pytest.mark.parametrize(
    ("comment", "metres"),
    [
        ("time in s, positions in cm", 0.01),
        ("head height z in cm, x and y in m", 1.0),
        ("recorded in Zurich, positions in feet", 0.3048),
        ("unit: mm", 0.001),
        ("position of the person's point in cm", 0.01),
    ],
)
def test_the_unit_of_a_comment_is_that_of_x_and_y(tmp_path: Path, comment: str, metres: float) -> None:
    rows = [f"{k},{p},{x / metres},{y / metres}" for k, p, x, y in ROWS]
    path = text_file(tmp_path, "\n".join([f"# {comment}", "frame,ped,x,y", *rows]))
    record, facts = imported(path, frame_time=STEP)
    assert facts["median_speed"] == pytest.approx(1.25, abs=0.01)
    assert tracks_of(record)[5][0, 1:] == pytest.approx((0.5, -2.0), abs=1e-3)


@pytest.mark.parametrize(
    "comment",
    [
        "2.5 fps", "2.5 frames per second", "frame rate (Hz): 2.5", "frame rate is 2.5", "frame rate in Hz: 2.5",
        "framerate [fps]: 2.5", "framerate: 2,5", "fps=2.5", "Frame-Rate: 2.50 fps",
    ],
)  # fmt: skip
def test_the_frame_rate_of_a_comment(tmp_path: Path, comment: str) -> None:
    rows = [f"{k},{p},{x},{y}" for k, p, x, y in ROWS]
    _, facts = imported(text_file(tmp_path, "\n".join([f"# {comment}", "frame,ped,x,y", *rows])))
    assert facts["interval"] == 0.4


@pytest.mark.parametrize(
    ("classes", "persons", "robot", "note"),
    [
        (("adult", "car", "adult"), 2, None, "tracks of others than people are left out: 1 car"),
        (("walker", "robot", "walker"), 2, 2, ""),
        (("adult", "ego", "child"), 2, 2, ""),
        (("car", "bicycle", "car"), 3, None, "the classes bicycle, car are unknown: all count as people"),
        (("1", "2", "1"), 3, None, ""),
    ],
)
def test_classes_of_tracks(
    tmp_path: Path, classes: tuple[str, ...], persons: int, robot: int | None, note: str
) -> None:
    of = dict(zip((1, 2, 5), classes, strict=True))
    rows = [f"{k},{p},{x},{y},{of[p]}" for k, p, x, y in ROWS]
    record, facts = imported(text_file(tmp_path, "\n".join(["frame,ped,x,y,class", *rows])), frame_time=STEP)
    assert facts["persons"] == persons
    assert ("robot" in record.scene().unmeasured) == (robot is None)
    assert note in "; ".join(facts["notes"])


def test_a_file_without_people_names_its_classes(tmp_path: Path) -> None:
    rows = [f"{k},{p},{x},{y},{'robot' if p == 1 else 'car'}" for k, p, x, y in ROWS]
    line = refusals(text_file(tmp_path, "\n".join(["frame,ped,x,y,class", *rows])), frame_time=STEP)
    assert "it holds no track of a person; tracks of others than people are left out: 2 car" in line


@pytest.mark.parametrize("separator", [",", "\t", ";"])
def test_cells_may_be_empty_at_the_end_of_a_row(tmp_path: Path, separator: str) -> None:
    rows = [separator.join(map(str, row)) for row in ROWS] + [separator.join(("25", "1", "", ""))]
    path = text_file(tmp_path, "\n".join([separator.join(("frame", "ped", "x", "y")), *rows]))
    _, facts = imported(path, frame_time=STEP)
    assert facts["persons"] == 3
    assert f"1 of {len(rows)} rows hold" in "; ".join(facts["notes"])


def test_decimal_commas_may_begin_late_and_spreadsheets_name_their_separator(tmp_path: Path) -> None:
    rows = [f"{k};{p};{1 if k < 10 else '1,25'};{k if p == 1 else p}" for k in range(20) for p in (1, 2)]
    record, _ = imported(text_file(tmp_path, "\n".join(["sep=;", "frame;ped;x;y", *rows])), frame_time=1.0)
    assert tracks_of(record)[2][[0, -1], 1].tolist() == [1.0, 1.25]


def test_units_of_the_header_count_for_columns_that_the_user_names(tmp_path: Path) -> None:
    rows = [f"{k},{p},{100 * x},{100 * y}" for k, p, x, y in ROWS]
    path = text_file(tmp_path, "\n".join(["when,who,a [cm],b [cm]", *rows]))
    _, facts = imported(path, frame_time=STEP, columns=("frame", "ped", "x", "y"))
    assert facts["median_speed"] == pytest.approx(1.25, abs=0.01)


def test_an_option_that_contradicts_the_file_is_noted(tmp_path: Path) -> None:
    rows = [f"{k},{p},{x},{y}" for k, p, x, y in ROWS]
    path = text_file(tmp_path, "\n".join(["# framerate: 5", "frame,ped,x,y", *rows]))
    _, facts = imported(path, frame_time=STEP)
    assert "the file says 5 Hz; 2.5 Hz was given" in facts["notes"]
    _, facts = imported(path, frame_rate=5.0)
    assert facts["notes"] == []


@pytest.mark.parametrize("options", [{"frame_rate": 0}, {"frame_time": 0.0}, {"frame_time": -0.1}])
def test_durations_that_are_none_are_refused(tmp_path: Path, options: dict[str, float]) -> None:
    assert "must be above 0, got" in refusals(text_file(tmp_path, TWO_ROWS), **options)


def test_a_data_base_without_a_frame_rate_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    jupedsim(path)
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("UPDATE metadata SET value = '0' WHERE key = 'fps'")
    assert "it gives a frame rate of 0 Hz; give the true one with --frame-rate" in refusals(path)
    _, facts = imported(path, frame_rate=1.0 / STEP)
    assert facts["persons"] == 3


@pytest.mark.parametrize(("rate", "digits"), [(30.0, 2), (25.0, 1), (30.0, 3)])
def test_rounded_times_beside_frame_numbers(tmp_path: Path, rate: float, digits: int) -> None:
    rows = [f"{k},{k / rate:.{digits}f},{p},{p},{k / rate:.4f}" for k in range(80) for p in (1, 2)]
    _, facts = imported(text_file(tmp_path, "\n".join(["frame,t,ped,x,y", *rows])))
    assert facts["interval"] == pytest.approx(1 / rate, rel=0.02)


def test_a_person_between_the_frames_of_ucy_is_noted(tmp_path: Path) -> None:
    lines = ["2 - the number of splines", "2 - Num of control points", "0 0 0 0", "100 0 40 0"]
    lines += ["2 - Num of control points", "0 9 1 0", "9 9 9 0"]
    _, facts = imported(text_file(tmp_path, "\n".join(lines), "a.vsp"), unit="0.02")
    assert facts["persons"] == 1
    assert "person 2 is seen between two of every 10 frames only, and is left out" in facts["notes"]


def footsteps(*steps: str) -> str:
    return "\n".join(["pedestrianId simTime endTime startX-PID1 startY-PID1 endX-PID1 endY-PID1", *steps])


def test_who_waits_between_two_footsteps_stands(tmp_path: Path) -> None:
    """From 1 s to 6 s at x = 1, then on."""
    steps = ["1 0.0 1.0 0.0 0.0 1.0 0.0", "1 6.0 7.0 1.0 0.0 2.0 0.0"]
    record, _ = imported(text_file(tmp_path, footsteps(*steps), "a.traj"))
    t, x, _ = tracks_of(record)[1].T
    assert np.interp([0.5, 1.0, 3.0, 5.9, 6.5, 7.0], t, x) == pytest.approx([0.5, 1.0, 1.0, 1.0, 1.5, 2.0], abs=1e-3)


def test_what_lies_beside_vadere_is_named_in_errors(tmp_path: Path) -> None:
    path = text_file(tmp_path, footsteps("1 0.0 1.0 0.0 0.0 1.0 0.0"), "a.traj")
    (tmp_path / "x.scenario").write_text('{"scenario": {"topography": {}}}')
    line = refusals(path)
    assert "x.scenario beside it, which holds its walls, is no scenario of Vadere: 'attributes' is missing" in line
    (tmp_path / "x.scenario").unlink()
    path.write_text("#IDXCOL=2,DATACOL=5,SEP=' '\n")
    assert "it has no rows" in refusals(path)
    path.write_text(footsteps("1 0.0 1.0 0.0"))
    assert "row 1 has 4 cells, not the 7 of its columns" in refusals(path)


def test_annotations_may_have_any_blanks(tmp_path: Path) -> None:
    path = tmp_path / "annotations.txt"
    sdd(path)
    path.write_text(path.read_text().replace(" ", "  ", 40).replace(" ", "\t", 300))
    _, facts = imported(path, unit="0.02")
    assert facts["persons"] == 3


def test_a_homography_and_a_text_for_people_are_no_tracks(tmp_path: Path) -> None:
    text_file(tmp_path, TWO_ROWS, "a.txt")
    text_file(tmp_path, "1 0 0\n0 1 0\n0 0 1\n", "H.txt")
    text_file(tmp_path, "Recorded by hand.", "README.txt")
    result = import_from(tmp_path, "tracks", tmp_path / "made", Options(frame_time=1.0))
    assert [path.name for path in result.files] == ["a.json"]
    assert result.refused == []


def test_columns_may_be_one_text(tmp_path: Path) -> None:
    rows = [f"{k},{p},{x},{y}" for k, p, x, y in ROWS]
    _, facts = imported(text_file(tmp_path, "\n".join(rows)), frame_time=STEP, columns="frame,ped,x,y")
    assert facts["persons"] == 3


def test_a_robot_that_no_robot_can_follow_is_doubted(tmp_path: Path) -> None:
    rows = [f"{k},{p},{100 * x if p == 1 else x},{y},{'robot' if p == 1 else 'person'}" for k, p, x, y in ROWS]
    _, facts = imported(text_file(tmp_path, "\n".join(["frame,ped,x,y,class", *rows])), frame_time=STEP)
    assert "the robot moves at up to 125 m/s; check its track" in facts["doubts"]
