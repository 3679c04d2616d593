"""Reading `sonata` files: the room stands still, so the way of the robot is had from how the walls move before it.

The world frame is the robot's first one: it starts at (0, 0), heading for +y.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..entities import AT_LAPTOP, AT_PLANT, RELATIONS
from ..exact import Array
from ..humans import ACTIVITIES
from ..record.canonical import rounded, rounded_rows
from ..record.layout import Tree
from .form import Options, parsing
from .given import load_json, numbers, table
from .imported import ROBOT, Found, document_of, goal_of, radii_that_fit
from .motion import activity_of, box_round, polygon_of, turned_by, velocities
from .sonata import ADVANCE, NAME, ROTATION

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
    return np.concatenate((place, turned_by(turn + np.pi / 2)[:, None]), axis=1)


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
    poses = np.concatenate((place, turned_by(turn - bodies[..., 2])[..., None]), axis=-1)
    humans = np.concatenate((poses[:, :count], velocities(time, poses[:, :count])), axis=-1)
    humans = np.concatenate((humans, humans[..., 2:3]), axis=-1)  # the head is not told: as the body
    known = {*people, *things}
    ties = [_interactions(frame["interaction"], set(people), known) for frame in frames]
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


def _interactions(rows: list[Tree], people: set[int], known: set[int]) -> list[list[Any]]:
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
