"""The laws: what turning, mirroring and hand calculation say of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models.base import (
    Sight,
    desired_acceleration,
    standing_acceleration,
    wall_acceleration,
)
from sonata2d.agents.pedestrians.models.moussaid2009 import (
    Moussaid2009,
    Moussaid2010,
    bulk_of,
    group_acceleration,
    interaction_acceleration,
)
from sonata2d.core.entities import Wall
from sonata2d.core.geometry import Barriers
from sonata2d.core.portable_math import Array

from ..conftest import L_SHAPE, room

LAW = Moussaid2009()


def everybody(count: int) -> Array:
    return 1.0 - np.eye(count)


def some_people(seed: int = 0, count: int = 6) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (count, 2)), rng.uniform(-1.5, 1.5, (count, 2))


def test_interaction_as_worked_out_by_hand() -> None:
    """Two people 1 m apart, side by side, one walking at 1 m/s across the other's front: D = (2, 0) + (0, 1)."""
    place, velocity = np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    d = math.sqrt(5.0)
    t, reach = np.array([2.0, 1.0]) / d, 0.35 * d
    theta = math.atan2(t[0] * 1.0 - t[1] * 0.0, t[1]) + 0.005 * reach
    decay = math.exp(-1.0 / reach)
    left = np.array([-t[1], t[0]])
    by_hand = -4.5 * decay * (math.exp(-((3 * reach * theta) ** 2)) * t + math.exp(-((2 * reach * theta) ** 2)) * left)
    felt = interaction_acceleration(place, velocity, everybody(2), np.zeros((2, 2)), 1, LAW)
    assert felt[0] == pytest.approx(by_hand, abs=1e-6)


def test_a_bulky_robot_is_felt_from_further_off() -> None:
    place, velocity = np.array([[0.0, 0.0], [1.5, 0.0]]), np.array([[1.3, 0.0], [0.0, 0.0]])
    felt = {
        r: interaction_acceleration(place, velocity, everybody(2), bulk_of(np.array([0.2, r])), 1, LAW)
        for r in (0.2, 0.4)
    }
    nearer = interaction_acceleration(place * (1.3 / 1.5), velocity, everybody(2), np.zeros((2, 2)), 1, LAW)
    assert felt[0.4][0] == pytest.approx(nearer[0])
    assert np.linalg.norm(felt[0.4][0]) > np.linalg.norm(felt[0.2][0])


def test_interaction_turns_with_the_scene() -> None:
    place, velocity = some_people()
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    felt = interaction_acceleration(place, velocity, everybody(6), np.zeros((6, 6)), 1, LAW)
    turned = interaction_acceleration(place @ turn.T, velocity @ turn.T, everybody(6), np.zeros((6, 6)), 1, LAW)
    assert turned == pytest.approx(felt @ turn.T, abs=1e-6)


def test_interaction_mirrors_with_the_scene_and_its_side() -> None:
    place, velocity = some_people()
    mirror = np.array([-1.0, 1.0])
    felt = interaction_acceleration(place, velocity, everybody(6), np.zeros((6, 6)), 1, LAW)
    mirrored = interaction_acceleration(place * mirror, velocity * mirror, everybody(6), np.zeros((6, 6)), -1, LAW)
    assert mirrored == pytest.approx(felt * mirror, abs=1e-9)


@pytest.mark.parametrize("side", [1, -1])
def test_who_meets_head_on_evades_to_the_biased_side(side: int) -> None:
    place, velocity = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([[1.3, 0.0], [-1.3, 0.0]])
    felt = interaction_acceleration(place, velocity, everybody(2), np.zeros((2, 2)), side, LAW)
    assert felt[0, 1] * side < 0.0  # to the right of one who walks along +x is -y
    assert felt[1, 1] * side > 0.0


def test_nobody_minds_whom_they_do_not_weigh() -> None:
    place, velocity = some_people()
    weight = everybody(6)
    weight[2, :] = 0.0  # nobody minds person 2
    felt = interaction_acceleration(place, velocity, weight, np.zeros((6, 6)), 1, LAW)
    moved = place.copy()
    moved[2] += 0.5
    again = interaction_acceleration(moved, velocity, weight, np.zeros((6, 6)), 1, LAW)
    others = [0, 1, 3, 4, 5]
    assert np.array_equal(felt[others], again[others])


def test_drive_closes_the_lag_in_the_relaxation_time() -> None:
    felt = desired_acceleration(np.array([[0.5, 0.0]]), np.array([[1.0, 0.0]]), np.array([1.3]), relaxation_time=0.5)
    assert felt[0] == pytest.approx((1.6, 0.0))
    with pytest.raises(ValueError, match="positive"):
        desired_acceleration(felt, felt, np.array([1.3]), relaxation_time=0.0)


def test_who_stands_comes_back_without_swinging() -> None:
    place, velocity = np.array([[0.3, 0.0]]), np.zeros((1, 2))
    for _ in range(400):
        velocity = velocity + 0.01 * standing_acceleration(place, velocity, np.zeros((1, 2)))
        place = place + 0.01 * velocity
        assert place[0, 0] > -1e-3
    assert place[0, 0] < 0.01


def test_walls_push_straight_away_and_by_the_gap() -> None:
    wall = Barriers.of([((-5.0, 0.0), (5.0, 0.0), 0.0)])
    place, radius = np.array([[0.0, 0.3], [1.0, -0.5]]), np.array([0.2, 0.2])
    felt = wall_acceleration(place, radius, wall, strength=3.0, reach=0.1)
    assert felt[0] == pytest.approx((0.0, 3.0 * math.exp(-1.0)), abs=1e-6)
    assert felt[1] == pytest.approx((0.0, -3.0 * math.exp(-3.0)), abs=1e-6)


def test_walls_hide_people_from_one_another() -> None:
    scene = room(polygon=L_SHAPE, inner=[Wall((-4.0, -2.0), (-1.0, -2.0))])
    place = np.array([[-3.0, 3.0], [3.0, -0.5], [-3.0, -1.0], [-3.0, -3.0]])
    seen = Sight(scene, 4).seen(place)
    assert not seen[0, 1]  # round the corner of the L
    assert seen[0, 2]
    assert not seen[2, 3]  # through the inner wall
    assert np.array_equal(seen, seen.T)


def test_a_square_room_hides_nobody() -> None:
    assert Sight(room(), 2).seen(np.array([[-3.0, -3.0], [3.0, 3.0]])).all()


def test_a_pair_far_apart_closes_up_and_waits() -> None:
    place = np.array([[0.0, 0.0], [-2.0, 0.0], [5.0, 5.0]])
    velocity, looking = np.tile([[1.0, 0.0]], (3, 1)), np.tile([[1.0, 0.0]], (3, 1))
    member = np.zeros((3, 3))
    member[0, 1] = member[1, 0] = 1.0
    felt = group_acceleration(place, velocity, looking, member, Moussaid2010())
    assert felt[0, 0] == pytest.approx(-4.0 - 3.0)  # brakes for the one behind, and is pulled back
    assert felt[1, 0] == pytest.approx(3.0)
    assert felt[2].tolist() == [0.0, 0.0]
