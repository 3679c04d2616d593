"""What others mean by the same names, worked out by hand on the same runs as our own."""

from __future__ import annotations

import math

import pytest

from sonata2d.core.entities import Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.metrics.catalogue import ALL, METRICS
from sonata2d.metrics.interop import VARIANTS

from ..conftest import room
from .samples import Places, line, stay, value

ONE = room([Human(1, Pose(0.0, 0.0), 0.2)])
AWAY = [[[x, 0.0, 0.0] for x in (0.4, 0.8, 1.05, 1.5, 4.0, 4.2)]]  # between centres; our d is 0.5 m less
STILL = stay(0.0, 0.0, 6)
JOLT = [[x, 0.0, 0.0] for x in (0.0, 0.0, 0.1, 0.4, 0.7)]  # 0, 0, 1, 3, 3 m/s


def test_every_variant_names_the_metric_of_ours_that_it_differs_from() -> None:
    assert all(variant.variant_of in METRICS for variant in VARIANTS)
    assert len(ALL) == len(METRICS) + len(VARIANTS)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("socnavgym.personal_space_compliance", 5 / 6),  # ours 4 / 6
        ("socnavgym.minimum_distance_to_human", 0.4),  # ours 0
        ("socnavgym.minimum_obstacle_distance", 4.0),  # ours 3.7
        ("hunavsim.intimate_space_intrusions", 100 * 2 / 6),
        ("hunavsim.personal_space_intrusions", 100 * 2 / 6),
        ("hunavsim.social_space_intrusions", 100 * 1 / 6),
        ("socnav3.social_space_intrusionA", 2 / 6),
        ("socnav3.social_space_intrusionB", 3 / 6),
        ("socnav3.social_space_intrusionC", 3 / 6),
        ("socnav3.hum_collision_flag", 1 / 6),
    ],
)
def test_room_left_to_people(name: str, expected: float) -> None:
    assert value(name, ONE, STILL, AWAY) == pytest.approx(expected, abs=1e-6)


def test_socnavgym_calls_turning_stalled_and_counts_steps_away() -> None:
    turning = [[0.0, 0.0, 0.3 * k] for k in range(5)]
    assert value("socnavgym.stalled_time", room(), turning) == pytest.approx(0.4)
    assert value("stalled_time", room(), turning) == 0.0
    back = [[x, 0.0, 0.0] for x in (0.0, 0.1, 0.05, 0.2)]
    assert value("socnavgym.failure_to_progress", room(), back) == 1.0


def test_socnavgym_jerk_is_of_commands_that_were_zero_before() -> None:
    """u = 1 m/s at four ticks: accelerations 10, 0, 0, 0, jerks 100, -100, 0, 0; ours knows no start."""
    ahead = line((0.0, 0.0), (0.1, 0.0), 5)
    assert value("socnavgym.jerk_avg", room(), ahead) == pytest.approx(50.0)
    assert value("jerk_mean", room(), ahead) == pytest.approx(0.0, abs=1e-6)


def test_hunavsim_reaches_a_goal_five_centimetres_early() -> None:
    near = stay(3.0 - 0.44, 0.0, 3)
    assert value("hunavsim.goal_reached", room(), near) == 1.0
    assert value("success", room(), near) == 0.0
    assert value("hunavsim.goal_reached", room(), stay(3.0 - 0.46, 0.0, 3)) == 0.0


def test_hunavsim_takes_a_turn_to_the_right_for_standing() -> None:
    right, left = ([[0.0, 0.0, sign * 0.1 * k] for k in range(5)] for sign in (-1.0, 1.0))
    assert value("hunavsim.time_not_moving", room(), right) == pytest.approx(0.4)
    assert value("hunavsim.time_not_moving", room(), left) == 0.0


@pytest.mark.parametrize(("facing", "by_robot", "by_person"), [(math.pi, 3.0, 0.0), (0.0, 0.0, 3.0)])
def test_hunavsim_counts_looks_and_goes_by_bearings(facing: float, by_robot: float, by_person: float) -> None:
    """The robot runs at one who stands: α is 0 if they face it and π if not, α' is π/2. The gap is below 2 cm at the
    last three of five looks.
    """
    robot = line((-0.54, 0.0), (0.015, 0.0), 5)
    told = (ONE, robot, [stay(0.0, 0.0, 5, facing)])
    assert value("hunavsim.robot_on_person_collision", *told) == by_robot
    assert value("hunavsim.person_on_robot_collision", *told) == by_person
    assert value("human_collisions", *told) == 1.0
    assert value("robot_on_person", *told) == 1.0


def test_hunavsim_groups_have_their_middle_ahead_of_their_members() -> None:
    """Two who face each other over 2 m: 1.5 m ahead of each, on average the middle. The robot's rim is 0.4 m off."""
    people: list[Places] = [stay(0.0, -1.0, 2, math.pi / 2), stay(0.0, 1.0, 2, -math.pi / 2)]
    pair = room([Human(1, Pose(0, 0), 0.2), Human(2, Pose(0, 0), 0.2)], groups=(Group(5, "talking", (1, 2)),))
    told = {name: value(f"hunavsim.group_{name}_space_intrusions", pair, stay(-0.7, 0.0, 2), people)
            for name in ("intimate", "personal", "social")}  # fmt: skip
    assert told == {"intimate": 100.0, "personal": 0.0, "social": 0.0}
    assert value("group_intrusion", pair, stay(-0.7, 0.0, 2), people) == 0.0


def test_hunavsim_overacceleration_is_a_change_of_speed() -> None:
    """Changes of 0, 1, 2, 0 m/s over 0.01 s², by five looks."""
    assert value("hunavsim.avg_overacceleration", room(), JOLT) == pytest.approx(60.0)


def test_socnav3_sees_a_larger_robot_coming() -> None:
    """2.5 m between centres at the last look, 1 m/s, R = 0.3 √2 + 0.3; ours 2.0 s."""
    told = (ONE, line((-3.0, 0.0), (0.1, 0.0), 6), [stay(0.0, 0.0, 6)])
    soon = 2.5 - 0.3 * math.sqrt(2.0) - 0.3
    assert value("socnav3.min_time_to_collision", *told) == pytest.approx(soon, abs=1e-6)
    assert value("socnav3.max_fear", *told) == pytest.approx(1.0 / soon, abs=1e-6)
    assert value("socnav3.max_fear", ONE, stay(-0.5, 0.0, 3), [stay(0.0, 0.0, 3)]) == 10.0
    assert value("socnav3.max_fear", ONE, stay(-3.0, 0.0, 3), [stay(0.0, 0.0, 3)]) == 0.0


def test_socnav3_path_efficiency_flies_as_the_crow_and_does_not_ask_for_success() -> None:
    assert value("socnav3.path_efficiency_ratio", room(), line((-3.0, 0.0), (0.0, 0.1), 76)) == pytest.approx(0.8)
    assert value("socnav3.path_efficiency_ratio", room(), line((-3.0, 0.0), (0.1, 0.0), 20)) == 1.0
