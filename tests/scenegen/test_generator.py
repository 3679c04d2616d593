"""Scenes: the distributions of sonata-2020, nothing on anything else, always a way, the same for the same seed."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonata2d.core.entities import AT_LAPTOP, AT_OBJECT, AT_PLANT, TALKING, WALKING_TOGETHER, Human
from sonata2d.core.geometry import Disc, Pose, canonical_angle, inside_polygon, quantised, shape_gap
from sonata2d.core.navigation import FreeSpace
from sonata2d.core.scene import Scene
from sonata2d.core.vectors import wrap_angle
from sonata2d.errors import SceneError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario

EXAMPLES = Path(__file__).parents[2] / "examples" / "scenarios"
SCENES = 400
EMPTY = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}


@cache
def scenes() -> list[Scene]:
    """The default scenario, many times."""
    return [generate(ScenarioConfig(), 1, episode) for episode in range(SCENES)]


@cache
def all_related() -> list[Scene]:
    """The default scenario with more relations."""
    config = ScenarioConfig(standing=(2, 4), wandering=(2, 4), tables=(1, 4), plants=(1, 4), relations=(3, 4))
    return [generate(config, 2, episode) for episode in range(SCENES)]


def related(relation: str) -> list[tuple[Human, Pose]]:
    """Everybody in a relation, and the pose of who or what they attend to."""
    pairs = []
    for scene in all_related():
        pose = {thing.id: thing.pose for thing in (*scene.humans, *scene.furniture)}
        people = {human.id: human for human in scene.humans}
        pairs += [(people[i.src], pose[i.dst]) for i in scene.interactions if i.relation == relation]
    return pairs


def distance(a: Pose, b: Pose) -> float:
    return math.dist(a.position, b.position)


def ks_p_value(values: list[float], low: float, high: float) -> float:
    """Chance of a sample that far from the uniform distribution.

    Source: Kolmogorov's limit, with Stephens' correction, J. R. Stat. Soc. B 32 (1970) 115.
    """
    x = np.sort((np.array(values) - low) / (high - low))
    n = len(x)
    gap = max(float(np.max(np.arange(1, n + 1) / n - x)), float(np.max(x - np.arange(n) / n)))
    scaled = gap * (math.sqrt(n) + 0.12 + 0.11 / math.sqrt(n))
    return 2 * sum((-1) ** (k - 1) * math.exp(-2 * k * k * scaled * scaled) for k in range(1, 50))


def is_even(values: list[object], options: int) -> bool:
    """Whether all options occur about equally often: chi-squared within 5 deviations of its mean."""
    counts, expected = Counter(values), len(values) / options
    chi = sum((count - expected) ** 2 / expected for count in counts.values())
    return len(counts) == options and chi < options - 1 + 5 * math.sqrt(2 * (options - 1))


# Rooms


def test_each_kind_of_room_is_a_third():
    assert is_even([scene.family for scene in scenes()], 3)


def test_rooms_have_the_original_sizes():
    kinds = {"sonata-2020/square": set(), "sonata-2020/rectangle": set(), "sonata-2020/l": set()}
    for scene in scenes():
        span = scene.outline.max(axis=0) - scene.outline.min(axis=0)
        kinds[scene.family].add((float(span[0]), float(span[1])))
    assert kinds["sonata-2020/square"] == {(side, side) for side in (6.0, 7.0, 8.0, 9.0, 10.0)}
    assert {y for _, y in kinds["sonata-2020/rectangle"]} == {5.0, 6.0, 7.0, 8.0, 9.0, 10.0}
    assert all(5 <= y <= x <= 10 for x, y in kinds["sonata-2020/rectangle"])
    assert kinds["sonata-2020/l"] == {(9.0, 9.0), (12.0, 12.0)}


def test_sides_of_squares_are_alike():
    assert is_even([s.polygon[1][0] - s.polygon[0][0] for s in scenes() if s.family.endswith("square")], 5)


def test_an_l_comes_in_four_orientations():
    outlines = [scene.polygon for scene in scenes() if scene.family.endswith("/l")]
    notches = [
        (sx, sy)
        for outline in outlines
        for sx in (-1, 1)
        for sy in (-1, 1)
        if not inside_polygon(np.array([[sx * 2.5, sy * 2.5]]) * max(outline)[0] / 4.5, np.array(outline))[0]
    ]
    assert len(notches) == len(outlines)
    assert is_even(notches, 4)


def test_rooms_are_centred_and_counter_clockwise_with_their_edges_as_first_walls():
    for scene in scenes():
        x, y = scene.outline.T
        assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0
        assert np.allclose(scene.outline.max(axis=0), -scene.outline.min(axis=0))
        assert tuple(wall.start for wall in scene.walls[: len(x)]) == scene.polygon


# People, things and relations


@pytest.mark.parametrize("behaviour", ["standing", "wandering"])
def test_counts_of_people_are_even_from_0_to_4(behaviour):
    assert is_even([sum(h.behaviour == behaviour for h in scene.humans) for scene in scenes()], 5)


def test_counts_of_things_are_even_from_0_to_4_and_every_table_has_its_laptop():
    assert is_even([sum(f.type == "plant" for f in scene.furniture) for scene in scenes()], 5)
    assert is_even([sum(f.type == "table" for f in scene.furniture) for scene in scenes()], 5)
    for scene in scenes():
        tables = {f.id: f.pose for f in scene.furniture if f.type == "table"}
        laptops = {f.on: f.pose for f in scene.furniture if f.type == "laptop"}
        assert tables == laptops


def test_ids_are_people_who_stand_then_wander_then_tables_laptops_plants():
    for scene in scenes():
        assert [human.id for human in scene.humans] == list(range(1, len(scene.humans) + 1))
        behaviours = [human.behaviour for human in scene.humans]
        assert behaviours == sorted(behaviours)
        first = len(scene.humans) + 1
        assert [piece.id for piece in scene.furniture] == list(range(first, first + len(scene.furniture)))
        ranks = [("table", "laptop", "plant").index(piece.type) for piece in scene.furniture]
        assert ranks == sorted(ranks)


def test_talking_pairs_stand_1_5_to_3_metres_apart_and_face_each_other_within_20_degrees():
    pairs = related(TALKING)
    assert ks_p_value([distance(a.pose, b) for a, b in pairs], 1.5, 3.0) > 0.01
    turns = [wrap_angle(b.theta - a.pose.theta - math.pi) for a, b in pairs]
    assert ks_p_value(turns, -math.radians(20), math.radians(20)) > 0.01
    for a, b in pairs:
        ahead, left = a.pose.to_local(b)
        assert ahead > 1.4
        assert abs(left) < 1e-3


@pytest.mark.parametrize("relation", [AT_LAPTOP, AT_PLANT])
def test_people_stand_1_to_4_metres_below_a_laptop_or_plant_and_face_it(relation):
    pairs = related(relation)
    assert ks_p_value([distance(a.pose, b) for a, b in pairs], 1.0, 4.0) > 0.01
    for a, b in pairs:
        assert a.pose.theta == 1.5708
        assert abs(a.pose.x - b.x) < 1e-3
        assert a.pose.y < b.y


def test_people_who_walk_together_start_half_a_metre_apart_side_by_side():
    for a, b in related(WALKING_TOGETHER):
        ahead, left = a.pose.to_local(b)
        assert (ahead, left) == pytest.approx((0.0, 0.5), abs=3e-4)
        assert b.theta == a.pose.theta


def test_each_of_the_four_relations_is_about_as_likely_where_all_are_possible():
    firsts = [scene.interactions[0].relation for scene in all_related() if scene.interactions]
    assert is_even(firsts, 4)


def test_nobody_and_nothing_is_in_two_relations():
    for scene in (*scenes(), *all_related()):
        ends = [end for i in scene.interactions for end in (i.src, i.dst)]
        assert len(ends) == len(set(ends))


def test_pairs_are_groups_whose_first_member_leads():
    for scene in all_related():
        pairs = [i for i in scene.interactions if i.relation in (TALKING, WALKING_TOGETHER)]
        assert [group.members for group in scene.groups] == [(i.src, i.dst) for i in pairs]
        in_group = {member: group.id for group in scene.groups for member in group.members}
        assert all(human.group == in_group.get(human.id) for human in scene.humans)


def test_the_laptop_itself_is_attended_to():
    for scene in all_related():
        types = {piece.id: piece.type for piece in scene.furniture}
        assert all(types[i.dst] == "laptop" for i in scene.interactions if i.relation == AT_LAPTOP)


def test_desired_speeds_are_spread_about_1_3_within_0_8_and_1_8():
    speeds = [human.desired_speed for scene in scenes() for human in scene.humans]
    assert min(speeds) >= 0.8
    assert max(speeds) <= 1.8
    assert np.mean(speeds) == pytest.approx(1.3, abs=0.02)
    assert np.std(speeds) == pytest.approx(0.2, abs=0.02)


def test_the_share_who_ignore_the_robot_is_as_asked():
    config = ScenarioConfig(humans=8, relations=0, person={"ignores_robot": 0.25})
    reacts = [human.reacts_to_robot for k in range(100) for human in generate(config, k).humans]
    assert set(reacts) == {0.0, 1.0}
    assert np.mean(reacts) == pytest.approx(0.75, abs=0.05)


# Places


def outlines(scene: Scene) -> list[tuple[object, Pose]]:
    solid = [(piece.shape, piece.pose) for piece in scene.furniture if piece.on is None]
    people = [(Disc(human.radius), human.pose) for human in scene.humans]
    return [*solid, *people, (Disc(scene.robot.radius), scene.robot.pose)]


def test_nothing_overlaps_and_all_is_in_the_room():
    for scene in scenes()[:120]:
        for (shape, pose), (other, place) in combinations(outlines(scene), 2):
            near = shape.reach + other.reach + 0.1
            if distance(pose, place) < near:
                assert shape_gap(shape, pose, other, place) >= 0.05 - 1e-9
        centres = np.array([pose.position for _, pose in outlines(scene)])
        assert inside_polygon(centres, scene.outline).all()


def test_people_start_0_4_metres_from_walls():
    for scene in scenes():
        walls = replace(scene, furniture=()).barriers
        places = np.array([human.pose.position for human in scene.humans]).reshape(-1, 2)
        assert (walls.gaps(places) >= 0.4 - 1e-9).all()


def test_the_robot_is_never_on_its_goal_and_always_has_a_way():
    for scene in scenes():
        assert math.dist(scene.robot.pose.position, scene.goal.position) >= 2.0
        space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing), scene.robot.radius + 0.05)
        assert space.path(scene.robot.pose.position, scene.goal.position) is not None


def test_every_number_is_one_that_a_file_can_hold():
    for scene in scenes()[:50]:
        poses = [pose for _, pose in outlines(scene)] + [Pose(scene.goal.x, scene.goal.y, scene.goal.theta)]
        for pose in poses:
            assert pose == Pose(quantised(pose.x), quantised(pose.y), canonical_angle(pose.theta))
        assert all(human.desired_speed == quantised(human.desired_speed) for human in scene.humans)


def test_nobody_talks_or_looks_through_a_wall():
    config = load_scenario(EXAMPLES / "home.yaml")
    for seed in range(20):
        scene = generate(config, seed)
        pose = {thing.id: thing.pose for thing in (*scene.humans, *scene.furniture)}
        walls = replace(scene, furniture=()).barriers
        for i in scene.interactions:
            samples = np.linspace(pose[i.src].position, pose[i.dst].position, 60)
            assert walls.gaps(samples).min() > 0.01


# Seeds


def test_the_same_seed_gives_the_same_scene():
    config = load_scenario("sonata-2020-crowded")
    assert generate(config, 3, 4) == generate(config, 3, 4)


def test_neither_process_nor_hash_seed_changes_a_scene():
    code = "from sonata2d.scenegen import *; print(generate(load_scenario('sonata-2020-crowded'), 5, 6))"
    told = {
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in ("1", "2")
    }
    assert told == {f"{generate(load_scenario('sonata-2020-crowded'), 5, 6)}\n".encode()}


def test_another_seed_or_episode_gives_another_scene():
    config = ScenarioConfig()
    places = {generate(config, seed, episode).robot.pose for seed in range(5) for episode in range(5)}
    assert len(places) == 25


def test_a_scene_carries_its_settings_and_can_be_made_again_from_them():
    scene = generate(ScenarioConfig(humans=(4, 8)), 7, 2)
    assert (scene.seed, scene.episode) == (7, 2)
    assert generate(ScenarioConfig(**scene.settings), scene.seed, scene.episode) == scene


# Settings


def test_humans_in_total_are_split_by_share():
    config = ScenarioConfig(humans=(4, 8), relations=0)
    people = [generate(config, seed).humans for seed in range(150)]
    assert {len(humans) for humans in people} == {4, 5, 6, 7, 8}
    share = np.mean([human.behaviour == "wandering" for humans in people for human in humans])
    assert share == pytest.approx(0.5, abs=0.04)


def test_explicit_relations_bring_their_own_people_and_things():
    pairs = {"talking_pairs": 1, "walking_pairs": 1, "at_laptop": 1, "at_plant": 1, "at_object": 1}
    scene = generate(ScenarioConfig(**EMPTY, **pairs), 1)
    assert [h.behaviour for h in scene.humans] == ["standing"] * 5 + ["wandering"] * 2
    assert [f.type for f in scene.furniture] == ["table", "laptop", "plant", "shelf"]
    relations = {i.relation for i in scene.interactions}
    assert relations == {TALKING, WALKING_TOGETHER, AT_LAPTOP, AT_PLANT, AT_OBJECT}


def test_explicit_relations_use_what_is_there_before_they_bring_more():
    scene = generate(ScenarioConfig(**EMPTY | {"tables": 2, "plants": 1}, at_laptop=3, at_plant=1), 1)
    assert Counter(f.type for f in scene.furniture) == {"table": 3, "laptop": 3, "plant": 1}
    fixed = ({"type": "plant", "x": 1.0, "y": 2.0},)
    scene = generate(ScenarioConfig(**EMPTY, furniture=fixed, at_plant=1), 1)
    assert [f.pose for f in scene.furniture] == [Pose(1.0, 2.0)]
    assert scene.interactions[0].dst == scene.furniture[0].id


def test_a_fixed_laptop_lies_on_its_table_and_is_used_from_its_right_side():
    desk = ({"type": "laptop", "x": 0.1, "y": 0.0, "theta": math.pi}, {"type": "table", "x": 0.0, "y": 0.0})
    scene = generate(ScenarioConfig(**EMPTY, furniture=desk, at_laptop=1, laptop_distance=(1.0, 1.5)), 4)
    table, laptop = scene.furniture
    assert (table.type, laptop.type, laptop.on) == ("table", "laptop", table.id)
    ahead, left = laptop.pose.to_local(scene.humans[0].pose.position)
    assert abs(ahead) < 1e-3
    assert -1.5 <= left <= -0.99
    assert scene.humans[0].pose.theta == pytest.approx(-math.pi / 2, abs=1e-3)


def test_a_given_start_and_goal_are_kept():
    config = ScenarioConfig(robot={"pose": [1, 1, 0.5]}, goal={"position": [-1, -1], "theta": 0.25})
    for seed in range(10):
        scene = generate(config, seed)
        assert scene.robot.pose == Pose(1.0, 1.0, 0.5)
        assert (scene.goal.x, scene.goal.y, scene.goal.theta) == (-1.0, -1.0, 0.25)


def test_what_finds_no_place_is_an_error_that_says_what_and_how_often():
    config = ScenarioConfig(room={"kinds": "square", "side": 4}, humans=60)
    with pytest.raises(SceneError, match=r"no free spot for .* of \d+ in a 4\.0 m room after 200 attempts; widen"):
        generate(config, 1)


def test_what_finds_no_place_is_listed_if_it_may_be_dropped():
    room = {"kinds": "square", "side": 4}
    config = ScenarioConfig(**EMPTY | {"standing": 2}, at_plant=2, plant_distance=4.0, room=room, drop=True)
    scene = generate(config, 1)
    assert scene.dropped == ("person at a plant 1 of 2", "person at a plant 2 of 2")
    assert [human.id for human in scene.humans] == [1, 2]
    assert not scene.furniture
    assert not scene.interactions


def test_a_goal_that_cannot_be_reached_is_an_error():
    room = {"polygon": [[0, 0], [6, 0], [6, 6], [0, 6]], "walls": [[3, 0, 3, 6]]}
    config = ScenarioConfig(**EMPTY, room=room, robot={"pose": [1, 1, 0]}, goal={"position": [5, 5]}, max_layouts=2)
    with pytest.raises(SceneError, match=r"no way from its start \(1, 1\) to its goal \(5, 5\); move either"):
        generate(config, 1)


def test_furniture_that_stands_in_a_wall_is_an_error():
    config = ScenarioConfig(**EMPTY, furniture=({"type": "table", "x": 0, "y": 5},))
    with pytest.raises(SceneError, match=r"the table at \(0, 5\) does not fit between the walls"):
        generate(config.model_copy(update={"room": ScenarioConfig(room={"kinds": "l", "unit": 3}).room}), 1)


@pytest.mark.parametrize("name", ["home", "office", "clinic_corridor"])
def test_the_examples_can_always_be_laid_out(name):
    config = load_scenario(EXAMPLES / f"{name}.yaml")
    assert all(generate(config, seed).family == f"{name}/given" for seed in range(51))


@settings(max_examples=30, deadline=None)
@given(
    standing=st.integers(0, 6),
    wandering=st.integers(0, 6),
    tables=st.integers(0, 3),
    yaw=st.floats(-3.0, 3.0),
    seed=st.integers(0, 2**32),
)
def test_as_many_are_placed_as_are_asked_for(standing, wandering, tables, yaw, seed):
    config = ScenarioConfig(standing=standing, wandering=wandering, tables=tables, furniture_yaw=yaw)
    scene = generate(config, seed)
    assert (
        Counter(h.behaviour for h in scene.humans)
        == Counter({"standing": standing, "wandering": wandering}) + Counter()
    )
    assert sum(piece.type == "table" for piece in scene.furniture) == tables
