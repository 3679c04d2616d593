"""People who are given one by one."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

import sonata2d as s2
from sonata2d.core.entities import WALKING_TOGETHER, Group, Human, Interaction
from sonata2d.core.scene import Scene
from sonata2d.errors import ConfigError, SceneError
from sonata2d.scenegen.track import sampled

SQUARE = {"kinds": "square", "side": 8}
EMPTY: dict[str, Any] = {"room": SQUARE, "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}


def scene(*people: dict[str, Any], **more: Any) -> Scene:
    return s2.generate(s2.ScenarioConfig(**{**EMPTY, "people": people, **more}), seed=3)


def alone(**person: Any) -> Human:
    (human,) = scene(person).humans
    return human


def refusal(*people: dict[str, Any]) -> str:
    with pytest.raises(ValidationError) as error:
        scene(*people)
    return str(error.value)


def test_a_person_starts_where_they_are_told_to_and_the_rest_is_drawn() -> None:
    human = alone(x=1.0, y=-2.0, theta=0.5)
    assert (human.id, human.pose.x, human.pose.y, human.pose.theta) == (1, 1.0, -2.0, 0.5)
    assert human.behaviour == "standing"
    assert 0.8 <= human.desired_speed <= 1.8
    assert alone(x=0, y=0, desired_speed=0.7, radius=0.25, reacts_to_robot=0.5).desired_speed == 0.7


def test_goals_make_a_walker_and_a_track_one_who_is_recorded() -> None:
    walker = alone(x=1.0, y=1.0, goals=[[1.0, 3.0], [0.0, 0.0]], exits=True, enters=1.25, leaves=7.0)
    assert (walker.behaviour, walker.goals, walker.exits) == ("walking", ((1.0, 3.0), (0.0, 0.0)), True)
    assert (walker.enters, walker.leaves) == (13, 70)
    assert walker.pose.theta == pytest.approx(math.pi / 2, abs=1e-4)
    recorded = alone(track=[[0.4, 0.0, 0.0], [0.8, 0.4, 0.0], [1.2, 0.8, 0.0]])
    assert (recorded.behaviour, recorded.enters, recorded.leaves) == ("recorded", 4, 13)
    assert recorded.track == tuple((round(0.1 * k, 4), 0.0) for k in range(9))
    assert recorded.velocity == (1.0, 0.0)


def test_who_is_recorded_heeds_no_robot_unless_told_to() -> None:
    track = [[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]]
    recorded, told = alone(track=track), alone(track=track, reacts_to_robot=0.5)
    assert (recorded.reacts_to_robot, recorded.reaction) == (0.0, "ignores")
    assert (told.reacts_to_robot, told.reaction) == (0.5, "avoids")
    assert alone(x=0.0, y=0.0, goals=[[2.0, 0.0]]).reaction == "avoids"


def test_a_track_is_a_smooth_way_through_its_places() -> None:
    places = [(0.4 * k, 1.2 * k + 0.3 * math.sin(k), 0.5 * math.cos(k)) for k in range(12)]
    first, way = sampled(tuple(places), 0.1)
    assert first == 0
    assert len(way) == 45
    for k, (_, x, y) in enumerate(places):
        assert way[4 * k] == pytest.approx((x, y), abs=1e-4)
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way)]
    jumps = [math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(steps)]
    corners = [
        math.hypot(*(places[k - 1][i] - 2 * places[k][i] + places[k + 1][i] for i in (1, 2))) for k in range(1, 11)
    ]
    assert max(jumps) < 0.4 * max(corners) / 4  # straight pieces would have all of the turn at the corners
    assert sampled(((0.13, 0.0, 0.0), (0.37, 2.4, 0.0)), 0.1) == (2, [(0.7, 0.0), (1.7, 0.0)])
    assert sampled(((0.11, 0.0, 0.0), (0.19, 1.0, 0.0)), 0.1)[1] == []


def test_the_same_group_walks_together() -> None:
    rows = [{"x": 0.5 * k, "y": 0.0, "goals": [[3.0, 3.0]], "group": 7} for k in range(3)]
    made = scene(*rows, {"x": -2.0, "y": -2.0, "goals": [[0.0, 3.0]], "group": 8})
    assert made.groups == (Group(7, "walking", (1, 2, 3)),)
    assert made.interactions == tuple(Interaction(a, WALKING_TOGETHER, b) for a, b in ((1, 2), (1, 3), (2, 3)))
    assert [human.group for human in made.humans] == [7, 7, 7, None]


def test_drawn_people_and_things_take_the_numbers_that_are_left() -> None:
    people = [{"id": 2, "x": 0.0, "y": 0.0}, {"x": 2.0, "y": 2.0}]
    plain = scene(standing=2, tables=1, walking_pairs=1)
    made = scene(*people, standing=2, tables=1, walking_pairs=1)
    assert [human.id for human in made.humans] == [2, 1, 3, 4, 5, 6]
    assert [thing.id for thing in made.furniture] == [7, 8]
    assert made.furniture[1].on == 7
    assert [human.behaviour for human in made.humans[2:]] == [human.behaviour for human in plain.humans]
    assert {member for group in made.groups for member in group.members} == {5, 6}
    assert {(tie.src, tie.dst) for tie in made.interactions} == {(5, 6)}


def test_drawn_things_and_the_robot_keep_clear_of_who_is_given() -> None:
    people = [{"x": x, "y": y} for x in (-1.2, 0.0, 1.2) for y in (-1.2, 0.0, 1.2)]
    for seed in range(5):
        config = s2.ScenarioConfig(**{**EMPTY, "people": people, "tables": 2})
        made = s2.generate(config, seed)
        for human in made.humans:
            robot = made.robot.pose
            assert math.hypot(human.pose.x - robot.x, human.pose.y - robot.y) > 0.5
            for table in made.furniture[::2]:
                assert math.hypot(human.pose.x - table.pose.x, human.pose.y - table.pose.y) > 0.6


def test_a_scenario_file_holds_people(tmp_path: Path) -> None:
    path = tmp_path / "two.yaml"
    path.write_text("people:\n- {x: 1, y: 1, goals: [[0, 0]]}\n- {x: 2, y: 2, goal: [[0, 0]]}\n")
    with pytest.raises(ConfigError, match=r"two.yaml, line 3: people.1.goal: unknown key 'goal'; did you mean 'goals'"):
        s2.load_scenario(path)
    path.write_text("people:\n- {x: 1, y: 1, goals: [[0, 0]]}\n- {x: 2, y: 2}\n")
    config = s2.load_scenario(path)
    assert s2.ScenarioConfig(**config.settings()) == config
    assert s2.generate(config, 1).humans[0].goals == ((0.0, 0.0),)


@pytest.mark.parametrize(
    ("person", "told"),
    [
        ({"x": 1.0}, "give a start"),
        ({"x": 1.0, "y": 1.0, "track": [[0, 0, 0], [1, 1, 1]]}, "a track tells the start"),
        ({"track": [[0, 0, 0], [1, 1, 1]], "enters": 1.0}, "a track tells when"),
        ({"track": [[0, 0, 0], [0, 1, 1]]}, "must rise"),
        ({"track": [[-1, 0, 0], [0, 1, 1]]}, "from 0 or later"),
        ({"track": [[0, 0, 0]]}, "at least 2"),
        ({"x": 1.0, "y": 1.0, "behaviour": "walking"}, "who is walking has goals"),
        ({"x": 1.0, "y": 1.0, "behaviour": "recorded"}, "who is recorded has track"),
        ({"x": 1.0, "y": 1.0, "behaviour": "standing", "goals": [[0, 0]]}, "who is walking has goals, and nobody else"),
        ({"x": 1.0, "y": 1.0, "exits": True}, "no goals to leave at"),
        ({"x": 1.0, "y": 1.0, "enters": 3.0, "leaves": 2.0}, "leave before they enter"),
        ({"x": 1.0, "y": 1.0, "group": 1, "behaviour": "wandering", "enters": 1.0}, "can neither enter nor leave"),
    ],
)
def test_what_makes_no_person_is_refused(person: dict[str, Any], told: str) -> None:
    assert told in refusal(person)


def test_twins_are_refused() -> None:
    assert "id 4 is given to more than one" in refusal({"id": 4, "x": 0, "y": 0}, {"id": 4, "x": 1, "y": 1})


@pytest.mark.parametrize(
    ("person", "told"),
    [
        ({"x": 5.0, "y": 0.0}, r"the start of person 1 is outside the room at \(5, 0\)"),
        ({"x": 0.0, "y": 0.0, "goals": [[0.0, 9.0]]}, "the goal of person 1 is outside"),
        ({"track": [[0, 0, 0], [4, 6, 0]]}, "the track of person 1 is outside"),
        ({"track": [[0.11, 0, 0], [0.19, 1, 0]]}, "falls between two ticks"),
        ({"x": -3.0, "y": 0.3}, "the robot would start on person 1"),
    ],
)
def test_who_does_not_fit_into_the_room_is_told_in_one_line(person: dict[str, Any], told: str) -> None:
    with pytest.raises(SceneError, match=told) as error:
        scene(person, robot={"pose": (-3.0, 0.0, 0.0)})
    assert "\n" not in str(error.value)
