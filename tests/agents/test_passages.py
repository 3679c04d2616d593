"""Pedestrians wait beside a narrow passage in which others walk the other way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.pedestrians.passages import WIDEST, find_passages
from sonata2d.core.entities import Furniture, Human, Wall
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene

from ..conftest import L_SHAPE, room
from .test_crowd import positions, simulate, two_rooms

CORNER = Pose(-3.6, 3.6)


def facing_door(count: int, side: int, first: int = 1) -> list[Human]:
    """Pedestrians on one side of a door at the origin, -1 or 1, whose goals are on the other side."""
    heading = 0.0 if side < 0 else math.pi
    people = []
    for k in range(count):
        x, y = side * (1.4 + 0.8 * (k // 2)), (0.45 if k % 2 else -0.4) + 0.02 * k
        goal = -side * 3.2, 2.4 - 4.8 * k / max(count - 1, 1)
        people.append(Human(first + k, Pose(x, y, heading), 0.14, breadth=0.45, behaviour="walking", goals=(goal,)))
    return people


def progress(path: Array, count: int) -> Array:
    """How far people are behind the door, (T, N), m; the first `count` of them come from the left."""
    return path[:, :, 0] * np.where(np.arange(path.shape[1]) < count, 1.0, -1.0)


def test_passages_are_gaps_for_one_person_with_room_to_wait_on_both_sides() -> None:
    (frame,) = find_passages(two_rooms(0.8, [])).frame
    assert frame[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert abs(frame[3]) == pytest.approx(1.0)  # the wall is along y
    assert frame[4] == pytest.approx(0.4)
    for width in (0.2, WIDEST + 0.05):
        assert len(find_passages(two_rooms(width, [])).frame) == 0
    # a passage along a wall has no room for those who wait, and there is none outside the room
    aisle = [Furniture(1, "table", Pose(0.0, -3.0), Rectangle(7.0, 0.4))]
    assert len(find_passages(room([], aisle)).frame) == 0
    assert len(find_passages(room([], polygon=L_SHAPE)).frame) == 0
    plants = [Furniture(k, "plant", Pose(0.0, y), Disc(0.2)) for k, y in ((1, 0.6), (2, -0.6))]
    (frame,) = find_passages(room([], plants)).frame
    assert frame[[0, 1, 4]] == pytest.approx([0.0, 0.0, 0.4], abs=1e-9)


def test_one_direction_passes_first_and_the_other_one_waits_beside_the_door() -> None:
    people = [*facing_door(2, -1), *facing_door(2, 1, 3)]
    run = simulate(two_rooms(0.8, people, robot=CORNER, rules=Rules()), 12.0)
    behind = progress(positions(run), 2)
    passed = [int(np.argmax(behind[:, k] > 0.3)) for k in range(4)]
    assert min(passed) > 0
    first, last = (passed[:2], passed[2:]) if passed[0] < passed[2] else (passed[2:], passed[:2])
    assert max(first) < min(last)
    # nobody is pushed back
    assert (np.maximum.accumulate(behind, axis=0) - behind)[behind < 0.3].max() < 0.15


def test_crowds_take_turns_at_a_door_and_all_get_through() -> None:
    people = [*facing_door(6, -1), *facing_door(6, 1, 7)]
    run = simulate(two_rooms(0.8, people, robot=CORNER), 30.0)
    passing = [
        [human.id <= 6 for human in snapshot.humans if abs(human.pose.x) < 0.2 and abs(human.pose.y) < 0.4]
        for snapshot in run
    ]
    assert sum(len(set(who)) == 2 for who in passing) < 10  # ticks in which both directions are in the door
    assert (progress(positions(run), 6)[-1] > 0.3).all()


@pytest.mark.parametrize("width", [0.32, 0.5])
def test_a_walker_squeezes_through_a_gap_that_is_hardly_wider_than_its_body(width: float) -> None:
    (person,) = facing_door(1, -1)
    path = positions(simulate(two_rooms(width, [person], robot=CORNER), 20.0))
    assert path[-1, 0, 0] > 1.0


def test_mirrored_crowds_at_a_door_move_mirrored() -> None:
    people = [*facing_door(3, -1), *facing_door(3, 1, 4)]

    def scene(sign: int) -> Scene:
        humans = [
            Human(
                h.id, Pose(h.pose.x, sign * h.pose.y, sign * h.pose.theta), h.radius, breadth=h.breadth,
                behaviour="walking", goals=tuple((x, sign * y) for x, y in h.goals),
            )
            for h in people
        ]  # fmt: skip
        inner = [Wall((0.0, sign * -4.0), (0.0, sign * -0.4)), Wall((0.0, sign * 0.4), (0.0, sign * 4.0))]
        rules = Rules(side=sign)
        return room(humans, inner=inner, robot=Pose(-3.6, sign * 3.6), rules=rules)

    for a, b in zip(simulate(scene(1), 6.0), simulate(scene(-1), 6.0), strict=True):
        assert b.humans.position * np.array([1.0, -1.0]) == pytest.approx(a.humans.position, abs=1e-6)
