"""What stands once in an episode file of its scene, as pydantic models."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..entities import Behaviour, EndsOn, Formation, Kinematics, Reaction

Count = Annotated[int, Field(ge=0)]
Chance = Annotated[float, Field(ge=0, le=1)]
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

    visits: Chance = Field(description="that a wanderer, on arrival, goes to a plant, laptop or other object")
    joins: Chance = Field(description="that a wanderer, on arrival, joins somebody who stands, or a group that talks")
    meets: Chance = Field(description="that two wanderers who come near each other stop and talk")
    leaves: Chance = Field(description="that who attends to a person or a thing at the start goes away after a time")
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
