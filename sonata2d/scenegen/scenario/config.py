"""What a generated scene may look like: `ScenarioConfig`. Its defaults are the preset sonata-2020."""

from __future__ import annotations

from typing import Any, Self

from pydantic import Field, PositiveFloat, PositiveInt, ValidationError, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...errors import ConfigError
from ...registry import did_you_mean
from .people import PersonSpec, refuse_twins
from .ranges import IntRange, Range, Settings, Share
from .sections import (
    SIZES,
    FurnitureConfig,
    GoalConfig,
    GroupConfig,
    LabelConfig,
    PersonConfig,
    RobotConfig,
    RoomConfig,
    RulesConfig,
    Size,
)
from .social import SocialConfig

_TWENTY_DEGREES = 0.3490658503988659  # rad


class ScenarioConfig(Settings):
    """What a generated scene may look like. Every range may be one number.

    People and things are drawn first: those of `standing` to `tvs` without a place in any relation, then `relations`
    among them, at most as many as there are people and things for; each is of a random kind (talking, at a laptop, at a
    plant, walking together) or, if nobody is free for that, of the next. `talking_pairs` to `at_object` bring their own
    people, and use a free laptop, plant or other object, a fixed one first, before they bring one of their own.
    `people` are there besides all of these.

    Attributes:
        name: of the scenario; scenes are grouped by it. Unless given: sonata-2020, or custom if anything is set.
        context: text for whoever judges the robot, kept in the file.
        standing, wandering: people who stand alone, or walk about.
        humans: both together, in place of the two; `wandering_share` of them wander.
        laptops_on_tables: one laptop on each drawn table.
        talking_groups, walking_groups: see `groups`; the pairs are those of the original, farther apart.
        furniture: pieces at fixed places.
        people: each with a start, goals or a track of their own, besides those who are drawn.
        sizes: m, by type of furniture: overrides, or new types. A number is the radius of a disc, a pair an oblong.
        furniture_yaw: rad, of drawn furniture.
        talking_distance: m; `talking_angle`: rad, by which the second fails to face the first.
        laptop_distance, plant_distance, object_distance: m, from the person to what they attend to, which they face
            from its right side (-y).
        pair_spacing: m, side by side, of people who walk together.
        clearance: m, between outlines at the start.
        max_attempts: poses tried for each thing; `max_layouts`: fresh starts with the same people and things.
        drop: leave out what finds no place, and list it in `Scene.dropped`, instead of raising a SceneError; robot,
            goal and `people` are never left out.
        flip: the chance that a scene is laid out as its mirror image, with all that is given: y changes its sign.
    """

    name: str = Field(default="sonata-2020", min_length=1)
    description: str = ""
    context: str | None = None
    room: RoomConfig = RoomConfig()
    standing: IntRange | None = IntRange(0, 4)
    wandering: IntRange | None = IntRange(0, 4)
    humans: IntRange | None = None
    wandering_share: Share = 0.5
    tables: IntRange = IntRange(0, 4)
    plants: IntRange = IntRange(0, 4)
    chairs: IntRange = IntRange(0, 0)
    shelves: IntRange = IntRange(0, 0)
    tvs: IntRange = IntRange(0, 0)
    laptops_on_tables: bool = True
    relations: IntRange = IntRange(0, 4)
    talking_pairs: IntRange = IntRange(0, 0)
    walking_pairs: IntRange = IntRange(0, 0)
    talking_groups: IntRange = IntRange(0, 0)
    walking_groups: IntRange = IntRange(0, 0)
    at_laptop: IntRange = IntRange(0, 0)
    at_plant: IntRange = IntRange(0, 0)
    at_object: IntRange = IntRange(0, 0)
    furniture: tuple[FurnitureConfig, ...] = ()
    people: tuple[PersonSpec, ...] = ()
    sizes: dict[str, Size] = Field(default_factory=lambda: dict(SIZES))
    furniture_yaw: Range = Range(0, 0)
    talking_distance: Range = Range(1.5, 3.0)
    talking_angle: Range = Range(-_TWENTY_DEGREES, _TWENTY_DEGREES)
    laptop_distance: Range = Range(1.0, 4.0)
    plant_distance: Range = Range(1.0, 4.0)
    object_distance: Range = Range(1.0, 2.0)
    pair_spacing: Range = Range(0.5, 0.5)
    groups: GroupConfig = GroupConfig()
    person: PersonConfig = PersonConfig()
    robot: RobotConfig = RobotConfig()
    goal: GoalConfig = GoalConfig()
    rules: RulesConfig = RulesConfig()
    social: SocialConfig = SocialConfig()
    label: LabelConfig = LabelConfig()
    clearance: PositiveFloat = 0.05
    max_attempts: PositiveInt = 200
    max_layouts: PositiveInt = 10
    drop: bool = False
    flip: Share = 0.0

    @model_validator(mode="before")
    @classmethod
    def _choose_name_and_people(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        given = {"name": "custom" if given else "sonata-2020"} | given
        if given.get("humans") is None:
            return given
        for key in ("standing", "wandering"):
            if given.get(key) is not None:
                said = {"path": ("humans",)}
                raise PydanticCustomError("humans", "give humans, or standing and wandering, not both", said)
        return given | {"standing": None, "wandering": None}

    @model_validator(mode="after")
    def _have_people(self) -> Self:
        if self.humans is None and (self.standing is None or self.wandering is None):
            raise PydanticCustomError("humans", "standing and wandering must be ranges where humans is not given")
        return self

    @field_validator(
        "talking_distance", "laptop_distance", "plant_distance", "object_distance", "pair_spacing", mode="after"
    )
    @classmethod
    def _be_apart(cls, distance: Range) -> Range:
        if not distance.min > 0.0:
            raise PydanticCustomError("distance", "a distance must be above 0")
        return distance

    @field_validator("sizes", mode="after")
    @classmethod
    def _know_every_size(cls, sizes: dict[str, Size]) -> dict[str, Size]:
        return SIZES | sizes

    @field_validator("people", mode="after")
    @classmethod
    def _be_no_twins(cls, people: tuple[PersonSpec, ...]) -> tuple[PersonSpec, ...]:
        refuse_twins(people)
        return people

    @model_validator(mode="after")
    def _know_every_type(self) -> Self:
        for k, piece in enumerate(self.furniture):
            if piece.size is None and piece.type not in self.sizes:
                said = {"hint": did_you_mean(piece.type, self.sizes), "path": ("furniture", k, "type")}
                raise PydanticCustomError("furniture", "furniture of unknown type needs a size{hint}", said)
        return self

    @model_validator(mode="after")
    def _keep_start_off_goal(self) -> Self:
        if self.robot.pose is not None and self.goal.position is not None:
            dx, dy = (a - b for a, b in zip(self.robot.pose, self.goal.position, strict=False))
            if dx * dx + dy * dy <= self.goal.distance * self.goal.distance:
                said = {"path": ("goal", "position")}
                raise PydanticCustomError("goal", "the robot would start on its goal", said)
        return self

    def changed(self, **settings: Any) -> ScenarioConfig:
        """The same scenario with other settings.

        Raises:
            ConfigError: they cannot be used.
        """
        try:
            return ScenarioConfig(**{**self.settings(), **settings})
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise ConfigError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None

    def settings(self) -> dict[str, Any]:
        """All settings, resolved, as JSON holds them; `ScenarioConfig(**settings)` is the same scenario again."""
        return self.model_dump(mode="json")
