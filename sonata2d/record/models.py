"""Schema of the episode file as pydantic models; the JSON Schema, docs/format.md and `check` are derived from them.

Models of entities are derived from the dataclasses of `core`. The names of all models but base classes are part of the
published JSON Schema.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeVar, get_type_hints

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, GetCoreSchemaHandler, create_model
from pydantic_core import CoreSchema

from ..core.attributes import AttributeSpec
from ..core.bounds import Count, Id, NotNegative, Number, Opening, Positive
from ..core.devices import DeviceEvent
from ..core.doors import InteriorDoor
from ..core.entities import Area, Door, Furniture, Goal, Group, Human, Place, Queue, Robot
from ..core.files.limits import MAX_COUNT, MAX_ROBOTS
from ..core.geometry import Disc, Point, Polygon, Pose, Rectangle, checked_corners
from ..core.labels import LabelSpec
from ..core.scene import Rules, Social
from ..core.snapshot import Contact, Status
from ..version import FORMAT

T = TypeVar("T")


def _with_people(settings: dict[str, Any]) -> dict[str, Any]:
    """Require that the listed people, which data cards count, are mappings; the rest may be anything."""
    people = settings.get("people", [])
    if not isinstance(people, list) or not all(isinstance(person, dict) for person in people):
        raise ValueError("people must be a list of mappings")
    return settings


Settings = Annotated[dict[str, Any], AfterValidator(_with_people)]  # resolved settings of a scenario


def _adapt_to_json(schema: Any) -> None:
    """Accept lists in place of tuples, and end the checks of a list at its first faulty entry.

    1 MB may hold a million faults, whose messages would take gigabytes.
    """
    if isinstance(schema, dict):
        if schema.get("type") == "tuple":
            schema["strict"] = False
        if schema.get("type") in ("tuple", "list"):
            schema["fail_fast"] = True
        schema = list(schema.values())
    for part in schema if isinstance(schema, list) else ():
        _adapt_to_json(part)


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError("the shortest time must not exceed the longest one")
    return pair


# in dataclasses of `core`, pairs of these types are the shortest and the longest duration
_DURATIONS = (tuple[NotNegative, NotNegative], tuple[Positive, Positive])


class Part(BaseModel):
    """Base class of all models: immutable, with strict types and finite numbers. A tuple is a list in JSON."""

    model_config = ConfigDict(frozen=True, strict=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        _adapt_to_json(schema)
        return schema


@cache
def model_of(kind: type, name: str | None = None, /, **changed: Any) -> type[Part]:
    """Create the model that describes the JSON object of a dataclass in a file.

    All fields are keys, and are required unless they are `ADDITIVE`. `x`, `y` and `theta` take the place of a pose. The
    descriptions are those under `Attributes` of the docstring.

    Args:
        kind: the dataclass.
        name: of the definition in the JSON Schema; by default the name of the class.
        changed: types by name, which replace the types of fields; a name that is not a field is an additional key.
    """
    text, descriptions = _documentation(kind)
    hints = get_type_hints(kind, include_extras=True)
    types = {key: hint for key, hint in changed.items() if key not in hints}
    for key, hint in (hints | changed).items():
        if hint is Pose:  # its fields are keys of the same object
            text += f"\n\nx, y, theta: {descriptions[key]}."
            types |= get_type_hints(Pose, include_extras=True)
            descriptions |= _documentation(Pose)[1]
        else:  # other dataclasses are objects in it
            hint = Annotated[hint, AfterValidator(_ordered)] if hint in _DURATIONS else hint
            types[key] = Annotated[hint, _FileForm()] if is_dataclass(hint) else hint
    keys: Any = {key: (hint, Field(description=descriptions.get(key))) for key, hint in types.items()}
    for each in (field for field in fields(kind) if field.metadata.get("additive")):
        keys[each.name] = types[each.name], Field(default=each.default, description=descriptions.get(each.name))
    return create_model(name or kind.__name__, __base__=Part, __doc__=text, **keys)


class _FileForm:
    """Annotation of a dataclass that stands for its model, `model_of`; takes the same arguments."""

    def __init__(self, name: str | None = None, /, **changed: Any) -> None:
        self._name, self._changed = name, changed

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler.generate_schema(model_of(source, self._name, **self._changed))


_InFile = Annotated[T, _FileForm()]


def _documentation(kind: type) -> tuple[str, dict[str, str]]:
    """The text of a class docstring before `Attributes`, and the description of each attribute, for readers of JSON."""
    text, _, attributes = inspect.cleandoc(kind.__doc__ or "").partition("\n\nAttributes:\n")
    items = re.findall(r"^    (\w.*?): (.*(?:\n     .*)*)", attributes, re.MULTILINE)
    descriptions = {name: " ".join(text.split()).rstrip(".") for names, text in items for name in names.split(", ")}
    return text, {name: re.sub(r"\bNone\b", "null", text) for name, text in descriptions.items()}


_Ring = Annotated[list[Point], Field(min_length=3, max_length=MAX_COUNT)]


class Room(Part):
    """The room."""

    polygon: _Ring = Field(description="m, world frame, counter-clockwise; pedestrians and robot stay inside")
    holes: list[_Ring] | None = Field(
        default=None, max_length=MAX_COUNT, description="parts without floor, m, world frame; absent if there are none"
    )


_Corners = Annotated[tuple[Point, ...], AfterValidator(checked_corners)]
_SolidOutline = Annotated[
    Annotated[Disc, _FileForm("DiscShape", type=Literal["disc"])]
    | Annotated[Rectangle, _FileForm("RectangleShape", type=Literal["rectangle"])]
    | Annotated[Polygon, _FileForm("PolygonShape", type=Literal["polygon"], points=_Corners)],
    Discriminator("type"),
]
_Entities = Annotated[list[T], Field(max_length=MAX_COUNT)]  # those that each other entity is compared with
_Contact = Annotated[Contact, _FileForm(id=Id)]
_Event = Annotated[DeviceEvent, _FileForm("Event")]
_AskedLabel = Annotated[LabelSpec, _FileForm(kind=Literal["yes_no", "classes", "slider", "text"])]
_InteractionRow = Annotated[
    tuple[Id, str, Id],
    Field(description="src (id of a human), relation, dst (id of the human or object attended to)"),
]
_TwistRow = Annotated[tuple[Number, Number, Number], Field(description="vx, vy (m/s), omega (rad/s); body frame")]
_RobotRow = Annotated[
    tuple[Number, Number, Number, Number, Number, Number],
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s); world frame"),
]
_HumanRow = Annotated[
    tuple[Number, Number, Number, Number, Number, Number, Number],
    Field(description="x, y (m), theta (rad), vx, vy (m/s), omega (rad/s), head (rad); world frame"),
]


class Controller(Part):
    """The robot's controller."""

    path: str = Field(description="import path, package.module:Class, or registered name")
    version: str | None
    settings: dict[str, Any] | None = Field(description="its settings, not rounded")


class Sensor(Part):
    """A recorded sensor of the robot."""

    name: str
    type: str = Field(description="registered name, or package.module:Class")
    settings: dict[str, Any] = Field(description="its settings, not rounded")


_Sensors = Annotated[
    list[Sensor] | None,
    Field(description="the recorded sensors of this robot; absent if there are none"),
]
_Readings = Annotated[
    dict[str, Any] | None,
    Field(description="of this robot's sensors, those that arrived at this tick, by name; absent if none did"),
]


class OtherRobot(Part):
    """A robot besides the first one. Its keys but the id are those that the file has for the first robot."""

    id: Id = Field(description="unique among robots, pedestrians and objects; 0 is the first robot")
    robot: Annotated[Robot, _FileForm(shape=_SolidOutline | None)]
    goal: _InFile[Goal]
    controller: Controller
    labels: dict[str, str] | None
    sensors: _Sensors = None


class Branch(Part):
    """The episode with which this one shares its first frames."""

    id: str
    tick: Count = Field(description="the first tick that may differ")


class Mirror(Part):
    """The episode of which this one is the mirror image (y and theta change sign).

    Seed and settings belong to the original episode.
    """

    id: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of its uncompressed document")
    labels: bool = Field(description="whether labels were mirrored too; otherwise they are the labels of the original")
    thetas: list[tuple[int, Number]] = Field(
        description="index in `objects`, and theta in the original, where mirroring twice does not restore all digits"
    )


class ImportedTracks(Part):
    """Facts about recorded tracks, by which a reader sees whether they were understood."""

    persons: int
    frames: int = Field(description="times from the first to the last observation")
    interval: Number = Field(description="time between them, s")
    median_speed: Number | None = Field(description="of people while they walk, m/s; null: nobody walks")
    largest_speed: Number = Field(description="m/s")
    width: Number = Field(description="of the area in which people were, m")
    depth: Number = Field(description="of this area, m")
    robot: bool = Field(description="whether the file has a robot's track")
    walls: int
    doubts: list[str] = Field(description="reasons why units, times or ids may be wrong")
    notes: list[str] = Field(description="what was left out or repaired")


class Imported(Part):
    """The file of another format that this episode was imported from. Missing values are null or substituted."""

    format: str
    file: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of that file")
    lacks: list[str] = Field(description="keys of this document that the file lacks; their values were not measured")
    derived: list[str] = Field(description="keys that were computed from the content of the file")
    tracks: ImportedTracks | None = Field(default=None, description="only of recorded tracks")


class Column(Part):
    """A column of the rows in frames."""

    name: str
    unit: str
    frame: Literal["world", "body"] = Field(description="frame of reference")


class Columns(Part):
    """Columns of the rows in frames."""

    robot: list[Column]
    humans: list[Column]
    command: list[Column] = Field(description="of `command` and `executed`")


class Outcome(Part):
    """End of the episode."""

    status: Status
    reason: str
    tick: Count
    time: NotNegative = Field(description="s")
    arrivals: list[Count | None] | None = Field(
        default=None,
        description="tick at which each robot reached its goal, the first one first; null: it did not; absent if there "
        "is one robot",
    )


class OtherState(Part):
    """State of another robot at a tick."""

    robot: _RobotRow = Field(description="x, y, theta, vx, vy, omega")
    contacts: list[_Contact] = Field(description="of this robot, during the previous tick")


class OtherFrame(OtherState):
    """State of another robot at a tick, and the answer of its controller."""

    command: _TwistRow = Field(description="the controller's command: vx, vy, omega")
    executed: _TwistRow = Field(description="mean velocity of the robot in the tick that begins here: vx, vy, omega")
    guarded: bool = Field(description="whether the safety guard intervened during the tick that begins here")
    label: Any = Field(default=None, description="any JSON value; without this key the command itself is the label")
    sensors: _Readings = None


class State(Part):
    """State of the world at a tick; the base class of frames and of the final state."""

    tick: Count = Field(description="counted from 0")
    time: NotNegative = Field(description="s, tick times dt")
    robot: _RobotRow = Field(description="x, y, theta, vx, vy, omega")
    humans: list[_HumanRow | None] = Field(
        description="a row for each of the top-level `humans`: x, y, theta, vx, vy, omega, head; null: not present"
    )
    activity: list[Annotated[int, Field(ge=-1)]] = Field(
        description="of each human, an index into the top-level `activities`; -1: not present"
    )
    interactions: list[_InteractionRow] = Field(description="current ones: [src, relation, dst]")
    contacts: list[_Contact] = Field(description="of the robot, during the previous tick")
    doors: list[Opening] | None = Field(
        default=None,
        description="openings of the top-level `interior_doors` that move: 0: closed; 1, or -1 of hinged ones: open; "
        "absent if there are none",
    )


class LastLook(State):
    """State of the world at the end of the episode."""

    events: list[_Event] | None = Field(
        default=None, description="of input devices, since the last frame; absent if there are none"
    )
    command: _TwistRow | None = Field(
        default=None, description="vx, vy, omega; only in episodes imported from a format that has a last command"
    )
    robots: list[OtherState] | None = Field(
        default=None, description="the other robots, in the order of the top-level `robots`; absent if there are none"
    )


class Frame(State):
    """State of the world at a tick, and the answer of the controller."""

    command: _TwistRow = Field(description="the controller's command: vx, vy, omega")
    executed: _TwistRow = Field(
        description="mean velocity of the robot in the tick that begins here, after guard and contacts: vx, vy, omega"
    )
    guarded: bool = Field(description="whether the safety guard intervened during the tick that begins here")
    events: list[_Event] = Field(description="of input devices, since the previous frame")
    label: Any = Field(default=None, description="any JSON value; without this key the command itself is the label")
    sensors: _Readings = None
    robots: list[OtherFrame] | None = Field(
        default=None, description="the other robots, in the order of the top-level `robots`; absent if there are none"
    )


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
    version: Literal[1, 2] = Field(
        description="1; 2 with polygons, interior doors, several robots, robots that are no discs, or drives that 1 "
        "does not have"
    )
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
    rules: _InFile[Rules]
    room: Room
    walls: _Entities[tuple[Number, Number, Number, Number]] = Field(description="x1, y1, x2, y2, m, world frame")
    objects: _Entities[Annotated[Furniture, _FileForm("Object", shape=_SolidOutline)]]
    doors: _Entities[_InFile[Door]] = Field(description="through which pedestrians enter and leave")
    queues: _Entities[_InFile[Queue]] = Field(description="in which pedestrians stand in line")
    places: _Entities[_InFile[Place]] = Field(description="of interest, to which wandering pedestrians go")
    areas: list[_InFile[Area]] | None = Field(
        default=None, max_length=MAX_COUNT, description="named parts of the floor; absent if there are none"
    )
    interior_doors: list[_InFile[InteriorDoor]] | None = Field(
        default=None, max_length=MAX_COUNT, description="doors between parts of the room; absent if there are none"
    )
    attributes: list[_InFile[AttributeSpec]] | None = Field(
        default=None,
        max_length=MAX_COUNT,
        description="declared attributes of people, objects and areas, and those of the episode; absent if there are "
        "none",
    )
    humans: list[_InFile[Human]] = Field(description="in the order of the rows in frames")
    groups: list[_InFile[Group]]
    interactions: list[_InteractionRow] = Field(description="at the start: [src, relation, dst]")
    robot: Annotated[Robot, _FileForm(shape=_SolidOutline | None)]
    goal: _InFile[Goal]
    robots: list[OtherRobot] | None = Field(
        default=None, max_length=MAX_ROBOTS, description="the other robots; absent if there are none"
    )
    social: _InFile[Social] | None = Field(description="social behaviour during the episode; null: none")
    dropped: list[str] = Field(description="requested items that could not be placed")
    controller: Controller
    labels: dict[str, str] | None = Field(description="meaning of the labels' keys; null: the command is the label")
    sensors: _Sensors = None
    label_spec: _AskedLabel | None = Field(
        default=None, description="the label that the driver was asked for; absent if there was none"
    )
    label: Any = Field(default=None, description="of the whole run; only if the driver was asked for one")
    contributor: str | None = Field(description="name of the person who drove or recorded")
    context: str | None = Field(description="text for the raters of the episode")
    branched_from: Branch | None
    mirrored_from: Mirror | None = Field(default=None, description="only in mirror images")
    imported: Imported | None = Field(default=None, description="only in episodes imported from another format")
    columns: Columns
    activities: list[str] = Field(description="names of the numbers in `activity`")
    outcome: Outcome
    never_entered: list[int] | None = Field(
        default=None,
        description="ids of people who never appear, because the place where they enter stays occupied; only if any",
    )
    frames: list[Frame] = Field(description="one for each executed tick")
    final: LastLook = Field(description="state after the last frame, to which no command belongs")
    software: Software
