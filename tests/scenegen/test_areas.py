"""Areas and holes of a room: who is placed where, files, mirror images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.geometry import inside_polygon
from sonata2d.core.scene import Scene
from sonata2d.datasets.transforms.mirror import mirror_file
from sonata2d.errors import ConfigError, SceneError
from sonata2d.formats.occupancy import occupancy_grid
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import EpisodeRecorder, JsonRecorder

BLOCK = ((5.0, 2.0), (9.0, 2.0), (9.0, 6.0), (5.0, 6.0))
KITCHEN, HALL = ((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0)), ((10.0, 0.0), (14.0, 0.0), (14.0, 8.0))
ROOM = {"polygon": [(0, 0), (14, 0), (14, 8), (0, 8)], "holes": [BLOCK]}
AREAS = [{"name": "kitchen", "polygon": KITCHEN}, {"name": "hall", "polygon": HALL}]


def config(**settings: Any) -> s2.ScenarioConfig:
    return s2.ScenarioConfig(**{"room": ROOM, "areas": AREAS, **settings})


def positions(scene: Scene) -> np.ndarray:
    return np.array([thing.pose.position for thing in (*scene.humans, *scene.furniture)]).reshape(-1, 2)


def are_in(points: Any, corners: Any) -> bool:
    return bool(inside_polygon(np.atleast_2d(np.array(points, dtype=float)), np.array(corners)).all())


def test_nothing_is_placed_in_a_hole() -> None:
    crowded = config(standing=10, wandering=10, tables=4, plants=4)
    for episode in range(20):
        scene = s2.generate(crowded, 1, episode)
        points = np.array([*positions(scene), scene.robot.pose.position, scene.goal.position])
        assert not inside_polygon(points, np.array(BLOCK)).any()
        assert [(wall.start, wall.end) for wall in scene.walls[4:]] == list(
            zip(BLOCK, BLOCK[1:] + BLOCK[:1], strict=True)
        )


def test_nobody_walks_into_a_hole() -> None:
    scene = s2.generate(config(standing=0, wandering=12, rules={"time_limit": 20.0, "ends_on": ["time"]}), 3)
    recorder = EpisodeRecorder()
    s2.Episode(scene, s2.load_controller("social-planner"), observers=[recorder]).run()
    walked = recorder.record().states.humans[..., :2].reshape(-1, 2)
    assert not inside_polygon(walked, np.array(BLOCK)).any()


def test_robot_goal_and_people_are_drawn_in_their_areas() -> None:
    people = [{"in": "hall"}, {"in": "kitchen", "behaviour": "wandering"}, {"in": "hall", "goals": [(1.0, 1.0)]}]
    settings = config(standing=0, wandering=0, tables=0, plants=0, people=people)
    settings = settings.changed(robot={"in": "kitchen"}, goal={"in": "hall"}, flip=0.5)
    flipped, headings = 0, set[float]()
    for episode in range(20):
        scene = s2.generate(settings, 2, episode)
        kitchen, hall = (area.polygon for area in scene.areas)
        assert are_in(scene.robot.pose.position, kitchen)
        assert are_in(scene.goal.position, hall)
        for human, corners in zip(scene.humans, (hall, kitchen, hall), strict=True):
            assert are_in(human.pose.position, corners)
        headings |= {human.pose.theta for human in scene.humans[:2]}
        flipped += kitchen != KITCHEN
    assert 0 < flipped < 20
    assert len(headings) == 40
    assert min(headings) < -2.0
    assert max(headings) > 2.0


def test_drawn_people_and_furniture_are_placed_by_the_shares_of_areas() -> None:
    shared = [AREAS[0] | {"share": 1.0}, AREAS[1] | {"share": 0.0}]
    for episode in range(10):
        assert are_in(positions(s2.generate(config(areas=shared, tables=2, standing=4), 0, episode)), KITCHEN)


def test_scenes_without_areas_and_holes_have_no_keys_for_them() -> None:
    settings = s2.generate("sonata-2020").settings
    assert settings is not None
    assert "areas" not in settings
    assert "holes" not in settings["room"]
    assert "in" not in settings["robot"] | settings["goal"]
    assert s2.ScenarioConfig(**config().settings()) == config()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"goal": {"in": "kitchn"}}, "goal.in: there is no area 'kitchn'; did you mean 'kitchen'"),
        ({"robots": [{"in": "attic"}]}, "robots.0.in: there is no area 'attic'; areas are kitchen, hall"),
        ({"people": [{"in": "hall", "x": 1.0}]}, "people.0.x: the start is drawn in an area: omit x and y"),
        ({"people": [{"in": "hall", "track": [(0, 1, 1), (1, 2, 1)]}]}, "the track gives the start: omit in"),
        ({"robot": {"in": "hall", "pose": (1, 1, 0)}}, "robot.in: the position is given: omit in"),
        ({"areas": [AREAS[0], AREAS[0]]}, "areas.1.name: the name 'kitchen' is given to more than one area"),
        ({"areas": [{"name": "x", "polygon": [(0, 0), (2, 2), (2, 0), (0, 2)]}]}, "edges of the polygon cross"),
        (
            {"people": [{"in": "hall", "jitter": (1, 1, 0)}]},
            "people.0.jitter: a start that is drawn in an area has no jitter",
        ),
        ({"robot": {"area": "hall"}}, "robot.area: unknown key 'area'"),
        ({"room": ROOM | {"holes": [BLOCK[:2]]}}, "room.holes.0"),
        (
            {"room": ROOM | {"holes": [BLOCK, BLOCK]}},
            "room.holes.1: the hole crosses or touches the outline or another",
        ),
        ({"room": ROOM | {"holes": [[(13, 1), (15, 1), (15, 2)]]}}, "room.holes.0: the hole crosses or touches"),
        ({"room": ROOM | {"holes": [[(20, 1), (22, 1), (22, 2)]]}}, "room.holes.0: the hole is outside the room"),
        ({"room": ROOM | {"holes": [BLOCK, [(6, 3), (7, 3), (7, 4)]]}}, "room.holes.1: a hole lies in another one"),
        ({"room": {"holes": [BLOCK]}}, r"room.holes: holes need a given room \(polygon\)"),
    ],
)
def test_invalid_areas_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        config(**settings)


def test_an_area_without_a_free_place_is_an_error() -> None:
    with pytest.raises(SceneError, match="no free place for a person in the area 'pillar' after 200 attempts; enlarge"):
        s2.generate(config(areas=[{"name": "pillar", "polygon": BLOCK}], people=[{"in": "pillar"}]))


def test_what_is_given_must_be_on_the_floor() -> None:
    for settings in ({"places": [{"x": 7, "y": 4}]}, {"people": [{"track": [(0, 4, 4), (5, 10, 4)]}]}):
        with pytest.raises(SceneError, match="is outside the room"):
            s2.generate(config(**settings))
    attic = {"name": "attic", "polygon": [(20, 0), (22, 0), (22, 2)]}
    outside = config(areas=[*AREAS, attic], robot={"in": "kitchen"}, goal={"in": "attic"})
    with pytest.raises(SceneError, match=r"the area 'attic', from \(20, 0\), lies outside the room; move it"):
        s2.generate(outside)


def test_holes_are_no_floor_of_grids_and_densities() -> None:
    scene = s2.generate(config(standing=2, wandering=0), 1)
    assert scene.floor_area == 14 * 8 - 16
    assert scene.is_on_floor(np.array([(1.0, 1.0), (7.0, 4.0), (15.0, 1.0)])).tolist() == [True, False, False]
    grid = occupancy_grid(scene)
    column, row = (round((place - grid[key]) / grid["cell_size"]) for place, key in ((7.0, "x_orig"), (4.0, "y_orig")))
    assert grid["data"][row][column] == grid["data"][0][0]  # unknown, as outside


def test_files_and_mirror_images_hold_areas_and_holes(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    scene = s2.generate(config(rules={"time_limit": 1.0}), 4)
    with JsonRecorder(path) as recorder:
        s2.Episode(scene, s2.load_controller("straight-to-goal"), observers=[recorder]).run()
    assert read_episode(path).scene() == scene
    image = mirror_file(path, tmp_path / "image.json").scene()
    assert image.holes == (tuple((x, -y) for x, y in BLOCK[::-1]),)
    assert image.areas[0].polygon == tuple((x, 0.0 - y) for x, y in KITCHEN[::-1])
    again = mirror_file(tmp_path / "image.json", tmp_path / "again.json")
    assert (again.scene().holes, again.scene().areas) == (scene.holes, scene.areas)


@pytest.mark.parametrize(
    ("polygon", "is_outside"),
    [
        ([[20, 20], [22, 20], [22, 22]], True),
        ([[3.5, 0], [9, 0], [9, 2], [3.5, 2]], False),  # partly inside
        ([[-9, -9], [9, -9], [9, 9], [-9, 9]], False),  # around the room
        ([[-9, 0], [9, 0], [9, 0.1], [-9, 0.1]], False),  # across it
        ([[0.6, 0.6], [0.9, 0.6], [0.9, 0.9], [0.6, 0.9]], True),  # in a hole
    ],
)
def test_areas_outside_the_room_are_refused(polygon: list[list[float]], is_outside: bool) -> None:
    hole = [[0.5, 0.5], [1.0, 0.5], [1.0, 1.0], [0.5, 1.0]]
    room = {"polygon": [[-4, -3], [4, -3], [4, 3], [-4, 3]], "holes": [hole]}
    config = s2.load_scenario("empty").changed(room=room, areas=[{"name": "bay", "polygon": polygon}])
    if is_outside:
        with pytest.raises(SceneError, match=r"the area 'bay', from \(.*\), lies outside the room; move it"):
            s2.generate(config, seed=1)
    else:
        assert s2.generate(config, seed=1).areas[0].name == "bay"
