"""Rules of areas for robots: no-go, speed limit, one way; in planners, metrics, scenes, mirror images and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.core.geometry import inside_rings
from sonata2d.datasets import mirror_file, verify
from sonata2d.errors import ConfigError, SceneError
from sonata2d.gym import SocialNavEnv
from sonata2d.gym.parts import AreaRules
from sonata2d.metrics import Trajectory
from sonata2d.metrics.catalogue import METRICS
from sonata2d.view.stills import picture, snapshot_of
from tests.running import record_of

HALL: dict[str, Any] = {
    "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "rules": {"time_limit": 60},
    "room": {"polygon": [[-6, -4], [6, -4], [6, 4], [-6, 4]]}, "robot": {"pose": [-5, 0, 0]},
    "goal": {"position": [5, 0]},
}  # fmt: skip
BLOCK = [[-1, -3], [1, -3], [1, 2], [-1, 2]]
BAND = [[-2, -4], [2, -4], [2, 4], [-2, 4]]
MIDDLE = [[-2, -2], [2, -2], [2, 2], [-2, 2]]


def scene_of(*areas: dict[str, Any], **changes: Any) -> s2.Scene:
    return s2.generate(s2.ScenarioConfig(**(HALL | changes), areas=list(areas)), 1)


def run(scene: s2.Scene, controller: s2.Controller) -> Trajectory:
    return Trajectory(record_of(scene, controller))


def value(name: str, trajectory: Trajectory) -> float | None:
    return METRICS[name].function(trajectory)


@pytest.mark.parametrize("controller", [s2.SocialPlanner(), s2.Orca(), s2.SocialForce()])
def test_planners_drive_round_a_no_go_area(controller: s2.Controller) -> None:
    trajectory = run(scene_of({"name": "carpet", "polygon": BLOCK, "no_go": True}), controller)
    assert value("no_go_time", trajectory) == 0.0
    assert trajectory.record.document["outcome"]["status"] == "goal"
    straight = run(trajectory.scene, s2.StraightToGoal())
    times = straight.time[:-1][np.abs(straight.position[:-1, 0]) < 1.3]
    assert value("no_go_time", straight) == pytest.approx(len(times) * 0.1, abs=0.11), "the whole outline counts"


def test_observations_have_the_rules_as_a_part() -> None:
    areas = [
        {"name": "carpet", "polygon": BLOCK, "no_go": True},
        {"name": "far carpet", "polygon": [[5, -4], [6, -4], [6, -3]], "no_go": True},
        {"name": "ward", "polygon": [[-6, -4], [-4, -4], [-4, 4], [-6, 4]], "speed_limit": 0.4},
        {"name": "ramp", "polygon": [[-6, -4], [-4.5, -4], [-4.5, 4], [-6, 4]], "speed_limit": 0.3, "one_way": 0.0},
    ]
    config = s2.ScenarioConfig(**(HALL | {"robot": {"pose": [-5, 0, np.pi / 2]}}), areas=areas)
    env = SocialNavEnv(config, parts=["area_rules"])
    seen, _ = env.reset(seed=0)
    names = [column.name for column in AreaRules.columns]
    rules = dict(zip(names, seen["area_rules"].tolist(), strict=True))
    expected = {  # the robot looks along the y axis of the world, so that the carpet is on its right
        "no_go_x": 0.0, "no_go_y": -4.0, "no_go_distance": 4.0, "limited_x": 0.0, "limited_y": 0.0,
        "limited_distance": 0.0, "limited_speed": 0.4, "speed_limit": 0.3, "way_cos": 0.0, "way_sin": -1.0,
    }  # fmt: skip
    assert rules == pytest.approx(expected, abs=1e-4)  # headings are rounded
    assert env.observation_space.contains(seen)
    free = SocialNavEnv(s2.ScenarioConfig(**HALL), parts=["area_rules"])
    values = dict(zip(names, free.reset(seed=0)[0]["area_rules"].tolist(), strict=True))
    assert values == dict.fromkeys(names, 0.0) | {
        "no_go_distance": 100.0, "limited_distance": 100.0, "limited_speed": 20.0, "speed_limit": 20.0
    }  # fmt: skip


def test_the_planner_brakes_before_an_area_with_a_speed_limit_and_keeps_it() -> None:
    trajectory = run(scene_of({"name": "ward", "polygon": BAND, "speed_limit": 0.4}), s2.SocialPlanner())
    assert value("speeding_time", trajectory) == 0.0
    speed = np.hypot(*trajectory.velocity.T)
    assert speed.max() > 0.9, "elsewhere it drives fast"
    inside = inside_rings(trajectory.position, tuple(map(tuple, BAND)), ())
    assert speed[inside].max() <= 0.41
    straight = run(trajectory.scene, s2.StraightToGoal())
    fast = (np.abs(straight.position[:, 0]) < 2.0) & (np.hypot(*straight.velocity.T) > 0.42)
    assert value("speeding_time", straight) == pytest.approx(fast[:-1].sum() * 0.1, abs=1e-6)


def test_the_planner_takes_another_way_than_against_a_one_way_area() -> None:
    against, along = (
        run(scene_of({"name": "way", "polygon": MIDDLE, "one_way": heading}), s2.SocialPlanner())
        for heading in (3.1416, 0.0)
    )
    assert (value("wrong_way_time", against) or 0.0) < 0.6
    assert np.abs(against.position[:, 1]).max() > 1.9
    assert value("wrong_way_time", along) == 0.0
    assert np.abs(along.position[:, 1]).max() < 1.0
    straight = run(against.scene, s2.StraightToGoal())
    assert (value("wrong_way_time", straight) or 0.0) > 3.0


def test_the_metrics_are_not_defined_without_such_areas() -> None:
    trajectory = run(scene_of({"name": "lobby", "polygon": BLOCK}), s2.SocialPlanner())
    assert [value(name, trajectory) for name in ("no_go_time", "speeding_time", "wrong_way_time")] == [None] * 3


def test_a_robot_neither_starts_nor_ends_in_a_no_go_area_and_has_a_way_round_it() -> None:
    area = {"name": "carpet", "polygon": BAND, "no_go": True}
    for changes, problem in (
        ({"goal": {"position": [0, 0]}}, "the robot's goal"),
        ({"robot": {"pose": [0, 0, 0]}}, "the robot's start"),
        ({}, "there is no path for the robot"),
    ):
        with pytest.raises(SceneError, match=problem):
            scene_of(area, **changes)
    drawn = {key: HALL[key] for key in HALL if key not in ("robot", "goal")}
    config = s2.ScenarioConfig(**drawn, areas=[{"name": "carpet", "polygon": BLOCK, "no_go": True}])
    for episode in range(30):
        scene = s2.generate(config, 2, episode)
        points = np.array([scene.robot.pose.position, scene.goal.position])
        assert not inside_rings(points, scene.areas[0].polygon, ()).any()


def test_rules_are_recorded_mirrored_and_flipped(tmp_path: Path) -> None:
    areas = [{"name": "way", "polygon": MIDDLE, "one_way": 0.5, "speed_limit": 0.6}]
    path = tmp_path / "a.json"
    s2.Episode(scene_of(*areas), s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()
    assert s2.read_episode(path).document["areas"][0] == {
        "name": "way", "polygon": [[float(x), float(y)] for x, y in MIDDLE], "speed_limit": 0.6, "one_way": 0.5
    }  # fmt: skip
    assert verify(path, replay=True) == []
    mirror_file(path, tmp_path / "b.json")
    mirrored = s2.read_episode(tmp_path / "b.json").scene().areas[0]
    assert mirrored.one_way == -0.5
    assert verify(tmp_path / "b.json", replay=True) == []
    flipped = scene_of(*areas, flip=1.0).areas[0]
    assert (flipped.one_way, flipped.speed_limit) == (-0.5, 0.6)


def test_pictures_show_the_rules() -> None:
    rules: list[dict[str, Any]] = [{}, {"no_go": True}, {"speed_limit": 0.5}, {"one_way": 0.0}]
    images = [
        pygame.image.tobytes(picture(snapshot_of(scene_of({"name": "x", "polygon": BLOCK} | rule))), "RGB")
        for rule in rules
    ]
    assert len(set(images)) == 4


def test_no_robot_starts_or_ends_in_a_no_go_area_whose_edges_are_those_of_the_room() -> None:
    half = [[-6, -4], [0, -4], [0, 4], [-6, 4]]
    drawn = {"robot": {}, "goal": {}, "areas": [{"name": "left", "polygon": half, "no_go": True}]}
    config = s2.ScenarioConfig(**(HALL | drawn))
    for episode in range(20):
        scene = s2.generate(config, 1, episode)
        assert min(scene.robot.pose.x, scene.goal.x) > 0.0
    whole = {"name": "all", "polygon": [[-6, -4], [6, -4], [6, 4], [-6, 4]], "no_go": True}
    with pytest.raises(SceneError, match=r"the robot's start \(-5, 0\) is in the no-go area 'all'; move it"):
        scene_of(whole)
    band = {"name": "band", "polygon": BAND, "no_go": True}
    with pytest.raises(SceneError, match="move one of them, make the no-go areas smaller, or give"):
        scene_of(band)


def test_a_speed_limit_that_files_cannot_hold_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"speed_limit.*0\.01"):
        scene_of({"name": "ward", "polygon": BAND, "speed_limit": 1e-9})
