"""`sonata`: frame lists of the SONATA toolkit (2020), in the robot frame: +x right, +y ahead, angles clockwise."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.furniture_types import LAPTOP, PLANT
from ..core.geometry import Shape
from ..core.portable_math import Array, IntArray
from ..core.relations import ACTIVITIES, AT_LAPTOP, ORIGINAL_RELATIONS, RELATION, RELATIONS
from ..core.scene import Scene
from ..core.vectors import wrap_angles
from ..errors import RecordError
from ..record.canonical import rounded, rounded_rows
from ..record.files import safe_stem, safe_text
from ..record.layout import JsonDict
from ..record.motion import motion_of
from ..record.record import EpisodeRecord
from . import estimates
from .estimates import POSE, POSITION, THETA, VELOCITY
from .format import (
    ROBOT_OPTIONS,
    Format,
    Options,
    exact_stamps,
    require_all_present,
    require_consecutive_ids,
    require_duration,
    require_even_times,
    require_known_relations,
    require_robot,
)
from .imported import ROBOT, SourceEpisode, episode_document, goal_of, object_row
from .importing import load_json, numbers, parsing, table

NAME = "sonata"
_ADVANCE, _ROTATION = 3.5, 4.0  # joystick values at full deflection
_MINIMUM_DURATION = 2.0  # s; readers make no graph of a shorter file, and stop if it is the only one
_EPOCH = 1_595_000_000.0  # s since 1970, July 2020: nominal start of the original's first episode
_EPISODE_OFFSET = 3600.0  # s between the nominal starts of episodes
_PERIOD = 0.1  # s; the original saved a frame when more time than this had passed


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the frame list of an episode.

    Raises:
        UnsuitableEpisode: readers of the format would misinterpret the episode.
    """
    _check_exportable(record, options)
    ticks, stamps = _saved_ticks(record, options)
    require_duration(record, NAME, float(stamps[-1] - stamps[0]) if len(stamps) else 0.0, _MINIMUM_DURATION)
    poses = _local_poses(record, ticks)
    steps = np.zeros(poses.shape)  # the format's velocities: previous pose minus this one, per frame
    steps[1:] = poses[:-1] - poses[1:]
    if not options.original:  # the original's angular velocities jump by 2 pi
        steps[..., THETA] = wrap_angles(steps[..., THETA])
    commands = _joystick(record, ticks)
    columns: tuple[Any, ...] = (
        ticks,
        stamps.tolist(),
        commands.tolist(),
        poses.tolist(),
        steps.tolist(),
        *_walls_and_goal(record, ticks),
    )
    frames = [_frame(record, *row) for row in zip(*columns, strict=True)]
    if options.original:
        return _original_text(frames)
    frames = [frame | {"ID": record.id} for frame in frames]  # SNGNN2D-v2 reads it
    return b"[\n" + b",\n".join(orjson.dumps(frame, option=orjson.OPT_SORT_KEYS) for frame in frames) + b"\n]\n"


def original_name(record: EpisodeRecord) -> str:
    """Return the file name that the original would use; it has colons, which Windows does not allow.

    The date is nominal, an hour per episode, as the date of the recording is not in the episode file.
    """
    from datetime import UTC, datetime

    start = datetime.fromtimestamp(_nominal_start(record), UTC)
    name = record.contributor or "default"
    # what would lead to another folder, or is no name everywhere, is replaced
    return f"{name if safe_text(name) == name else safe_stem(name)}__{start:%Y-%m-%d__%H:%M:%S}.json"


def _check_exportable(record: EpisodeRecord, options: Options) -> None:
    require_robot(record, NAME)
    require_all_present(record, NAME)
    require_consecutive_ids(record, NAME)
    require_even_times(record, NAME)
    require_known_relations(record, NAME, ORIGINAL_RELATIONS if options.original else RELATIONS)


def _nominal_start(record: EpisodeRecord) -> float:
    """s since 1970."""
    return _EPOCH + _EPISODE_OFFSET * record.episode


def _saved_ticks(record: EpisodeRecord, options: Options) -> tuple[list[int], Array]:
    """The ticks that are saved, and their time stamps, s.

    The original ran by the wall clock: at each tick it saved a frame if more than 0.1 s had passed since the last one,
    which in floating point holds after one tick or after two.
    """
    count = len(record) + ("command" in record.document["final"])
    if not options.original:
        return list(range(count)), exact_stamps(record.states.tick[:count], record.scene().rules.dt)
    clock = _nominal_start(record) + record.states.time[:count]
    saved: list[int] = []
    for tick, now in enumerate(clock.tolist()):
        if not saved or now - float(clock[saved[-1]]) > _PERIOD:
            saved.append(tick)
    return saved, clock[saved]


def _local_poses(record: EpisodeRecord, ticks: list[int]) -> Array:
    """Poses of pedestrians, objects, and robots that are objects, in the robot frame: (T, K, 3), columns x, y, a."""
    scene, states = record.scene(), record.states
    people = states.humans[ticks][..., POSE]
    furniture = np.array([(*f.pose.position, f.pose.theta) for f in scene.furniture], dtype=float).reshape(-1, 3)
    objects = np.broadcast_to(furniture, (len(ticks), *furniture.shape))
    world = np.concatenate((people, objects, states.robots[ticks][..., POSE]), axis=1)
    robot = states.robot[ticks][:, None, POSE]
    position = _to_robot_frame(world[..., POSITION], robot)
    angle = -wrap_angles(world[..., THETA] - robot[..., THETA] + np.pi / 2)
    return np.concatenate((position, angle[..., None]), axis=-1)


def _to_robot_frame(points: Array, robot: Array) -> Array:
    """Transform world points into the format's robot frame, x to the right and y ahead.

    Args:
        points: (T, K, 2), m.
        robot: (T, 1, 3), columns x, y, theta.

    Returns:
        (T, K, 2), m.
    """
    c, s = np.cos(robot[..., THETA]), np.sin(robot[..., THETA])
    dx, dy = points[..., 0] - robot[..., 0], points[..., 1] - robot[..., 1]
    return np.stack((dx * s - dy * c, dx * c + dy * s), axis=-1)


def _walls_and_goal(record: EpisodeRecord, ticks: list[int]) -> tuple[Any, Any]:
    """Walls, (T, W, 4), and the goal, (T, 2), in the robot frame, as lists."""
    robot = record.states.robot[ticks][:, None, POSE]
    ends = motion_of(record).walls[ticks].reshape(len(ticks), -1, 2)
    walls = _to_robot_frame(ends, robot).reshape(len(ticks), -1, 4)
    goal = _to_robot_frame(record.goals[ticks][:, None, :2], robot)[:, 0]
    return walls.tolist(), goal.tolist()


def _joystick(record: EpisodeRecord, ticks: list[int]) -> Array:
    """Commands as joystick values, (T, 3): ahead, to the right (readers expect -1..1), clockwise."""
    limits, final = record.scene().robot.limits, record.document["final"]
    command = np.concatenate((record.command, [final.get("command", (0.0, 0.0, 0.0))]))[ticks]
    scale = np.array([1.0 / limits.ahead, -1.0 / limits.sideways, -1.0 / limits.turn])
    joystick = np.clip(command * scale, -1.0, 1.0) * np.array([_ADVANCE, 1.0, _ROTATION]) + 0.0  # + 0.0: no -0.0
    return np.asarray(joystick)


def _frame(
    record: EpisodeRecord,
    tick: int,
    stamp: float,
    command: list[float],
    poses: list[list[float]],
    steps: list[list[float]],
    walls: list[list[float]],
    goal: list[float],
) -> JsonDict:
    scene, frames = record.scene(), record.document["frames"]
    recorded = frames[tick] if tick < len(frames) else record.document["final"]
    people = len(scene.humans)
    things = [(thing.id, thing.shape) for thing in scene.furniture]
    things += [(other.id, other.robot.outline) for other in scene.robots]
    entities = [
        {"x": x, "y": y, "a": a, "vx": vx, "vy": vy, "va": va}
        for (x, y, a), (vx, vy, va) in zip(poses, steps, strict=True)
    ]
    return {
        "command": command,
        "goal": [{"x": goal[0], "y": goal[1]}],
        "interaction": _interactions(scene, recorded["interactions"]),
        "objects": [
            {"id": id, **_size(shape), **entity} for (id, shape), entity in zip(things, entities[people:], strict=True)
        ],
        "people": [{"id": human.id, **entity} for human, entity in zip(scene.humans, entities, strict=False)],
        "timestamp": stamp,
        "walls": [{"x1": x1, "y1": y1, "x2": x2, "y2": y2} for x1, y1, x2, y2 in walls],
    }


def _interactions(scene: Scene, rows: list[list[Any]]) -> list[JsonDict]:
    """Interactions as the format defines them: with the table instead of the laptop on it."""
    carrier = {thing.id: thing.on for thing in scene.furniture if thing.on is not None}
    return [
        {"src": src, "relation": relation, "dst": carrier.get(dst, dst) if relation == AT_LAPTOP else dst}
        for src, relation, dst in rows
    ]


def _size(shape: Shape) -> JsonDict:
    """Extent of the bounding box along the object's own x and y, m."""
    return dict(zip(("size_x", "size_y"), shape.sides, strict=True))


def _original_text(frames: list[JsonDict]) -> bytes:
    """The original's text: seven keys per frame, sorted, indented by four; the lateral command is the integer 0.

    Raises:
        RecordError: a value is not finite.
    """
    for frame in frames:
        frame["command"][1] = 0
    try:
        return json.dumps(frames, indent=4, sort_keys=True, allow_nan=False).encode()
    except ValueError as error:
        raise RecordError(f"a {NAME} file holds finite numbers only: {error}") from error


_TOLERANCE = 0.05  # m, apparent motion of walls, objects and the goal
_MISSING = (
    "humans.radius", "humans.group", "humans.head", "objects.on", "objects.type", "robot.radius", "goal.theta",
    "goal.distance", "goal.angle",
)  # fmt: skip
_DERIVED = ("frames.robot", "frames.humans", "frames.activity", "room.polygon")
_TYPE_OF = {kind.relation: kind.on or kind.name for kind in (LAPTOP, PLANT)}  # a laptop stands for its table


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode of a file; the world frame is the robot's first frame, as the format does not record one.

    Raises:
        RecordError: the file is damaged, its entities change, or it holds nothing static that shows the robot's motion.
    """
    frames = load_json(path, NAME)
    with parsing(path, NAME):
        yield episode_document(_source_episode(frames), NAME, path)


def _source_episode(frames: Any) -> SourceEpisode:
    if not isinstance(frames, list) or len(frames) < 2:
        raise ValueError("it must be a list of two frames or more")
    people, objects = _ids(frames, "people"), _ids(frames, "objects")
    time = estimates.elapsed(numbers(frames, ("timestamp",), "frames")[:, 0], "frame")
    walls = _block(frames, "walls", ("x1", "y1", "x2", "y2"))
    entities = (("people", people), ("objects", objects))
    bodies = np.concatenate([_block(frames, key, ("x", "y", "a"), ids) for key, ids in entities], axis=1)
    goal = _block(frames, "goal", ("x", "y"))
    if goal.shape[1] != 1:
        raise ValueError(f"a frame must have one goal, got {goal.shape[1]}")
    robot = _robot_poses(_landmarks(walls, bodies[:, len(people) :, POSITION], goal))
    return _to_world(frames, time, robot, bodies, walls, goal, people, objects)


def _ids(frames: list[JsonDict], key: str) -> list[int]:
    """Ids under a key, in the first frame's order."""
    ids = [entity["id"] for entity in frames[0][key]]
    for t, frame in enumerate(frames):
        frame_ids = [entity["id"] for entity in frame[key]]
        if any(type(id) is not int for id in frame_ids) or len(set(frame_ids)) != len(frame_ids):
            raise ValueError(f"ids of {key} in frame {t} must be unique integers")
        if sorted(frame_ids) != sorted(ids):
            raise ValueError(f"{key} change at frame {t}; an episode of this format has the same throughout")
    return ids


def _block(frames: list[JsonDict], key: str, names: tuple[str, ...], ids: list[int] | None = None) -> Array:
    """(T, K, columns) of the entities under a key in all frames; in the order of `ids` unless it is None."""
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


def _landmarks(walls: Array, objects: Array, goal: Array) -> Array:
    """(T, K, 2): points that are static in the world, in the robot frame."""
    if walls.shape[1]:
        return walls.reshape(len(walls), -1, 2)
    return np.concatenate((objects, goal), axis=1)


def _robot_poses(landmarks: Array) -> Array:
    """The robot's poses, (T, 3), from the least-squares rigid motion of the landmarks onto the first frame."""
    first = landmarks[0] - landmarks[0].mean(axis=0)
    if len(first) < 2 or np.hypot(*first.T).max() < 0.1:
        raise ValueError("it has no walls, and fewer than two static points, so the robot's motion cannot be found")
    centred = landmarks - landmarks.mean(axis=1, keepdims=True)
    dot = (centred * first).sum(axis=(1, 2))
    cross = (centred[..., 0] * first[..., 1] - centred[..., 1] * first[..., 0]).sum(axis=1)
    turn = np.arctan2(cross, dot)
    position = landmarks[0].mean(axis=0) - _rotate(landmarks.mean(axis=1), turn)
    residual = _rotate(landmarks, turn[:, None]) + position[:, None] - landmarks[0]
    worst = np.hypot(residual[..., 0], residual[..., 1]).max(axis=1)
    if worst.max() > _TOLERANCE:
        raise ValueError(f"its walls move by {worst.max():.2f} m at frame {int(np.argmax(worst))}")
    return np.concatenate((position, wrap_angles(turn + np.pi / 2)[:, None]), axis=1)


def _check_static(positions: Array, names: list[str]) -> None:
    """Check that objects and goal, (T, K, 2), m, stand still, as in every episode."""
    distance = np.hypot(*np.moveaxis(positions - positions[0], -1, 0))
    if distance.max() > _TOLERANCE:
        t, k = np.unravel_index(int(np.argmax(distance)), distance.shape)
        raise ValueError(f"{names[k]} has moved by {distance[t, k]:.2f} m at frame {t}; in an episode it stands still")


def _rotate(points: Array, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack((points[..., 0] * c - points[..., 1] * s, points[..., 0] * s + points[..., 1] * c), axis=-1)


def _to_world(
    frames: list[JsonDict], time: Array, robot: Array, bodies: Array, walls: Array, goal: Array,
    people: list[int], objects: list[int],
) -> SourceEpisode:  # fmt: skip
    """Transform everything from the robot frame of each frame into the world frame."""
    turn, count = robot[:, None, THETA] - np.pi / 2, len(people)
    position = _rotate(bodies[..., POSITION], turn) + robot[:, None, POSITION]
    static = np.concatenate((position[:, count:], _rotate(goal, turn) + robot[:, None, POSITION]), axis=1)
    _check_static(static, [*(f"object {id}" for id in objects), "the goal"])
    poses = np.concatenate((position, wrap_angles(turn - bodies[..., THETA])[..., None]), axis=-1)
    humans = estimates.with_velocities(time, poses[:, :count])
    ids = {*people, *objects}
    interactions = [_read_interactions(frame["interaction"], set(people), ids) for frame in frames]
    points = np.concatenate((position.reshape(-1, 2), robot[:, POSITION]))
    return SourceEpisode(
        time=time,
        robot=np.concatenate((robot, estimates.velocities(time, robot)), axis=1),
        humans=humans,
        ids=people,
        radii=estimates.fitting_radii(humans, walls[0]),
        activity=_activity(humans, people, interactions),
        interactions=interactions,
        polygon=estimates.room_around(walls[0], points),
        walls=walls[0],
        objects=_objects(frames[0], objects, poses[0, count:]),
        goal=goal_of(goal[0, 0].tolist()),
        robot_radius=ROBOT.radius,
        command_fraction=_command_fractions(frames),
        missing=_MISSING,
        derived=_DERIVED,
    )


def _read_interactions(rows: list[JsonDict], people: set[int], ids: set[int]) -> list[list[Any]]:
    interactions = [[row["src"], row["relation"], row["dst"]] for row in rows]
    for src, relation, dst in interactions:
        if src not in people or dst not in ids or relation not in RELATIONS:
            raise ValueError(f"interaction {relation} of {src} and {dst}: unknown relation, or an id not in the frame")
    return interactions


def _activity(humans: Array, ids: list[int], interactions: list[list[list[Any]]]) -> IntArray:
    """Activities by interaction; of pedestrians without interactions by speed."""
    activity = estimates.activity_of(humans[..., VELOCITY])
    for t, rows in enumerate(interactions):
        for src, relation, dst in rows:
            index = ACTIVITIES.index(RELATION[relation].activity)
            for id in {src, dst} & set(ids):
                activity[t, ids.index(id)] = index
    return activity


def _objects(frame: JsonDict, ids: list[int], poses: Array) -> list[JsonDict]:
    """The objects at their first poses; their types follow from the interactions with them."""
    types = {row["dst"]: _TYPE_OF[row["relation"]] for row in frame["interaction"] if row["relation"] in _TYPE_OF}
    by_id = {thing["id"]: thing for thing in frame["objects"]}
    sizes = rounded(numbers([by_id[id] for id in ids], ("size_x", "size_y"), "objects")).tolist()
    placed = rounded_rows(poses, [THETA]).tolist()
    return [
        object_row(id, types.get(id, "object"), pose, {"type": "rectangle", "length": length, "width": width})
        for id, pose, (length, width) in zip(ids, placed, sizes, strict=True)
    ]


def _command_fractions(frames: list[JsonDict]) -> Array:
    """Commands as fractions of the robot's limits; the format does not give the scale of the joystick in m/s."""
    joystick = table([frame["command"] for frame in frames], 3, "command of frames")
    fraction: Array = joystick * np.array([1.0 / _ADVANCE, -1.0, -1.0 / _ROTATION])
    return fraction


FORMAT = Format(
    "robot-frame frame lists of the SONATA toolkit (2020), also read by SNGNN2D-v2",
    ".json",
    import_,
    export=export,
    options=frozenset({"original"}) | ROBOT_OPTIONS,
)
