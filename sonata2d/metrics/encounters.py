"""Encounters of the robot with humans and groups in an episode, derived from their positions alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from ..core.entities import Group
from ..core.geometry import Barriers, Point, segments_cross, to_shoulder_line
from ..core.portable_math import Array, unit_vectors
from ..core.proxemics import SOCIAL_DISTANCE
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.vectors import lengths
from ..datasets.motion import THETA
from ..record.record import EpisodeRecord

DIRECTION_WINDOW = 2.0  # s before and after the nearest moment, over which directions of motion are taken
PASSING_WINDOW = 20.0  # s before and after the nearest moment, at which "ahead" and "behind" are compared
STILL_DISTANCE = 0.4  # m; a smaller displacement within the direction window counts as standing
HEAD_ON_ANGLE, SAME_WAY_ANGLE = 3 * np.pi / 4, np.pi / 4  # rad, between the directions of robot and human
DOOR_RANGE, MAX_DOOR_WIDTH = 2.5, 1.3  # m; distance up to which an agent is at a doorway; wider gaps are no doorways
MAX_GROUP_RADIUS = SOCIAL_DISTANCE / 2  # m; a group with a larger radius has broken up
JOIN_TOLERANCE = 0.4  # m, by which a robot that has joined a group may be farther from the centre than the members

Kind = Literal["head-on", "overtaking", "overtaken", "alongside", "crossing", "standing", "waiting"]


@dataclass(frozen=True, eq=False)
class Tracks:
    """Positions in all L states of an episode with N humans; m, world frame, NaN where absent."""

    scene: Scene
    robot: Array  # (L, 2)
    humans: Array  # (L, N, 2)
    direction: Array  # (L, N, 2), unit vectors of the humans' headings

    @classmethod
    def of(cls, episode: EpisodeRecord | Iterable[Snapshot]) -> Tracks:
        """The tracks of a recorded episode, or of the snapshots of a live one."""
        if isinstance(episode, EpisodeRecord):
            robot, humans = episode.states.robot, episode.states.humans
            return cls(episode.scene(), robot[:, :2], humans[:, :, :2], unit_vectors(humans[:, :, THETA]))
        snapshots = list(episode)
        scene = snapshots[0].scene
        robot = np.array([snapshot.robot.position for snapshot in snapshots], dtype=float)
        position, direction = (
            np.stack([s.humans.expand(getattr(s.humans, name), len(scene.humans), np.nan) for s in snapshots])
            for name in ("position", "direction")
        )
        return cls(scene, robot, position, direction)

    @property
    def dt(self) -> float:
        """From one state to the next, s."""
        return self.scene.rules.dt


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


@dataclass(frozen=True, slots=True)
class GroupMeeting:
    """The approach of the robot and a group, while all members of the group are present and together.

    Attributes:
        group: id.
        blocks_path: whether the straight line from the robot's start to its goal leads through the circle around the
            group, bodies included.
        distance: smallest distance of the robot's centre from the centre of the group, m.
        radius: mean distance of the members from the centre of the group at that moment, m.
        joined: whether the robot stands as near to the centre as the members do at the end.
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
    """

    meetings: tuple[Meeting, ...]
    groups: tuple[GroupMeeting, ...]
    neighbours: float
    density: float


def encounter(episode: EpisodeRecord | Iterable[Snapshot]) -> Encounter:
    """Find the encounters of an episode.

    Args:
        episode: a recorded episode, or the snapshots of a live one.
    """
    tracks = Tracks.of(episode)
    scene = tracks.scene
    present = [k for k in range(len(scene.humans)) if np.isfinite(tracks.humans[:, k, 0]).any()]
    meetings = sorted((_meeting(tracks, k) for k in present), key=lambda meeting: meeting.clearance)
    clearance = np.stack([_clearance(tracks, k) for k in present]) if present else np.full((1, 1), np.inf)
    x, y = scene.outline.T
    area = abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / 2
    return Encounter(
        tuple(meetings),
        tuple(meeting for group in scene.groups if (meeting := _group_meeting(tracks, group)) is not None),
        float((clearance < SOCIAL_DISTANCE).sum(axis=0).mean()),
        float(np.isfinite(clearance).sum(axis=0).mean()) / area,
    )


def doorways(scene: Scene) -> list[tuple[Point, Point]]:
    """Both ends of each gap of up to 1.3 m between free ends of walls, m."""
    ends = [end for wall in scene.walls for end in (wall.start, wall.end)]
    barriers = [Barriers.of([(wall.start, wall.end, 0.0)]) for wall in scene.walls]
    free = [end for end in ends if sum(b.gaps(np.array([end])).min() < 1e-3 for b in barriers) == 1]
    return [(a, b) for a, b in combinations(free, 2) if 0.0 < lengths(np.subtract(a, b)) <= MAX_DOOR_WIDTH]


def _meeting(tracks: Tracks, k: int) -> Meeting:
    """The meeting with the human of index k."""
    clearance = _clearance(tracks, k)
    nearest = int(np.argmin(clearance))
    near, far = round(DIRECTION_WINDOW / tracks.dt), round(PASSING_WINDOW / tracks.dt)
    robot, human = tracks.robot, tracks.humans[:, k]
    entered, left = np.flatnonzero(np.isfinite(clearance))[[0, -1]].tolist()  # first and last state with the human
    first, last = max(nearest - near, entered), min(nearest + near, left)
    moved = robot[last] - robot[first], human[last] - human[first]
    angle = _angle(*moved)
    offset = human - robot
    cross = moved[0][0] * offset[nearest][1] - moved[0][1] * offset[nearest][0]
    return Meeting(
        person=tracks.scene.humans[k].id,
        kind=_kind(moved, angle, offset[max(nearest - far, entered)], offset[min(nearest + far, left)]),
        time=round(nearest * tracks.dt, 4),
        clearance=float(clearance[nearest]),
        angle=angle,
        side="left" if cross > 0.0 else "right",
        sight_distance=_sight_distance(tracks, k),
        crossing_delay=_crossing_delay(tracks, k),
        door_width=_door_width(tracks, k),
    )


def _clearance(tracks: Tracks, k: int) -> Array:
    """(L,), m, between the outlines of the robot and a human; inf where the human is absent."""
    human = tracks.scene.humans[k]
    to_line = to_shoulder_line(tracks.humans[:, k] - tracks.robot, tracks.direction[:, k], human.shoulder)
    clearance = lengths(to_line) - human.radius - tracks.scene.robot.radius
    return np.where(np.isfinite(clearance), clearance, np.inf)


def _kind(moved: tuple[Array, Array], angle: float, before: Array, after: Array) -> Kind:
    """Classify a meeting.

    Args:
        moved: displacements of robot and human, (2,) each, m.
        angle: between them, rad.
        before, after: (2,), m, offset from the robot to the human before and after the meeting.
    """
    if not lengths(moved[1]) > STILL_DISTANCE:
        return "standing"
    if not lengths(moved[0]) > STILL_DISTANCE:
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


def _sight_distance(tracks: Tracks, k: int) -> float | None:
    """Distance in the first state without a wall between robot and human, m; None if that is the first, or none."""
    walls = Barriers.of((wall.start, wall.end, 0.0) for wall in tracks.scene.walls)
    present = np.isfinite(tracks.humans[:, k, 0])
    robot, human = tracks.robot[present], tracks.humans[present, k]
    hidden = np.any(segments_cross(robot, human, walls), axis=0)
    if not hidden[0] or hidden.all():
        return None
    return float(lengths(human - robot)[int(np.argmin(hidden))])


def _crossing_delay(tracks: Tracks, k: int) -> float | None:
    """Time between the passages of robot and human at the point where their paths cross, s; the smallest if several."""
    robot, human = tracks.robot, tracks.humans[:, k]
    human_steps = Barriers(human[:-1], human[1:], np.zeros(len(human) - 1))
    human_index, robot_index = np.nonzero(segments_cross(robot[:-1], robot[1:], human_steps))
    return None if len(robot_index) == 0 else float(np.abs(robot_index - human_index).min()) * tracks.dt


def _door_width(tracks: Tracks, k: int) -> float | None:
    """Width of the first doorway that robot and human come near on opposite sides, and that one of them passes, m."""
    for a, b in doorways(tracks.scene):
        start, end = np.array(a), np.array(b)
        along, middle = end - start, (start + end) / 2
        # sign: the side of the doorway
        robot, human = (
            along[0] * (track[:, 1] - middle[1]) - along[1] * (track[:, 0] - middle[0])
            for track in (tracks.robot, tracks.humans[:, k])
        )
        near = [lengths(track - middle) < DOOR_RANGE for track in (tracks.robot, tracks.humans[:, k])]
        present = np.isfinite(human)
        passes = human[present][0] * human[present][-1] < 0.0
        # or it walks up to the doorway, and lets the robot pass first
        yields = robot[0] * robot[-1] < 0.0 and not near[1][present][0]
        if (passes or yields) and bool(((robot * human < 0.0) & near[0] & near[1]).any()):
            return float(lengths(along))
    return None


def _group_meeting(tracks: Tracks, group: Group) -> GroupMeeting | None:
    """The meeting with a group; None if the group is never together."""
    column = {human.id: k for k, human in enumerate(tracks.scene.humans)}
    rows = [column[m] for m in group.members]
    members, extent = tracks.humans[:, rows], max(tracks.scene.humans[k].radius for k in rows)
    centre = _centres(members, in_circle=group.kind == "talking" and len(group.members) > 2)
    radius = lengths(members - centre[:, None]).mean(axis=1)
    distance = np.where(radius < MAX_GROUP_RADIUS, lengths(centre - tracks.robot), np.nan)
    if not np.isfinite(distance).any():
        return None
    nearest = int(np.nanargmin(distance))
    goal = np.array([tracks.scene.goal.position])
    straight = Barriers(tracks.robot[:1], goal, np.zeros(1))
    return GroupMeeting(
        group=group.id,
        blocks_path=bool(straight.gaps(centre[nearest : nearest + 1])[0, 0] < radius[nearest] + extent),
        distance=float(distance[nearest]),
        radius=float(radius[nearest]),
        joined=bool(distance[-1] < radius[-1] + JOIN_TOLERANCE),
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
