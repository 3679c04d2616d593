"""Observations of a snapshot as arrays of constant shape, in the robot's frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from gymnasium import spaces

from ..core.arguments import whole_number
from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.packing import Floats2, Packed, unpack
from ..core.compiled.scalar import length, to_line
from ..core.entities import Interaction
from ..core.files.limits import MAX_ROWS
from ..core.humans import X, Y
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.relations import RELATIONS
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.state import HUMAN_SIZE, ROBOT_SIZE, State
from ..core.wording import shown
from ..scenegen.floor_plans import draw_floor_plan
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.sections import RoomConfig
from .parts import (
    STANDARD,
    DerivedPart,
    Floats32,
    Observation,
    Rows,
    SnapshotPart,
    part_named,
    put_wall,
    table_of,
    wall_ends,
)

Order = Literal["nearest", "scene"]

_VISITORS = 10  # additional rows of pedestrians in scenarios with doors through which pedestrians enter
_SAMPLES = 16  # floor plans of each kind of room that are drawn to count the walls of a scenario


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
            object.__setattr__(self, name, whole_number(f"the number of rows of {name}", number, 1, MAX_ROWS))

    @classmethod
    def of(cls, config: ScenarioConfig) -> Sizes:
        """The largest numbers of entities in scenes of a scenario.

        Pedestrians who enter through doors have ten rows besides the rows of the pedestrians at the start; more of them
        may enter.
        """
        drawn = (config.humans,) if config.humans is not None else (config.standing, config.wandering)
        pairs = config.talking_pairs.max + config.walking_pairs.max
        attending = config.at_laptop.max + config.at_plant.max + config.at_object.max
        humans = sum(count.max for count in drawn if count is not None) + 2 * pairs
        talking, walking = config.groups.talking_size.max, config.groups.walking_size.max
        groups = ((config.talking_groups.max, talking), (config.walking_groups.max, walking))
        humans += sum(count * size for count, size in groups)
        humans += attending + config.seated.max + len(config.people) + sum(queue.waiting.max for queue in config.queues)
        humans += _VISITORS if any(door.inflow > 0.0 for door in config.doors) else 0
        laptops = config.tables.max if config.laptops_on_tables else 0
        objects = sum(count.max for count in config.counts.values()) + laptops
        objects += 2 * attending + len(config.furniture)  # a laptop comes with a table
        together = sum(count * size * size for count, size in groups)
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
    return max(
        len(draw_floor_plan(config, RandomStream(k, 0, "scene")).walls) for config in rooms for k in range(_SAMPLES)
    )


class _Scene(NamedTuple):
    """The constants of an episode, and the rows, for the kernel `_choose_rows`.

    Attributes:
        objects: (M, 2), positions, m, world frame.
        walls: (W, 4), ends, m, world frame.
        rows: the arrays that the kernel writes.
        is_sorted: whether the nearest entities come first.
    """

    objects: Floats2
    walls: Floats2
    rows: Rows
    is_sorted: bool


class Encoder:
    """Writes snapshots as observations.

    Args:
        sizes: numbers of rows.
        order: of the rows of pedestrians, objects and walls: the nearest to the robot first, or as in the scene. In the
            order of the scene each entity keeps its row if all of the scene fit; the row of an absent pedestrian is
            empty.
        parts: names of further parts.

    Raises:
        ConfigError: there is no such part.

    Attributes:
        parts: of the observations.
        space: of the observations.
        rows: the entities in the rows of the last observation.
        objects: (M, 2), centres of the furniture of the scene, m, world frame.
        walls: (W, 4), both ends of the walls of the scene, m, world frame.
    """

    def __init__(self, sizes: Sizes, order: Order = "nearest", parts: Iterable[str] = ()) -> None:
        if order not in ("nearest", "scene"):
            raise ValueError(f"order must be 'nearest' or 'scene', got {order!r}")
        classes = dict.fromkeys((*STANDARD, *(part_named(name) for name in parts)))
        self.sizes, self.order, self.parts = sizes, order, tuple(part() for part in classes)
        numbers = asdict(sizes)
        low, high = np.float32(0.0), np.float32(1.0)
        masks = {f"{kind}_mask": spaces.Box(low, high, (n,), np.float32) for kind, n in numbers.items()}
        self.space = spaces.Dict({part.name: part.space(numbers) for part in self.parts} | masks)
        self._filled = [part for part in self.parts if isinstance(part, SnapshotPart)]
        self._derived = [part for part in self.parts if isinstance(part, DerivedPart)]
        names = [*(part.name for part in self._filled), *masks]
        self._arrays = [(name, self.space[name].shape, self.space[name].dtype) for name in names]
        humans, objects, walls = (np.full(n, -1) for n in (sizes.humans, sizes.objects, sizes.walls))
        self.rows = Rows(humans, objects, walls, np.zeros((sizes.interactions, 3), dtype=np.int64))

    def reset(self, scene: Scene) -> None:
        """Begin an episode."""
        objects = np.array([piece.pose.position for piece in scene.furniture], dtype=float).reshape(-1, 2)
        self.objects, self.walls = objects, wall_ends(scene)
        self._scene = Packed(_Scene(self.objects, self.walls, self.rows, self.order == "nearest"))
        self._everybody = np.ones(len(scene.humans), dtype=bool)
        ids = [*(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)]
        self._index = {entity: k for k, entity in enumerate(ids)}
        self._interactions: tuple[tuple[Interaction, ...], IntArray] | None = None
        for part in self._filled:
            part.begin(scene)

    def encode(self, snapshot: Snapshot) -> Observation:
        """The observation of a snapshot of the scene given to `reset`."""
        observation: Observation = {name: np.zeros(shape, dtype) for name, shape, dtype in self._arrays}  # type: ignore[arg-type]
        state = snapshot.state
        _choose_rows(
            self._scene.argument, state.row, self.present(state),
            self._interaction_rows(snapshot), observation["humans_mask"], observation["objects_mask"],
            observation["walls_mask"], observation["interactions_mask"],
        )  # fmt: skip
        for part in self._filled:
            part.fill(snapshot, self.rows, observation[part.name])
        self.derive(observation)
        return observation

    def present(self, state: State) -> BoolArray:
        """Whether each pedestrian of the scene is in the room, (N,)."""
        return self._everybody if state.is_present is None else state.is_present

    def derive(self, observation: Observation) -> None:
        """Compute the derived parts of an observation from its rows, in place.

        Raises:
            ValueError: a part returns another number of values than it has columns, or nan.
        """
        for part in self._derived:
            tables = {source.name: table_of(source, observation) for source in part.sources()}
            values = np.asarray(part.derive(tables), dtype=float)
            if values.shape != (len(part.columns),) or np.isnan(values).any():
                raise ValueError(
                    f"the observation part {part.name!r} must return {len(part.columns)} numbers, got {shown(values)}"
                )
            observation[part.name] = np.clip(values, *part.bounds()).astype(np.float32)

    def hide(self, observation: Observation, human_is_seen: BoolArray, object_is_seen: BoolArray) -> None:
        """Clear the rows of hidden entities and of their interactions in all parts of an observation, in place.

        Args:
            observation: of `encode`.
            human_is_seen, object_is_seen: (H,) and (M,), by row.
        """
        ends = observation["interactions"][:, [0, 2]]
        link_is_seen = np.concatenate((human_is_seen, object_is_seen))[ends].all(axis=1)
        seen = {"humans": human_is_seen, "objects": object_is_seen, "interactions": link_is_seen}
        for kind, is_seen in seen.items():
            for name in (f"{kind}_mask", *(part.name for part in self.parts if part.rows_of == kind)):
                observation[name][~is_seen] = 0
        self.derive(observation)

    def _interaction_rows(self, snapshot: Snapshot) -> IntArray:
        """Source, relation and destination of each interaction, (K, 3): indices of entities, pedestrians first."""
        known = self._interactions
        if known is None or known[0] is not snapshot.interactions:
            index = self._index
            rows = [(index[i.src], RELATIONS.index(i.relation), index[i.dst]) for i in snapshot.interactions]
            known = self._interactions = snapshot.interactions, np.array(rows, dtype=np.int64).reshape(-1, 3)
        return known[1]


@kernel
def _choose_rows(
    packed_scene: Any, row: Array, is_present: BoolArray, interactions: IntArray, human_mask: Floats32,
    object_mask: Floats32, wall_mask: Floats32, interaction_mask: Floats32,
) -> None:  # fmt: skip
    """Choose the entities that have rows, and write `Rows` and the masks.

    Args:
        packed_scene: packed `_Scene`.
        row: of a `State`.
        is_present: (N,), pedestrians that are in the room.
        interactions: (K, 3), source, relation, destination; indices of entities, pedestrians first.
        human_mask, object_mask, wall_mask, interaction_mask: one number for each row, 0; 1 is written for rows that are
            not empty.
    """
    scene = unpack(packed_scene, _Scene)
    x, y, is_sorted = row[X], row[Y], scene.is_sorted
    human_rows, object_rows, wall_rows = scene.rows.humans, scene.rows.objects, scene.rows.walls
    humans, objects, walls = len(is_present), len(scene.objects), len(scene.walls)
    distance = np.empty(max(len(human_rows), len(object_rows), len(wall_rows)))

    count = 0
    keeps_rows = not is_sorted and humans <= len(human_rows)
    for k in range(humans):
        if keeps_rows:  # the row of an absent pedestrian stays empty
            human_rows[k], count = k if is_present[k] else -1, k + 1
        elif is_present[k]:
            at = ROBOT_SIZE + HUMAN_SIZE * k
            count = _insert(human_rows, distance, count, k, length(row[at + X] - x, row[at + Y] - y))
    if not keeps_rows:
        _arrange(human_rows, count, is_sorted)
    _finish(human_rows, count, human_mask)

    count = 0
    for k in range(objects):
        away = length(scene.objects[k, 0] - x, scene.objects[k, 1] - y)
        count = _insert(object_rows, distance, count, k, away)
    _arrange(object_rows, count, is_sorted)
    _finish(object_rows, count, object_mask)

    count, visible_part = 0, np.empty(4, np.float32)
    for k in range(walls):
        wall = scene.walls[k]
        if put_wall(visible_part, wall, row):  # else all of it is too far away
            along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
            square = max(along_x * along_x + along_y * along_y, 1e-12)
            to_x, to_y = to_line(x - wall[0], y - wall[1], along_x, along_y, 1.0 / square)
            count = _insert(wall_rows, distance, count, k, length(to_x, to_y))
    _arrange(wall_rows, count, is_sorted)
    _finish(wall_rows, count, wall_mask)

    slot = np.full(humans + objects, -1, np.int64)  # row of each entity; objects follow the rows of pedestrians
    for n in range(len(human_rows)):
        if human_rows[n] >= 0:
            slot[human_rows[n]] = n
    for n in range(len(object_rows)):
        if object_rows[n] >= 0:
            slot[humans + object_rows[n]] = len(human_rows) + n
    scene.rows.interactions[:] = 0
    count = 0
    for k in range(len(interactions)):
        source, destination = slot[interactions[k, 0]], slot[interactions[k, 2]]
        if source >= 0 and destination >= 0 and count < len(interaction_mask):
            link = scene.rows.interactions[count]
            link[0], link[1], link[2] = source, interactions[k, 1], destination
            interaction_mask[count] = 1.0
            count += 1


@subroutine
def _insert(rows: IntArray, distance: Array, count: int, k: int, away: float) -> int:
    """Insert entity k at a distance, m, into the nearest ones, ordered by distance; returns their number.

    Args:
        rows: indices of the entities; the first `count` are taken.
        distance: of these, m.
    """
    if count == len(rows):
        if not away < distance[count - 1]:
            return count
        count -= 1
    n = count
    while n > 0 and away < distance[n - 1]:
        rows[n], distance[n] = rows[n - 1], distance[n - 1]
        n -= 1
    rows[n], distance[n] = k, away
    return count + 1


@subroutine
def _arrange(rows: IntArray, count: int, is_sorted: bool) -> None:
    """Put the first `count` entities into the order of the scene, unless they stay sorted by distance."""
    for n in range(1, 0 if is_sorted else count):
        k, m = rows[n], n
        while m > 0 and rows[m - 1] > k:
            rows[m] = rows[m - 1]
            m -= 1
        rows[m] = k


@subroutine
def _finish(rows: IntArray, count: int, mask: Floats32) -> None:
    """Mark the rows beyond `count` as empty, and write the mask."""
    for n in range(len(rows)):
        if n >= count:
            rows[n] = -1
        if rows[n] >= 0:
            mask[n] = 1.0
