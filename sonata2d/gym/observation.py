"""Observations of a snapshot as arrays of constant shape, in the robot's frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from gymnasium import spaces

from ..core.arguments import whole_number
from ..core.compiled.packing import Packed
from ..core.entities import Interaction
from ..core.files.limits import MAX_ROWS
from ..core.portable_math import BoolArray, IntArray
from ..core.relations import RELATIONS
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.state import State
from ..core.wording import shown
from ..scenegen.floor_plans import draw_floor_plan
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.sections import RoomConfig
from .parts import STANDARD, DerivedPart, Observation, Rows, SnapshotPart, part_named, table_of
from .sight import Arrays, goal_columns, sight_of, write_observation

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
        attending = sum(count for relation, count in config.additional if relation.humans == 1)
        humans = sum(count.max for count in drawn if count is not None)
        humans += sum(relation.humans * count for relation, count in config.additional)
        talking, walking = config.groups.talking_size.max, config.groups.walking_size.max
        groups = ((config.talking_groups.max, talking), (config.walking_groups.max, walking))
        humans += sum(count * size for count, size in groups)
        humans += config.seated.max + len(config.people) + sum(queue.waiting.max for queue in config.queues)
        humans += sum(other.count for other in config.robots)  # which are observed as people
        humans += _VISITORS if any(door.inflow > 0.0 for door in config.doors) else 0
        laptops = config.tables.max if config.laptops_on_tables else 0
        objects = sum(count.max for count in config.counts.values()) + laptops
        objects += 2 * attending + len(config.furniture)  # a laptop comes with a table
        together = sum(count * size * size for count, size in groups)
        walls = _wall_count(config.room) + len(config.interior_doors)
        return cls(max(humans, 1), max(objects, 1), walls, max(2 * humans, together, 1))

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
        arrays: the parts in `STANDARD` of the last observation.
        rows: the entities in its rows.
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
        self._filled = [part for part in self.parts if isinstance(part, SnapshotPart) and type(part) not in STANDARD]
        self._derived = [part for part in self.parts if isinstance(part, DerivedPart)]
        named = (*Arrays._fields, *(part.name for part in self._filled))
        self._arrays: Observation = {
            name: np.zeros(self.space[name].shape or (), self.space[name].dtype) for name in named
        }
        self.arrays = Arrays(*(self._arrays[name] for name in Arrays._fields))
        humans, objects, walls = (np.full(n, -1) for n in (sizes.humans, sizes.objects, sizes.walls))
        self.rows = Rows(humans, objects, walls)

    def reset(self, scene: Scene) -> None:
        """Begin an episode; the other robots of the scene are observed as people."""
        scene = scene.with_robots_as_people
        self._sight = Packed(sight_of(scene, self.rows, self.arrays, self.order == "nearest"))
        self.objects, self.walls = self._sight.value.objects[:, :2].copy(), self._sight.value.walls
        self._goal, self._time_limit = scene.goal, scene.rules.time_limit
        self._everybody = np.ones(len(scene.humans), dtype=bool)
        ids = [*(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)]
        self._index = {entity: k for k, entity in enumerate(ids)}
        self._links: tuple[tuple[Interaction, ...], IntArray] | None = None
        for part in self._filled:
            part.begin(scene)

    def encode(self, snapshot: Snapshot) -> Observation:
        """The observation of a snapshot of the scene given to `reset`."""
        snapshot = snapshot.with_robots_as_people()
        state, links = snapshot.state, self._links_of(snapshot)
        if snapshot.goal is not self._goal:
            self._goal = snapshot.goal
            self._sight.value.goal[:] = goal_columns(self._goal)
        write_observation(
            self._sight.argument, state.row, self.present(state), state.activity, links, len(links),
            min(snapshot.time / self._time_limit, 1.0),
        )  # fmt: skip
        for part in self._filled:
            out = self._arrays[part.name]
            out.fill(0)
            part.fill(snapshot, self.rows, out)
        observation: Observation = {name: array.copy() for name, array in self._arrays.items()}
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

    def _links_of(self, snapshot: Snapshot) -> IntArray:
        """Source, destination and relation of each interaction, (K, 3): indices of entities, pedestrians first."""
        known = self._links
        if known is None or known[0] is not snapshot.interactions:
            index = self._index
            rows = [(index[i.src], index[i.dst], RELATIONS.index(i.relation)) for i in snapshot.interactions]
            known = self._links = snapshot.interactions, np.array(rows, dtype=np.int64).reshape(-1, 3)
        return known[1]
