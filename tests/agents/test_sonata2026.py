"""The default pedestrian model: its terms compared with calculations by hand, and the motion of its pedestrians."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models import sonata2026
from sonata2d.agents.pedestrians.models.base import Walkers
from sonata2d.agents.pedestrians.models.sonata2026 import (
    AHEAD,
    ALIGNMENT,
    ANGLES,
    ASIDE,
    BRISK_PACE,
    CONTACT,
    FORMATION_TOLERANCE,
    MAXIMUM_ACCELERATION,
    MAXIMUM_BRAKING,
    MAXIMUM_GROUP_DISTANCE,
    MOVE_AHEAD,
    MOVE_ASIDE,
    PARAMETERS,
    SHUFFLE,
    SLOW_PACE,
    WAITING_LAG,
    WEIGHT,
    Memory,
    Sonata2026Model,
    anticipation_acceleration,
    contact_distance,
    desired_change,
    deviate,
    group_velocity,
    headway_reach,
    headway_speed,
    own_course,
    proximity_acceleration,
    steer,
    with_body,
)
from sonata2d.core.entities import Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene

from ..conftest import neighbour_lists, room
from .test_crowd import positions, rotated, simulate, two_rooms

GIVEN = PARAMETERS._replace(
    relaxation_time=0.3, turning_time=0.5, headway_half_width=0.4, standstill_gap=0.1, time_gap=1.0, matching_time=0.0,
    look_ahead_time=0.5, temperature=0.1, side_bonus=0.06, anticipation_strength=0.8,
    anticipation_length=0.3, proximity_strength=0.5, wall_strength=2.0, proximity_length=0.3, cohesion=0.2, spacing=0.9,
    wander=0.1, pace_deviation=0.0,
)  # fmt: skip
CORNER = Pose(-3.7, -3.7)
CONTACT_DISTANCE = 0.4
DISCS = (CONTACT_DISTANCE, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0)
NO_WALLS = np.zeros((0, 3))
EAST = (1.0, 0.0)
DIAGONAL = math.sqrt(0.5)


# Drive and body


def test_speed_and_direction_change_with_time_constants_of_their_own() -> None:
    assert desired_change((0.8, 0.2), EAST, 1.3, 0.0, 0.5, 0.4, 0.1) == pytest.approx((0.5 / 0.5, -0.2 / 0.4))
    assert desired_change((0.8, 0.2), EAST, 1.3, -1.5, 0.5, 0.4, 0.1) == pytest.approx((-0.5, -0.2 / 0.4))
    assert desired_change((0.0, 0.0), EAST, 1.3, 0.0, 0.01, 0.4, 0.1) == pytest.approx((MAXIMUM_ACCELERATION, 0.0))
    assert desired_change((1.3, 0.0), EAST, 0.0, 0.0, 0.01, 0.4, 0.1) == pytest.approx((-MAXIMUM_BRAKING, 0.0))
    assert desired_change((0.1, 0.0), EAST, 0.0, -3.0, 0.5, 0.4, 0.1) == pytest.approx((-0.1 / 0.1, 0.0))
    assert desired_change((0.5, 0.2), (0.0, 0.0), 1.3, 0.0, 0.5, 0.4, 0.1) == pytest.approx((-0.5 / 0.4, -0.2 / 0.4))


@pytest.mark.parametrize(
    ("angle", "pace", "course", "share"),
    [
        (0.0, 0.0, 0.0, 1.0),
        (40.0, BRISK_PACE, 40.0, 1.0),
        (60.0, BRISK_PACE, 45.0, 1.0),
        (90.0, BRISK_PACE, 45.0, 0.5),  # slows down, and walks as far to the left as its body permits
        (120.0, BRISK_PACE, 45.0, 0.0),
        (180.0, BRISK_PACE, 45.0, 0.0),
        (90.0, 0.0, 45.0, SHUFFLE),
        (180.0, SLOW_PACE, 45.0, 0.0),  # stands until the body has turned
        (90.0, (SLOW_PACE + BRISK_PACE) / 2, 45.0, (0.5 + SHUFFLE) / 2),
    ],
)
def test_a_body_that_faces_elsewhere_turns_first(angle: float, pace: float, course: float, share: float) -> None:
    x, y = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    expected = math.cos(math.radians(course)), math.sin(math.radians(course)), 1.2 * share
    assert with_body(EAST, x, y, 1.2, pace, 1.0, SHUFFLE) == pytest.approx(expected, abs=1e-9)
    if angle < 180.0:
        assert with_body(EAST, x, -y, 1.2, pace, -1.0, SHUFFLE) == pytest.approx(
            (expected[0], -expected[1], expected[2]), abs=1e-9
        )


def test_bodies_touch_by_their_depth_in_file_and_by_their_breadth_abreast() -> None:
    human, east, north = Human(1, Pose(0.0, 0.0)), (1.0, 0.0), (0.0, 1.0)
    pair = (2 * human.radius, human.shoulder, *east, human.shoulder, *east)
    assert contact_distance(*east, pair) == pytest.approx(2 * human.radius)
    assert contact_distance(*north, pair) == pytest.approx(human.breadth)
    turned = (2 * human.radius, human.shoulder, *east, human.shoulder, *north)
    assert contact_distance(*east, turned) == pytest.approx(human.radius + human.breadth / 2)


# Headway and steering


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
    for time_gap in (1.0, 0.5):
        found = headway_speed(x, y, CONTACT_DISTANCE, weight, time_gap, 1.0, 0.0, GIVEN)
        assert max(found, 0.0) == pytest.approx(speed / time_gap)


@pytest.mark.parametrize(
    ("gap", "pace", "speed"),
    [
        (1.0, 1.0, 1.0),  # at the same speed as without matching
        (0.5, 1.0, (0.5 + 2.0) / 3.0),  # slower than the one ahead, to widen the gap, but not half as slow
        (1.0, 0.5 * SLOW_PACE, (1.0 + 0.5 * SLOW_PACE) / 2.0),  # half of the matching time at half of the slow pace
        (1.0, 0.0, 1.0),  # no matching with a person who stands
        (1.0, -1.0, 1.0),  # or comes nearer
    ],
)
def test_walkers_match_the_speed_of_those_ahead(gap: float, pace: float, speed: float) -> None:
    ahead = gap + CONTACT_DISTANCE + GIVEN.standstill_gap
    assert headway_speed(ahead, 0.0, CONTACT_DISTANCE, 1.0, 1.0, pace, 2.0, GIVEN) == pytest.approx(speed)


def steered(ahead: float, left: float, cosine: float, side: float = 1.0) -> Array:
    """The direction (ahead, left) and the speed that a pedestrian chooses with another one in its path.

    Args:
        ahead, left: position of the other one, m.
        cosine: of the two desired directions.
        side: of the rules.
    """
    path = np.array([[ahead, -left, 0.0, 0.0, cosine, CONTACT_DISTANCE, 1.0]])
    return np.array(steer(path, NO_WALLS, EAST, 1.3, GIVEN.time_gap, side, GIVEN, np.empty(len(ANGLES))))


def test_a_free_path_is_walked_straight_at_the_desired_speed() -> None:
    assert steered(4.0, 0.0, 1.0).tolist() == [1.0, 0.0, 1.3]


def test_oncoming_pedestrians_are_passed_on_the_biased_side() -> None:
    ahead, left, speed = steered(1.0, 0.0, -1.0)
    assert left < -0.1
    assert speed > 0.4
    assert steered(1.0, 0.0, -1.0, side=-1.0) == pytest.approx((ahead, -left, speed))


def test_those_who_walk_as_fast_are_followed_and_slower_ones_are_overtaken() -> None:
    def course(pace: float) -> tuple[float, float, float]:
        path = np.array([[0.9, 0.0, pace * GIVEN.look_ahead_time, 0.0, 1.0, CONTACT_DISTANCE, 1.0]])
        return steer(path, NO_WALLS, EAST, 1.3, GIVEN.time_gap, 1.0, GIVEN, np.empty(len(ANGLES)))

    ahead, left, speed = course(1.8)
    assert (ahead, left) == pytest.approx((1.0, 0.0), abs=0.05)
    assert speed == pytest.approx(0.4, abs=0.1)  # (0.9 - 0.4 - 0.1) / 1
    assert course(0.2)[1] < -0.1  # to the side of the rules


def test_neighbours_out_of_reach_do_not_change_the_choice_of_direction_and_speed() -> None:
    random, value = np.random.default_rng(2), np.empty(len(ANGLES))
    held_up = 0
    for _ in range(2000):
        velocity, desired_speed = random.normal(scale=1.0, size=(3, 2)), random.uniform(0.0, 2.0)
        time_gap = PARAMETERS.time_gap * random.uniform(0.7, 1.4)
        # Two neighbours ahead, and one out of reach that comes nearer, mostly in one of the directions.
        far = headway_reach(CONTACT_DISTANCE, math.hypot(*velocity[2]), desired_speed, time_gap, PARAMETERS)
        distance = np.array([*random.uniform(0.4, 1.2, size=2), max(far, 0.0) * random.uniform(1.0001, 1.1)])
        angle = np.radians(random.choice(ANGLES, size=3)) + random.normal(scale=0.05, size=3)
        velocity[2] = -np.hypot(*velocity[2]) * np.array((math.cos(angle[2]), -math.sin(angle[2])))
        path = np.empty((3, 7))
        path[:, AHEAD], path[:, ASIDE] = distance * np.cos(angle), -distance * np.sin(angle)
        path[:, MOVE_AHEAD], path[:, MOVE_ASIDE] = velocity.T * PARAMETERS.look_ahead_time
        path[:, ALIGNMENT] = random.uniform(-1.0, 1.0, size=3)
        path[:, CONTACT], path[:, WEIGHT] = CONTACT_DISTANCE, random.choice((1.0, 0.4), size=3)
        own = EAST, desired_speed, time_gap, 1.0, PARAMETERS, value
        found = steer(path, NO_WALLS, *own)
        held_up += found != (*EAST, desired_speed)
        assert found == steer(path[:2], NO_WALLS, *own)
    assert held_up > 300


# Repulsion


def anticipation(x: float, y: float, velocity: Array, bonus: float = 0.0, side: float = 1.0) -> Array:
    """The anticipation term of two agents, (2, 2); the second one is at (x, y) relative to the first."""
    ux, uy = (velocity[1] - velocity[0]).tolist()
    parameters = GIVEN._replace(side_bonus=bonus)
    first = anticipation_acceleration(x, y, ux, uy, 1.0, DISCS, side, parameters)
    second = anticipation_acceleration(-x, -y, -ux, -uy, 1.0, DISCS, side, parameters)
    return np.array([first, second])


@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_anticipation_by_hand(speed: float) -> None:
    """Paths cross 2 m ahead of the first and 2.7 m of the second: closest half-way in between, 0.495 m apart."""
    found = anticipation(2.0, -2.7, speed * np.array([[1.0, 0.0], [0.0, 1.0]]))
    offset = np.array([2.0 - 2.35, -2.7 + 2.35])
    closing = min(speed * (2.0 + 2.7) / math.hypot(2.0, 2.7), 1.0)
    assert (closing == 1.0) == (speed == 1.0)  # m/s, from which on it counts in full
    size = closing * 0.8 * math.exp((CONTACT_DISTANCE - math.hypot(*offset)) / 0.3 - 2.35 / speed / 0.5)
    assert found[0] == pytest.approx(-size * offset / math.hypot(*offset), rel=1e-5)
    assert found[1] == pytest.approx(-found[0])


def test_pairs_that_separate_do_not_anticipate() -> None:
    assert np.abs(anticipation(1.0, 0.1, np.array([[-1.0, 0.0], [1.0, 0.0]]))).max() == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_head_on_encounters_are_evaded_to_the_side_of_the_rules(side: float) -> None:
    found = anticipation(3.0, 0.0, np.array([[1.0, 0.0], [-1.0, 0.0]]), bonus=0.06, side=side)
    assert found[0, 1] * side < 0.0
    assert found[1] == pytest.approx(-found[0])


def test_proximity_is_in_full_ahead_and_nothing_behind() -> None:
    for x, direction, share in ((0.7, EAST, 1.0), (-0.7, EAST, 0.0), (0.7, (0.0, 1.0), 0.5), (0.7, (0.0, 0.0), 0.5)):
        push = proximity_acceleration(x, 0.0, direction, 1.0, DISCS, GIVEN)
        assert push == pytest.approx((-share * 0.5 * math.exp(-1.0), 0.0), abs=1e-6)


# Groups and streams


def walkers_at(position: list[tuple[float, float]], velocity: list[tuple[float, float]], group: int = -1) -> Walkers:
    """Discs that head and face east, want to walk at 1.3 m/s, and attend to each other."""
    count = len(position)
    east, ones = np.tile(EAST, (count, 1)), np.ones(count)
    return Walkers(
        np.array(position), np.array(velocity), east, east, 1.3 * ones, CONTACT_DISTANCE / 2 * ones, ones > 0.0,
        **neighbour_lists(1.0 - np.eye(count)), group=np.full(count, group), is_abreast=ones > 0.0,
        shoulder=0.0 * ones, headway=ones, politeness=ones, heed=0.0 * ones, steering=np.zeros((len(ones), 2)),
    )  # fmt: skip


def test_members_of_a_group_that_lag_hurry_as_much_as_members_ahead_wait() -> None:
    def added(x: float, y: float, i: int, *, is_abreast: bool = True) -> tuple[float, float]:
        walkers = walkers_at([(0.0, 0.0), (x, y)], [(0.0, 0.0)] * 2, group=0)
        walkers.is_abreast[:] = is_abreast
        gx, gy, pace = group_velocity(walkers, i, np.zeros(2), 1.0, GIVEN)
        assert pace == 1.0
        return gx, gy

    assert added(0.3, 0.7, 0) == pytest.approx((0.0, 0.0))  # within a third of the spacing: abreast
    assert added(0.5, 0.7, 0) == pytest.approx((0.2 * 0.2, 0.0))
    assert added(0.5, 0.7, 1) == pytest.approx((-0.2 * 0.2, 0.0))
    assert added(0.5, 0.7, 0, is_abreast=False) == pytest.approx((0.0, 0.0))
    assert added(0.0, 0.5, 0) == pytest.approx((0.0, -0.2 * 0.1))  # nearer than two thirds of the spacing
    assert added(0.5, 0.0, 0)[1] == pytest.approx(-added(0.5, 0.0, 1)[1])  # in file: they go to different sides
    assert added(0.0, 1.4, 0) == pytest.approx((0.0, 0.2 * 0.5))  # half a metre farther than the spacing
    assert added(0.0, 9.0, 0) == pytest.approx((0.0, 0.2 * MAXIMUM_GROUP_DISTANCE))


def test_members_far_ahead_wait() -> None:
    def pace(ahead: float) -> float:
        walkers = walkers_at([(0.0, 0.0), (ahead, 0.0)], [(0.0, 0.0)] * 2, group=0)
        assert group_velocity(walkers, 0, np.zeros(2), 1.0, GIVEN)[2] == 1.0  # the one behind
        return group_velocity(walkers, 1, np.zeros(2), 1.0, GIVEN)[2]

    tolerance = FORMATION_TOLERANCE * GIVEN.spacing
    assert pace(tolerance + WAITING_LAG) == pytest.approx(1.0)
    assert pace(tolerance + 1.5 * WAITING_LAG) == pytest.approx(0.5)
    assert pace(tolerance + 2.0 * WAITING_LAG) == pytest.approx(0.0)


def test_nobody_evades_into_a_wall() -> None:
    """An oncoming person straight ahead is evaded to the right, the side of the rules, or to the left of a wall."""
    path = np.array([[0.8, 0.0, 0.0, 0.0, -1.0, CONTACT_DISTANCE, 1.0]])

    def course(walls: Array) -> float:
        return steer(path, walls, EAST, 1.3, GIVEN.time_gap, 1.0, GIVEN, np.empty(len(ANGLES)))[1]

    assert course(NO_WALLS) < -0.1
    assert course(np.array([[0.0, -1.0, 0.05]])) > 0.1


def test_a_group_keeps_half_of_the_looseness_with_which_it_comes() -> None:
    looseness = np.full(2, math.nan)
    came = walkers_at([(0.0, 0.0), (0.7, 0.7)], [(0.0, 0.0)] * 2, group=0)
    assert group_velocity(came, 0, looseness, 1.0, GIVEN) == (0.0, 0.0, 1.0)
    assert looseness[0] == pytest.approx(0.4)  # it is so much more than a third of the spacing behind
    assert math.isnan(looseness[1])
    assert group_velocity(came, 0, looseness, 1.0, GIVEN) == pytest.approx((0.2 * 0.2, 0.0, 1.0))


def test_walls_and_people_beside_turn_a_walker_and_do_not_slow_it_down(monkeypatch: pytest.MonkeyPatch) -> None:
    given = GIVEN._replace(wander=0.0, anticipation_strength=0.0)
    monkeypatch.setattr(sonata2026, "PARAMETERS", given)
    walkers = walkers_at([(0.0, 0.0), (0.3, 0.6)], [(1.3, 0.0)] * 2)
    push = Sonata2026Model(room()).acceleration(walkers)[0]
    distance = math.hypot(0.3, 0.6)
    size = 0.5 * (0.5 + 0.5 * 0.3 / distance) * math.exp((CONTACT_DISTANCE - distance) / 0.3)
    assert push == pytest.approx((0.0, -size * 0.6 / distance), abs=1e-6)


def test_deviations_fade_in_a_crowd_and_are_shared_by_a_group(monkeypatch: pytest.MonkeyPatch) -> None:
    given = GIVEN._replace(wander=0.1, pace_deviation=0.1, crowd=1.0)
    memory = Memory(np.zeros(2, np.int64), np.array([[1.0, 2.0], [-1.0, 0.5]]), np.zeros(2))
    pair = walkers_at([(0.0, 0.0), (0.0, 1.0)], [(0.0, 0.0)] * 2)
    share = 1.0 / (1.0 + math.exp(-1.0) ** 4)
    assert own_course(pair, 0, memory, given) == pytest.approx((0.1 * share, math.exp(0.2 * share)))
    group = walkers_at([(0.0, 0.0), (0.0, 1.0)], [(0.0, 0.0)] * 2, group=0)
    assert (
        own_course(group, 0, memory, given)
        == own_course(group, 1, memory, given)
        == pytest.approx((0.1, math.exp(0.2)))
    )


def test_deviations_have_mean_0_and_variance_1_and_last_for_their_time() -> None:
    lag = 10  # ticks
    memory, deviations = Memory(np.array([12345]), np.zeros((1, 2)), np.zeros(1)), np.empty((40_000, 2))
    for row in deviations:
        deviate(memory, 0, math.exp(-1.0 / lag))
        row[:] = memory.deviation[0]
    for deviation in deviations.T:
        assert deviation.mean() == pytest.approx(0.0, abs=0.1)
        assert deviation.var() == pytest.approx(1.0, abs=0.1)
        assert np.mean(deviation[lag:] * deviation[:-lag]) == pytest.approx(math.exp(-1.0), abs=0.1)
    assert np.mean(deviations[:, 0] * deviations[:, 1]) == pytest.approx(0.0, abs=0.1)


def test_each_pedestrian_deviates_in_its_own_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sonata2026, "PARAMETERS", PARAMETERS._replace(wander=0.1))
    humans = [Human(k, Pose(-3.5, y), behaviour="walking", goals=((3.5, y),)) for k, y in ((1, -3.0), (2, 3.0))]
    together = positions(simulate(room(humans, robot=CORNER), 3.0))
    alone = positions(simulate(room(humans[1:], robot=CORNER), 3.0))
    others = positions(simulate(room(humans, robot=CORNER, seed=1), 3.0))
    start = together[0, :, 1]
    assert np.abs(together[:, 0, 1] - start[0] - together[:, 1, 1] + start[1]).max() > 0.02
    assert np.abs(together[:, 1, 1] - others[:, 1, 1]).max() > 0.02
    assert together[:, 1] == pytest.approx(alone[:, 0], abs=1e-9)  # whoever else is there, out of range


# Motion


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


def test_the_page_of_the_models_has_the_parameters() -> None:
    page = (Path(__file__).parents[2] / "docs/models.md").read_text(encoding="utf-8")
    table = page[page.index("| drive | τ =") : page.index("Mirroring a scene and")]
    numbers = [float(number) for number in re.findall(r"(?:= |spacing )(-?[\d.]+)", table)]
    assert sorted(numbers) == sorted(PARAMETERS)
