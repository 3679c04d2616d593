"""People at given places: there they are, a little moved if asked, mirrored if asked, refused if they do not fit."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from sonata2d.core.entities import TALKING, WALKING_TOGETHER
from sonata2d.errors import SceneError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario, scenario_names

HALL = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "room": {"kinds": "square", "side": 8}}


def one(**person: object) -> ScenarioConfig:
    return ScenarioConfig(**HALL, people=[{"x": 1.0, "y": 2.0, **person}])


def test_a_person_is_where_and_how_they_are_given() -> None:
    given = {"theta": 0.5, "behaviour": "walking", "goals": [(-1, -2), (3, 3)], "velocity": (0.5, 0.2)}
    (human,) = generate(one(**given, desired_speed=0.7, radius=0.25, reacts_to_robot=0.5), 3).humans
    assert (human.pose.x, human.pose.y, human.pose.theta) == (1.0, 2.0, 0.5)
    assert (human.behaviour, human.goals, human.velocity) == ("walking", ((-1.0, -2.0), (3.0, 3.0)), (0.5, 0.2))
    assert (human.desired_speed, human.radius, human.reacts_to_robot) == (0.7, 0.25, 0.5)


def test_a_person_may_have_manners_of_their_own() -> None:
    person = {"ignores_robot": 1.0, "reactions": ["ignores"]}
    people = [{"x": 0, "y": k, "reaction": kind} for k, kind in enumerate(("curious", "ignores", None))]
    humans = generate(ScenarioConfig(**HALL, person=person, people=people), 1).humans
    assert [(h.reaction, h.reacts_to_robot) for h in humans] == [("curious", 1.0), ("ignores", 0.0), ("ignores", 0.0)]


def test_what_is_not_given_is_drawn_as_for_everybody() -> None:
    speeds = {generate(one(), seed).humans[0].desired_speed for seed in range(20)}
    assert len(speeds) == 20
    assert all(0.8 <= speed <= 1.8 for speed in speeds)


def test_jitter_moves_a_start_and_its_goals_alike_within_its_reach() -> None:
    config = one(behaviour="walking", goals=[(-2.0, 2.0)], jitter=(0.5, 0.2, 0.3))
    for seed in range(30):
        (human,) = generate(config, seed).humans
        dx, dy = human.pose.x - 1.0, human.pose.y - 2.0
        assert abs(dx) <= 0.5
        assert abs(dy) <= 0.2
        assert human.goals[0] == pytest.approx((-2.0 + dx, 2.0 + dy), abs=2e-4)
    assert len({generate(config, seed).humans[0].pose for seed in range(30)}) == 30


def test_a_start_and_a_goal_of_the_robot_are_moved_as_well() -> None:
    config = ScenarioConfig(
        **HALL, robot={"pose": (-2, 0, 0), "jitter": (0.3, 0.3, 0.1)}, goal={"position": (2, 0), "jitter": (0.2, 0.1)}
    )
    found = [generate(config, seed) for seed in range(20)]
    assert len({scene.robot.pose for scene in found}) == len({scene.goal.position for scene in found}) == 20
    for scene in found:
        assert abs(scene.robot.pose.x + 2) <= 0.3
        assert abs(scene.goal.x - 2) <= 0.2
        assert abs(scene.goal.y) <= 0.1


@pytest.mark.parametrize(
    ("behaviour", "kind", "relation"), [("standing", "talking", TALKING), ("wandering", "walking", WALKING_TOGETHER)]
)
def test_people_of_one_number_are_a_group(behaviour: str, kind: str, relation: str) -> None:
    people = [{"x": k, "y": 0, "behaviour": behaviour, "group": 4} for k in range(3)]
    scene = generate(ScenarioConfig(**HALL, people=[*people, {"x": 0, "y": 2}]), 1)
    (group,) = scene.groups
    formation = "circle" if kind == "talking" else None
    assert (group.kind, len(group.members), group.formation) == (kind, 3, formation)
    assert len({human.desired_speed for human in scene.humans if human.group and kind == "walking"}) <= 1
    assert [tie.relation for tie in scene.interactions] == [relation] * 3
    assert sum(human.group is None for human in scene.humans) == 1


def test_half_the_scenes_are_mirror_images_where_half_shall_be() -> None:
    desk = {"type": "table", "x": -1.0, "y": 1.5, "theta": 0.3}
    people = [{"x": 1.0, "y": 2.0, "theta": 0.5, "behaviour": "walking", "goals": [(1.0, -2.0)], "desired_speed": 1.0}]
    config = ScenarioConfig(
        **HALL, people=people, furniture=[desk], robot={"pose": (-2, -1, 0.4)}, goal={"position": (2, -1)}, flip=0.5
    )
    found = [generate(config, seed) for seed in range(40)]
    flipped = [scene for scene in found if scene.robot.pose.y > 0]
    assert 8 <= len(flipped) <= 32
    straight = next(scene for scene in found if scene.robot.pose.y < 0)
    for scene in flipped:
        assert scene.humans[0].pose.position == (1.0, -2.0)
        assert scene.humans[0].goals == ((1.0, 2.0),)
        assert scene.goal.position == (2.0, 1.0)
        here, there = scene.furniture[0].pose, straight.furniture[0].pose
        assert (here.x, -here.y) == there.position
        front, other = (pose.to_world((0.0, -1.0)) for pose in (here, there))
        assert (front[0], -front[1]) == pytest.approx(other, abs=1e-3)


def test_who_is_moved_into_a_wall_is_an_error_that_names_the_place() -> None:
    with pytest.raises(SceneError, match=r"person 1 at \(3\.\d+, 2\) does not fit there; move it"):
        generate(one(x=3.9, jitter=(0.05, 0.0, 0.0)), 1)


@pytest.mark.parametrize("place", [(3.95, 0.0), (0.0, 0.3), (-2.0, 0.1)])
def test_who_is_given_a_place_in_a_wall_a_thing_or_somebody_is_an_error(place: tuple[float, float]) -> None:
    people = [{"x": -2.0, "y": 0.0}, {"x": place[0], "y": place[1]}]
    config = ScenarioConfig(**HALL, people=people, furniture=[{"type": "table", "x": 0, "y": 0}])
    with pytest.raises(SceneError, match=r"person 2 at .* does not fit there; move it"):
        generate(config, 1)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"behaviour": "walking"}, "who is walking has goals, and nobody else"),
        ({"goals": [(1, 1)], "behaviour": "standing"}, "who is walking has goals, and nobody else"),
        ({"desired_speed": 0}, "a desired speed must be above 0"),
        ({"radius": 0.01}, "a person's radius must be 0.1 m or more"),
        ({"jitter": (-1, 0, 0)}, "greater than or equal to 0"),
        ({"reaction": "scared", "reacts_to_robot": 0}, "who ignores the robot has reacts_to_robot 0"),
        ({"haste": 1}, "unknown key 'haste'"),
    ],
)
def test_a_person_who_cannot_be_is_refused(given: dict[str, object], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        one(**given)


@pytest.mark.parametrize("name", scenario_names())
def test_every_preset_can_be_laid_out_and_made_again_from_its_settings(name: str) -> None:
    for episode in range(12):
        scene = generate(load_scenario(name), 9, episode)
        assert generate(ScenarioConfig(**scene.settings), 9, episode) == scene
        assert math.dist(scene.robot.pose.position, scene.goal.position) > scene.goal.distance
