"""Entities of a scene: walls, furniture, doors, queues, places, pedestrians, groups, interactions, robot and goal.

All are frozen values, at the precision of files. The schema of the episode file is derived from them: from the types of
the fields, with their bounds, and from the descriptions under `Attributes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from .attributes import Attributes
from .bounds import ADDITIVE, Capacity, Count, Fraction, Id, NotNegative, Number, Positive
from .geometry import Disc, Point, Pose, Rectangle, Shape, Stadium, quantised
from .vectors import wrap_angle

Behaviour = Literal["standing", "wandering", "walking", "recorded"]
Reaction = Literal["ignores", "avoids", "stops", "curious", "scared"]
EndsOn = Literal["goal", "time", "contact"]
RobotTask = Literal["go", "meet", "follow", "accompany", "lead", "wait"]
AT_PERSON = frozenset({"meet", "follow", "accompany"})  # tasks whose goal moves with the person
Formation = Literal["abreast", "v", "face_to_face", "l", "side_by_side", "circle", "semicircle"]

ROBOT_ID = 0
ANY_HEADING = 3.14  # rad; a goal whose angle tolerance is at least this accepts every heading
_HALF_BODY = 0.25  # m, from the side of a door to the centre of a pedestrian
PERSON_RADIUS = 0.14  # m, half the depth of a body
PERSON_BREADTH = 0.45  # m, from shoulder to shoulder
DEFAULT_MODEL = "sonata2026"
DEFAULT_KIND = "adult"  # of persons
DEFAULT_CONTROLLER = "social-planner"  # of robots besides the first one


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight rigid wall without thickness; m, world frame."""

    start: Point
    end: Point


@dataclass(frozen=True, slots=True)
class Furniture:
    """A rigid object that does not move, such as a piece of furniture.

    Attributes:
        id: unique among pedestrians and objects; 0 is the robot.
        type: name of its type, such as table, laptop, plant or chair.
        pose: of the centre, world frame.
        shape: solid outline.
        on: id of the object that carries this one; a carried object has no physical body. None: it is on the floor.
        seat: whether one pedestrian can sit on it, above its centre and facing its front; None: see `is_seat_by_type`.
        attributes: values by name, see `Scene.attributes`; None: there are none.
    """

    id: Id
    type: str
    pose: Pose
    shape: Shape
    on: Id | None = None
    seat: bool | None = None
    attributes: Attributes | None = field(default=None, hash=False, metadata=ADDITIVE)

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
        half = [side / 2 for side in shape.sides]
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

    id: Id
    pose: Pose
    width: Positive = 1.0
    share: NotNegative = 1.0

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

    id: Id
    pose: Pose
    spacing: Positive = 0.75
    service: tuple[NotNegative, NotNegative] = (5.0, 15.0)
    capacity: Capacity = 8

    def slot(self, number: int) -> Point:
        """Where the pedestrian with this number stands, the first being 0; m."""
        return self.pose.to_world((-self.spacing * number, 0.0))


@dataclass(frozen=True, slots=True)
class Place:
    """A place of interest: if a scene has any, wandering pedestrians go to them instead of anywhere.

    Attributes:
        id: unique among places.
        x, y: centre, m, world frame.
        radius: m; pedestrians go to a random point within it.
        weight: relative frequency with which pedestrians choose this place.
        stay: shortest and longest time that a pedestrian stands there, s.
    """

    id: Id
    x: Number
    y: Number
    radius: Positive = 1.0
    weight: Positive = 1.0
    stay: tuple[NotNegative, NotNegative] = (5.0, 20.0)

    @property
    def position(self) -> Point:
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Area:
    """A named part of the floor, with rules for robots.

    The rules are known to planners and metrics; the simulation does not enforce them.

    Attributes:
        name: unique among areas.
        polygon: corners in order, m, world frame.
        no_go: whether robots must stay outside, with their whole outlines.
        speed_limit: highest speed of a robot whose centre is in the area, m/s; None: only its drive limits it.
        one_way: heading, rad, world frame, of the only direction, up to a right angle, in which the centre of a robot
            may move in the area; None: every direction.
        attributes: values by name, see `Scene.attributes`; None: there are none.
    """

    name: str
    polygon: tuple[Point, ...]
    no_go: bool = field(default=False, metadata=ADDITIVE)
    speed_limit: Positive | None = field(default=None, metadata=ADDITIVE)
    one_way: Number | None = field(default=None, metadata=ADDITIVE)
    attributes: Attributes | None = field(default=None, hash=False, metadata=ADDITIVE)

    def edges(self) -> list[tuple[Point, Point, float]]:
        """The edges, as barriers without thickness."""
        return [(a, b, 0.0) for a, b in zip(self.polygon, (*self.polygon[1:], self.polygon[0]), strict=True)]


@dataclass(frozen=True, slots=True)
class Human:
    """A pedestrian: initial state and properties.

    A pedestrian that does not react to the robot has both `reacts_to_robot` 0 and the reaction `ignores`; setting
    either of them sets the other.

    Attributes:
        id: unique among pedestrians and objects; 0 is the robot.
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
        goals: destinations of a walking pedestrian in order, m, world frame; it stays at the last one.
        velocity: at the start or on entering, m/s, world frame.
        enters: tick at which the pedestrian appears; unless it is recorded, it waits until there is room.
        leaves: tick from which the pedestrian is absent; None: never.
        track: position of a recorded pedestrian at each tick from `enters` on, m, world frame; it stays at the last.
        exits: whether a walking pedestrian leaves the scene at the last of its goals instead of staying there.
        stays: time that a walking pedestrian stands at each of its goals but the last, s; missing ones are 0.
        seat: id of the object that a wandering pedestrian sits on at the start.
        queue: id of the queue in which a wandering pedestrian stands at the start; the nearer one to its head is first.
        breadth: of the shoulders, m. The solid outline, from which contacts, clearances, drawings and metrics are
            computed, is all within `radius` of the shoulder line, which is `breadth` - 2 `radius` long and lies across
            the heading; a disc if `breadth` is not more than 2 `radius`. Of a body with a `length` this line lies along
            the heading.
        headway: factor of the time gap that the pedestrian keeps to those ahead.
        politeness: factor of the strength with which the pedestrian avoids others.
        pre_movement: time for which the pedestrian stands before it walks for the first time, s.
        reaction_time: from the moment at which a robot comes into view until the pedestrian reacts to it, s.
        kind: name of the kind of person, such as adult, child or wheelchair.
        length: of a body that is longer than broad, m, along its heading, such as of a person in a wheelchair; the
            shoulder line is then `length` - 2 `radius` long and lies along the heading, and `breadth` is 2 `radius`.
            0: the body is not longer than broad.
        side_steps: whether the pedestrian can move sideways. One that cannot, because it is on wheels or pushes a cart,
            moves along its heading only, and turns to where it wants to go.
        attributes: values by name, see `Scene.attributes`; None: there are none.
    """

    id: Id
    pose: Pose
    radius: Positive = PERSON_RADIUS
    desired_speed: NotNegative = 1.3
    behaviour: Behaviour = "standing"
    model: str = DEFAULT_MODEL
    reacts_to_robot: Fraction = 1.0
    reaction: Reaction = "avoids"
    robot_clearance: NotNegative = 0.1
    group: Id | None = None
    goals: tuple[Point, ...] = ()
    velocity: Point = (0.0, 0.0)
    enters: Count = 0
    leaves: Count | None = None
    track: tuple[Point, ...] = ()
    exits: bool = False
    stays: tuple[NotNegative, ...] = ()
    seat: Id | None = None
    queue: Id | None = None
    breadth: Positive = PERSON_BREADTH
    headway: Positive = 1.0
    politeness: NotNegative = 1.0
    pre_movement: NotNegative = field(default=0.0, metadata=ADDITIVE)
    reaction_time: NotNegative = field(default=0.0, metadata=ADDITIVE)
    kind: str = field(default=DEFAULT_KIND, metadata=ADDITIVE)
    length: NotNegative = field(default=0.0, metadata=ADDITIVE)
    side_steps: bool = field(default=True, metadata=ADDITIVE)
    attributes: Attributes | None = field(default=None, hash=False, metadata=ADDITIVE)

    @property
    def shoulder(self) -> float:
        """Half the length of the shoulder line, m; negative if it lies along the heading, 0 for a disc."""
        return half_shoulder_line(self.radius, self.breadth, self.length)

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


def half_shoulder_line(radius: float, breadth: float, length: float) -> float:
    """Half the length of the shoulder line of a body, m; negative if it lies along the heading, 0 for a disc.

    Args:
        radius, breadth, length: see `Human`, m.
    """
    return radius - length / 2 if length > 2.0 * radius else max(breadth / 2 - radius, 0.0)


@dataclass(frozen=True, slots=True)
class Group:
    """Pedestrians that talk or walk together.

    Attributes:
        id: unique among groups.
        kind: what the members do together.
        members: ids of the pedestrians; the first one leads.
        formation: spatial arrangement at the start, whose members keep their heading while they talk. None: no
            arrangement; members that talk face the centre of the others.
    """

    id: Id
    kind: Literal["talking", "walking"]
    members: tuple[Id, ...]
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
    """Limits of the robot's drive.

    Attributes:
        ahead, back, sideways: speed, m/s.
        turn: turn rate, rad/s.
        acceleration: m/s².
        turn_acceleration: rad/s².
    """

    ahead: Positive = 1.0
    back: Positive = 0.5
    sideways: Positive = 0.5
    turn: Positive = 1.5
    acceleration: Positive = 1.5
    turn_acceleration: Positive = 3.0


_FORWARD_ONLY = ("unicycle", "differential", "bicycle")  # built-in drives without sideways motion


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot's start, outline and drive.

    Attributes:
        pose: at the start, world frame.
        radius: of the solid outline, a disc, m; of another outline, of the smallest circle around it.
        kinematics: name of the drive; holonomic: moves in every direction; unicycle: along its heading only.
        limits: of the drive.
        shape: solid outline that is no disc; None: the disc.
        drive: parameters of the drive by name, see the section on drives in the docs; None: it has none.
    """

    pose: Pose
    radius: Positive = 0.30
    kinematics: str = "holonomic"
    limits: Limits = field(default_factory=Limits)
    shape: Shape | None = field(default=None, metadata=ADDITIVE)
    drive: dict[str, Number] | None = field(default=None, metadata=ADDITIVE)

    def __post_init__(self) -> None:
        if self.shape is not None:
            radius = self.shape.circumradius
            if isinstance(self.shape, Disc):
                object.__setattr__(self, "shape", None)
            else:  # the circle lies around the outline in spite of rounding
                radius = math.ceil(radius * 10_000.0 - 1e-6) / 10_000.0
            object.__setattr__(self, "radius", quantised(radius))

    @property
    def outline(self) -> Shape:
        """The solid outline."""
        return self.shape or Disc(self.radius)

    @property
    def moves_sideways(self) -> bool:
        """Whether the drive can move sideways; of a plug-in, unless its parameter `sideways` is 0."""
        return self.kinematics not in _FORWARD_ONLY and (self.drive or {}).get("sideways", 1.0) != 0.0

    @property
    def sideways_limit(self) -> float:
        """Limit of the sideways speed, m/s; 0 for a drive that moves along its heading only."""
        return self.limits.sideways if self.moves_sideways else 0.0

    @property
    def top_speed(self) -> float:
        """Highest speed within the limits, m/s."""
        forward, sideways = max(self.limits.ahead, self.limits.back), self.sideways_limit
        if self.kinematics == "bicycle":  # the centre, which lies before the rear axle, moves sideways in curves
            sideways = (self.drive or {}).get("rear", 0.0) * self.limits.turn
        return math.sqrt(forward * forward + sideways * sideways)


@dataclass(frozen=True, slots=True)
class Goal:
    """The robot's goal, a pose in the world frame, and its task there.

    Tasks end with the outcome `goal` as follows. `go`: the robot is at the position, and then at each of the further
    places. `meet`: it is near the person. `follow`, `accompany`: the person is at the end of its way, and the robot is
    near it. `lead`: the robot is at the position, and the person is near it. `wait`: likewise; the person comes by
    itself. A `Snapshot` has the goal of its tick: the place that is next, or the one at the person, or beside it to
    accompany it, to 0.25 m.

    Attributes:
        x, y: position, m; of the first place, or of the person at the start.
        theta: heading, rad.
        distance: largest distance of the robot's centre from the position at which the goal counts as reached, m.
        angle: largest heading error at which the goal counts as reached, rad; 3.1416: any heading. Of several places,
            it holds at the last.
        task: what the robot does.
        person: id of the person to meet, follow, accompany, lead or wait for; None for `go`.
        near: largest distance between the centres of robot and person at which they are near each other, m.
        then: further places of the task `go`, in order, m.
        object: id of the object that the position is beside; None: any position.
    """

    x: Number
    y: Number
    theta: Number = 0.0
    distance: Positive = 0.40
    angle: Positive = 3.1416
    task: RobotTask = field(default="go", metadata=ADDITIVE)
    person: Id | None = field(default=None, metadata=ADDITIVE)
    near: Positive = field(default=2.0, metadata=ADDITIVE)
    then: tuple[Point, ...] = field(default=(), metadata=ADDITIVE)
    object: Id | None = field(default=None, metadata=ADDITIVE)

    @property
    def moves(self) -> bool:
        """Whether the goal is at other places in later ticks."""
        return bool(self.then) or self.task in AT_PERSON

    @property
    def is_plain(self) -> bool:
        """Whether the task is to be at one position."""
        return self.person is None and not self.then

    @property
    def position(self) -> Point:
        return self.x, self.y

    def is_reached(self, pose: Pose) -> bool:
        """Whether a robot at a pose is near enough, and faces in an accepted direction."""
        dx, dy = self.x - pose.x, self.y - pose.y
        turned = abs(wrap_angle(pose.theta - self.theta)) if self.angle < ANY_HEADING else 0.0
        return math.sqrt(dx * dx + dy * dy) <= self.distance and turned <= self.angle


@dataclass(frozen=True, slots=True)
class OtherRobot:
    """A robot of a scene besides its first one.

    Attributes:
        id: unique among robots, pedestrians and objects; the first robot of a scene has the id 0.
        robot: its start, outline and drive.
        goal: of this robot.
        controller: registered name or import path of its controller, unless an episode gets another one.
    """

    id: Id
    robot: Robot
    goal: Goal
    controller: str = field(default=DEFAULT_CONTROLLER, compare=False)
