"""Pedestrians of the section `people`: created as given, moved by jitter, mirrored, refused where they do not fit."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.core.entities import Group, Human, Interaction
from sonata2d.core.relations import TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Scene
from sonata2d.errors import ConfigError, SceneError
from sonata2d.scenegen.placed import resample_track
from sonata2d.scenegen.scenario.load import scenario_names

SQUARE = {"kinds": "square", "side": 8}
EMPTY: dict[str, Any] = {"room": SQUARE, "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}


def config_with(*people: dict[str, Any], **settings: Any) -> s2.ScenarioConfig:
    """An otherwise empty scenario with some people."""
    return s2.ScenarioConfig(**{**EMPTY, "people": people, **settings})


def scene_with(*people: dict[str, Any], **settings: Any) -> Scene:
    return s2.generate(config_with(*people, **settings), seed=3)


def single_human(**person: Any) -> Human:
    (human,) = scene_with(person).humans
    return human


def test_given_properties_are_kept() -> None:
    person = {"x": 1.0, "y": 2.0, "theta": 0.5, "behaviour": "walking", "goals": [(-1, -2), (3, 3)]}
    human = single_human(**person, velocity=(0.5, 0.2), desired_speed=0.7, radius=0.25, reacts_to_robot=0.5)
    assert (human.id, human.pose.x, human.pose.y, human.pose.theta) == (1, 1.0, 2.0, 0.5)
    assert (human.behaviour, human.goals, human.velocity) == ("walking", ((-1.0, -2.0), (3.0, 3.0)), (0.5, 0.2))
    assert (human.desired_speed, human.radius, human.reacts_to_robot) == (0.7, 0.25, 0.5)


def test_a_person_without_goals_and_track_stands() -> None:
    human = single_human(x=1.0, y=-2.0, theta=0.5)
    assert (human.id, human.pose.x, human.pose.y, human.pose.theta) == (1, 1.0, -2.0, 0.5)
    assert human.behaviour == "standing"
    assert 0.8 <= human.desired_speed <= 1.8
    assert single_human(x=0, y=0, desired_speed=0.7, radius=0.25, reacts_to_robot=0.5).desired_speed == 0.7


def test_properties_that_are_not_given_are_drawn() -> None:
    config = config_with({"x": 1.0, "y": 2.0})
    speeds = {s2.generate(config, seed).humans[0].desired_speed for seed in range(20)}
    assert len(speeds) == 20
    assert all(0.8 <= speed <= 1.8 for speed in speeds)


def test_behaviour_start_and_times_follow_from_goals_or_track() -> None:
    walking = single_human(x=1.0, y=1.0, goals=[[1.0, 3.0], [0.0, 0.0]], exits=True, enters=1.25, leaves=7.0)
    assert (walking.behaviour, walking.goals, walking.exits) == ("walking", ((1.0, 3.0), (0.0, 0.0)), True)
    assert (walking.enters, walking.leaves) == (13, 70)
    assert walking.pose.theta == pytest.approx(math.pi / 2, abs=1e-4)
    recorded = single_human(track=[[0.4, 0.0, 0.0], [0.8, 0.4, 0.0], [1.2, 0.8, 0.0]])
    assert (recorded.behaviour, recorded.enters, recorded.leaves) == ("recorded", 4, 13)
    assert recorded.track == tuple((round(0.1 * k, 4), 0.0) for k in range(9))
    assert recorded.velocity == (1.0, 0.0)


def test_a_recorded_person_ignores_the_robot_by_default() -> None:
    track = [[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]]
    default, given = single_human(track=track), single_human(track=track, reacts_to_robot=0.5)
    assert (default.reacts_to_robot, default.reaction) == (0.0, "ignores")
    assert (given.reacts_to_robot, given.reaction) == (0.5, "avoids")
    assert single_human(x=0.0, y=0.0, goals=[[2.0, 0.0]]).reaction == "avoids"


def test_a_given_reaction_replaces_the_drawn_one() -> None:
    person = {"ignores_robot": 1.0, "reactions": ["ignores"]}
    people = [{"x": 0, "y": k, "reaction": kind} for k, kind in enumerate(("curious", "ignores", None))]
    humans = s2.generate(config_with(*people, person=person), 1).humans
    assert [(h.reaction, h.reacts_to_robot) for h in humans] == [("curious", 1.0), ("ignores", 0.0), ("ignores", 0.0)]


def test_a_resampled_track_is_smooth_and_passes_through_its_points() -> None:
    track = [(0.4 * k, 1.2 * k + 0.3 * math.sin(k), 0.5 * math.cos(k)) for k in range(12)]
    first, positions = resample_track(tuple(track), 0.1)
    assert first == 0
    assert len(positions) == 45
    for k, (_, x, y) in enumerate(track):
        assert positions[4 * k] == pytest.approx((x, y), abs=1e-4)
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(positions)]
    changes = [math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(steps)]
    corners = [math.hypot(*(track[k - 1][i] - 2 * track[k][i] + track[k + 1][i] for i in (1, 2))) for k in range(1, 11)]
    assert max(changes) < 0.4 * max(corners) / 4  # linear interpolation would have the whole change at the points
    assert resample_track(((0.13, 0.0, 0.0), (0.37, 2.4, 0.0)), 0.1) == (2, [(0.7, 0.0), (1.7, 0.0)])
    assert resample_track(((0.11, 0.0, 0.0), (0.19, 1.0, 0.0)), 0.1)[1] == []


def test_people_with_the_same_group_number_walk_together() -> None:
    members = [{"x": 0.5 * k, "y": 0.0, "goals": [[3.0, 3.0]], "group": 7} for k in range(3)]
    scene = scene_with(*members, {"x": -2.0, "y": -2.0, "goals": [[0.0, 3.0]], "group": 8})
    assert scene.groups == (Group(7, "walking", (1, 2, 3)),)
    assert scene.interactions == tuple(Interaction(a, WALKING_TOGETHER, b) for a, b in ((1, 2), (1, 3), (2, 3)))
    assert [human.group for human in scene.humans] == [7, 7, 7, None]


@pytest.mark.parametrize(
    ("behaviour", "kind", "relation"), [("standing", "talking", TALKING), ("wandering", "walking", WALKING_TOGETHER)]
)
def test_the_kind_of_a_group_follows_from_its_behaviour(behaviour: str, kind: str, relation: str) -> None:
    people = [{"x": k, "y": 0, "behaviour": behaviour, "group": 4} for k in range(3)]
    scene = s2.generate(config_with(*people, {"x": 0, "y": 2}), 1)
    (group,) = scene.groups
    formation = "circle" if kind == "talking" else None
    assert (group.kind, len(group.members), group.formation) == (kind, 3, formation)
    assert len({human.desired_speed for human in scene.humans if human.group and kind == "walking"}) <= 1
    assert [interaction.relation for interaction in scene.interactions] == [relation] * 3
    assert sum(human.group is None for human in scene.humans) == 1


def test_drawn_entities_get_the_ids_that_are_left() -> None:
    people = [{"id": 2, "x": 0.0, "y": 0.0}, {"x": 2.0, "y": 2.0}]
    drawn_only = scene_with(standing=2, tables=1, walking_pairs=1)
    scene = scene_with(*people, standing=2, tables=1, walking_pairs=1)
    assert [human.id for human in scene.humans] == [2, 1, 3, 4, 5, 6]
    assert [piece.id for piece in scene.furniture] == [7, 8]
    assert scene.furniture[1].on == 7
    assert [human.behaviour for human in scene.humans[2:]] == [human.behaviour for human in drawn_only.humans]
    assert {member for group in scene.groups for member in group.members} == {5, 6}
    assert {(interaction.src, interaction.dst) for interaction in scene.interactions} == {(5, 6)}


def test_drawn_entities_and_the_robot_keep_clear_of_given_people() -> None:
    people = [{"x": x, "y": y} for x in (-1.2, 0.0, 1.2) for y in (-1.2, 0.0, 1.2)]
    for seed in range(5):
        scene = s2.generate(config_with(*people, tables=2), seed)
        for human in scene.humans:
            robot = scene.robot.pose
            assert math.hypot(human.pose.x - robot.x, human.pose.y - robot.y) > 0.5
            for table in scene.furniture[::2]:
                assert math.hypot(human.pose.x - table.pose.x, human.pose.y - table.pose.y) > 0.6


def test_jitter_moves_a_start_and_its_goals_by_the_same_bounded_offset() -> None:
    person = {"x": 1.0, "y": 2.0, "behaviour": "walking", "goals": [(-2.0, 2.0)], "jitter": (0.5, 0.2, 0.3)}
    config = config_with(person)
    for seed in range(30):
        (human,) = s2.generate(config, seed).humans
        dx, dy = human.pose.x - 1.0, human.pose.y - 2.0
        assert abs(dx) <= 0.5
        assert abs(dy) <= 0.2
        assert human.goals[0] == pytest.approx((-2.0 + dx, 2.0 + dy), abs=2e-4)
    assert len({s2.generate(config, seed).humans[0].pose for seed in range(30)}) == 30


def test_a_track_of_years_is_refused_before_it_is_interpolated() -> None:
    with pytest.raises(SceneError, match=r"track of person 1, 0 to 1e\+09 s, is longer than 1000000 ticks"):
        scene_with({"track": [(0, 0, 0), (1e9, 1, 0)]})


def test_jitter_moves_the_start_and_the_goal_of_the_robot() -> None:
    config = config_with(
        robot={"pose": (-2, 0, 0), "jitter": (0.3, 0.3, 0.1)}, goal={"position": (2, 0), "jitter": (0.2, 0.1)}
    )
    scenes = [s2.generate(config, seed) for seed in range(20)]
    assert len({scene.robot.pose for scene in scenes}) == len({scene.goal.position for scene in scenes}) == 20
    for scene in scenes:
        assert abs(scene.robot.pose.x + 2) <= 0.3
        assert abs(scene.goal.x - 2) <= 0.2
        assert abs(scene.goal.y) <= 0.1


def test_flip_0_5_mirrors_half_of_the_scenes() -> None:
    table = {"type": "table", "x": -1.0, "y": 1.5, "theta": 0.3}
    person = {"x": 1.0, "y": 2.0, "theta": 0.5, "behaviour": "walking", "goals": [(1.0, -2.0)], "desired_speed": 1.0}
    config = config_with(person, furniture=[table], robot={"pose": (-2, -1, 0.4)}, goal={"position": (2, -1)}, flip=0.5)
    scenes = [s2.generate(config, seed) for seed in range(40)]
    mirrored = [scene for scene in scenes if scene.robot.pose.y > 0]
    assert 8 <= len(mirrored) <= 32
    original = next(scene for scene in scenes if scene.robot.pose.y < 0)
    for scene in mirrored:
        assert scene.humans[0].pose.position == (1.0, -2.0)
        assert scene.humans[0].goals == ((1.0, 2.0),)
        assert scene.goal.position == (2.0, 1.0)
        pose, original_pose = scene.furniture[0].pose, original.furniture[0].pose
        assert (pose.x, -pose.y) == original_pose.position
        front, original_front = (place.to_world((0.0, -1.0)) for place in (pose, original_pose))
        assert (front[0], -front[1]) == pytest.approx(original_front, abs=1e-3)


def test_a_scenario_file_may_contain_people(tmp_path: Path) -> None:
    path = tmp_path / "two.yaml"
    path.write_text("people:\n- {x: 1, y: 1, goals: [[0, 0]]}\n- {x: 2, y: 2, goal: [[0, 0]]}\n")
    with pytest.raises(ConfigError, match=r"two.yaml, line 3: people.1.goal: unknown key 'goal'; did you mean 'goals'"):
        s2.load_scenario(path)
    path.write_text("people:\n- {x: 1, y: 1, goals: [[0, 0]]}\n- {x: 2, y: 2}\n")
    config = s2.load_scenario(path)
    assert s2.ScenarioConfig(**config.settings()) == config
    assert s2.generate(config, 1).humans[0].goals == ((0.0, 0.0),)


AT_1_1 = {"x": 1.0, "y": 1.0}


@pytest.mark.parametrize(
    ("person", "message"),
    [
        ({"x": 1.0}, "give a start"),
        ({**AT_1_1, "track": [[0, 0, 0], [1, 1, 1]]}, "the track gives the start"),
        ({"track": [[0, 0, 0], [1, 1, 1]], "enters": 1.0}, "the track gives the times"),
        ({"track": [[0, 0, 0], [0, 1, 1]]}, "must rise"),
        ({"track": [[-1, 0, 0], [0, 1, 1]]}, "from 0 or later"),
        ({"track": [[0, 0, 0]]}, "at least 2"),
        ({**AT_1_1, "behaviour": "walking"}, "goals must be given with behaviour walking, and with no other"),
        ({**AT_1_1, "behaviour": "recorded"}, "track must be given with behaviour recorded, and with no other"),
        ({**AT_1_1, "behaviour": "standing", "goals": [[0, 0]]}, "goals must be given with behaviour walking, and"),
        ({**AT_1_1, "exits": True}, "needs goals to leave at"),
        ({**AT_1_1, "enters": 3.0, "leaves": 2.0}, "leaves must be later than enters"),
        ({**AT_1_1, "group": 1, "behaviour": "wandering", "enters": 1.0}, "can neither enter nor leave"),
        ({**AT_1_1, "desired_speed": 0}, "a desired speed must be above 0"),
        ({**AT_1_1, "radius": 0.01}, "a person's radius must be 0.1 m or more"),
        ({**AT_1_1, "jitter": (-1, 0, 0)}, "greater than or equal to 0"),
        ({**AT_1_1, "reaction": "scared", "reacts_to_robot": 0}, "reacts_to_robot must be 0 with reaction ignores"),
        ({**AT_1_1, "haste": 1}, "unknown key 'haste'"),
    ],
)
def test_an_invalid_person_is_refused(person: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        config_with(person)
    assert message in str(error.value)


def test_an_id_given_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="id 4 is given to more than one person"):
        config_with({"id": 4, "x": 0, "y": 0}, {"id": 4, "x": 1, "y": 1})


@pytest.mark.parametrize(
    ("person", "message"),
    [
        ({"x": 5.0, "y": 0.0}, r"the start of person 1 is outside the room at \(5, 0\)"),
        ({"x": 0.0, "y": 0.0, "goals": [[0.0, 9.0]]}, "the goal of person 1 is outside"),
        ({"track": [[0, 0, 0], [4, 6, 0]]}, "the track of person 1 is outside"),
        ({"track": [[0.11, 0, 0], [0.19, 1, 0]]}, "lies between two ticks"),
        ({"x": -3.0, "y": 0.3}, "the robot would start on person 1"),
    ],
)
def test_a_person_outside_the_room_or_under_the_robot_is_an_error(person: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        scene_with(person, robot={"pose": (-3.0, 0.0, 0.0)})
    assert "\n" not in str(error.value)


def test_a_wall_between_people_who_talk_is_an_error() -> None:
    people = [{"x": 0.0, "y": y, "group": 1} for y in (-0.6, 0.6)]
    room = {"kinds": "rectangle", "breadth": 8, "length": 8}
    assert s2.generate(s2.ScenarioConfig(room=room, people=people), 1).groups
    room["walls"] = [(-2.0, 0.0, 2.0, 0.0)]
    with pytest.raises(SceneError, match="a wall is between person 1 and person 2, who stand in one group; move one"):
        s2.generate(s2.ScenarioConfig(room=room, people=people), 1)


def test_jitter_into_a_wall_is_an_error_that_names_the_position() -> None:
    with pytest.raises(SceneError, match=r"person 1 does not fit at \(3\.\d+, 2\); move it"):
        s2.generate(config_with({"x": 3.9, "y": 2.0, "jitter": (0.05, 0.0, 0.0)}), 1)


@pytest.mark.parametrize("position", [(3.98, 0.0), (0.0, 0.3), (-2.0, 0.1)])
def test_a_person_in_a_wall_furniture_or_another_person_is_an_error(position: tuple[float, float]) -> None:
    people = [{"x": -2.0, "y": 0.0}, {"x": position[0], "y": position[1]}]
    config = config_with(*people, furniture=[{"type": "table", "x": 0, "y": 0}])
    with pytest.raises(SceneError, match=r"person 2 does not fit at .*; move it"):
        s2.generate(config, 1)


@pytest.mark.parametrize("name", scenario_names())
def test_scenes_of_every_preset_can_be_generated_again_from_their_settings(name: str) -> None:
    for episode in range(12):
        scene = s2.generate(s2.load_scenario(name), 9, episode)
        assert s2.generate(s2.ScenarioConfig(**scene.settings or {}), 9, episode) == scene
        assert math.dist(scene.robot.pose.position, scene.goal.position) > scene.goal.distance


TABLE = {"type": "table", "x": 2.0, "y": 1.0, "size": (1.6, 0.9)}


def test_a_start_or_a_goal_in_furniture_is_an_error_that_names_it() -> None:
    with pytest.raises(SceneError, match=r"person 1 does not fit at \(2\.2, 1\.1\), on the table at \(2, 1\); move it"):
        scene_with({"x": 2.2, "y": 1.1, "goals": [(0, 0)]}, furniture=[TABLE])
    with pytest.raises(SceneError, match=r"the start \(2\.2, 1\.1\) of person 1 is in the table at \(2, 1\); move one"):
        scene_with({"x": 2.2, "y": 1.1, "goals": [(0, 0)], "enters": 4}, furniture=[TABLE])
    for exits in (False, True):
        with pytest.raises(SceneError, match=r"the goal \(2, 1\) of person 1 is in the table at \(2, 1\); move one"):
            scene_with({"x": -2, "y": 1, "goals": [(0, 0), (2, 1)], "exits": exits}, furniture=[TABLE])


def with_gap(width: float, *people: dict[str, Any]) -> Scene:
    """Two rooms, and a gap between them at the origin."""
    walls = [(0, -4, 0, -width / 2), (0, width / 2, 0, 4)]
    return scene_with(*people, room={**SQUARE, "walls": walls})


def test_a_goal_in_a_wall_is_an_error() -> None:
    with pytest.raises(SceneError, match=r"the goal \(0, 2\) of person 1 is in a wall; move it"):
        with_gap(0.8, {"x": -2, "y": 1, "goals": [(0, 2)]})


def test_a_goal_behind_a_gap_that_is_too_narrow_is_an_error() -> None:
    slim, stout = ({"x": -2, "y": y, "goals": [(2, y)], "radius": radius} for y, radius in ((1, 0.14), (-1, 0.2)))
    problem = r"person 1 cannot walk from \(-2, 1\) to its goal \(2, 1\): no way .* its body, which is 0\.28 m deep"
    with pytest.raises(SceneError, match=problem):
        with_gap(0.26, slim)
    assert with_gap(0.32, slim).humans
    assert with_gap(0.26, slim | {"exits": True}).humans  # as people of recordings do
    with pytest.raises(SceneError, match="person 2 cannot walk"):
        with_gap(0.32, slim, stout)


LOOP = [(-3, -1, 3, -1), (3, -1, 3, 1), (3, 1, -3, 1), (-3, 1, -3, -1)]


@pytest.mark.parametrize("person", [{"goals": [(2.5, 0)]}, {"goals": [(2.5, 0)], "exits": True}, {"goals": []}])
def test_a_walker_inside_a_closed_loop_of_walls_is_an_error(person: dict[str, Any]) -> None:
    behaviour = {} if person["goals"] else {"behaviour": "wandering"}
    walker = {"x": -2, "y": 0, **person, **behaviour}
    with pytest.raises(SceneError, match=r"person 1 at \(-2, 0\) is inside a closed loop of walls, .*leave a gap"):
        scene_with(walker, room={**SQUARE, "walls": LOOP})
    gap = [*LOOP[:3], (-3, 1, -3, -0.2)]
    assert scene_with(walker, room={**SQUARE, "walls": gap}).humans
    assert scene_with(
        {"x": -2, "y": 0, "theta": 0}, room={**SQUARE, "walls": LOOP}
    ).humans  # a standing person needs no path


def test_loops_are_those_of_straight_walls() -> None:
    walker = {"x": -2, "y": 0, "goals": [(2.5, 0)], "exits": True}
    in_pieces = [(-3, -1, 0, -1), *LOOP[1:], (0, -1, 3, -1)]
    with pytest.raises(SceneError, match="inside a closed loop of walls"):
        scene_with(walker, room={**SQUARE, "walls": in_pieces})
    # A wall that goes on beyond a corner is no edge of a loop: paths lead out at its end.
    assert scene_with(walker, room={**SQUARE, "walls": [*LOOP, (3, -1, 4, -1)]}).humans


def test_people_are_not_drawn_inside_a_closed_loop_of_walls() -> None:
    config = config_with(wandering=4, room={**SQUARE, "walls": LOOP})
    for seed in range(5):
        for human in s2.generate(config, seed).humans:
            assert abs(human.pose.x) > 3.0 or abs(human.pose.y) > 1.0
