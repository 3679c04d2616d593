"""Observations of a snapshot as arrays of constant shape, in the robot's frame."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.packing import Floats, Floats2, Ints, Packed, unpack
from ..core.compiled.scalar import clipped, length, to_line
from ..core.entities import Furniture, Interaction
from ..core.furniture_types import OBJECT_TYPES
from ..core.geometry import Disc
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.relations import ACTIVITIES, RELATIONS
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.state import HUMAN_SIZE, ROBOT_SIZE
from ..registry import furniture_type
from ..scenegen.floor_plans import draw_floor_plan
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.sections import RoomConfig

Floats32 = NDArray[np.float32]
Observation = dict[str, NDArray[Any]]
Order = Literal["nearest", "scene"]

FARTHEST, FASTEST, FASTEST_TURN = 100.0, 20.0, 20.0  # m, m/s, rad/s: bounds of the spaces, to which values are clipped
_VISITORS = 10  # additional rows of pedestrians in scenarios with doors through which pedestrians enter
_SAMPLES = 16  # floor plans of each kind of room that are drawn to count the walls of a scenario

# Columns of the float parts, with their bounds.
ROBOT = {
    "vx": FASTEST, "vy": FASTEST, "omega": FASTEST_TURN, "radius": FARTHEST, "time": 1.0,
}  # fmt: skip
GOAL = {"x": FARTHEST, "y": FARTHEST, "cos": 1.0, "sin": 1.0, "distance": FARTHEST, "angle": math.pi + 0.01}
HUMAN = {
    "x": FARTHEST, "y": FARTHEST, "vx": FASTEST, "vy": FASTEST, "cos": 1.0, "sin": 1.0, "gaze_cos": 1.0,
    "gaze_sin": 1.0, "omega": FASTEST_TURN, "radius": FARTHEST, "shoulder": FARTHEST,
}  # fmt: skip
OBJECT = {
    "x": FARTHEST, "y": FARTHEST, "cos": 1.0, "sin": 1.0, "length": FARTHEST, "width": FARTHEST, "is_disc": 1.0,
}  # fmt: skip
WALL = {"start_x": FARTHEST, "start_y": FARTHEST, "end_x": FARTHEST, "end_y": FARTHEST}
_HUMAN_COLUMNS, _OBJECT_COLUMNS, _WALL_COLUMNS = len(HUMAN), len(OBJECT), len(WALL)
_NEVER_NEGATIVE = ("radius", "time", "distance", "angle", "shoulder", "length", "width", "is_disc")


@dataclass(frozen=True)
class Sizes:
    """Numbers of rows of an observation; of more entities than rows, the nearest to the robot are observed.

    Attributes:
        humans, objects, walls, interactions: 1 or more.
    """

    humans: int
    objects: int
    walls: int
    interactions: int

    def __post_init__(self) -> None:
        for name, number in asdict(self).items():
            if not isinstance(number, int) or number < 1:
                raise ValueError(f"an observation needs 1 or more rows of {name}, got {number!r}")

    @classmethod
    def of(cls, config: ScenarioConfig) -> Sizes:
        """The largest numbers of entities in scenes of a scenario.

        Pedestrians who enter through doors have ten rows beside those of the people who are there at the start; there
        may be more of them.
        """
        drawn = (config.humans,) if config.humans is not None else (config.standing, config.wandering)
        pairs = config.talking_pairs.max + config.walking_pairs.max
        attending = config.at_laptop.max + config.at_plant.max + config.at_object.max
        humans = sum(count.max for count in drawn if count is not None) + 2 * pairs + _members(config)
        humans += attending + config.seated.max + len(config.people) + sum(queue.waiting.max for queue in config.queues)
        humans += _VISITORS if any(door.inflow > 0.0 for door in config.doors) else 0
        laptops = config.tables.max if config.laptops_on_tables else 0
        objects = sum(count.max for count in config.counts.values()) + laptops
        objects += 2 * attending + len(config.furniture)  # a laptop comes with a table
        group = config.groups.talking_size.max
        together = (
            config.talking_groups.max * group * group + config.walking_groups.max * config.groups.walking_size.max**2
        )
        return cls(max(humans, 1), max(objects, 1), _wall_count(config.room), max(2 * humans, together, 1))

    def changed(self, numbers: dict[str, int]) -> Sizes:
        """Other numbers for some of the entities.

        Raises:
            ValueError: a name is unknown, or a number is below 1.
        """
        for name in numbers:
            if name not in asdict(self):
                raise ValueError(f"an observation has no rows of {name!r}; give {', '.join(asdict(self))}")
        return replace(self, **numbers)


def _wall_count(room: RoomConfig) -> int:
    """The largest number of walls of floor plans drawn from each kind of room that is possible."""
    kinds = [None] if room.polygon is not None else [kind for kind, weight in room.kinds.items() if weight > 0.0]
    rooms = [room if kind is None else room.model_copy(update={"kinds": {kind: 1.0}}) for kind in kinds]
    return max(len(draw_floor_plan(one, RandomStream(k, 0, "scene")).walls) for one in rooms for k in range(_SAMPLES))


def _members(config: ScenarioConfig) -> int:
    """The largest number of members of all groups of a scenario together."""
    groups = config.groups
    return config.talking_groups.max * groups.talking_size.max + config.walking_groups.max * groups.walking_size.max


def observation_space(sizes: Sizes) -> spaces.Dict:
    """The space of the observations of an `Encoder`."""
    one = np.float32(1.0)
    tables = {"humans": (HUMAN, sizes.humans), "objects": (OBJECT, sizes.objects), "walls": (WALL, sizes.walls)}
    parts: dict[str, spaces.Space[Any]] = {"robot": _box(ROBOT), "goal": _box(GOAL)}
    for name, (columns, rows) in tables.items():
        parts[name] = _box(columns, rows)
        parts[f"{name}_mask"] = spaces.Box(np.float32(0.0), one, (rows,), np.float32)
    ends = sizes.humans + sizes.objects - 1
    high = np.tile(
        np.array([max(sizes.humans - 1, 1), len(RELATIONS) - 1, ends], dtype=np.int64), (sizes.interactions, 1)
    )
    parts["activities"] = spaces.MultiDiscrete([len(ACTIVITIES)] * sizes.humans)
    parts["object_types"] = spaces.MultiDiscrete([len(OBJECT_TYPES)] * sizes.objects)
    parts["interactions"] = spaces.Box(np.zeros_like(high), high, dtype=np.int64)
    parts["interactions_mask"] = spaces.Box(np.float32(0.0), one, (sizes.interactions,), np.float32)
    return spaces.Dict(parts)


def _box(columns: dict[str, float], rows: int | None = None) -> spaces.Box:
    high = np.array(list(columns.values()), dtype=np.float32)
    low = np.where([name in _NEVER_NEGATIVE for name in columns], np.float32(0.0), -high)
    if rows is not None:
        high, low = np.tile(high, (rows, 1)), np.tile(low, (rows, 1))
    return spaces.Box(low, high, dtype=np.float32)


# The parts of an observation, and their indices in `_Fixed.begin`.
_PARTS = (
    "robot", "goal", "humans", "humans_mask", "objects", "objects_mask", "walls", "walls_mask", "interactions_mask",
    "activities", "object_types", "interactions",
)  # fmt: skip
_ROBOT, _GOAL, _HUMANS, _HUMANS_MASK, _OBJECTS, _OBJECTS_MASK, _WALLS, _WALLS_MASK, _LINKS_MASK, _ACTIVITIES, _TYPES, \
    _LINKS = range(12)  # fmt: skip


class _Fixed(NamedTuple):
    """What stays the same in an episode, for kernels.

    Attributes:
        bodies: (N, 2), radius and half the shoulder line of each pedestrian, m.
        objects: (M, 7), columns of `OBJECT`, world frame.
        object_types: (M,), into `furniture_types.OBJECT_TYPES`.
        walls: (K, 4), columns of `WALL`, world frame.
        begin: (12,), where each part begins, see `_PARTS`, among the floats or the integers.
        rows: (4,), numbers of rows as in `Sizes`.
        goal: (6,), columns of `GOAL`, world frame.
        robot_radius: m.
        time_limit: s.
        is_sorted: whether the nearest entities come first.
    """

    bodies: Floats2
    objects: Floats2
    object_types: Floats
    walls: Floats2
    begin: Ints
    rows: Ints
    goal: Floats
    robot_radius: float
    time_limit: float
    is_sorted: bool


class Encoder:
    """Writes snapshots as observations.

    Args:
        sizes: numbers of rows.
        order: of the rows of pedestrians, objects and walls: the nearest to the robot first, or as in the scene. In the
            order of the scene each entity keeps its row if all of the scene fit; that of an absent pedestrian is empty.

    Attributes:
        space: of the observations.
        human_rows: (H,), index in the scene of the pedestrian in each row of the last observation; -1: none.
    """

    def __init__(self, sizes: Sizes, order: Order = "nearest") -> None:
        if order not in ("nearest", "scene"):
            raise ValueError(f"order must be 'nearest' or 'scene', got {order!r}")
        self.sizes, self.order, self.space = sizes, order, observation_space(sizes)
        floats = [name for name, part in self.space.items() if part.dtype == np.float32]
        self._floats, self._float_size = _parts(self.space, floats)
        self._ints, self._int_size = _parts(self.space, [name for name in self.space if name not in floats])
        places = {name: part.start for name, (part, _) in (self._floats | self._ints).items()}
        self._begin = np.array([places[name] for name in _PARTS], dtype=np.int64)
        self.human_rows = np.full(sizes.humans, -1)

    def reset(self, scene: Scene) -> None:
        """Begin an episode."""
        objects = scene.furniture
        goal = scene.goal
        ends = [(*wall.start, *wall.end) for wall in scene.walls]
        rows = [_object_row(piece) for piece in objects]
        types = [furniture_type(piece.type).number for piece in objects]
        bodies = [(human.radius, human.shoulder) for human in scene.humans]
        heading = (math.cos(goal.theta), math.sin(goal.theta))
        self._fixed = Packed(
            _Fixed(
                bodies=np.array(bodies, dtype=float).reshape(-1, 2),
                objects=np.array(rows, dtype=float).reshape(-1, len(OBJECT)),
                object_types=np.array(types, dtype=float),
                walls=np.array(ends, dtype=float).reshape(-1, 4),
                begin=self._begin,
                rows=np.array(list(asdict(self.sizes).values()), dtype=np.int64),
                goal=np.array([goal.x, goal.y, *heading, goal.distance, goal.angle]),
                robot_radius=scene.robot.radius,
                time_limit=scene.rules.time_limit,
                is_sorted=self.order == "nearest",
            )
        )
        self._everybody = np.ones(len(bodies), dtype=bool)
        self._index = {human.id: k for k, human in enumerate(scene.humans)}
        self._index |= {piece.id: len(bodies) + k for k, piece in enumerate(objects)}
        self._interactions: tuple[tuple[Interaction, ...], IntArray] | None = None

    def encode(self, snapshot: Snapshot) -> Observation:
        """The observation of a snapshot of the scene given to `reset`."""
        floats = np.empty(self._float_size, dtype=np.float32)
        ints = np.empty(self._int_size, dtype=np.int64)
        state = snapshot.state
        is_present = self._everybody if state.is_present is None else state.is_present
        fill(
            self._fixed.argument, state.row, state.activity, is_present, self._interaction_rows(snapshot),
            snapshot.time, floats, ints, self.human_rows,
        )  # fmt: skip
        parts = {name: floats[part].reshape(shape) for name, (part, shape) in self._floats.items()}
        return parts | {name: ints[part].reshape(shape) for name, (part, shape) in self._ints.items()}

    def _interaction_rows(self, snapshot: Snapshot) -> IntArray:
        """Source, relation and destination of each interaction, (K, 3): indices of entities, pedestrians first."""
        known = self._interactions
        if known is None or known[0] is not snapshot.interactions:
            index = self._index
            rows = [(index[i.src], RELATIONS.index(i.relation), index[i.dst]) for i in snapshot.interactions]
            known = self._interactions = snapshot.interactions, np.array(rows, dtype=np.int64).reshape(-1, 3)
        return known[1]


def _parts(space: spaces.Dict, names: list[str]) -> tuple[dict[str, tuple[slice, tuple[int, ...]]], int]:
    """Slice and shape of some parts of a space in one array, and the size of this array."""
    parts, size = {}, 0
    for name in names:
        shape = space[name].shape
        assert shape is not None
        parts[name] = slice(size, size + math.prod(shape)), shape
        size += math.prod(shape)
    return parts, size


def _object_row(piece: Furniture) -> tuple[float, ...]:
    """Columns of `OBJECT` of a piece of furniture, world frame; a disc has its diameter as length and width."""
    shape, (x, y), (c, s) = piece.shape, piece.pose.position, piece.pose.direction
    if isinstance(shape, Disc):
        return x, y, c, s, 2.0 * shape.radius, 2.0 * shape.radius, 1.0
    return x, y, c, s, shape.length, shape.width, 0.0


# The three kinds of entities whose rows are filled.
_OF_HUMANS, _OF_OBJECTS, _OF_WALLS = range(3)


@kernel
def fill(
    packed_fixed: Any, row: Array, activity: IntArray, is_present: BoolArray, interactions: IntArray, time: float,
    floats: Floats32, ints: IntArray, human_rows: IntArray,
) -> None:  # fmt: skip
    """Write an observation.

    Args:
        packed_fixed: packed `_Fixed`.
        row, activity: of a `State`.
        is_present: (N,), pedestrians that are in the room.
        interactions: (K, 3), source, relation, destination; indices of entities, pedestrians first.
        time: s.
        floats, ints: are filled.
        human_rows: (H,), is filled with the index of the pedestrian in each row; -1: none.
    """
    fixed = unpack(packed_fixed, _Fixed)
    begin, rows = fixed.begin, fixed.rows
    humans, objects = len(fixed.bodies), len(fixed.objects)
    for k in range(len(floats)):
        floats[k] = 0.0
    for k in range(len(ints)):
        ints[k] = 0
    x, y, c, s = row[X], row[Y], row[BODY_X], row[BODY_Y]
    frame = (x, y, c, s)

    at = begin[_ROBOT]
    _put_vector(floats, at, row[VX], row[VY], frame, FASTEST)
    floats[at + 2] = clipped(row[OMEGA], -FASTEST_TURN, FASTEST_TURN)
    floats[at + 3], floats[at + 4] = fixed.robot_radius, min(time / fixed.time_limit, 1.0)
    at, goal = begin[_GOAL], fixed.goal
    _put_point(floats, at, goal[0], goal[1], frame)
    _put_vector(floats, at + 2, goal[2], goal[3], frame, 1.0)
    floats[at + 4], floats[at + 5] = min(goal[4], FARTHEST), goal[5]

    slot = np.full(humans + objects, -1, np.int64)  # row of each entity in the observation
    chosen, distance = np.empty(len(slot) + len(fixed.walls), np.int64), np.empty(len(slot) + len(fixed.walls))
    for n in range(len(human_rows)):
        human_rows[n] = -1
    count = 0
    keeps_rows = not fixed.is_sorted and humans <= rows[_OF_HUMANS]
    for k in range(humans):
        if keeps_rows:  # an absent pedestrian leaves its row empty
            chosen[k], count = k, k + 1
        elif is_present[k]:
            human = row[ROBOT_SIZE + HUMAN_SIZE * k : ROBOT_SIZE + HUMAN_SIZE * (k + 1)]
            count = _insert(chosen, distance, count, rows[_OF_HUMANS], k, length(human[X] - x, human[Y] - y))
    _arrange(chosen, count, fixed.is_sorted)
    for n in range(count):
        k = chosen[n]
        if not is_present[k]:
            continue
        human_rows[n], slot[k] = k, n
        human = row[ROBOT_SIZE + HUMAN_SIZE * k : ROBOT_SIZE + HUMAN_SIZE * (k + 1)]
        at = begin[_HUMANS] + _HUMAN_COLUMNS * n
        _put_point(floats, at, human[X], human[Y], frame)
        _put_vector(floats, at + 2, human[VX], human[VY], frame, FASTEST)
        _put_vector(floats, at + 4, human[BODY_X], human[BODY_Y], frame, 1.0)
        _put_vector(floats, at + 6, human[GAZE_X], human[GAZE_Y], frame, 1.0)
        floats[at + 8] = clipped(human[OMEGA], -FASTEST_TURN, FASTEST_TURN)
        floats[at + 9], floats[at + 10] = fixed.bodies[k, 0], fixed.bodies[k, 1]
        floats[begin[_HUMANS_MASK] + n], ints[begin[_ACTIVITIES] + n] = 1.0, activity[k]

    count = 0
    for k in range(objects):
        away = length(fixed.objects[k, 0] - x, fixed.objects[k, 1] - y)
        count = _insert(chosen, distance, count, rows[_OF_OBJECTS], k, away)
    _arrange(chosen, count, fixed.is_sorted)
    for n in range(count):
        k, at = chosen[n], begin[_OBJECTS] + _OBJECT_COLUMNS * n
        slot[humans + k] = rows[_OF_HUMANS] + n
        _put_point(floats, at, fixed.objects[k, 0], fixed.objects[k, 1], frame)
        _put_vector(floats, at + 2, fixed.objects[k, 2], fixed.objects[k, 3], frame, 1.0)
        for column in range(4, _OBJECT_COLUMNS):
            floats[at + column] = min(fixed.objects[k, column], FARTHEST)
        floats[begin[_OBJECTS_MASK] + n], ints[begin[_TYPES] + n] = 1.0, int(fixed.object_types[k])

    count = 0
    for k in range(len(fixed.walls)):
        wall = fixed.walls[k]
        along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
        square = max(along_x * along_x + along_y * along_y, 1e-12)
        to_x, to_y = to_line(x - wall[0], y - wall[1], along_x, along_y, 1.0 / square)
        count = _insert(chosen, distance, count, rows[_OF_WALLS], k, length(to_x, to_y))
    _arrange(chosen, count, fixed.is_sorted)
    filled = 0
    for n in range(count):
        if _put_wall(floats, begin[_WALLS] + _WALL_COLUMNS * filled, fixed.walls[chosen[n]], frame):
            floats[begin[_WALLS_MASK] + filled] = 1.0
            filled += 1

    count = 0
    for k in range(len(interactions)):
        source, destination = slot[interactions[k, 0]], slot[interactions[k, 2]]
        if source >= 0 and destination >= 0 and count < rows[3]:
            at = begin[_LINKS] + 3 * count
            ints[at], ints[at + 1], ints[at + 2] = source, interactions[k, 1], destination
            floats[begin[_LINKS_MASK] + count] = 1.0
            count += 1


@subroutine
def _insert(chosen: IntArray, distance: Array, count: int, limit: int, k: int, away: float) -> int:
    """Insert entity k at a distance, m, into the nearest `limit` ones, ordered by distance; returns their number."""
    if count == limit:
        if not away < distance[count - 1]:
            return count
        count -= 1
    n = count
    while n > 0 and away < distance[n - 1]:
        chosen[n], distance[n] = chosen[n - 1], distance[n - 1]
        n -= 1
    chosen[n], distance[n] = k, away
    return count + 1


@subroutine
def _arrange(chosen: IntArray, count: int, is_sorted: bool) -> None:
    """Put the first `count` entities into the order of the scene, unless they stay sorted by distance."""
    for n in range(1, 0 if is_sorted else count):
        k, m = chosen[n], n
        while m > 0 and chosen[m - 1] > k:
            chosen[m] = chosen[m - 1]
            m -= 1
        chosen[m] = k


@subroutine
def _put_point(floats: Floats32, at: int, x: float, y: float, frame: tuple[float, float, float, float]) -> None:
    """Write a point in the robot's frame, m."""
    _put_vector(floats, at, x - frame[0], y - frame[1], frame, FARTHEST)


@subroutine
def _put_vector(
    floats: Floats32, at: int, x: float, y: float, frame: tuple[float, float, float, float], limit: float
) -> None:
    """Write a vector along the robot's axes, shortened so that no component exceeds a limit."""
    ahead, left = x * frame[2] + y * frame[3], y * frame[2] - x * frame[3]
    factor = limit / max(abs(ahead), abs(left), limit)
    floats[at], floats[at + 1] = clipped(ahead * factor, -limit, limit), clipped(left * factor, -limit, limit)


@subroutine
def _put_wall(floats: Floats32, at: int, wall: Array, frame: tuple[float, float, float, float]) -> bool:
    """Write the part of a wall whose coordinates in the robot's frame do not exceed `FARTHEST`; False: there is none.

    Source: Y.-D. Liang & B. Barsky, ACM Trans. Graph. 3 (1984) 1: clipping of lines.
    """
    x, y, c, s = frame
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
    for k, part in ((0, first), (2, last)):
        floats[at + k] = clipped(start_x + part * dx, -FARTHEST, FARTHEST)
        floats[at + k + 1] = clipped(start_y + part * dy, -FARTHEST, FARTHEST)
    return True
