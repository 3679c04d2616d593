"""Variants of other projects, by hand, on the same episodes as the metrics of this package."""

from __future__ import annotations

import math

import pytest

from sonata2d.core.entities import Group, Human
from sonata2d.core.geometry import Pose
from sonata2d.metrics.catalogue import ALL, METRICS
from sonata2d.metrics.interop import VARIANTS

from ..conftest import room
from .samples import Poses, line, stay, value

ONE_PERSON = room([Human(1, Pose(0.0, 0.0), 0.2)])
PERSON = [[[x, 0.0, 0.0] for x in (0.4, 0.8, 1.05, 1.5, 4.0, 4.2)]]  # between centres; d is 0.5 m less
ROBOT = stay(0.0, 0.0, 6)


def test_every_variant_names_a_metric_of_this_package() -> None:
    assert all(variant.variant_of in METRICS for variant in VARIANTS)
    assert len(ALL) == len(METRICS) + len(VARIANTS)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("socnavgym.personal_space_compliance", 5 / 6),  # 4 / 6 in this package
        ("socnavgym.minimum_distance_to_human", 0.4),  # 0 in this package
        ("socnavgym.minimum_obstacle_distance", 4.0),  # 3.7 in this package
        ("hunavsim.intimate_space_intrusions", 100 * 2 / 6),
        ("hunavsim.personal_space_intrusions", 100 * 2 / 6),
        ("hunavsim.social_space_intrusions", 100 * 1 / 6),
        ("socnav3.social_space_intrusionA", 2 / 6),
        ("socnav3.social_space_intrusionB", 3 / 6),
        ("socnav3.social_space_intrusionC", 3 / 6),
        ("socnav3.hum_collision_flag", 1 / 6),
    ],
)
def test_distances_to_people_and_obstacles(name: str, expected: float) -> None:
    assert value(name, ONE_PERSON, ROBOT, PERSON) == pytest.approx(expected, abs=1e-6)


def test_socnavgym_counts_turning_as_stalled_and_steps_away_from_the_goal() -> None:
    turning = [[0.0, 0.0, 0.3 * k] for k in range(5)]
    assert value("socnavgym.stalled_time", room(), turning) == pytest.approx(0.4)
    assert value("stalled_time", room(), turning) == 0.0
    back = [[x, 0.0, 0.0] for x in (0.0, 0.1, 0.05, 0.2)]
    assert value("socnavgym.failure_to_progress", room(), back) == 1.0


def test_socnavgym_jerk_assumes_zero_commands_before_the_start() -> None:
    """u = 1 m/s in four ticks: accelerations 10, 0, 0, 0, jerks 100, -100, 0, 0; ours ignores the start."""
    ahead = line((0.0, 0.0), (0.1, 0.0), 5)
    assert value("socnavgym.jerk_avg", room(), ahead) == pytest.approx(50.0)
    assert value("jerk_mean", room(), ahead) == pytest.approx(0.0, abs=1e-6)


def test_hunavsim_goal_is_five_centimetres_larger() -> None:
    near = stay(3.0 - 0.44, 0.0, 3)
    assert value("hunavsim.goal_reached", room(), near) == 1.0
    assert value("success", room(), near) == 0.0
    assert value("hunavsim.goal_reached", room(), stay(3.0 - 0.46, 0.0, 3)) == 0.0


def test_hunavsim_counts_a_right_turn_as_standing() -> None:
    right, left = ([[0.0, 0.0, sign * 0.1 * k] for k in range(5)] for sign in (-1.0, 1.0))
    assert value("hunavsim.time_not_moving", room(), right) == pytest.approx(0.4)
    assert value("hunavsim.time_not_moving", room(), left) == 0.0


@pytest.mark.parametrize(("facing", "by_robot", "by_person"), [(math.pi, 3.0, 0.0), (0.0, 0.0, 3.0)])
def test_hunavsim_counts_states_and_attributes_by_bearings(facing: float, by_robot: float, by_person: float) -> None:
    """The robot drives at a standing person: α is 0 if the person faces it, else π, and α' is π/2. The clearance is
    below 2 cm in the last three of five states.
    """
    robot = line((-0.54, 0.0), (0.015, 0.0), 5)
    episode = (ONE_PERSON, robot, [stay(0.0, 0.0, 5, facing)])
    assert value("hunavsim.robot_on_person_collision", *episode) == by_robot
    assert value("hunavsim.person_on_robot_collision", *episode) == by_person
    assert value("human_collisions", *episode) == 1.0
    assert value("robot_on_person", *episode) == 1.0


def test_hunavsim_collisions_of_equal_speeds_need_equal_angles() -> None:
    """Robot and person touch and move alike; |α| is π for a person who faces away, and π/2 for one who faces left."""
    for facing, count in ((0.0, 0.0), (math.pi / 2, 5.0)):
        people = [line((0.5, 0.0), (1 / 64, 0.0), 5, facing)]  # numbers without rounding errors
        for name in ("robot_on_person", "person_on_robot"):
            found = value(f"hunavsim.{name}_collision", ONE_PERSON, line((0.0, 0.0), (1 / 64, 0.0), 5), people)
            assert found == count


def test_hunavsim_groups_have_their_centre_ahead_of_their_members() -> None:
    """Two people face each other at 2 m: the mean of the points 1.5 m ahead of each is the middle. The robot's outline
    is 0.4 m from it.
    """
    people: list[Poses] = [stay(0.0, -1.0, 2, math.pi / 2), stay(0.0, 1.0, 2, -math.pi / 2)]
    pair = room([Human(1, Pose(0, 0), 0.2), Human(2, Pose(0, 0), 0.2)], groups=(Group(5, "talking", (1, 2)),))
    values = {name: value(f"hunavsim.group_{name}_space_intrusions", pair, stay(-0.7, 0.0, 2), people)
              for name in ("intimate", "personal", "social")}  # fmt: skip
    assert values == {"intimate": 100.0, "personal": 0.0, "social": 0.0}
    assert value("group_intrusion", pair, stay(-0.7, 0.0, 2), people) == 0.0


def test_hunavsim_overacceleration_is_a_change_of_speed() -> None:
    """Speeds 0, 0, 1, 3, 3 m/s: changes of 0, 1, 2, 0 m/s over 0.01 s², divided by five states."""
    robot = [[x, 0.0, 0.0] for x in (0.0, 0.0, 0.1, 0.4, 0.7)]
    assert value("hunavsim.avg_overacceleration", room(), robot) == pytest.approx(60.0)


def test_socnav3_uses_larger_radii_for_the_time_to_collision() -> None:
    """2.5 m between centres in the last state, 1 m/s, R = 0.3 √2 + 0.3; 2.0 s in this package."""
    episode = (ONE_PERSON, line((-3.0, 0.0), (0.1, 0.0), 6), [stay(0.0, 0.0, 6)])
    time = 2.5 - 0.3 * math.sqrt(2.0) - 0.3
    assert value("socnav3.min_time_to_collision", *episode) == pytest.approx(time, abs=1e-6)
    assert value("socnav3.max_fear", *episode) == pytest.approx(1.0 / time, abs=1e-6)
    assert value("socnav3.max_fear", ONE_PERSON, stay(-0.5, 0.0, 3), [stay(0.0, 0.0, 3)]) == 10.0
    assert value("socnav3.max_fear", ONE_PERSON, stay(-3.0, 0.0, 3), [stay(0.0, 0.0, 3)]) == 0.0


def test_socnav3_path_efficiency_uses_the_straight_distance_and_ignores_success() -> None:
    assert value("socnav3.path_efficiency_ratio", room(), line((-3.0, 0.0), (0.0, 0.1), 76)) == pytest.approx(0.8)
    assert value("socnav3.path_efficiency_ratio", room(), line((-3.0, 0.0), (0.1, 0.0), 20)) == 1.0
