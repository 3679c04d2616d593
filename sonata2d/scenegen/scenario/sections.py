"""The sections of a scenario: room, furniture, people, robot, goal, rules."""

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

from ...core.entities import DEFAULT_MODEL, PERSON_RADIUS, EndsOn, Kinematics, Limits, Reaction
from ...core.geometry import Disc, Point, Rectangle, Shape, quantised
from ...core.labels import Kind, LabelSpec, When
from ...core.scene import Rules
from ...registry import PEDESTRIAN_MODELS
from .groups import GroupConfig
from .ranges import Jitter, Normal, Range, Settings, Share, registered, weighed
from .rooms import RoomConfig
from .social import ClearanceConfig

__all__ = [  # every section, in the order of docs/scenario.md
    "FurnitureConfig",
    "GoalConfig",
    "GroupConfig",
    "LabelConfig",
    "LimitsConfig",
    "PersonConfig",
    "RobotConfig",
    "RoomConfig",
    "RulesConfig",
    "SpeedConfig",
]

ModelName = Annotated[str, AfterValidator(partial(registered, PEDESTRIAN_MODELS))]
Size = PositiveFloat | tuple[PositiveFloat, PositiveFloat]  # radius of a disc, or length (x) and width (y), m

SIZES: dict[str, Size] = {
    "table": (0.8, 0.8),
    "laptop": (0.35, 0.25),
    "plant": 0.2,
    "chair": (0.45, 0.45),
    "shelf": (1.0, 0.35),
    "tv": (1.0, 0.1),
}  # m; the table as SocNav3 draws it, the rest as one finds them in shops


def outline_of(size: Size) -> Shape:
    """The outline that a size stands for."""
    return Rectangle(quantised(size[0]), quantised(size[1])) if isinstance(size, tuple) else Disc(quantised(size))


class FurnitureConfig(Settings):
    """A piece of furniture at a fixed place. A laptop over a table lies on it.

    Attributes:
        size: m, if not that of its type.
        attracts: whether `at_laptop`, `at_plant` or `at_object` may put somebody on its right side (-y), facing it.
    """

    type: str
    x: float
    y: float
    theta: float = 0.0
    size: Size | None = None
    attracts: bool = True


class SpeedConfig(Normal):
    """A normal distribution cut off at both ends, m/s."""

    mean: PositiveFloat = 1.3
    sd: PositiveFloat = 0.2
    min: PositiveFloat = 0.8
    max: PositiveFloat = 1.8


class PersonConfig(Settings):
    """What people are like.

    Attributes:
        radius: of the solid outline, m.
        wall_distance: of a person's centre from walls at the start, m.
        model: of walking, one for everybody: sonata2026, moussaid2009, helbing1995, helbing2000, farina2017 or
            orca2011; see models.md.
        ignores_robot: the chance, drawn for each person, that they take no notice of the robot.
        reactions: weights of how the others behave towards it: avoids, stops, curious, scared, ignores; a list of
            names weighs them alike.
        robot_clearance: m, that they want to pass it at.
    """

    radius: Range = Range(PERSON_RADIUS, PERSON_RADIUS)
    wall_distance: NonNegativeFloat = 0.4
    desired_speed: SpeedConfig = SpeedConfig()
    model: ModelName = DEFAULT_MODEL
    ignores_robot: Share = 0.0
    reactions: dict[Reaction, NonNegativeFloat] = Field(default={"avoids": 1.0})
    robot_clearance: ClearanceConfig = ClearanceConfig()

    @field_validator("reactions", mode="before")
    @classmethod
    def _weigh_reactions(cls, given: Any) -> Any:
        return weighed(given)

    @field_validator("reactions", mode="after")
    @classmethod
    def _have_a_reaction(cls, reactions: dict[Reaction, float]) -> dict[Reaction, float]:
        if not sum(reactions.values()) > 0.0:
            raise PydanticCustomError("reactions", "at least one reaction needs a weight above 0")
        return reactions

    @field_validator("radius", mode="after")
    @classmethod
    def _have_a_body(cls, radius: Range) -> Range:
        if not radius.min >= 0.1:
            raise PydanticCustomError("radius", "a person's radius must be 0.1 m or more")
        return radius


class LimitsConfig(Settings):
    """What the robot's drive can do: m/s, rad/s, m/s², rad/s²."""

    ahead: PositiveFloat = Limits().ahead
    back: PositiveFloat = Limits().back
    sideways: PositiveFloat = Limits().sideways
    turn: PositiveFloat = Limits().turn
    acceleration: PositiveFloat = Limits().acceleration
    turn_acceleration: PositiveFloat = Limits().turn_acceleration


class RobotConfig(Settings):
    """The robot's drive and outline.

    Attributes:
        clearance: of a drawn start from everything, m.
        pose: x, y, theta of the start, if it is not to be drawn.
        jitter: how far from that pose a scene may move it, in x, y and theta, either way; m, rad.
        on_ways: m: a drawn start and a drawn goal lie no farther than this from a way of `people`: their track, or the
            line from their start through their goals. Unless given, anywhere.
    """

    kinematics: Kinematics = "holonomic"
    radius: PositiveFloat = 0.30
    limits: LimitsConfig = LimitsConfig()
    clearance: PositiveFloat = 0.2
    pose: tuple[float, float, float] | None = None
    jitter: Jitter = (0.0, 0.0, 0.0)
    on_ways: PositiveFloat | None = None


class GoalConfig(Settings):
    """Where the robot shall go, and when it is there.

    Attributes:
        distance, angle: of the robot from the goal's centre (m) and heading (rad) that count as reached.
        min_distance: from the robot's start, m, of a drawn goal.
        position: x, y, m, if the goal is not to be drawn.
        jitter: how far from that position a scene may move it, in x and y, either way; m.
        theta: rad, if the heading is not to be drawn.
    """

    distance: PositiveFloat = 0.40
    angle: PositiveFloat = 3.1416
    min_distance: PositiveFloat = 2.0
    position: Point | None = None
    jitter: tuple[NonNegativeFloat, NonNegativeFloat] = (0.0, 0.0)
    theta: float | None = None


class LabelConfig(Settings):
    """What a person who drives, or rates, is asked for; see `labels.LabelSpec`.

    Attributes:
        kind: `command`, which asks nothing, `yes_no`, `classes`, `slider` from 0 to 1, or `text`.
        when: `frame`, while driving, or `run`, once afterwards; text is asked for afterwards only.
        name: its key in frames.
        question: what the person is asked.
        classes: their names, or how many there are; 2 to 9.
        ends: what 0 and 1 of the slider mean.
    """

    kind: Kind = "command"
    when: When = "run"
    name: str = Field(default="label", min_length=1)
    question: str = ""
    classes: Annotated[tuple[str, ...], Field(min_length=2, max_length=9)] | None = None
    ends: tuple[str, str] = LabelSpec().ends

    @field_validator("classes", mode="before")
    @classmethod
    def _number_them(cls, given: Any) -> Any:
        if isinstance(given, int) and not isinstance(given, bool):
            return tuple(str(k) for k in range(1, min(given, 10) + 1))
        return given

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        if (self.kind == "classes") != (self.classes is not None):
            hint = "name the classes, or say how many" if self.kind == "classes" else "classes go with kind: classes"
            raise PydanticCustomError("label", "{hint}", {"hint": hint, "path": ("classes",)})
        if self.kind == "text" and self.when == "frame":
            raise PydanticCustomError("label", "text is asked for after the run; set when: run", {"path": ("when",)})
        return self

    def spec(self) -> LabelSpec:
        """As the rest of sonata2d knows it."""
        return LabelSpec(self.kind, self.when, self.name, self.question, self.classes or (), self.ends)


class RulesConfig(Settings):
    """How an episode is run; see `entities.Rules`."""

    dt: PositiveFloat = Rules().dt
    substeps: PositiveInt = Rules().substeps
    iterations: PositiveInt = Rules().iterations
    time_limit: PositiveFloat = Rules().time_limit
    ends_on: tuple[EndsOn, ...] = Rules().ends_on
    guard: bool = Rules().guard
    contact_distance: NonNegativeFloat = Rules().contact_distance
    side: Literal[-1, 1] = Rules().side
