"""Pedestrians wait beside a narrow passage in which others walk the other way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.passages import WIDEST, find_passages
from sonata2d.core.entities import Furniture, Human, Wall
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene
from sonata2d.sim.world import World

from ..conftest import L_SHAPE, room, walker
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


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("width", [0.32, 0.4])
def test_a_walker_squeezes_through_a_gap_that_is_hardly_wider_than_its_body(width: float) -> None:
    (person,) = facing_door(1, -1)
    path = positions(simulate(two_rooms(width, [person], robot=CORNER), 20.0))
    assert path[-1, 0, 0] > 1.0


@pytest.mark.usefixtures("no_deviations")
def test_people_pass_a_gap_of_40_cm_in_both_directions() -> None:
    people = [*facing_door(2, -1), *facing_door(2, 1, 3)]
    path = positions(simulate(two_rooms(0.4, people, robot=CORNER), 25.0))
    assert (progress(path, 2)[-1] > 0.3).all()


def test_they_do_so_also_if_they_deviate_from_their_course() -> None:
    people = [*facing_door(2, -1), *facing_door(2, 1, 3)]
    for seed in range(5):
        path = positions(simulate(replace(two_rooms(0.4, people, robot=CORNER), seed=seed), 60.0))
        assert (progress(path, 2).max(axis=0) > 0.3).all()


def test_the_inside_of_a_hollow_wall_is_no_passage() -> None:
    faces = [Wall((x, sign * 4.0), (x, sign * 0.4)) for x in (-0.2, 0.2) for sign in (-1, 1)]
    jambs = [Wall((-0.2, sign * 0.4), (0.2, sign * 0.4)) for sign in (-1, 1)]
    (frame,) = find_passages(room([], inner=[*faces, *jambs], robot=CORNER)).frame
    assert frame[[0, 1, 4, 5]] == pytest.approx([0.0, 0.0, 0.4, 0.2], abs=1e-9)


def beside_a_table(count: int) -> Scene:
    """People at both ends of an aisle of 0.6 m between a table and a wall, 1.6 m long."""
    table = Furniture(1, "table", Pose(0.0, -0.3), Rectangle(1.6, 1.4))
    corridor = ((-6.0, -1.0), (6.0, -1.0), (6.0, 1.0), (-6.0, 1.0))
    people = [
        Human(
            1 + k, Pose(side * (3.0 + 0.8 * (k // 2)), 0.3, 0.0 if side < 0 else math.pi), 0.14, breadth=0.45,
            behaviour="walking", goals=((-side * (3.0 + 0.8 * (k // 2)), -0.2),),
        )
        for k, side in enumerate((-1, 1) * count)
    ]  # fmt: skip
    return room(people, [table], polygon=corridor, robot=Pose(-5.7, -0.7), goal=(5.0, 0.0))


@pytest.mark.parametrize("count", [1, 2])
def test_people_wait_at_the_open_side_of_an_aisle_beside_a_wall(count: int) -> None:
    scene = beside_a_table(count)
    (frame,) = find_passages(scene).frame
    assert frame[[0, 1, 4, 5]] == pytest.approx([0.0, 0.7, 0.3, 0.8], abs=1e-9)
    assert frame[6] * frame[3] == frame[7] * frame[3] == -1.0  # away from the wall, which is at y = 1 m
    path = positions(simulate(scene, 16.0))
    starts = np.sign(path[0, :, 0])
    assert (path[-1, :, 0] * starts < -1.5).all()


def in_series(distance: float, count: int, *, is_closed: bool) -> Scene:
    """People on both sides of two walls with a door each; between the walls is a corridor, or a small room."""
    inner = [Wall((x, sign * 4.0), (x, sign * 0.4)) for x in (-distance / 2, distance / 2) for sign in (-1, 1)]
    if is_closed:
        inner += [Wall((-distance / 2, y), (distance / 2, y)) for y in (-0.9, 0.9)]
    people = [*facing_door(count, -1), *facing_door(count, 1, count + 1)]
    shifted = [
        replace(person, pose=Pose(person.pose.x + math.copysign(distance / 2, person.pose.x), person.pose.y))
        for person in people
    ]
    return room(shifted, inner=inner, robot=CORNER)


@pytest.mark.parametrize("is_closed", [False, True])
@pytest.mark.parametrize(("distance", "count", "seconds"), [(1.4, 1, 10.0), (1.5, 2, 15.0), (2.0, 2, 15.0)])
def test_nobody_waits_for_ever_at_two_doors_in_series(
    distance: float, count: int, seconds: float, is_closed: bool
) -> None:
    scene = in_series(distance, count, is_closed=is_closed)
    assert len(find_passages(scene).frame) == 2
    path = positions(simulate(scene, seconds))
    assert (progress(path, count)[-1] > distance / 2 + 0.3).all()


def test_nobody_waits_for_ever_for_somebody_who_is_stuck() -> None:
    """A body that is deeper than the door stands in it."""
    stuck = Human(1, Pose(-0.6, 0.0), 0.25, breadth=0.5, behaviour="walking", goals=((3.0, 0.0),))
    scene = two_rooms(0.46, [stuck, *facing_door(1, 1, 2)], robot=CORNER)
    crowd, world = Crowd(scene), World(scene)
    speeds = []
    for _ in range(250):
        world.step(Twist(), crowd.act(world.snapshot()))
        speeds.append(crowd.state.walkers.desired_speed[1])
    assert max(speeds[60:160]) < 0.3
    assert max(speeds[180:]) > 1.0


def mirrored(scene: Scene) -> Scene:
    """The scene mirrored at the x axis."""

    def pose(p: Pose, turn: float = 0.0) -> Pose:
        return Pose(p.x, 0.0 - p.y, turn - p.theta)

    return replace(
        scene,
        humans=tuple(
            replace(h, pose=pose(h.pose), goals=tuple((x, 0.0 - y) for x, y in h.goals)) for h in scene.humans
        ),
        walls=tuple(Wall((w.start[0], -w.start[1]), (w.end[0], -w.end[1])) for w in scene.walls),
        furniture=tuple(replace(piece, pose=pose(piece.pose, math.pi)) for piece in scene.furniture),
        robot=replace(scene.robot, pose=pose(scene.robot.pose)),
        rules=replace(scene.rules, side=-scene.rules.side),
    )


def test_a_passage_between_thick_objects_is_in_the_middle_and_has_a_depth() -> None:
    shelves = [Furniture(k, "shelf", Pose(0.0, y), Rectangle(0.5, 3.6)) for k, y in ((1, 2.2), (2, -2.2))]
    scene = room([], shelves, robot=CORNER)
    for each in (scene, mirrored(scene)):
        (frame,) = find_passages(each).frame
        assert frame[[0, 1, 4, 5]] == pytest.approx([0.0, 0.0, 0.4, 0.25], abs=1e-9)


def test_people_go_to_no_place_behind_a_gap_that_is_too_narrow() -> None:
    wanderers = [walker(k, -3.0 + 0.7 * k, 2.0 - k, radius=0.14, breadth=0.45) for k in (1, 2, 3)]
    path = positions(simulate(two_rooms(0.24, wanderers, robot=Pose(-3.6, -3.6), seed=2), 30.0))
    assert (np.hypot(path[:, :, 0], path[:, :, 1]) < 0.4).mean() < 0.05


@pytest.mark.parametrize(("is_thick", "seconds"), [(False, 5.0), (True, 2.0)])
def test_mirrored_crowds_at_a_door_move_mirrored(is_thick: bool, seconds: float) -> None:
    """Until contacts have amplified the rounding errors."""
    people = [*facing_door(3, -1), *facing_door(3, 1, 4)]
    scene = two_rooms(0.8, people, robot=CORNER)
    if is_thick:
        shelves = [Furniture(k, "shelf", Pose(0.0, y), Rectangle(0.3, 3.0)) for k, y in ((1, 1.9), (2, -1.9))]
        scene = room(people, shelves, robot=CORNER)
    scene = replace(scene, rules=Rules(substeps=10))
    for a, b in zip(simulate(scene, seconds), simulate(mirrored(scene), seconds), strict=True):
        assert b.humans.position * np.array([1.0, -1.0]) == pytest.approx(a.humans.position, abs=1e-6)
