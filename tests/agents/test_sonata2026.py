"""The default walking model: its forces as worked out by hand, and what its people do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models.base import Walkers, pedestrian_model
from sonata2d.agents.pedestrians.models.sonata2026 import (
    Choice,
    Strip,
    anticipation_acceleration,
    company_acceleration,
    free_speed,
    nearness_acceleration,
    steered,
)
from sonata2d.core.entities import Group, Human, Wall
from sonata2d.core.geometry import Pose
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene

from ..conftest import room
from .test_crowd import turned, watched

STRIP = Strip(breadth=0.4, distance=0.1, time=1.0)


def pair(x: float, y: float) -> tuple[Array, Array]:
    """dx and dy of two: the second is at (x, y) from the first; entry [j, i] leads from i to j."""
    return np.array([[0.0, -x], [x, 0.0]]), np.array([[0.0, -y], [y, 0.0]])


OTHERS, TOUCHING = 1.0 - np.eye(2), np.full((2, 2), 0.4)
EAST_AND_WEST, BOTH_EAST = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([[1.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize(
    ("x", "y", "weight", "speed"),
    [
        (2.0, 0.0, 1.0, 1.5),  # (2 - 0.4 - 0.1) / 1
        (2.0, 0.2, 1.0, 1.6),  # half-way to the edge of the strip counts 15/16
        (2.0, 0.0, 0.5, 3.0),
        (2.0, 0.4, 1.0, math.inf),
        (-2.0, 0.0, 1.0, math.inf),
        (0.45, 0.0, 1.0, 0.0),
    ],
)
def test_the_gap_ahead_sets_the_speed(x: float, y: float, weight: float, speed: float) -> None:
    dx, dy = pair(x, y)
    assert free_speed(dx, dy, TOUCHING, weight * OTHERS, STRIP)[0] == pytest.approx(speed)


def way_of(x: float, y: float, direction: Array, side: float = 0.06, queueing: float = 1.0) -> tuple[Array, Array]:
    dx, dy = pair(x, y)
    choice = Choice(outlook=0.5, side=side, habit=0.0, decision=0.1, queueing=queueing)
    speed = np.array([1.3, 1.3])
    return steered(dx, dy, 0.0 * direction, direction, speed, TOUCHING, OTHERS, choice=choice, strip=STRIP)


def test_a_free_way_is_gone_straight_at_the_desired_speed() -> None:
    way, speed = way_of(4.0, 0.0, BOTH_EAST)
    assert np.array_equal(way, BOTH_EAST)
    assert speed.tolist() == [1.3, 1.3]


def test_who_comes_against_one_is_passed_on_the_biased_side_and_mirrors() -> None:
    way, speed = way_of(1.0, 0.0, EAST_AND_WEST)
    assert way[0, 1] < -0.1  # to the right of one who goes east
    assert way[1, 1] > 0.1
    assert (speed > 0.4).all()
    mirrored, _ = way_of(1.0, 0.0, EAST_AND_WEST, side=-0.06)
    assert mirrored == pytest.approx(way * [1.0, -1.0])


def test_who_goes_the_same_way_is_followed_not_walked_round() -> None:
    way, speed = way_of(1.0, 0.0, BOTH_EAST)
    assert way[0] == pytest.approx((1.0, 0.0), abs=0.05)
    assert speed[0] == pytest.approx(0.5, abs=0.1)  # (1 - 0.4 - 0.1) / 1
    overtaking, _ = way_of(1.0, 0.1, BOTH_EAST, queueing=0.0)
    assert abs(overtaking[0, 1]) > 0.3


def test_anticipation_as_worked_out_by_hand() -> None:
    """Both walk at 1 m/s and would meet 2 m ahead of one and 2.5 m of the other: nearest in 2.25 s, 0.354 m apart."""
    dx, dy = pair(2.0, -2.5)
    velocity = np.array([[1.0, 0.0], [0.0, 1.0]])
    felt = anticipation_acceleration(
        dx, dy, velocity, OTHERS, TOUCHING / 2, strength=0.8, reach=0.5, horizon=1.5, side=0.0
    )
    t = 2.25
    apart = np.array([2.0 - t, -2.5 + t])
    closing = (2.0 + 2.5) / math.hypot(2.0, 2.5)  # more than 1 m/s: counts in full
    assert closing > 1.0
    near = 0.8 * math.exp((0.2 - math.hypot(*apart)) / 0.5 - t / 1.5)
    assert felt[0] == pytest.approx(-near * apart / math.hypot(*apart), abs=1e-6)
    assert felt[1] == pytest.approx(-felt[0])


def test_nobody_gives_way_to_whom_they_leave_behind() -> None:
    dx, dy = pair(1.0, 0.0)
    felt = anticipation_acceleration(
        dx, dy, -EAST_AND_WEST, OTHERS, TOUCHING, strength=0.8, reach=0.5, horizon=1.5, side=0.05
    )
    assert np.abs(felt).max() == 0.0


@pytest.mark.parametrize("side", [0.05, -0.05])
def test_who_meets_head_on_gives_way_to_the_biased_side(side: float) -> None:
    dx, dy = pair(3.0, 0.0)
    felt = anticipation_acceleration(
        dx, dy, EAST_AND_WEST, OTHERS, TOUCHING, strength=0.8, reach=0.5, horizon=1.5, side=side
    )
    assert felt[0, 1] * side < 0.0
    assert felt[1, 1] * side > 0.0


def test_nearness_as_worked_out_by_hand() -> None:
    dx, dy = pair(0.7, 0.0)
    felt = nearness_acceleration(dx, dy, BOTH_EAST, OTHERS, TOUCHING, strength=0.5, reach=0.3, anisotropy=0.2)
    assert felt[0] == pytest.approx((-0.5 * math.exp(-1.0), 0.0), abs=1e-6)
    assert felt[1] == pytest.approx((0.2 * 0.5 * math.exp(-1.0), 0.0), abs=1e-6)  # it is behind


def test_who_is_behind_hurries_as_much_as_who_is_ahead_waits() -> None:
    dx, dy = pair(0.6, 0.5)
    felt = company_acceleration(dx, dy, BOTH_EAST, OTHERS, np.ones(2), cohesion=0.2, spacing=0.9, abreast=0.1)
    assert felt[0] == pytest.approx((0.06, 0.0))
    assert felt[1] == pytest.approx((-0.06, 0.0))
    dx, dy = pair(0.0, 1.4)
    felt = company_acceleration(dx, dy, BOTH_EAST, OTHERS, np.ones(2), cohesion=0.2, spacing=0.9, abreast=0.1)
    assert felt[0] == pytest.approx((0.0, 0.1))


def some_people(count: int = 12) -> Walkers:
    rng = np.random.default_rng(3)
    angle = rng.uniform(-3.0, 3.0, count)
    direction = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    member = np.zeros((count, count))
    member[0, 1] = member[1, 0] = 1.0
    return Walkers(
        position=rng.uniform(-2.0, 2.0, (count, 2)), velocity=rng.uniform(-1.0, 1.0, (count, 2)),
        desired_direction=direction, body_direction=direction,
        desired_speed=np.full(count, 1.3), radius=np.full(count, 0.2),
        weight=1.0 - np.eye(count), member=member, bond=np.full(count, 0.5),
    )  # fmt: skip


def felt_by(people: Walkers, side: int = 1) -> Array:
    """In a room far larger than they are, so that turning it changes nothing."""
    far = ((-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0))
    humans = [Human(k + 1, Pose(0.0, 0.0)) for k in range(len(people.position) - 1)]
    scene = room(humans, polygon=far, rules=Rules(side=side))  # type: ignore[arg-type]
    return pedestrian_model("sonata2026")(scene).acceleration(people)


def moved(people: Walkers, by: Array) -> Walkers:
    names = ("position", "velocity", "desired_direction", "body_direction")
    return replace(people, **{name: getattr(people, name) @ by.T for name in names})


def test_what_people_feel_turns_and_mirrors_with_them() -> None:
    people = some_people()
    felt = felt_by(people)
    turn, mirror = np.array([[0.6, -0.8], [0.8, 0.6]]), np.diag([1.0, -1.0])
    assert felt_by(moved(people, turn)) == pytest.approx(felt @ turn.T, abs=1e-6)
    assert felt_by(moved(people, mirror), side=-1) == pytest.approx(felt @ mirror, abs=1e-9)
    assert np.abs(felt_by(moved(people, mirror), side=1) - felt @ mirror).max() > 1e-3


def test_nobody_feels_whom_they_do_not_weigh() -> None:
    people = some_people()
    weight = people.weight.copy()
    weight[5, :] = 0.0
    elsewhere = people.position.copy()
    elsewhere[5] += 0.7
    felt = felt_by(replace(people, weight=weight))
    again = felt_by(replace(people, weight=weight, position=elsewhere))
    assert np.array_equal(np.delete(felt, 5, axis=0), np.delete(again, 5, axis=0))


def crossing(side: int = 1) -> Scene:
    """Eight people from all sides, each with a goal on the other."""
    people = []
    for k in range(8):
        x, y = 3.4 * math.cos(0.8 * k), 3.4 * math.sin(0.8 * k)
        human = Human(k + 1, Pose(x, y), desired_speed=1.0 + 0.07 * k, behaviour="walking", goals=((-x, -y),))
        people.append(human)
    return room(people, robot=Pose(3.7, 3.7), rules=Rules(side=side))  # type: ignore[arg-type]


def mirrored(scene: Scene) -> Scene:
    people = tuple(
        replace(h, pose=Pose(h.pose.x, -h.pose.y, -h.pose.theta), goals=tuple((x, -y) for x, y in h.goals))
        for h in scene.humans
    )
    robot = replace(scene.robot, pose=Pose(scene.robot.pose.x, -scene.robot.pose.y))
    return replace(scene, humans=people, robot=robot)


def test_motion_turns_and_mirrors_with_the_scene() -> None:
    places = np.array([s.humans.position for s in watched(crossing(), 6.0)])
    assert np.abs(places[-1] - places[0]).max() > 4.0
    quarter = turned(crossing(), 0, 1)
    people = tuple(replace(h, goals=tuple((-y, x) for x, y in h.goals)) for h in quarter.humans)
    again = np.array([s.humans.position for s in watched(replace(quarter, humans=people), 6.0)])
    assert again == pytest.approx(np.stack((-places[..., 1], places[..., 0]), axis=-1), abs=1e-4)
    image = np.array([s.humans.position for s in watched(mirrored(crossing(-1)), 6.0)])
    assert image == pytest.approx(places * [1.0, -1.0], abs=1e-4)


def two_rooms(width: float, people: list[Human]) -> Scene:
    inner = [Wall((0.0, -4.0), (0.0, -width / 2)), Wall((0.0, width / 2), (0.0, 4.0))]
    return room(people, inner=inner, robot=Pose(-3.7, -3.7))


def through(number: int, x: float, y: float) -> Human:
    side = math.copysign(1.0, x)
    return Human(number, Pose(x, y), behaviour="walking", goals=((-3.0 * side, 0.3 * y),), reacts_to_robot=0.0)


@pytest.mark.parametrize("width", [1.0, 1.2])
def test_opposing_people_do_not_block_a_doorway(width: float) -> None:
    left = [through(k + 1, -1.0 - 0.7 * (k // 3), 1.0 * (k % 3) - 1.0) for k in range(5)]
    right = [through(k + 6, 1.0 + 0.7 * (k // 3), 1.1 * (k % 3) - 1.1) for k in range(5)]
    last = watched(two_rooms(width, left + right), 40.0)[-1].humans.position
    assert (last[:5, 0] > 0.5).all()
    assert (last[5:, 0] < -0.5).all()


def test_a_queue_at_a_door_resolves_to_the_last_one() -> None:
    people = [through(k + 1, -0.8 - 0.6 * (k // 5), 0.8 * (k % 5) - 1.6) for k in range(20)]
    seen = watched(two_rooms(0.9, people), 40.0)
    assert (seen[-1].humans.position[:, 0] > 0.5).all()
    assert (seen[50].humans.position[:, 0] < 0.0).any()  # there was a queue


def test_a_walking_group_keeps_together_and_its_pace() -> None:
    people = [
        Human(k + 1, Pose(-3.0, 0.8 * k - 0.8), behaviour="walking", desired_speed=1.1, group=1,
              goals=((3.0, 0.8 * k - 0.8),), velocity=(1.1, 0.0))
        for k in range(3)
    ]  # fmt: skip
    seen = watched(room(people, groups=(Group(1, "walking", (1, 2, 3)),), robot=Pose(3.7, 3.7)), 4.0)
    places = np.array([s.humans.position for s in seen])
    gaps = np.linalg.norm(np.diff(places, axis=1), axis=2)
    assert (gaps > 0.6).all()
    assert (gaps < 1.2).all()
    assert (places[-1, :, 0] - places[0, :, 0]) / 3.9 == pytest.approx([1.1] * 3, abs=0.1)
