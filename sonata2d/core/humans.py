"""The people in a snapshot: one array, read-only, and what they do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .entities import AT_LAPTOP, AT_OBJECT, AT_PLANT, TALKING, WALKING_TOGETHER, Interaction
from .geometry import Point, Pose
from .portable_math import Array, angle_of, arctan2
from .scene import Scene

# Columns of the one array that holds the people: (N, 9), world frame.
X, Y, VX, VY, BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA = range(
    9
)  # place, velocity, body's direction, look's direction, turn rate
ACTIVITIES = ("standing", "walking", "walking together", "talking", "using", "looking")

_DOING = {
    TALKING: "talking",
    WALKING_TOGETHER: "walking together",
    AT_LAPTOP: "using",
    AT_PLANT: "looking",
    AT_OBJECT: "looking",
}
_ALONE = np.array(
    [ACTIVITIES.index({"talking": "standing", "walking together": "walking"}.get(k, k)) for k in ACTIVITIES]
)


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
        activity_index: (N,) of int, into `humans.ACTIVITIES`.
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
    def direction(self) -> Array:
        """(N, 2), unit vectors of the bodies."""
        return self.state[:, BODY_X : BODY_Y + 1]

    @property
    def look(self) -> Array:
        """(N, 2), unit vectors of the heads."""
        return self.state[:, GAZE_X : GAZE_Y + 1]

    @property
    def omega(self) -> Array:
        """(N,), rad/s, of the bodies."""
        return self.state[:, OMEGA]

    @cached_property
    def theta(self) -> Array:
        """(N,), rad, of the bodies."""
        return arctan2(self.state[:, BODY_Y], self.state[:, BODY_X])

    @cached_property
    def head(self) -> Array:
        """(N,), rad, of the heads, world frame."""
        return arctan2(self.state[:, GAZE_Y], self.state[:, GAZE_X])

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, index: int) -> HumanState:
        row = [float(value) for value in self.state[index]]
        return HumanState(
            id=int(self.id[index]),
            pose=Pose(row[X], row[Y], angle_of(row[BODY_Y], row[BODY_X])),
            velocity=(row[VX], row[VY]),
            omega=row[OMEGA],
            head=angle_of(row[GAZE_Y], row[GAZE_X]),
            radius=float(self.radius[index]),
            activity=ACTIVITIES[int(self.activity_index[index])],
        )

    def __iter__(self) -> Iterator[HumanState]:
        return (self[index] for index in range(len(self)))


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


def activities_among(activity: Any, ids: Any, ties: Iterable[Interaction]) -> Any:
    """(N,) of int, into `ACTIVITIES`: what people do once those they do it with are absent.

    Args:
        activity: (N,) of int, what they do if everybody is there.
        ids: (N,) of int.
        ties: the interactions between those who are there.
    """
    busy = {end for tie in ties for end in (tie.src, tie.dst)}
    is_alone = np.array([id not in busy for id in ids.tolist()], dtype=bool)
    return frozen(np.where(is_alone, _ALONE[activity], activity))


def activities(walks: Mapping[int, bool], interactions: Iterable[Interaction]) -> Any:
    """(N,) of int, into `ACTIVITIES`: what people do by their interactions, else by whether they walk; ids in order."""
    doing = {person: "walking" if is_walking else "standing" for person, is_walking in walks.items()}
    for tie in interactions:
        doing[tie.src] = _DOING[tie.relation]
        if tie.dst in doing:
            doing[tie.dst] = _DOING[tie.relation]
    return frozen(np.array([ACTIVITIES.index(kind) for kind in doing.values()], dtype=np.int64))
