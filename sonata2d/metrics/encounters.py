"""How robot and people came near each other in an episode, told from where they went alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np

from ..core.entities import Group
from ..core.geometry import Barriers, Point, segments_cross
from ..core.portable_math import Array
from ..core.proxemics import SOCIAL_DISTANCE
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.vectors import lengths
from ..record.record import EpisodeRecord

WINDOW = 2.0  # s, before and after the nearest moment: the way each goes while they meet
PASSING = 20.0  # s, before and after: who was ahead, and who is
STAYED = 0.4  # m: who got less far within the window stood
HEAD_ON, SAME_WAY = 3 * np.pi / 4, np.pi / 4  # rad, between the ways of two who meet
AT_DOOR, DOOR = 2.5, 1.3  # m: how near a doorway is at it; the widest that counts as narrow
TOGETHER = SOCIAL_DISTANCE / 2  # m, mean distance from the middle, up to which a group has not broken up
JOINED = 0.4  # m, that somebody who joins may stand farther out than the members do

Kind = Literal["head-on", "overtaking", "overtaken", "alongside", "crossing", "standing", "waiting"]


@dataclass(frozen=True, eq=False)
class Course:
    """Where all went: L looks, N people; m, world frame. Who is absent is NaN."""

    scene: Scene
    robot: Array  # (L, 2)
    people: Array  # (L, N, 2)

    @classmethod
    def of(cls, episode: EpisodeRecord | Iterable[Snapshot]) -> Course:
        """From a recorded episode, or from the snapshots of a live one."""
        if isinstance(episode, EpisodeRecord):
            return cls(episode.scene(), episode.looks.robot[:, :2], episode.looks.humans[:, :, :2])
        looks = list(episode)
        robot, count = np.array([look.robot.position for look in looks], dtype=float), len(looks[0].scene.humans)
        people = [look.humans.among_all(look.humans.position, count, np.nan) for look in looks]
        return cls(looks[0].scene, robot, np.stack(people))

    @property
    def dt(self) -> float:
        return self.scene.rules.dt


@dataclass(frozen=True, slots=True)
class Meeting:
    """How robot and person came near each other.

    Attributes:
        person: id.
        kind: by the angle between the ways they go about the nearest moment; overtaking: the robot passes the person,
            overtaken: the person the robot; waiting: the robot stands.
        time: of the nearest moment, s.
        gap: between their outlines then, m.
        angle: between their ways, rad, 0..pi.
        side: on which the robot has the person then.
        sight: m, between centres, when a wall no longer hid them from each other; None if it never did.
        missed: s, between their visits to where their ways cross; None if they do not.
        at_door: m, the width of a doorway with one of them on either side, both near it; None if there is none.
    """

    person: int
    kind: Kind
    time: float
    gap: float
    angle: float
    side: Literal["left", "right"]
    sight: float | None
    missed: float | None
    at_door: float | None


@dataclass(frozen=True, slots=True)
class GroupMeeting:
    """How the robot and a group came near each other, while all of its members were there and together.

    Attributes:
        group: id.
        in_the_way: whether the robot's straight way to its goal leads through the group.
        nearest: m, least distance of the robot's centre from the middle; of talkers, from that of the circle.
        reach: m, mean distance of the members from the middle then.
        joined: whether in the end the robot stands as near to the middle as the members do.
    """

    group: int
    in_the_way: bool
    nearest: float
    reach: float
    joined: bool


@dataclass(frozen=True, slots=True)
class Encounter:
    """All that took place between robot and people.

    Attributes:
        meetings: with everybody, nearest first.
        groups: with those who walk or talk together.
        company: people within 3.6 m of the robot's outline, on average over looks.
        density: people per m2 of the room's outline, on average over looks.
    """

    meetings: tuple[Meeting, ...]
    groups: tuple[GroupMeeting, ...]
    company: float
    density: float


def encounter(episode: EpisodeRecord | Iterable[Snapshot]) -> Encounter:
    """What took place between robot and people in an episode, recorded or live."""
    course = Course.of(episode)
    scene = course.scene
    there = [k for k in range(len(scene.humans)) if np.isfinite(course.people[:, k, 0]).any()]
    meetings = sorted((_meeting(course, k) for k in there), key=lambda meeting: meeting.gap)
    gaps = np.stack([_gaps(course, k) for k in there]) if there else np.full((1, 1), np.inf)
    x, y = scene.outline.T
    area = abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / 2
    return Encounter(
        tuple(meetings),
        tuple(meeting for group in scene.groups if (meeting := _group_meeting(course, group)) is not None),
        float((gaps < SOCIAL_DISTANCE).sum(axis=0).mean()),
        float(np.isfinite(gaps).sum(axis=0).mean()) / area,
    )


def doorways(scene: Scene) -> list[tuple[Point, Point]]:
    """Gaps of up to 1.3 m between loose ends of walls."""
    ends = [end for wall in scene.walls for end in (wall.start, wall.end)]
    barriers = [Barriers.of([(wall.start, wall.end, 0.0)]) for wall in scene.walls]
    loose = [end for end in ends if sum(b.gaps(np.array([end])).min() < 1e-3 for b in barriers) == 1]
    return [(a, b) for a, b in combinations(loose, 2) if 0.0 < lengths(np.subtract(a, b)) <= DOOR]


def _meeting(course: Course, k: int) -> Meeting:
    gaps = _gaps(course, k)
    nearest = int(np.argmin(gaps))
    reach, far = round(WINDOW / course.dt), round(PASSING / course.dt)
    robot, person = course.robot, course.people[:, k]
    came, went = np.flatnonzero(np.isfinite(gaps))[[0, -1]].tolist()
    first, last = max(nearest - reach, came), min(nearest + reach, went)
    ways = robot[last] - robot[first], person[last] - person[first]
    angle = _angle(*ways)
    offset = person - robot
    cross = ways[0][0] * offset[nearest][1] - ways[0][1] * offset[nearest][0]
    return Meeting(
        person=course.scene.humans[k].id,
        kind=_kind(ways, angle, offset[max(nearest - far, came)], offset[min(nearest + far, went)]),
        time=round(nearest * course.dt, 4),
        gap=float(gaps[nearest]),
        angle=angle,
        side="left" if cross > 0.0 else "right",
        sight=_sight(course, k),
        missed=_missed(course, k),
        at_door=_at_door(course, k),
    )


def _gaps(course: Course, k: int) -> Array:
    """(L,), m, between the outlines of robot and person; inf where the person is absent."""
    away = lengths(course.people[:, k] - course.robot) - course.scene.humans[k].radius - course.scene.robot.radius
    return np.where(np.isfinite(away), away, np.inf)


def _kind(ways: tuple[Array, Array], angle: float, before: Array, after: Array) -> Kind:
    """By the ways of robot and person, and where the person is, from the robot, before and after."""
    if not lengths(ways[1]) > STAYED:
        return "standing"
    if not lengths(ways[0]) > STAYED:
        return "waiting"
    if angle >= HEAD_ON:
        return "head-on"
    if angle > SAME_WAY:
        return "crossing"
    way = ways[0] + ways[1]
    ahead_before, ahead_after = float((before * way).sum()), float((after * way).sum())
    if ahead_before > 0.0 > ahead_after:
        return "overtaking"
    return "overtaken" if ahead_before < 0.0 < ahead_after else "alongside"


def _sight(course: Course, k: int) -> float | None:
    """m, at the first look at which they see each other; None if they do from the start, or never."""
    walls = Barriers.of((wall.start, wall.end, 0.0) for wall in course.scene.walls)
    there = np.isfinite(course.people[:, k, 0])
    robot, person = course.robot[there], course.people[there, k]
    hidden: Any = np.any(segments_cross(robot, person, walls), axis=0)
    if not hidden[0] or hidden.all():
        return None
    return float(lengths(person - robot)[int(np.argmin(hidden))])


def _missed(course: Course, k: int) -> float | None:
    """s, between the moments at which robot and person are where their ways cross; the least if they do so often."""
    robot, person = course.robot, course.people[:, k]
    steps = Barriers(person[:-1], person[1:], np.zeros(len(person) - 1))
    there, here = np.nonzero(segments_cross(robot[:-1], robot[1:], steps))
    return None if len(here) == 0 else float(np.abs(here - there).min()) * course.dt


def _at_door(course: Course, k: int) -> float | None:
    """m, the width of a doorway with robot and person near it, one on either side."""
    for a, b in doorways(course.scene):
        start, end = np.array(a), np.array(b)
        along, middle = end - start, (start + end) / 2
        one, other = (
            along[0] * (who[:, 1] - middle[1]) - along[1] * (who[:, 0] - middle[0])
            for who in (course.robot, course.people[:, k])
        )
        near = [lengths(who - middle) < AT_DOOR for who in (course.robot, course.people[:, k])]
        went_through = other[np.isfinite(other)][0] * other[np.isfinite(other)][-1] < 0.0
        if went_through and bool(((one * other < 0.0) & near[0] & near[1]).any()):
            return float(lengths(along))
    return None


def _group_meeting(course: Course, group: Group) -> GroupMeeting | None:
    """None for a group that is never together."""
    index = {human.id: k for k, human in enumerate(course.scene.humans)}
    places = course.people[:, [index[m] for m in group.members]]
    middle = _middles(places, in_circle=group.kind == "talking" and len(group.members) > 2)
    reach = lengths(places - middle[:, None]).mean(axis=1)
    away = np.where(reach < TOGETHER, lengths(middle - course.robot), np.nan)
    if not np.isfinite(away).any():
        return None
    nearest = int(np.nanargmin(away))
    goal = np.array([course.scene.goal.position])
    straight = Barriers(course.robot[:1], goal, np.zeros(1))
    return GroupMeeting(
        group=group.id,
        in_the_way=bool(straight.gaps(middle[nearest : nearest + 1])[0, 0] < reach[nearest]),
        nearest=float(away[nearest]),
        reach=float(reach[nearest]),
        joined=bool(away[-1] < reach[-1] + JOINED),
    )


def _middles(places: Array, *, in_circle: bool) -> Array:
    """(L, 2), the middle of (L, M, 2) members; of those in a circle, which may be open, the circle's centre.

    Source: Kåsa, IEEE Trans. Instrum. Meas. 25 (1976) 8, the least-squares circle.
    """
    middles: Array = places.mean(axis=1)
    if not in_circle:
        return middles
    for k in np.flatnonzero(np.isfinite(middles[:, 0])):
        from_mean = places[k] - middles[k]
        rows = np.column_stack((2 * from_mean, np.ones(len(from_mean))))
        centre = np.linalg.lstsq(rows, (from_mean**2).sum(axis=1), rcond=None)[0][:2]
        if lengths(centre) < lengths(from_mean).max():  # else they stand in a line
            middles[k] += centre
    return middles


def _angle(a: Array, b: Array) -> float:
    """Between two ways, rad, 0..pi."""
    return float(abs(np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum())))
