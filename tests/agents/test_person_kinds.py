"""Kinds of persons: their outlines, how they move, where they come from, and where they are read again."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.core.compiled.scalar import extent, half_line, shoulder_line_distance, to_shoulder_line
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose, Stadium, contact_times, shoulder_line_distances
from sonata2d.core.outlines import shape_gap
from sonata2d.core.person_kinds import BUILT_IN
from sonata2d.core.relations import ACTIVITIES
from sonata2d.datasets.check.verification import verify
from sonata2d.errors import ConfigError, SceneError
from sonata2d.gym.env import SocialNavEnv
from sonata2d.registry import PERSON_KINDS, person_kind
from sonata2d.sim.world import World
from sonata2d.view.stills import picture, snapshot_of
from tests.running import record_of

EMPTY: dict[str, Any] = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
HALL: dict[str, Any] = {"room": {"polygon": [[-7, -5], [7, -5], [7, 5], [-7, 5]]}}
ON_WHEELS = ("wheelchair", "walking_frame", "cart")
ALL = {kind.name: 1.0 for kind in BUILT_IN}


def scene_of(seed: int = 0, **settings: Any) -> s2.Scene:
    return s2.generate(s2.ScenarioConfig.model_validate({**EMPTY, **HALL, **settings}), seed)


def write(scene: s2.Scene, path: Path) -> None:
    s2.Episode(scene, s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()


@pytest.fixture
def _runner() -> Iterator[None]:
    PERSON_KINDS.register("runner", s2.PersonKind("runner", desired_speed=(3.0, 0.2, 2.5, 3.5), source="a test"))
    yield
    PERSON_KINDS.registered.clear()


# Outlines


def test_a_long_outline_is_a_broad_one_turned_by_a_right_angle() -> None:
    """Every function of a shoulder line gives, for a negative one, the result of the same line across."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        half, angle, other = rng.uniform(0.05, 0.8), rng.uniform(-3, 3), rng.uniform(-3, 3)
        dx, dy, other_half = *rng.uniform(-2, 2, 2), rng.uniform(-0.8, 0.8)
        body, turned = (
            (math.cos(angle), math.sin(angle)),
            (math.cos(angle - math.pi / 2), math.sin(angle - math.pi / 2)),
        )
        across = math.cos(other), math.sin(other)
        assert to_shoulder_line(dx, dy, *body, -half) == pytest.approx(to_shoulder_line(dx, dy, *turned, half))
        assert extent(1.0, 0.0, *body, -half) == pytest.approx(extent(1.0, 0.0, *turned, half))
        assert np.abs(half_line(*body, -half)) == pytest.approx(np.abs(half_line(*turned, half)))
        expected = shoulder_line_distance(dx, dy, *turned, half, *across, other_half)
        assert shoulder_line_distance(dx, dy, *body, -half, *across, other_half) == pytest.approx(expected)
        offset = np.array([[dx, dy]])
        rows = [np.array([row]) for row in (body, turned, across)]
        distances = shoulder_line_distances(offset, rows[0], np.array([-half]), rows[2], np.array([other_half]))
        assert distances == pytest.approx(expected, abs=1e-9)
        velocity = np.array([rng.uniform(-1, 1, 2)])
        times = [
            contact_times(offset, velocity, 0.5, rows[k], np.array([sign * half])) for k, sign in ((0, -1), (1, 1))
        ]
        assert times[0] == pytest.approx(times[1])
        pose, turned_pose = Pose(0.3, -0.2, angle), Pose(0.3, -0.2, angle - math.pi / 2)
        disc = Stadium(0.2, 0.0), Pose(dx, dy, 0.0)
        gap = shape_gap(Stadium(0.3, half), turned_pose, *disc)
        assert shape_gap(Stadium(0.3, -half), pose, *disc) == pytest.approx(gap, abs=1e-9)


def test_a_length_gives_a_line_along_the_heading() -> None:
    human = Human(1, Pose(0.0, 0.0), radius=0.3, breadth=0.6, length=1.0)
    assert human.shoulder == pytest.approx(-0.2)
    assert human.shape.sides == pytest.approx((1.0, 0.6))
    assert human.shape.circumradius == pytest.approx(0.5)


# Motion


@pytest.mark.parametrize("kind", ON_WHEELS)
def test_persons_on_wheels_move_along_their_headings_and_accelerate_slowly(kind: str) -> None:
    goals = [[5, 3], [-5, 3], [5, -3]]
    people = [
        {"kind": kind, "x": -5.0, "y": -3.0, "theta": 2.5, "desired_speed": 1.0, "goals": goals},
        {"kind": "adult", "x": 5.0, "y": 3.0, "goals": [[-5, -3], [5, 3]]},
    ]
    scene = scene_of(people=people, furniture=[{"type": "table", "x": 0.0, "y": 0.3}], rules={"ends_on": ["time"]})
    rows = record_of(scene).states.humans[:, 0]
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    assert np.abs(rows[:, 4] * c - rows[:, 3] * s).max() < 2e-4  # the precision of the file
    speed = rows[:, 3] * c + rows[:, 4] * s
    assert np.quantile(np.abs(np.diff(speed)), 0.95) <= 1.5 * 0.1 + 1e-3
    assert np.hypot(*(rows[:, :2] - goals[0]).T).min() < 0.5, "it reaches its first goal"
    assert np.abs(np.diff(np.unwrap(rows[:, 2]))).sum() > 2.5, "it turns"


def test_a_wheelchair_takes_the_way_through_the_wide_gap_and_an_adult_the_near_one() -> None:
    walls = [[0, -5, 0, -0.28], [0, 0.28, 0, 3.4], [0, 4.6, 0, 5]]  # gaps of 0.56 m and of 1.2 m
    goal = [[4, 0]]
    crossings = {}
    for kind in ("adult", "wheelchair"):
        person = {"kind": kind, "x": -4.0, "y": 0.0, "desired_speed": 1.0, "goals": goal}
        scene = scene_of(
            room={**HALL["room"], "walls": walls}, people=[person], rules={"ends_on": ["time"], "time_limit": 30},
            robot={"pose": [-6, -4, 0]}, goal={"position": [-6, 4]},
        )  # fmt: skip
        rows = record_of(scene).states.humans[:, 0]
        crossings[kind] = float(rows[np.argmax(rows[:, 0] > 0.0), 1])
        assert rows[-1, 0] > 3.0
    assert abs(crossings["adult"]) < 0.3
    assert crossings["wheelchair"] == pytest.approx(4.0, abs=0.4)


def test_scenes_of_all_kinds_replay_and_have_no_deep_overlaps(tmp_path: Path) -> None:
    settings = {
        "wandering": 8, "standing": 2, "talking_groups": 1, "walking_groups": 1, "chairs": 2, "seated": 1,
        "at_plant": 1, "doors": [{"x": -7, "y": 0, "inflow": 6}], "queues": [{"waiting": 2}], "person": {"kinds": ALL},
        "social": {"exits": 0.2, "sits": 0.3, "queues": 0.2, "pause": [1, 4]},
    }  # fmt: skip
    for seed in range(3):
        path = tmp_path / f"{seed}.json"
        write(scene_of(seed, **settings), path)
        assert verify(path, replay=True) == []


# Sampling


def test_kinds_are_drawn_by_their_weights_with_the_sizes_of_their_class() -> None:
    config = {**HALL, "wandering": 12, "person": {"kinds": {"adult": 1, "child": 1, "wheelchair": 2}}}
    humans = [human for seed in range(25) for human in scene_of(seed, **config).humans]
    count = {name: sum(human.kind == name for human in humans) for name in ALL}
    assert {name for name, number in count.items() if number} == {"adult", "child", "wheelchair"}
    assert count["wheelchair"] / len(humans) == pytest.approx(0.5, abs=0.1)
    for human in humans:
        kind = person_kind(human.kind)
        assert human.side_steps == kind.side_steps
        if kind.length and kind.breadth:
            assert kind.length[0] <= human.length <= kind.length[1]
            assert kind.breadth[0] <= 2 * human.radius <= kind.breadth[1] + 1e-4
        else:
            assert human.length == 0.0


def test_adults_alone_are_the_people_of_a_scene_without_kinds() -> None:
    plain, given = (scene_of(4, wandering=6, **more) for more in ({}, {"person": {"kinds": {"adult": 3}}}))
    assert plain.humans == given.humans


def test_groups_and_queues_of_long_bodies_have_room() -> None:
    scene = scene_of(
        1, walking_groups=1, talking_groups=1, queues=[{"waiting": 3}], person={"kinds": {"wheelchair": 1}}, at_plant=1
    )
    bodies = [(human.shape, human.pose) for human in scene.humans]
    gaps = [shape_gap(*a, *b) for k, a in enumerate(bodies) for b in bodies[:k]]
    assert len(bodies) > 7
    assert min(gaps) > 0.0


def test_persons_on_wheels_do_not_sit_down() -> None:
    config = {"chairs": 4, "seated": [1, 2], "wandering": 6, "social": {"sits": 0.9}, "rules": {"ends_on": ["time"]}}
    record = record_of(scene_of(2, **config, person={"kinds": {"adult": 1, "wheelchair": 3}}))
    scene, sitting = record.scene(), ACTIVITIES.index("sitting")
    sat = (record.states.activity == sitting).any(axis=0)
    assert sat.any()
    assert all(human.side_steps for human, each in zip(scene.humans, sat, strict=True) if each)


def test_a_person_of_people_has_the_kind_that_is_given() -> None:
    scene = scene_of(people=[{"kind": "cart", "x": 0, "y": 0, "desired_speed": 0.9}, {"x": 2, "y": 2}])
    assert [human.kind for human in scene.humans] == ["cart", "adult"]
    assert scene.humans[0].desired_speed == 0.9
    assert scene.humans[0].length > 1.4


def test_an_unknown_kind_is_an_error_that_names_a_similar_one() -> None:
    with pytest.raises(ConfigError, match="wheelchair"):
        s2.ScenarioConfig(person={"kinds": ["wheelchiar"]})
    with pytest.raises(ConfigError, match="at least one kind of person needs a weight above 0"):
        s2.ScenarioConfig(person={"kinds": {"adult": 0}})


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"length": (1.0, 1.2)}, "needs a breadth"),
        ({"breadth": (0.6, 0.5)}, "the smaller one first"),
        ({"desired_speed": (1.0, 0.2, 1.5, 2.0)}, "desired_speed"),
        ({"headway": 0.0}, "headway"),
    ],
)
def test_a_kind_with_impossible_numbers_is_refused(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        s2.PersonKind("odd", **fields)


@pytest.mark.usefixtures("_runner")
def test_a_registered_kind_is_drawn_recorded_and_shown() -> None:
    scene = scene_of(wandering=3, person={"kinds": ["runner"]})
    assert {human.kind for human in scene.humans} == {"runner"}
    assert min(human.desired_speed for human in scene.humans) >= 2.5
    assert World(scene).snapshot().humans[0].kind == "runner"


# Files, snapshots, observations, pictures


def test_files_hold_the_kind_only_where_it_is_not_an_adult(tmp_path: Path) -> None:
    people = [{"x": 0, "y": 0}, {"kind": "wheelchair", "x": 2, "y": 2}]
    path = tmp_path / "a.json"
    write(scene_of(people=people, rules={"time_limit": 1}), path)
    adult, other = s2.read_episode(path).document["humans"]
    assert {"kind", "length", "side_steps"}.isdisjoint(adult)
    assert (other["kind"], other["side_steps"]) == ("wheelchair", False)
    assert s2.read_episode(path).scene().humans[1].shoulder < 0.0
    snapshot = next(iter(s2.read_episode(path).snapshots()))
    assert snapshot.humans.kind.tolist() == ["adult", "wheelchair"]
    assert snapshot.humans[1].length == other["length"]
    assert snapshot.humans[1].breadth == pytest.approx(2 * other["radius"])


def test_observations_have_the_kinds_as_a_part() -> None:
    people = [{"kind": "child", "x": 0, "y": 0}, {"kind": "wheelchair", "x": 2, "y": 2}]
    config = s2.ScenarioConfig.model_validate({**EMPTY, **HALL, "people": people})
    env = SocialNavEnv(config, parts=["human_kinds"])
    observation, _ = env.reset(seed=0)
    names = ["adult", "older", "child", "wheelchair"]
    kinds = observation["human_kinds"][observation["humans_mask"] > 0]
    assert sorted(names[k] for k in kinds) == ["child", "wheelchair"]
    assert env.observation_space.contains(observation)


def test_each_kind_has_a_picture_of_its_own() -> None:
    pictures = []
    for kind in BUILT_IN:
        person = {"kind": kind.name, "x": 0, "y": 0, "radius": 0.2, "breadth": 0.4}
        pictures.append(picture(snapshot_of(scene_of(people=[person], robot={"pose": [5, 4, 0]})), size=(300, 250)))
    assert len({pygame.image.tobytes(image, "RGB") for image in pictures}) == len(BUILT_IN)


def test_given_sizes_of_people_on_wheels_agree_with_each_other() -> None:
    sizes = ({"breadth": 0.8}, {"radius": 0.2}, {"radius": 0.7})
    people = [{"kind": "wheelchair", "x": 3 * k - 3, "y": 0} | size for k, size in enumerate(sizes)]
    broad, slim, huge = scene_of(people=people, robot={"pose": [5, 4, 0]}).humans
    assert (broad.radius, broad.breadth) == (0.4, 0.8)
    assert (slim.radius, slim.breadth) == (0.2, 0.4)
    assert huge.length >= huge.breadth == 1.4
    both = [{"kind": "wheelchair", "x": 0, "y": 0, "breadth": 0.8, "radius": 0.2}]
    with pytest.raises(SceneError, match="the breadth of a wheelchair is twice its radius; give one of them"):
        scene_of(people=both)
