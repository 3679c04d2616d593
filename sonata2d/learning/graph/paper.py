"""The paper's input: graphs of up to three instants a second apart, seen from the robot, 42 features a node.

Positions and velocities are the original recorder's: x to the robot's right, y ahead, angles clockwise from the right,
velocities the last place less this one, each seen from the robot at its time, a tick apart.

Source: the SONATA toolkit and its data set; see "Learn from graphs" in docs/how-to.md for what is like it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ...core.portable_math import Array, unit_vector, unit_vectors
from ...core.scene import Scene
from ...core.vectors import wrap_angles
from ...record.record import EpisodeRecord
from .graph import INTERVAL, NODE_TYPES, ROUNDING, Cast, Graph, edges_of, wall_pieces
from .source import Look, people_at, recorded_look, thing_poses, thing_sizes, wall_ends

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
TURNED = np.array([1.0, -1.0, -1.0])  # labels are to the right and clockwise, twists to the left and counter-clockwise
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
    The label is the frame's own, where that is a twist, or the command: its share of the robot's limits, ahead, right,
    clockwise.

    Args:
        record: an episode; of less than a second it gives none.
    """
    kept, scene, labels = kept_ticks(record.time), record.scene(), record.labels
    look = cache(lambda tick: recorded_look(record, tick))
    graphs = []
    for j in range(1, len(kept)):
        ticks = kept[max(j - INSTANTS + 1, 1) : j + 1][::-1]
        label = share_of_limits(scene, labels[ticks[0]], record.command[ticks[0]])
        pairs = [(look(tick), look(tick - 1)) for tick in ticks]
        graphs.append(paper_graph(scene, pairs, first=ticks[-1] == kept[1], label=label))
    return graphs


def paper_graph(
    scene: Scene, instants: Sequence[tuple[Look, Look]], *, first: bool = False, label: Array | None = None
) -> Graph:
    """One graph, of any looks.

    `is_first_frame` marks the oldest instant if it is the `first`, `time_left` is 1 / (tick + 1); both are the same for
    all nodes of an instant. People are those who are there at every instant, and at the tick before it.

    Args:
        scene: of the episode.
        instants: the newest first, 1 to 3: each look, and the one a tick before it, which velocities are told from.
        first: whether the oldest instant is the first that the episode has.
        label: to go with it.

    Returns:
        Of k instants, P people, O objects, M wall nodes and I interactions each: N = 2 + P + O + M nodes and
        1 + 3 (N - 1) + 2 I edges an instant, and 2 (k - 1) N edges between them.
    """
    here = people_at([look for pair in instants for look in pair])
    owner, pieces = wall_pieces(wall_ends(scene))
    cast = Cast(tuple(scene.humans[k].id for k in here), tuple(f.id for f in scene.furniture), owner)
    source = _Source(scene, cast, here, pieces)
    oldest = len(instants) - 1
    blocks = [source.features(i, *pair, first=first and i == oldest) for i, pair in enumerate(instants)]
    edges, relation = edges_of(cast, [look.ties for look, _ in instants])
    return Graph(
        feature_names=FEATURES,
        features=np.concatenate(blocks),
        node_type=np.array([NODE_TYPES.index(kind) for kind in cast.types] * len(instants)),
        entity=np.array(cast.entities * len(instants)),
        position=np.concatenate([source.position(look) for look, _ in instants]),
        instant=np.repeat(np.arange(len(instants)), len(cast)),
        edges=edges,
        relation=relation,
        label=label,
        ticks=tuple(look.tick for look, _ in instants),
    )


def share_of_limits(scene: Scene, label: Any, command: Array) -> Array:
    """(3,): a twist, which is the label if that is three numbers, over the robot's limits; ahead, right, clockwise."""
    limits, told = scene.robot.limits, np.asarray(label)
    twist = told if told.shape == (3,) and told.dtype.kind in "fi" else command
    return np.asarray(twist * (TURNED / np.array([limits.ahead, limits.sideways, limits.turn])), dtype=float)


def legacy_points(points: Array, origin: Array) -> Array:
    """World points seen from a pose: x to the right, y ahead; (n, 2) and (3,) to (n, 2)."""
    dx, dy = points[:, 0] - origin[0], points[:, 1] - origin[1]
    c, s = unit_vector(float(origin[2]))
    return np.column_stack((dx * s - dy * c, dx * c + dy * s))


def _legacy_poses(poses: Array, origin: Array) -> Array:
    """(n, 3), x, y, theta, as the original's recorder told them: x, y, a, clockwise from the right."""
    angle = -wrap_angles(poses[:, 2] - origin[2] + np.pi / 2)
    return np.column_stack((legacy_points(poses, origin), angle))


@dataclass(frozen=True, eq=False)
class _Source:
    """Makes the rows of an instant; `here` are the indices of the people, `pieces` (M, 4) m, world frame."""

    scene: Scene
    cast: Cast
    here: Any
    pieces: Array

    def features(self, instant: int, look: Look, before: Look, *, first: bool) -> Array:
        """(N, 42)."""
        people, goal = len(self.cast.people), self.cast.goal
        rows = np.zeros((len(self.cast), len(FEATURES)))
        types = [NODE_TYPES.index(kind) for kind in self.cast.types]
        rows[np.arange(len(rows)), types] = 1.0
        _fill(rows, slice(None), _ALL[instant : instant + 1], np.ones((len(rows), 1)))
        _fill(rows, slice(None), _ALL[3:], np.array([[float(first), 1.0 / (look.tick + 1)]]))
        things = self._moving(look, before)
        _fill(rows, slice(1, 1 + people), _HUMAN, things[:people])
        objects = np.concatenate((things[people:, :7], thing_sizes(self.scene), things[people:, 7:]), axis=1)
        _fill(rows, slice(1 + people, goal), _OBJECT, objects)
        share = people / CROWD
        _fill(rows, slice(0, 1), _ROOM, np.array([[share, share * share]]))
        _fill(rows, slice(goal, goal + 1), _GOAL, _with_distance(self._goal(look) / FAR))
        _fill(rows, slice(goal + 1, None), _WALL, self._walls(look))
        return rows

    def position(self, look: Look) -> Array:
        """(N, 2), m, x to the robot's right, y ahead; the room is where the robot is."""
        ends = self._ends(look)
        middle = (ends[:, :2] + ends[:, 2:]) / 2
        things = legacy_points(self._poses(look), look.robot)
        return np.concatenate((np.zeros((1, 2)), things, self._goal(look), middle))

    def _poses(self, look: Look) -> Array:
        """(P + O, 3), of people and objects, world frame."""
        return np.concatenate((look.humans[self.here, :3], thing_poses(self.scene)))

    def _goal(self, look: Look) -> Array:
        return legacy_points(np.array([[self.scene.goal.x, self.scene.goal.y]]), look.robot)

    def _ends(self, look: Look) -> Array:
        """(M, 4), of the pieces of the walls."""
        return np.concatenate([legacy_points(self.pieces[:, k : k + 2], look.robot) for k in (0, 2)], axis=1)

    def _walls(self, look: Look) -> Array:
        ends = self._ends(look)
        along = ends[:, 2:] - ends[:, :2]
        length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])[:, None]
        place = _with_distance((ends[:, :2] + ends[:, 2:]) / 2 / FAR)
        return np.column_stack((place[:, :2], along / length, place[:, 2:]))  # the angle's sine and cosine, from ahead

    def _moving(self, look: Look, before: Look) -> Array:
        """(P + O, 9): place, va, vx, vy, sin, cos, distance and its inverse."""
        now = _legacy_poses(self._poses(look), look.robot)
        change = _legacy_poses(self._poses(before), before.robot) - now
        change[:, 2] = wrap_angles(change[:, 2])
        place, direction = _with_distance(now[:, :2] / FAR), unit_vectors(now[:, 2])
        return np.column_stack((place[:, :2], change[:, [2, 0, 1]] / FAR, direction[:, [1, 0]], place[:, 2:]))


def _with_distance(place: Array) -> Array:
    """(n, 4): the place, its distance, and 1 less that."""
    distance = np.sqrt(place[:, 0] * place[:, 0] + place[:, 1] * place[:, 1])
    return np.column_stack((place, distance, 1.0 - distance))


def _fill(rows: Array, nodes: slice, names: tuple[str, ...], values: Array) -> None:
    start = FEATURES.index(names[0])
    rows[nodes, start : start + len(names)] = values
