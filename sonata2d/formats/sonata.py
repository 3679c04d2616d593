"""`sonata`: frame lists as the toolkit of 2020 wrote them, in the robot's frame: +x right, +y ahead, angles clockwise.

Velocities are the previous saved frame minus this one, in the moving robot's frame; commands are on the scale of a
stick. What differs from the original by default: va is wrapped, stamps are exact, all three numbers of a command are
floats, and each frame has an `ID`. With `Options.original` these are as they were: see `_as_the_original`.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import orjson

from ..entities import AT_LAPTOP, RELATIONS
from ..errors import RecordError
from ..exact import Array
from ..geometry import Disc, Shape
from ..record import EpisodeRecord
from ..record.layout import Tree
from ..scene import Scene
from .clock import exact_stamps
from .form import Options
from .motion import turned_by
from .refuse import (
    refuse_absences,
    refuse_ids,
    refuse_relations,
    refuse_short,
    refuse_uneven,
    refuse_without_robot,
)

NAME = "sonata"
ADVANCE, ROTATION = 3.5, 4.0  # the stick at its stop
LEAST = 2.0  # s; a shorter file gives its reader no graph, and alone it stops it
ORIGINAL_RELATIONS = RELATIONS[:4]
_EPOCH = 1_595_000_000.0  # s since 1970, July 2020: when the original's episodes are said to begin
_APART = 3600.0  # s between the beginnings of episodes
_PERIOD = 0.1  # s; the original saved a frame when more than this had passed


def export(record: EpisodeRecord, options: Options) -> bytes:
    """The file of an episode.

    Raises:
        RecordError: readers would be misled by it.
    """
    _refuse(record, options)
    chosen, stamps = _chosen(record, options)
    refuse_short(record, NAME, float(stamps[-1] - stamps[0]) if len(stamps) else 0.0, LEAST)
    poses = _local_poses(record, chosen)
    steps = np.zeros(poses.shape)
    steps[1:] = poses[:-1] - poses[1:]
    if not options.original:
        steps[..., 2] = turned_by(steps[..., 2])
    commands = _stick(record, chosen)
    parts: tuple[Any, ...] = (
        chosen,
        stamps.tolist(),
        commands.tolist(),
        poses.tolist(),
        steps.tolist(),
        *_still(record, chosen),
    )
    frames = [_frame(record, *part) for part in zip(*parts, strict=True)]
    if options.original:
        return _as_the_original(frames)
    frames = [frame | {"ID": record.id} for frame in frames]
    return b"[\n" + b",\n".join(orjson.dumps(frame, option=orjson.OPT_SORT_KEYS) for frame in frames) + b"\n]\n"


def original_name(record: EpisodeRecord) -> str:
    """The name that the original gave its files, with colons, which Windows does not take.

    The minute stands for the episode, since when it was recorded is not in the file.
    """
    from datetime import UTC, datetime

    start = datetime.fromtimestamp(_start(record), UTC)
    return f"{record.contributor or 'default'}__{start:%Y-%m-%d__%H:%M:%S}.json"


def _refuse(record: EpisodeRecord, options: Options) -> None:
    refuse_without_robot(record, NAME)
    refuse_absences(record, NAME)
    refuse_ids(record, NAME)
    refuse_uneven(record, NAME)
    refuse_relations(record, NAME, ORIGINAL_RELATIONS if options.original else RELATIONS)


def _start(record: EpisodeRecord) -> float:
    return _EPOCH + _APART * record.episode


def _chosen(record: EpisodeRecord, options: Options) -> tuple[list[int], Array]:
    """The looks that are saved, and their stamps, s.

    The original ran by the wall clock: at each tick it saved if more than 0.1 s had passed since the last frame,
    which in floating point is now this tick, now the next one.
    """
    looks = len(record) + ("command" in record.document["final"])
    if not options.original:
        return list(range(looks)), exact_stamps(record.looks.tick[:looks], record.scene().rules.dt)
    clock = _start(record) + record.looks.time[:looks]
    kept: list[int] = []
    for look, now in enumerate(clock.tolist()):
        if not kept or now - float(clock[kept[-1]]) > _PERIOD:
            kept.append(look)
    return kept, clock[kept]


def _local_poses(record: EpisodeRecord, chosen: list[int]) -> Array:
    """People, then objects, as the robot sees them: (T, P + O, 3), columns x, y, a."""
    scene, looks = record.scene(), record.looks
    people = looks.humans[chosen][..., 0:3]
    still = np.array([(*f.pose.position, f.pose.theta) for f in scene.furniture], dtype=float).reshape(-1, 3)
    things = np.broadcast_to(still, (len(chosen), *still.shape))
    world = np.concatenate((people, things), axis=1)
    robot = looks.robot[chosen][:, None, 0:3]
    place = local(world[..., 0:2], robot)
    angle = -turned_by(world[..., 2] - robot[..., 2] + np.pi / 2)
    return np.concatenate((place, angle[..., None]), axis=-1)


def local(points: Array, robot: Array) -> Array:
    """World points in the format's frame of the robot: to its right, and ahead.

    Args:
        points: (T, K, 2), m.
        robot: (T, 1, 3), columns x, y, theta.

    Returns:
        (T, K, 2), m.
    """
    c, s = np.cos(robot[..., 2]), np.sin(robot[..., 2])
    dx, dy = points[..., 0] - robot[..., 0], points[..., 1] - robot[..., 1]
    return np.stack((dx * s - dy * c, dx * c + dy * s), axis=-1)


def _still(record: EpisodeRecord, chosen: list[int]) -> tuple[Any, Any]:
    """Walls, (T, W, 4), and the goal, (T, 2), as the robot sees them."""
    scene, robot = record.scene(), record.looks.robot[chosen][:, None, 0:3]
    ends = np.array([point for wall in scene.walls for point in (wall.start, wall.end)], dtype=float).reshape(1, -1, 2)
    walls = local(np.broadcast_to(ends, (len(chosen), *ends.shape[1:])), robot).reshape(len(chosen), -1, 4)
    goal = local(np.broadcast_to(np.array(scene.goal.position), (len(chosen), 1, 2)), robot)[:, 0]
    return walls.tolist(), goal.tolist()


def _stick(record: EpisodeRecord, chosen: list[int]) -> Array:
    """Commands as a stick gives them, (T, 3): ahead, to the right (readers take it as -1..1), clockwise."""
    limits, final = record.scene().robot.limits, record.document["final"]
    asked = np.concatenate((record.command, [final.get("command", (0.0, 0.0, 0.0))]))[chosen]
    scale = np.array([1.0 / limits.ahead, -1.0 / limits.sideways, -1.0 / limits.turn])
    stick = np.clip(asked * scale, -1.0, 1.0) * np.array([ADVANCE, 1.0, ROTATION]) + 0.0
    return np.asarray(stick)


def _frame(
    record: EpisodeRecord,
    look: int,
    stamp: float,
    command: list[float],
    poses: list[list[float]],
    steps: list[list[float]],
    walls: list[list[float]],
    goal: list[float],
) -> Tree:
    scene, frames = record.scene(), record.document["frames"]
    told = frames[look] if look < len(frames) else record.document["final"]
    people = len(scene.humans)
    entities = [
        {"x": x, "y": y, "a": a, "vx": vx, "vy": vy, "va": va}
        for (x, y, a), (vx, vy, va) in zip(poses, steps, strict=True)
    ]
    return {
        "command": command,
        "goal": [{"x": goal[0], "y": goal[1]}],
        "interaction": _interactions(scene, told["interactions"]),
        "objects": [
            {"id": thing.id, **_size(thing.shape), **entity}
            for thing, entity in zip(scene.furniture, entities[people:], strict=True)
        ],
        "people": [{"id": human.id, **entity} for human, entity in zip(scene.humans, entities, strict=False)],
        "timestamp": stamp,
        "walls": [{"x1": x1, "y1": y1, "x2": x2, "y2": y2} for x1, y1, x2, y2 in walls],
    }


def _interactions(scene: Scene, rows: list[list[Any]]) -> list[Tree]:
    """As readers know them: whoever is at a laptop is tied to the table it stands on."""
    carrier = {thing.id: thing.on for thing in scene.furniture if thing.on is not None}
    return [
        {"src": src, "relation": relation, "dst": carrier.get(dst, dst) if relation == AT_LAPTOP else dst}
        for src, relation, dst in rows
    ]


def _size(shape: Shape) -> Tree:
    """Extent of the box round a thing, along its own x and y, m."""
    if isinstance(shape, Disc):
        return {"size_x": 2 * shape.radius, "size_y": 2 * shape.radius}
    return {"size_x": shape.length, "size_y": shape.width}


def _as_the_original(frames: list[Tree]) -> bytes:
    """Seven keys a frame, sorted, indented by four; a lateral command that is always the integer 0.

    Raises:
        RecordError: it would be no JSON.
    """
    for frame in frames:
        frame["command"][1] = 0
    try:
        return json.dumps(frames, indent=4, sort_keys=True, allow_nan=False).encode()
    except ValueError as error:
        raise RecordError(f"a {NAME} file holds finite numbers only: {error}") from error
