"""The episode file as pydantic models; the JSON Schema, docs/format.md and `check` derive from them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..core.entities import Behaviour, EndsOn, Formation, Kinematics, Reaction
from ..core.snapshot import Status
from ..version import FORMAT, FORMAT_VERSION

Count = Annotated[int, Field(ge=0)]
Probability = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]


class Part(BaseModel):
    """Strict, frozen, finite."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


class Placed(Part):
    """Has a pose in the world frame."""

    x: float = Field(description="m, to the right")
    y: float = Field(description="m, up")
    theta: float = Field(description="rad, counter-clockwise from x")


class Rules(Part):
    """How the episode was run."""

    dt: Positive = Field(description="s, the control tick: one frame")
    substeps: int = Field(ge=1, description="physics steps within a tick")
    iterations: int = Field(ge=1, description="of the contact solver")
    time_limit: Positive = Field(description="s")
    ends_on: list[EndsOn] = Field(description="what ends the episode, besides the time limit")
    guard: bool = Field(description="whether the robot's bumper limits its velocity by the gap")
    contact_distance: float = Field(ge=0, description="m; outlines nearer than this touch")
    side: Literal[-1, 1] = Field(description="+1: people who meet head-on evade to their right; -1: to their left")


class Room(Part):
    """The room."""

    polygon: list[tuple[float, float]] = Field(
        min_length=3, description="m, world frame, counter-clockwise; people and robot stay within"
    )


class DiscShape(Part):
    """A round outline."""

    type: Literal["disc"]
    radius: Positive = Field(description="m")


class RectangleShape(Part):
    """An oblong outline about the pose."""

    type: Literal["rectangle"]
    length: Positive = Field(description="m, along the object's x")
    width: Positive = Field(description="m, along its y")


class Object(Placed):
    """A thing that stands still."""

    id: int
    type: str = Field(description="table, laptop, plant, chair, shelf, tv, …")
    shape: Annotated[DiscShape | RectangleShape, Field(discriminator="type")] = Field(description="the solid outline")
    on: int | None = Field(description="id of what carries it; such a thing has no body of its own")


class Human(Placed):
    """A person: where they start, and how they are."""

    id: int
    radius: Positive = Field(description="m, the solid outline")
    desired_speed: float = Field(ge=0, description="m/s")
    behaviour: Behaviour = Field(description="what they do")
    model: str = Field(description="name of the walking model")
    reacts_to_robot: float = Field(description="0: ignores the robot .. 1: minds it")
    reaction: Reaction = Field(default="avoids", description="how they behave towards the robot")
    robot_clearance: float = Field(
        default=0.83, ge=0, description="m, between outlines, at which they want to pass the robot"
    )
    group: int | None = Field(description="id of their group")
    goals: list[tuple[float, float]] = Field(default=[], description="m, world frame: where one who is walking goes")
    velocity: tuple[float, float] = Field(default=(0.0, 0.0), description="m/s, world frame, at the start")
    enters: Count = Field(default=0, description="tick at which they come in; who is not recorded waits for room")
    leaves: Count | None = Field(default=None, description="tick from which they are gone; null: they stay")
    track: list[tuple[float, float]] = Field(
        default=[], description="m, world frame: where one who is recorded is at each tick from `enters` on"
    )
    exits: bool = Field(default=False, description="whether one who is walking leaves at the last of `goals`")


class Social(Part):
    """What people take up while the episode runs: chances, 0..1, and times."""

    visits: Probability = Field(description="that a wanderer, on arrival, goes to a plant, laptop or other object")
    joins: Probability = Field(
        description="that a wanderer, on arrival, joins somebody who stands, or a group that talks"
    )
    meets: Probability = Field(description="that two wanderers who come near each other stop and talk")
    leaves: Probability = Field(
        description="that who attends to a person or a thing at the start goes away after a time"
    )
    visit_time: tuple[Positive, Positive] = Field(description="s, from and to")
    talk_time: tuple[Positive, Positive] = Field(description="s, from and to")


class Group(Part):
    """People who belong together."""

    id: int
    kind: Literal["talking", "walking"]
    members: list[int] = Field(description="ids of humans; the first one leads")
    formation: Formation | None = Field(default=None, description="how they stand to each other at the start")


class Limits(Part):
    """What the robot's drive can do."""

    ahead: Positive = Field(description="m/s")
    back: Positive = Field(description="m/s")
    sideways: Positive = Field(description="m/s")
    turn: Positive = Field(description="rad/s")
    acceleration: Positive = Field(description="m/s²")
    turn_acceleration: Positive = Field(description="rad/s²")


class Robot(Placed):
    """The robot's start, outline and drive."""

    radius: Positive = Field(description="m, the solid outline")
    kinematics: Kinematics = Field(description="a unicycle has no sideways velocity")
    limits: Limits


class Goal(Placed):
    """Where the robot shall go."""

    distance: Positive = Field(description="m, from centre to centre; nearer counts as reached")
    angle: Positive = Field(description="rad, between the robot's theta and the goal's; 3.1416: any will do")


Interaction = Annotated[
    tuple[int, str, int], Field(description="src (a human's id), relation, dst (id of whom or what they attend to)")
]
TwistRow = Annotated[tuple[float, float, float], Field(description="vx, vy (m/s), omega (rad/s); body frame")]
RobotRow = Annotated[
    tuple[float, float, float, float, float, float],
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s); world frame"),
]
HumanRow = Annotated[
    tuple[float, float, float, float, float, float, float],
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s), head (rad); world frame"),
]


class Controller(Part):
    """Who drove."""

    path: str = Field(description="where it is imported from, package.module:Class")
    version: str | None
    settings: dict[str, Any] | None = Field(description="how it was set, every digit")


class Branch(Part):
    """The episode that this one shares its beginning with."""

    id: str
    tick: Count = Field(description="the first tick that may differ")


class Mirror(Part):
    """The episode that this one is the mirror image of: y and theta changed sign. Seed and settings made that one."""

    id: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of its document, unpacked")
    labels: bool = Field(description="whether labels were changed too; else they are the original's")
    thetas: list[tuple[int, float]] = Field(
        description="index in `objects` and the original's theta, where turning it back does not give every digit"
    )


class Imported(Part):
    """The file of another format that this episode was read from. What it did not tell is null, or stood in for."""

    format: str
    file: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of that file")
    lacks: list[str] = Field(description="keys of this document that it did not tell; nothing there was measured")
    derived: list[str] = Field(description="keys that were computed from what it told")


class Column(Part):
    """A number of a row."""

    name: str
    unit: str
    frame: Literal["world", "body"] = Field(description="frame of reference")


class Columns(Part):
    """What the rows of the frames hold."""

    robot: list[Column]
    humans: list[Column]
    command: list[Column] = Field(description="of `command` and `executed`")


class Outcome(Part):
    """How the episode ended."""

    status: Status
    reason: str
    tick: Count
    time: float = Field(ge=0, description="s")


class Contact(Part):
    """The robot nearer to another outline than the contact distance, at some moment of the tick before."""

    kind: Literal["human", "object", "wall"]
    id: int = Field(description="of the human or object; of a wall its index in `walls`")
    robot_at_fault: bool = Field(description="its own velocity closed the gap")
    other_at_fault: bool = Field(description="the other's velocity closed the gap; both may be, or neither")


class Event(Part):
    """What a person did to a device since the frame before."""

    device: str
    control: str
    value: float = Field(description="its new value, -1..1")


class Look(Part):
    """What is seen at a tick."""

    tick: Count = Field(description="counted from 0")
    time: float = Field(ge=0, description="s, tick times dt")
    robot: RobotRow = Field(description="x, y, theta, vx, vy, omega")
    humans: list[HumanRow | None] = Field(
        description="a row for each of the top-level `humans`: x, y, theta, vx, vy, omega, head; null: not present"
    )
    activity: list[Annotated[int, Field(ge=-1)]] = Field(
        description="of each human, an index into the top-level `activities`; -1: not present"
    )
    interactions: list[Interaction] = Field(description="as they stand now: [src, relation, dst]")
    contacts: list[Contact] = Field(description="the robot's, in the tick before")


class LastLook(Look):
    """What is seen at the end."""

    events: list[Event] | None = Field(default=None, description="of devices, since the last frame; only if any")


class LabelSpec(Part):
    """What a person was asked for."""

    kind: Literal["yes_no", "classes", "slider", "text"]
    when: Literal["frame", "run"] = Field(description="for each frame while driving, or once for the whole run")
    name: str = Field(description="key of the label in frames")
    question: str
    classes: list[str] = Field(description="names of the classes 1, 2, …")
    ends: tuple[str, str] = Field(description="what 0 and 1 of the slider mean")


class Frame(Look):
    """What is seen at a tick, and what was done about it."""

    command: TwistRow = Field(description="what the controller asked for: vx, vy, omega")
    executed: TwistRow = Field(description="what the drive carried out in the tick that begins here: vx, vy, omega")
    guarded: bool = Field(description="whether the guard stepped in during the tick that begins here")
    events: list[Event] = Field(description="of devices, since the frame before")
    label: Any = Field(default=None, description="anything; without this key the command itself is the label")


class Software(Part):
    """What made the file; `check --replay` does not compare it."""

    sonata2d: str
    python: str
    numpy: str
    pymunk: str
    platform: str


class Episode(Part):
    """One episode."""

    format: Literal[FORMAT]  # type: ignore[valid-type]
    version: Literal[FORMAT_VERSION]  # type: ignore[valid-type]
    id: str = Field(description="of the episode")
    name: str = Field(description="of the scenario")
    family: str = Field(description="scenario and kind of room; splits of a data set go by it")
    seed: int = Field(description="of the data set")
    episode: int = Field(description="its number in the data set")
    physics: int = Field(description="version of the physics; another gives other frames")
    precision: Positive = Field(description="numbers in frames are multiples of this")
    settings: dict[str, Any] | None = Field(description="resolved settings of the scenario; null: made by hand")
    rules: Rules
    room: Room
    walls: list[tuple[float, float, float, float]] = Field(description="x1, y1, x2, y2, m, world frame")
    objects: list[Object]
    humans: list[Human] = Field(description="in the order of the rows in the frames")
    groups: list[Group]
    interactions: list[Interaction] = Field(description="at the start: [src, relation, dst]")
    robot: Robot
    goal: Goal
    social: Social | None = Field(
        default=None, description="what people take up while it runs; null or absent: nothing"
    )
    dropped: list[str] = Field(description="what could not be placed although asked for")
    controller: Controller
    labels: dict[str, str] | None = Field(
        description="what the keys of the labels mean; null: the command is the label"
    )
    label_spec: LabelSpec | None = Field(default=None, description="what a person was asked for; only if anything")
    label: Any = Field(default=None, description="of the whole run; only where a person is asked for one")
    contributor: str | None = Field(description="who drove or recorded")
    context: str | None = Field(description="text for whoever judges the episode")
    branched_from: Branch | None
    mirrored_from: Mirror | None = Field(default=None, description="only if it is a mirror image")
    imported: Imported | None = Field(default=None, description="only if it was read from another format")
    columns: Columns
    activities: list[str] = Field(description="names of the numbers in `activity`")
    outcome: Outcome
    frames: list[Frame] = Field(description="one for each tick that was run")
    final: LastLook = Field(description="the look after the last frame, to which no command belongs")
    software: Software
