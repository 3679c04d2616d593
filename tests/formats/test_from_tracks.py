"""Scenarios from tracks: pedestrians replayed, simulated, or both, with a robot added."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import PERSON_BREADTH
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.errors import ConfigError, RecordError, SceneError
from sonata2d.formats.from_tracks import save_scenario, scenario_from_tracks
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder

from .test_tracks import REAL

STEP = 0.4  # s per frame


def track_rows() -> list[tuple[int, int, float, float, int]]:
    """Return rows of frame, ped, x, y, group.

    Pedestrians 1 and 2 walk together, 3 enters later from the other side, 4 stands.
    """
    rows = []
    for frame in range(30):
        t = STEP * frame
        rows += [(frame, ped, 1.2 * t - 6.0, 0.2 + 0.2 * ped, 5) for ped in (1, 2) if frame < 25]
        rows += [(frame, 3, 4.0 - 0.9 * (t - 4.0), -0.5 + 0.2 * math.sin(t), 0)] if frame >= 10 else []
        rows += [(frame, 4, 0.0, 2.5 + 0.05 * (frame % 2), 0)]
    return rows


def track_file(folder: Path, rows: list[tuple[Any, ...]] | None = None, walls: str = "") -> Path:
    path = folder / "street.csv"
    lines = [",".join(map(str, (0, f, STEP * f, p, x, y, g))) for f, p, x, y, g in rows or track_rows()]
    path.write_text("\n".join(["scene,frame,t,ped,x,y,group", *lines, ""]))
    if walls:
        (folder / "street.obstacles.csv").write_text(walls)
    return path


def person(config: s2.ScenarioConfig, id: int) -> Any:
    return next(person for person in config.people if person.id == id)


def behaviours(config: s2.ScenarioConfig) -> list[str]:
    return [person.resolved_behaviour for person in config.people]


def run(config: s2.ScenarioConfig, folder: Path, seed: int = 0) -> Any:
    """Return the record of an episode of a scenario, which passes all checks and replays."""
    path = folder / "run.json"
    with JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, seed), s2.SocialPlanner(), observers=[recorder]).run()
    assert verify(path) == []
    assert check_replay(read_episode(path)) == []
    return read_episode(path)


def test_replayed_pedestrians_are_at_their_recorded_positions(tmp_path: Path) -> None:
    config = scenario_from_tracks(
        track_file(tmp_path, walls="x1,y1,x2,y2\n-6,4,6,4\n"), seconds=12.0, robot=(3, 3, 0), goal=(-5, 3)
    )
    assert set(behaviours(config)) == {"recorded"}
    assert config.room.walls == ((-6.0, 4.0, 6.0, 4.0),)
    record = run(config, tmp_path)
    column = {human.id: k for k, human in enumerate(record.scene().humans)}
    for frame, ped, x, y, _ in track_rows():
        if 4 * frame <= len(record):
            assert record.states.humans[4 * frame, column[ped], :2] == pytest.approx((x, y), abs=1e-3)
    assert np.isnan(record.states.humans[39, column[3]]).all()
    assert record.scene().groups[0].members == (1, 2)


def test_simulated_pedestrians_start_and_aim_as_recorded(tmp_path: Path) -> None:
    config = scenario_from_tracks(track_file(tmp_path), people="simulated", seconds=12.0)
    late = person(config, 3)
    assert (late.resolved_behaviour, late.enters, late.exits) == ("walking", 4.0, True)
    assert late.start == pytest.approx((4.0, -0.5 + 0.2 * math.sin(4.0)), abs=1e-4)
    assert late.goals[0] == pytest.approx((4.0 - 0.9 * 7.6, -0.5 + 0.2 * math.sin(11.6)), abs=1e-4)
    assert late.desired_speed.min == late.desired_speed.max == pytest.approx(0.9, abs=0.05)
    assert late.velocity[0] == pytest.approx(-0.9, abs=1e-3)
    assert person(config, 4).resolved_behaviour == "standing"
    assert [person(config, k).group for k in (1, 2, 3)] == [5, 5, None]
    y = [person(config, k).start[1] for k in (1, 2)]
    distance = PERSON_BREADTH - 0.03  # recorded, the shoulders would overlap
    assert y == pytest.approx([0.5 - distance / 2, 0.5 + distance / 2], abs=2e-3)
    record = run(config, tmp_path)
    assert record.present[-1].sum() < 4 or len(record) < 100


def test_single_pedestrians_are_replayed_among_simulated_ones(tmp_path: Path) -> None:
    config = scenario_from_tracks(track_file(tmp_path), replay=[3], seconds=12.0)
    assert behaviours(config) == ["walking", "walking", "recorded", "standing"]
    run(config, tmp_path)


def test_pedestrian_recorded_inside_a_wall_starts_beside_it(tmp_path: Path) -> None:
    path = track_file(tmp_path, [(k, 1, 0.4 * k, 0.05, 0) for k in range(10)], walls="x1,y1,x2,y2\n-3,0,3,0\n")
    config = scenario_from_tracks(path, people="simulated", seconds=3.0)
    assert config.people[0].start == pytest.approx((0.0, PERSON_BREADTH / 2 - 0.03), abs=1e-3)
    run(config, tmp_path)


def test_time_window_holds_the_pedestrians_present_and_starts_at_0(tmp_path: Path) -> None:
    config = scenario_from_tracks(track_file(tmp_path), start=8.0, seconds=2.0)
    track = person(config, 1).track
    assert (track[0][0], track[-1][0]) == (0.0, 1.6)  # pedestrian 1 leaves at 9.6 s
    assert track[0][1] == pytest.approx(1.2 * 8.0 - 6.0)
    assert config.rules.time_limit == 2.0
    early = scenario_from_tracks(track_file(tmp_path), seconds=3.0)
    assert [person.id for person in early.people] == [1, 2, 4]


def test_room_encloses_all_pedestrians_and_the_robot(tmp_path: Path) -> None:
    config = scenario_from_tracks(track_file(tmp_path), robot=(9.0, 0.0, 0.0), goal=(-9.0, 0.0), seconds=12.0)
    low, high = np.min(config.room.polygon, axis=0), np.max(config.room.polygon, axis=0)
    assert low.tolist() == [-10.5, pytest.approx(min(y for *_, y, _ in track_rows()) - 1.5, abs=1e-3)]
    assert high[0] == 10.5
    drawn = scenario_from_tracks(track_file(tmp_path), seconds=12.0)
    scene = s2.generate(drawn, 4)
    assert math.hypot(scene.goal.x - scene.robot.pose.x, scene.goal.y - scene.robot.pose.y) >= 4.0


def test_round_trip_becomes_two_goals(tmp_path: Path) -> None:
    outward = [(k, 1, 0.4 * k, 0.0, 0) for k in range(15)]
    back = [(29 - k, 1, 0.4 * k, 0.5, 0) for k in range(15)]
    config = scenario_from_tracks(track_file(tmp_path, outward + back), people="simulated")
    assert len(person(config, 1).goals) == 2
    assert person(config, 1).goals[0][0] == pytest.approx(5.6)


def test_desired_speed_comes_from_long_tracks_option_or_settings_file(tmp_path: Path) -> None:
    short = [(k, 1, 0.4 * k, 0.0, 0) for k in range(3)]
    path = track_file(tmp_path, [*short, *((k, 2, 0.6 * k, 3.0, 0) for k in range(10))])
    config = scenario_from_tracks(path, people="simulated", speed=1.1)
    assert [person.desired_speed.min for person in config.people] == [1.1, pytest.approx(1.5)]
    assert scenario_from_tracks(path, people="simulated").people[0].desired_speed is None
    (tmp_path / "street.json").write_text('{"desired_speed": 1.34}')
    assert {person.desired_speed.max for person in scenario_from_tracks(path, people="simulated").people} == {1.34}


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_saved_scenario_reads_back_equal(tmp_path: Path, suffix: str) -> None:
    config = scenario_from_tracks(track_file(tmp_path), replay=[3], robot=(3, 3, 0))
    save_scenario(config, tmp_path / f"street.{suffix}")
    assert s2.load_scenario(tmp_path / f"street.{suffix}") == config
    assert (tmp_path / f"street.{suffix}").read_text().count("\n") < 25
    with pytest.raises(RecordError, match=r"end in \.yaml"):
        save_scenario(config, tmp_path / "street.toml")


def test_frame_numbers_need_not_lie_on_a_regular_grid(tmp_path: Path) -> None:
    late = [(f + 0.5, p, x, y, g) for f, p, x, y, g in track_rows() if p == 3]
    config = scenario_from_tracks(track_file(tmp_path, [row for row in track_rows() if row[1] != 3] + late))
    assert person(config, 3).track[0][0] == pytest.approx(4.2)


def test_trajnet_files_are_accepted_as_tracks(tmp_path: Path) -> None:
    path = tmp_path / "street.ndjson"
    lines = [f'{{"track": {{"f": {f}, "p": {p}, "x": {x}, "y": {y}}}}}' for f, p, x, y, _ in track_rows()]
    path.write_text("\n".join(lines))
    config = scenario_from_tracks(path)
    assert [person.id for person in config.people] == [1, 2, 3, 4]
    assert person(config, 3).track[0][0] == pytest.approx(4.0)


def refusal(folder: Path, change: Any, **options: Any) -> str:
    """Return the error message for changed track rows, which is one line and names the file."""
    with pytest.raises((RecordError, ConfigError)) as error:
        scenario_from_tracks(track_file(folder, change(track_rows())), **options)
    assert "\n" not in str(error.value)
    assert "street.csv" in str(error.value)
    return str(error.value)


def test_invalid_tracks_raise_a_message_of_one_line(tmp_path: Path) -> None:
    jump = refusal(tmp_path, lambda rows: [(f, p, x + 20.0 * (p == 3 and f > 20), y, g) for f, p, x, y, g in rows])
    assert "person 3 jumps at 49" in jump
    assert "two places" in refusal(tmp_path, lambda rows: [*rows, (3, 1, 0.0, 0.0, 0)])
    assert "two frames" in refusal(tmp_path, lambda rows: rows[:1], frame_time=0.4)
    empty = refusal(tmp_path, lambda rows: rows, start=100.0)
    assert "no pedestrian is present from 100 to 160 s; the recording lasts 11.6 s" in empty
    assert "has the id 9; the ids are 1, 2, 3, 4" in refusal(tmp_path, lambda rows: rows, replay=[9])


def test_a_person_who_is_not_observed_for_long_is_two_people(tmp_path: Path) -> None:
    rows = [row for row in track_rows() if row[1] != 1 or not 5 <= row[0] <= 10]  # 2.8 s
    config = scenario_from_tracks(track_file(tmp_path, rows), seconds=12.0)
    assert [
        (person.id, person.track[0][0], person.track[-1][0]) for person in config.people if person.id in (1, 5)
    ] == [
        (1, 0.0, pytest.approx(1.6)),
        (5, pytest.approx(4.4), pytest.approx(9.6)),
    ]
    assert person(config, 5).group == 5, "the second part is in the same group"


def test_robot_without_free_space_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="the robot would start on person 4"):
        scenario_from_tracks(track_file(tmp_path), robot=(0.1, 2.4, 0.0))


def test_drawn_start_or_goal_lies_near_a_track(tmp_path: Path) -> None:
    assert scenario_from_tracks(track_file(tmp_path)).robot.on_ways == 1.0
    assert scenario_from_tracks(track_file(tmp_path), robot=(3, 3, 0)).robot.on_ways == 1.0
    assert scenario_from_tracks(track_file(tmp_path), robot=(3, 3, 0), goal=(-5, 3)).robot.on_ways is None


@pytest.mark.parametrize("far", [{"robot": (100.0, 2.0, 0.0)}, {"goal": (100.0, 2.0)}])
def test_robot_far_from_all_pedestrians_is_refused(tmp_path: Path, far: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"\(100, 2\) is \d+\.\d m from all tracks and walls; give one within 10 m"):
        scenario_from_tracks(track_file(tmp_path), **far)


@pytest.mark.parametrize("walls", ["x1,y1,x2\n1,2,3\n", "x1,y1,x2,y2\n1,2,3,oh\n", "x1,y1,x2,y2\n1,2,3\n", ""])
def test_invalid_walls_raise_a_message_of_one_line(tmp_path: Path, walls: str) -> None:
    (tmp_path / "walls.csv").write_text(walls)
    with pytest.raises(RecordError, match=r"walls\.csv") as error:
        scenario_from_tracks(track_file(tmp_path), walls=tmp_path / "walls.csv")
    assert "\n" not in str(error.value)


@pytest.mark.skipif(not REAL.exists(), reason="the recorded tracks are not on this machine")
@pytest.mark.parametrize(("name", "replay"), [("eth", ()), ("zara01", (4, 9)), ("corridor_uni", ())])
def test_real_tracks_become_a_scenario(tmp_path: Path, name: str, replay: tuple[int, ...]) -> None:
    config = scenario_from_tracks(REAL / f"{name}.csv", start=4.0, seconds=8.0, replay=replay)
    run(config, tmp_path)
