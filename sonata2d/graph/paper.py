"""The paper's input: graphs of up to three instants a second apart, seen from the robot, 42 features a node.

Positions and velocities are the original recorder's: x to the robot's right, y ahead, angles clockwise from the right,
velocities the last place less this one, each seen from the robot at its time, a tick apart.

Source: the SONATA toolkit and its data set; see "Learn from graphs" in docs/how-to.md for what is like it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..exact import Array
from ..geometry import Disc
from ..record.record import EpisodeRecord
from ..scene import Scene
from ..transforms.frames import wrapped_angles
from ..transforms.motion import Motion, motion_of
from .graph import INTERVAL, NODE_TYPES, ROUNDING, Cast, Graph, edges_of, there_at, wall_pieces

_MOVING = ("x_pos", "y_pos", "a_vel", "x_vel", "y_vel", "orientation_sin", "orientation_cos")
_HUMAN = ("hum_x_pos", "hum_y_pos", "human_a_vel", "human_x_vel", "human_y_vel", "hum_orientation_sin",
          "hum_orientation_cos", "hum_dist", "hum_inv_dist")  # fmt: skip
_OBJECT = tuple(f"obj_{name}" for name in (*_MOVING, "x_size", "y_size", "dist", "inv_dist"))
_ROOM = ("room_humans", "room_humans2")
_WALL = tuple(f"wall_{name}" for name in ("x_pos", "y_pos", *_MOVING[5:], "dist", "inv_dist"))
_GOAL = ("goal_x_pos", "goal_y_pos", "goal_dist", "goal_inv_dist")
_ALL = ("is_t_0", "is_t_m1", "is_t_m2", "is_first_frame", "time_left")
FEATURES = (*NODE_TYPES, *_ALL, *_HUMAN, *_OBJECT, *_ROOM, *_WALL, *_GOAL)

INSTANTS = 3
FAR = 10.0  # m, m/s, rad a tick: what positions and velocities are divided by
CROWD = 15.0  # people: what their number is divided by


def kept_ticks(time: Array, interval: float = INTERVAL) -> list[int]:
    """Ticks at least `interval` apart: the first, then each that is so long after the one kept before.

    Args:
        time: (T,), s.
    """
    kept = [0] if len(time) else []
    for tick in range(1, len(time)):
        if time[tick] - time[kept[-1]] >= interval - ROUNDING:
            kept.append(tick)
    return kept


def paper_graphs(record: EpisodeRecord) -> list[Graph]:
    """The graphs of an episode, in order: one for each kept frame but the first, with up to two before it.

    The first frame of all, which has no velocities yet, is in none; so graph j has min(j + 1, 3) instants.
    `is_first_frame` marks the instant that the first graph begins with, `time_left` is 1 / (tick + 1); both are the
    same for all nodes of an instant. The label is the command's share of the robot's limits: ahead, right, clockwise.
    People are those who are there at every instant of a graph, and at the tick before it.

    Args:
        record: an episode; of less than a second it gives none.

    Returns:
        Of k instants, P people, O objects, M wall nodes and I interactions each: N = 2 + P + O + M nodes and
        1 + 3 (N - 1) + 2 I edges an instant, and 2 (k - 1) N edges between them.
    """
    kept = kept_ticks(record.time)
    motion, scene = motion_of(record), record.scene()
    owner, pieces = wall_pieces(motion.walls[0])
    legacy, sizes = _Legacy.of(motion), _sizes(scene)
    limits = scene.robot.limits
    scale = np.array([1 / limits.ahead, -1 / limits.sideways, -1 / limits.turn])
    graphs = []
    for j in range(1, len(kept)):
        ticks = kept[max(j - INSTANTS + 1, 1) : j + 1][::-1]
        here = there_at(record.present, [*ticks, *(tick - 1 for tick in ticks)])  # velocities are from the tick before
        cast = Cast(tuple(scene.humans[k].id for k in here), tuple(f.id for f in scene.furniture), owner)
        source = _Source(cast, legacy.of_people(here, len(scene.humans)), pieces, sizes)
        blocks = [source.features(tick, i, first=tick == kept[1]) for i, tick in enumerate(ticks)]
        edges, relation = edges_of(cast, [motion.interactions[tick] for tick in ticks])
        graphs.append(
            Graph(
                feature_names=FEATURES,
                features=np.concatenate(blocks),
                node_type=np.array([NODE_TYPES.index(kind) for kind in cast.types] * len(ticks)),
                entity=np.array(cast.entities * len(ticks)),
                position=np.concatenate([source.position(tick) for tick in ticks]),
                instant=np.repeat(np.arange(len(ticks)), len(cast)),
                edges=edges,
                relation=relation,
                label=motion.command[ticks[0]] * scale,
                ticks=tuple(ticks),
            )
        )
    return graphs


@dataclass(frozen=True, eq=False)
class _Legacy:
    """The motion as the original's recorder told it.

    Attributes:
        origin: (T + 1, 3), of the robot.
        things: (T + 1, P + O, 6), columns x, y, a, vx, vy, va.
        goal: (T + 1, 2).
    """

    origin: Array
    things: Array
    goal: Array

    @classmethod
    def of(cls, motion: Motion) -> _Legacy:
        poses = np.concatenate((motion.humans[..., :3], motion.objects), axis=1)
        origin = motion.robot[:, :3]
        place = legacy_points(poses[..., :2], origin[:, None])
        angle = -wrapped_angles(poses[..., 2] - origin[:, None, 2] + np.pi / 2)
        now = np.concatenate((place, angle[..., None]), axis=-1)
        change = np.zeros_like(now)
        change[1:] = now[:-1] - now[1:]
        change[..., 2] = wrapped_angles(change[..., 2])
        return cls(origin, np.concatenate((now, change), axis=-1), legacy_points(motion.goal[:, :2], origin))

    def of_people(self, here: Any, people: int) -> _Legacy:
        """The same of some of so many people, by index, and of all objects."""
        if len(here) == people:
            return self
        kept = [*here.tolist(), *range(people, self.things.shape[1])]
        return _Legacy(self.origin, self.things[:, kept], self.goal)


def legacy_points(points: Array, origin: Array) -> Array:
    """World points seen from poses: x to the right, y ahead; (…, 2) and (…, 3) to (…, 2)."""
    dx, dy = points[..., 0] - origin[..., 0], points[..., 1] - origin[..., 1]
    s, c = np.sin(origin[..., 2]), np.cos(origin[..., 2])
    return np.stack((dx * s - dy * c, dx * c + dy * s), axis=-1)


@dataclass(frozen=True, eq=False)
class _Source:
    """Makes the rows of an instant; `pieces` (M, 4) and `sizes` (O, 2) are metres, world frame."""

    cast: Cast
    legacy: _Legacy
    pieces: Array
    sizes: Array

    def features(self, tick: int, instant: int, *, first: bool) -> Array:
        """(N, 42)."""
        people, goal = len(self.cast.people), self.cast.goal
        rows = np.zeros((len(self.cast), len(FEATURES)))
        types = [NODE_TYPES.index(kind) for kind in self.cast.types]
        rows[np.arange(len(rows)), types] = 1.0
        _fill(rows, slice(None), _ALL[instant : instant + 1], np.ones((len(rows), 1)))
        _fill(rows, slice(None), _ALL[3:], np.array([[float(first), 1.0 / (tick + 1)]]))
        things = _moving(self.legacy.things[tick])
        _fill(rows, slice(1, 1 + people), _HUMAN, things[:people])
        objects = np.concatenate((things[people:, :7], self.sizes, things[people:, 7:]), axis=1)
        _fill(rows, slice(1 + people, goal), _OBJECT, objects)
        share = people / CROWD
        _fill(rows, slice(0, 1), _ROOM, np.array([[share, share * share]]))
        _fill(rows, slice(goal, goal + 1), _GOAL, _with_distance(self.legacy.goal[tick][None] / FAR))
        _fill(rows, slice(goal + 1, None), _WALL, self._walls(tick))
        return rows

    def position(self, tick: int) -> Array:
        """(N, 2), m, x to the robot's right, y ahead; the room is where the robot is."""
        middle = self._ends(tick).reshape(-1, 2, 2).mean(axis=1)
        legacy = self.legacy
        return np.concatenate((np.zeros((1, 2)), legacy.things[tick, :, :2], legacy.goal[tick][None], middle))

    def _ends(self, tick: int) -> Array:
        """(M, 4), of the pieces of the walls."""
        origin = self.legacy.origin[tick]
        return np.concatenate([legacy_points(self.pieces[:, k : k + 2], origin) for k in (0, 2)], axis=1)

    def _walls(self, tick: int) -> Array:
        ends = self._ends(tick)
        along = ends[:, 2:] - ends[:, :2]
        angle = np.arctan2(along[:, 0], along[:, 1])  # from straight ahead
        place = _with_distance((ends[:, :2] + ends[:, 2:]) / 2 / FAR)
        return np.column_stack((place[:, :2], np.sin(angle), np.cos(angle), place[:, 2:]))


def _moving(rows: Array) -> Array:
    """(n, 9) of people or objects from (n, 6): place, va, vx, vy, sin, cos, distance and its inverse."""
    place = _with_distance(rows[:, :2] / FAR)
    speed = rows[:, [5, 3, 4]] / FAR
    return np.column_stack((place[:, :2], speed, np.sin(rows[:, 2]), np.cos(rows[:, 2]), place[:, 2:]))


def _with_distance(place: Array) -> Array:
    """(n, 4): the place, its distance, and 1 less that."""
    distance = np.hypot(place[:, 0], place[:, 1])
    return np.column_stack((place, distance, 1.0 - distance))


def _fill(rows: Array, nodes: slice, names: tuple[str, ...], values: Array) -> None:
    start = FEATURES.index(names[0])
    rows[nodes, start : start + len(names)] = values


def _sizes(scene: Scene) -> Array:
    """(O, 2), m: lengths along a thing's own x and y."""
    shapes = [thing.shape for thing in scene.furniture]
    sizes = [(2 * s.radius, 2 * s.radius) if isinstance(s, Disc) else (s.length, s.width) for s in shapes]
    return np.array(sizes, dtype=float).reshape(-1, 2)
