"""A graph of the same shape with today's numbers: SI, exact velocities, head angles, any frame and horizon.

In place of the room its hub is the robot: without it nobody could tell from a graph in the world frame where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ...core.portable_math import Array, arctan2, unit_vectors
from ...core.scene import Scene
from ...record.record import EpisodeRecord
from .graph import INTERVAL, NODE_TYPES, Cast, Graph, edges_of, wall_pieces
from .source import Look, people_at, recorded_look, thing_poses, thing_sizes, wall_ends

MODERN_FEATURES = (
    *(f"is_{kind}" if kind != "room" else "is_robot" for kind in NODE_TYPES),
    "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
    "near_x", "near_y", "gap",
)  # fmt: skip

FRAMES = ("world", "robot", "goal")


def modern_graph(
    record: EpisodeRecord,
    tick: int,
    *,
    frame: Literal["world", "robot", "goal"] = "robot",
    instants: int = 3,
    interval: float = INTERVAL,
) -> Graph:
    """The graph of a look and of those before it; see `graph_of_looks`.

    Args:
        record: an episode.
        tick: of the newest instant, 0 to T; at T, the final look, the label is None.
        frame: `world`; `robot`, x ahead; or `goal`, at the goal, x along the way to it from the robot's start.
        instants: how many, 1 or more; fewer where the episode has not gone on for so long.
        interval: s between them, a multiple of the tick.

    Returns:
        A graph whose label is the frame's own, or [vx, vy, omega] where that is the label.

    Raises:
        ValueError: there is no such tick or frame, or no such horizon.
    """
    if frame not in FRAMES:
        raise ValueError(f"frame must be one of {', '.join(FRAMES)}, got {frame!r}")
    looks = [recorded_look(record, at) for at in _ticks(record, tick, instants, interval)]
    scene, origin = record.scene(), np.zeros(3)
    if frame == "robot":
        origin = looks[0].robot[:3]
    elif frame == "goal":
        goal, start = scene.goal, record.looks.robot[0]
        origin = np.array([goal.x, goal.y, float(arctan2(goal.y - start[1], goal.x - start[0]))])
    return graph_of_looks(scene, looks, origin, label=record.labels[tick] if tick < len(record) else None)


def graph_of_looks(scene: Scene, looks: Sequence[Look], origin: Array, *, label: Any = None) -> Graph:
    """The graph of looks, of a recorded episode or of one that is under way.

    Nodes and edges are the paper's, with the robot in the place of the room; people are those who are there at every
    instant. Features: type; age, s before the newest instant; place, m; direction; velocity, m/s, rad/s; direction of
    the head; length and width, m; the place on the outline that is nearest to the robot then, and the gap between
    their outlines, m. What stands has no velocity; who has no head of their own looks ahead; a wall is as long as its
    piece, and points along it; the goal is as large as the distance at which it is reached.

    Args:
        scene: of the episode.
        looks: the newest first, 1 or more.
        origin: (3,), x, y, theta of the frame of reference, world frame, for all instants.
        label: to go with it.
    """
    here = people_at([*looks])
    owner, pieces = wall_pieces(wall_ends(scene))
    cast = Cast(tuple(scene.humans[k].id for k in here), tuple(f.id for f in scene.furniture), owner)
    dt = scene.rules.dt
    rows = [_rows(scene, look, here, pieces, origin, (looks[0].tick - look.tick) * dt) for look in looks]
    types = np.eye(len(NODE_TYPES))[[NODE_TYPES.index(kind) for kind in cast.types]]
    features = np.concatenate([np.column_stack((types, block)) for block in rows])
    edges, relation = edges_of(cast, [look.ties for look in looks])
    return Graph(
        feature_names=MODERN_FEATURES,
        features=features,
        node_type=np.array([NODE_TYPES.index(kind) for kind in cast.types] * len(looks)),
        entity=np.array(cast.entities * len(looks)),
        position=features[:, 6:8].copy(),
        instant=np.repeat(np.arange(len(looks)), len(cast)),
        edges=edges,
        relation=relation,
        label=label,
        ticks=tuple(look.tick for look in looks),
    )


def _ticks(record: EpisodeRecord, tick: int, instants: int, interval: float) -> list[int]:
    """The newest first."""
    dt = record.scene().rules.dt
    step = round(interval / dt) if 0.0 < interval < float("inf") else 0
    if not 0 <= tick <= len(record):
        raise ValueError(f"tick must be 0 to {len(record)}, got {tick}")
    if instants < 1 or step < 1 or abs(step * dt - interval) > 1e-6:
        raise ValueError(f"instants must be 1 or more, got {instants}; interval a multiple of {dt} s, got {interval}")
    return [at for at in (tick - i * step for i in range(instants)) if at >= 0]


def _rows(scene: Scene, look: Look, here: Any, pieces: Array, origin: Array, age: float) -> Array:
    """(N, 15) of an instant: robot, people, things, goal, walls; all but the type."""
    body = np.concatenate([*_solids(scene, look, here), _marks(scene, pieces)])
    poses, speed, head, size, round_ = body[:, :3], body[:, 3:6], body[:, 6], body[:, 7:9], body[:, 9]
    near, gap = _nearest(poses, size, round_, look.robot, scene.robot.radius)
    axes, turned, looking = (
        unit_vectors(origin[2:3])[0],
        unit_vectors(poses[:, 2] - origin[2]),
        unit_vectors(head - origin[2]),
    )
    place, nearest = (_turned(points - origin[:2], axes) for points in (poses[:, :2], near))
    velocity = np.column_stack((_turned(speed[:, :2], axes), speed[:, 2]))
    return np.column_stack((np.full(len(body), age), place, turned, velocity, looking, size, nearest, gap))


def _solids(scene: Scene, look: Look, here: Any) -> tuple[Array, Array, Array]:
    """(1, 10), (P, 10) and (O, 10), robot, people, things: x, y, theta, vx, vy, omega, head, length, width, radius."""
    people, things = look.humans[here], thing_poses(scene)
    radius = np.array([scene.humans[k].radius for k in here], dtype=float)
    round_ = np.array([getattr(thing.shape, "radius", 0.0) for thing in scene.furniture], dtype=float)
    own = scene.robot.radius
    return (
        np.array([[*look.robot, look.robot[2], 2 * own, 2 * own, own]]),
        np.column_stack((people, 2 * radius, 2 * radius, radius)),
        np.column_stack((things, np.zeros((len(things), 3)), things[:, 2], thing_sizes(scene), round_)),
    )


def _marks(scene: Scene, pieces: Array) -> Array:
    """(1 + M, 10), the goal and the pieces of walls, alike."""
    along, goal = pieces[:, 2:] - pieces[:, :2], scene.goal
    theta = arctan2(along[:, 1], along[:, 0])
    length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])
    none = np.zeros((len(pieces), 1))
    walls = np.column_stack((pieces[:, :2] + along / 2, theta, none, none, none, theta, length, none, none))
    size = 2 * goal.distance
    return np.concatenate(([[goal.x, goal.y, goal.theta, 0, 0, 0, goal.theta, size, size, goal.distance]], walls))


def _nearest(poses: Array, size: Array, radius: Array, robot: Array, own: float) -> tuple[Array, Array]:
    """(N, 2), the places on the outlines nearest to the robot's centre, and (N,), the gaps; m, world frame.

    Args:
        poses: (N, 3); the first is the robot's own.
        size: (N, 2), length and width, m.
        radius: (N,), m, of what is round; 0 of what has corners.
        robot: (6,).
        own: m, radius of the robot.
    """
    axes = unit_vectors(poses[:, 2])
    dx, dy = robot[0] - poses[:, 0], robot[1] - poses[:, 1]
    half = np.where(radius[:, None] > 0.0, 0.0, size / 2)  # of the core: of what is round, a point
    x = np.minimum(np.maximum(dx * axes[:, 0] + dy * axes[:, 1], -half[:, 0]), half[:, 0])
    y = np.minimum(np.maximum(dy * axes[:, 0] - dx * axes[:, 1], -half[:, 1]), half[:, 1])
    core = poses[:, :2] + np.column_stack((x * axes[:, 0] - y * axes[:, 1], x * axes[:, 1] + y * axes[:, 0]))
    to_x, to_y = robot[0] - core[:, 0], robot[1] - core[:, 1]
    apart = np.sqrt(to_x * to_x + to_y * to_y)
    out = (radius / np.where(apart > 0.0, apart, 1.0))[:, None]
    gap = apart - radius - own
    gap[0] = 0.0
    return core + out * np.column_stack((to_x, to_y)), gap


def _turned(rows: Array, axes: Array) -> Array:
    """(n, 2) in axes that point along a unit vector."""
    c, s = axes
    return np.column_stack((rows[:, 0] * c + rows[:, 1] * s, rows[:, 1] * c - rows[:, 0] * s))
