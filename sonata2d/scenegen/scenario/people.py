"""The section `people` of a scenario: where each starts, where they go, when they come and leave, or their track."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator
from pydantic_core import PydanticCustomError

from ...core.entities import Behaviour, Reaction
from ...core.geometry import Barriers, Point
from ..track import Sighting
from .ranges import Jitter, Range, Settings, Share

Track = Annotated[tuple[Sighting, ...], Field(min_length=2)]


class PersonSpec(Settings):
    """One person of `people`, who are there besides those who are drawn.

    Attributes:
        id: 1 or more; unless given, the next free number. Drawn people and things take the numbers that are left.
        x, y: m, where they start, or come in; with a track it is its first place.
        jitter: m, m, rad: how far from there a scene may move them, either way; their goals move along.
        theta: rad; unless given, the way they are going at the start.
        velocity: m/s, world frame, at the start.
        behaviour: `standing`, `wandering`, `walking` to their `goals`, or `recorded`: carried along their `track`.
            Unless given, what track or goals tell, else standing.
        goals: x, y, m; one after the other.
        exits: whether they leave the scene on reaching the last of their goals, instead of staying there.
        enters, leaves: s, when they come in, as soon as there is room, and when they are gone; with a track, they are
            there from its first moment to its last.
        track: t, x, y, s and m, t rising: places on their way, which is a smooth curve through them. Nothing holds up
            who is recorded: they go through walls and shove others aside.
        group: a number; those of the same number belong together: they talk if they stand, else they walk together,
            and the first one leads.
        desired_speed, radius, reacts_to_robot: m/s, m, and from 0 (ignores the robot) to 1; unless given, drawn as
            `person` says.
        reaction: how they behave towards the robot; unless given, drawn as well.
    """

    id: PositiveInt | None = None
    x: float | None = None
    y: float | None = None
    jitter: Jitter = (0.0, 0.0, 0.0)
    theta: float | None = None
    velocity: Point | None = None
    behaviour: Behaviour | None = None
    goals: tuple[Point, ...] = ()
    exits: bool = False
    enters: NonNegativeFloat = 0.0
    leaves: PositiveFloat | None = None
    track: Track | None = None
    group: PositiveInt | None = None
    desired_speed: Range | None = None
    radius: Range | None = None
    reacts_to_robot: Share | None = None
    reaction: Reaction | None = None

    @property
    def does(self) -> Behaviour:
        """What they do."""
        return self.behaviour or ("recorded" if self.track else "walking" if self.goals else "standing")

    @model_validator(mode="after")
    def _have_a_place(self) -> Self:
        for key in ("x", "y"):
            if (getattr(self, key) is None) == (self.track is None):
                hint = (
                    "give a start (x, y), or a track" if self.track is None else "a track tells the start: leave it out"
                )
                raise PydanticCustomError("place", "{hint}", {"hint": hint, "path": (key,)})
        if self.track is not None and (self.enters or self.leaves is not None):
            raise PydanticCustomError("track", "a track tells when somebody enters and leaves: leave these out")
        if self.track is not None and any(self.jitter):
            said = {"path": ("jitter",)}
            raise PydanticCustomError("track", "who is on a track is not moved: leave jitter out", said)
        if self.leaves is not None and self.leaves <= self.enters:
            raise PydanticCustomError("leaves", "they would leave before they enter", {"path": ("leaves",)})
        return self

    @model_validator(mode="after")
    def _do_what_they_can(self) -> Self:
        needs: dict[Behaviour, str] = {"walking": "goals", "recorded": "track"}
        for behaviour, key in needs.items():
            if (self.does == behaviour) != bool(getattr(self, key)):
                told = {"behaviour": behaviour, "key": key, "path": (key,)}
                raise PydanticCustomError("behaviour", "who is {behaviour} has {key}, and nobody else", told)
        if None not in (self.reaction, self.reacts_to_robot) and (self.reaction == "ignores") != (
            not self.reacts_to_robot
        ):
            said = {"path": ("reaction",)}
            raise PydanticCustomError("reaction", "who ignores the robot has reacts_to_robot 0, and nobody else", said)
        if self.exits and not self.goals:
            raise PydanticCustomError("exits", "they have no goals to leave at", {"path": ("exits",)})
        if self.desired_speed is not None and not self.desired_speed.min > 0.0:
            raise PydanticCustomError("speed", "a desired speed must be above 0", {"path": ("desired_speed",)})
        if self.radius is not None and not self.radius.min >= 0.1:
            raise PydanticCustomError("radius", "a person's radius must be 0.1 m or more", {"path": ("radius",)})
        return self

    @model_validator(mode="after")
    def _keep_time(self) -> Self:
        times = [row[0] for row in self.track or ()]
        if times and (times[0] < 0.0 or any(b <= a for a, b in pairwise(times))):
            raise PydanticCustomError("track", "times of a track must rise, from 0 or later", {"path": ("track",)})
        return self

    @property
    def start(self) -> Point:
        """m, where they start or come in."""
        if self.track is not None:
            return self.track[0][1], self.track[0][2]
        assert self.x is not None
        assert self.y is not None
        return self.x, self.y

    @property
    def way(self) -> tuple[Point, ...]:
        """m, their track, or their start and their goals."""
        return tuple((x, y) for _, x, y in self.track) if self.track else (self.start, *self.goals)


def ways_of(people: tuple[PersonSpec, ...]) -> Barriers:
    """The ways of people as thin segments; a point for who goes nowhere."""
    legs = (leg for person in people for leg in pairwise((person.start, *person.way)))  # from start to start first
    return Barriers.of((a, b, 0.0) for a, b in legs)


def refuse_twins(people: tuple[PersonSpec, ...]) -> None:
    """Ids are given once; members of a group all stand or all go, and are together throughout if they choose their way.

    Raises:
        PydanticCustomError: they are not.
    """
    ids = [person.id for person in people if person.id is not None]
    for k, person in enumerate(people):
        if person.id is not None and ids.count(person.id) > 1:
            said = {"id": person.id, "path": ("people", k, "id")}
            raise PydanticCustomError("people", "id {id} is given to more than one", said)
        comes_and_goes = person.enters > 0.0 or person.leaves is not None
        if person.group is not None and person.does == "wandering" and comes_and_goes:
            said = {"path": ("people", k, "group")}
            raise PydanticCustomError("people", "who wanders in a group can neither enter nor leave; give goals", said)
    standing: dict[int, bool] = {}
    for k, person in enumerate(people):
        if (
            person.group is not None
            and standing.setdefault(person.group, stands := person.does == "standing") != stands
        ):
            said = {"group": person.group, "path": ("people", k, "group")}
            raise PydanticCustomError("people", "group {group} has members who stand and others who walk", said)
