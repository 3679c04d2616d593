"""The pedestrians of a snapshot as one read-only array, and their activities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from .entities import DEFAULT_KIND, Human, Interaction, half_shoulder_line
from .geometry import Point, Pose
from .portable_math import Array, IntArray, angle_of, arctan2
from .relations import ACTIVITIES, ACTIVITY, RELATION
from .wording import counted

# Columns of the (N, 9) state of the pedestrians, world frame: position, velocity, unit vectors of the body's heading
# and of the gaze, turn rate. Arrays of bodies that hold position and velocity only have the first four of them.
X, Y, VX, VY, BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA = range(9)
ACTIVITY_ALONE = np.array([ACTIVITIES.index(activity.alone or activity.name) for activity in ACTIVITY.values()])

RESPONSE_TIME = 0.5  # s, in which a pedestrian can reverse its velocity
MAXIMUM_SPEED_RATIO = 1.3  # maximum speed over desired speed (Helbing & Molnár, Phys. Rev. E 51 (1995) 4282)

Values = TypeVar("Values", bound=NDArray[Any])


@dataclass(frozen=True, slots=True)
class HumanState:
    """One pedestrian in a snapshot, world frame.

    Attributes:
        velocity: m/s.
        omega: turn rate of the body, rad/s.
        head: direction of the gaze, rad.
        radius: half the depth of the body, m.
        breadth: of the shoulders, m.
        activity: one of `ACTIVITIES`.
        length: of a body that is longer than broad, m, along its heading; 0 for others.
        kind: name of the kind of person.
    """

    id: int
    pose: Pose
    velocity: Point
    omega: float
    head: float
    radius: float
    breadth: float
    activity: str
    length: float = 0.0
    kind: str = DEFAULT_KIND

    @property
    def shoulder(self) -> float:
        """Half the length of the shoulder line, m; see `Humans.shoulder`."""
        return half_shoulder_line(self.radius, self.breadth, self.length)


@dataclass(frozen=True, repr=False)
class Humans:
    """The N pedestrians that are present in a snapshot, as read-only arrays in the scene's order.

    `humans[3]` creates one `HumanState`. Pedestrians can enter and leave, so `id` identifies one across snapshots, and
    its row does not.

    Attributes:
        state: (N, 9), columns x, y, vx, vy, unit vector of the body's heading, unit vector of the gaze, turn rate; SI
            units, world frame.
        id: (N,) of int.
        radius: (N,), half the depth of each body, m.
        shoulder: (N,), half the length of the shoulder line, m, which lies across the heading; the outline is all
            within the radius of this line. 0 for a disc. Of a body that is longer than broad, such as of a wheelchair
            user, it is negative, and the line lies along the heading.
        activity_index: (N,) of int, into `relations.ACTIVITIES`.
        kind: (N,) of str, names of the kinds of persons.
        row: (N,) of int, index of each pedestrian in `scene.humans`; None: all pedestrians are present.
    """

    state: Array
    id: IntArray
    radius: Array
    shoulder: Array
    activity_index: IntArray
    kind: NDArray[np.str_]
    row: IntArray | None = None

    def select(self, rows: IntArray) -> Humans:
        """The pedestrians in some rows.

        Args:
            rows: (n,) of int, ascending.

        Returns:
            The n pedestrians, with `row` set; this object itself if all rows are selected.
        """
        if len(rows) == len(self):
            return self
        constant = self.id[rows], self.radius[rows], self.shoulder[rows]
        columns: Any = self.state[rows], *constant, self.activity_index[rows], self.kind[rows], np.asarray(rows)
        for column in columns:
            column.flags.writeable = False
        return Humans(*columns)

    def expand(self, values: NDArray[Any], count: int, fill: float) -> Any:
        """Rows of the pedestrians that are present, expanded to rows of all pedestrians of the scene.

        Args:
            values: (N, ...), one row per pedestrian that is present.
            count: number of pedestrians in the scene.
            fill: value in the rows of absent pedestrians.

        Returns:
            (count, ...), a new array of the same dtype.
        """
        if self.row is None:
            return values.copy()
        rows = np.full((count, *values.shape[1:]), fill, dtype=values.dtype)
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
        """(N, 2), unit vectors of the bodies' headings."""
        return self.state[:, BODY_X : BODY_Y + 1]

    @property
    def gaze(self) -> Array:
        """(N, 2), unit vectors of the gaze, the direction in which the head points."""
        return self.state[:, GAZE_X : GAZE_Y + 1]

    @property
    def omega(self) -> Array:
        """(N,), turn rates of the bodies, rad/s."""
        return self.state[:, OMEGA]

    @cached_property
    def theta(self) -> Array:
        """(N,), headings of the bodies, rad."""
        return arctan2(self.state[:, BODY_Y], self.state[:, BODY_X])

    @cached_property
    def head(self) -> Array:
        """(N,), angles of the gaze, rad, world frame."""
        return arctan2(self.state[:, GAZE_Y], self.state[:, GAZE_X])

    def __repr__(self) -> str:
        return f"<Humans: {counted(len(self), 'person')}>"

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
            breadth=2.0 * float(self.radius[index] + max(self.shoulder[index], 0.0)),
            activity=ACTIVITIES[int(self.activity_index[index])],
            length=2.0 * float(self.radius[index] - self.shoulder[index]) if self.shoulder[index] < 0.0 else 0.0,
            kind=str(self.kind[index]),
        )

    def __iter__(self) -> Iterator[HumanState]:
        return (self[index] for index in range(len(self)))


def frozen(array: Values) -> Values:
    """The array itself, made read-only."""
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False, slots=True)
class HumanTable:
    """Table of the humans of a scene: one row each in the scene's order; read-only arrays.

    Attributes:
        id: (N,) of int.
        position: (N, 2), m, at the start or on entering, world frame.
        radius: (N,), m, half the depth of the bodies.
        shoulder: (N,), m, half the length of the shoulder lines; see `Humans.shoulder`.
        circumradius: (N,), m, of the circles around the bodies.
        desired_speed: (N,), m/s.
        kind: (N,) of str.
        row: index of the row of each id.
    """

    id: IntArray
    position: Array
    radius: Array
    shoulder: Array
    circumradius: Array
    desired_speed: Array
    kind: NDArray[np.str_]
    row: dict[int, int]

    @classmethod
    def of(cls, humans: Sequence[Human]) -> Self:
        """The table of some humans."""
        numbers = [(h.radius, h.shoulder, h.shape.circumradius, h.desired_speed, *h.pose.position) for h in humans]
        table = np.array(numbers, dtype=float).reshape(-1, 6)
        names = ("radius", "shoulder", "circumradius", "desired_speed")
        columns: Any = {name: frozen(table[:, k].copy()) for k, name in enumerate(names)}
        ids = [human.id for human in humans]
        return cls(
            id=frozen(np.array(ids, dtype=np.int64)),
            position=frozen(table[:, 4:].copy()),
            kind=frozen(np.array([human.kind for human in humans], dtype=np.str_)),
            row={id: k for k, id in enumerate(ids)},
            **columns,
        )

    def with_state(self, state: Array, activity: IntArray) -> Humans:
        """The humans in a state, (N, 9), with activities, (N,) of int; the arrays are not copied."""
        return Humans(state, self.id, self.radius, self.shoulder, activity, self.kind)


def activities_of_present(activity: IntArray, ids: IntArray, interactions: Iterable[Interaction]) -> IntArray:
    """Activities while some pedestrians are absent: those without a present partner stand or walk alone.

    Args:
        activity: (N,) of int, into `ACTIVITIES`, if all were present.
        ids: (N,) of int.
        interactions: those between pedestrians that are present.

    Returns:
        (N,) of int, into `ACTIVITIES`, read-only.
    """
    partners = {id for interaction in interactions for id in (interaction.src, interaction.dst)}
    is_alone = np.array([id not in partners for id in ids.tolist()], dtype=bool)
    return frozen(np.where(is_alone, ACTIVITY_ALONE[activity], activity))


def activity_indices(alone: Mapping[int, str], interactions: Iterable[Interaction]) -> IntArray:
    """Activities by interaction.

    Args:
        alone: activities of the pedestrians if they had no interaction, by id; in the order of the result. Members of
            a walking group have it while they do not walk.
        interactions: their current interactions.

    Returns:
        (N,) of int, into `ACTIVITIES`, read-only.
    """
    activity = dict(alone)
    for interaction in interactions:
        for id in (interaction.src, interaction.dst):
            # an object has no activity, and a group that pauses does not walk
            relation = RELATION[interaction.relation]
            if id in alone and (relation.group != "walking" or alone[id] == "walking"):
                activity[id] = relation.activity
    return frozen(np.array([ACTIVITIES.index(name) for name in activity.values()], dtype=np.int64))
