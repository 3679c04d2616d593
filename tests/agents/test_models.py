"""The laws of the literature: each as worked out by hand, and what holds of all of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.agents.controllers.reactive import Orca, SocialForce
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.models.base import Walkers, pedestrian_model
from sonata2d.agents.pedestrians.models.farina2017 import Farina2017, headed_acceleration, headed_group_acceleration
from sonata2d.agents.pedestrians.models.helbing1995 import Helbing1995, step_acceleration
from sonata2d.agents.pedestrians.models.helbing2000 import (
    Helbing2000,
    pressing_acceleration,
    pressing_wall_acceleration,
)
from sonata2d.agents.pedestrians.models.orca2011 import reciprocal_half_planes, wall_half_planes
from sonata2d.core.geometry import Barriers, Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene
from sonata2d.registry import PEDESTRIAN_MODELS
from sonata2d.sim.episode import Episode
from sonata2d.sim.world import World

from ..conftest import room, walker
from .test_crowd import watched

WALL = Barriers.of([((-5.0, 0.0), (5.0, 0.0), 0.0)])
LAWS = ["helbing1995", "helbing2000", "farina2017", "orca2011"]
EAST = np.array([[1.0, 0.0]])
BOTH = 1.0 - np.eye(2)


def some_people(seed: int = 0, count: int = 6) -> Walkers:
    """People at random in a small place, and a robot, that all want to go somewhere."""
    rng = np.random.default_rng(seed)
    angle, turn = rng.uniform(-3.0, 3.0, (2, count))
    direction = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    direction[-1] = 0.0
    return Walkers(
        position=rng.uniform(-1.5, 1.5, (count, 2)),
        velocity=rng.uniform(-1.0, 1.0, (count, 2)),
        desired_direction=direction,
        body_direction=np.stack((np.cos(turn), np.sin(turn)), axis=1),
        desired_speed=np.array([1.3] * (count - 1) + [0.0]),
        radius=np.array([0.2] * (count - 1) + [0.3]),
        weight=1.0 - np.eye(count),
    )


def felt(model: str, walkers: Walkers, scene: Scene | None = None) -> Array:
    """What the people feel; the robot's own row is nobody's affair."""
    return pedestrian_model(model)(scene or room()).acceleration(walkers)[:-1]


def test_pedestrians_of_one_model_walk_where_they_face() -> None:
    assert [name for name in PEDESTRIAN_MODELS if pedestrian_model(name).headed] == ["farina2017"]


def test_a_step_ahead_as_worked_out_by_hand() -> None:
    """One stands 1 m to the left of the middle of the other's step of 2 m, who walks at 1 m/s along x."""
    place, velocity = np.array([[1.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    law = Helbing1995()
    away = step_acceleration(place, velocity, np.array([[0.0, -1.0], [1.0, 0.0]]), BOTH, law)
    near = math.sqrt(2.0)  # to either focus: a + c = 2 sqrt 2, 2b = 2
    by_hand = 2.1 / 0.3 * math.exp(-1.0 / 0.3) * (2.0 * near) / 4.0 * (2.0 / near)
    assert away[0] == pytest.approx((0.0, by_hand), abs=1e-6)


def test_whom_one_does_not_see_counts_half() -> None:
    place, velocity = np.array([[1.0, 0.0], [0.0, 0.0]]), np.zeros((2, 2))
    law = Helbing1995()
    towards, turned_away = (
        step_acceleration(place, velocity, np.array([[x, 0.0], [1.0, 0.0]]), BOTH, law)[0] for x in (-1.0, 1.0)
    )
    assert towards == pytest.approx((2.1 / 0.3 * math.exp(-1.0 / 0.3), 0.0), abs=1e-6)
    assert turned_away == pytest.approx(0.5 * towards)


def test_the_wall_of_1995_as_worked_out_by_hand() -> None:
    walkers = replace(some_people(count=2), position=np.array([[0.0, -3.5], [0.0, 0.0]]), velocity=np.zeros((2, 2)))
    walkers = replace(walkers, desired_direction=np.zeros((2, 2)), weight=np.zeros((2, 2)))
    by_hand = 10.0 / 0.2 * (math.exp(-0.5 / 0.2) - math.exp(-7.5 / 0.2))
    assert felt("helbing1995", walkers)[0] == pytest.approx((0.0, by_hand), abs=1e-5)


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_pressing_and_rubbing_as_worked_out_by_hand(gap: float) -> None:
    """The other, to the right, slides past upwards; who is touched is dragged along."""
    place = np.array([[0.0, 0.0], [0.4 + gap, 0.0]])
    velocity = np.array([[0.0, 0.0], [0.3, 0.8]])
    pushed = pressing_acceleration(place, velocity, np.full(2, 0.2), BOTH, Helbing2000())
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert pushed[0] == pytest.approx((-push, 2.4e5 * overlap * 0.8 / 80.0), rel=1e-5)
    assert pushed[1] == pytest.approx(-pushed[0])


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_a_wall_presses_and_brakes_as_worked_out_by_hand(gap: float) -> None:
    place, velocity = np.array([[0.0, 0.2 + gap], [0.0, 3.0]]), np.array([[1.1, -0.2], [0.0, 0.0]])
    pushed = pressing_wall_acceleration(place, velocity, np.full(2, 0.2), WALL, Helbing2000())
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert pushed[0] == pytest.approx((-2.4e5 * overlap * 1.1 / 80.0, push), rel=1e-5)


def test_a_headed_body_takes_its_own_drive_ahead_only_and_slips_little() -> None:
    drive, others = np.array([[1.0, 2.0]]), np.array([[0.3, -0.4]])
    velocity, direction = np.array([[0.5, 0.1]]), np.array([[0.0, 1.0]])  # faces +y, so its left is -x
    made = headed_acceleration(drive, others, velocity, direction, Farina2017())
    assert made[0] == pytest.approx((0.3 - 500.0 / 75.0 * 0.5, 2.0 - 0.4))


def test_a_headed_group_pulls_only_beyond_its_distances() -> None:
    """Three abreast, heading east; the third has fallen 4.5 m behind: the centre is 1.5 m behind the first two."""
    place = np.array([[0.0, 0.3], [0.0, -0.3], [-4.5, 0.0], [9.0, 9.0]])
    member = np.zeros((4, 4))
    member[:3, :3] = 1.0 - np.eye(3)
    pull = headed_group_acceleration(place, np.repeat(EAST, 4, axis=0), member, Farina2017())
    to_first = math.sqrt(1.5 * 1.5 + 0.3 * 0.3)
    assert pull[0] == pytest.approx((-200.0 / 75.0 * 1.5 / to_first, 0.0))
    assert pull[2] == pytest.approx((200.0 / 75.0, 0.0))
    assert pull[3].tolist() == [0.0, 0.0]


def test_a_half_plane_off_the_leg_as_worked_out_by_hand() -> None:
    """Head-on, 2 m apart, radii 0.2, closing at 2.6 m/s: the nearest way out is square to a leg of the cone."""
    place, velocity = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[1.3, 0.0], [-1.3, 0.0]])
    half = np.full((2, 2), 0.5)
    planes = reciprocal_half_planes(place, velocity, np.full(2, 0.2), BOTH, half, horizon=2.0, dt=0.1)
    sine = 0.4 / 2.0
    normal = np.array([-sine, -math.sqrt(1.0 - sine * sine)])
    assert (planes.x[1, 0], planes.y[1, 0]) == pytest.approx(normal)
    assert planes.least[1, 0] == pytest.approx(normal[0] * 1.3 + 0.5 * 2.6 * sine)


def test_a_half_plane_off_the_arc_as_worked_out_by_hand() -> None:
    """4 m off, at rest: touching at the end of 2 s would take (4 - 0.4) / 2 m/s; each may take half of that."""
    place = np.array([[0.0, 0.0], [4.0, 0.0]])
    half = np.full((2, 2), 0.5)
    planes = reciprocal_half_planes(place, np.zeros((2, 2)), np.full(2, 0.2), BOTH, half, horizon=2.0, dt=0.1)
    assert (planes.x[1, 0], planes.y[1, 0]) == pytest.approx((-1.0, 0.0))
    assert planes.least[1, 0] == pytest.approx(-0.9)


def test_a_wall_allows_the_speed_that_meets_it_at_the_horizon() -> None:
    planes = wall_half_planes(np.array([[0.0, 0.8], [0.0, 0.15]]), np.full(2, 0.2), WALL, horizon=1.0, dt=0.1)
    assert planes.y[0] == pytest.approx((1.0, 1.0))
    assert planes.least[0] == pytest.approx((-0.6, 0.5))  # the second is 5 cm in it, and shall be out by the next look


@pytest.mark.parametrize("model", LAWS)
def test_laws_turn_with_the_people(model: str) -> None:
    walkers, turn = some_people(), np.array([[0.6, -0.8], [0.8, 0.6]])
    there = Scene(**{**vars(room()), "polygon": (), "walls": ()})
    names = ("position", "velocity", "desired_direction", "body_direction")
    turned = replace(walkers, **{name: getattr(walkers, name) @ turn.T for name in names})
    assert felt(model, turned, there) == pytest.approx(felt(model, walkers, there) @ turn.T, abs=1e-5)


@pytest.mark.parametrize("model", LAWS)
def test_laws_mirror_with_the_people_and_the_side(model: str) -> None:
    walkers, mirror = some_people(), np.array([-1.0, 1.0])
    names = ("position", "velocity", "desired_direction", "body_direction")
    mirrored = replace(walkers, **{name: getattr(walkers, name) * mirror for name in names})
    other_side = room(rules=Rules(side=-1))
    assert felt(model, mirrored, other_side) == pytest.approx(felt(model, walkers) * mirror, abs=1e-9)


@pytest.mark.parametrize("model", LAWS)
def test_nobody_minds_whom_they_do_not_weigh(model: str) -> None:
    walkers = some_people()
    weight = walkers.weight.copy()
    weight[2, :] = 0.0
    moved = walkers.position.copy()
    moved[2] = walkers.position[0] + 0.1
    alone, still_alone = (
        felt(model, replace(walkers, weight=weight, position=place)) for place in (walkers.position, moved)
    )
    others = [0, 1, 3, 4]
    assert np.array_equal(alone[others], still_alone[others])
    assert not np.allclose(alone[others], felt(model, replace(walkers, position=moved))[others])


@pytest.mark.parametrize("model", LAWS)
def test_people_in_one_place_and_in_walls_feel_finite_forces(model: str) -> None:
    walkers = some_people()
    place = np.zeros((6, 2))
    place[3:] = (4.0, 0.0)  # on the wall's line
    for velocity in (walkers.velocity, np.zeros((6, 2))):
        assert np.isfinite(felt(model, replace(walkers, position=place, velocity=velocity))).all()


@pytest.mark.parametrize("model", LAWS)
def test_a_lone_walker_reaches_the_desired_speed(model: str) -> None:
    own = walker(1, -3.0, 0.0, model=model, behaviour="walking", goals=((3.5, 0.0),), desired_speed=1.2)
    seen = watched(room([own], robot=Pose(-3.5, 3.5)), 3.0)
    assert math.hypot(*seen[-1].humans[0].velocity) == pytest.approx(1.2, abs=0.05)


def facing(model: str, side: int, y: float = 0.0) -> list[Array]:
    """Two who want to be where the other is: their places, tick by tick."""
    blind = {"model": model, "behaviour": "walking", "reacts_to_robot": 0.0}  # the robot is not mirrored
    pair = [walker(1, -3.0, y, goals=((3.5, y),), **blind), walker(2, 3.0, 0.0, math.pi, goals=((-3.5, 0.0),), **blind)]
    scene = room(pair, robot=Pose(0.0, 3.6), rules=Rules(side=side))  # type: ignore[arg-type]
    return [snapshot.humans.position for snapshot in watched(scene, 11.0)]


@pytest.mark.parametrize("model", LAWS)
def test_two_who_meet_head_on_pass_on_the_side_of_the_rules(model: str) -> None:
    passed = {side: facing(model, side) for side in (1, -1)}
    for side, places in passed.items():
        assert places[-1][0, 0] > 2.5
        assert places[-1][1, 0] < -2.5
        beside = min(places, key=lambda place: abs(float(place[0, 0] - place[1, 0])))
        assert side * (beside[1, 1] - beside[0, 1]) > 0.35  # to the right of one who walks along +x is -y
        assert min(np.linalg.norm(place[0] - place[1]) for place in places) > 0.39
    there, mirrored = (np.array(passed[side]) for side in (1, -1))
    assert mirrored == pytest.approx(there * [1.0, -1.0], abs=1e-6)


@pytest.mark.parametrize("model", LAWS)
def test_the_same_scene_gives_the_same_bits(model: str, busy: Scene) -> None:
    scene = replace(busy, humans=tuple(replace(human, model=model) for human in busy.humans))
    first, again = (np.array([s.humans.state for s in watched(scene, 4.0)]) for _ in range(2))
    assert np.array_equal(first, again)
    assert np.isfinite(first).all()


@pytest.mark.parametrize("model", ["helbing2000", "farina2017"])
def test_stiff_laws_are_asked_at_every_step_of_the_engine(model: str) -> None:
    assert pedestrian_model(model).evaluations == Rules().substeps


def test_headed_people_walk_where_they_face() -> None:
    own = walker(1, -3.0, -3.0, 2.0, model="farina2017", behaviour="walking", goals=((3.0, -3.0), (3.0, 3.0)))
    seen = watched(room([own], robot=Pose(-3.5, 3.5)), 12.0)
    slip = []
    for person in (snapshot.humans[0] for snapshot in seen):
        c, s = math.cos(person.pose.theta), math.sin(person.pose.theta)
        slip.append(abs(person.velocity[1] * c - person.velocity[0] * s))
    assert np.median(slip) < 0.02
    assert np.mean(np.array(slip) > 0.2) < 0.15  # while they turn
    assert np.linalg.norm(seen[-1].humans.position[0] - (3.0, 3.0)) < 0.5


def test_people_do_all_of_the_evasion_from_a_robot_under_orca() -> None:
    """One who does half would touch the robot, which stands in the way."""
    own = walker(1, -3.0, 0.05, model="orca2011", behaviour="walking", goals=((3.0, 0.05),))
    scene = room([own], robot=Pose(0.0, 0.0))
    world, crowd, gaps = World(scene), Crowd(scene), []
    for _ in range(50):
        snapshot = world.snapshot()
        gaps.append(np.linalg.norm(snapshot.humans.position[0]) - 0.5)
        world.step(Twist(), crowd.act(snapshot))
    assert min(gaps) > -0.002
    assert snapshot.humans.position[0, 0] > 2.0


@pytest.mark.parametrize("model", list(PEDESTRIAN_MODELS.built_in))
def test_the_robot_may_walk_by_any_law(model: str) -> None:
    people = [walker(1, 0.5, 0.3, behaviour="standing"), walker(2, 3.0, 1.0, math.pi, model=model)]
    people[0] = replace(people[0], model=model)
    assert Episode(room(people), SocialForce(model=model)).run().status == "goal"
    assert Episode(room(), SocialForce(model=model)).run().status == "goal"


def test_a_robot_is_told_of_an_unknown_law_and_restored_with_its_own() -> None:
    with pytest.raises(ValueError, match=r"no pedestrian model is named 'orca'; did you mean 'orca2011'"):
        SocialForce(model="orca")
    told = SocialForce(speed=0.7, model="helbing1995").settings()
    assert SocialForce.from_settings(told).settings() == told
    assert Orca.from_settings({}).settings()["model"] == "orca2011"


@pytest.mark.parametrize("substeps", [1, 4, 10])
def test_nobody_gets_faster_than_their_hurry_however_often_a_law_is_asked(substeps: int) -> None:
    """Two who start in one another's way, pushed apart by some 60 m/s2."""
    pair = [walker(k, 0.2 * k, 0.0, model="helbing2000", desired_speed=1.0) for k in (1, 2)]
    seen = watched(room(pair, robot=Pose(3.5, 3.5), rules=Rules(substeps=substeps)), 1.0)
    speed = np.array([np.linalg.norm(snapshot.humans.velocity, axis=1) for snapshot in seen])
    assert speed.max() < 1.3 + 0.3  # the engine parts bodies that overlap as well
