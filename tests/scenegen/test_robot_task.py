"""Where the robot starts and goes: near people's ways if asked, and refused at once where it cannot be."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sonata2d.errors import SceneError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig

ROOM = {"polygon": [[-6, -6], [6, -6], [6, 6], [-6, 6]], "walls": [[-6, 2, 6, 2]]}
EMPTY: dict[str, Any] = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "room": ROOM}
WALKER = {"x": -5.0, "y": -3.0, "goals": [[5.0, -3.0]]}


def test_start_and_goal_lie_on_peoples_ways_if_asked() -> None:
    config = ScenarioConfig(**EMPTY, people=[WALKER], robot={"on_ways": 1.0})
    for seed in range(20):
        scene = generate(config, seed)
        assert abs(scene.robot.pose.y + 3.0) <= 1.0 + 1e-4
        assert abs(scene.goal.y + 3.0) <= 1.0 + 1e-4
    anywhere = [generate(ScenarioConfig(**EMPTY, people=[WALKER]), seed) for seed in range(20)]
    assert any(abs(scene.goal.y + 3.0) > 1.0 for scene in anywhere)


def test_a_track_is_a_way_and_mirrors_with_the_scene() -> None:
    config = ScenarioConfig(
        **EMPTY | {"room": {"kinds": "square", "side": 10}},
        people=[{"track": [[0.0, -4.0, 3.0], [8.0, 4.0, 3.0]]}],
        robot={"on_ways": 0.5},
        flip=1.0,
    )
    assert all(abs(generate(config, seed).goal.y + 3.0) <= 0.5 + 1e-4 for seed in range(5))


def test_where_nobody_goes_the_setting_is_named() -> None:
    with pytest.raises(SceneError, match=r"no free start and goal .* or set robot\.on_ways to null$"):
        generate(ScenarioConfig(**EMPTY, robot={"on_ways": 1.0}), 1)
    with pytest.raises(ValidationError, match="greater than 0"):
        ScenarioConfig(robot={"on_ways": 0.0})


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"goal": {"position": [0, 2]}}, r"the robot's goal \(0, 2\) is in a wall or thing, or too near one"),
        ({"robot": {"pose": [1, 2.2, 0]}}, r"the robot's start \(1, 2\.2\) is in a wall or thing, or too near one"),
        ({"goal": {"position": [9, 0]}}, r"the robot's goal \(9, 0\) is outside the room; move it"),
        ({"robot": {"pose": [0, 0, 0]}, "goal": {"position": [0, 4]}}, r"no way from its start \(0, 0\) to its goal"),
    ],
)
def test_a_given_place_that_cannot_be_is_told_at_once(given: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        generate(ScenarioConfig(**EMPTY, **given), 1)
