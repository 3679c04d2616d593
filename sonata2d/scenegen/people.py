"""The section `people` of a scenario: people at given places, one by one."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, NonNegativeFloat, model_validator
from pydantic_core import PydanticCustomError

from ..entities import Behaviour
from ..geometry import Point
from .settings import Range, Settings

Jitter = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]  # m, m, rad


class FixedPerson(Settings):
    """A person at a given place.

    Attributes:
        x, y, theta: where they start, m, rad.
        jitter: how far from there a scene may move them, in x, y and theta, either way; their goals move along.
        behaviour: standing, wandering, or walking: to their goals.
        goals: x, y of each, m, one after the other; a wall in between is walked round.
        velocity: m/s, world frame, at the start.
        desired_speed, radius: m/s, m; drawn as for everybody if not given.
        group: people of the same name or number belong together: they talk if they stand, else they walk together.
        reacts_to_robot: 0 ignores the robot .. 1 treats it as a person; drawn as for everybody if not given.
    """

    x: float
    y: float
    theta: float = 0.0
    jitter: Jitter = (0.0, 0.0, 0.0)
    behaviour: Behaviour = "standing"
    goals: tuple[Point, ...] = ()
    velocity: Point = (0.0, 0.0)
    desired_speed: Range | None = None
    radius: Range | None = None
    group: str | int | None = None
    reacts_to_robot: Annotated[float, Field(ge=0.0, le=1.0)] | None = None

    @model_validator(mode="after")
    def _go_somewhere(self) -> Self:
        if bool(self.goals) != (self.behaviour == "walking"):
            hint = "who is walking needs goals" if not self.goals else "goals go with behaviour: walking"
            raise PydanticCustomError("goals", "{hint}", {"hint": hint})
        if self.desired_speed is not None and not self.desired_speed.min > 0.0:
            raise PydanticCustomError("speed", "a desired speed must be above 0", {"path": ("desired_speed",)})
        if self.radius is not None and not self.radius.min >= 0.1:
            raise PydanticCustomError("radius", "a person's radius must be 0.1 m or more", {"path": ("radius",)})
        return self
