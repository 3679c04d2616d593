"""Times to collision and intrusions, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.core.entities import Furniture, Group, Human
from sonata2d.core.geometry import Disc, Pose, disc_contact_times
from sonata2d.core.relations import AT_LAPTOP, TALKING
from sonata2d.core.scene import Scene

from ..conftest import room, times_to_collision
from .samples import line, record, stay, value

ONE_PERSON = room([Human(1, Pose(0.0, 0.0), 0.2)])


def test_time_to_collision_with_a_standing_person() -> None:
    """The clearance is 2.5 m in the first of six states and decreases at 1 m/s."""
    robot = line((-3.0, 0.0), (0.1, 0.0), 6)
    assert value("time_to_collision_min", ONE_PERSON, robot, [stay(0.0, 0.0, 6)]) == pytest.approx(2.0)


def test_time_to_collision_on_crossing_paths() -> None:
    """C = (1.5, 1.5), V = (1, 1) m/s, R = 0.5 in the last state: (3 - √(9 - 2 (4.5 - 0.25))) / 2 s, for a disc."""
    disc = room([Human(1, Pose(0.0, 0.0), 0.2, breadth=0.4)])
    robot, person = line((-0.2, 0.0), (0.1, 0.0), 3), line((1.5, 1.7), (0.0, -0.1), 3)
    expected = (3.0 - math.sqrt(9.0 - 2.0 * 4.25)) / 2.0
    assert value("time_to_collision_min", disc, robot, [person]) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("robot", "expected"),
    [
        (line((-3.0, 0.0), (-0.1, 0.0), 3), None),  # moves away
        (line((-3.0, 0.6), (0.1, 0.0), 3), None),  # passes at 0.6 m, while the radii sum to 0.5 m
        (stay(0.4, 0.0, 3), 0.0),  # overlaps
    ],
)
def test_time_to_collision_without_a_collision_course(robot: list[list[float]], expected: float | None) -> None:
    assert value("time_to_collision_min", ONE_PERSON, robot, [stay(0.0, 0.0, 3)]) == expected


def test_time_to_collision_of_touching_discs_is_zero() -> None:
    assert float(disc_contact_times(np.array([0.5, 0.0]), np.zeros(2), 0.5)) == 0.0


def talking(*positions: tuple[float, float]) -> tuple[Scene, list[list[list[float]]]]:
    """A scene with one talking group, and the poses of its members in four states."""
    people = [Human(k, Pose(*position), 0.2, group=9) for k, position in enumerate(positions, 1)]
    group = Group(9, "talking", tuple(range(1, len(positions) + 1)))
    return room(people, groups=(group,)), [stay(*position, 4) for position in positions]


def test_group_intrusion_of_a_pair_is_on_the_line_between_them() -> None:
    """The line is x = 0 from y = -1 to 1; the robot's outline meets it for x > -0.3, in two of four states."""
    scene, people = talking((0.0, -1.0), (0.0, 1.0))
    robot = line((-0.45, 0.0), (0.1, 0.0), 4)  # x = -0.45, -0.35, -0.25, -0.15
    assert value("group_intrusion", scene, robot, people) == 0.5
    assert value("group_intrusion", scene, line((-0.45, 1.5), (0.1, 0.0), 4), people) == 0.0


def test_group_intrusion_of_three_is_in_their_triangle() -> None:
    """The centre of a triangle with sides of 3.46 m, at least 1 m from each, and a point outside."""
    corners = [(2.0 * math.cos(a), 2.0 * math.sin(a)) for a in (0.0, 2 * math.pi / 3, 4 * math.pi / 3)]
    scene, people = talking(*corners)
    assert value("group_intrusion", scene, stay(0.0, 0.0, 4), people) == 1.0
    assert value("group_intrusion", scene, stay(-1.4, 0.0, 4), people) == 0.0


@pytest.mark.parametrize("sense", [1, -1])
def test_group_intrusion_in_a_small_triangle_in_either_sense(sense: int) -> None:
    """Sides of 1.2 m: the centre is 0.346 m from each, beyond the robot's radius."""
    corners = [(1.2 / math.sqrt(3.0) * math.cos(a), 1.2 / math.sqrt(3.0) * math.sin(a)) for a in (0.0, 2.0944, 4.1888)]
    scene, people = talking(*corners[::sense])
    assert value("group_intrusion", scene, stay(0.0, 0.0, 4), people) == 1.0


def test_group_intrusion_of_six_is_in_their_hexagon() -> None:
    """A hexagon of radius 1 m: its side is at x = 0.866, so the robot's outline meets it up to x = 1.166."""
    corners = [(math.sin(k * math.pi / 3), math.cos(k * math.pi / 3)) for k in range(6)]
    scene, people = talking(*corners)
    assert value("group_intrusion", scene, line((0.0, 0.0), (0.35, 0.0), 4), people) == 1.0
    assert value("group_intrusion", scene, stay(1.18, 0.0, 4), people) == 0.0


def test_members_beyond_social_distance_do_not_form_a_hull() -> None:
    scene, people = talking((0.0, -1.9), (0.0, 1.9))
    assert value("group_intrusion", scene, stay(0.0, 0.0, 4), people) == 0.0
    assert value("group_intrusion", ONE_PERSON, stay(0.0, 0.0, 4), [stay(0.0, 3.0, 4)]) is None


def test_interactions_count_while_they_last() -> None:
    """Persons 1 and 2 talk in states 0 and 1 only; the robot always stands between them."""
    scene = room([Human(1, Pose(-1.0, 0.0), 0.2), Human(2, Pose(1.0, 0.0), 0.2)])
    episode = (scene, stay(0.0, 0.2, 4), [stay(-1.0, 0.0, 4), stay(1.0, 0.0, 4)])
    interactions = {0: [[1, TALKING, 2]], 1: [[1, TALKING, 2]]}
    assert value("interaction_intrusion", *episode, interactions=interactions) == 0.5
    assert value("interaction_intrusion", *episode) is None


@pytest.mark.parametrize("rows", [[[1, TALKING, 2], [2, TALKING, 3]], [[2, TALKING, 3], [1, TALKING, 2]]])
def test_intrusion_into_one_of_two_interactions_counts(rows: list[list[object]]) -> None:
    scene = room([Human(k, Pose(0.0, 0.0), 0.2) for k in (1, 2, 3)])
    people = [stay(-1.0, 0.0, 1), stay(1.0, 0.0, 1), stay(1.0, 3.0, 1)]
    assert value("interaction_intrusion", scene, stay(0.0, 0.0, 1), people, interactions={0: rows}) == 1.0


@pytest.mark.parametrize(("y", "expected"), [(0.29, 1.0), (0.31, 0.0)])
def test_intrusion_into_an_interaction_with_an_object(y: float, expected: float) -> None:
    laptop = Furniture(7, "laptop", Pose(2.0, 0.0), Disc(0.2), on=6)
    scene = room([Human(1, Pose(0.0, 0.0), 0.2)], [laptop])
    interactions = {0: [[1, AT_LAPTOP, 7]]}
    found = value("interaction_intrusion", scene, stay(1.0, y, 1), [stay(0.0, 0.0, 1)], interactions=interactions)
    assert found == expected


def test_time_to_collision_of_a_record_equals_that_of_its_snapshots() -> None:
    episode = (ONE_PERSON, [[-2.0, 0.1, 0.0], [-1.9, 0.1, 0.0]], [stay(0.0, 0.0, 2)])
    found = record(*episode)
    for state in [*found.document["frames"], found.document["final"]]:
        state["events"] = []
    smallest = min(float(times_to_collision(snapshot).min()) for snapshot in found.snapshots())
    assert value("time_to_collision_min", *episode) == pytest.approx(smallest, abs=1e-6)
