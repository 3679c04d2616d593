"""What stands or walks in a room, and the Scene that gathers it: values, frozen, at a file's precision."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from .geometry import Point, Pose, Shape

Behaviour = Literal["standing", "wandering", "walking", "recorded"]
Reaction = Literal["ignores", "avoids", "stops", "curious", "scared"]
Kinematics = Literal["holonomic", "unicycle"]
EndsOn = Literal["goal", "time", "contact"]
Formation = Literal["abreast", "v", "face_to_face", "l", "side_by_side", "circle", "semicircle"]

# Relations: the original toolkit's four, and one for any other thing a person attends to.
TALKING = "two_static_person_talking"
AT_LAPTOP = "human_laptop_interaction"
AT_PLANT = "human_plant_interaction"
WALKING_TOGETHER = "wandering_human_interacting"
AT_OBJECT = "human_object_interaction"
RELATIONS = (TALKING, AT_LAPTOP, AT_PLANT, WALKING_TOGETHER, AT_OBJECT)

ROBOT_ID = 0
PERSON_RADIUS = 0.157  # m, as calibrated with the default walking model: half the depth of a body, not its breadth
DEFAULT_MODEL = "sonata2026"


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight rigid wall; its outline is the line itself."""

    start: Point
    end: Point


@dataclass(frozen=True, slots=True)
class Furniture:
    """A rigid thing that stands still. `on` is the id of what carries it: such a thing has no body of its own."""

    id: int
    type: str
    pose: Pose
    shape: Shape
    on: int | None = None


@dataclass(frozen=True, slots=True)
class Human:
    """A person: where they start and how they are.

    Attributes:
        radius: the solid outline, m, which contact, clearance, drawing and metrics all read.
        desired_speed: m/s.
        behaviour: standing: stays; wandering: takes place after place in the room; walking: goes to `goals`;
            recorded: is carried along `track`.
        model: name of the walking model.
        reacts_to_robot: 0 ignores the robot .. 1 minds it; 0 and the reaction `ignores` are the same.
        reaction: how they behave towards the robot.
        robot_clearance: m, from outline to outline, that they want to pass the robot at.
        group: id of the group they belong to.
        goals: m, where one who is walking goes, one after the other; they stay at the last.
        velocity: m/s, world frame, at the start.
        enters: the tick at which they come in, at `pose`; one who is not recorded waits until there is room.
        leaves: the tick from which they are gone; None: they stay.
        track: m, world frame, where one who is recorded is at each tick from `enters` on; they stay at the last.
        exits: whether one who is walking leaves on reaching the last of the goals, instead of staying there.
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

    @property
    def stays(self) -> bool:
        """Whether they are there from the start to the end, unless they exit."""
        return self.enters == 0 and self.leaves is None

    def place_at(self, tick: int) -> Point:
        """Where one who is recorded is at a tick, m: the first place before they enter, the last after the end."""
        return self.track[min(max(tick - self.enters, 0), len(self.track) - 1)]

    def __post_init__(self) -> None:
        if self.reacts_to_robot == 0.0:
            object.__setattr__(self, "reaction", "ignores")
        elif self.reaction == "ignores":
            object.__setattr__(self, "reacts_to_robot", 0.0)


@dataclass(frozen=True, slots=True)
class Group:
    """People who belong together; `members` are human ids, the first one leads.

    Attributes:
        formation: how they stand to each other at the start; who talks in one keeps facing as at the start. None where
            that is left open: who talks then faces the middle of the others.
    """

    id: int
    kind: Literal["talking", "walking"]
    members: tuple[int, ...]
    formation: Formation | None = None


@dataclass(frozen=True, slots=True)
class Interaction:
    """Who (a human's id) attends to whom or what (an id), and how."""

    src: int
    relation: str
    dst: int


@dataclass(frozen=True, slots=True)
class Limits:
    """What the robot's drive can do: m/s, rad/s, m/s2, rad/s2; all positive."""

    ahead: float = 1.0
    back: float = 0.5
    sideways: float = 0.5
    turn: float = 1.5
    acceleration: float = 1.5
    turn_acceleration: float = 3.0


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot's start, outline (a disc, m) and drive."""

    pose: Pose
    radius: float = 0.30
    kinematics: Kinematics = "holonomic"
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class Goal:
    """Where the robot shall go. Reached within `distance` (m) of the centre and `angle` (rad) of theta."""

    x: float
    y: float
    theta: float = 0.0
    distance: float = 0.40
    angle: float = 3.1416

    @property
    def position(self) -> Point:
        return self.x, self.y
