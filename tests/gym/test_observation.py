"""Observations: every number against the snapshot, limits of rows, order."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.furniture_types import OBJECT_TYPES
from sonata2d.core.geometry import Disc
from sonata2d.core.portable_math import Array
from sonata2d.core.relations import ACTIVITIES, RELATION, RELATIONS, Relation
from sonata2d.gym.observation import Encoder, Sizes
from sonata2d.gym.parts import Observation


def observed(scenario: str, ticks: int = 30, seed: int = 2, **arguments: object) -> tuple[s2.Snapshot, Observation]:
    config = s2.load_scenario(scenario)
    scene = s2.generate(config, seed)
    episode = s2.Episode(scene, s2.StraightToGoal())
    for _ in range(ticks):
        episode.step()
    encoder = Encoder(Sizes.of(config), **arguments)  # type: ignore[arg-type]
    encoder.reset(scene)
    return episode.snapshot(), encoder.encode(episode.snapshot())


def local(snapshot: s2.Snapshot, point: tuple[float, float]) -> list[float]:
    return list(snapshot.robot.pose.to_local(point))


def turned(snapshot: s2.Snapshot, vector: tuple[float, float]) -> list[float]:
    (c, s), (x, y) = snapshot.robot.direction, vector
    return [x * c + y * s, y * c - x * s]


@pytest.mark.parametrize("order", ["nearest", "scene"])
def test_all_numbers_are_those_of_the_snapshot(order: str) -> None:
    snapshot, observation = observed("lively", order=order)
    robot, goal = snapshot.robot, snapshot.goal
    twist = robot.twist
    time = snapshot.time / snapshot.scene.rules.time_limit
    expected = [twist.vx, twist.vy, twist.omega, robot.radius, time]
    np.testing.assert_allclose(observation["robot"], expected, atol=1e-6)
    heading = turned(snapshot, (math.cos(goal.theta), math.sin(goal.theta)))
    expected = [*local(snapshot, goal.position), *heading, goal.distance, goal.angle]
    np.testing.assert_allclose(observation["goal"], expected, atol=1e-5)

    x, y = robot.position
    people = list(snapshot.humans)
    things = list(snapshot.objects)
    if order == "nearest":
        people.sort(key=lambda human: math.hypot(human.pose.x - x, human.pose.y - y))
        things.sort(key=lambda piece: math.hypot(piece.pose.x - x, piece.pose.y - y))
    assert people
    assert things
    for row, human in zip(observation["humans"], people, strict=False):
        gaze = (math.cos(human.head), math.sin(human.head))
        expected = [
            *local(snapshot, human.pose.position), *turned(snapshot, human.velocity),
            *turned(snapshot, human.pose.direction), *turned(snapshot, gaze), human.omega, human.radius, human.shoulder,
        ]  # fmt: skip
        np.testing.assert_allclose(row, expected, atol=1e-5)
    for row, piece in zip(observation["objects"], things, strict=False):
        shape = piece.shape
        sizes = (2 * shape.radius,) * 2 if isinstance(shape, Disc) else (shape.length, shape.width)
        expected = [*local(snapshot, piece.pose.position), *turned(snapshot, piece.pose.direction), *sizes,
                    isinstance(shape, Disc)]  # fmt: skip
        np.testing.assert_allclose(row, expected, atol=1e-5)
    for name, count in (("humans", len(people)), ("objects", len(things)), ("walls", len(snapshot.walls))):
        np.testing.assert_array_equal(observation[f"{name}_mask"], np.arange(len(observation[name])) < count)
        assert not observation[name][count:].any()
    activities = [ACTIVITIES.index(human.activity) for human in people]
    np.testing.assert_array_equal(observation["activities"][: len(people)], activities)
    types = [OBJECT_TYPES.index(piece.type) for piece in things]
    np.testing.assert_array_equal(observation["object_types"][: len(things)], types)
    ends = {tuple(np.round(local(snapshot, wall.start), 3)) for wall in snapshot.walls}
    rows = observation["walls"][: len(snapshot.walls), :2]
    assert {tuple(np.round(row, 3)) for row in rows.astype(float)} == ends

    rows = len(observation["humans"])
    entities = [human.id for human in people] + [-1] * (rows - len(people)) + [piece.id for piece in things]
    links = observation["interactions"][observation["interactions_mask"] > 0.0]
    found = {(entities[a], RELATIONS[kind], entities[b]) for a, kind, b in links}
    assert found == {(i.src, i.relation, i.dst) for i in snapshot.interactions}
    assert found


def test_absent_pedestrians_have_no_rows() -> None:
    snapshot, observation = observed("waiting-room", ticks=100)
    assert len(snapshot.humans) < len(snapshot.scene.humans)
    assert observation["humans_mask"].sum() == len(snapshot.humans)


def test_of_more_entities_than_rows_the_nearest_are_observed() -> None:
    config = s2.load_scenario("crowded-hall")
    scene = s2.generate(config, 1)
    snapshot = s2.Episode(scene, s2.StraightToGoal()).snapshot()
    away = np.hypot(*(snapshot.humans.position - np.array(snapshot.robot.position)).T)
    for order in ("nearest", "scene"):
        encoder = Encoder(Sizes.of(config).changed({"humans": 4, "walls": 2}), order)  # type: ignore[arg-type]
        encoder.reset(scene)
        observation = encoder.encode(snapshot)
        assert encoder.space.contains(observation)
        nearest = np.argsort(away, kind="stable")[:4]
        expected = nearest if order == "nearest" else np.sort(nearest)
        np.testing.assert_array_equal(encoder.rows.humans, expected)
        assert observation["walls_mask"].all()


def test_in_the_order_of_the_scene_everybody_keeps_a_row() -> None:
    config = s2.load_scenario("waiting-room")
    scene = s2.generate(config, 1)
    encoder = Encoder(Sizes.of(config).changed({"humans": len(scene.humans)}), "scene")
    encoder.reset(scene)
    episode, absent = s2.Episode(scene, s2.StraightToGoal()), 0
    while not episode.is_over and episode.observe().tick < 200:
        observation, snapshot = encoder.encode(episode.snapshot()), episode.snapshot()
        present = {human.id for human in snapshot.humans}
        expected = [human.id in present for human in scene.humans]
        np.testing.assert_array_equal(observation["humans_mask"] > 0.0, expected)
        np.testing.assert_array_equal(encoder.rows.humans >= 0, expected)
        assert not observation["humans"][~np.array(expected)].any()
        absent += len(scene.humans) - len(present)
        episode.step()
    assert absent


def test_what_is_far_away_is_shown_in_its_direction() -> None:
    """In a corridor of 300 m, walls end 100 m away, and lie where they are."""
    settings = {
        "room": {"kinds": "rectangle", "length": 300, "breadth": 6}, "robot": {"pose": [-140, 1, 0.5]},
        "goal": {"position": [140, -1]},
    }  # fmt: skip
    config = s2.load_scenario("empty").changed(**settings)
    scene = s2.generate(config, 1)
    encoder = Encoder(Sizes.of(config))
    encoder.reset(scene)
    snapshot = s2.Episode(scene, s2.StraightToGoal()).snapshot()
    observation = encoder.encode(snapshot)
    x, y = local(snapshot, scene.goal.position)
    np.testing.assert_allclose(math.atan2(*observation["goal"][[1, 0]]), math.atan2(y, x), atol=1e-6)
    assert np.abs(observation["goal"][:2]).max() == 100.0
    walls = observation["walls"][observation["walls_mask"] > 0.0].astype(float)
    assert len(walls) == 3  # the far end of the room has no row
    lines = [(np.array(local(snapshot, wall.start)), np.array(local(snapshot, wall.end))) for wall in snapshot.walls]
    for row in walls:
        for point in (row[:2], row[2:]):
            assert min(distance_to_line(point, start, end) for start, end in lines) < 1e-3


def distance_to_line(point: Array, start: Array, end: Array) -> float:
    (x, y), (dx, dy) = point - start, end - start
    return abs(x * dy - y * dx) / math.hypot(dx, dy)


@pytest.mark.parametrize("relation", RELATION.values(), ids=lambda relation: relation.setting)
def test_all_people_and_objects_of_a_relation_have_rows(relation: Relation) -> None:
    free = {"laptops_on_tables": False, "relations": 0}
    config = s2.ScenarioConfig(room={"kinds": ["hall"]}, standing=0, wandering=0, **free, **{relation.setting: 3})
    scene, sizes = s2.generate(config, seed=1), Sizes.of(config)
    assert len(scene.humans) == 3 * relation.humans
    assert sizes.humans == len(scene.humans)
    assert sizes.objects >= len(scene.furniture)
    assert sizes.interactions >= len(scene.interactions)


def test_waiting_people_and_large_groups_have_rows() -> None:
    queue = {"x": 0, "y": 0, "theta": 0, "waiting": 6}
    assert Sizes.of(s2.load_scenario("empty").changed(queues=[queue])).humans == 6
    group = {"talking_groups": 1, "groups": {"talking_size": 6}}
    assert Sizes.of(s2.load_scenario("empty").changed(**group)).interactions >= 15
    rare = {"room": {"kinds": {"square": 0.999, "crossing": 0.001}}}
    assert Sizes.of(s2.load_scenario("empty").changed(**rare)).walls == 12


def test_sizes_cover_every_scene_of_a_preset() -> None:
    from sonata2d.scenegen.scenario.load import scenario_names

    for name in scenario_names():
        config = s2.load_scenario(name)
        sizes = Sizes.of(config)
        for seed in range(10):
            scene = s2.generate(config, seed)
            assert len(scene.walls) <= sizes.walls, name
            assert len(scene.furniture) <= sizes.objects, name
            if not scene.doors:
                assert len(scene.humans) <= sizes.humans, name
                assert len(scene.interactions) <= sizes.interactions, name


def test_spaces_are_finite() -> None:
    space = Encoder(Sizes(3, 2, 4, 5)).space
    for name in ("robot", "goal", "humans", "objects", "walls"):
        part = space[name]
        assert np.isfinite(part.low).all()  # type: ignore[attr-defined]
        assert np.isfinite(part.high).all()  # type: ignore[attr-defined]
