"""Groups: as many as asked, spaced as people are, and nobody else in what talkers share."""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from sonata2d.core.entities import TALKING, WALKING_TOGETHER, Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.core.scene import Scene
from sonata2d.core.vectors import wrap_angle
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.sampling import talking, walking
from sonata2d.scenegen.scenario.config import ScenarioConfig

NOBODY = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
BUSY = {"standing": 3, "wandering": 3, "tables": 2, "plants": 3, "relations": 1}


@cache
def scenes() -> list[Scene]:
    """Talking and walking groups of all sizes among others."""
    config = ScenarioConfig(**BUSY, room={"kinds": "hall"}, talking_groups=(1, 3), walking_groups=(1, 3))
    return [generate(config, 5, episode) for episode in range(60)]


def members(scene: Scene, group: Group) -> list[Human]:
    people = {human.id: human for human in scene.humans}
    return [people[member] for member in group.members]


def groups(kind: str) -> list[tuple[Scene, Group]]:
    return [(scene, group) for scene in scenes() for group in scene.groups if group.kind == kind and group.formation]


def test_counts_and_sizes_are_as_asked() -> None:
    for kind, most in (("talking", 6), ("walking", 5)):
        found = groups(kind)
        assert {sum(group.kind == kind for _, group in found if _ is scene) for scene in scenes()} == {1, 2, 3}
        assert {len(group.members) for _, group in found} == set(range(2, most + 1))


def test_neighbours_who_talk_are_0_9_to_1_2_metres_apart() -> None:
    for scene, group in groups("talking"):
        people = members(scene, group)
        ring = [*people, people[0]] if group.formation == "circle" else people
        for a, b in pairwise(ring):
            assert 0.9 - 1e-3 <= math.dist(a.pose.position, b.pose.position) <= 1.2 + 1e-3


def test_who_talks_is_within_social_distance_of_everybody_in_the_group() -> None:
    for scene, group in groups("talking"):
        for a, b in combinations(members(scene, group), 2):
            assert math.dist(a.pose.position, b.pose.position) < 3.6


def test_who_talks_in_a_circle_or_an_arc_faces_its_middle() -> None:
    for scene, group in groups("talking"):
        people = members(scene, group)
        if group.formation != "side_by_side":
            (ax, ay), (bx, by) = people[0].pose.direction, people[1].pose.direction
            middle = crossing(people[0].pose, people[1].pose) if abs(ax * by - ay * bx) > 0.1 else None
            for human in people if middle else ():
                _, left = human.pose.to_local(middle)
                assert abs(left) < 2e-3


def crossing(a: Pose, b: Pose) -> tuple[float, float]:
    """Where two ways ahead meet."""
    rows = np.array([[a.direction[0], -b.direction[0]], [a.direction[1], -b.direction[1]]])
    along, _ = np.linalg.solve(rows, np.array(b.position) - np.array(a.position))
    return a.to_world((float(along), 0.0))


@pytest.mark.parametrize(("name", "turn"), [("face_to_face", math.pi), ("l", math.pi / 2), ("side_by_side", 0.0)])
def test_two_stand_to_each_other_as_their_formation_says(name: str, turn: float) -> None:
    one, other = talking(name, 2, 1.0).poses
    assert math.dist(one.position, other.position) == pytest.approx(1.0)
    assert abs(wrap_angle(other.theta - one.theta)) == pytest.approx(turn)


def test_nobody_else_and_nothing_stands_in_an_o_space() -> None:
    for scene, group in groups("talking"):
        own = {human.id: human.pose.position for human in members(scene, group)}
        others = [human.pose.position for human in scene.humans if human.id not in own]
        others += [thing.pose.position for thing in scene.furniture] + [scene.robot.pose.position, scene.goal.position]
        hull = np.array(list(own.values()))
        middle = hull.mean(axis=0)
        reach = np.sqrt(((hull - middle) ** 2).sum(axis=1)).min()
        assert min(math.dist(middle, place) for place in others) > reach - 1e-6


def test_neighbours_who_walk_are_0_7_to_1_1_metres_apart_and_go_the_same_way() -> None:
    for scene, group in groups("walking"):
        people = members(scene, group)
        assert len({human.pose.theta for human in people}) == 1
        for a, b in pairwise(people):
            assert 0.7 - 1e-3 <= math.dist(a.pose.position, b.pose.position) <= 1.1 + 1e-3


@pytest.mark.parametrize("size", [2, 3, 4, 5])
def test_the_middle_of_a_v_is_behind_at_the_observed_angle(size: int) -> None:
    poses = walking("v", size, 0.9, 1.2).poses
    angles = [math.atan2(abs(b.y - a.y), abs(b.x - a.x)) for a, b in pairwise(poses)]
    steep = angles if size in (2, 3, 5) else [angles[0], angles[2]]
    assert all(angle == pytest.approx(1.2, abs=1e-6) for angle in steep)
    if size > 2:
        assert min(poses, key=lambda pose: pose.x) in poses[(size - 1) // 2 : size // 2 + 1]
        assert poses[0].x == pytest.approx(poses[-1].x)


def test_those_abreast_are_level() -> None:
    assert all(pose.x == pytest.approx(0.0) for pose in walking("abreast", 5, 0.9, 1.2).poses)


def test_each_pair_of_a_group_is_an_interaction() -> None:
    relation = {"talking": TALKING, "walking": WALKING_TOGETHER}
    for scene in scenes():
        ties = {(tie.src, tie.relation, tie.dst) for tie in scene.interactions}
        for group in scene.groups:
            assert {(a, relation[group.kind], b) for a, b in combinations(group.members, 2)} <= ties


def test_a_given_place_is_the_middle_of_the_group() -> None:
    given = {"places": [(1.0, -0.5)], "formations": "circle", "talking_size": (3, 6)}
    for seed in range(10):
        scene = generate(ScenarioConfig(**NOBODY, room={"kinds": "square"}, talking_groups=1, groups=given), seed)
        places = np.array([human.pose.position for human in scene.humans])
        assert places.mean(axis=0) == pytest.approx((1.0, -0.5), abs=1e-3)


def test_without_groups_not_even_chance_is_spent() -> None:
    plain, other = ScenarioConfig(), ScenarioConfig(name="sonata-2020", groups={"talking_size": 3}, people=())
    assert generate(plain, 4).humans == generate(other, 4).humans


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"formations": "circle"}, "no formation for two people has a weight above 0"),
        ({"formations": ["l"], "talking_size": (2, 3)}, "no formation for three and more people"),
        ({"formations": {"abreast": 1}}, "'abreast' is none of face_to_face, l, side_by_side, circle, semicircle"),
        ({"talking_size": (1, 3)}, "a group has 2 to 6 people"),
        ({"walking_spacing": 0.3}, "neighbours in a group need 0.5 m or more"),
        ({"v_angle": 0.1}, "the angle of a V must be within"),
        ({"walking_formations": {"v": 0}}, "at least one formation needs a weight above 0"),
    ],
)
def test_settings_that_cannot_be_are_refused(given: dict[str, object], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        ScenarioConfig(groups=given)
