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

from ..core.attributes import Holder
from ..core.compiled.packing import Ints
from ..core.floats import FloatFields
from ..core.furniture_types import OBJECT_TYPES
from ..core.geometry import Barriers, inside_rings
from ..core.person_kinds import BUILT_IN as PERSONS
from ..core.portable_math import Array, unit_vector
from ..core.relations import ACTIVITIES, RELATIONS
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import ConfigError
from ..registry import OBSERVATION_PARTS

ATTRIBUTE_PARTS: dict[Holder, tuple[str, str]] = {  # name of the part, and its rows; see `register_attribute_parts`
    "people": ("human_attributes", "humans"),
    "objects": ("object_attributes", "objects"),
    "areas": ("area_attributes", ""),
    "episode": ("episode_attributes", ""),
}
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
    """

    humans: Ints
    objects: Ints
    walls: Ints


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
        """Write the values; those of the parts in `STANDARD` are written by one kernel (`sight.py`) instead.

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


class Goal(SnapshotPart):
    """Position, direction of the goal's heading, and the distance and the angle (rad) at which it is reached."""

    name, about = "goal", frozenset({"goal"})
    columns = (*point(), *direction(), Column("distance", "m", FARTHEST), Column("angle", "rad", math.pi + 0.01))


class Humans(SnapshotPart):
    """Position, velocity over the ground, directions of body and gaze, turn rate, radius, half the shoulder line."""

    name, about, rows_of = "humans", frozenset({"humans"}), "humans"
    columns = (
        *point(), *velocity(), *direction(), *direction("gaze_cos", "gaze_sin"),
        Column("omega", "rad/s", FASTEST_TURN, -FASTEST_TURN), Column("radius", "m", FARTHEST),
        Column("shoulder", "m", FARTHEST, -FARTHEST),
    )  # fmt: skip


class Activities(SnapshotPart):
    """Activity of each pedestrian."""

    name, about, rows_of = "activities", frozenset({"humans"}), "humans"
    columns = (Column("activity", values=ACTIVITIES),)


class Objects(SnapshotPart):
    """Position, direction, size, and whether it is a disc, whose diameter is both length and width."""

    name, about, rows_of = "objects", frozenset({"objects"}), "objects"
    columns = (
        *point(), *direction(), Column("length", "m", FARTHEST), Column("width", "m", FARTHEST), Column("is_disc"),
    )  # fmt: skip


class ObjectTypes(SnapshotPart):
    """Type of each piece of furniture."""

    name, about, rows_of = "object_types", frozenset({"objects"}), "objects"
    columns = (Column("type", values=OBJECT_TYPES),)


class Walls(SnapshotPart):
    """Both ends; a wall ends where it is 100 m ahead, behind or aside."""

    name, about, rows_of = "walls", frozenset({"walls"}), "walls"
    columns = (*point("start_x", "start_y"), *point("end_x", "end_y"))


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


STANDARD: tuple[type[SnapshotPart], ...] = (
    Robot, Goal, Humans, Objects, Walls, Activities, ObjectTypes, Interactions,
)  # fmt: skip
"""The parts of every observation."""


class HumanKinds(SnapshotPart):
    """Kind of each pedestrian; kinds of plug-ins are `other`."""

    name, about, rows_of = "human_kinds", frozenset({"humans"}), "humans"
    columns = (Column("kind", values=(*(kind.name for kind in PERSONS), "other")),)

    def begin(self, scene: Scene) -> None:
        names = self.columns[0].values
        self._kinds = [names.index(human.kind if human.kind in names else "other") for human in scene.humans]

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        for n, k in enumerate(rows.humans.tolist()):
            if k >= 0:
                out[n] = self._kinds[k]


class AreaRules(SnapshotPart):
    """Nearest no-go area and nearest area with a speed limit, 100 m if there is none; the rules at the robot's centre.

    The position of an area is that of its nearest point, which is the robot's centre, at a distance of 0, inside. Where
    there is no limit, the speed is 20 m/s; where every direction is allowed, `way_cos` and `way_sin` are 0.
    """

    name, about = "area_rules", frozenset({"robot"})
    columns = (
        *point("no_go_x", "no_go_y"), Column("no_go_distance", "m", FARTHEST),
        *point("limited_x", "limited_y"), Column("limited_distance", "m", FARTHEST),
        Column("limited_speed", "m/s", FASTEST), Column("speed_limit", "m/s", FASTEST),
        *direction("way_cos", "way_sin"),
    )  # fmt: skip

    def begin(self, scene: Scene) -> None:
        self._areas = [(area, Barriers.of(area.edges())) for area in scene.areas]

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        pose = snapshot.robot.pose
        centre, none = np.array([pose.position]), (0.0, 0.0, FARTHEST)
        no_go, limited, limited_speed, speed_limit, way = none, none, FASTEST, FASTEST, (0.0, 0.0)
        for area, edges in self._areas:
            is_inside = bool(inside_rings(centre, area.polygon, ())[0])
            dx, dy = (0.0, 0.0) if is_inside else _nearest(*edges.towards(centre))
            place = (*pose.to_local((pose.x + dx, pose.y + dy)), math.sqrt(dx * dx + dy * dy))
            if area.no_go and place[2] < no_go[2]:
                no_go = place
            if area.speed_limit is not None and place[2] < limited[2]:
                limited, limited_speed = place, area.speed_limit
            if area.speed_limit is not None and is_inside:
                speed_limit = min(speed_limit, area.speed_limit)
            if area.one_way is not None and is_inside:
                way = unit_vector(area.one_way - pose.theta)
        out[:] = (*no_go, *limited, limited_speed, speed_limit, *way)


def _nearest(x: Array, y: Array) -> tuple[float, float]:
    """The shortest of vectors; (M, 1) each."""
    k = int(np.argmin(x[:, 0] ** 2 + y[:, 0] ** 2))
    return float(x[k, 0]), float(y[k, 0])


OPTIONAL: tuple[type[ObservationPart], ...] = (HumanKinds, AreaRules)
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

    if name not in OBSERVATION_PARTS and name in (part for part, _ in ATTRIBUTE_PARTS.values()):
        raise ConfigError(
            f"no observation part is named {name!r}; parts with attributes exist after "
            "sonata2d.gym.register_attribute_parts(scenario), which returns their names"
        )
    part: type[ObservationPart] = OBSERVATION_PARTS.load(name, problem)
    return part


def table_of(part: type[ObservationPart], observation: Observation) -> Table:
    """The rows of a part that are not empty, or its vector."""
    if not part.rows_of:
        return Table(part, observation[part.name])
    rows = observation[part.name][observation[f"{part.rows_of}_mask"] > 0.0]
    return Table(part, rows.reshape(-1, len(part.columns)))
