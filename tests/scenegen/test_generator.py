"""Generated scenes: distributions of sonata-2020, clearances, a path to the goal, the same scene for the same seed."""

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
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from sonata2d.core.entities import Human
from sonata2d.core.geometry import Disc, Pose, canonical_angle, inside_polygon, quantised
from sonata2d.core.navigation import FreeSpace
from sonata2d.core.outlines import shape_gap
from sonata2d.core.relations import AT_LAPTOP, AT_OBJECT, AT_PLANT, TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Scene
from sonata2d.core.vectors import wrap_angle
from sonata2d.errors import ConfigError, SceneError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario

EXAMPLES = Path(__file__).parents[2] / "examples" / "scenarios"
SCENES = 400
EMPTY = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}


@cache
def scenes() -> list[Scene]:
    """Many scenes of the default scenario."""
    return [generate(ScenarioConfig(), 1, episode) for episode in range(SCENES)]


@cache
def scenes_with_relations() -> list[Scene]:
    """Many scenes of the default scenario with more relations."""
    config = ScenarioConfig(standing=(2, 4), wandering=(2, 4), tables=(1, 4), plants=(1, 4), relations=(3, 4))
    return [generate(config, 2, episode) for episode in range(SCENES)]


def related(relation: str) -> list[tuple[Human, Pose]]:
    """All people in a relation, each with the pose of the person or object attended to."""
    pairs = []
    for scene in scenes_with_relations():
        pose = {entity.id: entity.pose for entity in (*scene.humans, *scene.furniture)}
        people = {human.id: human for human in scene.humans}
        pairs += [(people[i.src], pose[i.dst]) for i in scene.interactions if i.relation == relation]
    return pairs


def distance(a: Pose, b: Pose) -> float:
    return math.dist(a.position, b.position)


def ks_p_value(values: list[float], low: float, high: float) -> float:
    """p-value of the Kolmogorov-Smirnov test against the uniform distribution on low..high.

    Source: Kolmogorov's limit, with Stephens' correction, J. R. Stat. Soc. B 32 (1970) 115.
    """
    x = np.sort((np.array(values) - low) / (high - low))
    n = len(x)
    gap = max(float(np.max(np.arange(1, n + 1) / n - x)), float(np.max(x - np.arange(n) / n)))
    scaled = gap * (math.sqrt(n) + 0.12 + 0.11 / math.sqrt(n))
    return 2 * sum((-1) ** (k - 1) * math.exp(-2 * k * k * scaled * scaled) for k in range(1, 50))


def is_uniform(values: list[object], options: int) -> bool:
    """Whether all options occur about equally often: chi-squared within 5 standard deviations of its mean."""
    counts, expected = Counter(values), len(values) / options
    chi = sum((count - expected) ** 2 / expected for count in counts.values())
    return len(counts) == options and chi < options - 1 + 5 * math.sqrt(2 * (options - 1))


# Rooms


def test_the_three_kinds_of_room_are_equally_frequent():
    assert is_uniform([scene.family for scene in scenes()], 3)


def test_rooms_have_the_original_sizes():
    kinds = {"sonata-2020/square": set(), "sonata-2020/rectangle": set(), "sonata-2020/l": set()}
    for scene in scenes():
        span = scene.outline.max(axis=0) - scene.outline.min(axis=0)
        kinds[scene.family].add((float(span[0]), float(span[1])))
    assert kinds["sonata-2020/square"] == {(side, side) for side in (6.0, 7.0, 8.0, 9.0, 10.0)}
    assert {y for _, y in kinds["sonata-2020/rectangle"]} == {5.0, 6.0, 7.0, 8.0, 9.0, 10.0}
    assert all(5 <= y <= x <= 10 for x, y in kinds["sonata-2020/rectangle"])
    assert kinds["sonata-2020/l"] == {(9.0, 9.0), (12.0, 12.0)}


def test_the_five_sides_of_squares_are_equally_frequent():
    assert is_uniform([s.polygon[1][0] - s.polygon[0][0] for s in scenes() if s.family.endswith("square")], 5)


def test_the_four_orientations_of_an_l_are_equally_frequent():
    outlines = [scene.polygon for scene in scenes() if scene.family.endswith("/l")]
    notches = [
        (sx, sy)
        for outline in outlines
        for sx in (-1, 1)
        for sy in (-1, 1)
        if not inside_polygon(np.array([[sx * 2.5, sy * 2.5]]) * max(outline)[0] / 4.5, np.array(outline))[0]
    ]
    assert len(notches) == len(outlines)
    assert is_uniform(notches, 4)


def test_rooms_are_centred_and_counter_clockwise_and_their_edges_are_the_first_walls():
    for scene in scenes():
        x, y = scene.outline.T
        assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0
        assert np.allclose(scene.outline.max(axis=0), -scene.outline.min(axis=0))
        assert tuple(wall.start for wall in scene.walls[: len(x)]) == scene.polygon


# Pedestrians, furniture and relations


@pytest.mark.parametrize("behaviour", ["standing", "wandering"])
def test_counts_of_people_are_uniform_from_0_to_4(behaviour):
    assert is_uniform([sum(h.behaviour == behaviour for h in scene.humans) for scene in scenes()], 5)


def test_counts_of_furniture_are_uniform_from_0_to_4_and_every_table_has_a_laptop():
    assert is_uniform([sum(f.type == "plant" for f in scene.furniture) for scene in scenes()], 5)
    assert is_uniform([sum(f.type == "table" for f in scene.furniture) for scene in scenes()], 5)
    for scene in scenes():
        tables = {f.id: f.pose for f in scene.furniture if f.type == "table"}
        laptops = {f.on: f.pose for f in scene.furniture if f.type == "laptop"}
        assert tables == laptops


def test_ids_are_in_the_order_standing_wandering_tables_laptops_plants():
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


def test_walking_pairs_start_half_a_metre_apart_side_by_side():
    for a, b in related(WALKING_TOGETHER):
        ahead, left = a.pose.to_local(b)
        assert (ahead, left) == pytest.approx((0.0, 0.5), abs=3e-4)
        assert b.theta == a.pose.theta


def test_the_four_relations_are_equally_frequent_where_all_are_possible():
    firsts = [scene.interactions[0].relation for scene in scenes_with_relations() if scene.interactions]
    assert is_uniform(firsts, 4)


def test_no_entity_is_in_two_relations():
    for scene in (*scenes(), *scenes_with_relations()):
        ends = [end for i in scene.interactions for end in (i.src, i.dst)]
        assert len(ends) == len(set(ends))


def test_pairs_are_groups_whose_first_member_leads():
    for scene in scenes_with_relations():
        pairs = [i for i in scene.interactions if i.relation in (TALKING, WALKING_TOGETHER)]
        assert [group.members for group in scene.groups] == [(i.src, i.dst) for i in pairs]
        in_group = {member: group.id for group in scene.groups for member in group.members}
        assert all(human.group == in_group.get(human.id) for human in scene.humans)


def test_people_at_a_laptop_attend_to_the_laptop_not_the_table():
    for scene in scenes_with_relations():
        types = {piece.id: piece.type for piece in scene.furniture}
        assert all(types[i.dst] == "laptop" for i in scene.interactions if i.relation == AT_LAPTOP)


def test_desired_speeds_are_normally_distributed_within_0_8_and_1_8():
    speeds = [human.desired_speed for scene in scenes() for human in scene.humans]
    assert min(speeds) >= 0.8
    assert max(speeds) <= 1.8
    assert np.mean(speeds) == pytest.approx(1.3, abs=0.02)
    assert np.std(speeds) == pytest.approx(0.2, abs=0.02)


def test_ignores_robot_is_the_fraction_of_people_that_ignore_the_robot():
    config = ScenarioConfig(humans=8, relations=0, person={"ignores_robot": 0.25})
    reacts = [human.reacts_to_robot for k in range(100) for human in generate(config, k).humans]
    assert set(reacts) == {0.0, 1.0}
    assert np.mean(reacts) == pytest.approx(0.75, abs=0.05)


# Positions


def solid_outlines(scene: Scene) -> list[tuple[object, Pose]]:
    solid = [(piece.shape, piece.pose) for piece in scene.furniture if piece.on is None]
    people = [(Disc(human.radius), human.pose) for human in scene.humans]
    return [*solid, *people, (Disc(scene.robot.radius), scene.robot.pose)]


def test_entities_keep_their_clearance_and_are_in_the_room():
    for scene in scenes()[:120]:
        for (shape, pose), (other, place) in combinations(solid_outlines(scene), 2):
            near = shape.circumradius + other.circumradius + 0.1
            if distance(pose, place) < near:
                assert shape_gap(shape, pose, other, place) >= 0.05 - 1e-9
        centres = np.array([pose.position for _, pose in solid_outlines(scene)])
        assert inside_polygon(centres, scene.outline).all()


def test_people_start_0_4_metres_from_walls():
    for scene in scenes():
        walls = replace(scene, furniture=()).barriers
        places = np.array([human.pose.position for human in scene.humans]).reshape(-1, 2)
        assert (walls.gaps(places) >= 0.4 - 1e-9).all()


def test_the_goal_is_2_metres_away_and_can_be_reached():
    for scene in scenes():
        assert math.dist(scene.robot.pose.position, scene.goal.position) >= 2.0
        space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing_humans), scene.robot.radius + 0.05)
        assert space.path(scene.robot.pose.position, scene.goal.position) is not None


def test_all_numbers_are_rounded_to_the_precision_of_files():
    for scene in scenes()[:50]:
        poses = [pose for _, pose in solid_outlines(scene)] + [Pose(scene.goal.x, scene.goal.y, scene.goal.theta)]
        for pose in poses:
            assert pose == Pose(quantised(pose.x), quantised(pose.y), canonical_angle(pose.theta))
        assert all(human.desired_speed == quantised(human.desired_speed) for human in scene.humans)


def test_no_wall_separates_interacting_entities():
    config = load_scenario(EXAMPLES / "home.yaml")
    for seed in range(20):
        scene = generate(config, seed)
        pose = {entity.id: entity.pose for entity in (*scene.humans, *scene.furniture)}
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
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in ("1", "2")
    }
    assert outputs == {f"{generate(load_scenario('sonata-2020-crowded'), 5, 6)}\n".encode()}


def test_another_seed_or_episode_gives_another_scene():
    config = ScenarioConfig()
    poses = {generate(config, seed, episode).robot.pose for seed in range(5) for episode in range(5)}
    assert len(poses) == 25


def test_a_scene_can_be_generated_again_from_its_settings_and_seed():
    scene = generate(ScenarioConfig(humans=(4, 8)), 7, 2)
    assert (scene.seed, scene.episode) == (7, 2)
    assert generate(ScenarioConfig(**scene.settings), scene.seed, scene.episode) == scene


# Settings


def test_wandering_share_is_the_fraction_of_wandering_humans():
    config = ScenarioConfig(humans=(4, 8), relations=0)
    people = [generate(config, seed).humans for seed in range(150)]
    assert {len(humans) for humans in people} == {4, 5, 6, 7, 8}
    fraction = np.mean([human.behaviour == "wandering" for humans in people for human in humans])
    assert fraction == pytest.approx(0.5, abs=0.04)


def test_requested_relations_add_people_and_furniture():
    pairs = {"talking_pairs": 1, "walking_pairs": 1, "at_laptop": 1, "at_plant": 1, "at_object": 1}
    scene = generate(ScenarioConfig(**EMPTY, **pairs), 1)
    assert [h.behaviour for h in scene.humans] == ["standing"] * 5 + ["wandering"] * 2
    assert [f.type for f in scene.furniture] == ["table", "laptop", "plant", "shelf"]
    relations = {i.relation for i in scene.interactions}
    assert relations == {TALKING, WALKING_TOGETHER, AT_LAPTOP, AT_PLANT, AT_OBJECT}


def test_requested_relations_use_free_furniture_before_adding_more():
    scene = generate(ScenarioConfig(**EMPTY | {"tables": 2, "plants": 1}, at_laptop=3, at_plant=1), 1)
    assert Counter(f.type for f in scene.furniture) == {"table": 3, "laptop": 3, "plant": 1}
    fixed = ({"type": "plant", "x": 1.0, "y": 2.0},)
    scene = generate(ScenarioConfig(**EMPTY, furniture=fixed, at_plant=1), 1)
    assert [f.pose for f in scene.furniture] == [Pose(1.0, 2.0)]
    assert scene.interactions[0].dst == scene.furniture[0].id


def test_a_fixed_laptop_lies_on_its_table_and_is_used_from_its_right_side():
    furniture = ({"type": "laptop", "x": 0.1, "y": 0.0, "theta": math.pi}, {"type": "table", "x": 0.0, "y": 0.0})
    scene = generate(ScenarioConfig(**EMPTY, furniture=furniture, at_laptop=1, laptop_distance=(1.0, 1.5)), 4)
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


def test_an_entity_without_space_is_an_error_with_its_number_and_the_attempts():
    config = ScenarioConfig(room={"kinds": "square", "side": 4}, humans=60)
    with pytest.raises(SceneError, match=r"no free spot for .* of \d+ in a 4\.0 m room after 200 attempts; widen"):
        generate(config, 1)


def test_entities_without_space_are_listed_with_drop():
    room = {"kinds": "square", "side": 4}
    config = ScenarioConfig(**EMPTY | {"standing": 2}, at_plant=2, plant_distance=4.0, room=room, drop=True)
    scene = generate(config, 1)
    assert scene.dropped == ("person at a plant 1 of 2", "person at a plant 2 of 2")
    assert [human.id for human in scene.humans] == [1, 2]
    assert not scene.furniture
    assert not scene.interactions


def test_a_goal_without_a_path_is_an_error():
    room = {"polygon": [[0, 0], [6, 0], [6, 6], [0, 6]], "walls": [[3, 0, 3, 6]]}
    config = ScenarioConfig(**EMPTY, room=room, robot={"pose": [1, 1, 0]}, goal={"position": [5, 5]}, max_layouts=2)
    with pytest.raises(SceneError, match=r"no path for the robot from its start \(1, 1\) to its goal \(5, 5\); move"):
        generate(config, 1)


def test_fixed_furniture_in_a_wall_is_an_error():
    config = ScenarioConfig(**EMPTY, furniture=({"type": "table", "x": 0, "y": 5},))
    with pytest.raises(SceneError, match=r"the table at \(0, 5\) does not fit between the walls"):
        generate(config.model_copy(update={"room": ScenarioConfig(room={"kinds": "l", "unit": 3}).room}), 1)


@pytest.mark.parametrize("name", ["home", "office", "clinic_corridor"])
def test_every_example_scenario_generates_scenes(name):
    config = load_scenario(EXAMPLES / f"{name}.yaml")
    assert all(generate(config, seed).family == f"{name}/given" for seed in range(51))


@settings(max_examples=30)
@given(
    standing=st.integers(0, 6),
    wandering=st.integers(0, 6),
    tables=st.integers(0, 3),
    yaw=st.floats(-3.0, 3.0),
    seed=st.integers(0, 2**32),
)
def test_the_requested_numbers_of_entities_are_placed(standing, wandering, tables, yaw, seed):
    config = ScenarioConfig(standing=standing, wandering=wandering, tables=tables, furniture_yaw=yaw)
    scene = generate(config, seed)
    assert (
        Counter(h.behaviour for h in scene.humans)
        == Counter({"standing": standing, "wandering": wandering}) + Counter()
    )
    assert sum(piece.type == "table" for piece in scene.furniture) == tables


def test_a_scenario_can_be_given_by_name_or_path(tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text("extends: lively\nwandering: 3\n")
    assert generate("lively") == generate(load_scenario("lively"), seed=0)
    by_path = generate(tmp_path / "own.yaml", seed=4)
    assert by_path == generate(str(tmp_path / "own.yaml"), seed=4)
    assert (by_path.name, sum(human.behaviour == "wandering" for human in by_path.humans)) == ("own", 3)
    with pytest.raises(ConfigError, match="did you mean 'lively'"):
        generate("livley")


@pytest.mark.parametrize(("settings", "remedy"), [(3, ""), ({"humans": 2}, r"; ScenarioConfig\(\*\*settings\)")])
def test_a_number_or_a_dictionary_is_not_a_scenario(settings: Any, remedy: str) -> None:
    with pytest.raises(TypeError, match=rf"the name of a preset, .* or a ScenarioConfig, got .*{remedy}"):
        generate(settings, seed=1)
