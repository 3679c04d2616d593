"""Encounters of tracks that are made by hand: each fact of a meeting, and what each situation asks of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from sonata2d.core.entities import Group, Wall
from sonata2d.metrics.encounters import Encounter, GroupMeeting, Meeting, encounter
from sonata2d.metrics.situations import SITUATIONS
from sonata2d.metrics.trajectory import Trajectory

from ..conftest import room, walker
from .samples import Poses, line, record, stay

COUNT = 81  # states, one each 0.1 s; the direction window is 20 of them
NAN = [[math.nan] * 3]


def meeting_of(robot: Poses, person: Poses, *walls: Wall) -> Meeting:
    """The meeting with one person, in a room of 8 x 8 m around the origin."""
    scene = room([walker(1, *person[-1][:2])])
    (found,) = encounter(record(replace(scene, walls=(*scene.walls, *walls)), robot, [person])).meetings
    return found


AHEAD = line((-4.0, 0.0), (0.1, 0.0), COUNT)  # at 1 m/s; at the origin after 4 s


@pytest.mark.parametrize(
    ("person", "kind", "side", "angle"),
    [
        (line((4.0, 1.0), (-0.1, 0.0), COUNT), "head-on", "left", math.pi),
        (line((4.0, -1.0), (-0.1, 0.0), COUNT), "head-on", "right", math.pi),
        (line((4.0, 5.0), (-0.1, -0.11), COUNT), "crossing", "left", math.pi - math.atan2(0.11, 0.1)),
        (line((-0.5, -4.0), (0.0, 0.1), COUNT), "crossing", "right", math.pi / 2),
        (line((-2.0, 1.0), (0.05, 0.0), COUNT), "overtaking", "left", 0.0),
        (line((-3.96, 0.2), (0.099, 0.0), COUNT), "overtaking", "left", 0.0),  # by a few centimetres
        (line((-8.0, 1.0), (0.2, 0.0), COUNT), "overtaken", "left", 0.0),
        (line((-4.04, 0.2), (0.101, 0.0), COUNT), "overtaken", "left", 0.0),
        (line((-4.1, -1.0), (0.1, 0.0), COUNT), "alongside", "right", 0.0),
        (stay(0.0, 1.5, COUNT), "standing", "left", None),
        (line((0.0, -1.0), (0.009, 0.0), COUNT), "standing", "right", None),  # 0.36 m in 4 s
        (line((0.0, -1.0), (0.011, 0.0), COUNT), "overtaking", "right", 0.0),
    ],
)
def test_the_kind_of_a_meeting_follows_from_the_directions(
    person: Poses, kind: str, side: str, angle: float | None
) -> None:
    meeting = meeting_of(AHEAD, person)
    assert (meeting.kind, meeting.side) == (kind, side)
    assert angle is None or meeting.angle == pytest.approx(angle)


def test_a_robot_that_stands_waits() -> None:
    assert meeting_of(stay(0.0, 0.0, COUNT), line((4.0, 1.0), (-0.1, 0.0), COUNT)).kind == "waiting"
    assert meeting_of(line((0.0, 0.0), (0.009, 0.0), COUNT), line((4.0, 1.0), (-0.1, 0.0), COUNT)).kind == "waiting"


@pytest.mark.parametrize(
    ("degrees", "kind"), [(44, "overtaking"), (46, "crossing"), (134, "crossing"), (136, "head-on")]
)
def test_45_degrees_divide_the_kinds(degrees: float, kind: str) -> None:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    person = line((-2.0 * c, 0.6 - 2.0 * s), (0.05 * c, 0.05 * s), COUNT)
    meeting = meeting_of(AHEAD, person)
    assert meeting.kind == kind
    assert meeting.angle == pytest.approx(math.radians(degrees))


def test_directions_are_those_of_two_seconds_before_and_after() -> None:
    """The person walks towards the robot, and back again after it has passed; nearest at 4 s, at the turning point."""
    there = line((2.0, 1.0), (-0.05, 0.0), 41)
    person = there + line((0.0, 1.0), (0.05, 0.0), COUNT - 41)
    assert meeting_of(AHEAD, person).kind == "standing"  # as many steps to and fro
    longer = line((4.0, 1.0), (-0.1, 0.0), 46) + line((-0.5, 1.0), (0.1, 0.0), COUNT - 46)
    assert meeting_of(AHEAD, longer).kind == "head-on"


def test_time_clearance_and_presence() -> None:
    """The person is there from 5 s on: the nearest moment, and the directions, are within that time."""
    person = NAN * 50 + line((2.0, 1.0), (0.0, 0.05), COUNT - 50)
    meeting = meeting_of(AHEAD, person)
    assert meeting.time == 5.4  # 1.2 m beside the robot, 0.6 m ahead
    assert math.hypot(0.6, 1.2) - 0.8 < meeting.clearance < math.hypot(0.6, 1.2) - 0.5
    assert meeting.kind == "crossing"


def test_crossing_delay_is_the_time_between_both_passages() -> None:
    """The paths cross at (1.05, 0), where the robot is after 5.05 s, and the person after 3.05 s and its delay."""
    for ticks, delay in ((0, 2.0), (7, 1.3), (20, 0.0), (25, 0.5)):
        person = stay(1.05, -3.05, ticks) + line((1.05, -3.05), (0.0, 0.1), COUNT - ticks)
        assert meeting_of(AHEAD, person).crossing_delay == pytest.approx(delay)
    assert meeting_of(AHEAD, line((4.0, 1.0), (-0.1, 0.0), COUNT)).crossing_delay is None


def test_sight_distance_is_that_of_the_first_state_without_a_wall_between() -> None:
    """A wall along y = 0.5 up to x = 0; the person stands at (0.05, 3)."""
    person = stay(1.0, 3.0, COUNT)
    wall = Wall((-4.0, 0.5), (0.0, 0.5))
    meeting = meeting_of(AHEAD, person, wall)
    first = next(x for x, _, _ in AHEAD if x + (1.0 - x) * 0.5 / 3.0 > 0.0)
    assert meeting.sight_distance == pytest.approx(math.hypot(1.0 - first, 3.0))
    assert meeting_of(AHEAD, person).sight_distance is None
    assert meeting_of(AHEAD, person, Wall((-4.0, 0.5), (4.0, 0.5))).sight_distance is None


DOOR = (Wall((0.0, -4.0), (0.0, -0.5)), Wall((0.0, 0.5), (0.0, 4.0)))  # a gap of 1 m at the origin


@pytest.mark.parametrize(
    ("robot", "person", "found"),
    [
        (AHEAD, line((4.0, 0.2), (-0.1, 0.0), COUNT), True),  # both pass
        (stay(-1.0, 1.0, COUNT), line((4.0, 0.0), (-0.1, 0.0), COUNT), True),  # the person passes
        (stay(-3.0, 1.0, COUNT), line((4.0, 0.0), (-0.1, 0.0), COUNT), False),  # the robot is never near
        (AHEAD, line((3.0, 1.0), (-0.03, 0.0), COUNT), True),  # it comes to the doorway and lets the robot pass
        (AHEAD, stay(1.5, 1.0, COUNT), False),  # it was there from the beginning
        (line((-4.0, 1.0), (0.03, 0.0), COUNT), line((4.0, 1.0), (-0.03, 0.0), COUNT), False),  # nobody passes
        (stay(-0.6, 0.0, COUNT), line((3.0, 1.0), (-0.03, 0.0), COUNT), False),
        (line((4.0, 1.5), (-0.03, 0.0), COUNT), line((4.0, 0.0), (-0.1, 0.0), COUNT), False),  # on the same side
    ],
)
def test_a_doorway_is_met_by_two_on_opposite_sides_of_whom_one_passes(robot: Poses, person: Poses, found: bool) -> None:
    assert meeting_of(robot, person, *DOOR).door_width == (1.0 if found else None)
    wide = (Wall((0.0, -4.0), (0.0, -0.66)), Wall((0.0, 0.66), (0.0, 4.0)))
    assert meeting_of(robot, person, *wide).door_width is None  # 1.32 m


def test_doors_in_other_places_are_met_there() -> None:
    """The doorway of the test above, turned by 90 degrees and moved by 1 m."""
    door = (Wall((-4.0, 1.0), (-0.5, 1.0)), Wall((0.5, 1.0), (4.0, 1.0)))
    robot, person = line((0.0, -3.0), (0.0, 0.08), COUNT), line((0.0, 3.5), (0.0, -0.03), COUNT)
    assert meeting_of(robot, person, *door).door_width == 1.0
    assert meeting_of(robot, stay(3.0, 3.0, COUNT), *door).door_width is None


def of_group(robot: Poses, radius: float, count: int, *, kind: str = "talking") -> list[GroupMeeting]:
    """The meeting with people who stand on a circle around (0, 1)."""
    angles = np.pi * (0.5 + np.arange(count) / max(count - 1, 1))  # on half a circle
    people = [stay(radius * math.cos(a), 1.0 + radius * math.sin(a), COUNT) for a in angles]
    humans = [walker(k + 1, *person[0][:2], group=1) for k, person in enumerate(people)]
    scene = room(humans)
    group = Group(1, kind, tuple(range(1, count + 1)))  # type: ignore[arg-type]
    scene = replace(scene, groups=(group,), goal=replace(scene.goal, x=3.0, y=0.0))
    return list(encounter(record(scene, robot, people)).groups)


def test_a_group_is_on_the_path_if_the_straight_line_meets_its_circle() -> None:
    (group,) = of_group(AHEAD, 0.85, 4)
    assert group.group == 1
    assert group.radius == pytest.approx(0.85)
    assert group.distance == pytest.approx(1.0)
    assert group.blocks_path  # the bodies reach beyond the circle
    assert not group.joined
    (apart,) = of_group(AHEAD, 0.5, 4)
    assert not apart.blocks_path
    (walking,) = of_group(AHEAD, 0.5, 4, kind="walking")  # the mean of the members
    assert walking.distance == pytest.approx(math.hypot(1.0, 0.0), abs=0.4)
    assert of_group(AHEAD, 1.9, 4) == []  # it has broken up
    (pair,) = of_group(AHEAD, 0.4, 2)
    assert pair.radius == pytest.approx(0.4)


def test_a_robot_joins_a_group_if_it_ends_as_near_as_the_members() -> None:
    for y, joined in ((1.0 - 0.85 - 0.39, True), (1.0 - 0.85 - 0.41, False)):
        (group,) = of_group(line((-4.0, y), (0.05, 0.0), COUNT), 0.85, 4)
        assert group.joined == joined


def test_neighbours_and_density() -> None:
    scene = room([walker(1, 2.0, 1.0), walker(2, 3.0, 3.0), walker(3, -3.0, -3.0)])
    near = 3.6 + scene.robot.radius + scene.humans[0].radius
    people = [stay(near - 0.3, 0.0, COUNT), stay(near + 0.3, 0.0, COUNT), NAN * 41 + stay(0.0, 1.0, COUNT - 41)]
    found = encounter(record(scene, stay(0.0, 0.0, COUNT), people))
    assert found.neighbours == pytest.approx(1.0 + 40 / 81)
    assert found.density == pytest.approx((2.0 + 40 / 81) / 64.0)
    assert [meeting.person for meeting in found.meetings] == [3, 1, 2]


MEETING = Meeting(7, "head-on", 4.0, 1.9, math.pi, "left", None, None, None)


def said(
    situation: str, *meetings: Meeting, groups: tuple[GroupMeeting, ...] = (), crowd: tuple[float, float] = (0, 0)
) -> str:
    """The description of a verdict, after + or -."""
    verdict = SITUATIONS[situation](Encounter(meetings, groups, *crowd, trajectory=cast(Trajectory, None)))
    return f"{'+' if verdict.took_place else '-'} {verdict.description}"


def test_what_the_situations_ask_of_a_meeting() -> None:
    assert said("frontal-approach", MEETING) == (
        "+ person 7 came towards the robot: nearest at 4.0 s, clearance 1.90 m on the left"
    )
    assert said("frontal-approach", replace(MEETING, clearance=2.0)) == (
        "- no person came towards the robot (person 7 head-on, clearance 2.0 m)"
    )
    assert said("frontal-approach", replace(MEETING, sight_distance=3.0))[0] == "-"
    assert said("frontal-approach") == "- no person came towards the robot (there are no people)"
    others = [replace(MEETING, person=k, kind="standing") for k in (1, 2, 3)]
    assert said("overtaking", *others) == (
        "- no person was overtaken by the robot "
        "(person 1 standing, clearance 1.9 m; person 2 standing, clearance 1.9 m)"
    )
    assert said("overtaking", *others, replace(MEETING, kind="overtaking")).startswith("+ person 7 was overtaken")
    assert said("being-overtaken", replace(MEETING, kind="overtaken")).startswith("+ person 7 overtook the robot")
    hidden = replace(MEETING, sight_distance=4.9)
    assert said("blind-corner", hidden).endswith("on the left, first seen at 4.9 m")
    assert [said("blind-corner", replace(hidden, **change))[0] for change in (
        {"sight_distance": 5.0}, {"clearance": 2.0}, {"sight_distance": None},
    )] == ["-"] * 3  # type: ignore[arg-type]  # fmt: skip
    assert said("narrow-doorway", replace(MEETING, door_width=0.95)).endswith("on the left, doorway 0.95 m wide")
    crossing = replace(MEETING, kind="crossing", angle=math.pi / 2, crossing_delay=3.9)
    assert said("intersection", crossing).startswith("+ person 7 crossed the robot's path")
    assert [said("intersection", replace(crossing, **change))[0] for change in (
        {"crossing_delay": 4.0}, {"crossing_delay": None}, {"clearance": 2.0}, {"door_width": 1.0},
        {"angle": math.pi / 4}, {"angle": 3 * math.pi / 4},
    )] == ["-"] * 6  # type: ignore[arg-type]  # fmt: skip


def test_what_the_situations_ask_of_groups_and_crowds() -> None:
    group = GroupMeeting(5, True, 0.8, 0.9, False)
    assert said("crossing-a-group", groups=(group,)) == (
        "+ group 5 was on the straight path; the robot went through it at 0.80 m"
    )
    around = replace(group, distance=2.69)
    assert "the robot went around it at 2.69 m" in said("crossing-a-group", groups=(around,))
    assert said("crossing-a-group", groups=(replace(group, distance=2.71),))[0] == "-"
    assert said("crossing-a-group", groups=(replace(group, blocks_path=False),))[0] == "-"
    assert said("joining-a-group", groups=(group, around)) == "- the robot stayed 0.80 m or more from groups"
    assert said("joining-a-group") == "- there is no group"
    assert said("joining-a-group", groups=(group, replace(group, group=6, joined=True))) == (
        "+ the robot stands with group 6 at the end"
    )
    assert said("crowded-hall", crowd=(3.0, 0.1)) == "+ on average 3.0 people near the robot, 0.10 per m² of the room"
    assert said("crowded-hall", crowd=(2.9, 0.1))[0] == said("crowded-hall", crowd=(3.0, 0.09))[0] == "-"
