"""Doors, queues, places and seats in generated scenes, and the people that come with them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.geometry import Barriers, inside_polygon
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.errors import SceneError
from sonata2d.record.layout import scene_from_json, scene_to_json

EMPTY = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
HALL = {"kinds": "rectangle", "breadth": 8, "length": 10}


def scenario(**settings: object) -> s2.ScenarioConfig:
    return s2.ScenarioConfig(**{"room": HALL, **EMPTY, **settings})  # type: ignore[arg-type]


def through_a_file(scene: Scene) -> Scene:
    ids = {"name": scene.name, "family": scene.family, "seed": scene.seed, "episode": scene.episode}
    return scene_from_json(scene_to_json(scene) | ids)


def test_scenes_without_the_settings_have_no_doors_queues_places_and_visitors() -> None:
    for seed in range(10):
        scene = s2.generate(s2.ScenarioConfig(), seed)
        assert (scene.doors, scene.queues, scene.places) == ((), (), ())
        assert all(human.enters == 0 and human.seat is None and human.queue is None for human in scene.humans)


def test_doors_change_nothing_else_in_a_scene() -> None:
    plain = s2.generate(scenario(plants=2, wandering=3), 4)
    other = s2.generate(scenario(plants=2, wandering=3, doors=[{"x": 5, "y": 0}]), 4)
    assert len(other.doors) == 1
    assert (other.humans, other.furniture) == (plain.humans, plain.furniture)


def test_a_given_door_is_at_the_nearest_place_of_the_outline_and_faces_into_the_room() -> None:
    scene = s2.generate(scenario(doors=[{"x": 9, "y": 1.3}, {"x": -4.9, "y": 50}]), 1)
    assert [(d.pose.x, d.pose.y, d.pose.theta) for d in scene.doors] == [(5.0, 1.3, 3.1416), (-4.4, 4.0, -1.5708)]


@pytest.mark.parametrize("kind", ["l", "crossing", "u"])
def test_drawn_doors_are_on_the_outline_apart_from_each_other(kind: str) -> None:
    for seed in range(10):
        scene = s2.generate(scenario(room={"kinds": kind}, doors=[{}, {"width": 1.2}, {}]), seed)
        places = np.array([door.pose.position for door in scene.doors])
        edges = Barriers.of((w.start, w.end, 0.0) for w in scene.walls)
        assert edges.gaps(places).min(axis=0) == pytest.approx(np.zeros(3), abs=1e-4)
        inner = np.array([door.pose.to_world((0.5, 0.0)) for door in scene.doors])
        assert inside_polygon(inner, scene.outline).all()
        assert min(math.dist(a, b) for a in places for b in places if (a != b).any()) > 1.2


def test_arrivals_have_the_mean_and_the_variance_of_a_poisson_process() -> None:
    config = scenario(doors=[{"x": 5, "y": 0, "inflow": 5}], rules={"time_limit": 120})
    counts = [len(s2.generate(config, seed).humans) for seed in range(300)]
    assert np.mean(counts) == pytest.approx(10.0, abs=0.55)  # three standard errors
    assert np.var(counts) == pytest.approx(10.0, rel=0.3)
    ticks = [human.enters for seed in range(60) for human in s2.generate(config, seed).humans]
    assert min(ticks) >= 1
    assert max(ticks) < 1200
    assert np.mean(ticks) == pytest.approx(600.0, abs=45.0)


def test_poisson_counts_of_large_means_have_them_as_mean_and_variance() -> None:
    rng = RandomStream(1, 0, "journeys")
    counts = [rng.poisson(100.0) for _ in range(2000)]
    assert np.mean(counts) == pytest.approx(100.0, abs=0.7)
    assert np.var(counts) == pytest.approx(100.0, rel=0.1)
    assert rng.poisson(0.0) == 0


def test_people_enter_at_their_door_and_pairs_of_them_together() -> None:
    config = scenario(doors=[{"x": 5, "y": 0, "inflow": 10, "pairs": 1.0, "width": 1.4}])
    scene = s2.generate(config, 2)
    door = scene.doors[0].pose
    assert len(scene.groups) > 5
    people = {human.id: human for human in scene.humans}
    assert all(human.behaviour == "wandering" and human.group for human in scene.humans)
    for group in scene.groups:
        a, b = (people[member] for member in group.members)
        assert a.enters == b.enters > 0
        assert math.dist(a.pose.position, b.pose.position) == pytest.approx(0.6, abs=1e-3)
        for human in (a, b):
            ahead, left = door.to_local(human.pose.position)
            assert ahead == pytest.approx(0.35, abs=1e-3)
            assert abs(left) < 0.7
            assert human.pose.theta == door.theta


def test_people_wait_in_a_queue_one_behind_the_other() -> None:
    scene = s2.generate(scenario(queues=[{"x": 2, "y": 3, "theta": 1.5708, "waiting": 3}], wandering=4), 1)
    waiting = [human for human in scene.humans if human.queue == scene.queues[0].id]
    assert [human.pose.position for human in waiting] == [(2.0, 3.0), (2.0, 2.25), (2.0, 1.5)]
    others = [human.pose.position for human in scene.humans if human.queue is None]
    assert min(math.dist(place, human.pose.position) for place in others for human in waiting) > 0.4


def test_a_queue_is_as_long_as_there_is_space() -> None:
    furniture = [{"type": "table", "x": 2, "y": 0}]
    queue = s2.generate(scenario(queues=[{"x": 2, "y": 3, "theta": 1.5708}], furniture=furniture), 1).queues[0]
    assert queue.capacity == 4
    drawn = s2.generate(scenario(queues=[{"capacity": 5}], furniture=furniture), 1)
    slots = np.array([drawn.queues[0].slot(number) for number in range(drawn.queues[0].capacity)])
    assert drawn.barriers.gaps(slots).min() > 0.29


def test_people_sit_on_free_seats() -> None:
    seat = {"type": "sofa", "x": 0, "y": -3, "theta": 0.0, "size": [0.9, 0.5], "seat": True}
    plain = {"type": "chair", "x": 3, "y": -3, "seat": False}
    walled = [{"type": "table", "x": x, "y": y} for x, y in ((-3.4, 3), (-4.6, 3), (-4, 3.6), (-4, 2.4))]
    config = scenario(furniture=[seat, plain, *walled, {"type": "chair", "x": -4, "y": 3}], chairs=1, seated=9)
    scene = s2.generate(config, 3)
    sitting = {human.seat: human for human in scene.humans}
    sofa = next(piece for piece in scene.furniture if piece.type == "sofa")
    assert len(sitting) == len(scene.humans) == 2  # on the sofa and the drawn chair
    assert sitting[sofa.id].pose == s2.Pose(0.0, -3.0, -1.5708)  # the front of a sofa longer than wide is -y


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"places": [{"x": 9, "y": 0}]}, r"the place \(9, 0\) is outside the room; move it"),
        ({"queues": [{"x": 9, "y": 0}]}, r"the queue at \(9, 0\) has no space for 1 person; move it"),
        ({"queues": [{"x": 0, "y": 0, "theta": 1.5708, "waiting": 8}]}, "has no space for 8 people"),
        ({"doors": [{"x": 5, "y": 0}, {"x": 5, "y": 0.5}]}, r"the door at \(5, 0.5\) is too near to another one"),
        ({"doors": [{"x": 5, "y": 0, "width": 11}]}, "no wall is long enough for a door of 11 m"),
        ({"doors": [{"width": 9.5}]}, "no space for a door of 9.5 m in a 10.0 x 8.0 m room"),
    ],
)
def test_what_has_no_space_is_refused_with_the_remedy(settings: dict[str, object], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        s2.generate(scenario(**settings), 1)


def test_scenes_with_journeys_are_the_same_after_reading_and_for_the_same_seed() -> None:
    config = scenario(
        doors=[{"inflow": 4, "pairs": 0.5}, {}], queues=[{"waiting": [0, 2]}], places=[{"x": 0, "y": 0}], chairs=2,
        seated=1, people=[{"x": 1, "y": 0, "goals": [[2, 0], [3, 0]], "stay": [1, 2]}],
    )  # fmt: skip
    scene = s2.generate(config, 6)
    assert scene == s2.generate(config, 6) == through_a_file(scene)
    assert 1.0 <= scene.humans[0].stays[0] <= 2.0
    assert s2.ScenarioConfig(**config.settings()) == config


def test_a_flipped_scenario_mirrors_doors_queues_places_and_seats() -> None:
    given = {
        "doors": [{"x": 5, "y": 1}], "queues": [{"x": 1, "y": 2, "theta": 0.5}], "places": [{"x": -2, "y": 1}],
        "furniture": [{"type": "chair", "x": 0, "y": -3, "theta": 0.7}], "seated": 1,
    }  # fmt: skip
    plain, image = (s2.generate(scenario(**given, flip=flip), 1) for flip in (0.0, 1.0))
    for a, b in zip((*plain.doors, *plain.queues), (*image.doors, *image.queues), strict=True):
        assert (b.pose.x, b.pose.y) == (a.pose.x, -a.pose.y)
        assert math.remainder(a.pose.theta + b.pose.theta, 6.2832) == pytest.approx(0.0, abs=2e-4)
    assert image.places[0].position == (-2.0, -1.0)
    assert (image.humans[0].pose.y, image.humans[0].pose.theta) == (3.0, -0.7)
