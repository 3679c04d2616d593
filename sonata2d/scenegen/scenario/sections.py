"""The sections of a scenario: furniture, pedestrians, groups, social behaviour, robot, goal, label, rules."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal, Self, get_args

from annotated_types import Ge
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PositiveInt,
    SerializerFunctionWrapHandler,
    TypeAdapter,
    ValidationError,
    WrapSerializer,
    model_validator,
)

from ...core.bounds import Capacity, Fraction, NotNegative, Number, Opening, OpeningTime, Positive
from ...core.doors import DoorKind, OpenedBy
from ...core.entities import AT_PERSON, DEFAULT_CONTROLLER, DEFAULT_MODEL, Area, Formation, Limits, Reaction, RobotTask
from ...core.files.limits import MAX_NAME
from ...core.geometry import Disc, Point, Polygon, Rectangle, Shape, canonical_angle, quantised
from ...core.labels import LabelSpec
from ...core.scene import Rules, Social
from ...core.tasks import BESIDE
from ...core.wording import shown
from ...registry import CONTROLLERS, DRIVES, PEDESTRIAN_MODELS, PERSON_KINDS, did_you_mean, drive_class
from .attributes import GivenAttributes
from .base import (
    BodyRadius,
    Breadth,
    Duration,
    Entities,
    IntRange,
    Jitter,
    Normal,
    Range,
    Section,
    Settings,
    TupleOf,
    require_registered,
    weights_of,
    within,
)
from .problems import setting_error
from .rooms import Polygon as Corners, RoomConfig as RoomConfig

_ModelName = Annotated[str, AfterValidator(partial(require_registered, PEDESTRIAN_MODELS))]
KindName = Annotated[str, AfterValidator(partial(require_registered, PERSON_KINDS))]
AreaName = Annotated[str, Field(min_length=1, max_length=MAX_NAME)]
Size = Positive | tuple[Positive, Positive]  # radius of a disc, or length (x) and width (y), m

_WalkingFormation = Literal["abreast", "v"]
_PairFormation = Literal["face_to_face", "l", "side_by_side"]
_CircleFormation = Literal["circle", "semicircle"]
_TalkingFormation = Literal[_PairFormation, _CircleFormation]
_GroupSize = Annotated[IntRange, within("a group has 2 to 6 people", 2, 6)]
_Spacing = Annotated[Range, within("neighbours in a group need 0.5 m or more between their centres", 0.5)]


_SMALLEST_BODY = 0.01  # m


class BodyConfig(Settings):
    """An outline that is no disc.

    Attributes:
        shape: rectangle, with `length` along the heading and `width` across it, m; or polygon, a convex one with its
            corners `points` in the body frame, [x, y] in m, counter-clockwise; or disc, with `radius`, m.
    """

    _optional = frozenset({"radius", "length", "width", "points"})

    shape: Literal["disc", "rectangle", "polygon"]
    radius: Positive | None = None
    length: Positive | None = None
    width: Positive | None = None
    points: TupleOf[Point] | None = None

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        needed = {"disc": {"radius"}, "rectangle": {"length", "width"}, "polygon": {"points"}}[self.shape]
        for key in ("radius", "length", "width", "points"):
            if (getattr(self, key) is None) == (key in needed):
                what = "needs" if key in needed else "has no"
                raise setting_error(f"a {self.shape} {what} {key}", key)
        try:
            smallest = min(self.outline().sides)
        except ValueError as error:
            raise setting_error(str(error), "points") from error
        if smallest < _SMALLEST_BODY:
            raise setting_error(f"a body is at least {_SMALLEST_BODY} m long and wide, got {smallest:g} m")
        return self

    def outline(self) -> Shape:
        """The outline, at the precision of files."""
        if self.shape == "polygon":
            return Polygon(tuple((quantised(x), quantised(y)) for x, y in self.points or ()))
        if self.shape == "rectangle":
            return Rectangle(quantised(self.length or 0.0), quantised(self.width or 0.0))
        return Disc(quantised(self.radius or 0.0))


class FurnitureConfig(Settings):
    """A piece of furniture at a fixed position. A laptop that overlaps a table lies on it.

    Attributes:
        type: a type of furniture, a key of `sizes`, or any name if `size` is given.
        x, y: m, world frame.
        theta: rad, world frame.
        size: m; default: the size of its type.
        attracts: whether `at_laptop`, `at_plant` or `at_object` may place a pedestrian at its access side (-y), facing
            it.
        seat: whether one pedestrian can sit on it, above its centre and facing its front: +x, or -y of a piece that is
            longer (x) than wide (y). Default: if its type is one, such as a chair.
        body: outline, given instead of `size`.
        attributes: values of attributes of objects by name, which `attributes.objects` declares; the others are drawn.
    """

    _optional = frozenset({"body", "attributes"})

    type: str
    x: Number
    y: Number
    theta: Number = 0.0
    size: Size | None = None
    attracts: bool = True
    seat: bool | None = None
    body: BodyConfig | None = None
    attributes: GivenAttributes | None = None

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        if self.size is not None and self.body is not None:
            raise setting_error("give size or body, not both", "body")
        return self


class _DrawnOrFixed(Settings):
    """Base class of settings with a position that is drawn unless it is given."""

    x: Number | None = None
    y: Number | None = None

    @model_validator(mode="after")
    def _check_position(self) -> Self:
        if (self.x is None) != (self.y is None):
            raise setting_error("give x and y, or neither", "x" if self.x is None else "y")
        return self


class DoorConfig(_DrawnOrFixed):
    """A door in the outline of the room, through which pedestrians enter and leave.

    The wall stays solid for the robot and for all pedestrians: they appear just inside the door, and disappear just
    before it. Those that enter wander; arrivals are independent of each other (a Poisson process over
    `rules.time_limit`), and wait while there is no space at the door.

    Attributes:
        x, y: m, world frame: the middle of the door is at the nearest place of the outline with space for it. Default:
            drawn.
        width: m.
        inflow: mean number of arrivals, 1/min; a pair is one arrival.
        pairs: probability that an arrival is a group of two that walks together.
        share: weight with which pedestrians that leave (`social.exits`) choose this door.
    """

    width: Annotated[Number, Field(ge=0.7)] = 1.0
    inflow: NotNegative = 0.0
    pairs: Fraction = 0.0
    share: NotNegative = 1.0


class InteriorDoorConfig(_DrawnOrFixed):
    """A door in an opening between walls inside the room, with a leaf that opens and closes; see `InteriorDoor`.

    Attributes:
        x, y: m, world frame: a place in the opening, from which walls on both sides are 0.5 to 3 m apart. Default: the
            doorway of a room of the kind `doorway`.
        theta: rad, world frame: direction from the fixed end of the leaf along the closed leaf, to about 45°. Default:
            drawn of the two.
        kind: `hinged`: the leaf turns on its fixed end, away from whoever opens it; `sliding`: it disappears in the
            wall.
        opened_by: `anyone`: people and robots, by a sensor; `people`: people, by hand; `request`: also robots that
            stand before it for 1 s; `nobody`: the door does not move.
        opening: at the start: 0: closed; 1: open; of a hinged door also -1: open to the right, as seen from the hinge.
        opening_time: from closed to open, and back, s; 0.1 to 60.
        hold: for which the door stays open after the last one has passed, s.
    """

    theta: Number | None = None
    kind: DoorKind = "hinged"
    opened_by: OpenedBy = "anyone"
    opening: Opening = 0.0
    opening_time: OpeningTime = 1.5
    hold: NotNegative = 2.0

    @model_validator(mode="after")
    def _check_opening(self) -> Self:
        if self.kind == "sliding" and self.opening < 0.0:
            raise setting_error("a sliding door opens to one side only; give 0 to 1", "opening")
        return self


class QueueConfig(_DrawnOrFixed):
    """A queue: pedestrians stand in line, straight back from the first one, and leave it when they were served.

    Attributes:
        x, y: m, world frame: where the first pedestrian stands. Default: drawn, at a wall that it faces.
        theta: rad, world frame: what the first pedestrian faces, if x and y are given.
        spacing: distance of neighbours, m.
        service: time that the first pedestrian needs, s.
        capacity: largest number of pedestrians; less where a wall or furniture is in the way.
        waiting: number of pedestrians that stand in the queue at the start, in addition to all others.
    """

    theta: Number = 0.0
    spacing: Annotated[Number, Field(ge=0.5)] = 0.75
    service: Duration = Range(5, 15)
    capacity: Capacity = 8
    waiting: IntRange = IntRange(0, 0)

    @model_validator(mode="after")
    def _check_waiting(self) -> Self:
        if self.waiting.max > self.capacity:
            raise setting_error(f"{self.waiting.max} people do not fit into a queue of {self.capacity}", "waiting")
        return self


class AreaConfig(Settings):
    """A named part of the floor, such as a kitchen.

    Attributes:
        name: of the area; `in: NAME` places the robot, its goal or one of `people` in it.
        polygon: corners in order, m, world frame; edges must not cross.
        share: weight with which drawn pedestrians and furniture are placed in this area; those at fixed furniture and
            at given places are not. Default: anywhere in the room, if no area has a share above 0.
        no_go: whether robots must stay outside.
        speed_limit: of a robot in the area, m/s; 0.01 or more.
        one_way: rad, world frame: the only direction, up to a right angle, in which a robot may move in the area.
        attributes: values of attributes of areas by name, which `attributes.areas` declares; the others are drawn.
    """

    _optional = frozenset({"share", "no_go", "speed_limit", "one_way", "attributes"})

    name: AreaName
    polygon: Corners
    share: NotNegative | None = None
    no_go: bool = False
    speed_limit: Annotated[Positive, Ge(0.01)] | None = None
    one_way: Number | None = None
    attributes: GivenAttributes | None = None

    @property
    def corners(self) -> tuple[Point, ...]:
        """The corners at the precision of files, m."""
        return tuple((quantised(x), quantised(y)) for x, y in self.polygon)

    def area(self) -> Area:
        """The area of a scene."""
        return Area(
            self.name, self.corners, self.no_go, None if self.speed_limit is None else quantised(self.speed_limit),
            None if self.one_way is None else canonical_angle(self.one_way), self.attributes,
        )  # fmt: skip


class PlaceConfig(Settings):
    """A place of interest; if there are any, wandering pedestrians go to them instead of anywhere in the room.

    Attributes:
        x, y: m, world frame.
        radius: m; pedestrians go to a random point within it.
        weight: with which pedestrians choose this place.
        stay: time that a pedestrian stands there, s.
    """

    x: Number
    y: Number
    radius: Positive = 1.0
    weight: Positive = 1.0
    stay: Duration = Range(5, 20)


class SpeedConfig(Normal):
    """Distribution of the desired speed, m/s: a normal distribution truncated at min and max."""

    mean: Positive = 1.3
    sd: Positive = 0.2
    min: Positive = 0.8
    max: Positive = 1.8


class ClearanceConfig(Normal):
    """Distribution of the clearance to the robot, m, between outlines: a normal distribution truncated at min and max.

    By default, simulated people pass a robot as near as recorded ones (Day & Karamouzas, A Study in Zucker, IEEE RA-L
    2024: 0.72 m between the centres in the median).
    """

    mean: NotNegative = 0.1
    sd: Positive = 0.1
    min: NotNegative = 0.0
    max: Positive = 0.3


class FactorConfig(Normal):
    """Distribution of a factor by which persons differ: a normal distribution truncated at min and max."""

    mean: Positive = 1.0
    sd: Positive = 0.2
    min: Positive = 0.5
    max: Positive = 1.5


class PersonConfig(Settings):
    """Properties of the pedestrians.

    Attributes:
        radius: half the depth of the body, m.
        breadth: of the shoulders, m; twice the radius or less gives a disc.
        wall_distance: minimum distance of a pedestrian's centre from walls at the start, m.
        pre_movement: time for which a pedestrian stands at the start before it walks, s.
        reaction_time: time from the moment at which the robot comes into view of a pedestrian until it reacts, s.
        model: pedestrian model of all pedestrians: sonata2026, moussaid2009, helbing1995, helbing2000, farina2017 or
            orca2011; see models.md.
        desired_speed: distribution of the desired speed, m/s.
        headway: distribution of the factor of the time gap that a pedestrian keeps to those ahead.
        politeness: distribution of the factor of the strength with which a pedestrian avoids others.
        ignores_robot: probability that a pedestrian does not react to the robot, drawn for each pedestrian.
        reactions: weight of each reaction of the other pedestrians to the robot: avoids, stops, curious, scared,
            ignores; a list of names gives equal weights.
        robot_clearance: distribution of the clearance at which a pedestrian wants to pass the robot, m.
        kinds: weight of each kind of person: adult, older, child, wheelchair, walking_frame, cart, carrying, staff, or
            of a plug-in; a list of names gives equal weights. A kind replaces some of the distributions of sizes and
            speed; adults have those of this section. Default: adults.
    """

    _optional = frozenset({"kinds"})

    radius: BodyRadius = Range(0.13, 0.15)
    breadth: Breadth = Range(0.4, 0.5)
    wall_distance: NotNegative = 0.4
    desired_speed: SpeedConfig = SpeedConfig()
    headway: FactorConfig = FactorConfig()
    politeness: FactorConfig = FactorConfig()
    pre_movement: Duration = Range(0, 0)
    reaction_time: Duration = Range(0, 0)
    model: _ModelName = DEFAULT_MODEL
    ignores_robot: Fraction = 0.0
    reactions: Annotated[dict[Reaction, NotNegative], *weights_of("reaction")] = Field(default={"avoids": 1.0})
    robot_clearance: ClearanceConfig = ClearanceConfig()
    kinds: Annotated[dict[KindName, NotNegative], *weights_of("kind of person")] | None = None


class GroupConfig(Settings):
    """Size and formation of the groups of `walking_groups` and `talking_groups` at the start.

    Walking groups move abreast, or in a V with the middle members behind (Moussaïd et al., PLoS ONE 5 (2010) e10047).
    The members of a talking group stand around a shared space, the o-space, and face its centre (Kendon, Conducting
    Interaction, 1990): two members face to face, in an L or side by side; three and more in a circle or a semicircle.
    No other pedestrian and no furniture is placed in an o-space.

    Attributes:
        walking_size, talking_size: number of members, 2 to 6.
        walking_formations, formations: weight of each formation of walking and of talking groups; a name or a list of
            names gives equal weights. Formations that do not fit the group's size are skipped.
        walking_spacing, talking_spacing: m, between the centres of neighbours.
        v_angle: rad, between the walking direction and the line to the neighbour in a V.
        places: x, y, m, world frame, of the o-space centres of the first talking groups; the others are drawn.
    """

    walking_size: _GroupSize = IntRange(2, 5)
    walking_formations: Annotated[dict[_WalkingFormation, NotNegative], *weights_of("formation")] = Field(
        default=dict.fromkeys(get_args(_WalkingFormation), 1.0)
    )
    walking_spacing: _Spacing = Range(0.7, 1.1)
    v_angle: Annotated[Range, within("the angle of a V must be within 0.5..1.5708 rad", 0.5, 1.5708)] = Range(1.1, 1.33)
    talking_size: _GroupSize = IntRange(2, 6)
    formations: Annotated[dict[_TalkingFormation, NotNegative], *weights_of("formation")] = Field(
        default=dict.fromkeys(get_args(_TalkingFormation), 1.0)
    )
    talking_spacing: _Spacing = Range(0.9, 1.2)
    places: Entities[Point] = ()

    @model_validator(mode="after")
    def _check_formations(self) -> Self:
        """Check that every size of a talking group in the range has a formation."""
        # every size from three up has the same formations, so that two and three stand for all sizes
        for size in {min(size, 3) for size in range(self.talking_size.min, self.talking_size.max + 1)}:
            if not sum(self.formation_weights(size).values()) > 0.0:
                people = "two" if size == 2 else "three and more"
                raise setting_error(f"no formation for {people} people has a weight above 0", "formations")
        return self

    def formation_weights(self, size: int) -> dict[Formation, float]:
        """Return the weights of the formations of a talking group with `size` members."""
        fitting = get_args(_PairFormation if size == 2 else _CircleFormation)
        return {name: weight for name, weight in self.formations.items() if name in fitting}


class RobotConfig(Settings):
    """The robot's drive, outline and start.

    Attributes:
        kinematics: name of the drive. holonomic; unicycle, which moves along its heading only: at a wall or a person it
            stops; differential, omni, bicycle, or the drive of a plug-in.
        drive: parameters of the drive by name, which replace its defaults.
        radius: m, of a disc.
        body: another outline, in place of the disc; `radius` then has no effect.
        limits: of the drive.
        clearance: minimum clearance of a drawn start from walls, furniture and pedestrians, m.
        pose: x, y (m), theta (rad) of the start, world frame; default: drawn.
        jitter: maximum random offset of `pose` in x, y (m) and theta (rad), in both directions, drawn for each scene.
        on_ways: maximum distance of a drawn start and goal, m, from the path of one of `people`: its track, or the line
            from its start through its goals. Default: no limit.
        area: name of one of `areas`, in which a drawn start lies; in files the key is `in`.
    """

    _optional = frozenset({"body", "drive", "area"})

    kinematics: Annotated[str, AfterValidator(partial(require_registered, DRIVES))] = "holonomic"
    radius: Positive = 0.30
    limits: Annotated[Limits, Section(Limits())] = Limits()
    clearance: Positive = 0.2
    pose: tuple[Number, Number, Number] | None = None
    jitter: Jitter = (0.0, 0.0, 0.0)
    on_ways: Positive | None = None
    body: BodyConfig | None = None
    drive: dict[str, Number] | None = None
    area: AreaName | None = Field(default=None, alias="in")

    @model_validator(mode="after")
    def _complete_drive(self) -> Self:
        """Set all parameters of the drive."""
        kind = drive_class(self.kinematics)
        names = kind().parameters
        is_built_in = self.kinematics in DRIVES.built_in
        for name in self.drive or ():
            if name not in names and (is_built_in or name != "sideways"):
                hint = did_you_mean(name, names) or (f"; it has {', '.join(names)}" if names else "; it has none")
                raise setting_error(f"the drive {self.kinematics} has no parameter {name!r}{hint}", "drive", name)
        try:
            given = {name: quantised(value) for name, value in (self.drive or {}).items() if name in names}
            parameters = TypeAdapter(kind).validate_python(given).parameters
        except ValidationError as error:
            first = error.errors()[0]
            raise setting_error(f"{first['msg']}, got {shown(first['input'])}", "drive", *first["loc"]) from error
        if not is_built_in and not kind.moves_sideways:
            parameters["sideways"] = 0.0  # a file is read without the plug-in
        vars(self)["drive"] = {name: quantised(value) for name, value in parameters.items()} or None
        return self

    @property
    def moves_sideways(self) -> bool:
        """Whether the drive can move sideways."""
        return bool(drive_class(self.kinematics).moves_sideways)

    @property
    def outline(self) -> Shape:
        """The solid outline, at the precision of files."""
        return Disc(quantised(self.radius)) if self.body is None else self.body.outline()


class GoalConfig(Settings):
    """The robot's goal, its task there, and the condition for reaching it.

    Attributes:
        distance, angle: largest distance (m) and heading error (rad) of the robot at which the goal counts as reached.
        min_distance: minimum distance of a drawn goal from the robot's start, m.
        position: x, y, m, world frame; default: drawn.
        jitter: maximum random offset of `position` in x and y (m), in both directions, drawn for each scene.
        theta: rad, world frame; default: drawn.
        area: name of one of `areas`, in which a drawn goal lies; in files the key is `in`.
        task: `go` to the position; `meet`, `follow` or `accompany` a person; `lead` a person to the position; `wait`
            for a person there. See `Goal` in docs/format.md for when a task is done.
        person: number of the person in `people`, from 1; of one that is followed or accompanied, `goals` are given.
        near: largest distance between the centres of robot and person at which they are near each other, m.
        then: further places of the task `go`, in order, m.
        object: type of furniture, beside a piece of which the goal is drawn.
    """

    _optional = frozenset({"area", "task", "person", "near", "then", "object"})

    distance: Positive = 0.40
    angle: Positive = 3.1416
    min_distance: Positive = 2.0
    position: Point | None = None
    jitter: tuple[NotNegative, NotNegative] = (0.0, 0.0)
    theta: Number | None = None
    area: AreaName | None = Field(default=None, alias="in")
    task: RobotTask = "go"
    person: PositiveInt | None = None
    near: Positive = 2.0
    then: tuple[Point, ...] = ()
    object: Annotated[str, Field(min_length=1, max_length=MAX_NAME)] | None = None

    @model_validator(mode="after")
    def _check_task(self) -> Self:
        if (self.task == "go") != (self.person is None):
            message = f"the task {self.task!r} is about a person; give its number in people"
            raise setting_error("person is of other tasks than go" if self.task == "go" else message, "person")
        least = 0.5 if self.task != "accompany" else BESIDE + 0.3
        if self.near < least:
            raise setting_error(f"near is {least:g} m or more, from centre to centre, for {self.task}", "near")
        idle = ["near"] if self.task == "go" else []
        idle += ["theta", "angle", "jitter", "min_distance"] if self.task in AT_PERSON else []
        for key in idle:
            if getattr(self, key) != type(self).model_fields[key].default:
                raise setting_error(f"{key} has no effect on the task {self.task!r}; omit it", key)
        if self.task != "go" and self.then:
            raise setting_error(f"further places are of the task go, not of {self.task!r}", "then")
        places = [place for place in (self.position, self.area, self.object) if place is not None]
        if self.task in AT_PERSON and places:
            raise setting_error(f"the goal of the task {self.task!r} is at the person; omit the place", "task")
        if self.object is not None and len(places) > 1:
            raise setting_error("the goal is beside an object, or at a position or in an area", "object")
        return self


class OtherRobotConfig(RobotConfig):
    """Robots besides the first one, with the settings of the section `robot` and these.

    Attributes:
        count: number of such robots.
        controller: name of a built-in controller or of a plug-in, which drives them unless an episode gets others.
        goal: their goals; see the section `goal`.
    """

    count: PositiveInt = 1
    controller: Annotated[str, AfterValidator(partial(require_registered, CONTROLLERS))] = DEFAULT_CONTROLLER
    goal: GoalConfig = GoalConfig()

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        if self.count > 1 and (self.pose is not None or self.goal.position is not None):
            raise setting_error("robots with a given pose or goal position are listed one by one", "count")
        return self


def _check_time_limit(rules: Rules) -> Rules:
    """Require time for one tick."""
    if rules.time_limit < rules.dt:
        raise setting_error(f"the time limit must be at least one tick, dt = {rules.dt} s", "time_limit")
    return rules


def _check_choices(social: Social) -> Social:
    """Require that the probabilities of the choices on arrival leave no negative rest."""
    total = social.visits + social.joins + social.sits + social.queues + social.exits
    if total > 1.0 + 1e-9:
        raise setting_error(f"visits + joins + sits + queues + exits is {round(total, 4)}; the sum must not exceed 1")
    return social


def _class_names(value: Any) -> Any:
    """Convert a number of classes to the names "1", "2", …, and null to no classes."""
    if isinstance(value, int) and not isinstance(value, bool):
        return tuple(str(k) for k in range(1, min(value, 10) + 1))  # 10 names are one too many: an error follows
    return () if value is None else value


def _check_label(label: LabelSpec) -> LabelSpec:
    """Require classes for the kind that has some, and no text while driving."""
    hint, key = "", "classes"
    if label.kind == "classes" and not label.classes:
        hint = "give the names of the classes, or their number"
    elif label.kind != "classes" and label.classes:
        hint = "classes need kind: classes"
    elif label.classes and not 2 <= len(label.classes) <= 9:
        hint = "there must be 2 to 9 classes"
    elif label.kind == "text" and label.when == "frame":
        hint, key = "text is asked for after the run; set when: run", "when"
    if hint:
        raise setting_error(hint, key)
    return label


def _label_settings(label: LabelSpec, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
    """Return the settings of a label, with null in place of an empty list of classes."""
    settings: dict[str, Any] = handler(label)
    return settings | {"classes": list(label.classes) or None}


PAUSING = Social(pause=(1.0, 6.0))  # of a scenario that sets nothing else
RulesSection = Annotated[Rules, Section(Rules()), AfterValidator(_check_time_limit)]
SocialSection = Annotated[Social, Section(PAUSING), AfterValidator(_check_choices)]
LabelSection = Annotated[
    LabelSpec,
    Section(LabelSpec(), classes=Annotated[TupleOf[str], BeforeValidator(_class_names)]),
    AfterValidator(_check_label),
    WrapSerializer(_label_settings),
]
