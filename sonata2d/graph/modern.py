"""A graph of the same shape with today's numbers: SI, exact velocities, head angles, any frame and horizon.

In place of the room its hub is the robot: without it nobody could tell from a graph in the world frame where it is.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from ..exact import Array, headings
from ..geometry import Disc
from ..record.record import EpisodeRecord
from ..scene import Scene
from ..transforms.frames import goal_frame, seen_from
from ..transforms.motion import Motion, motion_of
from .graph import INTERVAL, NODE_TYPES, Cast, Graph, edges_of, there_at, wall_pieces

MODERN_FEATURES = (
    *(f"is_{kind}" if kind != "room" else "is_robot" for kind in NODE_TYPES),
    "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
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
    """The graph of a look and of those before it.

    Nodes and edges are the paper's, with the robot in the place of the room; people are those who are there at every
    instant. Features: type; age, s before the newest
    instant; place, m; direction; velocity, m/s, rad/s; direction of the head; length and width, m. What stands has no
    velocity; who has no head of their own looks ahead; a wall is as long as its piece, and points along it. In the
    frames `robot` and `goal` all instants are seen from where the newest one is seen.

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
    ticks = _ticks(record, tick, instants, interval)
    world, scene, here = motion_of(record), record.scene(), there_at(record.looks.present, ticks)
    motion = _seen(world, frame, tick)
    owner, _ = wall_pieces(world.walls[0])
    cast = Cast(tuple(scene.humans[k].id for k in here), tuple(f.id for f in scene.furniture), owner)
    rows = [_rows(motion, at, scene, (tick - at) * world.dt, cast, here) for at in ticks]
    edges, relation = edges_of(cast, [world.interactions[at] for at in ticks])
    features = np.concatenate(rows)
    return Graph(
        feature_names=MODERN_FEATURES,
        features=features,
        node_type=np.array([NODE_TYPES.index(kind) for kind in cast.types] * len(ticks)),
        entity=np.array(cast.entities * len(ticks)),
        position=features[:, 6:8].copy(),
        instant=np.repeat(np.arange(len(ticks)), len(cast)),
        edges=edges,
        relation=relation,
        label=world.labels[tick] if tick < len(world) else None,
        ticks=tuple(ticks),
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


def _seen(world: Motion, frame: str, tick: int) -> Motion:
    """All instants as they are seen from one place, that of the newest."""
    if frame != "robot":
        return goal_frame(world) if frame == "goal" else world
    return seen_from(world, world.robot[tick, :3], "robot")


def _rows(motion: Motion, at: int, scene: Scene, age: float, cast: Cast, here: Any) -> Array:
    """(N, 17) of an instant."""
    _, pieces = wall_pieces(motion.walls[at])
    along = pieces[:, 2:] - pieces[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    unit = along / np.where(length > 0.0, length, 1.0)[:, None]
    shapes = [thing.shape for thing in scene.furniture]
    sizes = [(2 * s.radius, 2 * s.radius) if isinstance(s, Disc) else (s.length, s.width) for s in shapes]
    wide = 2 * np.array([scene.humans[k].radius for k in here])
    robot, humans, things, goal = motion.robot[at], motion.humans[at, here], motion.objects[at], motion.goal[at]
    walls = np.column_stack((pieces[:, :2] + along / 2, unit, np.zeros((len(pieces), 3)), unit))
    blocks = [
        _placed(robot[None], np.full((1, 2), 2 * scene.robot.radius)),
        _placed(humans, np.column_stack((wide, wide))),
        _placed(things, np.array(sizes, dtype=float).reshape(-1, 2)),
        _placed(goal[None], np.full((1, 2), 2 * scene.goal.distance)),
        np.column_stack((walls, length, np.zeros(len(pieces)))),
    ]
    types = np.eye(len(NODE_TYPES))[[NODE_TYPES.index(kind) for kind in cast.types]]
    return np.column_stack((types, np.full(len(cast), age), np.concatenate(blocks)))


def _placed(rows: Array, size: Array) -> Array:
    """(n, 11) from rows x, y, theta (vx, vy, omega (head))."""
    ahead = headings(rows[:, 2])
    look = headings(rows[:, 6]) if rows.shape[1] > 6 else ahead
    speed = rows[:, 3:6] if rows.shape[1] > 3 else np.zeros((len(rows), 3))
    return np.column_stack((rows[:, :2], ahead, speed, look, size))
