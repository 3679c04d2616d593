"""Times to collision and intrusions, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.entities import AT_LAPTOP, TALKING, Furniture, Group, Human
from sonata2d.core.geometry import Disc, Pose
from sonata2d.metrics.interactions import times_to_collision

from ..conftest import room
from .samples import line, record, stay, value

ONE = room([Human(1, Pose(0.0, 0.0), 0.2)])


def test_time_to_collision_of_a_robot_that_goes_straight_at_one_who_stands() -> None:
    """Rim to rim 2.5 m at the first of six looks, 0.1 m less at each; 1 m/s."""
    robot = line((-3.0, 0.0), (0.1, 0.0), 6)
    assert value("time_to_collision_min", ONE, robot, [stay(0.0, 0.0, 6)]) == pytest.approx(2.0)


def test_time_to_collision_of_two_who_cross() -> None:
    """C = (1.5, 1.5), V = (1, 1) m/s, R = 0.5 at the last look: (3 - √(9 - 2 (4.5 - 0.25))) / 2 s."""
    robot, person = line((-0.2, 0.0), (0.1, 0.0), 3), line((1.5, 1.7), (0.0, -0.1), 3)
    expected = (3.0 - math.sqrt(9.0 - 2.0 * 4.25)) / 2.0
    assert value("time_to_collision_min", ONE, robot, [person]) == pytest.approx(expected, abs=1e-6)


def test_no_time_to_collision_where_none_is_to_come() -> None:
    apart = line((-3.0, 0.0), (-0.1, 0.0), 3)
    assert value("time_to_collision_min", ONE, apart, [stay(0.0, 0.0, 3)]) is None
    beside = line((-3.0, 0.6), (0.1, 0.0), 3)  # passes at 0.6 m, the radii sum up to 0.5
    assert value("time_to_collision_min", ONE, beside, [stay(0.0, 0.0, 3)]) is None
    assert value("time_to_collision_min", ONE, stay(0.4, 0.0, 3), [stay(0.0, 0.0, 3)]) == 0.0


def test_who_touch_just_so_and_stand_have_met() -> None:
    touching = times_to_collision(np.array([0.5, 0.0]), np.zeros(2), 0.5)
    assert float(touching) == 0.0


def talking(*places: tuple[float, float]) -> tuple[object, list[list[list[float]]]]:
    people = [Human(k, Pose(*place), 0.2, group=9) for k, place in enumerate(places, 1)]
    group = Group(9, "talking", tuple(range(1, len(places) + 1)))
    return room(people, groups=(group,)), [stay(*place, 4) for place in places]


def test_group_intrusion_of_a_pair_is_cutting_the_line_between_them() -> None:
    """The line is x = 0 from y = -1 to 1; the rim reaches it at x > -0.3, at two looks of four."""
    scene, people = talking((0.0, -1.0), (0.0, 1.0))
    robot = line((-0.45, 0.0), (0.1, 0.0), 4)  # at -0.45, -0.35, -0.25, -0.15
    assert value("group_intrusion", scene, robot, people) == 0.5
    assert value("group_intrusion", scene, line((-0.45, 1.5), (0.1, 0.0), 4), people) == 0.0


def test_group_intrusion_of_three_is_being_among_them() -> None:
    """In the middle of a triangle with sides of 3.46 m, at least 1 m from each, then outside."""
    corners = [(2.0 * math.cos(a), 2.0 * math.sin(a)) for a in (0.0, 2 * math.pi / 3, 4 * math.pi / 3)]
    scene, people = talking(*corners)
    assert value("group_intrusion", scene, stay(0.0, 0.0, 4), people) == 1.0
    assert value("group_intrusion", scene, stay(-1.4, 0.0, 4), people) == 0.0


def test_group_intrusion_of_six_in_a_circle_is_being_within_it() -> None:
    """A hexagon of 1 m: its edge is at x = 0.866, so that the rim of 0.3 m is within up to 1.166 m."""
    corners = [(math.sin(k * math.pi / 3), math.cos(k * math.pi / 3)) for k in range(6)]
    scene, people = talking(*corners)
    assert value("group_intrusion", scene, line((0.0, 0.0), (0.35, 0.0), 4), people) == 1.0
    assert value("group_intrusion", scene, stay(1.18, 0.0, 4), people) == 0.0


def test_members_further_apart_than_social_distance_are_no_group() -> None:
    scene, people = talking((0.0, -1.9), (0.0, 1.9))
    assert value("group_intrusion", scene, stay(0.0, 0.0, 4), people) == 0.0
    assert value("group_intrusion", ONE, stay(0.0, 0.0, 4), [stay(0.0, 3.0, 4)]) is None


def test_interactions_count_while_they_last() -> None:
    """Persons 1 and 2 talk at looks 0 and 1 only; the robot stands between them all the time."""
    scene = room([Human(1, Pose(-1.0, 0.0), 0.2), Human(2, Pose(1.0, 0.0), 0.2)])
    told = (scene, stay(0.0, 0.2, 4), [stay(-1.0, 0.0, 4), stay(1.0, 0.0, 4)])
    assert value("interaction_intrusion", *told, ties={0: [[1, TALKING, 2]], 1: [[1, TALKING, 2]]}) == 0.5
    assert value("interaction_intrusion", *told) is None


def test_one_interaction_that_is_not_cut_does_not_make_up_for_one_that_is() -> None:
    scene = room([Human(k, Pose(0.0, 0.0), 0.2) for k in (1, 2, 3)])
    told = (scene, stay(0.0, 0.0, 1), [stay(-1.0, 0.0, 1), stay(1.0, 0.0, 1), stay(1.0, 3.0, 1)])
    for ties in ([[1, TALKING, 2], [2, TALKING, 3]], [[2, TALKING, 3], [1, TALKING, 2]]):
        assert value("interaction_intrusion", *told, ties={0: ties}) == 1.0


def test_an_interaction_with_a_thing_is_cut_too() -> None:
    laptop = Furniture(7, "laptop", Pose(2.0, 0.0), Disc(0.2), on=6)
    scene = room([Human(1, Pose(0.0, 0.0), 0.2)], [laptop])
    ties = {0: [[1, AT_LAPTOP, 7]]}
    assert value("interaction_intrusion", scene, stay(1.0, 0.29, 1), [stay(0.0, 0.0, 1)], ties=ties) == 1.0
    assert value("interaction_intrusion", scene, stay(1.0, 0.31, 1), [stay(0.0, 0.0, 1)], ties=ties) == 0.0


def test_times_agree_with_those_that_controllers_see() -> None:
    """`proxemics.times_to_collision` and the metric are the same formula."""
    from sonata2d.core import proxemics

    told = record(ONE, [[-2.0, 0.1, 0.0], [-1.9, 0.1, 0.0]], [stay(0.0, 0.0, 2)])
    seen = min(float(proxemics.times_to_collision(told_look).min()) for told_look in snapshots(told))
    assert value("time_to_collision_min", ONE, [[-2.0, 0.1, 0.0], [-1.9, 0.1, 0.0]], [stay(0.0, 0.0, 2)]) == (
        pytest.approx(seen, abs=1e-6)
    )


def snapshots(told: object) -> list[object]:
    for look in [*told.document["frames"], told.document["final"]]:  # type: ignore[attr-defined]
        look["events"] = []
    return list(told.snapshots())  # type: ignore[attr-defined]
