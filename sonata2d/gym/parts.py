"""The parts of an observation, one class each: their columns, and the values of one snapshot.

A `SnapshotPart` is filled from a snapshot. A `DerivedPart` is computed from the rows of other parts, as they are after
noise and a limited field of view. Spaces, flat observations, policy files and the table in docs/gym.md follow from the
classes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.packing import Ints, Ints2
from ..core.compiled.scalar import clipped
from ..core.entities import Furniture
from ..core.floats import FloatFields
from ..core.furniture_types import OBJECT_TYPES
from ..core.geometry import Disc
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ..core.portable_math import Array, IntArray
from ..core.relations import ACTIVITIES, RELATIONS
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.state import HUMAN_SIZE, ROBOT_SIZE
from ..registry import OBSERVATION_PARTS, furniture_type

_ENTITIES = frozenset({"robot", "goal", "humans", "objects", "walls"})
Floats32 = NDArray[np.float32]
Observation = dict[str, NDArray[Any]]

FARTHEST, FASTEST, FASTEST_TURN = 100.0, 20.0, 20.0  # m, m/s, rad/s: bounds of the spaces, to which values are clipped


@dataclass(frozen=True, slots=True)
class Column(FloatFields):
    """A column of a part.

    Attributes:
        name: of the column.
        unit: SI unit; empty for a number without one.
        high, low: bounds of the values.
        axes: `point` or `vector` in two successive columns that hold the coordinates of a point, or the components of
            a vector, in the robot's frame: x ahead, y left. `WorldFrame` and `Noise` change these columns. Empty: the
            value is the same in every frame.
        values: the names of the values of a column of indices; empty for a column of floats.
    """

    name: str
    unit: str = ""
    high: float = 1.0
    low: float = 0.0
    axes: str = ""
    values: tuple[str, ...] = ()


def _pair(axes: str, names: tuple[str, str], unit: str, bound: float) -> tuple[Column, Column]:
    """The two columns of a point or a vector."""
    return Column(names[0], unit, bound, -bound, axes), Column(names[1], unit, bound, -bound, axes)


def point(x: str = "x", y: str = "y") -> tuple[Column, Column]:
    """The columns of a point, m."""
    return _pair("point", (x, y), "m", FARTHEST)


def velocity(x: str = "vx", y: str = "vy") -> tuple[Column, Column]:
    """The columns of a velocity, m/s."""
    return _pair("vector", (x, y), "m/s", FASTEST)


def direction(cos: str = "cos", sin: str = "sin") -> tuple[Column, Column]:
    """The columns of a unit vector."""
    return _pair("vector", (cos, sin), "", 1.0)


class Rows(NamedTuple):
    """The entities that have rows in an observation.

    Args:
        humans, objects, walls: (H,), (M,), (W,), index in the scene of the entity in each row; -1: none.
        interactions: (I, 3), row of the pedestrian, relation (into `RELATIONS`), row of the other entity: pedestrians
            from 0, objects from H; 0 in rows without an interaction.
    """

    humans: Ints
    objects: Ints
    walls: Ints
    interactions: Ints2


class ObservationPart:
    """Base class of the parts of an observation: a vector, or a table with one row for each entity of a kind.

    Subclass `SnapshotPart` or `DerivedPart`.

    Attributes:
        name: key of the array in the observation.
        version: changes with the meaning of a column; files of policies record it.
        columns: of the array.
        about: the entities on which the values depend: `robot`, `goal`, `humans`, `objects` or `walls`.
        rows_of: `humans`, `objects`, `walls` or `interactions`: the part is a table with one row for each of these, and
            the array `<rows_of>_mask` is 1 for rows that are not empty; an empty text: the part is a vector.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]]
    about: ClassVar[frozenset[str]]
    rows_of: ClassVar[str] = ""

    @classmethod
    def space(cls, sizes: Mapping[str, int]) -> spaces.Space[Any]:
        """The space of the array, for the numbers of rows of each kind of entity."""
        if values := cls.columns[0].values:
            return spaces.MultiDiscrete([len(values)] * sizes[cls.rows_of])
        low, high = (bounds.astype(np.float32) for bounds in cls.bounds())
        if cls.rows_of:
            low, high = (np.tile(bounds, (sizes[cls.rows_of], 1)) for bounds in (low, high))
        return spaces.Box(low, high, dtype=np.float32)

    @classmethod
    @cache
    def bounds(cls) -> tuple[Array, Array]:
        """Lowest and highest values of the columns."""
        return np.array([column.low for column in cls.columns]), np.array([column.high for column in cls.columns])

    @classmethod
    @cache
    def pairs(cls) -> list[tuple[int, Column]]:
        """Points and vectors: index of the first of their two columns, and this column."""
        places = [k for k, column in enumerate(cls.columns) if column.axes]
        return [(k, cls.columns[k]) for k in places[::2]]

    @classmethod
    def record(cls) -> dict[str, Any]:
        """Version and columns as plain data, for files of policies."""
        names = [" ".join(filter(None, (column.name, column.unit, *column.values))) for column in cls.columns]
        return {"version": cls.version, "columns": names}


class SnapshotPart(ObservationPart):
    """Base class of parts that are filled from a snapshot.

    A vector depends on robot, goal and walls only, which are never hidden. In a table about pedestrians, furniture or
    interactions, a row depends on its own entity only, so that a limited field of view can clear it.

    Raises:
        TypeError: a subclass is about other entities; derive its values from their rows in a `DerivedPart`.
    """

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        entities = {"humans", "objects"} if cls.rows_of == "interactions" else {cls.rows_of}
        if hidden := sorted(getattr(cls, "about", frozenset()) - {"robot", "goal", "walls", *entities}):
            raise TypeError(
                f"the observation part {cls.__name__} tells of {hidden[0]} from a snapshot, which has hidden ones too; "
                f"derive it from their rows in a DerivedPart, or make it a table with rows_of = {hidden[0]!r}"
            )

    def begin(self, scene: Scene) -> None:
        """Begin an episode; for values that stay the same in it."""

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        """Write the values.

        Args:
            snapshot: of the scene given to `begin`.
            rows: the entities that have rows.
            out: the array, of zeros; rows without an entity stay 0.
        """
        raise NotImplementedError


class DerivedPart(ObservationPart):
    """Base class of vectors that are computed from the rows of other parts, and so depend on observed entities only.

    >>> class Crowding(DerivedPart):
    ...     name, about, columns = "crowding", frozenset({"humans"}), (Column("count", "", 100.0),)
    ...
    ...     def derive(self, tables):
    ...         return [len(tables["humans"])]
    >>> Crowding.space({})
    Box(0.0, 100.0, (1,), float32)
    """

    @classmethod
    @cache
    def sources(cls) -> tuple[type[SnapshotPart], ...]:
        """The parts in `STANDARD` that are about no other entities than this part."""
        return tuple(part for part in STANDARD if part.about <= cls.about)

    def derive(self, tables: Mapping[str, Table]) -> Sequence[float]:
        """Compute the values.

        Args:
            tables: the parts in `sources` by name, in the robot's frame, without their empty rows.

        Returns:
            A number for each column, which is clipped to its bounds.
        """
        raise NotImplementedError


class Table:
    """Rows of a part, or its only one, with columns by name.

    Args:
        part: whose columns they are.
        rows: (..., number of columns).

    >>> Table(Goal, np.arange(6.0))["distance"].tolist()
    4.0
    """

    def __init__(self, part: type[ObservationPart], rows: NDArray[Any]) -> None:
        self.rows, self._index = rows, {column.name: k for k, column in enumerate(part.columns)}

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The values of a column."""
        return self.rows[..., self._index[name]]

    def columns(self, *names: str) -> dict[str, NDArray[Any]]:
        """The values of columns by name."""
        return {name: self[name] for name in names}


def places(part: type[ObservationPart], *names: str) -> tuple[int, ...]:
    """Indices of columns."""
    known = [column.name for column in part.columns]
    return tuple(known.index(name) for name in names)


class Robot(SnapshotPart):
    """Velocity over the ground, turn rate, radius, and the fraction of the time limit that is over."""

    name, about = "robot", frozenset({"robot"})
    columns = (
        *velocity(), Column("omega", "rad/s", FASTEST_TURN, -FASTEST_TURN), Column("radius", "m", FARTHEST),
        Column("time"),
    )  # fmt: skip

    def begin(self, scene: Scene) -> None:
        self._radius, self._time_limit = scene.robot.radius, scene.rules.time_limit

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _fill_robot(snapshot.state.row, self._radius, min(snapshot.time / self._time_limit, 1.0), out)


class Goal(SnapshotPart):
    """Position, direction of the goal's heading, and the distance and the angle (rad) at which it is reached."""

    name, about = "goal", frozenset({"goal"})
    columns = (*point(), *direction(), Column("distance", "m", FARTHEST), Column("angle", "rad", math.pi + 0.01))

    def begin(self, scene: Scene) -> None:
        goal = scene.goal
        heading = (math.cos(goal.theta), math.sin(goal.theta))
        self._row = np.array([goal.x, goal.y, *heading, min(goal.distance, FARTHEST), goal.angle])

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _fill_goal(snapshot.state.row, self._row, out)


class Humans(SnapshotPart):
    """Position, velocity over the ground, directions of body and gaze, turn rate, radius, half the shoulder line."""

    name, about, rows_of = "humans", frozenset({"humans"}), "humans"
    columns = (
        *point(), *velocity(), *direction(), *direction("gaze_cos", "gaze_sin"),
        Column("omega", "rad/s", FASTEST_TURN, -FASTEST_TURN), Column("radius", "m", FARTHEST),
        Column("shoulder", "m", FARTHEST),
    )  # fmt: skip

    def begin(self, scene: Scene) -> None:
        bodies = [(human.radius, human.shoulder) for human in scene.humans]
        self._bodies = np.array(bodies, dtype=float).reshape(-1, 2)

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _fill_humans(snapshot.state.row, self._bodies, rows.humans, out)


class Activities(SnapshotPart):
    """Activity of each pedestrian."""

    name, about, rows_of = "activities", frozenset({"humans"}), "humans"
    columns = (Column("activity", values=ACTIVITIES),)

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _pick(snapshot.state.activity, rows.humans, out)


class Objects(SnapshotPart):
    """Position, direction, size, and whether it is a disc, whose diameter is both length and width."""

    name, about, rows_of = "objects", frozenset({"objects"}), "objects"
    columns = (
        *point(), *direction(), Column("length", "m", FARTHEST), Column("width", "m", FARTHEST), Column("is_disc"),
    )  # fmt: skip

    def begin(self, scene: Scene) -> None:
        rows = [_object_row(piece) for piece in scene.furniture]
        self._objects = np.array(rows, dtype=float).reshape(-1, len(self.columns))

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _fill_objects(snapshot.state.row, self._objects, rows.objects, out)


class ObjectTypes(SnapshotPart):
    """Type of each piece of furniture."""

    name, about, rows_of = "object_types", frozenset({"objects"}), "objects"
    columns = (Column("type", values=OBJECT_TYPES),)

    def begin(self, scene: Scene) -> None:
        self._types = np.array([furniture_type(piece.type).number for piece in scene.furniture], dtype=np.int64)

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _pick(self._types, rows.objects, out)


class Walls(SnapshotPart):
    """Both ends; a wall ends where it is 100 m ahead, behind or aside."""

    name, about, rows_of = "walls", frozenset({"walls"}), "walls"
    columns = (*point("start_x", "start_y"), *point("end_x", "end_y"))

    def begin(self, scene: Scene) -> None:
        self._walls = wall_ends(scene)

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        _fill_walls(snapshot.state.row, self._walls, rows.walls, out)


class Interactions(SnapshotPart):
    """Row of the pedestrian, relation, row of the other entity: pedestrians from 0, objects from H."""

    name, about, rows_of = "interactions", frozenset({"humans", "objects"}), "interactions"
    columns = (Column("source"), Column("relation", values=RELATIONS), Column("destination"))

    @classmethod
    def space(cls, sizes: Mapping[str, int]) -> spaces.Space[Any]:
        ends = sizes["humans"] + sizes["objects"] - 1
        high = np.array([max(sizes["humans"] - 1, 1), len(RELATIONS) - 1, ends], dtype=np.int64)
        high = np.tile(high, (sizes["interactions"], 1))
        return spaces.Box(np.zeros_like(high), high, dtype=np.int64)

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        out[:] = rows.interactions


STANDARD: tuple[type[SnapshotPart], ...] = (
    Robot, Goal, Humans, Objects, Walls, Activities, ObjectTypes, Interactions,
)  # fmt: skip
"""The parts of every observation."""

OPTIONAL: tuple[type[ObservationPart], ...] = ()
"""The other built-in parts, which an environment has if its argument `parts` names them."""

OBSERVATION_PARTS.built_in |= {part.name: f"{__name__}:{part.__name__}" for part in (*STANDARD, *OPTIONAL)}


def part_named(name: str) -> type[ObservationPart]:
    """A part by name.

    Raises:
        ConfigError: no part has the name, or the registered object is not a part of this name.
    """

    def problem(part: object) -> str | None:
        if not (isinstance(part, type) and issubclass(part, SnapshotPart | DerivedPart)):
            return "is not a class derived from SnapshotPart or DerivedPart"
        if missing := [field for field in ("name", "columns", "about") if not hasattr(part, field)]:
            return f"lacks {', '.join(missing)}"
        if unknown := sorted(part.about - _ENTITIES):
            return f"is about {unknown[0]!r}; the entities are {', '.join(sorted(_ENTITIES))}"
        return None if part.name == name else f"has the name {part.name!r}; use one name"

    part: type[ObservationPart] = OBSERVATION_PARTS.load(name, problem)
    return part


def table_of(part: type[ObservationPart], observation: Observation) -> Table:
    """The rows of a part that are not empty, or its vector."""
    if not part.rows_of:
        return Table(part, observation[part.name])
    rows = observation[part.name][observation[f"{part.rows_of}_mask"] > 0.0]
    return Table(part, rows.reshape(-1, len(part.columns)))


def _object_row(piece: Furniture) -> tuple[float, ...]:
    """Columns of `Objects`, world frame."""
    shape, pose, is_disc = piece.shape, piece.pose, isinstance(piece.shape, Disc)
    length, width = shape.sides
    return *pose.position, *pose.direction, min(length, FARTHEST), min(width, FARTHEST), float(is_disc)


def wall_ends(scene: Scene) -> Array:
    """Columns of `Walls`, world frame; (W, 4)."""
    return np.array([(*wall.start, *wall.end) for wall in scene.walls], dtype=float).reshape(-1, 4)


# First columns of the vectors, and the other columns, by part.
_VELOCITY, _TURN_RATE, _ROBOT_RADIUS, _TIME = places(Robot, "vx", "omega", "radius", "time")
_GOAL_POINT, _GOAL_HEADING, _DISTANCE, _ANGLE = places(Goal, "x", "cos", "distance", "angle")
_HUMAN_POINT, _HUMAN_VELOCITY, _BODY, _GAZE, _HUMAN_OMEGA, _RADIUS, _SHOULDER = places(
    Humans, "x", "vx", "cos", "gaze_cos", "omega", "radius", "shoulder"
)
_OBJECT_POINT, _OBJECT_DIRECTION, _LENGTH = places(Objects, "x", "cos", "length")
_START, _END = places(Walls, "start_x", "end_x")

# The kernels take the `row` of a `State`, which begins with the robot's pose.


@kernel
def _fill_robot(row: Array, radius: float, time: float, out: Floats32) -> None:
    _put_vector(out, _VELOCITY, row[VX], row[VY], row, FASTEST)
    out[_TURN_RATE] = clipped(row[OMEGA], -FASTEST_TURN, FASTEST_TURN)
    out[_ROBOT_RADIUS], out[_TIME] = radius, time


@kernel
def _fill_goal(row: Array, goal: Array, out: Floats32) -> None:
    _put_point(out, _GOAL_POINT, goal[_GOAL_POINT], goal[_GOAL_POINT + 1], row)
    _put_vector(out, _GOAL_HEADING, goal[_GOAL_HEADING], goal[_GOAL_HEADING + 1], row, 1.0)
    out[_DISTANCE], out[_ANGLE] = goal[_DISTANCE], goal[_ANGLE]


@kernel
def _fill_humans(row: Array, bodies: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        k = index[n]
        if k < 0:
            continue
        human, target = row[ROBOT_SIZE + HUMAN_SIZE * k : ROBOT_SIZE + HUMAN_SIZE * (k + 1)], out[n]
        _put_point(target, _HUMAN_POINT, human[X], human[Y], row)
        _put_vector(target, _HUMAN_VELOCITY, human[VX], human[VY], row, FASTEST)
        _put_vector(target, _BODY, human[BODY_X], human[BODY_Y], row, 1.0)
        _put_vector(target, _GAZE, human[GAZE_X], human[GAZE_Y], row, 1.0)
        target[_HUMAN_OMEGA] = clipped(human[OMEGA], -FASTEST_TURN, FASTEST_TURN)
        target[_RADIUS], target[_SHOULDER] = bodies[k, 0], bodies[k, 1]


@kernel
def _fill_objects(row: Array, objects: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        if index[n] < 0:
            continue
        piece, target = objects[index[n]], out[n]
        _put_point(target, _OBJECT_POINT, piece[_OBJECT_POINT], piece[_OBJECT_POINT + 1], row)
        _put_vector(target, _OBJECT_DIRECTION, piece[_OBJECT_DIRECTION], piece[_OBJECT_DIRECTION + 1], row, 1.0)
        for column in range(_LENGTH, len(piece)):
            target[column] = piece[column]


@kernel
def _fill_walls(row: Array, walls: Array, index: IntArray, out: Floats32) -> None:
    for n in range(len(index)):
        if index[n] >= 0:
            put_wall(out[n], walls[index[n]], row)


@kernel
def _pick(values: IntArray, index: IntArray, out: IntArray) -> None:
    """Write the value of the entity of each row."""
    for n in range(len(index)):
        if index[n] >= 0:
            out[n] = values[index[n]]


@subroutine
def _put_point(out: Floats32, at: int, x: float, y: float, row: Array) -> None:
    """Write a point in the robot's frame, m."""
    _put_vector(out, at, x - row[X], y - row[Y], row, FARTHEST)


@subroutine
def _put_vector(out: Floats32, at: int, x: float, y: float, row: Array, limit: float) -> None:
    """Write a vector along the robot's axes, shortened so that no component exceeds a limit."""
    ahead, left = x * row[BODY_X] + y * row[BODY_Y], y * row[BODY_X] - x * row[BODY_Y]
    factor = limit / max(abs(ahead), abs(left), limit)
    out[at], out[at + 1] = clipped(ahead * factor, -limit, limit), clipped(left * factor, -limit, limit)


@subroutine
def put_wall(out: Floats32, wall: Array, row: Array) -> bool:
    """Write the part of a wall whose coordinates in the robot's frame do not exceed `FARTHEST`; False if all do.

    Source: Y.-D. Liang & B. Barsky, ACM Trans. Graph. 3 (1984) 1: clipping of lines.
    """
    x, y, c, s = row[X], row[Y], row[BODY_X], row[BODY_Y]
    start_x, start_y = (wall[0] - x) * c + (wall[1] - y) * s, (wall[1] - y) * c - (wall[0] - x) * s
    dx, dy = (wall[2] - x) * c + (wall[3] - y) * s - start_x, (wall[3] - y) * c - (wall[2] - x) * s - start_y
    first, last = 0.0, 1.0
    for start, change in ((start_x, dx), (start_y, dy)):
        for side in (-1.0, 1.0):
            room, approach = FARTHEST - side * start, side * change
            if approach == 0.0:
                if room < 0.0:
                    return False
            elif approach > 0.0:
                last = min(last, room / approach)
            else:
                first = max(first, room / approach)
    if first > last:
        return False
    for at, part in ((_START, first), (_END, last)):
        out[at] = clipped(start_x + part * dx, -FARTHEST, FARTHEST)
        out[at + 1] = clipped(start_y + part * dy, -FARTHEST, FARTHEST)
    return True
