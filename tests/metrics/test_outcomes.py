"""Metrics of the outcome, by hand. dt is 0.1 s, the robot's radius 0.3 m, that of people 0.2 m."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sonata2d.core.entities import Furniture, Goal, Human
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.scene import Rules
from sonata2d.metrics.trajectory import Trajectory

from ..conftest import room
from .samples import line, record, stay, value

TO_GOAL = line((-3.0, 0.0), (0.1, 0.0), 61)  # the goal at (3, 0) is reached within 0.4 m, in state 56


def contact(id: int, kind: str = "human", *, robot: bool = True, other: bool = False) -> dict[str, object]:
    """A recorded contact and the parties at fault."""
    return {"kind": kind, "id": id, "robot_at_fault": robot, "other_at_fault": other}


def test_success_requires_a_state_within_the_radius_of_the_goal() -> None:
    assert value("success", room(), TO_GOAL) == 1.0
    assert value("time_to_goal", room(), TO_GOAL) == pytest.approx(5.6)
    assert len(Trajectory(record(room(), TO_GOAL))) == 57
    assert value("success", room(), TO_GOAL[:56]) == 0.0
    assert value("time_to_goal", room(), TO_GOAL[:56]) is None


def test_outcome_goal_is_success_even_if_the_rounded_position_is_outside() -> None:
    """At the precision of files the last position is 0.4 mm outside."""
    robot = [*line((-3.0, 0.0), (0.1, 0.0), 56), [2.5996, 0.0, 0.0]]
    assert value("success", room(), robot, status="goal") == 1.0
    assert value("success", room(), robot) == 0.0


def test_goal_with_a_heading_requires_the_heading() -> None:
    scene = replace(room(), goal=Goal(3.0, 0.0, theta=3.1, angle=0.2))
    assert value("success", scene, TO_GOAL) == 0.0
    across = [[x, y, -3.1] for x, y, _ in TO_GOAL]  # 0.083 rad from 3.1, across the discontinuity at pi
    assert value("success", scene, across) == 1.0


def test_timeout_requires_the_time_limit_before_the_goal() -> None:
    assert value("timeout", room(), stay(0, 0, 5), status="timeout") == 1.0
    assert value("timeout", room(), stay(0, 0, 5), status="stopped") == 0.0
    assert value("timeout", room(), TO_GOAL, status="timeout") == 0.0


def test_a_goal_after_the_time_limit_is_no_success() -> None:
    """The goal is reached in state 56, at 5.6 s."""
    for limit, is_in_time in ((5.55, 0.0), (5.5, 0.0), (5.5999, 0.0), (5.6, 1.0), (5.65, 1.0)):
        scene = room(rules=Rules(time_limit=limit))
        for robot, status in ((TO_GOAL, "stopped"), (TO_GOAL[:57], "goal")):
            assert value("success", scene, robot, status=status) == is_in_time
            assert value("time_to_goal", scene, robot, status=status) == (pytest.approx(5.6) if is_in_time else None)
        assert value("timeout", scene, TO_GOAL[:57], status="goal") == 1.0 - is_in_time


def test_contacts_in_consecutive_states_are_one_collision() -> None:
    scene = room([Human(1, Pose(0.0, 3.0), 0.2)])
    contacts = {index: [contact(1)] for index in (3, 4, 5, 9)}
    episode = (scene, stay(0, 0, 12), [stay(0, 3, 12)])
    assert value("human_collisions", *episode, contacts=contacts) == 2.0
    assert value("collisions", *episode, contacts=contacts) == 2.0
    assert value("robot_on_person", *episode, contacts=contacts) == 2.0
    assert value("person_on_robot", *episode, contacts=contacts) == 0.0
    assert value("time_to_first_collision", *episode, contacts=contacts) == pytest.approx(0.3)
    assert value("time_to_first_collision", *episode) is None


def test_fault_in_one_state_is_fault_of_the_collision() -> None:
    """States 3 and 4 are one collision with a different fault each; state 6 is another one without fault."""
    episode = (room([Human(1, Pose(0.0, 3.0), 0.2)]), stay(0, 0, 12), [stay(0, 3, 12)])
    contacts = {3: [contact(1, robot=False, other=True)], 4: [contact(1)], 6: [contact(1, robot=False)]}
    assert value("human_collisions", *episode, contacts=contacts) == 2.0
    assert value("robot_on_person", *episode, contacts=contacts) == 1.0
    assert value("person_on_robot", *episode, contacts=contacts) == 1.0
    assert value("both_on_each_other", *episode, contacts=contacts) == 1.0


def test_strict_success_excludes_collisions_before_the_goal_only() -> None:
    before, after = {10: [contact(2, "wall")]}, {58: [contact(2, "wall")]}
    assert value("success_strict", room(), TO_GOAL) == 1.0
    assert value("success_strict", room(), TO_GOAL, contacts=before) == 0.0
    assert value("success", room(), TO_GOAL, contacts=before) == 1.0
    assert value("wall_collisions", room(), TO_GOAL, contacts=before) == 1.0
    assert value("success_strict", room(), TO_GOAL, contacts=after) == 1.0


@pytest.mark.parametrize(
    ("robot_moves", "person_moves", "by_robot", "by_person", "by_both"),
    [(True, False, 1.0, 0.0, 0.0), (False, True, 0.0, 1.0, 0.0), (True, True, 1.0, 1.0, 1.0)],
)
def test_fault_follows_from_velocities_where_no_contact_is_recorded(
    robot_moves: bool, person_moves: bool, by_robot: float, by_person: float, by_both: float
) -> None:
    """The outlines touch in the last state: the centres are 0.5 m apart."""
    scene = room([Human(1, Pose(1.0, 0.0), 0.2)])
    robot = line((-0.4, 0.0), (0.1, 0.0), 5) if robot_moves else stay(0.0, 0.0, 5)
    person = line((0.9, 0.0), (-0.1, 0.0), 5) if person_moves else stay(0.5, 0.0, 5)
    if not robot_moves or not person_moves:
        robot, person = robot[1:], person[1:]
    episode = (scene, robot, [person])
    assert value("human_collisions", *episode) == 1.0
    assert value("robot_on_person", *episode) == by_robot
    assert value("person_on_robot", *episode) == by_person
    assert value("both_on_each_other", *episode) == by_both


def test_collisions_with_walls_and_objects_follow_from_clearances() -> None:
    """The wall is at x = 4, the left side of a table at x = 1."""
    table = Furniture(9, "table", Pose(1.5, 0.0), Rectangle(1.0, 1.0))
    to_table = line((0.0, 0.0), (0.1, 0.0), 8)
    assert value("object_collisions", room([], [table]), to_table) == 1.0
    assert value("object_collisions", room([], [table]), to_table[:7]) == 0.0
    assert value("wall_collisions", room(goal=(-3, 3)), line((3.0, 0.0), (0.1, 0.0), 8)) == 1.0
    assert value("wall_collisions", room([], [table]), to_table) == 0.0
    on_table = Furniture(10, "laptop", Pose(-1.0, 0.0), Disc(0.2), on=9)
    assert value("object_collisions", room([], [on_table]), stay(-1.0, 0.0, 3)) == 0.0


@pytest.mark.parametrize(("distance", "collisions"), [(0.2, 1.0), (Rules().contact_distance, 0.0)])
def test_contact_distance_is_that_of_the_scene(distance: float, collisions: float) -> None:
    scene = room([Human(1, Pose(0.0, 0.0), 0.2)], rules=Rules(contact_distance=distance))
    assert value("human_collisions", scene, stay(-0.65, 0.0, 3), [stay(0.0, 0.0, 3)]) == collisions


def test_stalled_time_requires_neither_motion_nor_turning() -> None:
    """Three ticks ahead, two without motion, two turning on the spot, one at 0.005 m/s."""
    x = [0.0, 0.1, 0.2, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3005]
    theta = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.2]
    robot = [[a, 0.0, t] for a, t in zip(x, theta, strict=True)]
    assert value("stalled_time", room(), robot) == pytest.approx(0.3)
