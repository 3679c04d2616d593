"""Encounters of the robot with humans and groups in an episode, derived from their positions alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal

import numpy as np

from ..core.entities import Group
from ..core.geometry import Barriers, Point, segments_cross
from ..core.portable_math import Array
from ..core.proxemics import SOCIAL_DISTANCE
from ..core.scene import Scene
from ..core.vectors import lengths
from ..record.record import EpisodeRecord
from .trajectory import Trajectory

_DIRECTION_WINDOW = 2.0  # s before and after the nearest moment, over which directions of motion are taken
_PASSING_WINDOW = 20.0  # s before and after the nearest moment, at which "ahead" and "behind" are compared
_STILL_DISTANCE = 0.4  # m; a smaller displacement within the direction window counts as standing
HEAD_ON_ANGLE, SAME_WAY_ANGLE = 3 * np.pi / 4, np.pi / 4  # rad, between the directions of robot and human
_DOOR_RANGE, _MAX_DOOR_WIDTH = 2.5, 1.3  # m; distance up to which an agent is at a doorway; wider ones do not count
_MAX_GROUP_RADIUS = SOCIAL_DISTANCE / 2  # m; a group with a larger radius has broken up
_JOIN_TOLERANCE = 0.4  # m, by which a robot that has joined a group may be farther from the centre than the members

Kind = Literal["head-on", "overtaking", "overtaken", "alongside", "crossing", "standing", "waiting"]


@dataclass(frozen=True, slots=True)
class Meeting:
    """The approach of the robot and one human.

    Attributes:
        person: id of the human.
        kind: by the angle between the directions around the nearest moment. `overtaking`: the robot passes the human;
            `overtaken`: the human passes the robot; `standing`: the human stands; `waiting`: the robot stands.
        time: of the nearest moment, s.
        clearance: between the outlines at the nearest moment, m.
        angle: between the directions, 0 to pi, rad.
        side: of the robot, on which the human is at the nearest moment.
        sight_distance: between the centres when a wall first no longer hides them from each other, m; None if they
            see each other from the start, or never.
        crossing_delay: time between the two passages of the point where the paths cross, s; None if they do not cross.
        door_width: of a doorway that both come near, on opposite sides, and that one of them passes, m; None without
            one.
        human_first: whether the human passes the point where the paths cross before the robot.
    """

    person: int
    kind: Kind
    time: float
    clearance: float
    angle: float
    side: Literal["left", "right"]
    sight_distance: float | None
    crossing_delay: float | None
    door_width: float | None
    human_first: bool = False


@dataclass(frozen=True, slots=True)
class GroupMeeting:
    """The approach of the robot and a group, while all members of the group are present and together.

    Attributes:
        group: id.
        blocks_path: whether the straight line from the robot's start to its goal leads through the circle around the
            group, bodies included.
        distance: smallest distance of the robot's centre from the centre of the group, m.
        radius: mean distance of the members from the centre of the group at that moment, m.
        joined: whether the robot stands, at the end, as near to the centre as the members do, or as they did at first.
    """

    group: int
    blocks_path: bool
    distance: float
    radius: float
    joined: bool


@dataclass(frozen=True, slots=True)
class Encounter:
    """All encounters of an episode.

    Attributes:
        meetings: with each human, nearest first.
        groups: with each group.
        neighbours: mean number of humans within 3.6 m of the robot's outline.
        density: mean number of humans per m² of the room.
        trajectory: of robot and humans.
    """

    meetings: tuple[Meeting, ...]
    groups: tuple[GroupMeeting, ...]
    neighbours: float
    density: float
    trajectory: Trajectory = field(repr=False, compare=False)


def encounter(record: EpisodeRecord) -> Encounter:
    """Find the encounters of an episode; of one that is run in memory, pass `EpisodeRecorder.record()`."""
    trajectory = Trajectory(record, is_whole=True)
    scene, clearance = trajectory.scene, trajectory.human_clearance
    present = np.flatnonzero(trajectory.present.any(axis=0)).tolist()
    meetings = sorted((_meeting(trajectory, k) for k in present), key=lambda meeting: meeting.clearance)
    groups = (_group_meeting(trajectory, group) for group in scene.groups)
    return Encounter(
        tuple(meetings),
        tuple(meeting for meeting in groups if meeting is not None),
        float((clearance < SOCIAL_DISTANCE).sum(axis=1).mean()),
        float(trajectory.present.sum(axis=1).mean()) / scene.floor_area,
        trajectory,
    )


def doorways(scene: Scene) -> list[tuple[Point, Point]]:
    """Both ends of each gap of up to 1.3 m between free ends of walls, m."""
    walls = scene.straight_walls.values()
    ends = [end for wall in walls for end in (wall.start, wall.end)]
    barriers = [Barriers.of([(wall.start, wall.end, 0.0)]) for wall in walls]
    free = [end for end in ends if sum(b.gaps(np.array([end])).min() < 1e-3 for b in barriers) == 1]
    return [(a, b) for a, b in combinations(free, 2) if 0.0 < lengths(np.subtract(a, b)) <= _MAX_DOOR_WIDTH]


def _meeting(trajectory: Trajectory, k: int) -> Meeting:
    """The meeting with the human of index k."""
    clearance, dt = trajectory.human_clearance[:, k], trajectory.scene.rules.dt
    nearest = int(np.argmin(clearance))
    near, far = round(_DIRECTION_WINDOW / dt), round(_PASSING_WINDOW / dt)
    robot, human, offset = trajectory.position, trajectory.human_position[:, k], trajectory.offset[:, k]
    entered, left = np.flatnonzero(trajectory.present[:, k])[[0, -1]].tolist()
    first, last = max(nearest - near, entered), min(nearest + near, left)
    moved = robot[last] - robot[first], human[last] - human[first]
    angle = _angle(*moved)
    cross = moved[0][0] * offset[nearest][1] - moved[0][1] * offset[nearest][0]
    delay = _crossing_delay(robot, human, dt)
    return Meeting(
        person=trajectory.scene.humans[k].id,
        kind=_kind(moved, angle, offset[max(nearest - far, entered)], offset[min(nearest + far, left)]),
        time=round(nearest * dt, 4),
        clearance=float(clearance[nearest]),
        angle=angle,
        side="left" if cross > 0.0 else "right",
        sight_distance=_sight_distance(trajectory, k),
        crossing_delay=None if delay is None else abs(delay),
        human_first=delay is not None and delay > 0.0,
        door_width=_door_width(trajectory.scene, robot, human),
    )


def _kind(moved: tuple[Array, Array], angle: float, before: Array, after: Array) -> Kind:
    """Classify a meeting.

    Args:
        moved: displacements of robot and human, (2,) each, m.
        angle: between them, rad.
        before, after: (2,), m, offset from the robot to the human before and after the meeting.
    """
    if not lengths(moved[1]) > _STILL_DISTANCE:
        return "standing"
    if not lengths(moved[0]) > _STILL_DISTANCE:
        return "waiting"
    if angle >= HEAD_ON_ANGLE:
        return "head-on"
    if angle > SAME_WAY_ANGLE:
        return "crossing"
    # in the same direction: compare along it whether the human is ahead of the robot
    along = moved[0] + moved[1]
    ahead_before, ahead_after = float((before * along).sum()), float((after * along).sum())
    if ahead_before > 0.0 > ahead_after:
        return "overtaking"
    return "overtaken" if ahead_before < 0.0 < ahead_after else "alongside"


def _sight_distance(trajectory: Trajectory, k: int) -> float | None:
    """Distance in the first state without a wall between robot and human, m; None if that is the first, or never."""
    walls = Barriers.of((wall.start, wall.end, 0.0) for wall in trajectory.scene.straight_walls.values())
    present = trajectory.present[:, k]
    robot, human = trajectory.position[present], trajectory.human_position[present, k]
    hidden = np.any(segments_cross(robot, human, walls), axis=0)
    if not hidden[0] or hidden.all():
        return None
    return float(trajectory.distance[present, k][int(np.argmin(hidden))])


def _crossing_delay(robot: Array, human: Array, dt: float) -> float | None:
    """Time from the human's to the robot's passage of the point where their paths cross, s; the smallest if several."""
    human_steps = Barriers(human[:-1], human[1:], np.zeros(len(human) - 1))
    human_index, robot_index = np.nonzero(segments_cross(robot[:-1], robot[1:], human_steps))
    if len(robot_index) == 0:
        return None
    delays = robot_index - human_index
    return float(delays[int(np.argmin(np.abs(delays)))]) * dt


def _door_width(scene: Scene, robot: Array, human: Array) -> float | None:
    """Width of the first doorway that robot and human come near on opposite sides, and that one of them passes, m."""
    present = np.isfinite(human[:, 0])
    for a, b in doorways(scene):
        along, middle = np.subtract(b, a), np.add(a, b) / 2
        # sign: the side of the doorway
        robot_side, human_side = (
            along[0] * (track[:, 1] - middle[1]) - along[1] * (track[:, 0] - middle[0]) for track in (robot, human)
        )
        robot_near, human_near = (lengths(track - middle) < _DOOR_RANGE for track in (robot, human))
        passes = human_side[present][0] * human_side[present][-1] < 0.0
        # or it walks up to the doorway, and lets the robot pass first
        yields = robot_side[0] * robot_side[-1] < 0.0 and not human_near[present][0]
        if (passes or yields) and bool(((robot_side * human_side < 0.0) & robot_near & human_near).any()):
            return float(lengths(along))
    return None


def _group_meeting(trajectory: Trajectory, group: Group) -> GroupMeeting | None:
    """The meeting with a group; None if the group is never together."""
    columns = [trajectory.human_column[member] for member in group.members]
    members, extent = trajectory.human_position[:, columns], trajectory.human_radius[columns].max()
    centre = _centres(members, in_circle=group.kind == "talking" and len(group.members) > 2)
    radius = lengths(members - centre[:, None]).mean(axis=1)
    distance = np.where(radius < _MAX_GROUP_RADIUS, lengths(centre - trajectory.position), np.nan)
    if not np.isfinite(distance).any():
        return None
    nearest = int(np.nanargmin(distance))
    straight = Barriers(trajectory.position[:1], np.array([trajectory.scene.goal.position]), np.zeros(1))
    # Members may step aside for a robot that joins them.
    to_first = lengths(trajectory.position[-1] - centre[0])
    joins_first = group.kind == "talking" and to_first < radius[0] + _JOIN_TOLERANCE
    return GroupMeeting(
        group=group.id,
        blocks_path=bool(straight.gaps(centre[nearest : nearest + 1])[0, 0] < radius[nearest] + extent),
        distance=float(distance[nearest]),
        radius=float(radius[nearest]),
        joined=bool(distance[-1] < radius[-1] + _JOIN_TOLERANCE or joins_first),
    )


def _centres(members: Array, *, in_circle: bool) -> Array:
    """Centre of a group in each state.

    Args:
        members: (L, M, 2), m, NaN where absent.
        in_circle: whether to fit a circle, as the mean of an open circle is not its centre.

    Returns:
        (L, 2), m, the mean of the members or the centre of the circle; NaN if a member is absent.

    Source: Kåsa, IEEE Trans. Instrum. Meas. 25 (1976) 8, the least-squares circle.
    """
    centres: Array = members.mean(axis=1)
    if not in_circle:
        return centres
    for index in np.flatnonzero(np.isfinite(centres[:, 0])):
        from_mean = members[index] - centres[index]
        rows = np.column_stack((2 * from_mean, np.ones(len(from_mean))))
        offset = np.linalg.lstsq(rows, (from_mean**2).sum(axis=1), rcond=None)[0][:2]
        if lengths(offset) < lengths(from_mean).max():  # otherwise the members stand in a line
            centres[index] += offset
    return centres


def _angle(a: Array, b: Array) -> float:
    """Angle between two vectors, 0 to pi, rad."""
    return float(abs(np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum())))
