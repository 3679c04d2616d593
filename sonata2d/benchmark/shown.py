"""The part of a scene and its snapshots that a controller of the benchmark gets: no seed, settings or intentions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..agents.sensors.base import SensorNoise
from ..agents.sensors.estimates import FieldOfView
from ..core.entities import Human, Interaction
from ..core.floats import FloatFields
from ..core.geometry import Pose
from ..core.humans import VX, VY, X, Y, frozen
from ..core.portable_math import Array, BoolArray
from ..core.scene import Rules, Scene, Social
from ..core.snapshot import Snapshot, snapshot_of
from ..core.state import HUMAN_SIZE, ROBOT_SIZE, State

_NAME = "benchmark"


@dataclass(frozen=True, slots=True)
class Sensing(FloatFields):
    """Perception of people: a field of view, hidden people and noise. The robot knows the room and itself.

    Attributes:
        angle: of the field of view, rad.
        distance: up to which people are seen, m.
        occlusion: whether walls and other people hide a person.
        noise, velocity_noise: standard deviations of positions (m) and velocities (m/s), in x and y, in each tick.
    """

    angle: float = 2.0 * math.pi
    distance: float = 1000.0
    occlusion: bool = True
    noise: float = 0.0
    velocity_noise: float = 0.0


class Perception:
    """The snapshots of an episode as a controller of the benchmark sees them.

    People that are not seen are absent, and so are their interactions. In the scene they stand far outside the room.

    Args:
        scene: of the episode.
        sensing: None: everything is seen, exactly.

    Attributes:
        scene: the part of it that the controller gets when the episode begins.
    """

    def __init__(self, scene: Scene, sensing: Sensing | None = None) -> None:
        self._noise = (0.0, 0.0) if sensing is None else (sensing.noise, sensing.velocity_noise)
        self._view: Callable[[Snapshot], BoolArray | None] = _present
        if sensing is not None:
            self._view = _seen(scene, sensing)
        self._full = scene
        first = snapshot_of(scene)
        is_seen = self._view(first)
        visible = [human.id for k, human in enumerate(scene.humans) if is_seen is None or is_seen[k]]
        links = first.interactions if is_seen is None else _between_seen(scene, is_seen, first.interactions)
        self.scene = _without_intentions(scene, frozenset(visible), links)

    def state(self, snapshot: Snapshot) -> tuple[State, tuple[Interaction, ...]]:
        """State and interactions of a tick, as far as they are seen."""
        state, is_seen = snapshot.state, self._view(snapshot)
        interactions = snapshot.interactions
        row = state.row
        if is_seen is not None:
            interactions = _between_seen(self._full, is_seen, interactions)
            row = row.copy()
            people = row[ROBOT_SIZE : ROBOT_SIZE + HUMAN_SIZE * len(is_seen)].reshape(-1, HUMAN_SIZE)
            people[~is_seen] = 0.0
        if any(self._noise) and len(state.activity):
            row = self._with_noise(row.copy(), snapshot.tick, len(state.activity))
        activity = state.activity if is_seen is None else np.where(is_seen, state.activity, 0)
        return State(frozen(row), frozen(activity), is_seen, state.door_count), interactions

    def _with_noise(self, row: Array, tick: int, count: int) -> Array:
        people = row[ROBOT_SIZE : ROBOT_SIZE + HUMAN_SIZE * count].reshape(-1, HUMAN_SIZE)
        errors = SensorNoise(self._full, "benchmark", tick).normals(4 * count).reshape(-1, 4)
        people[:, [X, Y]] += self._noise[0] * errors[:, :2]
        people[:, [VX, VY]] += self._noise[1] * errors[:, 2:]
        return row


def _present(snapshot: Snapshot) -> BoolArray | None:
    return snapshot.state.is_present


def _seen(scene: Scene, sensing: Sensing) -> Callable[[Snapshot], BoolArray]:
    """A function that returns the people that are seen, (N,) of bool."""
    sensor = FieldOfView(angle=sensing.angle, distance=sensing.distance, occlusion=sensing.occlusion)
    measure, row_of, count = sensor.start(scene), scene.human_table.row, len(scene.humans)

    def seen(snapshot: Snapshot) -> BoolArray:
        reading = measure(snapshot, SensorNoise(scene, "view", snapshot.tick))
        is_seen = np.zeros(count, dtype=np.bool_)
        is_seen[[row_of[int(id)] for id in reading.humans.id]] = True
        return is_seen

    return seen


def _between_seen(scene: Scene, is_seen: BoolArray, links: tuple[Interaction, ...]) -> tuple[Interaction, ...]:
    """The interactions whose people are all seen; objects always are."""
    row_of = scene.human_table.row
    return tuple(link for link in links if all(id not in row_of or is_seen[row_of[id]] for id in (link.src, link.dst)))


def _without_intentions(scene: Scene, visible: frozenset[int], links: tuple[Interaction, ...]) -> Scene:
    """The scene with its room, furniture, robot, goal and the people that are visible at the start."""
    far = scene.parking
    people = tuple(
        _without_intention(human, human.pose if human.id in visible else Pose(*far[k].tolist()), human.id in visible)
        for k, human in enumerate(scene.humans)
    )
    hidden = {human.id for human in scene.humans} - visible
    rules = scene.rules
    talking = (group for group in scene.groups if group.kind == "talking" and not hidden & set(group.members))
    return replace(
        scene,
        name=_NAME,
        family=_NAME,
        humans=people,
        groups=tuple(talking),
        interactions=links,
        rules=Rules(
            dt=rules.dt, time_limit=rules.time_limit, ends_on=rules.ends_on, guard=rules.guard,
            contact_distance=rules.contact_distance,
        ),
        social=Social(),
        seed=0,
        episode=0,
        settings=None,
        dropped=(),
        doors=(),
        queues=(),
        places=(),
    )  # fmt: skip


def _without_intention(human: Human, pose: Pose, is_visible: bool) -> Human:
    """A person with body and kind; a person that stands at the start counts as standing, others as wandering."""
    stands = is_visible and not human.walks_at_start
    return Human(
        human.id,
        pose,
        radius=human.radius,
        breadth=human.breadth,
        length=human.length,
        side_steps=human.side_steps,
        kind=human.kind,
        attributes=human.attributes,
        behaviour="standing" if stands else "wandering",
    )
