"""What passes between rooms: the Snapshot a mind sees, the commands it answers, the Frame noted, the Outcome."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from .devices import DeviceEvent
from .entities import Furniture, Goal, Interaction, Robot, Wall
from .geometry import Point, Pose, Twist
from .humans import Humans
from .portable_math import Array, angle_of
from .scene import Scene

Status = Literal["goal", "timeout", "contact", "stopped", "regenerate", "error"]


@dataclass(frozen=True, slots=True)
class Contact:
    """The robot and another outline nearer than the contact distance, at some moment of the last tick.

    At fault is the one whose own velocity closes the gap; both may be, or neither.
    """

    kind: Literal["human", "object", "wall"]
    id: int  # of the human or object; of a wall its index in the scene
    robot_at_fault: bool
    other_at_fault: bool


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot as seen in a snapshot.

    Attributes:
        position, direction, velocity: m, unit vector, m/s; world frame.
        omega: rad/s.
        executed: body-frame twist that the drive carried out in the last tick, guard included.
        guarded: whether the guard stepped in during the last tick.
        body: radius, drive and limits.
    """

    position: Point
    direction: Point
    velocity: Point
    omega: float
    executed: Twist
    guarded: bool
    body: Robot

    @property
    def pose(self) -> Pose:
        return Pose(*self.position, angle_of(self.direction[1], self.direction[0]))

    @property
    def radius(self) -> float:
        return self.body.radius

    @property
    def twist(self) -> Twist:
        """Its velocity now, body frame."""
        (c, s), (vx, vy) = self.direction, self.velocity
        return Twist(vx * c + vy * s, vy * c - vx * s, self.omega)


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One frozen look at the world, which controller and crowd share.

    `image` is (H, W, 3) of uint8 where the controller asks for one (`Controller.image`), else None.
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
    def dt(self) -> float:
        return self.scene.rules.dt


@dataclass(frozen=True, slots=True)
class CrowdCommands:
    """What the people want, one row a person in the scene's order.

    Attributes:
        acceleration: (N, 2), m/s2, world frame.
        facing: (N, 2), unit vectors the bodies turn to.
        look: (N, 2), unit vectors the heads turn to.
        activity: (N,) of int, into `ACTIVITIES`.
        interactions: as they stand now, those of absent people too.
        refresh: of a law so stiff that it must be asked again within the tick, else None: from (N + 1, 4) rows x, y,
            vx, vy, the robot last, to the (N, 2) accelerations there and then; asked `evaluations` times a tick.
        leaving: rows of those who have reached where they leave the scene.
    """

    acceleration: Array
    facing: Array
    look: Array
    activity: Any
    interactions: tuple[Interaction, ...]
    refresh: Callable[[Array], Array] | None = None
    evaluations: int = 1
    leaving: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Frame:
    """One tick as it is noted: what was seen, what the controller asked for, and its label."""

    snapshot: Snapshot
    command: Twist
    label: Any = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an episode ended."""

    status: Status
    reason: str
    tick: int
    time: float


@dataclass(frozen=True, slots=True)
class Author:
    """Who drives: what a file says of the controller."""

    path: str
    version: str | None = None
    settings: dict[str, Any] | None = None
    labels: dict[str, str] | None = None  # name of each label: what it means


class Observer(Protocol):
    """Whoever watches an episode: recorder, window, meter."""

    def open(self, scene: Scene, author: Author) -> None:
        """The episode begins."""

    def note(self, frame: Frame) -> None:
        """One tick, before the world moves."""

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """The episode is over; `last` is the final look, to which no command belongs."""
