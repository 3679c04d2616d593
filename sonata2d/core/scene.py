"""The scene: the layout of a room at the start, and everything that determines what happens in it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from .attributes import AttributeColumn, Attributes, AttributeSpec
from .bounds import ADDITIVE, Fraction, NotNegative, Positive, Steps
from .doors import OPEN, InteriorDoor
from .drawable import Drawable
from .entities import (
    ROBOT_ID,
    Area,
    Door,
    EndsOn,
    Furniture,
    Goal,
    Group,
    Human,
    Interaction,
    OtherRobot,
    Place,
    Queue,
    Robot,
    Wall,
)
from .floats import FloatFields
from .geometry import Barriers, Edge, Point, inside_rings, polygon_area
from .humans import HumanTable, activity_indices, frozen
from .portable_math import Array, BoolArray, IntArray
from .wall_lines import straight_walls, wall_lines
from .wording import counted

_TICK_TOLERANCE = 1e-6  # of a tick, by which the time limit is a multiple of the tick in spite of rounding
_PARKING_DISTANCE, _PARKING_SPACING = 200.0, 5.0  # m, of absent pedestrians from the room and from each other


@dataclass(frozen=True, slots=True)
class Rules:
    """Rules of an episode.

    Attributes:
        dt: control period, the time between frames, s.
        substeps: least number of physics steps in a tick; more if the pedestrian model needs more evaluations.
        iterations: number of iterations of the contact solver.
        time_limit: s; no state of the episode is later.
        ends_on: events that end the episode besides the time limit; `time` changes nothing.
        guard: whether the safety guard limits the robot's velocity by the gaps around it.
        contact_distance: outlines nearer than this are in contact, m.
        side: side to which pedestrians evade each other when they meet head-on: +1 right, -1 left.
    """

    dt: Positive = 0.1
    substeps: Steps = 5
    iterations: Steps = 5
    time_limit: Positive = 60.0
    ends_on: tuple[EndsOn, ...] = ("goal", "time")
    guard: bool = True
    contact_distance: NotNegative = 0.01
    side: Literal[-1, 1] = 1

    @property
    def last_tick(self) -> int:
        """The last tick whose time is not beyond the time limit; the episode ends there."""
        return int(self.time_limit / self.dt + _TICK_TOLERANCE)


@dataclass(frozen=True, slots=True)
class Social:
    """Social behaviour of the pedestrians during an episode: probabilities and durations.

    On reaching its destination, and on entering, a wandering pedestrian chooses what to do next, with the probabilities
    `visits`, `joins`, `sits`, `queues` and `exits`, whose sum is at most 1. With the probability that is left, and if
    its choice is not possible, it goes to one of the places of interest, or anywhere if there are none.

    Attributes:
        visits: probability that it goes to a free plant, laptop, shelf, TV or other object and attends to it for
            `visit_time`.
        joins: probability that it joins a standing pedestrian or a talking group for `talk_time`.
        meets: probability that two pedestrians that approach each other stop and talk for `talk_time`: wandering ones,
            and walking ones, which then go on to their goals. Members of groups do not.
        leaves: probability that a pedestrian that attends to another one or to an object at the start goes away once
            this time is over.
        visit_time, talk_time: shortest and longest duration, s.
        sits: probability that it sits down on a free seat for `sit_time`.
        queues: probability that it goes to a queue that is not full, and stays until it was served.
        exits: probability that it leaves through a door, together with its group if it leads one; not through the door
            by which it came if there is another one.
        sit_time: shortest and longest duration, s.
        pause: shortest and longest time that a wandering pedestrian, or a walking group, stands at its destination, s;
            a place of interest has its own time.
        stops: mean number of stops of a pedestrian, or of a group that walks together, in a minute of walking. They
            stand away from walls, doors and strangers, and then go on to their destination.
        stop_time: shortest and longest duration of a stop, s; half of the stops last less than the shortest time and
            an eighth of the difference.
        detours: standard deviation of the distance of via points from a straight way, as a fraction of its length. On
            straight ways of 3 m and more, pedestrians walk by a via point between a quarter and three quarters of it.
    """

    visits: Fraction = 0.0
    joins: Fraction = 0.0
    meets: Fraction = 0.0
    leaves: Fraction = 0.0
    visit_time: tuple[Positive, Positive] = (5.0, 20.0)
    talk_time: tuple[Positive, Positive] = (10.0, 40.0)
    sits: Fraction = 0.0
    queues: Fraction = 0.0
    exits: Fraction = 0.0
    sit_time: tuple[Positive, Positive] = (20.0, 90.0)
    pause: tuple[NotNegative, NotNegative] = (0.0, 0.0)
    stops: NotNegative = field(default=0.0, metadata=ADDITIVE)
    stop_time: tuple[Positive, Positive] = field(default=(1.2, 20.0), metadata=ADDITIVE)
    detours: Fraction = field(default=0.0, metadata=ADDITIVE)

    @property
    def is_lively(self) -> bool:
        """Whether pedestrians do more during an episode than they began with, and pauses."""
        return max(self.visits, self.joins, self.meets, self.leaves, self.sits, self.queues, self.exits) > 0.0


# Properties of a scene that are computed once, of its robots, doors and humans.
_OF_ROBOTS = ("_views", "with_robots_as_people", "_with_goals")
_OF_DOORS = ("barriers", "robot_barriers", "barrier_owner", "_solids", "moving_doors", "_with_open_doors")
_OF_HUMANS = ("human_table", "standing_humans", "parking")

Solid = Literal["wall", "object", "door"]  # kinds of owners of barriers

Unmeasured = Literal["robot", "goal", "headings", "heads", "seed", "outcome"]
"""Data that a recording of another program may lack; headings are the directions of pedestrians' bodies."""


@dataclass(frozen=True, repr=False)
class Scene(FloatFields, Drawable):
    """The layout that an episode starts from, with all that determines its course apart from the controller.

    Attributes:
        name: name of the scenario.
        family: scenario and kind of room; data sets are split by family.
        polygon: outline of the room, counter-clockwise, m; pedestrians and robot stay inside.
        walls: all walls, starting with the edges of the outline and of the holes.
        holes: parts of the room without floor, each as corners in order, m.
        areas: named parts of the floor.
        attributes: declared attributes of people, objects and areas, and the attributes of the episode.
        doors, queues, places: where pedestrians enter and leave, stand in line, and like to go.
        interior_doors: doors between parts of the room, whose leaves open and close.
        seed, episode: what the scene was generated from; they also seed the choices that pedestrians make.
        settings: resolved scenario settings as JSON values; None for a scene that was not generated.
        dropped: requested entities that could not be placed.
        unmeasured: what the source of an imported episode does not record; pictures do not show it.
        robot, goal: of the first robot; in the view of another one, of that one.
        robots: the other robots.
        robot_id: of `robot`; 0 but in the view of another robot, see `seen_by`.
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
    unmeasured: frozenset[Unmeasured] = frozenset()
    doors: tuple[Door, ...] = ()
    queues: tuple[Queue, ...] = ()
    places: tuple[Place, ...] = ()
    robots: tuple[OtherRobot, ...] = ()
    robot_id: int = ROBOT_ID
    holes: tuple[tuple[Point, ...], ...] = ()
    areas: tuple[Area, ...] = ()
    attributes: tuple[AttributeSpec, ...] = ()
    interior_doors: tuple[InteriorDoor, ...] = ()

    def __repr__(self) -> str:
        people, objects = counted(len(self.humans), "person"), counted(len(self.furniture), "object")
        return f"<Scene {self.title}: {people}, {objects}>"

    @property
    def title(self) -> str:
        """Family, seed and episode number, in words."""
        origin = "" if "seed" in self.unmeasured else f", seed {self.seed}, episode {self.episode}"
        return f"{self.family}{origin}"

    @property
    def origin(self) -> dict[str, object]:
        """Scenario and seed, for tables."""
        names: dict[str, object] = {"scenario": self.name, "family": self.family}
        return names if "seed" in self.unmeasured else names | {"seed": self.seed, "episode": self.episode}

    def _facts(self) -> dict[str, object]:
        kinds = Counter(piece.type for piece in self.furniture)
        return {
            **self.origin,
            "people": len(self.humans),
            **({"robots": 1 + len(self.robots)} if self.robots else {}),
            "objects": ", ".join(counted(number, kind) for kind, number in kinds.items()) or "none",
            "robot": f"({self.robot.pose.x:.2f}, {self.robot.pose.y:.2f}) m",
            "goal": f"({self.goal.x:.2f}, {self.goal.y:.2f}) m",
            "time limit": f"{self.rules.time_limit:g} s",
        }

    def drawn_as(self, seed: int, episode: int, settings: dict[str, Any]) -> Scene:
        """The same layout with another origin; what was computed of the layout is kept."""
        return self._changed(_OF_ROBOTS, seed=seed, episode=episode, settings=settings)

    def _changed(self, computed: Iterable[str], **values: Any) -> Scene:
        """A copy with other values; what was computed of the layout is kept, but for some properties."""
        scene = copy(self)
        for name in computed:
            vars(scene).pop(name, None)
        for name, value in values.items():
            object.__setattr__(scene, name, value)
        return scene

    def seen_by(self, robot_id: int) -> Scene:
        """The same scene from the view of one of its robots, which is its `robot`; `robots` are the others, by id.

        Args:
            robot_id: 0, or the id of one of `robots`.

        Raises:
            KeyError: there is no such robot.
        """
        if robot_id not in self._views:
            own = next((other for other in self.robots if other.id == robot_id), None)
            if own is None:
                raise KeyError(f"there is no robot {robot_id}; the scene has {', '.join(map(str, self.robot_ids))}")
            others = [OtherRobot(self.robot_id, self.robot, self.goal), *(o for o in self.robots if o is not own)]
            others.sort(key=lambda other: other.id)
            values = {"robot": own.robot, "goal": own.goal, "robots": tuple(others), "robot_id": own.id}
            computed = ["with_robots_as_people", "_with_goals"]  # not `_views`, which the views share
            self._views[robot_id] = self._changed(computed, **values)
        return self._views[robot_id]

    def with_goal(self, goal: Goal) -> Scene:
        """The same scene with another goal of the first robot; the same object for the same goal."""
        if goal == self.goal:
            return self
        if goal not in self._with_goals:
            self._with_goals[goal] = self._changed(_OF_ROBOTS, goal=goal)
        return self._with_goals[goal]

    def differs_in_goal_only(self, other: Scene) -> bool:
        """Whether another scene is this one with another goal, see `with_goal`."""
        return self.walls is other.walls and self.humans is other.humans and self.robot is other.robot

    @cached_property
    def _with_goals(self) -> dict[Goal, Scene]:
        return {}

    @cached_property
    def _views(self) -> dict[int, Scene]:
        return {self.robot_id: self}

    @cached_property
    def with_robots_as_people(self) -> Scene:
        """The scene with the other robots as people that walk, for code that knows one robot only.

        Each is a disc, the smallest circle around its outline.
        """
        if not self.robots:
            return self
        people = (
            Human(
                other.id, other.robot.pose, radius=other.robot.radius, breadth=2.0 * other.robot.radius,
                desired_speed=other.robot.limits.ahead, behaviour="walking",
            )
            for other in self.robots
        )  # fmt: skip
        return self._changed((*_OF_HUMANS, *_OF_ROBOTS), humans=(*self.humans, *people), robots=())

    @property
    def robot_ids(self) -> tuple[int, ...]:
        """Ids of all robots, that of `robot` first."""
        return (self.robot_id, *(other.id for other in self.robots))

    @property
    def tasks(self) -> tuple[tuple[Robot, Goal], ...]:
        """All robots with their goals, in the order of `robot_ids`."""
        return ((self.robot, self.goal), *((other.robot, other.goal) for other in self.robots))

    @cached_property
    def barriers(self) -> Barriers:
        """Everything solid that never moves, as thick segments in the order of `barrier_owner`.

        Straight walls, then furniture with a physical body, then the leaves of interior doors that nobody opens.
        """
        return Barriers.of([edge for _, edges in self._solids for edge in edges])

    @cached_property
    def robot_barriers(self) -> Barriers:
        """Barriers that a robot keeps off: walls, furniture, and the edges of areas where robots may not go."""
        return self.barriers.joined(Barriers.of([edge for area in self.areas if area.no_go for edge in area.edges()]))

    @cached_property
    def barrier_owner(self) -> tuple[tuple[Solid, int], ...]:
        """Owner of each barrier: ("wall", key in `straight_walls`), ("object", id) or ("door", id).

        The owners of all `Snapshot.barriers`: those of `barriers` come first, then the doors that move.
        """
        owners: list[tuple[Solid, int]] = [owner for owner, edges in self._solids for _ in edges]
        return (*owners, *(("door", door.id) for door in self.moving_doors))

    @cached_property
    def wall_lines(self) -> tuple[int, ...]:
        """For each wall, the index of the first piece of its straight wall, by which contacts name it."""
        return wall_lines(self.walls)

    @cached_property
    def straight_walls(self) -> dict[int, Wall]:
        """Walls, of which those that are drawn in several pieces are joined, by the index of their first piece."""
        return straight_walls(self.walls, self.wall_lines)

    @cached_property
    def _solids(self) -> list[tuple[tuple[Solid, int], list[Edge]]]:
        solids: list[tuple[tuple[Solid, int], list[Edge]]] = []
        solids += [(("wall", k), [(wall.start, wall.end, 0.0)]) for k, wall in self.straight_walls.items()]
        solids += [(("object", f.id), f.shape.edges(f.pose)) for f in self.furniture if f.on is None]
        solids += [(("door", door.id), [door.leaf(door.opening)]) for door in self.interior_doors if not door.moves]
        return solids

    @property
    def fixed_leaves(self) -> list[Edge]:
        """The leaves of the interior doors that never move."""
        return [door.leaf(door.opening) for door in self.interior_doors if not door.moves]

    @cached_property
    def moving_doors(self) -> tuple[InteriorDoor, ...]:
        """The interior doors that can open and close."""
        return tuple(door for door in self.interior_doors if door.moves)

    def for_paths(self, openings: Iterable[float]) -> Scene:
        """The room as paths lead through it: leaves of hinged doors that are open do not move, other doors are free.

        Args:
            openings: of `moving_doors`.

        Returns:
            The same object for the same open doors.
        """
        sides = tuple(
            math.copysign(1.0, opening) if door.kind == "hinged" and abs(opening) >= OPEN else 0.0
            for door, opening in zip(self.moving_doors, openings, strict=True)
        )
        if not any(sides):
            return self
        if sides not in self._with_open_doors:
            at = dict(zip((door.id for door in self.moving_doors), sides, strict=True))
            doors = tuple(
                replace(door, opened_by="nobody", opening=at[door.id]) if at.get(door.id) else door
                for door in self.interior_doors
            )
            self._with_open_doors[sides] = self._changed((*_OF_ROBOTS, *_OF_DOORS), interior_doors=doors)
        return self._with_open_doors[sides]

    @cached_property
    def _with_open_doors(self) -> dict[tuple[float, ...], Scene]:
        return {}

    @cached_property
    def outline(self) -> Array:
        """The polygon of the room as a read-only (K, 2) array, m."""
        return frozen(np.array(self.polygon, dtype=float))

    @cached_property
    def outline_edges(self) -> Array:
        """Start and end of the edges of the room's polygon and of its holes as a read-only (K, 4) array, m."""
        rings = [np.array(ring, dtype=float) for ring in (self.polygon, *self.holes)]
        return frozen(np.concatenate([np.hstack((ring, np.roll(ring, -1, axis=0))) for ring in rings]))

    def is_on_floor(self, points: Array) -> BoolArray:
        """Whether points lie in the room, and in none of its holes; (N, 2), m, to (N,) of bool."""
        return inside_rings(points, self.polygon, self.holes)

    @cached_property
    def floor_area(self) -> float:
        """Area of the room without its holes, m²."""
        return polygon_area(self.polygon) - sum(polygon_area(hole) for hole in self.holes)

    def attributes_at(self, columns: Sequence[AttributeColumn], points: Array) -> Array:
        """The numbers in the columns of areas at points: of the first area there that has a value; 0 without one.

        Args:
            columns: A columns of attributes of areas.
            points: (P, 2), m, world frame; not a number: no point.

        Returns:
            (P, A).
        """
        numbers, is_given = np.zeros((len(points), len(columns))), np.zeros((len(points), len(columns)), dtype=bool)
        for area in self.areas:
            is_inside = inside_rings(points, area.polygon, ())
            for k, column in enumerate(columns):
                if column.spec.name in (area.attributes or {}):
                    numbers[is_inside & ~is_given[:, k], k] = column.number(area.attributes)
                    is_given[:, k] |= is_inside
        return numbers

    def attributes_of(self, id: int | None = None) -> Attributes:
        """Values of the attributes of a person or an object, by name; of the episode without an id.

        Raises:
            KeyError: there is no such person or object.
        """
        if id is None:
            return {
                spec.name: spec.value for spec in self.attributes if spec.of == "episode" and spec.value is not None
            }
        entities: list[Human | Furniture] = [*self.humans, *self.furniture]
        for entity in entities:
            if entity.id == id:
                return entity.attributes or {}
        raise KeyError(f"there is no person or object {id}")

    @cached_property
    def human_table(self) -> HumanTable:
        """Constant properties of the humans as arrays."""
        return HumanTable.of(self.humans)

    @cached_property
    def standing_humans(self) -> Barriers:
        """Pedestrians that stand and are present throughout the episode, as discs."""
        return standing_throughout(self.humans)

    @cached_property
    def parking(self) -> Array:
        """A place for each pedestrian far from the room, where it is kept while it is absent; (N, 2), m, read-only."""
        x, y = (self.outline.max(axis=0) + _PARKING_DISTANCE).tolist()
        places = [(x, y + _PARKING_SPACING * k) for k in range(len(self.humans))]
        return frozen(np.array(places, dtype=float).reshape(-1, 2))


def initial_activities(scene: Scene) -> IntArray:
    """Activities at the start, from interactions and behaviours; (N,) of int, into `ACTIVITIES`, read-only."""
    return activity_indices({human.id: _activity_at_start(human) for human in scene.humans}, scene.interactions)


def _activity_at_start(human: Human) -> str:
    """The activity of a pedestrian without interactions at the start."""
    if human.walks_at_start:
        return "walking"
    return "standing" if human.seat is None and human.queue is None else "queueing" if human.seat is None else "sitting"


def standing_throughout(humans: Iterable[Human]) -> Barriers:
    """Outlines of the pedestrians that stand and are present from start to end, at their initial headings."""
    standing = (human for human in humans if human.is_always_present and human.behaviour == "standing")
    return Barriers.of(edge for human in standing for edge in human.shape.edges(human.pose))
