"""Arriving and touching, worked out by hand. dt is 0.1 s, the robot's radius 0.3 m, a person's 0.2 m."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sonata2d.core.entities import Furniture, Goal, Human
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.scene import Rules
from sonata2d.metrics.trajectory import Trajectory

from ..conftest import room
from .samples import line, record, stay, value

TO_GOAL = line((-3.0, 0.0), (0.1, 0.0), 61)  # the goal is at (3, 0), reached within 0.4 m: at look 56


def robot_at_fault(id: int, kind: str = "human") -> dict[str, object]:
    return {"kind": kind, "id": id, "robot_at_fault": True, "other_at_fault": False}


def test_success_is_the_first_look_within_reach_of_the_goal() -> None:
    assert value("success", room(), TO_GOAL) == 1.0
    assert value("time_to_goal", room(), TO_GOAL) == pytest.approx(5.6)
    assert len(Trajectory(record(room(), TO_GOAL))) == 57
    assert value("success", room(), TO_GOAL[:56]) == 0.0
    assert value("time_to_goal", room(), TO_GOAL[:56]) is None


def test_a_run_that_ended_at_the_goal_reached_it_whatever_rounding_says() -> None:
    """At the file's precision it is 0.4 mm outside."""
    robot = [*line((-3.0, 0.0), (0.1, 0.0), 56), [2.5996, 0.0, 0.0]]
    assert value("success", room(), robot, status="goal") == 1.0
    assert value("success", room(), robot) == 0.0


def test_a_goal_with_a_heading_wants_it() -> None:
    scene = replace(room(), goal=Goal(3.0, 0.0, theta=3.1, angle=0.2))
    assert value("success", scene, TO_GOAL) == 0.0
    across = [[x, y, -3.1] for x, y, _ in TO_GOAL]  # 0.083 rad from 3.1, the short way round
    assert value("success", scene, across) == 1.0


def test_timeout_is_running_out_of_time_before_the_goal() -> None:
    assert value("timeout", room(), stay(0, 0, 5), status="timeout") == 1.0
    assert value("timeout", room(), stay(0, 0, 5), status="stopped") == 0.0
    assert value("timeout", room(), TO_GOAL, status="timeout") == 0.0


def test_a_touch_of_many_looks_is_one_collision_and_a_second_touch_another() -> None:
    person = room([Human(1, Pose(0.0, 3.0), 0.2)])
    contacts = {look: [robot_at_fault(1)] for look in (3, 4, 5, 9)}
    told = (person, stay(0, 0, 12), [stay(0, 3, 12)])
    assert value("human_collisions", *told, contacts=contacts) == 2.0
    assert value("collisions", *told, contacts=contacts) == 2.0
    assert value("robot_on_person", *told, contacts=contacts) == 2.0
    assert value("person_on_robot", *told, contacts=contacts) == 0.0
    assert value("time_to_first_collision", *told, contacts=contacts) == pytest.approx(0.3)
    assert value("time_to_first_collision", *told) is None


def test_a_look_without_contact_parts_touches_and_fault_at_any_look_is_fault() -> None:
    """Looks 3 and 4 are one touch, in which the robot pushes on once it was hit; look 6 another, by nobody's fault."""
    hit = {"kind": "human", "id": 1, "robot_at_fault": False, "other_at_fault": True}
    rest = {"kind": "human", "id": 1, "robot_at_fault": False, "other_at_fault": False}
    told = (room([Human(1, Pose(0.0, 3.0), 0.2)]), stay(0, 0, 12), [stay(0, 3, 12)])
    contacts = {3: [hit], 4: [robot_at_fault(1)], 6: [rest]}
    assert value("human_collisions", *told, contacts=contacts) == 2.0
    assert value("robot_on_person", *told, contacts=contacts) == 1.0
    assert value("person_on_robot", *told, contacts=contacts) == 1.0
    assert value("both_on_each_other", *told, contacts=contacts) == 1.0


def test_strict_success_takes_no_touch_before_the_goal_and_does_not_mind_one_after() -> None:
    before, after = {10: [robot_at_fault(2, "wall")]}, {58: [robot_at_fault(2, "wall")]}
    assert value("success_strict", room(), TO_GOAL) == 1.0
    assert value("success_strict", room(), TO_GOAL, contacts=before) == 0.0
    assert value("success", room(), TO_GOAL, contacts=before) == 1.0
    assert value("wall_collisions", room(), TO_GOAL, contacts=before) == 1.0
    assert value("success_strict", room(), TO_GOAL, contacts=after) == 1.0


@pytest.mark.parametrize(
    ("robot_moves", "person_moves", "by_robot", "by_person", "by_both"),
    [(True, False, 1.0, 0.0, 0.0), (False, True, 0.0, 1.0, 0.0), (True, True, 1.0, 1.0, 1.0)],
)
def test_who_hit_whom_is_told_by_velocities_where_no_contact_is_recorded(
    robot_moves: bool, person_moves: bool, by_robot: float, by_person: float, by_both: float
) -> None:
    """The outlines meet at the last look: centres 0.5 m apart."""
    scene = room([Human(1, Pose(1.0, 0.0), 0.2)])
    robot = line((-0.4, 0.0), (0.1, 0.0), 5) if robot_moves else stay(0.0, 0.0, 5)
    person = line((0.9, 0.0), (-0.1, 0.0), 5) if person_moves else stay(0.5, 0.0, 5)
    if not robot_moves or not person_moves:
        robot, person = robot[1:], person[1:]
    told = (scene, robot, [person])
    assert value("human_collisions", *told) == 1.0
    assert value("robot_on_person", *told) == by_robot
    assert value("person_on_robot", *told) == by_person
    assert value("both_on_each_other", *told) == by_both


def test_gaps_alone_tell_of_walls_and_things() -> None:
    """The wall is at x = 4, a table's left side at x = 1."""
    table = Furniture(9, "table", Pose(1.5, 0.0), Rectangle(1.0, 1.0))
    to_table = line((0.0, 0.0), (0.1, 0.0), 8)
    assert value("object_collisions", room([], [table]), to_table) == 1.0
    assert value("object_collisions", room([], [table]), to_table[:7]) == 0.0
    assert value("wall_collisions", room(goal=(-3, 3)), line((3.0, 0.0), (0.1, 0.0), 8)) == 1.0
    assert value("wall_collisions", room([], [table]), to_table) == 0.0
    on_table = Furniture(10, "laptop", Pose(-1.0, 0.0), Disc(0.2), on=9)
    assert value("object_collisions", room([], [on_table]), stay(-1.0, 0.0, 3)) == 0.0


def test_contact_distance_is_the_scenes_own() -> None:
    scene = room([Human(1, Pose(0.0, 0.0), 0.2)], rules=Rules(contact_distance=0.2))
    assert value("human_collisions", scene, stay(-0.65, 0.0, 3), [stay(0.0, 0.0, 3)]) == 1.0
    assert (
        value("human_collisions", room([Human(1, Pose(0.0, 0.0), 0.2)]), stay(-0.65, 0.0, 3), [stay(0.0, 0.0, 3)])
        == 0.0
    )


def test_stalled_time_is_that_of_neither_going_nor_turning() -> None:
    """Three ticks ahead, two still, two turning on the spot, one creeping at 0.005 m/s."""
    x = [0.0, 0.1, 0.2, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3005]
    theta = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.2]
    robot = [[a, 0.0, t] for a, t in zip(x, theta, strict=True)]
    assert value("stalled_time", room(), robot) == pytest.approx(0.3)
