"""The sections of a scenario: furniture, pedestrians, groups, social behaviour, robot, goal, label, rules."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ...core.entities import DEFAULT_MODEL, EndsOn, Formation, Kinematics, Limits, Reaction
from ...core.files.limits import MAX_COUNT
from ...core.geometry import Point
from ...core.labels import Kind, LabelSpec, When
from ...core.scene import Rules, Social
from ...registry import PEDESTRIAN_MODELS
from .base import (
    Entities,
    Fraction,
    IntRange,
    Jitter,
    Normal,
    Pause,
    Range,
    Settings,
    TupleOf,
    Weights,
    bounded,
    require_registered,
    require_weight,
)
from .rooms import RoomConfig

__all__ = [  # every section, as docs/scenario.md lists them
    "ClearanceConfig",
    "DoorConfig",
    "FurnitureConfig",
    "GoalConfig",
    "GroupConfig",
    "LabelConfig",
    "LimitsConfig",
    "PersonConfig",
    "PlaceConfig",
    "QueueConfig",
    "RobotConfig",
    "RoomConfig",
    "RulesConfig",
    "SocialConfig",
    "SpeedConfig",
]

ModelName = Annotated[str, AfterValidator(partial(require_registered, PEDESTRIAN_MODELS))]
Size = PositiveFloat | tuple[PositiveFloat, PositiveFloat]  # radius of a disc, or length (x) and width (y), m

WALKING_FORMATIONS: tuple[Formation, ...] = ("abreast", "v")
PAIR_FORMATIONS: tuple[Formation, ...] = ("face_to_face", "l", "side_by_side")
CIRCLE_FORMATIONS: tuple[Formation, ...] = ("circle", "semicircle")
TALKING_FORMATIONS = (*PAIR_FORMATIONS, *CIRCLE_FORMATIONS)
MAX_GROUP_SIZE = 6

BodyRadius = Annotated[Range, bounded("a person's radius must be 0.1 m or more", low=0.1)]
BodyBreadth = Annotated[Range, bounded("a person's breadth must be above 0 and 1 m or less", above=0.0, high=1.0)]
ReactionWeights = Annotated[Weights[Reaction], AfterValidator(partial(require_weight, item="reaction"))]
_Time = Annotated[Range, bounded("a time must be above 0", above=0.0)]
_GroupSize = Annotated[IntRange, bounded(f"a group has 2 to {MAX_GROUP_SIZE} people", low=2, high=MAX_GROUP_SIZE)]
_Spacing = Annotated[Range, bounded("neighbours in a group need 0.5 m or more between their centres", low=0.5)]
_VAngle = Annotated[Range, bounded("the angle of a V must be within 0.5..1.5708 rad", low=0.5, high=1.5708)]


class FurnitureConfig(Settings):
    """A piece of furniture at a fixed position. A laptop that overlaps a table lies on it.

    Attributes:
        type: a type of furniture, a key of `sizes`, or any name if `size` is given.
        x, y: m, world frame.
        theta: rad, world frame.
        size: m; default: the size of its type.
        attracts: whether `at_laptop`, `at_plant` or `at_object` may place a pedestrian at its right side (-y), facing
            it.
        seat: whether one pedestrian can sit on it, above its centre and facing its front: +x, or -y of a piece that is
            longer (x) than wide (y). Default: if its type is one, such as a chair.
    """

    type: str
    x: float
    y: float
    theta: float = 0.0
    size: Size | None = None
    attracts: bool = True
    seat: bool | None = None


class _Place(Settings):
    """A position that is drawn where it is not given."""

    x: float | None = None
    y: float | None = None

    @model_validator(mode="after")
    def _check_position(self) -> Self:
        if (self.x is None) != (self.y is None):
            context = {"path": ("x" if self.x is None else "y",)}
            raise PydanticCustomError("place", "give x and y, or neither", context)
        return self


class DoorConfig(_Place):
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

    width: Annotated[float, Field(ge=0.7)] = 1.0
    inflow: NonNegativeFloat = 0.0
    pairs: Fraction = 0.0
    share: NonNegativeFloat = 1.0


class QueueConfig(_Place):
    """A queue: pedestrians stand in line, straight back from the first one, and leave it when they were served.

    Attributes:
        x, y: m, world frame: where the first pedestrian stands. Default: drawn, at a wall that it faces.
        theta: rad, world frame: what the first pedestrian faces, if x and y are given.
        spacing: distance of neighbours, m.
        service: time that the first pedestrian needs, s.
        capacity: largest number of pedestrians; less where a wall or furniture is in the way.
        waiting: number of pedestrians that stand in the queue at the start, in addition to all others.
    """

    theta: float = 0.0
    spacing: Annotated[float, Field(ge=0.5)] = 0.75
    service: Pause = Range(5, 15)
    capacity: Annotated[int, Field(ge=1, le=MAX_COUNT)] = 8
    waiting: IntRange = IntRange(0, 0)

    @model_validator(mode="after")
    def _check_waiting(self) -> Self:
        if self.waiting.max > self.capacity:
            context = {"waiting": self.waiting.max, "capacity": self.capacity, "path": ("waiting",)}
            raise PydanticCustomError("queue", "{waiting} people do not fit into a queue of {capacity}", context)
        return self


class PlaceConfig(Settings):
    """A place of interest; if there are any, wandering pedestrians go to them instead of anywhere in the room.

    Attributes:
        x, y: m, world frame.
        radius: m; pedestrians go to a random point within it.
        weight: with which pedestrians choose this place.
        stay: time that a pedestrian stands there, s.
    """

    x: float
    y: float
    radius: PositiveFloat = 1.0
    weight: PositiveFloat = 1.0
    stay: Pause = Range(5, 20)


class SpeedConfig(Normal):
    """Distribution of the desired speed, m/s: a normal distribution truncated at min and max."""

    mean: PositiveFloat = 1.3
    sd: PositiveFloat = 0.2
    min: PositiveFloat = 0.8
    max: PositiveFloat = 1.8


class ClearanceConfig(Normal):
    """Distribution of the clearance to the robot, m, between outlines: a normal distribution truncated at min and max.

    The default is the clearance that pedestrians kept from a robot crossing their path (Vassallo et al., Gait & Posture
    51 (2017) 97), truncated at two standard deviations.
    """

    mean: PositiveFloat = 0.83
    sd: PositiveFloat = 0.27
    min: NonNegativeFloat = 0.29
    max: PositiveFloat = 1.37


class FactorConfig(Normal):
    """Distribution of a factor by which persons differ: a normal distribution truncated at min and max."""

    mean: PositiveFloat = 1.0
    sd: PositiveFloat = 0.2
    min: PositiveFloat = 0.5
    max: PositiveFloat = 1.5


class PersonConfig(Settings):
    """Properties of the pedestrians.

    Attributes:
        radius: half the depth of the body, m.
        breadth: of the shoulders, m; twice the radius or less gives a disc.
        wall_distance: minimum distance of a pedestrian's centre from walls at the start, m.
        model: pedestrian model of all pedestrians: sonata2026, moussaid2009, helbing1995, helbing2000, farina2017 or
            orca2011; see models.md.
        desired_speed: distribution of the desired speed, m/s.
        headway: distribution of the factor of the time gap that a pedestrian keeps to those ahead.
        politeness: distribution of the factor of the strength with which a pedestrian avoids others.
        ignores_robot: probability that a pedestrian does not react to the robot, drawn for each pedestrian.
        reactions: weight of each reaction of the other pedestrians to the robot: avoids, stops, curious, scared,
            ignores; a list of names gives equal weights.
        robot_clearance: distribution of the clearance at which a pedestrian wants to pass the robot, m.
    """

    radius: BodyRadius = Range(0.13, 0.15)
    breadth: BodyBreadth = Range(0.4, 0.5)
    wall_distance: NonNegativeFloat = 0.4
    desired_speed: SpeedConfig = SpeedConfig()
    headway: FactorConfig = FactorConfig()
    politeness: FactorConfig = FactorConfig()
    model: ModelName = DEFAULT_MODEL
    ignores_robot: Fraction = 0.0
    reactions: ReactionWeights = Field(default={"avoids": 1.0})
    robot_clearance: ClearanceConfig = ClearanceConfig()


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
    walking_formations: Weights[Formation] = Field(default=dict.fromkeys(WALKING_FORMATIONS, 1.0))
    walking_spacing: _Spacing = Range(0.7, 1.1)
    v_angle: _VAngle = Range(1.1, 1.33)
    talking_size: _GroupSize = IntRange(2, 6)
    formations: Weights[Formation] = Field(default=dict.fromkeys(TALKING_FORMATIONS, 1.0))
    talking_spacing: _Spacing = Range(0.9, 1.2)
    places: Entities[Point] = ()

    @model_validator(mode="after")
    def _check_formations(self) -> Self:
        """Check that every formation is of the right kind, and that every group size in the range has a formation."""
        for key, known in (("walking_formations", WALKING_FORMATIONS), ("formations", TALKING_FORMATIONS)):
            unknown = [name for name in getattr(self, key) if name not in known]
            if unknown:
                context = {"name": unknown[0], "known": ", ".join(known), "path": (key,)}
                raise PydanticCustomError("formation", "'{name}' is not one of {known}", context)
        # every size from three up has the same formations, so that two and three stand for all sizes
        sizes = {min(size, 3) for size in range(self.talking_size.min, self.talking_size.max + 1)}
        for size in sizes:
            if not sum(self.formation_weights(size).values()) > 0.0:
                context = {"size": "two" if size == 2 else "three and more", "path": ("formations",)}
                raise PydanticCustomError("formation", "no formation for {size} people has a weight above 0", context)
        if not sum(self.walking_formations.values()) > 0.0:
            context = {"path": ("walking_formations",)}
            raise PydanticCustomError("formation", "at least one formation needs a weight above 0", context)
        return self

    def formation_weights(self, size: int) -> dict[Formation, float]:
        """Return the weights of the formations of a talking group with `size` members."""
        fitting = PAIR_FORMATIONS if size == 2 else CIRCLE_FORMATIONS
        return {name: weight for name, weight in self.formations.items() if name in fitting}


class SocialConfig(Settings):
    """What pedestrians do during the episode. By default they wander, and pause at their destinations.

    On reaching its goal, and on entering, a wandering pedestrian chooses what to do next, with the first five
    probabilities; their sum must not exceed 1. With what is left, and where its choice is not possible, it goes to one
    of `places`, or anywhere if there are none.

    Attributes:
        visits: probability that it goes to a free plant, laptop, shelf, TV or other object and attends to it for
            `visit_time`.
        joins: probability that it joins a standing pedestrian or a talking group for `talk_time`.
        sits: probability that it sits down on a free seat for `sit_time`.
        queues: probability that it goes to one of `queues` that is not full, and stays until it was served.
        exits: probability that it leaves through one of `doors`, together with its group if it leads one; not through
            the door by which it came if there is another one.
        meets: probability that two wandering pedestrians that approach each other stop and talk for `talk_time`.
        leaves: probability that a pedestrian that attends to a pedestrian or an object at the start leaves after that
            time.
        visit_time, talk_time, sit_time: s.
        pause: time that a wandering pedestrian, or a walking group, stands at its goal before it goes on, s; in a place
            of interest the time of that place.
    """

    visits: Fraction = 0.0
    joins: Fraction = 0.0
    meets: Fraction = 0.0
    leaves: Fraction = 0.0
    sits: Fraction = 0.0
    queues: Fraction = 0.0
    exits: Fraction = 0.0
    visit_time: _Time = Range(5, 20)
    talk_time: _Time = Range(10, 40)
    sit_time: _Time = Range(20, 90)
    pause: Pause = Range(1, 6)

    @model_validator(mode="after")
    def _check_sum(self) -> SocialConfig:
        total = self.visits + self.joins + self.sits + self.queues + self.exits
        if total > 1.0 + 1e-9:
            context = {"sum": round(total, 4)}
            message = "visits + joins + sits + queues + exits is {sum}; the sum must not exceed 1"
            raise PydanticCustomError("social", message, context)
        return self

    def social(self) -> Social:
        """Convert to the `Social` of a scene."""
        values: dict[str, Any] = {key: getattr(self, key) for key in Social.__dataclass_fields__}
        ranges = {key: (value.min, value.max) for key, value in values.items() if isinstance(value, Range)}
        return Social(**(values | ranges))


class LimitsConfig(Settings):
    """Limits of the robot's drive: speeds in m/s and rad/s, accelerations in m/s² and rad/s²."""

    ahead: PositiveFloat = Limits().ahead
    back: PositiveFloat = Limits().back
    sideways: PositiveFloat = Limits().sideways
    turn: PositiveFloat = Limits().turn
    acceleration: PositiveFloat = Limits().acceleration
    turn_acceleration: PositiveFloat = Limits().turn_acceleration


class RobotConfig(Settings):
    """The robot's drive, outline and start.

    Attributes:
        kinematics: holonomic, or unicycle, which moves along its heading only: at a wall or a person it stops.
        radius: m.
        limits: of the drive.
        clearance: minimum clearance of a drawn start from walls, furniture and pedestrians, m.
        pose: x, y (m), theta (rad) of the start, world frame; default: drawn.
        jitter: maximum random offset of `pose` in x, y (m) and theta (rad), in both directions, drawn for each scene.
        on_ways: maximum distance of a drawn start and goal, m, from the path of one of `people`: its track, or the line
            from its start through its goals. Default: no limit.
    """

    kinematics: Kinematics = "holonomic"
    radius: PositiveFloat = 0.30
    limits: LimitsConfig = LimitsConfig()
    clearance: PositiveFloat = 0.2
    pose: tuple[float, float, float] | None = None
    jitter: Jitter = (0.0, 0.0, 0.0)
    on_ways: PositiveFloat | None = None


class GoalConfig(Settings):
    """The robot's goal, and the condition for reaching it.

    Attributes:
        distance, angle: largest distance (m) and heading error (rad) of the robot at which the goal counts as reached.
        min_distance: minimum distance of a drawn goal from the robot's start, m.
        position: x, y, m, world frame; default: drawn.
        jitter: maximum random offset of `position` in x and y (m), in both directions, drawn for each scene.
        theta: rad, world frame; default: drawn.
    """

    distance: PositiveFloat = 0.40
    angle: PositiveFloat = 3.1416
    min_distance: PositiveFloat = 2.0
    position: Point | None = None
    jitter: tuple[NonNegativeFloat, NonNegativeFloat] = (0.0, 0.0)
    theta: float | None = None


class LabelConfig(Settings):
    """The label that a driver or rater is asked for; see `labels.LabelSpec`.

    Attributes:
        kind: `command` (the recorded command is the label; no question), `yes_no`, `classes`, `slider` from 0 to 1, or
            `text`.
        when: `frame`: at every frame while driving; `run`: once after the run. `text` requires `run`.
        name: key of the label in frames.
        question: text shown to the driver or rater.
        classes: names of the classes, or their number; 2 to 9.
        ends: meaning of 0 and of 1 on the slider.
    """

    kind: Kind = "command"
    when: When = "run"
    name: str = Field(default="label", min_length=1)
    question: str = ""
    classes: Annotated[tuple[str, ...], Field(min_length=2, max_length=9)] | None = None
    ends: tuple[str, str] = LabelSpec().ends

    @field_validator("classes", mode="before")
    @classmethod
    def _name_classes(cls, value: Any) -> Any:
        """Convert a number of classes to the names "1", "2", …"""
        if isinstance(value, int) and not isinstance(value, bool):
            return tuple(str(k) for k in range(1, min(value, 10) + 1))  # 10 names are one too many: an error follows
        return value

    @model_validator(mode="after")
    def _check_combination(self) -> Self:
        if (self.kind == "classes") != (self.classes is not None):
            needs_classes = self.kind == "classes"
            hint = "give the names of the classes, or their number" if needs_classes else "classes need kind: classes"
            raise PydanticCustomError("label", "{hint}", {"hint": hint, "path": ("classes",)})
        if self.kind == "text" and self.when == "frame":
            raise PydanticCustomError("label", "text is asked for after the run; set when: run", {"path": ("when",)})
        return self

    def spec(self) -> LabelSpec:
        """Convert to a `LabelSpec`."""
        return LabelSpec(self.kind, self.when, self.name, self.question, self.classes or (), self.ends)


class RulesConfig(Settings):
    """Rules of the episode; see `scene.Rules`."""

    dt: PositiveFloat = Rules().dt
    substeps: PositiveInt = Rules().substeps
    iterations: PositiveInt = Rules().iterations
    time_limit: PositiveFloat = Rules().time_limit
    ends_on: TupleOf[EndsOn] = Rules().ends_on
    guard: bool = Rules().guard
    contact_distance: NonNegativeFloat = Rules().contact_distance
    side: Literal[-1, 1] = Rules().side

    @model_validator(mode="after")
    def _check_time_limit(self) -> Self:
        if self.time_limit < self.dt:
            context: dict[str, Any] = {"limit": self.time_limit, "dt": self.dt, "path": ("time_limit",)}
            raise PydanticCustomError("rules", "the time limit must be at least one tick, dt = {dt} s", context)
        return self
