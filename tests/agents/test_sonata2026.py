"""The default pedestrian model: its terms compared with calculations by hand, and the motion of its pedestrians."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models.base import Walkers
from sonata2d.agents.pedestrians.models.sonata2026 import (
    AHEAD,
    ALIGNMENT,
    ANGLES,
    ASIDE,
    CONTACT,
    MOVE_AHEAD,
    MOVE_ASIDE,
    PARAMETERS,
    WEIGHT,
    adaptive_acceleration,
    anticipation_acceleration,
    anticipation_reach,
    group_cohesion_acceleration,
    headway_reach,
    headway_speed,
    proximity_acceleration,
    proximity_reach,
    steer,
)
from sonata2d.core.entities import Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene

from ..conftest import neighbour_lists, room
from .test_crowd import positions, rotated, simulate, two_rooms

STEERING = PARAMETERS._replace(
    headway_half_width=0.4, standstill_gap=0.1, time_gap=1.0, look_ahead_time=0.5, side_bonus=0.06, habit_bonus=0.0,
    temperature=0.1,
)  # fmt: skip
CORNER = Pose(-3.7, -3.7)
CONTACT_DISTANCE = 0.4


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
def test_the_gap_ahead_determines_the_speed(x: float, y: float, weight: float, speed: float) -> None:
    assert max(headway_speed(x, y, CONTACT_DISTANCE, weight, STEERING), 0.0) == pytest.approx(speed)


def steered(ahead: float, left: float, cosine: float, side: float = 1.0, queueing: float = 1.0) -> Array:
    """The direction (ahead, left) and the speed that a pedestrian at rest chooses with another one in its path.

    Args:
        ahead, left: position of the other one, m.
        cosine: of the two desired directions.
        side: of the rules.
        queueing: the parameter.
    """
    path = np.array([[ahead, -left, 0.0, 0.0, cosine, CONTACT_DISTANCE, 1.0]])
    parameters = STEERING._replace(queueing=queueing)
    return np.array(steer(path, (1.0, 0.0), (0.0, 0.0), 1.3, side, parameters, np.empty(len(ANGLES))))


def test_a_free_path_is_walked_straight_at_the_desired_speed() -> None:
    assert steered(4.0, 0.0, 1.0).tolist() == [1.0, 0.0, 1.3]


def test_oncoming_pedestrians_are_passed_on_the_biased_side() -> None:
    ahead, left, speed = steered(1.0, 0.0, -1.0)
    assert left < -0.1
    assert speed > 0.4
    assert steered(1.0, 0.0, -1.0, side=-1.0) == pytest.approx((ahead, -left, speed))


def test_pedestrians_in_the_same_direction_are_followed_and_not_overtaken() -> None:
    ahead, left, speed = steered(1.0, 0.0, 1.0)
    assert (ahead, left) == pytest.approx((1.0, 0.0), abs=0.05)
    assert speed == pytest.approx(0.5, abs=0.1)  # (1 - 0.4 - 0.1) / 1
    assert abs(steered(1.0, 0.1, 1.0, queueing=0.0)[1]) > 0.3


def anticipation(x: float, y: float, velocity: Array, contact_distance: float, offset: float) -> Array:
    """The anticipation term of two agents, (2, 2); the second one is at (x, y) relative to the first."""
    parameters = PARAMETERS._replace(
        anticipation_strength=0.8, anticipation_decay_length=0.5, anticipation_decay_time=1.5,
        anticipation_offset=abs(offset),
    )  # fmt: skip
    ux, uy = (velocity[1] - velocity[0]).tolist()
    side = math.copysign(1.0, offset)
    first = anticipation_acceleration(x, y, ux, uy, 1.0, contact_distance, side, parameters)
    second = anticipation_acceleration(-x, -y, -ux, -uy, 1.0, contact_distance, side, parameters)
    return np.array([first, second])


def test_anticipation_by_hand() -> None:
    """At 1 m/s each, paths cross 2 m ahead of the first and 2.5 m of the second: closest in 2.25 s, 0.354 m apart."""
    found = anticipation(2.0, -2.5, np.array([[1.0, 0.0], [0.0, 1.0]]), CONTACT_DISTANCE / 2, 0.0)
    t = 2.25
    offset = np.array([2.0 - t, -2.5 + t])
    closing = (2.0 + 2.5) / math.hypot(2.0, 2.5)
    assert closing > 1.0  # m/s: counts in full
    size = 0.8 * math.exp((0.2 - math.hypot(*offset)) / 0.5 - t / 1.5)
    assert found[0] == pytest.approx(-size * offset / math.hypot(*offset), abs=1e-6)
    assert found[1] == pytest.approx(-found[0])


EAST_AND_WEST = np.array([[1.0, 0.0], [-1.0, 0.0]])


def test_pairs_that_separate_do_not_anticipate() -> None:
    assert np.abs(anticipation(1.0, 0.0, -EAST_AND_WEST, CONTACT_DISTANCE, 0.05)).max() == 0.0


@pytest.mark.parametrize("offset", [0.05, -0.05])
def test_head_on_encounters_are_evaded_to_the_biased_side(offset: float) -> None:
    found = anticipation(3.0, 0.0, EAST_AND_WEST, CONTACT_DISTANCE, offset)
    assert found[0, 1] * offset < 0.0
    assert found[1, 1] * offset > 0.0


def test_proximity_by_hand() -> None:
    parameters = PARAMETERS._replace(proximity_strength=0.5, proximity_decay_length=0.3, anisotropy=0.2)
    before, behind = (
        proximity_acceleration(x, 0.0, (1.0, 0.0), 1.0, CONTACT_DISTANCE, parameters) for x in (0.7, -0.7)
    )
    assert before == pytest.approx((-0.5 * math.exp(-1.0), 0.0), abs=1e-6)
    assert behind == pytest.approx((0.2 * 0.5 * math.exp(-1.0), 0.0), abs=1e-6)


def test_neighbours_out_of_reach_contribute_next_to_nothing() -> None:
    random = np.random.default_rng(1)
    for _ in range(1000):
        angle, (ux, uy) = random.uniform(-math.pi, math.pi), random.normal(scale=2.0, size=2)
        ahead, left, beyond = math.cos(angle), math.sin(angle), random.uniform(1.000001, 1.2)
        reach = beyond * anticipation_reach(CONTACT_DISTANCE, math.hypot(ux, uy), PARAMETERS)
        pair = ahead * reach, left * reach, ux, uy, 1.0, CONTACT_DISTANCE, 1.0, PARAMETERS
        assert anticipation_acceleration(*pair) == pytest.approx((0.0, 0.0), abs=1e-5)
        reach = beyond * proximity_reach(CONTACT_DISTANCE, PARAMETERS)
        found = proximity_acceleration(ahead * reach, left * reach, (1.0, 0.0), 1.0, CONTACT_DISTANCE, PARAMETERS)
        assert found == pytest.approx((0.0, 0.0), abs=1e-5)


def test_neighbours_out_of_reach_do_not_change_the_choice_of_direction_and_speed() -> None:
    random, value = np.random.default_rng(2), np.empty(len(ANGLES))
    held_up = 0
    for _ in range(2000):
        velocity, desired_speed = random.normal(scale=1.0, size=(4, 2)), random.uniform(0.0, 2.0)
        # Two neighbours ahead, and one out of reach that comes nearer, mostly in one of the directions.
        far = headway_reach(CONTACT_DISTANCE, math.hypot(*velocity[2]), desired_speed, PARAMETERS)
        distance = np.array([*random.uniform(0.4, 1.2, size=2), max(far, 0.0) * random.uniform(1.0001, 1.1)])
        angle = np.radians(random.choice(ANGLES, size=3)) + random.normal(scale=0.05, size=3)
        velocity[2] = -np.hypot(*velocity[2]) * np.array((math.cos(angle[2]), -math.sin(angle[2])))
        path = np.empty((3, 7))
        path[:, AHEAD], path[:, ASIDE] = distance * np.cos(angle), -distance * np.sin(angle)
        path[:, MOVE_AHEAD], path[:, MOVE_ASIDE] = velocity[:3].T * PARAMETERS.look_ahead_time
        path[:, ALIGNMENT] = random.uniform(-1.0, 1.0, size=3)
        path[:, CONTACT], path[:, WEIGHT] = CONTACT_DISTANCE, random.choice((1.0, 0.4), size=3)
        own = (1.0, 0.0), (float(velocity[3, 0]), float(velocity[3, 1])), desired_speed, 1.0, PARAMETERS, value
        found = steer(path, *own)
        held_up += found != (1.0, 0.0, desired_speed)
        assert found == steer(path[:2], *own)
    assert held_up > 300


def test_pedestrians_start_at_once_and_follow_smoothly() -> None:
    starting, walking, following = (
        adaptive_acceleration((vx, 0.0), (1.0, 0.0), permitted, 1.3, PARAMETERS)
        for vx, permitted in ((0.0, 0.5), (1.0, 1.3), (1.0, 0.9))
    )
    assert starting[0] == pytest.approx(0.5 / 0.16)
    assert walking[0] == pytest.approx(0.3 / 0.61)
    assert following[0] == pytest.approx(-0.1 / 2.0)
    assert adaptive_acceleration((0.5, 0.2), (1.0, 0.0), 0.5, 0.5, PARAMETERS)[1] == pytest.approx(-0.2 / 0.36)


def test_group_members_behind_accelerate_as_much_as_members_ahead_slow_down() -> None:
    parameters = PARAMETERS._replace(cohesion=0.2, spacing=0.9, abreast=0.1)
    east, none, lists = np.tile([1.0, 0.0], (2, 1)), np.zeros((2, 2)), neighbour_lists(1.0 - np.eye(2))

    def cohesion(x: float, y: float, i: int) -> tuple[float, float]:
        position, ones = np.array([[0.0, 0.0], [x, y]]), np.ones(2)
        group = np.zeros(2, dtype=np.int64)
        walkers = Walkers(position, none, east, east, ones, ones, ones > 0.0, **lists, group=group, bond=ones)
        return group_cohesion_acceleration(walkers, i, parameters)

    assert cohesion(0.6, 0.5, 0) == pytest.approx((0.06, 0.0))
    assert cohesion(0.6, 0.5, 1) == pytest.approx((-0.06, 0.0))
    assert cohesion(0.0, 1.4, 0) == pytest.approx((0.0, 0.1))


def crossing(side: int = 1) -> Scene:
    """Eight pedestrians on a circle, each with its goal on the opposite side."""
    humans = []
    for k in range(8):
        x, y = 3.4 * math.cos(0.8 * k), 3.4 * math.sin(0.8 * k)
        human = Human(k + 1, Pose(x, y), desired_speed=1.0 + 0.07 * k, behaviour="walking", goals=((-x, -y),))
        humans.append(human)
    return room(humans, robot=Pose(3.7, 3.7), rules=Rules(side=side))  # type: ignore[arg-type]


def mirrored(scene: Scene) -> Scene:
    """The scene mirrored at the x axis."""
    humans = tuple(
        replace(h, pose=Pose(h.pose.x, -h.pose.y, -h.pose.theta), goals=tuple((x, -y) for x, y in h.goals))
        for h in scene.humans
    )
    return replace(scene, humans=humans, robot=replace(scene.robot, pose=Pose(scene.robot.pose.x, -scene.robot.pose.y)))


def test_motion_rotates_and_mirrors_with_the_scene() -> None:
    path = positions(simulate(crossing(), 6.0))
    assert np.abs(path[-1] - path[0]).max() > 4.0
    turned = positions(simulate(rotated(crossing(), 0, 1), 6.0))
    assert turned == pytest.approx(np.stack((-path[..., 1], path[..., 0]), axis=-1), abs=1e-4)
    image = positions(simulate(mirrored(crossing(-1)), 6.0))
    assert image == pytest.approx(path * [1.0, -1.0], abs=1e-4)


def through_the_door(number: int, x: float, y: float) -> Human:
    """A pedestrian whose goal is in the other room."""
    side = math.copysign(1.0, x)
    return Human(number, Pose(x, y), behaviour="walking", goals=((-3.0 * side, 0.3 * y),), reacts_to_robot=0.0)


@pytest.mark.parametrize("width", [1.0, 1.2])
def test_opposing_pedestrians_do_not_block_a_doorway(width: float) -> None:
    left = [through_the_door(k + 1, -1.0 - 0.7 * (k // 3), 1.0 * (k % 3) - 1.0) for k in range(5)]
    right = [through_the_door(k + 6, 1.0 + 0.7 * (k // 3), 1.1 * (k % 3) - 1.1) for k in range(5)]
    last = positions(simulate(two_rooms(width, left + right, robot=CORNER), 40.0))[-1]
    assert (last[:5, 0] > 0.5).all()
    assert (last[5:, 0] < -0.5).all()


def test_a_queue_at_a_door_resolves_completely() -> None:
    humans = [through_the_door(k + 1, -0.8 - 0.6 * (k // 5), 0.8 * (k % 5) - 1.6) for k in range(20)]
    path = positions(simulate(two_rooms(0.9, humans, robot=CORNER), 40.0))
    assert (path[-1, :, 0] > 0.5).all()
    assert (path[50, :, 0] < 0.0).any()  # after 5 s some still wait


def test_a_walking_group_stays_together_and_keeps_its_speed() -> None:
    humans = [
        Human(k + 1, Pose(-3.0, 0.8 * k - 0.8), behaviour="walking", desired_speed=1.1, group=1,
              goals=((3.0, 0.8 * k - 0.8),), velocity=(1.1, 0.0))
        for k in range(3)
    ]  # fmt: skip
    path = positions(simulate(room(humans, groups=(Group(1, "walking", (1, 2, 3)),), robot=Pose(3.7, 3.7)), 4.0))
    distances = np.linalg.norm(np.diff(path, axis=1), axis=2)
    assert (distances > 0.6).all()
    assert (distances < 1.2).all()
    assert (path[-1, :, 0] - path[0, :, 0]) / 3.9 == pytest.approx([1.1] * 3, abs=0.1)
