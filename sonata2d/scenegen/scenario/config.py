"""`ScenarioConfig`: the settings that a scene is generated from. Its defaults are the preset sonata-2020."""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection
from inspect import Parameter, Signature, signature
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, PositiveInt, model_validator

from ...core.attributes import Holder
from ...core.bounds import Fraction, Positive
from ...core.entities import Robot
from ...core.files.limits import MAX_COUNT, MAX_NAME, MAX_ROBOTS
from ...core.furniture_types import BUILT_IN
from ...core.geometry import Barriers, Pose
from ...core.humans import MAXIMUM_SPEED_RATIO, RESPONSE_TIME
from ...core.labels import LabelSpec
from ...core.relations import RELATION, Relation
from ...core.scene import Rules
from ...core.tasks import ARRIVED
from ...errors import PluginWarning
from ...registry import FURNITURE_TYPES, did_you_mean, furniture_type, furniture_types
from .attributes import AttributesConfig
from .base import Entities, IntRange, Range, Settings, is_section, within
from .people import PersonSpec, check_people
from .problems import setting_error
from .sections import (
    PAUSING,
    AreaConfig,
    DoorConfig,
    FurnitureConfig,
    GoalConfig,
    GroupConfig,
    InteriorDoorConfig,
    LabelSection,
    OtherRobotConfig,
    PersonConfig,
    PlaceConfig,
    QueueConfig,
    RobotConfig,
    RoomConfig,
    RulesSection,
    Size,
    SocialSection,
)

# Of a robot without safety guard, m/s, and m in a physics step: beyond them it pushes people through walls.
_UNGUARDED_SPEED, _UNGUARDED_STEP = 12.0, 0.05
_ROBOT_TURN = 1.0  # rad in a physics step, within which `portable_math.rotation` is exact to 2e-7
_TWENTY_DEGREES = 0.3490658503988659  # rad
Distance = Annotated[Range, within("a distance must be above 0", 0.0, above=True)]


class ScenarioConfig(Settings):
    """Settings of a scenario, from which scenes are generated. A range may be given as one number.

    Pedestrians and furniture are drawn first, by the counts `standing` to `tvs` and of further types of furniture. Then
    `relations` of them are put into relations, or fewer where too few are free; each relation is of a random kind
    (talking, at a laptop, at a plant, walking together) or, where that kind is impossible, of the next kind.
    `talking_pairs` to `following_pairs` add pedestrians of their own; they use a free laptop, plant or other object,
    fixed ones first, and add one where none is free. `people` are added to all of these.

    Attributes:
        name: of the scenario; part of the scene's family. Default: sonata-2020, or custom if any setting is given.
        description: one line, shown in lists of scenarios.
        context: text for the raters of the robot, stored in the episode file.
        room: floor plan.
        standing, wandering: number of standing and of wandering pedestrians.
        humans: total number, given instead of these two; `wandering_share`: fraction of `humans` that wander.
        tables, plants, chairs, shelves, tvs: number of drawn pieces of furniture; each further type of furniture, such
            as of a plug-in, has a key of its own.
        laptops_on_tables: whether each drawn table has a laptop on it.
        relations: number of relations among the drawn pedestrians and furniture.
        talking_pairs, walking_pairs: number of additional pairs, spaced by `talking_distance` and `pair_spacing`.
        talking_groups, walking_groups: number of additional groups; see `groups`.
        at_laptop, at_plant, at_object: number of additional pedestrians that attend to a laptop, plant or other object.
        arguing_pairs, handing_over_pairs, caring_pairs: number of additional pairs that argue, hand something over, or
            of whom one cares for the other.
        arguing_distance, handing_over_distance, caring_distance: m, between their members, who face each other.
        watching_tv: number of additional pedestrians that watch a TV, `tv_distance` away, m.
        leading_pairs, following_pairs: number of additional pairs that walk one behind the other, `leading_distance`
            apart, m: the one ahead leads, or the one behind follows.
        furniture: pieces at fixed positions.
        doors, interior_doors, queues, places, areas, attributes: see the sections of these names.
        seated: number of additional pedestrians that sit on seats at the start, or fewer where too few are free.
        people: pedestrians that are specified one by one, each with a start, goals or a track.
        sizes: m, by type of furniture: replaces the default sizes or adds types. One number is the radius of a disc,
            two are the length and width of a rectangle.
        furniture_yaw: rad, of drawn furniture.
        talking_distance: m, between the members of a talking pair; `talking_angle`: rad, deviation of the second member
            from facing the first.
        laptop_distance, plant_distance, object_distance: m, from a pedestrian to the object that it attends to; the
            pedestrian stands at the object's access side (-y) and faces it.
        pair_spacing: m, between the members of a walking pair, side by side.
        groups, person, robot, goal, rules, social: the sections of these names; label: the section `LabelSpec`.
        robots: the other robots, see the section `OtherRobotConfig`; or the number of robots in all, if the others have
            the settings of `robot` and `goal` too.
        clearance: minimum gap between outlines at the start, m.
        max_attempts: number of poses tried for each item; `max_layouts`: number of complete layouts tried with the same
            pedestrians and furniture.
        drop: whether items that cannot be placed are left out and listed in `Scene.dropped` instead of raising a
            SceneError; robot, goal and `people` are never left out.
        flip: probability that a scene is generated as its mirror image (y changes sign), fixed positions included.
    """

    model_config = ConfigDict(extra="allow")  # numbers of further types of furniture
    __pydantic_extra__: dict[str, IntRange] = Field(init=False)
    _optional = frozenset({
        "robots", "areas", "attributes", "interior_doors", "arguing_pairs", "handing_over_pairs", "caring_pairs",
        "watching_tv",
        "leading_pairs", "following_pairs", "arguing_distance", "handing_over_distance", "caring_distance",
        "tv_distance", "leading_distance",
    })  # fmt: skip

    name: str = Field(default="sonata-2020", min_length=1, max_length=MAX_NAME)
    description: str = ""
    context: str | None = None
    room: RoomConfig = RoomConfig()
    standing: IntRange | None = IntRange(0, 4)
    wandering: IntRange | None = IntRange(0, 4)
    humans: IntRange | None = None
    wandering_share: Fraction = 0.5
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
    arguing_pairs: IntRange = IntRange(0, 0)
    handing_over_pairs: IntRange = IntRange(0, 0)
    caring_pairs: IntRange = IntRange(0, 0)
    watching_tv: IntRange = IntRange(0, 0)
    leading_pairs: IntRange = IntRange(0, 0)
    following_pairs: IntRange = IntRange(0, 0)
    furniture: Entities[FurnitureConfig] = ()
    doors: Entities[DoorConfig] = ()
    queues: Entities[QueueConfig] = ()
    places: Entities[PlaceConfig] = ()
    areas: Entities[AreaConfig] = ()
    interior_doors: Entities[InteriorDoorConfig] = ()
    attributes: AttributesConfig = AttributesConfig()
    seated: IntRange = IntRange(0, 0)
    people: Annotated[Entities[PersonSpec], AfterValidator(check_people)] = ()
    sizes: dict[str, Size] = Field(default={})
    furniture_yaw: Range = Range(0, 0)
    talking_distance: Distance = Range(1.5, 3.0)
    talking_angle: Range = Range(-_TWENTY_DEGREES, _TWENTY_DEGREES)
    laptop_distance: Distance = Range(1.0, 4.0)
    plant_distance: Distance = Range(1.0, 4.0)
    object_distance: Distance = Range(1.0, 2.0)
    pair_spacing: Distance = Range(0.5, 0.5)
    arguing_distance: Distance = Range(0.6, 0.9)
    handing_over_distance: Distance = Range(0.8, 1.0)
    caring_distance: Distance = Range(0.6, 0.8)
    tv_distance: Distance = Range(1.5, 3.0)
    leading_distance: Distance = Range(1.0, 1.5)
    groups: GroupConfig = GroupConfig()
    person: PersonConfig = PersonConfig()
    robot: RobotConfig = RobotConfig()
    goal: GoalConfig = GoalConfig()
    robots: Entities[OtherRobotConfig] = ()
    rules: RulesSection = Rules()
    social: SocialSection = PAUSING
    label: LabelSection = LabelSpec()
    clearance: Positive = 0.05
    max_attempts: PositiveInt = 200
    max_layouts: PositiveInt = 50
    drop: bool = False
    flip: Fraction = 0.0

    @model_validator(mode="before")
    @classmethod
    def _list_robots(cls, values: Any) -> Any:
        """List the other robots if their number is given."""
        count = values.get("robots") if isinstance(values, dict) else None
        if not isinstance(count, int) or isinstance(count, bool):
            return values
        if not 1 <= count <= MAX_ROBOTS:
            raise setting_error(f"a scene has 1 to {MAX_ROBOTS} robots, got {count}", "robots")
        robot, goal = (_without_place(values.get(key)) for key in ("robot", "goal"))
        others = [{**robot, "goal": goal, "count": count - 1}] if count > 1 else []
        return values | {"robots": others}

    @model_validator(mode="before")
    @classmethod
    def _set_default_name_and_counts(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        values = {"name": "custom" if values else "sonata-2020"} | values
        if values.get("humans") is None:
            return values
        for key in ("standing", "wandering"):
            if values.get(key) is not None:
                raise setting_error("give humans, or standing and wandering, not both", "humans")
        return values | {"standing": None, "wandering": None}

    @model_validator(mode="after")
    def _leave_out_zero_counts(self) -> Self:
        """Leave out further types that are not drawn, so that files do not depend on the types that are installed."""
        further = self.model_extra or {}
        for key in [key for key, count in further.items() if count.max == 0]:
            del further[key]
        return self

    @model_validator(mode="after")
    def _check_counts(self) -> Self:
        if self.humans is None and (self.standing is None or self.wandering is None):
            raise setting_error("standing and wandering must be ranges where humans is not given")
        places, groups = len(self.groups.places), self.talking_groups.max
        if places > groups:
            message = f"there are {places} places for at most {groups} talking groups"
            raise setting_error(f"{message}; raise talking_groups, or remove places", "groups", "places")
        return self

    @model_validator(mode="after")
    def _check_furniture_types(self) -> Self:
        for k, piece in enumerate(self.furniture):
            if piece.size is None and piece.body is None and self.size_of(piece.type) is None:
                known = list(dict.fromkeys((*self.sizes, *FURNITURE_TYPES)))
                hint = did_you_mean(piece.type, known) or f"; known types are {', '.join(known)}"
                raise setting_error(f"furniture of unknown type needs a size{hint}", "furniture", k, "type")
        return self

    @model_validator(mode="after")
    def _check_journeys(self) -> Self:
        for key, needed in (("exits", "doors"), ("queues", "queues")):
            if getattr(self.social, key) > 0.0 and not getattr(self, needed):
                raise setting_error(f"social.{key} needs {needed}; add some, or set it to 0", "social", key)
        if self.social.exits > 0.0 and not any(door.share > 0.0 for door in self.doors):
            raise setting_error("at least one door needs a share above 0", "doors")
        arrivals = sum(door.inflow for door in self.doors) * self.rules.time_limit / 60.0
        if arrivals > MAX_COUNT:
            message = f"{arrivals:.0f} people would enter until rules.time_limit, at most {MAX_COUNT} may"
            raise setting_error(f"{message}; lower the inflow", "doors")
        return self

    @model_validator(mode="after")
    def _check_interior_doors(self) -> Self:
        for k, door in enumerate(self.interior_doors):
            if door.x is None and {*self.room.kinds} != {"doorway"}:
                raise setting_error("give x and y; only rooms of the kind doorway have one", "interior_doors", k, "x")
        return self

    @model_validator(mode="after")
    def _check_areas(self) -> Self:
        names = [area.name for area in self.areas]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise setting_error(f"the name {name!r} is given to more than one area", "areas", k, "name")
        # place of a key `in` among the settings, its value, and the position that it replaces
        uses: list[tuple[tuple[str | int, ...], str | None, tuple[float, ...] | None]]
        uses = [(("robot",), self.robot.area, self.robot.pose), (("goal",), self.goal.area, self.goal.position)]
        for k, other in enumerate(self.robots):
            uses.append((("robots", k), other.area, other.pose))
            uses.append((("robots", k, "goal"), other.goal.area, other.goal.position))
        uses += [(("people", k), person.area, None) for k, person in enumerate(self.people)]
        for place, area, position in uses:
            if area is not None and position is not None:
                raise setting_error("the position is given: omit in, or let it be drawn", *place, "in")
            if area is not None and area not in names:
                hint = did_you_mean(area, names) or f"; areas are {', '.join(names) or 'not given'}"
                raise setting_error(f"there is no area {area!r}{hint}", *place, "in")
        return self

    @model_validator(mode="after")
    def _check_attributes(self) -> Self:
        holders: dict[Holder, tuple[str, Any]] = {
            "people": ("people", self.people), "objects": ("furniture", self.furniture), "areas": ("areas", self.areas)
        }  # fmt: skip
        for of, (key, settings) in holders.items():
            for k, each in enumerate(settings):
                if problem := self.attributes.problem(of, each.attributes):
                    raise setting_error(problem[1], key, k, "attributes", problem[0])
        return self

    @model_validator(mode="after")
    def _check_robots(self) -> Self:
        if (count := 1 + sum(other.count for other in self.robots)) > MAX_ROBOTS:
            raise setting_error(f"a scene has at most {MAX_ROBOTS} robots, got {count}", "robots")
        self._check_task(self.robot, self.goal, ())
        if self.goal.person is not None:
            if self.goal.person > len(self.people):
                count = len(self.people)
                raise setting_error(f"there is no person {self.goal.person}; people has {count}", "goal", "person")
            if self.goal.task in ("follow", "accompany") and not self.people[self.goal.person - 1].goals:
                message = f"person {self.goal.person} walks nowhere; give goals, at the last of which the task ends"
                raise setting_error(message, "people", self.goal.person - 1, "goals")
            if self.goal.task in ("follow", "accompany"):
                self._check_way(self.people[self.goal.person - 1], self.goal.person)
        for k, other in enumerate(self.robots):
            if other.goal.task != "go" or other.goal.then or other.goal.object:
                raise setting_error("tasks, further places and objects are of the first robot", "robots", k, "goal")
            self._check_task(other, other.goal, ("robots", k))
        return self

    def _check_way(self, person: PersonSpec, number: int) -> None:
        """Check that a person who is followed comes to the end of its way once, and stays there."""
        path = ("people", number - 1)
        if person.exits or person.leaves is not None:
            raise setting_error(f"person {number} leaves the scene, and the task ends where it stays", *path)
        if person.area is not None:
            return  # its start is drawn
        before = (person.start, *person.goals[:-1])
        way = Barriers.of((a, b, 0.0) for a, b in pairwise((before[0], *before)))
        if way.gaps(np.array([person.goals[-1]])).min() <= 2.0 * ARRIVED:
            message = (
                f"the way of person {number} comes within {2.0 * ARRIVED:g} m of its end before, where the task ends"
            )
            raise setting_error(f"{message}; move a goal", *path, "goals")

    def _check_task(self, robot: RobotConfig, goal: GoalConfig, place: tuple[str | int, ...]) -> None:
        """Check a robot and its goal; `place` is that of the settings of another robot."""
        if robot.pose is not None and goal.position is not None:
            dx, dy = (a - b for a, b in zip(robot.pose, goal.position, strict=False))
            if dx * dx + dy * dy <= goal.distance * goal.distance:
                raise setting_error("the robot would start on its goal", *place, "goal", "position")
        self._check_unguarded_speed(robot)
        self._check_turn(robot)

    def _check_unguarded_speed(self, drive: RobotConfig) -> None:
        rules, pose = self.rules, Pose(0.0, 0.0, 0.0)
        speed = Robot(pose, kinematics=drive.kinematics, limits=drive.limits, drive=drive.drive).top_speed
        step = speed * rules.dt / rules.substeps
        if not rules.guard and (speed > _UNGUARDED_SPEED or step > _UNGUARDED_STEP):
            message = (
                f"without the guard the robot may drive at {_UNGUARDED_SPEED:g} m/s, and move {_UNGUARDED_STEP} m in a "
                f"physics step, dt / substeps; with robot.limits it reaches {speed:.3g} m/s and {step:.2g} m per "
                "physics step: lower robot.limits, or raise rules.substeps"
            )
            raise setting_error(message, "rules", "guard")

    def _check_turn(self, robot: RobotConfig) -> None:
        rules, turn = self.rules, robot.limits.turn
        if turn * rules.dt / rules.substeps > _ROBOT_TURN:
            message = (
                f"the robot may turn {_ROBOT_TURN:g} rad in a physics step, dt / substeps; with a limit of {turn:.3g} "
                f"rad/s it turns {turn * rules.dt / rules.substeps:.3g} rad: raise rules.substeps to "
                f"{math.ceil(turn * rules.dt / _ROBOT_TURN)}, or lower rules.dt or robot.limits.turn"
            )
            raise setting_error(message, "rules", "substeps")

    @model_validator(mode="after")
    def _check_steps_of_people(self) -> Self:
        counts = (
            self.standing, self.wandering, self.humans, self.talking_groups, self.walking_groups, self.seated,
            *(queue.waiting for queue in self.queues),
        )  # fmt: skip
        drawn = any(count and count.max for count in counts) or any(count for _, count in self.additional)
        drawn |= any(door.inflow > 0.0 for door in self.doors)
        people = [person for person in self.people if not person.track]
        dt, substeps = self.rules.dt, self.rules.substeps
        if (drawn or people) and dt > RESPONSE_TIME:
            message = (
                f"people choose an acceleration once in a tick, and can reverse within {RESPONSE_TIME} s; in longer "
                f"ticks they become ever faster: lower rules.dt to {RESPONSE_TIME} or less"
            )
            raise setting_error(message, "rules", "dt")
        # The maximum speed, m/s, and half the body depth, m, of each person. A person whose centre moves farther than
        # half the body depth in one physics step can pass through a wall without touching it.
        bodies = [(MAXIMUM_SPEED_RATIO * self.person.desired_speed.max, self.person.radius.min)] if drawn else []
        for one in people:
            desired_speed, radius = one.desired_speed or self.person.desired_speed, one.radius or self.person.radius
            vx, vy = one.velocity or (0.0, 0.0)
            start = math.sqrt(vx * vx + vy * vy)
            bodies.append((max(MAXIMUM_SPEED_RATIO * desired_speed.max, start), radius.min))
        speed, depth = max(bodies, key=lambda body: body[0] / body[1], default=(0.0, 1.0))
        if speed * dt / substeps > depth:
            message = (
                f"people may move {depth:g} m, half the depth of a body, in a physics step, dt / substeps; at up to "
                f"{speed:.3g} m/s they move {speed * dt / substeps:.2g} m, and pass through walls: raise "
                f"rules.substeps to {math.ceil(speed * dt / depth)}, or lower rules.dt or the speeds"
            )
            raise setting_error(message, "rules", "substeps")
        return self

    @classmethod
    def _further_keys(cls) -> Collection[str]:
        return count_keys().values()

    @property
    def counts(self) -> dict[str, IntRange]:
        """The number of drawn pieces of each type of furniture, by name of the type."""
        return {name: getattr(self, key, IntRange(0, 0)) for name, key in count_keys().items()}

    @property
    def other_tasks(self) -> list[tuple[RobotConfig, GoalConfig, str]]:
        """Robot, goal and controller of each other robot."""
        return [(other, other.goal, other.controller) for other in self.robots for _ in range(other.count)]

    @property
    def additional(self) -> list[tuple[Relation, int]]:
        """The largest number of additional instances of each relation, with pedestrians of their own."""
        return [(relation, getattr(self, relation.setting).max) for relation in RELATION.values()]

    def with_task(self, robot: RobotConfig, goal: GoalConfig) -> ScenarioConfig:
        """The scenario with another robot and goal in place of the first."""
        return self.model_copy(update={"robot": robot, "goal": goal})

    def size_of(self, furniture: str) -> Size | None:
        """The size of a type of furniture, m, by `sizes` or else by the type; None: unknown."""
        return self.sizes.get(furniture, furniture_type(furniture).size)

    def changed(self, **settings: Any) -> ScenarioConfig:
        """Return the scenario with other settings.

        Args:
            settings: settings to replace, by name; of a section, those that it does not name stay.

        Raises:
            ConfigError: a setting is unknown or invalid.
        """
        return ScenarioConfig(**merged(self.settings(), settings))

    def settings(self) -> dict[str, Any]:
        """Return all settings, with defaults, as JSON values; `ScenarioConfig(**settings)` restores the scenario."""
        return self.model_dump(mode="json")


def _without_place(section: Any) -> dict[str, Any]:
    """The settings of a robot or a goal without those that say where it is."""
    if section is not None and not isinstance(section, dict):
        section = section.model_dump(mode="json", exclude_defaults=True) if isinstance(section, Settings) else {}
    return {key: value for key, value in (section or {}).items() if key not in ("pose", "position", "jitter")}


def count_keys() -> dict[str, str]:
    """The key of the number of drawn pieces of each type of furniture that can be drawn, by name of the type.

    A type of a plug-in whose key is taken is skipped with a `PluginWarning`.
    """
    keys = {kind.name: kind.count for kind in BUILT_IN if kind.count}
    for name, kind in furniture_types().items():
        if kind.count and name not in keys:
            if kind.count in ScenarioConfig.model_fields or kind.count in keys.values():
                warning = f"furniture of type {name!r} is not drawn: the key {kind.count!r} is taken; choose another"
                warnings.warn(warning, PluginWarning, stacklevel=2)
            else:
                keys[name] = kind.count
    return keys


# `help` and notebooks show the call; with the types of pydantic it takes several screens
ScenarioConfig.__signature__ = Signature(
    [parameter.replace(annotation=Parameter.empty) for parameter in signature(ScenarioConfig).parameters.values()]
)


def merged(base: dict[str, Any], changes: dict[str, Any], model: type = ScenarioConfig) -> dict[str, Any]:
    """Replace settings of `base` by `changes`, recursively in each section of the model."""
    # `humans` replaces `standing` and `wandering`, and the other way round: both together would be an error
    counts = {"standing", "wandering"}
    replaced = counts if "humans" in changes else {"humans"} if counts & changes.keys() else set()
    if changes.get("kinematics") not in (None, base.get("kinematics")) and "drive" not in changes:
        replaced = {"drive"}  # another drive has other parameters
    result = {key: value for key, value in base.items() if key not in replaced}
    fields = model.model_fields if issubclass(model, Settings) else {}
    for key, value in changes.items():
        section = fields[key].annotation if key in fields else None
        if isinstance(value, dict) and isinstance(section, type) and is_section(section):
            value = merged(result.get(key) or {}, value, section)
        result[key] = value
    return result
