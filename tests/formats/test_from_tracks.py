"""Tracks become scenarios: people replayed, simulated, or both, with the robot put in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import PERSON_RADIUS
from sonata2d.datasets.check import check_episode
from sonata2d.datasets.replay import check_replay
from sonata2d.errors import ConfigError, RecordError, SceneError
from sonata2d.formats.from_tracks import save_scenario, scenario_from_tracks
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder

from .test_tracks import REAL

STEP = 0.4  # s a frame


def rows() -> list[tuple[int, int, float, float, int]]:
    """frame, ped, x, y, group: two who walk together, one who comes later from the other side, one who stands."""
    told = []
    for frame in range(30):
        t = STEP * frame
        told += [(frame, ped, 1.2 * t - 6.0, 0.2 + 0.2 * ped, 5) for ped in (1, 2) if frame < 25]
        told += [(frame, 3, 4.0 - 0.9 * (t - 4.0), -0.5 + 0.2 * math.sin(t), 0)] if frame >= 10 else []
        told += [(frame, 4, 0.0, 2.5 + 0.05 * (frame % 2), 0)]
    return told


def written(folder: Path, told: list[tuple[Any, ...]] | None = None, walls: str = "") -> Path:
    path = folder / "street.csv"
    lines = [",".join(map(str, (0, f, STEP * f, p, x, y, g))) for f, p, x, y, g in told or rows()]
    path.write_text("\n".join(["scene,frame,t,ped,x,y,group", *lines, ""]))
    if walls:
        (folder / "street.obstacles.csv").write_text(walls)
    return path


def person(config: s2.ScenarioConfig, id: int) -> Any:
    return next(person for person in config.people if person.id == id)


def run(config: s2.ScenarioConfig, folder: Path, seed: int = 0) -> Any:
    path = folder / "run.json"
    with JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, seed), s2.SocialPlanner(), observers=[recorder]).run()
    assert check_episode(path) == []
    assert check_replay(path) == []
    return read_episode(path)


def test_everyone_replayed_is_where_they_were_recorded(tmp_path: Path) -> None:
    config = scenario_from_tracks(
        written(tmp_path, walls="x1,y1,x2,y2\n-6,4,6,4\n"), seconds=12.0, robot=(3, 3, 0), goal=(-5, 3)
    )
    assert {one.does for one in config.people} == {"recorded"}
    assert config.room.walls == ((-6.0, 4.0, 6.0, 4.0),)
    record = run(config, tmp_path)
    column = {human.id: k for k, human in enumerate(record.scene().humans)}
    for frame, ped, x, y, _ in rows():
        if 4 * frame <= len(record):
            assert record.looks.humans[4 * frame, column[ped], :2] == pytest.approx((x, y), abs=1e-3)
    assert np.isnan(record.looks.humans[39, column[3]]).all()
    assert record.scene().groups[0].members == (1, 2)


def test_everyone_simulated_starts_as_recorded_and_wants_to_go_where_they_went(tmp_path: Path) -> None:
    config = scenario_from_tracks(written(tmp_path), people="simulated", seconds=12.0)
    late = person(config, 3)
    assert (late.does, late.enters, late.exits) == ("walking", 4.0, True)
    assert late.start == pytest.approx((4.0, -0.5 + 0.2 * math.sin(4.0)), abs=1e-4)
    assert late.goals[0] == pytest.approx((4.0 - 0.9 * 7.6, -0.5 + 0.2 * math.sin(11.6)), abs=1e-4)
    assert late.desired_speed.min == late.desired_speed.max == pytest.approx(0.9, abs=0.05)
    assert late.velocity[0] == pytest.approx(-0.9, abs=1e-3)
    assert person(config, 4).does == "standing"
    assert [person(config, k).group for k in (1, 2, 3)] == [5, 5, None]
    near = [person(config, k).start[1] for k in (1, 2)]
    apart = 2 * PERSON_RADIUS - 0.03  # bodies would overlap by 11 cm
    assert near == pytest.approx([0.5 - apart / 2, 0.5 + apart / 2], abs=2e-3)
    record = run(config, tmp_path)
    assert record.present[-1].sum() < 4 or len(record) < 100


def test_one_is_replayed_among_simulated_ones(tmp_path: Path) -> None:
    config = scenario_from_tracks(written(tmp_path), replay=[3], seconds=12.0)
    assert [one.does for one in config.people] == ["walking", "walking", "recorded", "standing"]
    run(config, tmp_path)


def test_who_was_recorded_in_a_wall_starts_beside_it(tmp_path: Path) -> None:
    path = written(tmp_path, [(k, 1, 0.4 * k, 0.05, 0) for k in range(10)], walls="x1,y1,x2,y2\n-3,0,3,0\n")
    config = scenario_from_tracks(path, people="simulated", seconds=3.0)
    assert config.people[0].start == pytest.approx((0.0, PERSON_RADIUS - 0.03), abs=1e-3)
    run(config, tmp_path)


def test_a_window_holds_who_is_there_and_begins_at_0(tmp_path: Path) -> None:
    config = scenario_from_tracks(written(tmp_path), start=8.0, seconds=2.0)
    track = person(config, 1).track
    assert (track[0][0], track[-1][0]) == (0.0, 1.6)  # they left at 9.6 s
    assert track[0][1] == pytest.approx(1.2 * 8.0 - 6.0)
    assert config.rules.time_limit == 2.0
    early = scenario_from_tracks(written(tmp_path), seconds=3.0)
    assert [one.id for one in early.people] == [1, 2, 4]


def test_the_room_is_wide_enough_for_everybody_and_for_the_robot(tmp_path: Path) -> None:
    config = scenario_from_tracks(written(tmp_path), robot=(9.0, 0.0, 0.0), goal=(-9.0, 0.0), seconds=12.0)
    low, high = np.min(config.room.polygon, axis=0), np.max(config.room.polygon, axis=0)
    assert low.tolist() == [-10.5, pytest.approx(min(y for *_, y, _ in rows()) - 1.5, abs=1e-3)]
    assert high[0] == 10.5
    drawn = scenario_from_tracks(written(tmp_path), seconds=12.0)
    scene = s2.generate(drawn, 4)
    assert math.hypot(scene.goal.x - scene.robot.pose.x, scene.goal.y - scene.robot.pose.y) >= 4.0


def test_who_comes_back_goes_the_round_again(tmp_path: Path) -> None:
    there = [(k, 1, 0.4 * k, 0.0, 0) for k in range(15)]
    config = scenario_from_tracks(
        written(tmp_path, there + [(29 - k, 1, 0.4 * k, 0.5, 0) for k in range(15)]), people="simulated"
    )
    assert len(person(config, 1).goals) == 2
    assert person(config, 1).goals[0][0] == pytest.approx(5.6)


def test_speeds_come_from_tracks_that_show_them(tmp_path: Path) -> None:
    short = [(k, 1, 0.4 * k, 0.0, 0) for k in range(3)]
    path = written(tmp_path, [*short, *((k, 2, 0.6 * k, 3.0, 0) for k in range(10))])
    told = scenario_from_tracks(path, people="simulated", speed=1.1)
    assert [one.desired_speed.min for one in told.people] == [1.1, pytest.approx(1.5)]
    assert scenario_from_tracks(path, people="simulated").people[0].desired_speed is None
    (tmp_path / "street.json").write_text('{"desired_speed": 1.34}')
    assert {one.desired_speed.max for one in scenario_from_tracks(path, people="simulated").people} == {1.34}


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_a_scenario_is_written_and_read_back(tmp_path: Path, suffix: str) -> None:
    config = scenario_from_tracks(written(tmp_path), replay=[3], robot=(3, 3, 0))
    save_scenario(config, tmp_path / f"street.{suffix}")
    assert s2.load_scenario(tmp_path / f"street.{suffix}") == config
    assert (tmp_path / f"street.{suffix}").read_text().count("\n") < 25
    with pytest.raises(RecordError, match=r"ends in \.yaml"):
        save_scenario(config, tmp_path / "street.toml")


def test_a_recording_that_restarts_out_of_step_is_taken_as_it_is(tmp_path: Path) -> None:
    late = [(f + 0.5, p, x, y, g) for f, p, x, y, g in rows() if p == 3]
    config = scenario_from_tracks(written(tmp_path, [row for row in rows() if row[1] != 3] + late))
    assert person(config, 3).track[0][0] == pytest.approx(4.2)


def test_trajnet_files_are_tracks_too(tmp_path: Path) -> None:
    path = tmp_path / "street.ndjson"
    lines = [f'{{"track": {{"f": {f}, "p": {p}, "x": {x}, "y": {y}}}}}' for f, p, x, y, _ in rows()]
    path.write_text("\n".join(lines))
    config = scenario_from_tracks(path)
    assert [one.id for one in config.people] == [1, 2, 3, 4]
    assert person(config, 3).track[0][0] == pytest.approx(4.0)


def broken(folder: Path, change: Any, **more: Any) -> str:
    with pytest.raises((RecordError, ConfigError)) as error:
        scenario_from_tracks(written(folder, change(rows())), **more)
    assert "\n" not in str(error.value)
    assert "street.csv" in str(error.value)
    return str(error.value)


def test_bad_tracks_get_one_clear_line(tmp_path: Path) -> None:
    lost = broken(tmp_path, lambda told: [row for row in told if row[:2] not in ((5, 1), (6, 1))])
    assert "person 1 is lost from 1.6 to 2.8 s" in lost
    jump = broken(tmp_path, lambda told: [(f, p, x + 20.0 * (p == 3 and f > 20), y, g) for f, p, x, y, g in told])
    assert "person 3 jumps at 49" in jump
    assert "two places" in broken(tmp_path, lambda told: [*told, (3, 1, 0.0, 0.0, 0)])
    assert "two frames" in broken(tmp_path, lambda told: told[:1], frame_time=0.4)
    assert "nobody is there from 100 to 160 s; it lasts 11.6 s" in broken(tmp_path, lambda told: told, start=100.0)
    assert "has the number 9; there are 1, 2, 3, 4" in broken(tmp_path, lambda told: told, replay=[9])


def test_a_robot_that_finds_no_place_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="the robot would start on person 4"):
        scenario_from_tracks(written(tmp_path), robot=(0.1, 2.4, 0.0))


def test_a_drawn_start_or_goal_lies_on_somebodys_way(tmp_path: Path) -> None:
    assert scenario_from_tracks(written(tmp_path)).robot.on_ways == 1.0
    assert scenario_from_tracks(written(tmp_path), robot=(3, 3, 0)).robot.on_ways == 1.0
    assert scenario_from_tracks(written(tmp_path), robot=(3, 3, 0), goal=(-5, 3)).robot.on_ways is None


@pytest.mark.parametrize("far", [{"robot": (100.0, 2.0, 0.0)}, {"goal": (100.0, 2.0)}])
def test_a_robot_far_from_everybody_is_refused(tmp_path: Path, far: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"\(100, 2\) is \d+\.\d m from all tracks and walls; give one within 10 m"):
        scenario_from_tracks(written(tmp_path), **far)


@pytest.mark.parametrize("walls", ["x1,y1,x2\n1,2,3\n", "x1,y1,x2,y2\n1,2,3,oh\n", "x1,y1,x2,y2\n1,2,3\n", ""])
def test_bad_walls_get_one_clear_line(tmp_path: Path, walls: str) -> None:
    (tmp_path / "walls.csv").write_text(walls)
    with pytest.raises(RecordError, match=r"walls\.csv") as error:
        scenario_from_tracks(written(tmp_path), walls=tmp_path / "walls.csv")
    assert "\n" not in str(error.value)


@pytest.mark.skipif(not REAL.exists(), reason="the recorded tracks are not on this machine")
@pytest.mark.parametrize(("name", "replay"), [("eth", ()), ("zara01", (4, 9)), ("corridor_uni", ())])
def test_recorded_people_become_a_scenario(tmp_path: Path, name: str, replay: tuple[int, ...]) -> None:
    config = scenario_from_tracks(REAL / f"{name}.csv", start=4.0, seconds=8.0, replay=replay)
    run(config, tmp_path)
