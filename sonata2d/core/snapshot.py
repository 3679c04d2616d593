"""Values exchanged in a tick: the snapshot, the commands that answer it, the recorded frame, and the outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol, Self

import numpy as np

from .devices import DeviceEvent
from .doors import DoorState
from .drawable import Drawable
from .entities import ROBOT_ID, Furniture, Goal, Interaction, Robot, Wall
from .geometry import Barriers, Edge, Point, Pose, Twist
from .humans import BODY_X, BODY_Y, GAZE_Y, OMEGA, VX, VY, Humans, X, Y, activities_of_present, frozen
from .portable_math import Array, BoolArray, IntArray, angle_of, unit_vector
from .relations import ACTIVITIES
from .scene import Scene, initial_activities
from .state import EXECUTED_OMEGA, EXECUTED_VX, EXECUTED_VY, GUARDED, ROBOT_SIZE, State
from .wording import counted

CLOSING_SPEED = 0.01  # m/s; a side that approaches the other faster than this closes the gap between them
ContactKind = Literal["human", "object", "wall", "door", "robot"]
Status = Literal["goal", "timeout", "contact", "stopped", "regenerate", "error"]


@dataclass(frozen=True, slots=True)
class Contact:
    """The robot and another outline came nearer than the contact distance during the last tick.

    A side is at fault if its own velocity closes the gap; both can be, or neither.

    Attributes:
        kind: what the robot touched.
        id: of the human, object, door or other robot; for a wall its index in the scene, or that of the first of the
            pieces of a straight wall.
        robot_at_fault, other_at_fault: whether each side closed the gap.
    """

    kind: ContactKind
    id: int
    robot_at_fault: bool
    other_at_fault: bool


@dataclass(frozen=True, slots=True)
class RobotState:
    """State of the robot in a snapshot, world frame.

    Attributes:
        position: m.
        direction: unit vector of the heading.
        velocity: m/s.
        omega: turn rate, rad/s.
        executed: body-frame twist that the drive executed in the last tick, after the safety guard.
        guarded: whether the safety guard reduced the velocity during the last tick.
        body: radius, drive and limits.
        id: 0 for the first robot of the scene.
    """

    position: Point
    direction: Point
    velocity: Point
    omega: float
    executed: Twist
    guarded: bool
    body: Robot
    id: int = ROBOT_ID

    @property
    def pose(self) -> Pose:
        return Pose(*self.position, angle_of(self.direction[1], self.direction[0]))

    @property
    def radius(self) -> float:
        return self.body.radius

    @property
    def twist(self) -> Twist:
        """Current velocity in the body frame."""
        (c, s), (vx, vy) = self.direction, self.velocity
        return Twist(vx * c + vy * s, vy * c - vx * s, self.omega)


@dataclass(frozen=True, repr=False)
class Snapshot(Drawable):
    """State of the world at one tick, frozen; controller and crowd receive the same one.

    The objects of a snapshot of a running episode are built when they are first read, so that a controller pays only
    for what it uses.

    Attributes:
        tick: number of ticks since the start.
        time: s since the start.
        scene: the layout at the start.
        robot: `pose`, `position`, `direction`, `velocity` (world frame), `twist` (body frame), `radius`, `body.limits`.
        humans: the people present, as arrays over N people: `position`, `velocity`, `direction`, `gaze` (N, 2),
            `theta`, `head`, `omega`, `radius`, `id` (N,); `humans[3]` is one of them.
        goal: of this tick; of a task with several places or a moving person, not that of the start.
        walls, objects: as in the scene.
        interactions: current ones between pedestrians and objects that are present.
        contacts: of the robot during the last tick.
        events: of input devices since the last snapshot.
        image: (H, W, 3) of uint8 if the controller requests one (`Controller.image`), else None.
        sensors: readings of the controller's sensors by name (`Controller.sensors`), such as `sensors.lidar`; None if
            it has none.
        robots: the other robots, in the order of `scene.robots`.
        contacts_of_robots: of the other robots during the last tick, in the same order.
        doors: the interior doors of the scene, and how far each is open.
    """

    tick: int
    time: float
    scene: Scene
    robot: RobotState
    humans: Humans
    interactions: tuple[Interaction, ...]
    contacts: tuple[Contact, ...] = ()
    events: tuple[DeviceEvent, ...] = ()
    image: Any = None
    sensors: Any = None
    robots: tuple[RobotState, ...] = field(default_factory=tuple)  # no attribute of the class: it is built when read
    contacts_of_robots: tuple[tuple[Contact, ...], ...] = ()
    doors: tuple[DoorState, ...] = field(default_factory=tuple)  # as `robots`
    _state: State | None = field(default=None, init=False, repr=False, compare=False)

    @classmethod
    def of_state(
        cls,
        tick: int,
        scene: Scene,
        state: State,
        interactions: tuple[Interaction, ...],
        contacts: tuple[Contact, ...] = (),
        events: tuple[DeviceEvent, ...] = (),
        contacts_of_robots: tuple[tuple[Contact, ...], ...] = (),
    ) -> Self:
        """A snapshot that builds `robot`, `robots`, `humans` and `doors` from a state when they are first read.

        Args:
            tick, scene, interactions, contacts, events, contacts_of_robots: as the attributes.
            state: of all robots and pedestrians of the scene.
        """
        snapshot = object.__new__(cls)
        values = vars(snapshot)  # of all attributes except those that are built later; the class is frozen
        values.update(tick=tick, time=round(tick * scene.rules.dt, 4), scene=scene, interactions=interactions)
        values.update(contacts=contacts, events=events, image=None, sensors=None, _state=state)
        if contacts_of_robots:  # else that of the class
            values["contacts_of_robots"] = contacts_of_robots
        return snapshot

    def __getattr__(self, name: str) -> Any:
        """Build `robot`, `robots`, `humans` or `doors` from the state; called for attributes that are not set."""
        if name == "robot" and self._state is not None:
            value: Any = _robot_state(self._state.robot.tolist(), self.scene.robot, self.scene.robot_id)
        elif name == "robots" and self._state is not None:
            rows, others = self._state.robots.tolist(), self.scene.robots
            value = tuple(_robot_state(row, o.robot, o.id) for row, o in zip(rows, others, strict=True))
        elif name == "humans" and self._state is not None:
            value = self._build_humans(self._state)
        elif name == "doors" and self._state is not None:
            value = door_states(self.scene, self._state.doors.tolist())
        else:
            raise AttributeError(f"Snapshot has no attribute {name!r}")
        object.__setattr__(self, name, value)
        return value

    def _build_humans(self, state: State) -> Humans:
        humans = self.scene.human_table.with_state(state.humans, state.activity)
        return humans if state.is_present is None else humans.select(np.flatnonzero(state.is_present))

    @property
    def state(self) -> State:
        """The numbers of this snapshot as one row, with all pedestrians of the scene."""
        if self._state is None:
            object.__setattr__(self, "_state", self._build_state())
        assert self._state is not None
        return self._state

    def _build_state(self) -> State:
        humans, count = self.humans, len(self.scene.humans)
        others = [value for robot in self.robots for value in _robot_row(robot)]
        people = humans.expand(humans.state, count, 0.0).ravel()
        openings = [each.opening for each in self.doors if each.door.moves]
        row = frozen(np.concatenate((_robot_row(self.robot), people, np.array(others), openings)))
        is_present = None
        if humans.row is not None:
            is_present = frozen(humans.expand(np.ones(len(humans), dtype=bool), count, False))
        return State(row, frozen(humans.expand(humans.activity_index, count, 0)), is_present, len(openings))

    def __repr__(self) -> str:
        people = counted(len(self.humans), "person")
        return f"<Snapshot of {self.scene.title}: tick {self.tick}, {self.time:g} s, {people}>"

    def _facts(self) -> dict[str, object]:
        (x, y), (vx, vy) = self.robot.position, self.robot.velocity
        return {
            **self.scene.origin,
            "time": f"{self.time:g} s, tick {self.tick}",
            "robot": f"({x:.2f}, {y:.2f}) m, {math.sqrt(vx * vx + vy * vy):.2f} m/s",
            "people": len(self.humans),
            "interactions": len(self.interactions),
            "contacts": len(self.contacts),
        }

    def seen_by(self, robot_id: int) -> Snapshot:
        """The same state from the view of another robot, see `Scene.seen_by`; without events, image and sensors.

        Raises:
            KeyError: there is no such robot.
        """
        if robot_id == self.scene.robot_id:
            return self
        scene = self.scene.seen_by(robot_id)
        order = [self.scene.robot_ids.index(id) for id in scene.robot_ids]
        contacts: list[tuple[Contact, ...]] = [()] * len(order)
        if self.contacts_of_robots:
            contacts = [(self.contacts, *self.contacts_of_robots)[k] for k in order]
        state = self.state.with_robots(order)
        return Snapshot.of_state(
            self.tick, scene, state, self.interactions, contacts[0], contacts_of_robots=tuple(contacts[1:])
        )

    def with_robots_as_people(self) -> Snapshot:
        """The same state of `Scene.with_robots_as_people`, for code that knows one robot only."""
        if not self.scene.robots:
            return self
        scene, state = self.scene.with_robots_as_people, self.state
        others, activity = state.robots, [ACTIVITIES.index("walking")] * len(self.scene.robots)
        people = np.concatenate(
            (others[:, : BODY_Y + 1], others[:, BODY_X : BODY_Y + 1], others[:, OMEGA : OMEGA + 1]), 1
        )
        row = frozen(np.concatenate((state.robot, state.humans.ravel(), people.ravel(), state.doors)))
        is_present = state.is_present
        if is_present is not None:
            is_present = frozen(np.concatenate((is_present, np.ones(len(others), dtype=bool))))
        activities = frozen(np.concatenate((state.activity, activity)))
        everybody = State(row, activities, is_present, state.door_count)
        snapshot = Snapshot.of_state(self.tick, scene, everybody, self.interactions, self.contacts, self.events)
        vars(snapshot).update(image=self.image, sensors=self.sensors)
        return snapshot

    @property
    def goal(self) -> Goal:
        return self.scene.goal

    @property
    def walls(self) -> tuple[Wall, ...]:
        return self.scene.walls

    @property
    def objects(self) -> tuple[Furniture, ...]:
        return self.scene.furniture

    @property
    def barriers(self) -> Barriers:
        """Everything solid but people and robots: barriers of the scene, then the leaves of the doors that move."""
        if not self.scene.moving_doors:
            return self.scene.barriers
        return self.scene.barriers.joined(Barriers.of(self.moving_leaves))

    @property
    def moving_leaves(self) -> list[Edge]:
        """The leaves of the interior doors that move, where they are in this tick."""
        return [each.leaf for each in self.doors if each.door.moves]

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.scene.rules.dt


def _robot_state(row: list[float], body: Robot, id: int) -> RobotState:
    """A robot's state from its part of a `State.row`."""
    executed, is_guarded = Twist(*row[EXECUTED_VX : EXECUTED_OMEGA + 1]), row[GUARDED] != 0.0
    position, direction, velocity = (row[X], row[Y]), (row[BODY_X], row[BODY_Y]), (row[VX], row[VY])
    return RobotState(position, direction, velocity, row[OMEGA], executed, is_guarded, body, id)


def _robot_row(robot: RobotState) -> list[float]:
    """A robot's part of a `State.row`, the inverse of `_robot_state`."""
    row = [0.0] * ROBOT_SIZE
    row[X], row[Y] = robot.position
    row[VX], row[VY] = robot.velocity
    row[BODY_X], row[BODY_Y] = robot.direction
    row[OMEGA], row[GUARDED] = robot.omega, float(robot.guarded)
    row[EXECUTED_VX], row[EXECUTED_VY], row[EXECUTED_OMEGA] = robot.executed.vx, robot.executed.vy, robot.executed.omega
    return row


def door_states(scene: Scene, openings: Sequence[float]) -> tuple[DoorState, ...]:
    """The states of the interior doors of a scene, from the openings of those that move."""
    moving = iter(openings)
    return tuple(DoorState(door, next(moving) if door.moves else door.opening) for door in scene.interior_doors)


class CrowdCommands(NamedTuple):
    """The crowd's answer to a snapshot: one row per pedestrian of the scene, in its order, whether present or not.

    The arrays are valid until the crowd's next answer.

    Attributes:
        acceleration: (N, 2), m/s^2, world frame.
        facing: (N, 2), unit vectors of the desired headings of the bodies.
        gaze: (N, 2), unit vectors of the desired gazes.
        activity: (N,) of int, into `relations.ACTIVITIES`.
        interactions: current ones, including interactions of absent pedestrians.
        refresh: for a pedestrian model so stiff that it must be evaluated several times in a tick: computes the (N, 2)
            accelerations, m/s^2, from the current (N + R, 4) rows x, y, vx, vy, those of the R robots last. Else None.
        evaluations: number of evaluations of the model in a tick.
        leaving: (N,) of bool, pedestrians that have reached the goal or the door at which they leave the scene; None:
            nobody.
        seats: (N,) of int, index in `scene.furniture` of the seat that a pedestrian sits on, sits down on or gets up
            from, since the two do not collide; -1 for none. None: as before.
    """

    acceleration: Array
    facing: Array
    gaze: Array
    activity: IntArray
    interactions: tuple[Interaction, ...]
    refresh: Callable[[Array], Array] | None = None
    evaluations: int = 1
    leaving: BoolArray | None = None
    seats: IntArray | None = None


@dataclass(frozen=True, slots=True)
class Frame:
    """Record of one tick.

    Attributes:
        snapshot: of the tick.
        command: of the controller, body frame.
        label: of the controller.
        others: commands and labels of the controllers of the other robots.
        readings: of each robot, the first one first, the readings that arrived at this tick from sensors that are
            recorded, by name, as files hold them; empty if no sensor is recorded.
    """

    snapshot: Snapshot
    command: Twist
    label: Any = None
    others: tuple[tuple[Twist, Any], ...] = ()
    readings: tuple[dict[str, Any], ...] = ()


class Frames(NamedTuple):
    """Consecutive frames that differ in their numbers only.

    Attributes:
        first: snapshot of the first frame, whose activities, interactions and contacts all have.
        rows: (T, 13 + 9 N + D), `State.row` of each frame; read-only.
        commands: (T, 3), vx, vy (m/s) and omega (rad/s), body frame.
        labels: of the frames; None: they have none.
    """

    first: Snapshot
    rows: Array
    commands: Array
    labels: Sequence[Any] | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """End of an episode.

    Attributes:
        status: kind of end.
        reason: in words.
        tick, time: of the end; s.
        arrivals: of several robots, the tick at which each reached its goal, None for those that did not; in the order
            of `Scene.robot_ids`. Empty for one robot.
    """

    status: Status
    reason: str
    tick: int
    time: float
    arrivals: tuple[int | None, ...] = ()


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """Description of a controller, as recorded in files.

    Attributes:
        path: import path or registered name of the controller.
        version: of the controller.
        settings: from which the controller can be reconstructed.
        labels: meaning of each label by name.
        sensors: the recorded sensors, each with its name, type and settings.
        others: controllers of the other robots, in the order of `scene.robots`.
    """

    path: str
    version: str | None = None
    settings: dict[str, Any] | None = None
    labels: dict[str, str] | None = None
    sensors: tuple[dict[str, Any], ...] = ()
    others: tuple[ControllerInfo, ...] = ()


class Observer(Protocol):
    """Receives the scene, every frame and the outcome of an episode: a recorder, a window, a meter.

    An observer that also has a method `on_frames(frames: Frames)` may get many frames at once, after the world has
    moved on; an error that it raises ends the episode at a later tick. A subclass that overrides `on_frame` alone gets
    every frame.
    """

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        """Called once, before the first tick."""

    def on_frame(self, frame: Frame) -> None:
        """Called once per tick, before the world moves."""

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """Called once, at the end; `last` is the final snapshot, to which no command belongs."""


def snapshot_of(scene: Scene) -> Snapshot:
    """The snapshot at tick 0: all agents at their initial poses and at rest, heads pointing ahead."""
    state, table = np.zeros((len(scene.humans), 9)), scene.human_table
    state[:, X : Y + 1] = table.position
    for row, human in zip(state, scene.humans, strict=True):
        row[BODY_X : GAZE_Y + 1] = (*human.pose.direction, *human.pose.direction)
    at_rest = [
        RobotState(robot.pose.position, unit_vector(robot.pose.theta), (0.0, 0.0), 0.0, Twist(), False, robot, id)
        for (robot, _), id in zip(scene.tasks, scene.robot_ids, strict=True)
    ]
    entering_later = {human.id for human in scene.humans if human.enters > 0}
    interactions = tuple(
        link for link in scene.interactions if link.src not in entering_later and link.dst not in entering_later
    )
    activity = initial_activities(scene)
    if entering_later:
        activity = activities_of_present(activity, table.id, interactions)
    humans = table.with_state(frozen(state), activity)
    present = humans.select(np.flatnonzero([human.enters == 0 for human in scene.humans]))
    doors = door_states(scene, [door.opening for door in scene.moving_doors])
    return Snapshot(0, 0.0, scene, at_rest[0], present, interactions, robots=tuple(at_rest[1:]), doors=doors)
