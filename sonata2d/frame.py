"""What passes between rooms: the Snapshot a mind sees, the commands it answers, the Frame noted, the Outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np

from .entities import (
    AT_LAPTOP,
    AT_OBJECT,
    AT_PLANT,
    TALKING,
    WALKING_TOGETHER,
    Furniture,
    Goal,
    Interaction,
    Robot,
    Scene,
    Wall,
)
from .exact import Array, angle_of, arctan2
from .geometry import Point, Pose, Twist
from .topics import DeviceEvent

# Columns of the one array that holds the people: (N, 9), world frame.
X, Y, VX, VY, HX, HY, LX, LY, OMEGA = range(9)  # place, velocity, body's direction, look's direction, turn rate
ACTIVITIES = ("standing", "walking", "walking together", "talking", "using", "looking")

_DOING = {
    TALKING: "talking",
    WALKING_TOGETHER: "walking together",
    AT_LAPTOP: "using",
    AT_PLANT: "looking",
    AT_OBJECT: "looking",
}

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
class HumanState:
    """One person as seen in a snapshot, world frame."""

    id: int
    pose: Pose
    velocity: Point
    omega: float
    head: float  # where they look, rad, world frame
    radius: float
    activity: str


@dataclass(frozen=True)
class Humans:
    """The people who are there: arrays in the scene's order, read-only; `humans[3]` makes one `HumanState`.

    N is the number of those present; who comes and goes is told by `id`.

    Attributes:
        state: (N, 9), columns x, y, vx, vy, body's unit vector, look's unit vector, turn rate; SI, world frame.
        id: (N,) of int.
        radius: (N,), m.
        activity_index: (N,) of int, into `frame.ACTIVITIES`.
        row: (N,) of int, each one's index in `scene.humans`; None: everybody is there.
    """

    state: Array
    id: Any
    radius: Array
    activity_index: Any
    row: Any = None

    def only(self, row: Any) -> Humans:
        """Of everybody those with these indices, (n,) of int, rising; as it is if that is all."""
        if len(row) == len(self):
            return self
        told = self.state[row], self.id[row], self.radius[row], self.activity_index[row], np.asarray(row)
        for values in told:
            values.flags.writeable = False
        return Humans(*told)

    def among_all(self, values: Any, count: int, absent: float) -> Any:
        """Values of those present, (N, …), as rows of all people of the scene, (count, …).

        Args:
            values: a row for each who is there.
            count: people in the scene.
            absent: what stands in the rows of the others.
        """
        if self.row is None:
            return values.copy()
        rows = np.full((count, *values.shape[1:]), absent, dtype=values.dtype)
        rows[self.row] = values
        return rows

    @property
    def position(self) -> Array:
        """(N, 2), m."""
        return self.state[:, X : Y + 1]

    @property
    def velocity(self) -> Array:
        """(N, 2), m/s."""
        return self.state[:, VX : VY + 1]

    @property
    def heading(self) -> Array:
        """(N, 2), unit vectors of the bodies."""
        return self.state[:, HX : HY + 1]

    @property
    def look(self) -> Array:
        """(N, 2), unit vectors of the heads."""
        return self.state[:, LX : LY + 1]

    @property
    def omega(self) -> Array:
        """(N,), rad/s, of the bodies."""
        return self.state[:, OMEGA]

    @cached_property
    def theta(self) -> Array:
        """(N,), rad, of the bodies."""
        return arctan2(self.state[:, HY], self.state[:, HX])

    @cached_property
    def head(self) -> Array:
        """(N,), rad, of the heads, world frame."""
        return arctan2(self.state[:, LY], self.state[:, LX])

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, index: int) -> HumanState:
        row = [float(value) for value in self.state[index]]
        return HumanState(
            id=int(self.id[index]),
            pose=Pose(row[X], row[Y], angle_of(row[HY], row[HX])),
            velocity=(row[VX], row[VY]),
            omega=row[OMEGA],
            head=angle_of(row[LY], row[LX]),
            radius=float(self.radius[index]),
            activity=ACTIVITIES[int(self.activity_index[index])],
        )

    def __iter__(self) -> Iterator[HumanState]:
        return (self[index] for index in range(len(self)))


@dataclass(frozen=True, slots=True)
class RobotState:
    """The robot as seen in a snapshot.

    Attributes:
        position, heading, velocity: m, unit vector, m/s; world frame.
        omega: rad/s.
        executed: body-frame twist that the drive carried out in the last tick, guard included.
        guarded: whether the guard stepped in during the last tick.
        body: radius, drive and limits.
    """

    position: Point
    heading: Point
    velocity: Point
    omega: float
    executed: Twist
    guarded: bool
    body: Robot

    @property
    def pose(self) -> Pose:
        return Pose(*self.position, angle_of(self.heading[1], self.heading[0]))

    @property
    def radius(self) -> float:
        return self.body.radius

    @property
    def twist(self) -> Twist:
        """Its velocity now, body frame."""
        (c, s), (vx, vy) = self.heading, self.velocity
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


def frozen(array: Array) -> Array:
    """The array, no longer to be written to."""
    array.flags.writeable = False
    return array


def human_ids(scene: Scene) -> Any:
    """(N,) of int: the ids of the people in the scene's order."""
    return frozen(np.array([human.id for human in scene.humans], dtype=np.int64))


def activities_of(scene: Scene) -> Any:
    """(N,) of int, into `ACTIVITIES`: what people do by their interactions, else by how they behave."""
    return activities({human.id: human.behaviour != "standing" for human in scene.humans}, scene.interactions)


def activities(walks: Mapping[int, bool], interactions: Iterable[Interaction]) -> Any:
    """(N,) of int, into `ACTIVITIES`: what people do by their interactions, else by whether they walk; ids in order."""
    doing = {person: "walking" if is_walking else "standing" for person, is_walking in walks.items()}
    for tie in interactions:
        doing[tie.src] = _DOING[tie.relation]
        if tie.dst in doing:
            doing[tie.dst] = _DOING[tie.relation]
    return frozen(np.array([ACTIVITIES.index(kind) for kind in doing.values()], dtype=np.int64))
