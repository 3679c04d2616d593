"""Schema of the episode file as pydantic models; the JSON Schema, docs/format.md and `check` are derived from them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

from ..core.entities import Behaviour, EndsOn, Formation, Kinematics, Reaction
from ..core.files.limits import MAX_COUNT, MAX_ID, MAX_SUBSTEPS
from ..core.furniture_types import BUILT_IN
from ..core.geometry import MAX_MAGNITUDE
from ..core.snapshot import Status
from ..version import FORMAT, FORMAT_VERSION

# The names of the classes are part of the published JSON Schema, except those of base classes.

Number = Annotated[float, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Positive = Annotated[float, Field(gt=0, le=MAX_MAGNITUDE)]
NotNegative = Annotated[float, Field(ge=0, le=MAX_MAGNITUDE)]
Probability = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0)]
Id = Annotated[int, Field(ge=-MAX_ID, le=MAX_ID)]
Steps = Annotated[int, Field(ge=1, le=MAX_SUBSTEPS)]
LIST = Strict(False)  # marks a tuple that is also accepted as a list, as parsed JSON has no tuples
Pair = Annotated[tuple[Number, Number], LIST]

T = TypeVar("T")
# Checking ends at the first faulty entry of a list: 1 MB may hold a million faults, which would take gigabytes.
ListOf = Annotated[list[T], Field(fail_fast=True)]


def _with_people(settings: dict[str, Any]) -> dict[str, Any]:
    """Require that the listed people, which data cards count, are mappings; the rest may be anything."""
    people = settings.get("people", [])
    if not isinstance(people, list) or not all(isinstance(person, dict) for person in people):
        raise ValueError("people must be a list of mappings")
    return settings


Settings = Annotated[dict[str, Any], AfterValidator(_with_people)]  # resolved settings of a scenario


class Part(BaseModel):
    """Base class of all models: immutable, with strict types and finite numbers."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)


class Placed(Part):
    """Base class of models with a pose in the world frame."""

    x: Number = Field(description="m, to the right")
    y: Number = Field(description="m, up")
    theta: Number = Field(description="rad, counter-clockwise from x")


class Rules(Part):
    """Rules of the episode."""

    dt: Positive = Field(description="s, control period: the time between frames")
    substeps: Steps = Field(description="number of physics steps in a tick")
    iterations: Steps = Field(description="of the contact solver")
    time_limit: Positive = Field(description="s")
    ends_on: ListOf[EndsOn] = Field(description="conditions that end the episode, in addition to the time limit")
    guard: bool = Field(description="whether the safety guard limits the robot's velocity by the gap to obstacles")
    contact_distance: NotNegative = Field(description="m; outlines with a smaller gap are in contact")
    side: Literal[-1, 1] = Field(
        description="+1: pedestrians that meet head-on evade to their right; -1: to their left"
    )


class Room(Part):
    """The room."""

    polygon: ListOf[Pair] = Field(
        min_length=3, description="m, world frame, counter-clockwise; pedestrians and robot stay inside"
    )


class DiscShape(Part):
    """A circular outline."""

    type: Literal["disc"]
    radius: Positive = Field(description="m")


class RectangleShape(Part):
    """A rectangular outline, centred at the pose."""

    type: Literal["rectangle"]
    length: Positive = Field(description="m, along the object's x axis")
    width: Positive = Field(description="m, along the object's y axis")


class Object(Placed):
    """A static object, such as a piece of furniture."""

    id: Id
    type: str = Field(description=", ".join([*(kind.name for kind in BUILT_IN), "…"]))
    shape: Annotated[DiscShape | RectangleShape, Field(discriminator="type")] = Field(description="the solid outline")
    on: Id | None = Field(description="id of the object that it lies on; then it has no solid outline of its own")
    seat: bool | None = Field(
        default=None,
        description="whether one person can sit on it, above its centre and facing its front; null: if it is a chair",
    )


class Door(Placed):
    """An opening in the outline of the room: its middle, with theta into the room."""

    id: Id = Field(description="unique among doors")
    width: Positive = Field(description="m")
    share: NotNegative = Field(description="weight with which pedestrians that leave choose this door")


class Queue(Placed):
    """A place where pedestrians stand in line: pose of the first one; the others stand straight behind it."""

    id: Id = Field(description="unique among queues")
    spacing: Positive = Field(description="m, distance of neighbours")
    service: Annotated[tuple[NotNegative, NotNegative], LIST] = Field(
        description="s, shortest and longest time that the first pedestrian needs"
    )
    capacity: Annotated[int, Field(ge=1, le=MAX_COUNT)] = Field(description="largest number of pedestrians")


class Place(Part):
    """A place of interest; if there are any, wandering pedestrians go to them instead of anywhere."""

    id: Id = Field(description="unique among places")
    x: Number = Field(description="m, to the right")
    y: Number = Field(description="m, up")
    radius: Positive = Field(description="m; pedestrians go to a random point within it")
    weight: Positive = Field(description="with which the place is chosen")
    stay: Annotated[tuple[NotNegative, NotNegative], LIST] = Field(
        description="s, shortest and longest time that a pedestrian stands there"
    )


class Human(Placed):
    """A pedestrian: its start and its properties."""

    id: Id
    radius: Positive = Field(description="m, half the depth of the body; of a file without `breadth`: of a disc")
    desired_speed: NotNegative = Field(description="m/s")
    behaviour: Behaviour = Field(description="kind of motion")
    model: str = Field(description="name of the pedestrian model")
    reacts_to_robot: Number = Field(description="strength of the reaction to the robot, from 0 (ignores it) to 1")
    reaction: Reaction = Field(default="avoids", description="kind of reaction to the robot")
    robot_clearance: NotNegative = Field(
        default=0.83, description="m, between outlines, at which the pedestrian wants to pass the robot"
    )
    group: Id | None = Field(description="id of its group")
    goals: ListOf[Pair] = Field(default=[], description="m, world frame: goals of a walking pedestrian, in order")
    velocity: Pair = Field(default=(0.0, 0.0), description="m/s, world frame, at the start")
    enters: Count = Field(
        default=0, description="tick at which it enters; unless it is recorded, it waits for free space"
    )
    leaves: Count | None = Field(default=None, description="tick from which it is absent; null: it stays")
    track: ListOf[Pair] = Field(
        default=[], description="m, world frame: position of a recorded pedestrian at each tick from `enters` on"
    )
    exits: bool = Field(default=False, description="whether a walking pedestrian leaves the scene at its last goal")
    stays: ListOf[NotNegative] = Field(
        default=[], description="s: how long a walking pedestrian stands at each of its goals but the last"
    )
    seat: Id | None = Field(default=None, description="id of the object that it sits on at the start")
    queue: Id | None = Field(default=None, description="id of the queue in which it stands at the start")
    breadth: Positive | None = Field(
        default=None,
        description="m, of the shoulders: the outline is all within `radius` of a line across the heading that is "
        "`breadth` - 2 `radius` long; null: a disc",
    )
    headway: Positive = Field(default=1.0, description="factor of the time gap to pedestrians ahead")
    politeness: NotNegative = Field(default=1.0, description="factor of the strength with which it avoids others")


class Social(Part):
    """Social behaviour during the episode: probabilities and durations."""

    visits: Probability = Field(
        description="that a wandering pedestrian, on reaching its goal, goes to a plant, laptop or other object"
    )
    joins: Probability = Field(
        description="that a wandering pedestrian, on reaching its goal, joins a standing pedestrian or a talking group"
    )
    meets: Probability = Field(description="that two wandering pedestrians that approach each other stop and talk")
    leaves: Probability = Field(
        description="that a pedestrian that attends to a pedestrian or an object at the start leaves after a time"
    )
    visit_time: Annotated[tuple[Positive, Positive], LIST] = Field(description="s, minimum and maximum")
    talk_time: Annotated[tuple[Positive, Positive], LIST] = Field(description="s, minimum and maximum")
    sits: Probability = Field(
        default=0.0, description="that a wandering pedestrian, on reaching its goal, sits down on a free seat"
    )
    queues: Probability = Field(
        default=0.0, description="that a wandering pedestrian, on reaching its goal, goes to a queue"
    )
    exits: Probability = Field(
        default=0.0, description="that a wandering pedestrian, on reaching its goal, leaves through a door"
    )
    sit_time: Annotated[tuple[Positive, Positive], LIST] = Field(
        default=(20.0, 90.0), description="s, minimum and maximum"
    )
    pause: Annotated[tuple[NotNegative, NotNegative], LIST] = Field(
        default=(0.0, 0.0), description="s, minimum and maximum: how long a wandering pedestrian stands at its goal"
    )


class Group(Part):
    """Pedestrians that talk or walk together."""

    id: Id
    kind: Literal["talking", "walking"]
    members: ListOf[Id] = Field(description="ids of humans; the first one leads")
    formation: Formation | None = Field(default=None, description="arrangement of the members at the start")


class Limits(Part):
    """Limits of the robot's drive."""

    ahead: Positive = Field(description="m/s")
    back: Positive = Field(description="m/s")
    sideways: Positive = Field(description="m/s")
    turn: Positive = Field(description="rad/s")
    acceleration: Positive = Field(description="m/s²")
    turn_acceleration: Positive = Field(description="rad/s²")


class Robot(Placed):
    """The robot's start, outline and drive."""

    radius: Positive = Field(description="m, of the solid outline")
    kinematics: Kinematics = Field(
        description="a unicycle moves along its heading only; until physics version 2, contacts pushed it sideways"
    )
    limits: Limits


class Goal(Placed):
    """The robot's goal."""

    distance: Positive = Field(description="m, between centres, below which the goal counts as reached")
    angle: Positive = Field(description="rad, maximum heading error for reaching the goal; 3.1416: any heading")


Interaction = Annotated[
    tuple[Id, str, Id],
    LIST,
    Field(description="src (id of a human), relation, dst (id of the human or object attended to)"),
]
WallRow = Annotated[tuple[Number, Number, Number, Number], LIST, Field(description="x1, y1, x2, y2, m, world frame")]
TwistRow = Annotated[tuple[Number, Number, Number], LIST, Field(description="vx, vy (m/s), omega (rad/s); body frame")]
RobotRow = Annotated[
    tuple[Number, Number, Number, Number, Number, Number],
    LIST,
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s); world frame"),
]
HumanRow = Annotated[
    tuple[Number, Number, Number, Number, Number, Number, Number],
    LIST,
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s), head (rad); world frame"),
]


class Controller(Part):
    """The robot's controller."""

    path: str = Field(description="import path, package.module:Class, or registered name")
    version: str | None
    settings: dict[str, Any] | None = Field(description="its settings, not rounded")


class Branch(Part):
    """The episode with which this one shares its first frames."""

    id: str
    tick: Count = Field(description="the first tick that may differ")


class Mirror(Part):
    """The episode of which this one is the mirror image (y and theta change sign).

    Seed and settings are those of the original episode.
    """

    id: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of its uncompressed document")
    labels: bool = Field(description="whether labels were mirrored too; else they are those of the original")
    thetas: ListOf[Annotated[tuple[int, Number], LIST]] = Field(
        description="index in `objects`, and theta in the original, where mirroring twice does not restore all digits"
    )


class Imported(Part):
    """The file of another format that this episode was imported from. Missing values are null or substituted."""

    format: str
    file: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of that file")
    lacks: ListOf[str] = Field(description="keys of this document that the file lacks; their values were not measured")
    derived: ListOf[str] = Field(description="keys that were computed from the content of the file")


class Column(Part):
    """A column of the rows in frames."""

    name: str
    unit: str
    frame: Literal["world", "body"] = Field(description="frame of reference")


class Columns(Part):
    """Columns of the rows in frames."""

    robot: ListOf[Column]
    humans: ListOf[Column]
    command: ListOf[Column] = Field(description="of `command` and `executed`")


class Outcome(Part):
    """How the episode ended."""

    status: Status
    reason: str
    tick: Count
    time: NotNegative = Field(description="s")


class Contact(Part):
    """The gap between the robot and another outline fell below the contact distance during the previous tick."""

    kind: Literal["human", "object", "wall"]
    id: Id = Field(description="of the human or object; of a wall its index in `walls`")
    robot_at_fault: bool = Field(description="whether the robot's own velocity closed the gap")
    other_at_fault: bool = Field(
        description="whether the other's velocity closed the gap; both can be true, or neither"
    )


class Event(Part):
    """A change of one control of an input device since the previous frame."""

    device: str
    control: str
    value: Number = Field(description="its new value, -1..1")


class State(Part):
    """State of the world at a tick; the base class of frames and of the final state."""

    tick: Count = Field(description="counted from 0")
    time: NotNegative = Field(description="s, tick times dt")
    robot: RobotRow = Field(description="x, y, theta, vx, vy, omega")
    humans: ListOf[HumanRow | None] = Field(
        description="a row for each of the top-level `humans`: x, y, theta, vx, vy, omega, head; null: not present"
    )
    activity: ListOf[Annotated[int, Field(ge=-1)]] = Field(
        description="of each human, an index into the top-level `activities`; -1: not present"
    )
    interactions: ListOf[Interaction] = Field(description="current ones: [src, relation, dst]")
    contacts: ListOf[Contact] = Field(description="of the robot, during the previous tick")


class LastLook(State):
    """State of the world at the end of the episode."""

    events: ListOf[Event] | None = Field(
        default=None, description="of input devices, since the last frame; absent if there are none"
    )
    command: TwistRow | None = Field(
        default=None, description="vx, vy, omega; only in episodes imported from a format that has a last command"
    )


class LabelSpec(Part):
    """The label that the driver was asked for."""

    kind: Literal["yes_no", "classes", "slider", "text"]
    when: Literal["frame", "run"] = Field(description="at each frame while driving, or once for the whole run")
    name: str = Field(description="key of the label in frames")
    question: str
    classes: ListOf[str] = Field(description="names of the classes 1, 2, …")
    ends: Annotated[tuple[str, str], LIST] = Field(description="meaning of 0 and of 1 on the slider")


class Rating(Part):
    """A line of a file of ratings: the rating of one run by one person."""

    rater: str
    file: str
    episode: str
    sha256: str
    label: Any
    showing: Count
    time: str
    seconds: NotNegative
    whole: bool
    spec: LabelSpec


class Frame(State):
    """State of the world at a tick, and the answer of the controller."""

    command: TwistRow = Field(description="the controller's command: vx, vy, omega")
    executed: TwistRow = Field(
        description="mean velocity of the robot in the tick that begins here, after guard and contacts: vx, vy, omega"
    )
    guarded: bool = Field(description="whether the safety guard intervened during the tick that begins here")
    events: ListOf[Event] = Field(description="of input devices, since the previous frame")
    label: Any = Field(default=None, description="any JSON value; without this key the command itself is the label")


class Software(Part):
    """Versions of the software that wrote the file; `check --replay` does not compare them."""

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
    family: str = Field(description="scenario and kind of room; data sets are split by it")
    seed: int = Field(description="of the data set")
    episode: int = Field(description="number of the episode in the data set")
    physics: int = Field(description="version of the physics; other versions give other frames")
    precision: Positive = Field(description="numbers in frames are multiples of this")
    settings: Settings | None = Field(
        description="all settings of the scenario, with defaults; null: the scene was not generated"
    )
    rules: Rules
    room: Room
    walls: ListOf[Annotated[tuple[Number, Number, Number, Number], LIST]] = Field(
        description="x1, y1, x2, y2, m, world frame"
    )
    objects: ListOf[Object]
    doors: ListOf[Door] = Field(default=[], description="through which pedestrians enter and leave")
    queues: ListOf[Queue] = Field(default=[], description="in which pedestrians stand in line")
    places: ListOf[Place] = Field(default=[], description="of interest, to which wandering pedestrians go")
    humans: ListOf[Human] = Field(description="in the order of the rows in frames")
    groups: ListOf[Group]
    interactions: ListOf[Interaction] = Field(description="at the start: [src, relation, dst]")
    robot: Robot
    goal: Goal
    social: Social | None = Field(default=None, description="social behaviour during the episode; null or absent: none")
    dropped: ListOf[str] = Field(description="requested items that could not be placed")
    controller: Controller
    labels: dict[str, str] | None = Field(description="meaning of the labels' keys; null: the command is the label")
    label_spec: LabelSpec | None = Field(
        default=None, description="the label that the driver was asked for; absent if there was none"
    )
    label: Any = Field(default=None, description="of the whole run; only if the driver was asked for one")
    contributor: str | None = Field(description="name of the person who drove or recorded")
    context: str | None = Field(description="text for the raters of the episode")
    branched_from: Branch | None
    mirrored_from: Mirror | None = Field(default=None, description="only in mirror images")
    imported: Imported | None = Field(default=None, description="only in episodes imported from another format")
    columns: Columns
    activities: ListOf[str] = Field(description="names of the numbers in `activity`")
    outcome: Outcome
    frames: ListOf[Frame] = Field(description="one for each executed tick")
    final: LastLook = Field(description="state after the last frame, to which no command belongs")
    software: Software
