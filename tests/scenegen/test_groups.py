"""Groups: counts, sizes and spacings as set; o-spaces stay free."""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest

from sonata2d.core.entities import Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.core.relations import TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Scene
from sonata2d.core.vectors import wrap_angle
from sonata2d.errors import ConfigError
from sonata2d.scenegen.formations import talking_formation, walking_formation
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig

EMPTY = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
BUSY = {"standing": 3, "wandering": 3, "tables": 2, "plants": 3, "relations": 1}


@cache
def scenes() -> list[Scene]:
    """Scenes with talking and walking groups of all sizes, and other entities."""
    config = ScenarioConfig(**BUSY, room={"kinds": "hall"}, talking_groups=(1, 3), walking_groups=(1, 3))
    return [generate(config, 5, episode) for episode in range(60)]


def members(scene: Scene, group: Group) -> list[Human]:
    people = {human.id: human for human in scene.humans}
    return [people[member] for member in group.members]


def groups(kind: str) -> list[tuple[Scene, Group]]:
    return [(scene, group) for scene in scenes() for group in scene.groups if group.kind == kind and group.formation]


def test_counts_and_sizes_cover_their_ranges() -> None:
    for kind, max_size in (("talking", 6), ("walking", 5)):
        found = groups(kind)
        assert {sum(group.kind == kind for _, group in found if _ is scene) for scene in scenes()} == {1, 2, 3}
        assert {len(group.members) for _, group in found} == set(range(2, max_size + 1))


def test_neighbours_in_a_talking_group_are_0_9_to_1_2_metres_apart() -> None:
    for scene, group in groups("talking"):
        people = members(scene, group)
        ring = [*people, people[0]] if group.formation == "circle" else people
        for a, b in pairwise(ring):
            assert 0.9 - 1e-3 <= math.dist(a.pose.position, b.pose.position) <= 1.2 + 1e-3


def test_members_of_a_talking_group_are_within_social_distance() -> None:
    for scene, group in groups("talking"):
        for a, b in combinations(members(scene, group), 2):
            assert math.dist(a.pose.position, b.pose.position) < 3.6


def test_members_of_a_talking_group_face_one_point() -> None:
    for scene, group in groups("talking"):
        people = members(scene, group)
        if group.formation != "side_by_side":
            (ax, ay), (bx, by) = people[0].pose.direction, people[1].pose.direction
            centre = crossing(people[0].pose, people[1].pose) if abs(ax * by - ay * bx) > 0.1 else None
            for human in people if centre else ():
                _, left = human.pose.to_local(centre)
                assert abs(left) < 2e-3


def crossing(a: Pose, b: Pose) -> tuple[float, float]:
    """The point where the lines of sight of two poses intersect, m."""
    rows = np.array([[a.direction[0], -b.direction[0]], [a.direction[1], -b.direction[1]]])
    ahead, _ = np.linalg.solve(rows, np.array(b.position) - np.array(a.position))
    return a.to_world((float(ahead), 0.0))


@pytest.mark.parametrize(("name", "turn"), [("face_to_face", math.pi), ("l", math.pi / 2), ("side_by_side", 0.0)])
def test_a_pair_has_the_distance_and_angle_of_its_formation(name: str, turn: float) -> None:
    first, second = talking_formation(name, 2, 1.0).poses
    assert math.dist(first.position, second.position) == pytest.approx(1.0)
    assert abs(wrap_angle(second.theta - first.theta)) == pytest.approx(turn)


def test_no_other_entity_stands_in_an_o_space() -> None:
    for scene, group in groups("talking"):
        own = {human.id: human.pose.position for human in members(scene, group)}
        others = [human.pose.position for human in scene.humans if human.id not in own]
        others += [piece.pose.position for piece in scene.furniture] + [scene.robot.pose.position, scene.goal.position]
        positions = np.array(list(own.values()))
        centre = positions.mean(axis=0)
        radius = np.sqrt(((positions - centre) ** 2).sum(axis=1)).min()
        assert min(math.dist(centre, position) for position in others) > radius - 1e-6


def test_neighbours_in_a_walking_group_are_0_7_to_1_1_metres_apart_and_have_the_same_heading() -> None:
    for scene, group in groups("walking"):
        people = members(scene, group)
        assert len({human.pose.theta for human in people}) == 1
        for a, b in pairwise(people):
            assert 0.7 - 1e-3 <= math.dist(a.pose.position, b.pose.position) <= 1.1 + 1e-3


@pytest.mark.parametrize("size", [2, 3, 4, 5])
def test_the_middle_of_a_v_is_behind_at_the_given_angle(size: int) -> None:
    poses = walking_formation("v", size, 0.9, 1.2).poses
    angles = [math.atan2(abs(b.y - a.y), abs(b.x - a.x)) for a, b in pairwise(poses)]
    v_angles = angles if size in (2, 3, 5) else [angles[0], angles[2]]
    assert all(angle == pytest.approx(1.2, abs=1e-6) for angle in v_angles)
    if size > 2:
        assert min(poses, key=lambda pose: pose.x) in poses[(size - 1) // 2 : size // 2 + 1]
        assert poses[0].x == pytest.approx(poses[-1].x)


def test_members_abreast_walk_side_by_side() -> None:
    assert all(pose.x == pytest.approx(0.0) for pose in walking_formation("abreast", 5, 0.9, 1.2).poses)


def test_each_pair_of_a_group_is_an_interaction() -> None:
    relation = {"talking": TALKING, "walking": WALKING_TOGETHER}
    for scene in scenes():
        interactions = {(i.src, i.relation, i.dst) for i in scene.interactions}
        for group in scene.groups:
            assert {(a, relation[group.kind], b) for a, b in combinations(group.members, 2)} <= interactions


def test_a_given_place_is_the_centre_of_the_group() -> None:
    groups = {"places": [(1.0, -0.5)], "formations": "circle", "talking_size": (3, 6)}
    for seed in range(10):
        scene = generate(ScenarioConfig(**EMPTY, room={"kinds": "square"}, talking_groups=1, groups=groups), seed)
        positions = np.array([human.pose.position for human in scene.humans])
        assert positions.mean(axis=0) == pytest.approx((1.0, -0.5), abs=1e-3)


def test_settings_of_groups_draw_nothing_without_groups() -> None:
    default, other = ScenarioConfig(), ScenarioConfig(name="sonata-2020", groups={"talking_size": 3}, people=())
    assert generate(default, 4).humans == generate(other, 4).humans


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        ({"formations": "circle"}, "no formation for two people has a weight above 0"),
        ({"formations": ["l"], "talking_size": (2, 3)}, "no formation for three and more people"),
        ({"formations": {"abreast": 1}}, "should be 'face_to_face', 'l', 'side_by_side', 'circle' or"),
        ({"talking_size": (1, 3)}, "a group has 2 to 6 people"),
        ({"walking_spacing": 0.3}, "neighbours in a group need 0.5 m or more"),
        ({"v_angle": 0.1}, "the angle of a V must be within"),
        ({"walking_formations": {"v": 0}}, "at least one formation needs a weight above 0"),
    ],
)
def test_invalid_settings_of_groups_are_refused(groups: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        ScenarioConfig(groups=groups)
