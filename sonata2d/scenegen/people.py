"""People who are given one by one: where they start, where they go, when they come and leave, or their whole track."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator
from pydantic_core import PydanticCustomError

from ..chance import Chance
from ..entities import WALKING_TOGETHER, Behaviour, Group, Human, Interaction, Scene
from ..errors import SceneError
from ..exact import angle_of
from ..geometry import Barriers, Disc, Point, Pose, canonical_angle, inside_polygon, quantised
from .sections import PersonConfig, Share
from .settings import Settings
from .track import Sighting, sampled

Track = Annotated[tuple[Sighting, ...], Field(min_length=2)]
_SLOW = 0.1  # m/s, below which a velocity tells nothing of where somebody faces
_TOLERANCE = 1e-6  # ticks


class GivenPersonConfig(Settings):
    """One person of `people`, who are there besides those who are drawn.

    Attributes:
        id: 1 or more; unless given, the next free number. Drawn people and things take the numbers that are left.
        x, y: m, where they start, or come in; with a track it is its first place.
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
        group: a number; those of the same number walk together, and the first one leads.
        desired_speed, radius, reacts_to_robot: m/s, m, and from 0 (ignores the robot) to 1; unless given, drawn as
            `person` says.
    """

    id: PositiveInt | None = None
    x: float | None = None
    y: float | None = None
    theta: float | None = None
    velocity: Point | None = None
    behaviour: Behaviour | None = None
    goals: tuple[Point, ...] = ()
    exits: bool = False
    enters: NonNegativeFloat = 0.0
    leaves: PositiveFloat | None = None
    track: Track | None = None
    group: PositiveInt | None = None
    desired_speed: PositiveFloat | None = None
    radius: Annotated[float, Field(ge=0.1)] | None = None
    reacts_to_robot: Share | None = None

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
        if self.exits and not self.goals:
            raise PydanticCustomError("exits", "they have no goals to leave at", {"path": ("exits",)})
        if self.group is not None and self.does == "standing":
            raise PydanticCustomError("group", "who stands is in no walking group", {"path": ("group",)})
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


def refuse_twins(people: tuple[GivenPersonConfig, ...]) -> None:
    """Ids are given once, and a group whose members choose their way is together throughout.

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


@dataclass(frozen=True, slots=True)
class Given:
    """The people who are given, their groups, and who walks with whom."""

    humans: tuple[Human, ...] = ()
    groups: tuple[Group, ...] = ()
    interactions: tuple[Interaction, ...] = ()

    @property
    def standing(self) -> Barriers:
        """Those who stand throughout, as discs."""
        throughout = (h for h in self.humans if h.behaviour == "standing" and h.enters == 0 and h.leaves is None)
        return Barriers.of(edge for human in throughout for edge in Disc(human.radius).edges(human.pose))


def given_people(people: tuple[GivenPersonConfig, ...], usual: PersonConfig, dt: float, chance: Chance) -> Given:
    """The people of `people`; what is not said of them is drawn.

    Args:
        people: as the scenario lists them.
        usual: what people are like.
        dt: s, the tick.
        chance: of the scene.

    Raises:
        SceneError: a track falls between two ticks.
    """
    taken = {person.id for person in people}
    free = (number for number in range(1, 2 * len(people) + 1) if number not in taken)
    humans = [_human(person, person.id or next(free), usual, dt, chance) for person in people]
    members: dict[int, list[int]] = {}
    for human in humans:
        if human.group is not None:
            members.setdefault(human.group, []).append(human.id)
    groups = {number: ids for number, ids in members.items() if len(ids) > 1}
    return Given(
        tuple(human if human.group in groups else replace(human, group=None) for human in humans),
        tuple(Group(number, "walking", tuple(ids)) for number, ids in sorted(groups.items())),
        tuple(Interaction(first, WALKING_TOGETHER, id) for first, *ids in groups.values() for id in ids),
    )


def _human(given: GivenPersonConfig, id: int, usual: PersonConfig, dt: float, chance: Chance) -> Human:
    speed = usual.desired_speed
    drawn_speed = chance.normal(speed.mean, speed.sd, speed.min, speed.max)
    drawn_radius, ignores = usual.radius.draw(chance), chance.uniform() < usual.ignores_robot
    reacts = given.reacts_to_robot
    enters = int(given.enters / dt + 1.0 - _TOLERANCE)
    human = Human(
        id=id,
        pose=Pose(*given.start).rounded(),
        radius=quantised(given.radius or drawn_radius),
        desired_speed=quantised(given.desired_speed or drawn_speed),
        behaviour=given.does,
        model=usual.model,
        reacts_to_robot=quantised(reacts) if reacts is not None else 0.0 if ignores else 1.0,
        group=given.group,
        goals=tuple((quantised(x), quantised(y)) for x, y in given.goals),
        enters=enters,
        leaves=None if given.leaves is None else max(int(given.leaves / dt + 1.0 - _TOLERANCE), enters + 1),
        exits=given.exits,
    )
    if given.track is not None:
        human = _on_track(human, given.track, dt)
    vx, vy = given.velocity or human.velocity
    human = replace(human, velocity=(quantised(vx), quantised(vy)))
    theta = _facing(human) if given.theta is None else given.theta
    return replace(human, pose=Pose(human.pose.x, human.pose.y, canonical_angle(theta)))


def _on_track(human: Human, track: Track, dt: float) -> Human:
    """The person at each tick of their track.

    Raises:
        SceneError: there is no tick within it.
    """
    first, places = sampled(track, dt)
    if not places:
        span = f"{track[0][0]:g} to {track[-1][0]:g} s"
        raise SceneError(f"the track of person {human.id}, {span}, falls between two ticks; leave it out")
    (x, y), (u, v) = places[0], places[min(1, len(places) - 1)]
    velocity = (u - x) / dt, (v - y) / dt
    leaves = first + len(places)
    return replace(human, pose=Pose(x, y), velocity=velocity, enters=first, leaves=leaves, track=tuple(places))


def _facing(human: Human) -> float:
    """rad, where somebody goes first: by their velocity, or to their goal."""
    vx, vy = human.velocity
    if vx * vx + vy * vy > _SLOW * _SLOW:
        return angle_of(vy, vx)
    x, y = human.goals[0] if human.goals else human.pose.position
    return angle_of(y - human.pose.y, x - human.pose.x) if (x, y) != human.pose.position else 0.0


def refuse_outside(given: Given, outline: Any, robot: Pose | None, radius: float) -> None:
    """All that is given must lie in the room, and a given robot on nobody.

    Args:
        given: the people.
        outline: (K, 2), m, of the room.
        robot: its start, if that is given.
        radius: of the robot, m.

    Raises:
        SceneError: somebody would be outside, or under the robot.
    """
    for human in given.humans:
        for what, places in (("start", [human.pose.position]), ("track", human.track), ("goal", human.goals)):
            inside = inside_polygon(np.array(places, dtype=float).reshape(-1, 2), outline)
            for x, y in (place for place, is_in in zip(places, inside.tolist(), strict=True) if not is_in):
                raise SceneError(
                    f"the {what} of person {human.id} is outside the room at ({x:g}, {y:g}); widen the room"
                )
        if robot is not None and human.enters == 0:
            dx, dy, near = robot.x - human.pose.x, robot.y - human.pose.y, radius + human.radius
            if dx * dx + dy * dy < near * near:
                raise SceneError(f"the robot would start on person {human.id}; give it another pose")


def joined(scene: Scene, given: Given) -> Scene:
    """The scene with the people who are given, first; drawn people and things take the ids that they leave free."""
    if not given.humans:
        return scene
    taken, groups = {human.id for human in given.humans}, {group.id for group in given.groups}
    drawn = [*(human.id for human in scene.humans), *(thing.id for thing in scene.furniture)]
    new = dict(zip(drawn, _free(taken, len(drawn)), strict=True))
    band = dict(zip((g.id for g in scene.groups), _free(groups, len(scene.groups)), strict=True))
    people = (replace(h, id=new[h.id], group=None if h.group is None else band[h.group]) for h in scene.humans)
    things = (replace(f, id=new[f.id], on=None if f.on is None else new[f.on]) for f in scene.furniture)
    bands = (replace(g, id=band[g.id], members=tuple(new[id] for id in g.members)) for g in scene.groups)
    ties = (replace(tie, src=new[tie.src], dst=new[tie.dst]) for tie in scene.interactions)
    return replace(
        scene,
        humans=(*given.humans, *people),
        furniture=tuple(things),
        groups=(*given.groups, *bands),
        interactions=(*given.interactions, *ties),
    )


def _free(taken: set[int], count: int) -> list[int]:
    """The lowest ids from 1 that are not taken."""
    return [number for number in range(1, len(taken) + count + 1) if number not in taken][:count]
