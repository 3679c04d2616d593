"""Entities of a scene: walls, furniture, doors, queues, places, pedestrians, groups, interactions, robot and goal.

All are frozen values, at the precision of files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from .geometry import Disc, Point, Pose, Rectangle, Shape, Stadium
from .vectors import wrap_angle

Behaviour = Literal["standing", "wandering", "walking", "recorded"]
Reaction = Literal["ignores", "avoids", "stops", "curious", "scared"]
Kinematics = Literal["holonomic", "unicycle"]
EndsOn = Literal["goal", "time", "contact"]
Formation = Literal["abreast", "v", "face_to_face", "l", "side_by_side", "circle", "semicircle"]

ROBOT_ID = 0
ANY_HEADING = 3.14  # rad; a goal whose angle tolerance is at least this accepts every heading
_HALF_BODY = 0.25  # m, from the side of a door to the centre of a pedestrian
PERSON_RADIUS = 0.14  # m, half the depth of a body
PERSON_BREADTH = 0.45  # m, from shoulder to shoulder
DEFAULT_MODEL = "sonata2026"


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight rigid wall without thickness; m, world frame."""

    start: Point
    end: Point


@dataclass(frozen=True, slots=True)
class Furniture:
    """A rigid object that does not move.

    Attributes:
        on: id of the object that carries this one; a carried object has no physical body. None: it is on the floor.
        seat: whether one pedestrian can sit on it, above its centre and facing its front; None: see `is_seat_by_type`.
    """

    id: int
    type: str
    pose: Pose
    shape: Shape
    on: int | None = None
    seat: bool | None = None

    @property
    def front(self) -> Point:
        """Unit vector from the centre to the front, world frame: along -y if it is longer (x) than wide, else +x."""
        x, y = self.pose.direction
        is_oblong = isinstance(self.shape, Rectangle) and self.shape.length > self.shape.width
        return (y, -x) if is_oblong else (x, y)

    @property
    def is_seat(self) -> bool:
        """Whether pedestrians can sit on it; nothing that another object carries is a seat."""
        return self.on is None and is_seat_by_type(self.type, self.seat)

    def approaches(self, clearance: float) -> list[Point]:
        """Where a pedestrian can stand before it sits down, m: in front of the object, to its left, to its right.

        Args:
            clearance: of these places from the object, m.
        """
        shape, (x, y), (fx, fy) = self.shape, self.pose.position, self.front
        half = (shape.radius, shape.radius) if isinstance(shape, Disc) else (shape.length / 2, shape.width / 2)
        ahead, aside = min(half) + clearance, max(half) + clearance
        return [(x + fx * ahead, y + fy * ahead), (x - fy * aside, y + fx * aside), (x + fy * aside, y - fx * aside)]


def is_seat_by_type(type: str, seat: bool | None) -> bool:
    """Whether an object is a seat: as `seat` says; if it is None, as files have it, chairs are the only seats."""
    return type == "chair" if seat is None else seat


@dataclass(frozen=True, slots=True)
class Door:
    """An opening in the outline of the room, through which pedestrians enter and leave.

    The wall stays solid: pedestrians appear just inside the opening, and disappear just before it.

    Attributes:
        id: unique among doors.
        pose: middle of the opening, on the wall; theta points into the room.
        width: m.
        share: weight with which pedestrians that leave choose this door.
    """

    id: int
    pose: Pose
    width: float = 1.0
    share: float = 1.0

    @property
    def reach(self) -> float:
        """Largest distance of the centre of a pedestrian who passes from the middle of the opening, m."""
        return max(self.width / 2 - _HALF_BODY, 0.0)


@dataclass(frozen=True, slots=True)
class Queue:
    """A place where pedestrians stand in line, straight back from the first one.

    Attributes:
        id: unique among queues.
        pose: where the first pedestrian stands, and what it faces.
        spacing: distance of neighbours, m.
        service: shortest and longest time that the first pedestrian needs, s.
        capacity: largest number of pedestrians.
    """

    id: int
    pose: Pose
    spacing: float = 0.75
    service: tuple[float, float] = (5.0, 15.0)
    capacity: int = 8

    def slot(self, number: int) -> Point:
        """Where the pedestrian with this number stands, the first being 0; m."""
        return self.pose.to_world((-self.spacing * number, 0.0))


@dataclass(frozen=True, slots=True)
class Place:
    """A place of interest: if a scene has any, wandering pedestrians go to them instead of anywhere.

    Attributes:
        id: unique among places.
        x, y: centre, m.
        radius: m; pedestrians go to a random point within it.
        weight: with which the place is chosen.
        stay: shortest and longest time that a pedestrian stands there, s.
    """

    id: int
    x: float
    y: float
    radius: float = 1.0
    weight: float = 1.0
    stay: tuple[float, float] = (5.0, 20.0)

    @property
    def position(self) -> Point:
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Human:
    """A pedestrian: initial state and properties.

    A pedestrian that does not react to the robot has both `reacts_to_robot` 0 and the reaction `ignores`; setting
    either of them sets the other.

    Attributes:
        pose: at the start, or on entering; world frame.
        radius: half the depth of the body, m.
        desired_speed: m/s.
        behaviour: standing: stays in place; wandering: walks to one random place after another; walking: walks to
            `goals`; recorded: is moved along `track`.
        model: name of the pedestrian model.
        reacts_to_robot: weight of the robot in the pedestrian's motion, from 0 (ignores it) to 1.
        reaction: kind of behaviour towards the robot.
        robot_clearance: preferred gap between the outlines when passing the robot, m.
        group: id of the group that the pedestrian belongs to.
        goals: destinations of a walking pedestrian in order, m; it stays at the last one.
        velocity: at the start or on entering, m/s, world frame.
        enters: tick at which the pedestrian appears at `pose`; unless it is recorded, it waits until there is room.
        leaves: tick from which the pedestrian is absent; None: never.
        track: position of a recorded pedestrian at each tick from `enters` on, m, world frame; it stays at the last.
        exits: whether a walking pedestrian leaves the scene at the last of its goals instead of staying there.
        stays: time that a walking pedestrian stands at each of its goals but the last, s; missing ones are 0.
        seat: id of the object that a wandering pedestrian sits on at the start.
        queue: id of the queue in which a wandering pedestrian stands at the start; the nearer one to its head is first.
        breadth: of the shoulders, m. The solid outline, from which contacts, clearances, drawings and metrics are
            computed, is all within `radius` of the shoulder line, which is `breadth` - 2 `radius` long and lies across
            the heading; a disc if `breadth` is not more than 2 `radius`.
        headway: factor of the time gap that the pedestrian keeps to those ahead.
        politeness: factor of the strength with which the pedestrian avoids others.
    """

    id: int
    pose: Pose
    radius: float = PERSON_RADIUS
    desired_speed: float = 1.3
    behaviour: Behaviour = "standing"
    model: str = DEFAULT_MODEL
    reacts_to_robot: float = 1.0
    reaction: Reaction = "avoids"
    robot_clearance: float = 0.83
    group: int | None = None
    goals: tuple[Point, ...] = ()
    velocity: Point = (0.0, 0.0)
    enters: int = 0
    leaves: int | None = None
    track: tuple[Point, ...] = ()
    exits: bool = False
    stays: tuple[float, ...] = ()
    seat: int | None = None
    queue: int | None = None
    breadth: float = PERSON_BREADTH
    headway: float = 1.0
    politeness: float = 1.0

    @property
    def shoulder(self) -> float:
        """Half the length of the shoulder line, m; 0 for a disc."""
        return max(self.breadth / 2 - self.radius, 0.0)

    @property
    def shape(self) -> Stadium:
        """The outline."""
        return Stadium(self.radius, self.shoulder)

    @property
    def walks_at_start(self) -> bool:
        """Whether the pedestrian walks when the episode begins, or when it enters."""
        return self.behaviour != "standing" and self.seat is None and self.queue is None

    @property
    def is_always_present(self) -> bool:
        """Whether the pedestrian is present from start to end, unless it exits at a goal or through a door."""
        return self.enters == 0 and self.leaves is None

    def track_position(self, tick: int) -> Point:
        """Position of a recorded pedestrian at a tick, m; its first or last one outside the track."""
        return self.track[min(max(tick - self.enters, 0), len(self.track) - 1)]

    def __post_init__(self) -> None:
        if self.reacts_to_robot == 0.0:
            object.__setattr__(self, "reaction", "ignores")
        elif self.reaction == "ignores":
            object.__setattr__(self, "reacts_to_robot", 0.0)


@dataclass(frozen=True, slots=True)
class Group:
    """Pedestrians that belong together.

    Attributes:
        members: ids of the pedestrians; the first one leads.
        formation: spatial arrangement at the start, whose members keep their heading while they talk. None: no
            arrangement; members that talk face the centre of the others.
    """

    id: int
    kind: Literal["talking", "walking"]
    members: tuple[int, ...]
    formation: Formation | None = None


@dataclass(frozen=True, slots=True)
class Interaction:
    """A directed relation: the pedestrian `src` attends to the pedestrian or object `dst`.

    Attributes:
        src: id of a pedestrian.
        relation: one of `relations.RELATIONS`.
        dst: id of a pedestrian or an object.
    """

    src: int
    relation: str
    dst: int


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the robot's drive, all positive.

    Attributes:
        ahead, back, sideways: speeds, m/s.
        turn: rad/s.
        acceleration: m/s^2.
        turn_acceleration: rad/s^2.
    """

    ahead: float = 1.0
    back: float = 0.5
    sideways: float = 0.5
    turn: float = 1.5
    acceleration: float = 1.5
    turn_acceleration: float = 3.0


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot: initial pose (world frame), radius of its circular outline (m), and drive."""

    pose: Pose
    radius: float = 0.30
    kinematics: Kinematics = "holonomic"
    limits: Limits = field(default_factory=Limits)

    @property
    def sideways_limit(self) -> float:
        """Limit of the sideways speed, m/s; 0 for a unicycle."""
        return self.limits.sideways if self.kinematics == "holonomic" else 0.0

    @property
    def top_speed(self) -> float:
        """Highest speed within the limits, m/s."""
        forward, sideways = max(self.limits.ahead, self.limits.back), self.sideways_limit
        return math.sqrt(forward * forward + sideways * sideways)


@dataclass(frozen=True, slots=True)
class Goal:
    """Target pose of the robot, world frame; reached within `distance` (m) of (x, y) and `angle` (rad) of theta."""

    x: float
    y: float
    theta: float = 0.0
    distance: float = 0.40
    angle: float = 3.1416

    @property
    def position(self) -> Point:
        return self.x, self.y

    def is_reached(self, pose: Pose) -> bool:
        """Whether a robot at a pose is near enough, and faces in an accepted direction."""
        dx, dy = self.x - pose.x, self.y - pose.y
        turned = abs(wrap_angle(pose.theta - self.theta)) if self.angle < ANY_HEADING else 0.0
        return math.sqrt(dx * dx + dy * dy) <= self.distance and turned <= self.angle
