"""What stands or walks in a room, and the Scene that gathers it: values, frozen, at a file's precision."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from .exact import Array
from .geometry import Barriers, Disc, Point, Pose, Shape

Behaviour = Literal["standing", "wandering", "walking", "recorded"]
Reaction = Literal["ignores", "avoids", "stops", "curious", "scared"]
Kinematics = Literal["holonomic", "unicycle"]
EndsOn = Literal["goal", "time", "contact"]
# of walking: docs/models.md
Model = Literal["sonata2026", "moussaid2009", "helbing1995", "helbing2000", "farina2017", "orca2011"]
Formation = Literal["abreast", "v", "face_to_face", "l", "side_by_side", "circle", "semicircle"]

# Relations: the original toolkit's four, and one for any other thing a person attends to.
TALKING = "two_static_person_talking"
AT_LAPTOP = "human_laptop_interaction"
AT_PLANT = "human_plant_interaction"
WALKING_TOGETHER = "wandering_human_interacting"
AT_OBJECT = "human_object_interaction"
RELATIONS = (TALKING, AT_LAPTOP, AT_PLANT, WALKING_TOGETHER, AT_OBJECT)

ROBOT_ID = 0
PARKED, PARKED_APART = 200.0, 5.0  # m, of absent people from the room and from one another


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight rigid wall; its outline is the line itself."""

    start: Point
    end: Point


@dataclass(frozen=True, slots=True)
class Furniture:
    """A rigid thing that stands still. `on` is the id of what carries it: such a thing has no body of its own."""

    id: int
    type: str
    pose: Pose
    shape: Shape
    on: int | None = None


@dataclass(frozen=True, slots=True)
class Human:
    """A person: where they start and how they are.

    Attributes:
        radius: the solid outline, m, which contact, clearance, drawing and metrics all read.
        desired_speed: m/s.
        behaviour: standing: stays; wandering: takes place after place in the room; walking: goes to `goals`;
            recorded: is carried along `track`.
        model: name of the walking model.
        reacts_to_robot: 0 ignores the robot .. 1 minds it; 0 and the reaction `ignores` are the same.
        reaction: how they behave towards the robot.
        robot_clearance: m, from outline to outline, that they want to pass the robot at.
        group: id of the group they belong to.
        goals: m, where one who is walking goes, one after the other; they stay at the last.
        velocity: m/s, world frame, at the start.
        enters: the tick at which they come in, at `pose`; one who is not recorded waits until there is room.
        leaves: the tick from which they are gone; None: they stay.
        track: m, world frame, where one who is recorded is at each tick from `enters` on; they stay at the last.
        exits: whether one who is walking leaves on reaching the last of the goals, instead of staying there.
    """

    id: int
    pose: Pose
    radius: float = 0.20
    desired_speed: float = 1.3
    behaviour: Behaviour = "standing"
    model: str = "sonata2026"
    reacts_to_robot: float = 1.0
    reaction: Reaction = "avoids"
    robot_clearance: float = 0.83
    group: int | None = None
    goals: tuple[Point, ...] = ()
    velocity: Point = (0.0, 0.0)
    enters: int = 0
    leaves: int | None = None
    track: tuple[Point, ...] = ()
    exits: bool = False

    @property
    def stays(self) -> bool:
        """Whether they are there from the start to the end, unless they exit."""
        return self.enters == 0 and self.leaves is None

    def place_at(self, tick: int) -> Point:
        """Where one who is recorded is at a tick, m: the first place before they enter, the last after the end."""
        return self.track[min(max(tick - self.enters, 0), len(self.track) - 1)]

    def __post_init__(self) -> None:
        if self.reacts_to_robot == 0.0:
            object.__setattr__(self, "reaction", "ignores")
        elif self.reaction == "ignores":
            object.__setattr__(self, "reacts_to_robot", 0.0)


@dataclass(frozen=True, slots=True)
class Group:
    """People who belong together; `members` are human ids, the first one leads.

    Attributes:
        formation: how they stand to each other at the start; who talks in one keeps facing as at the start. None where
            that is left open: who talks then faces the middle of the others.
    """

    id: int
    kind: Literal["talking", "walking"]
    members: tuple[int, ...]
    formation: Formation | None = None


@dataclass(frozen=True, slots=True)
class Interaction:
    """Who (a human's id) attends to whom or what (an id), and how."""

    src: int
    relation: str
    dst: int


@dataclass(frozen=True, slots=True)
class Limits:
    """What the robot's drive can do: m/s, rad/s, m/s2, rad/s2; all positive."""

    ahead: float = 1.0
    back: float = 0.5
    sideways: float = 0.5
    turn: float = 1.5
    acceleration: float = 1.5
    turn_acceleration: float = 3.0


@dataclass(frozen=True, slots=True)
class Robot:
    """The robot's start, outline (a disc, m) and drive."""

    pose: Pose
    radius: float = 0.30
    kinematics: Kinematics = "holonomic"
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class Goal:
    """Where the robot shall go. Reached within `distance` (m) of the centre and `angle` (rad) of theta."""

    x: float
    y: float
    theta: float = 0.0
    distance: float = 0.40
    angle: float = 3.1416

    @property
    def position(self) -> Point:
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Rules:
    """How an episode is run.

    Attributes:
        dt: the control tick, s.
        substeps: physics steps within a tick.
        iterations: of the contact solver.
        time_limit: s.
        ends_on: besides the time limit, what ends the episode.
        guard: whether the robot's bumper limits its velocity by the gap.
        contact_distance: outlines nearer than this touch, m.
        side: +1 people evade to their right when they meet head-on, -1 to their left.
    """

    dt: float = 0.1
    substeps: int = 10
    iterations: int = 5
    time_limit: float = 60.0
    ends_on: tuple[EndsOn, ...] = ("goal", "time")
    guard: bool = True
    contact_distance: float = 0.01
    side: Literal[-1, 1] = 1

    @property
    def last_tick(self) -> int:
        """The tick at which time is up."""
        return int(self.time_limit / self.dt + 0.5)


@dataclass(frozen=True, slots=True)
class Social:
    """What people take up with each other, and with things, while the episode runs. Each chance is 0..1.

    Attributes:
        visits: that a wanderer, on arrival, goes to a free plant, laptop or other object, and attends to it.
        joins: that a wanderer, on arrival, joins somebody who stands, or a group that talks.
        meets: that two wanderers who come near each other stop and talk.
        leaves: that somebody who attends to a person or a thing at the start goes away, once their time is over.
        visit_time, talk_time: s, from and to.
    """

    visits: float = 0.0
    joins: float = 0.0
    meets: float = 0.0
    leaves: float = 0.0
    visit_time: tuple[float, float] = (5.0, 20.0)
    talk_time: tuple[float, float] = (10.0, 40.0)

    @property
    def is_lively(self) -> bool:
        """Whether anything changes."""
        return max(self.visits, self.joins, self.meets, self.leaves) > 0.0


@dataclass(frozen=True)
class Scene:
    """The layout an episode starts from. Everything that decides what happens in it is here.

    Attributes:
        name: of the scenario.
        family: scenario and kind of room; splits of a data set go by it.
        polygon: the room's outline, counter-clockwise; people and robot stay within.
        walls: all of them, the outline's edges first.
        seed, episode: what it was generated from; they also drive what people choose on their way.
        settings: the resolved settings it was generated from, as JSON would hold them; None if made by hand.
        dropped: what could not be placed although asked for.
    """

    name: str
    family: str
    polygon: tuple[Point, ...]
    walls: tuple[Wall, ...]
    furniture: tuple[Furniture, ...]
    humans: tuple[Human, ...]
    robot: Robot
    goal: Goal
    groups: tuple[Group, ...] = ()
    interactions: tuple[Interaction, ...] = ()
    rules: Rules = field(default_factory=Rules)
    social: Social = field(default_factory=Social)
    seed: int = 0
    episode: int = 0
    settings: dict[str, Any] | None = None
    dropped: tuple[str, ...] = ()

    @cached_property
    def barriers(self) -> Barriers:
        """Walls first, then furniture that has a body, as thick segments; see `barrier_owner`."""
        return Barriers.of([edge for _, edges in self._solids for edge in edges])

    @cached_property
    def barrier_owner(self) -> tuple[tuple[str, int], ...]:
        """What each barrier belongs to: ("wall", index) or ("object", id)."""
        return tuple(owner for owner, edges in self._solids for _ in edges)

    @cached_property
    def _solids(self) -> list[tuple[tuple[str, int], list[tuple[Point, Point, float]]]]:
        walls = [(("wall", k), [(wall.start, wall.end, 0.0)]) for k, wall in enumerate(self.walls)]
        things = [(("object", f.id), f.shape.edges(f.pose)) for f in self.furniture if f.on is None]
        return walls + things

    @cached_property
    def outline(self) -> Array:
        """The room's polygon as (K, 2)."""
        outline = np.array(self.polygon, dtype=float)
        outline.flags.writeable = False
        return outline

    @cached_property
    def standing(self) -> Barriers:
        """People who stand, as discs; those only who are there throughout."""
        return standing_throughout(self.humans)

    @cached_property
    def parking(self) -> Array:
        """(N, 2), m: far from the room a place for each person, where they are while they are absent."""
        x, y = self.outline.max(axis=0).tolist()
        places = [(x + PARKED, y + PARKED + PARKED_APART * k) for k in range(len(self.humans))]
        parking = np.array(places, dtype=float).reshape(-1, 2)
        parking.flags.writeable = False
        return parking

    @cached_property
    def shared(self) -> Barriers:
        """The outlines of what people in formation share as they talk: others walk round it, not through."""
        place = {human.id: human.pose.position for human in self.humans}
        return outlines([place[m] for m in g.members] for g in self.groups if g.kind == "talking" and g.formation)


def standing_throughout(humans: Iterable[Human]) -> Barriers:
    """Those who stand and are there from the start to the end, as discs."""
    return Barriers.of(Disc(h.radius).edges(h.pose)[0] for h in humans if h.stays and h.behaviour == "standing")


def outlines(rings: Iterable[Sequence[Point]]) -> Barriers:
    """The lines from place to place round each ring, m; of two places the one between them."""
    closed = ([*ring, ring[0]] if len(ring) > 2 else ring for ring in rings)
    return Barriers.of((a, b, 0.0) for ring in closed for a, b in pairwise(ring))
