"""Start and goal of the robot: near the paths of pedestrians if set; impossible positions are errors."""

from __future__ import annotations

from typing import Any

import pytest

from sonata2d.errors import ConfigError, SceneError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario

ROOM = {"polygon": [[-6, -6], [6, -6], [6, 6], [-6, 6]], "walls": [[-6, 2, 6, 2]]}
EMPTY: dict[str, Any] = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "room": ROOM}
WALKER = {"x": -5.0, "y": -3.0, "goals": [[5.0, -3.0]]}


def test_start_and_goal_lie_near_the_paths_of_people_if_set() -> None:
    config = ScenarioConfig(**EMPTY, people=[WALKER], robot={"on_ways": 1.0})
    for seed in range(20):
        scene = generate(config, seed)
        assert abs(scene.robot.pose.y + 3.0) <= 1.0 + 1e-4
        assert abs(scene.goal.y + 3.0) <= 1.0 + 1e-4
    anywhere = [generate(ScenarioConfig(**EMPTY, people=[WALKER]), seed) for seed in range(20)]
    assert any(abs(scene.goal.y + 3.0) > 1.0 for scene in anywhere)


def test_a_track_counts_as_a_path_and_is_mirrored_with_the_scene() -> None:
    config = ScenarioConfig(
        **EMPTY | {"room": {"kinds": "square", "side": 10}},
        people=[{"track": [[0.0, -4.0, 3.0], [8.0, 4.0, 3.0]]}],
        robot={"on_ways": 0.5},
        flip=1.0,
    )
    assert all(abs(generate(config, seed).goal.y + 3.0) <= 0.5 + 1e-4 for seed in range(5))


@pytest.mark.parametrize(
    ("section", "remedy"),
    [
        ({"areas": [{"name": "all", "polygon": [[-4, -4], [4, -4], [4, 4], [-4, 4]], "no_go": True}]}, "no-go areas"),
        ({"opened_by": "people"}, "let robots open more doors"),
        ({"opened_by": "nobody", "opening": 1.0}, None),
    ],
)
def test_no_go_areas_and_closed_doors_are_named_where_there_is_no_way(
    section: dict[str, Any], remedy: str | None
) -> None:
    room: dict[str, Any] = {"kinds": "square", "side": 8}
    if "areas" not in section:
        room["walls"] = [[0, -4, 0, -0.45], [0, 0.45, 0, 4]]
        section = {"interior_doors": [{"x": 0, "y": 0, **section}], "robot": {"pose": [-2, 0, 0]}}
        section |= {"goal": {"position": [2, 0]}} if remedy is None else {"goal": {"min_distance": 11}}
    config = ScenarioConfig(**EMPTY | {"room": room} | section)
    if remedy is None:
        assert generate(config, 1).goal.x == 2.0
        return
    with pytest.raises(SceneError, match=f"{remedy}.*, widen the room"):
        generate(config, 1)


def test_without_paths_the_error_names_the_setting() -> None:
    with pytest.raises(SceneError, match=r"no free start and goal .* or set robot\.on_ways to null$"):
        generate(ScenarioConfig(**EMPTY, robot={"on_ways": 1.0}), 1)
    with pytest.raises(ConfigError, match="greater than 0"):
        ScenarioConfig(robot={"on_ways": 0.0})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"goal": {"position": [0, 2]}}, r"the robot's goal \(0, 2\) is inside or too close to a wall"),
        (
            {"robot": {"pose": [1, 2.2, 0]}},
            r"the robot's start \(1, 2\.2\) is inside or too close to a wall",
        ),
        ({"goal": {"position": [9, 0]}}, r"the robot's goal \(9, 0\) is outside the room; move it"),
        (
            {"robot": {"pose": [0, 0, 0]}, "goal": {"position": [0, 4]}},
            r"from its start \(0, 0\) to its goal \(0, 4\); move",
        ),
    ],
)
def test_an_impossible_start_or_goal_is_an_error(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        generate(ScenarioConfig(**EMPTY, **settings), 1)


def test_the_error_is_that_of_most_layouts() -> None:
    """A robot that is too large for the door: in a few layouts the person has no space either."""
    config = load_scenario("narrow-doorway").changed(robot={"radius": 0.7})
    for seed in range(4):
        with pytest.raises(SceneError, match=r"no path for the robot .* or give the robot a smaller body"):
            generate(config, seed)
