"""The section `people` of a scenario: pedestrians that are specified one by one."""

from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import pairwise
from typing import Annotated, Self

from pydantic import AfterValidator, Field, PositiveInt, model_validator

from ...core.bounds import Fraction, NotNegative, Number, Positive
from ...core.entities import Behaviour, Reaction
from ...core.files.limits import MAX_ID
from ...core.geometry import Barriers, Point
from ...core.relations import CARING, HANDING_OVER, RELATION
from ...registry import PERSON_KINDS, did_you_mean
from .attributes import GivenAttributes
from .base import BodyRadius, Breadth, Duration, Jitter, Range, Settings, TupleOf, require_registered, within
from .problems import setting_error


def _check_relation(name: str) -> str:
    known = [row.name for row in RELATION.values() if row.group]
    if name not in known:
        hint = did_you_mean(name, known) or f"; relations of groups are {', '.join(known)}"
        raise setting_error(f"there is no such relation of a group{hint}")
    return name


def _check_times(track: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
    if track[0][0] < 0.0 or any(later[0] <= earlier[0] for earlier, later in pairwise(track)):
        raise setting_error("times of a track must rise, from 0 or later")
    return track


Track = Annotated[TupleOf[tuple[Number, Number, Number]], Field(min_length=2), AfterValidator(_check_times)]  # s, m, m
_PositiveId = Annotated[PositiveInt, Field(le=MAX_ID)]
_RelationName = Annotated[str, AfterValidator(_check_relation)]
_KindName = Annotated[str, AfterValidator(partial(require_registered, PERSON_KINDS))]
_DesiredSpeed = Annotated[Range, within("a desired speed must be above 0", 0.0, above=True)]


class PersonSpec(Settings):
    """A pedestrian of `people`, in addition to the drawn pedestrians.

    Attributes:
        id: 1 or more; default: the lowest free number. Drawn pedestrians and furniture get the remaining numbers.
        x, y: m, position at the start or on entering; with a track: its first point.
        area: name of one of `areas`, in which the start is drawn, given instead of x and y; in files the key is `in`.
        jitter: maximum random offset of x, y (m) and theta (rad), in both directions, drawn for each scene; `goals`
            get the same offset.
        theta: rad; default: direction of the velocity, else of the first goal, else 0, or drawn if the start is drawn
            in an area. By default, the members of a talking group face its centre.
        velocity: m/s, world frame, at the start.
        behaviour: `standing`, `wandering`, `walking` (to `goals`) or `recorded` (moved along `track`). Default:
            recorded with a track, walking with goals, else standing.
        goals: x, y, m; visited in order; not in furniture or walls, nor behind a gap that is too narrow for the body.
        stay: s; how long the pedestrian stands at each goal but the last before it goes on, drawn for each goal.
        exits: whether the pedestrian leaves the scene at its last goal instead of staying there.
        enters, leaves: s. The pedestrian enters at `enters`, or as soon after it as there is free space, and is removed
            at `leaves`. With a track, it is present from the first to the last track point.
        track: t (s), x, y (m) with rising t: points of a smooth path. A recorded pedestrian follows it exactly, through
            walls and the robot, and pushes others aside.
        group: number of the group. The members of a group talk if they stand; else they walk together, and the first
            member leads.
        relation: of the members of the group to each other, given for one of them: arguing, handing_over or caring_for
            while they stand, leading or following while they walk, one behind the other. Default: they talk, or walk
            together.
        kind: of person, whose distributions of sizes and speed replace those of the section `person`. Default: drawn
            by `person.kinds`; of a pedestrian with a track, adult.
        desired_speed, radius, breadth: m/s, m, m; default: drawn from the section `person`.
        headway, politeness: factors; default: drawn from the section `person`.
        pre_movement: s; how long the pedestrian stands before it walks for the first time; default: drawn from the
            section `person`, or 0 if it enters later.
        reaction_time: s; from the moment at which the robot comes into view until the pedestrian reacts; default: drawn
            from the section `person`.
        reacts_to_robot: 0 (ignores the robot) to 1; default: drawn from the section `person`.
        reaction: kind of reaction to the robot; default: drawn from the section `person`.
        attributes: values of attributes of people by name, which `attributes.people` declares; the others are drawn.
    """

    _optional = frozenset({"area", "kind", "relation", "attributes"})

    id: _PositiveId | None = None
    x: Number | None = None
    y: Number | None = None
    area: str | None = Field(default=None, alias="in")
    jitter: Jitter = (0.0, 0.0, 0.0)
    theta: Number | None = None
    velocity: Point | None = None
    behaviour: Behaviour | None = None
    goals: TupleOf[Point] = ()
    stay: Duration = Range(0, 0)
    exits: bool = False
    enters: NotNegative = 0.0
    leaves: Positive | None = None
    track: Track | None = None
    group: _PositiveId | None = None
    relation: _RelationName | None = None
    kind: _KindName | None = None
    desired_speed: _DesiredSpeed | None = None
    radius: BodyRadius | None = None
    breadth: Breadth | None = None
    headway: Positive | None = None
    politeness: NotNegative | None = None
    pre_movement: Duration | None = None
    reaction_time: Duration | None = None
    reacts_to_robot: Fraction | None = None
    reaction: Reaction | None = None
    attributes: GivenAttributes | None = None

    @property
    def resolved_behaviour(self) -> Behaviour:
        """`behaviour`, or its default."""
        return self.behaviour or ("recorded" if self.track else "walking" if self.goals else "standing")

    @model_validator(mode="after")
    def _check_start(self) -> Self:
        """Check that start, jitter and times come either from their own keys or from the track."""
        for key in ("x", "y"):
            if self.area is not None and getattr(self, key) is not None:
                raise setting_error("the start is drawn in an area: omit x and y", key)
            if self.track is None and self.area is None and getattr(self, key) is None:
                raise setting_error("give a start (x, y), an area (in), or a track", key)
            if self.track is not None and getattr(self, key) is not None:
                raise setting_error("the track gives the start: omit x and y", key)
        if self.area is not None and any(self.jitter):
            raise setting_error("a start that is drawn in an area has no jitter", "jitter")
        if self.track is not None and self.area is not None:
            raise setting_error("the track gives the start: omit in", "in")
        if self.track is not None and (self.enters or self.leaves is not None):
            raise setting_error("the track gives the times: omit enters and leaves")
        if self.track is not None and any(self.jitter):
            raise setting_error("a track cannot be moved: omit jitter", "jitter")
        if self.leaves is not None and self.leaves <= self.enters:
            raise setting_error("leaves must be later than enters", "leaves")
        return self

    @model_validator(mode="after")
    def _check_behaviour(self) -> Self:
        """Check that the behaviour agrees with the other keys."""
        required_keys: dict[Behaviour, str] = {"walking": "goals", "recorded": "track"}
        for behaviour, key in required_keys.items():
            if (self.resolved_behaviour == behaviour) != bool(getattr(self, key)):
                raise setting_error(f"{key} must be given with behaviour {behaviour}, and with no other behaviour", key)
        has_both = self.reaction is not None and self.reacts_to_robot is not None
        if has_both and (self.reaction == "ignores") != (not self.reacts_to_robot):
            message = "reacts_to_robot must be 0 with reaction ignores, and above 0 with any other reaction"
            raise setting_error(message, "reaction")
        if self.stay.max > 0.0 and len(self.goals) < 2:
            raise setting_error("stay needs two goals or more", "stay")
        if self.pre_movement is not None and self.resolved_behaviour not in ("walking", "wandering"):
            raise setting_error("pre_movement needs a person that walks or wanders", "pre_movement")
        if self.exits and not self.goals:
            raise setting_error("exits needs goals to leave at", "exits")
        return self

    @property
    def start(self) -> Point:
        """Position at the start or on entering, m."""
        if self.track is not None:
            return self.track[0][1], self.track[0][2]
        assert self.x is not None
        assert self.y is not None
        return self.x, self.y

    @property
    def path(self) -> tuple[Point, ...]:
        """Points of the track, or the start and the goals, m."""
        return tuple((x, y) for _, x, y in self.track) if self.track else (self.start, *self.goals)


def path_segments(people: tuple[PersonSpec, ...]) -> Barriers:
    """Return the paths of all people as segments of radius 0; a person without goals gives a single point."""
    # the extra leg from the start to the start is the point that represents a person without goals
    legs = (leg for person in people for leg in pairwise((person.start, *person.path)))
    return Barriers.of((a, b, 0.0) for a, b in legs)


def check_people(people: tuple[PersonSpec, ...]) -> tuple[PersonSpec, ...]:
    """Return the people, whose ids and groups are checked.

    Raises:
        PydanticCustomError: an id is not unique; a group has standing and moving members; or a wandering member of a
            group enters later or leaves.
    """
    counts, members = Counter(person.id for person in people), Counter(person.group for person in people)
    group_stands: dict[int, bool] = {}
    relations: dict[int, str] = {}
    for k, person in enumerate(people):
        message, key, stands = "", "group", person.resolved_behaviour == "standing"
        if person.id is not None and counts[person.id] > 1:
            message, key = f"id {person.id} is given to more than one person", "id"
        elif person.group is None and person.relation is not None:
            message, key = "a relation needs a group", "relation"
        elif person.group is None:
            continue
        elif person.relation and (RELATION[person.relation].group == "talking") != stands:
            kind = "stand" if not stands else "walk"
            message, key = f"the members of a group that is {person.relation} must {kind}", "relation"
        elif person.relation and members[person.group] < 2:
            message, key = f"group {person.group} has one member, and a relation two or more", "relation"
        elif person.relation in (HANDING_OVER, CARING) and members[person.group] > 2:
            message = f"{person.relation} is a relation of two people; group {person.group} has {members[person.group]}"
            key = "relation"
        elif person.relation and relations.setdefault(person.group, person.relation) != person.relation:
            message, key = f"group {person.group} has two relations", "relation"
        elif person.resolved_behaviour == "wandering" and (person.enters > 0.0 or person.leaves is not None):
            message = "a wandering member of a group can neither enter nor leave; give goals"
        elif group_stands.setdefault(person.group, stands) != stands:
            message = f"group {person.group} has standing and moving members"
        if message:
            raise setting_error(message, k, key)
    return people
