"""`socnav3`: trajectory files of the SocNav3 data set, world frame, one step per snapshot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.entities import Furniture
from ..core.geometry import Disc, Shape, inside_polygon
from ..core.portable_math import Array
from ..core.scene import Scene
from ..errors import RecordError
from ..record.canonical import refuse_unfinite, rounded, rounded_rows
from ..record.layout import HUMAN_ANGLES, HUMAN_NAMES, ROBOT_ANGLES, ROBOT_NAMES, Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing
from .imported import Found, activity_of, box_round, document_of, goal_of, polygon_of, radii_that_fit, velocities
from .parse import load_json, numbers, table
from .refuse import refuse_absences, refuse_short, refuse_uneven, refuse_without_robot
from .timestamps import exact_stamps

CELL = 0.05  # m
_RIM = 5  # unknown cells round the room
_MOST = 4000  # cells a side
UNKNOWN, FREE, OCCUPIED = -1, 0, 1


def grid_of(scene: Scene) -> Tree:
    """Width, height, cell size, origin and rows of cells from the bottom up: -1 unknown, 0 free, 1 occupied.

    A cell is occupied where its centre lies in a thing that has a body, or within half a cell's diagonal of a wall;
    free elsewhere in the room. The room's box and a rim of 0.25 m are covered, with larger cells above 200 m.
    """
    low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
    cell = CELL * math.ceil(max(float((high - low).max()) / (CELL * (_MOST - 2 * _RIM)), 1.0))
    origin = np.floor(low / cell) * cell - _RIM * cell
    width, height = (math.ceil((high[k] - origin[k]) / cell - 1e-9) + _RIM for k in (0, 1))
    x, y = (origin[k] + (np.arange(count) + 0.5) * cell for k, count in ((0, width), (1, height)))
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    cells = np.where(inside_polygon(centres, scene.outline), FREE, UNKNOWN)
    cells[_occupied(scene, centres, cell)] = OCCUPIED
    return {
        "width": width,
        "height": height,
        "cell_size": cell,
        "x_orig": round(float(origin[0]), 9) + 0.0,
        "y_orig": round(float(origin[1]), 9) + 0.0,
        "angle_orig": 0,
        "data": cells.reshape(height, width).tolist(),
    }


def _occupied(scene: Scene, points: Array, cell: float) -> Any:
    """(M,) of bool."""
    hit = np.zeros(len(points), dtype=bool)
    for wall in scene.walls:
        hit |= _near(points, np.array(wall.start), np.array(wall.end), cell * math.sqrt(0.5))
    for thing in scene.furniture:
        if thing.on is None:
            hit |= _within(points, thing)
    return hit


def _near(points: Array, start: Array, end: Array, reach: float) -> Any:
    """Whether points are within reach of a segment; one at a time, as all at once would fill the memory."""
    along = end - start
    square = float(along @ along)
    share = np.clip((points - start) @ along / square, 0.0, 1.0) if square else np.zeros(len(points))
    off = points - start - share[:, None] * along
    return np.hypot(off[:, 0], off[:, 1]) <= reach


def _within(points: Array, thing: Furniture) -> Any:
    """Whether points are in a thing's outline."""
    offset, (c, s) = points - np.array(thing.pose.position), thing.pose.direction
    if isinstance(thing.shape, Disc):
        return np.hypot(offset[:, 0], offset[:, 1]) <= thing.shape.radius
    ahead, left = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    return (np.abs(ahead) <= thing.shape.length / 2) & (np.abs(left) <= thing.shape.width / 2)


NAME = "socnav3"
TYPES = ("chair", "table", "plant", "tv", "shelf", "floor_lamp")
BODILESS = "laptop"  # the one type besides those that nobody bumps into
_SEEN = ("activity", "interactions", "contacts", "command", "executed", "guarded", "events", "label")


def export(record: EpisodeRecord, options: Options) -> bytes:
    """The file of an episode.

    Raises:
        RecordError: readers would be misled by it.
    """
    _refuse(record)
    document, scene = record.document, record.scene()
    rest = {key: value for key, value in document.items() if key not in ("frames", "final")}
    others = [told for told in document["objects"] if told["type"] not in TYPES]
    file: Tree = {
        "grid": grid_of(scene),
        "walls": [[*wall.start, *wall.end] for wall in scene.walls],
        "sequence": _sequence(record),
    }
    if record.context is not None:
        file["context_description"] = record.context
    if (label := _label(record)) is not None:
        file["label"] = label
    return orjson.dumps(file | {NAME_OF_EXTRAS: {"header": rest, "other_objects": others}}) + b"\n"


NAME_OF_EXTRAS = "sonata2d"


def _refuse(record: EpisodeRecord) -> None:
    refuse_without_robot(record, NAME)
    refuse_absences(record, NAME)
    refuse_uneven(record, NAME)
    dt = record.scene().rules.dt
    refuse_short(record, NAME, dt * len(record), dt)
    if dt < 0.1:
        raise RecordError(f"{record.path}: a tick is {dt:g} s, and readers of {NAME} drop frames less than 0.1 s apart")
    refuse_unfinite(record.looks.robot, ROBOT_NAMES, "the robot")
    refuse_unfinite(record.looks.humans, HUMAN_NAMES, "human", [human.id for human in record.scene().humans])
    for thing in record.scene().furniture:
        if thing.type not in TYPES and thing.type != BODILESS and thing.on is None:
            raise RecordError(
                f"{record.path}: object {thing.id} is of type {thing.type!r}, and {NAME} knows {', '.join(TYPES)} only;"
                " without it its readers would see a way where there is none"
            )


def _label(record: EpisodeRecord) -> float | None:
    """The label of the run, if it is what the format means by one: a number from 0 to 1."""
    label = record.label
    if isinstance(label, dict) and len(label) == 1:
        (label,) = label.values()
    if isinstance(label, bool) or not isinstance(label, int | float) or not 0 <= label <= 1:
        return None
    return float(label)


def _sequence(record: EpisodeRecord) -> list[Tree]:
    """All looks, the final one too."""
    looks, scene = record.looks, record.scene()
    stamps = exact_stamps(looks.tick, scene.rules.dt).tolist()
    told = [*record.document["frames"], record.document["final"]]
    goal = _goal(record)
    objects = [_object(thing) for thing in scene.furniture if thing.type in TYPES]
    shape = _shape(Disc(scene.robot.radius))
    return [
        {
            "timestamp": stamp,
            "robot": _robot(row, shape),
            "people": _people(record, rows),
            "objects": objects,
            "goal": goal,
            NAME_OF_EXTRAS: {key: look[key] for key in _SEEN if key in look},
        }
        for stamp, row, rows, look in zip(stamps, looks.robot, looks.humans.tolist(), told, strict=True)
    ]


def _robot(row: Array, shape: Tree) -> Tree:
    """Velocities in the body frame."""
    x, y, theta, vx, vy, omega = row.tolist()
    c, s = float(np.cos(theta)), float(np.sin(theta))
    return {
        "x": x, "y": y, "angle": theta, "speed_x": vx * c + vy * s, "speed_y": vy * c - vx * s, "speed_a": omega,
        "shape": shape,
    }  # fmt: skip


def _people(record: EpisodeRecord, rows: list[list[float]]) -> list[Tree]:
    """Poses, and under extra keys what else is known of each; velocities in the world frame."""
    return [
        {
            "id": human.id, "x": x, "y": y, "angle": theta, "vx": vx, "vy": vy, "omega": omega, "head": head,
            "radius": human.radius,
        }
        for human, (x, y, theta, vx, vy, omega, head) in zip(record.scene().humans, rows, strict=True)
    ]  # fmt: skip


def _object(thing: Furniture) -> Tree:
    x, y = thing.pose.position
    return {"id": thing.id, "type": thing.type, "x": x, "y": y, "angle": thing.pose.theta, "shape": _shape(thing.shape)}


def _shape(shape: Shape) -> Tree:
    if isinstance(shape, Disc):
        return {"type": "circle", "width": 2 * shape.radius, "length": 2 * shape.radius}
    return {"type": "rectangle", "width": shape.width, "length": shape.length}


def _goal(record: EpisodeRecord) -> dict[str, Any]:
    goal = record.scene().goal
    return {
        "type": "go-to", "human": None, "x": goal.x, "y": goal.y, "angle": goal.theta,
        "pos_threshold": goal.distance, "angle_threshold": goal.angle,
    }  # fmt: skip


_LACKS = ("humans.radius", "humans.group", "humans.head", "frames.interactions", "interactions", "objects.on")
_DERIVED = ("humans.id", "objects.id", "frames.humans.velocity", "frames.activity", "room.polygon")
_STILL = 0.05  # m, that things may seem to move
_SHAPES = ("circle", "rectangle")


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The episode of a file.

    Raises:
        RecordError: it is damaged, or its entities change.
    """
    file = load_json(path, NAME)
    with parsing(path, NAME):
        if not isinstance(file, dict):
            raise ValueError("it must be a JSON object")
        ours = isinstance(file.get(NAME_OF_EXTRAS), dict) and "header" in file[NAME_OF_EXTRAS]
        yield _restored(file) if ours else document_of(_found(file), NAME, path)


def _restored(file: Tree) -> Tree:
    """The document that was exported; what the format itself carries is taken from where its readers look."""
    header: Tree = dict(file[NAME_OF_EXTRAS]["header"])
    software, dt = header.pop("software"), header["rules"]["dt"]
    steps = file["sequence"]
    robot = _robot_rows(steps)
    humans = _human_rows(steps, [human["id"] for human in header["humans"]])
    looks = []
    for t, (step, body, people) in enumerate(zip(steps, robot.tolist(), humans.tolist(), strict=True)):
        time = float(rounded(np.array(t * dt)))
        looks.append({"tick": t, "time": time, "robot": body, "humans": people} | step[NAME_OF_EXTRAS])
    return header | {"frames": [_in_order(look) for look in looks[:-1]], "final": looks[-1], "software": software}


def _in_order(look: Tree) -> Tree:
    """A frame's keys as the recorder writes them."""
    order = ("tick", "time", "robot", "command", "executed", "guarded", "humans", "activity", "interactions")
    return {key: look[key] for key in order} | look


def _robot_rows(steps: list[Tree]) -> Array:
    """(T, 6), as files hold them; the format's velocities are in the body frame."""
    x, y, theta, ahead, left, omega = numbers(
        [step["robot"] for step in steps], ("x", "y", "angle", "speed_x", "speed_y", "speed_a"), "the robot"
    ).T
    c, s = np.cos(theta), np.sin(theta)
    rows = np.stack((x, y, theta, ahead * c - left * s, ahead * s + left * c, omega), axis=1)
    return rounded_rows(rows, ROBOT_ANGLES)


def _human_rows(steps: list[Tree], ids: list[int]) -> Array:
    """(T, N, 7), as files hold them."""
    names = ("id", "x", "y", "angle", "vx", "vy", "omega", "head")
    rows = np.array([numbers(step["people"], names, f"people at step {t}") for t, step in enumerate(steps)])
    rows = rows.reshape(len(steps), -1, len(names))
    if not (rows[..., 0] == np.array(ids, dtype=float)).all():
        raise ValueError(f"people of the steps are not those of the header, {ids}")
    return rounded_rows(rows[..., 1:], HUMAN_ANGLES)


def _found(file: Tree) -> Found:
    steps, walls = file["sequence"], table(file["walls"], 4, "walls")
    if not isinstance(steps, list) or len(steps) < 2:
        raise ValueError("its sequence must be a list of two steps or more")
    stamps = numbers(steps, ("timestamp",), "steps")[:, 0]
    time = stamps - stamps[0]
    if not (np.diff(time) > 5e-5).all():
        raise ValueError(f"timestamps must rise, step {int(np.argmin(np.diff(time))) + 1} does not")
    ids, poses = _poses(steps)
    _refuse_change(steps)
    rates = velocities(time, poses)
    robot = _robot_rows(steps)
    polygon = polygon_of(walls)
    everything = np.concatenate((robot[:, 0:2], poses[..., 0:2].reshape(-1, 2), walls.reshape(-1, 2)))
    context, label = file.get("context_description"), file.get("label")
    return Found(
        time=time,
        robot=robot,
        humans=np.concatenate((poses, rates, poses[..., 2:3]), axis=-1),
        ids=ids,
        radii=radii_that_fit(poses, walls),
        activity=activity_of(rates[..., 0:2]),
        interactions=[[] for _ in steps],
        polygon=box_round(everything[~np.isnan(everything[:, 0])], 1.0) if polygon is None else polygon,
        walls=walls,
        objects=_objects(steps[0]["objects"], ids),
        goal=_read_goal(steps[0]["goal"]),
        robot_radius=_radius(steps[0]["robot"]["shape"]),
        lacks=_LACKS,
        derived=_DERIVED,
        header=({"context": context} if context is not None else {}) | ({"label": label} if label is not None else {}),
    )


def _refuse_change(steps: list[Tree]) -> None:
    """Things and the goal stand still in an episode, and are the same throughout."""
    first = {thing["id"]: thing for thing in steps[0]["objects"]}
    if len(first) != len(steps[0]["objects"]):
        raise ValueError("ids of objects repeat")
    for t, step in enumerate(steps):
        found = {thing["id"]: thing for thing in step["objects"]}
        if set(found) != set(first):
            raise ValueError(f"objects come or go at step {t}; in an episode they are the same throughout")
        pairs = [(f"object {id}", thing, first[id]) for id, thing in found.items()]
        for name, now, then in (*pairs, ("the goal", step["goal"], steps[0]["goal"])):
            places = numbers([now, then], ("x", "y"), name)
            if np.hypot(*(places[0] - places[1])) > _STILL:
                raise ValueError(f"{name} has moved at step {t}; in an episode it stands still")


def _poses(steps: list[Tree]) -> tuple[list[int], Array]:
    """Ids of the people, and (T, N, 3); NaN where they are not present."""
    tables = [numbers(step["people"], ("id", "x", "y", "angle"), f"people at step {t}") for t, step in enumerate(steps)]
    ids = sorted({float(id) for rows in tables for id in rows[:, 0]})
    if any(id != int(id) for id in ids):
        raise ValueError(f"ids of people must be whole numbers, got {ids}")
    column = {id: k for k, id in enumerate(ids)}
    poses = np.full((len(steps), len(ids), 3), np.nan)
    for t, rows in enumerate(tables):
        if len(set(rows[:, 0].tolist())) != len(rows):
            raise ValueError(f"ids of people repeat at step {t}")
        for row in rows:
            poses[t, column[float(row[0])]] = row[1:]
    lowest = int(min([1.0, *ids]))  # 0 is the robot's in an episode
    return [int(id) + 1 - lowest for id in ids], poses


def _objects(rows: list[Tree], people: list[int]) -> list[Tree]:
    """Things where they first stand. Ids that are a person's too, or the robot's, are given anew above all others."""
    placed = rounded_rows(numbers(rows, ("x", "y", "angle"), "objects"), [2]).tolist()
    given = [row["id"] for row in rows]
    if any(type(id) is not int for id in given):
        raise ValueError(f"ids of objects must be whole numbers, got {given}")
    taken, free, things = {0, *people}, max([0, *people, *given]) + 1, []
    for row, id, (x, y, theta) in zip(rows, given, placed, strict=True):
        if id in taken:
            id, free = free, free + 1
        taken.add(id)
        thing = {"id": id, "type": row["type"], "x": x, "y": y, "theta": theta, "shape": _outline(row["shape"])}
        things.append(thing | {"on": None})
    return things


def _outline(shape: Tree) -> Tree:
    if shape["type"] not in _SHAPES:
        raise ValueError(f"a shape is {' or '.join(_SHAPES)}, got {shape['type']!r}")
    if shape["type"] == "circle":
        return {"type": "disc", "radius": _radius(shape)}
    length, width = rounded(numbers([shape], ("length", "width"), "a shape"))[0].tolist()
    return {"type": "rectangle", "length": length, "width": width}


def _radius(shape: Tree) -> float:
    """Half the length, as the format's readers take it, also of a robot that is no disc; m."""
    return float(rounded(numbers([shape], ("length",), "a shape") / 2)[0, 0])


def _read_goal(told: dict[str, Any]) -> Tree:
    x, y, theta = numbers([told], ("x", "y", "angle"), "the goal")[0].tolist()
    keys = {"distance": "pos_threshold", "angle": "angle_threshold"}
    given = {name: float(rounded(numbers([told], (key,), "goal"))[0, 0]) for name, key in keys.items() if key in told}
    return goal_of([x, y], theta, **given)


FORMAT = Format("trajectory files of the SocNav3 data set, with an occupancy grid", ".json", import_, export=export)
