"""`sonata`: frame lists of the SONATA toolkit (2020), in the robot frame: +x right, +y ahead, angles clockwise."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.entities import AT_LAPTOP, AT_PLANT, RELATIONS
from ..core.geometry import Disc, Shape
from ..core.humans import ACTIVITIES
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.vectors import wrap_angles
from ..errors import RecordError
from ..record.canonical import rounded, rounded_rows
from ..record.layout import Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing
from .imported import (
    ROBOT,
    Found,
    activity_of,
    box_round,
    document_of,
    goal_of,
    polygon_of,
    radii_that_fit,
    velocities,
)
from .parse import load_json, numbers, table
from .refuse import refuse_absences, refuse_ids, refuse_relations, refuse_short, refuse_uneven, refuse_without_robot
from .timestamps import exact_stamps

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
        steps[..., 2] = wrap_angles(steps[..., 2])
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
    angle = -wrap_angles(world[..., 2] - robot[..., 2] + np.pi / 2)
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


_STILL = 0.05  # m, that walls may seem to move
_LACKS = (
    "humans.radius", "humans.group", "humans.head", "objects.on", "objects.type", "robot.radius", "goal.theta",
    "goal.distance", "goal.angle",
)  # fmt: skip
_DERIVED = ("frames.robot", "frames.humans", "frames.activity", "room.polygon")
_DOING = {RELATIONS[0]: "talking", AT_LAPTOP: "using", AT_PLANT: "looking", RELATIONS[3]: "walking together"}


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The episode of a file.

    Raises:
        RecordError: it is damaged, its entities change, or nothing in it stands still to tell the robot's way.
    """
    frames = load_json(path, NAME)
    with parsing(path, NAME):
        yield document_of(_found(frames), NAME, path)


def _found(frames: Any) -> Found:
    if not isinstance(frames, list) or len(frames) < 2:
        raise ValueError("it must be a list of two frames or more")
    people, things = _ids(frames, "people"), _ids(frames, "objects")
    stamps = numbers(frames, ("timestamp",), "frames")[:, 0]
    time = stamps - stamps[0]
    if not (np.diff(time) > 5e-5).all():
        raise ValueError(f"timestamps must rise, frame {int(np.argmin(np.diff(time))) + 1} does not")
    walls = _block(frames, "walls", ("x1", "y1", "x2", "y2"))
    bodies = np.concatenate([_block(frames, key, ("x", "y", "a"), ids) for key, ids in _kinds(people, things)], axis=1)
    goal = _block(frames, "goal", ("x", "y"))
    if goal.shape[1] != 1:
        raise ValueError(f"a frame has one goal, got {goal.shape[1]}")
    robot = _way(_anchors(walls, bodies[:, len(people) :, 0:2], goal))
    return _in_the_world(frames, time, robot, bodies, walls, goal, people, things)


def _kinds(people: list[int], things: list[int]) -> tuple[tuple[str, list[int]], ...]:
    return ("people", people), ("objects", things)


def _ids(frames: list[Tree], key: str) -> list[int]:
    """Ids under a key, in the first frame's order."""
    ids = [entity["id"] for entity in frames[0][key]]
    for t, frame in enumerate(frames):
        found = [entity["id"] for entity in frame[key]]
        if any(type(id) is not int for id in found) or len(set(found)) != len(found):
            raise ValueError(f"ids of {key} in frame {t} must be different integers")
        if sorted(found) != sorted(ids):
            raise ValueError(f"{key} change at frame {t}; an episode of this format has the same throughout")
    return ids


def _block(frames: list[Tree], key: str, names: tuple[str, ...], ids: list[int] | None = None) -> Array:
    """(T, K, columns) of what all frames hold under a key, in the order of ids if there are any."""
    blocks = []
    for t, frame in enumerate(frames):
        rows = frame[key]
        if ids is not None:
            by_id = {row["id"]: row for row in rows}
            rows = [by_id[id] for id in ids]
        blocks.append(numbers(rows, names, f"{key} in frame {t}"))
        if blocks[-1].shape != blocks[0].shape:
            raise ValueError(f"the number of {key} changes at frame {t}")
    return np.array(blocks)


def _anchors(walls: Array, things: Array, goal: Array) -> Array:
    """(T, K, 2): what stands still in the room, as the robot sees it."""
    if walls.shape[1]:
        return walls.reshape(len(walls), -1, 2)
    return np.concatenate((things, goal), axis=1)


def _way(anchors: Array) -> Array:
    """The robot's poses, (T, 3), by the rigid motion that takes each frame's anchors to the first frame's."""
    first = anchors[0] - anchors[0].mean(axis=0)
    if len(first) < 2 or np.hypot(*first.T).max() < 0.1:
        raise ValueError("nothing in it stands still (walls, or two objects) to tell the robot's way by")
    seen = anchors - anchors.mean(axis=1, keepdims=True)
    dot = (seen * first).sum(axis=(1, 2))
    cross = (seen[..., 0] * first[..., 1] - seen[..., 1] * first[..., 0]).sum(axis=1)
    turn = np.arctan2(cross, dot)
    place = anchors[0].mean(axis=0) - _turned(anchors.mean(axis=1), turn)
    off = _turned(anchors, turn[:, None]) + place[:, None] - anchors[0]
    worst = np.hypot(off[..., 0], off[..., 1]).max(axis=1)
    if worst.max() > _STILL:
        raise ValueError(f"its walls move by {worst.max():.2f} m at frame {int(np.argmax(worst))}")
    return np.concatenate((place, wrap_angles(turn + np.pi / 2)[:, None]), axis=1)


def _refuse_motion(places: Array, names: list[str]) -> None:
    """Things and the goal stand still in an episode; (T, K, 2), m."""
    off = np.hypot(*np.moveaxis(places - places[0], -1, 0))
    if off.max() > _STILL:
        t, k = np.unravel_index(int(np.argmax(off)), off.shape)
        raise ValueError(f"{names[k]} has moved by {off[t, k]:.2f} m at frame {t}; in an episode it stands still")


def _turned(points: Array, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((points[..., 0] * c - points[..., 1] * s, points[..., 0] * s + points[..., 1] * c), axis=-1)


def _in_the_world(
    frames: list[Tree], time: Array, robot: Array, bodies: Array, walls: Array, goal: Array,
    people: list[int], things: list[int],
) -> Found:  # fmt: skip
    turn, count = robot[:, None, 2] - np.pi / 2, len(people)
    place = _turned(bodies[..., 0:2], turn) + robot[:, None, 0:2]
    standing = np.concatenate((place[:, count:], _turned(goal, turn) + robot[:, None, 0:2]), axis=1)
    _refuse_motion(standing, [*(f"object {id}" for id in things), "the goal"])
    poses = np.concatenate((place, wrap_angles(turn - bodies[..., 2])[..., None]), axis=-1)
    humans = np.concatenate((poses[:, :count], velocities(time, poses[:, :count])), axis=-1)
    humans = np.concatenate((humans, humans[..., 2:3]), axis=-1)  # the head is not told: as the body
    known = {*people, *things}
    ties = [_read_interactions(frame["interaction"], set(people), known) for frame in frames]
    polygon, corners = polygon_of(walls[0]), walls[0].reshape(-1, 2)
    everything = np.concatenate((place.reshape(-1, 2), robot[:, 0:2], corners))
    return Found(
        time=time,
        robot=np.concatenate((robot, velocities(time, robot)), axis=1),
        humans=humans,
        ids=people,
        radii=radii_that_fit(humans, walls[0]),
        activity=_activity(humans, people, ties),
        interactions=ties,
        polygon=box_round(everything, 1.0) if polygon is None else polygon,
        walls=walls[0],
        objects=_objects(frames[0], things, poses[0, count:]),
        goal=goal_of(goal[0, 0].tolist()),
        robot_radius=ROBOT.radius,
        share=_shares(frames),
        lacks=_LACKS,
        derived=_DERIVED,
    )


def _read_interactions(rows: list[Tree], people: set[int], known: set[int]) -> list[list[Any]]:
    ties = [[row["src"], row["relation"], row["dst"]] for row in rows]
    for src, relation, dst in ties:
        if src not in people or dst not in known or relation not in RELATIONS:
            raise ValueError(f"interaction {relation} of {src} and {dst}: unknown, or of nobody in the frame")
    return ties


def _activity(humans: Array, ids: list[int], ties: list[list[list[Any]]]) -> Any:
    """By interactions, else by speed."""
    activity = activity_of(humans[..., 3:5])
    for t, rows in enumerate(ties):
        for src, relation, dst in rows:
            doing = ACTIVITIES.index(_DOING.get(relation, "looking"))
            for id in {src, dst} & set(ids):
                activity[t, ids.index(id)] = doing
    return activity


def _objects(frame: Tree, ids: list[int], poses: Array) -> list[Tree]:
    """Things where they first stand; what they are follows from who attends to them."""
    kinds = {tie["dst"]: "plant" for tie in frame["interaction"] if tie["relation"] == AT_PLANT}
    kinds |= {tie["dst"]: "table" for tie in frame["interaction"] if tie["relation"] == AT_LAPTOP}
    by_id = {thing["id"]: thing for thing in frame["objects"]}
    sizes = rounded(numbers([by_id[id] for id in ids], ("size_x", "size_y"), "objects")).tolist()
    placed = rounded_rows(poses, [2]).tolist()
    return [
        {
            "id": id, "type": kinds.get(id, "object"), "x": x, "y": y, "theta": theta,
            "shape": {"type": "rectangle", "length": length, "width": width}, "on": None,
        }
        for id, (x, y, theta), (length, width) in zip(ids, placed, sizes, strict=True)
    ]  # fmt: skip


def _shares(frames: list[Tree]) -> Array:
    """Commands as shares of the robot's limits; what the stick's scale meant in m/s is nowhere told."""
    stick = table([frame["command"] for frame in frames], 3, "command of frames")
    share: Array = stick * np.array([1.0 / ADVANCE, -1.0, -1.0 / ROTATION])
    return share


FORMAT = Format(
    "robot-frame frame lists of the 2020 toolkit, which SNGNN2D-v2 reads too", ".json", import_, export=export
)
