"""Import of `socnav3`: trajectory files of the SocNav3 data set, exported by sonata2d or made by other programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..core.files.limits import MAX_PERSON_SPEED
from ..core.portable_math import Array
from ..record.canonical import rounded, rounded_rows
from ..record.layout import HUMAN_ANGLES, ROBOT_ANGLES, JsonDict
from . import estimates
from .estimates import POSITION, THETA, VELOCITY
from .format import Options
from .imported import SourceEpisode, episode_document, goal_of, object_row
from .importing import document_of, load_json, numbers, parsing, table
from .tracks.reading import read_walls

NAME = "socnav3"
EXTRAS = "sonata2d"  # key of what the format has no place for: per step, and once per file

_MISSING = ("humans.radius", "humans.group", "humans.head", "frames.interactions", "interactions", "objects.on")
_DERIVED = ("humans.id", "objects.id", "frames.humans.velocity", "frames.activity", "room.polygon")
_TOLERANCE = 0.05  # m, apparent motion of the goal and of objects
_SHAPES = ("circle", "rectangle")


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode of a file: of an exported file the original episode, of a foreign one an imported episode.

    Raises:
        RecordError: the file is damaged, or its entities change.
    """
    file = load_json(path, NAME)
    with parsing(path, NAME):
        if not isinstance(file, dict):
            raise ValueError("it must be a JSON object")
        is_exported = isinstance(file.get(EXTRAS), dict) and "header" in file[EXTRAS]
        if is_exported:
            yield _restored(file)
        else:
            yield episode_document(_source_episode(file, options), NAME, path)


def _restored(file: JsonDict) -> JsonDict:
    """The document that was exported; poses and velocities are read from the format's own keys."""
    header, steps = file[EXTRAS]["header"], file["sequence"]
    ids, dt = [human["id"] for human in header["humans"]], header["rules"]["dt"]
    frames = []
    for t, (step, robot_row) in enumerate(zip(steps, _robot_rows(steps).tolist(), strict=True)):
        time, humans = float(rounded(np.array(t * dt))), _human_rows(step["people"], ids, t)
        frames.append({"tick": t, "time": time, "robot": robot_row, "humans": humans} | step[EXTRAS])
    return document_of(header, [*map(_in_order, frames[:-1]), frames[-1]])


def _in_order(frame: JsonDict) -> JsonDict:
    """The frame with its keys in the order of the recorder."""
    order = ("tick", "time", "robot", "command", "executed", "guarded", "humans", "activity", "interactions")
    return {key: frame[key] for key in order} | frame


def _robot_rows(steps: list[JsonDict]) -> Array:
    """(T, 6), columns as in episode files; the format's velocities are in the body frame."""
    x, y, theta, ahead, left, omega = numbers(
        [step["robot"] for step in steps], ("x", "y", "angle", "speed_x", "speed_y", "speed_a"), "the robot"
    ).T
    c, s = np.cos(theta), np.sin(theta)
    rows = np.stack((x, y, theta, ahead * c - left * s, ahead * s + left * c, omega), axis=1)
    return rounded_rows(rows, ROBOT_ANGLES)


def _human_rows(people: list[JsonDict], ids: list[int], step: int) -> list[list[float] | None]:
    """Rows of N pedestrians with the columns of episode files; None where absent."""
    table = numbers(people, ("id", "x", "y", "angle", "vx", "vy", "omega", "head"), f"people at step {step}")
    rows = dict(zip(table[:, 0].tolist(), rounded_rows(table[:, 1:], HUMAN_ANGLES).tolist(), strict=True))
    if len(rows) != len(people) or not set(rows) <= set(map(float, ids)):
        raise ValueError(f"ids of people at step {step} are not unique, or not among the ids of the header, {ids}")
    return [rows.get(float(id)) for id in ids]


def _source_episode(file: JsonDict, options: Options) -> SourceEpisode:
    steps, walls = file["sequence"], _walls(file, options)
    if not isinstance(steps, list) or len(steps) < 2:
        raise ValueError("its sequence must be a list of two steps or more")
    time = estimates.elapsed(numbers(steps, ("timestamp",), "steps")[:, 0], "step")
    if options.renumber:
        steps = _renumbered(steps)
    ids, poses = _poses(steps)
    _check_static(steps)
    if options.renumber:
        _check_continuity(time, poses)
    humans, robot = estimates.with_velocities(time, poses), _robot_rows(steps)
    points = np.concatenate((robot[:, POSITION], poses[..., POSITION].reshape(-1, 2)))
    extras = {"context": file.get("context_description"), "label": file.get("label")}
    return SourceEpisode(
        time=time,
        robot=robot,
        humans=humans,
        ids=ids,
        radii=estimates.fitting_radii(poses, walls),
        activity=estimates.activity_of(humans[..., VELOCITY]),
        interactions=[[] for _ in steps],
        polygon=estimates.room_around(walls, points),
        walls=walls,
        objects=_objects(steps[0]["objects"], ids),
        goal=_read_goal(steps[0]["goal"]),
        robot_radius=_radius(steps[0]["robot"]["shape"]),
        missing=_MISSING,
        derived=_DERIVED if options.walls is None else (*_DERIVED, "walls"),
        header={key: value for key, value in extras.items() if value is not None},
    )


def _walls(file: JsonDict, options: Options) -> Array:
    """Walls of a file or of `options.walls`, (W, 4), m."""
    if options.walls is not None:
        return read_walls(options.walls)
    if "walls" not in file:
        raise ValueError(
            "it has no walls; pass a file of them, x1,y1,x2,y2 in m, with --walls FILE (with the header only: no walls)"
        )
    return table(file["walls"], 4, "walls")


def _renumbered(steps: list[JsonDict]) -> list[JsonDict]:
    """The steps with unique ids: the n-th entry with an id is the same person or object in every step.

    The first entry keeps the id, so files without repetitions stay as they are.
    """
    result = [dict(step) for step in steps]
    for key in ("people", "objects"):
        known = {row["id"] for step in steps for row in step[key]}
        if any(type(id) not in (int, float) for id in known):
            raise ValueError(f"ids of {key} must be numbers, got {sorted(map(repr, known))}")
        unused = int(max([0, *known])) + 1
        new_ids: dict[tuple[float, int], float] = {}  # by id and number of the entry
        for step in result:
            seen: Counter[float] = Counter()
            rows = []
            for row in step[key]:
                entry = row["id"], seen[row["id"]]
                seen[row["id"]] += 1
                if entry not in new_ids:
                    new_ids[entry], unused = (row["id"], unused) if entry[1] == 0 else (unused, unused + 1)
                rows.append(row | {"id": new_ids[entry]})
            step[key] = rows
    return result


def _check_continuity(time: Array, poses: Array) -> None:
    """Check that no pedestrian jumps: entries with one id that change their order cannot be told apart."""
    step = np.diff(poses[..., POSITION], axis=0) / np.diff(time)[:, None, None]
    speed = np.nan_to_num(np.hypot(step[..., 0], step[..., 1]))
    for t in np.flatnonzero((speed > MAX_PERSON_SPEED).any(axis=1))[:1].tolist():
        raise ValueError(
            f"people with the same id change their order at step {t + 1} (one would move at {speed[t].max():.1f} m/s);"
            " give each person an id of their own"
        )


def _check_static(steps: list[JsonDict]) -> None:
    """Check that objects and goal stand still and are the same throughout, as in every episode."""
    first = {thing["id"]: thing for thing in steps[0]["objects"]}
    if len(first) != len(steps[0]["objects"]):
        raise ValueError("ids of objects must be unique; pass --renumber to replace repeated ones")
    for t, step in enumerate(steps):
        objects = {thing["id"]: thing for thing in step["objects"]}
        if set(objects) != set(first):
            raise ValueError(f"objects appear or disappear at step {t}; an episode has the same objects throughout")
        pairs = [(f"object {id}", thing, first[id]) for id, thing in objects.items()]
        for name, now, start in (*pairs, ("the goal", step["goal"], steps[0]["goal"])):
            positions = numbers([now, start], ("x", "y"), name)
            if np.hypot(*(positions[0] - positions[1])) > _TOLERANCE:
                raise ValueError(f"{name} has moved at step {t}; in an episode it stands still")


def _poses(steps: list[JsonDict]) -> tuple[list[int], Array]:
    """Ids of the pedestrians, and (T, N, 3) poses; NaN where absent."""
    tables = [numbers(step["people"], ("id", "x", "y", "angle"), f"people at step {t}") for t, step in enumerate(steps)]
    ids = sorted({float(id) for rows in tables for id in rows[:, 0]})
    if any(id != int(id) for id in ids):
        raise ValueError(f"ids of people must be integers, got {ids}")
    column = {id: k for k, id in enumerate(ids)}
    poses = np.full((len(steps), len(ids), 3), np.nan)
    for t, rows in enumerate(tables):
        if len(set(rows[:, 0].tolist())) != len(rows):
            raise ValueError(f"ids of people must be unique, step {t} repeats one; pass --renumber to replace it")
        for row in rows:
            poses[t, column[float(row[0])]] = row[1:]
    lowest = int(min([1.0, *ids]))  # id 0 is the robot's in an episode
    return [int(id) + 1 - lowest for id in ids], poses


def _objects(rows: list[JsonDict], people: list[int]) -> list[JsonDict]:
    """The objects at the first step; an id of a pedestrian or of the robot is replaced by a new one above all ids."""
    placed = rounded_rows(numbers(rows, ("x", "y", "angle"), "objects"), [THETA]).tolist()
    ids = [row["id"] for row in rows]
    if any(type(id) is not int for id in ids):
        raise ValueError(f"ids of objects must be integers, got {ids}")
    used, unused, objects = {0, *people}, max([0, *people, *ids]) + 1, []
    for row, id, pose in zip(rows, ids, placed, strict=True):
        if id in used:
            id, unused = unused, unused + 1
        used.add(id)
        objects.append(object_row(id, row["type"], pose, _read_shape(row["shape"])))
    return objects


def _read_shape(shape: JsonDict) -> JsonDict:
    if shape["type"] not in _SHAPES:
        raise ValueError(f"the type of a shape must be {' or '.join(_SHAPES)}, got {shape['type']!r}")
    if shape["type"] == "circle":
        return {"type": "disc", "radius": _radius(shape)}
    length, width = rounded(numbers([shape], ("length", "width"), "a shape"))[0].tolist()
    return {"type": "rectangle", "length": length, "width": width}


def _radius(shape: JsonDict) -> float:
    """Half the length, m, as readers of the format take it, also of a robot that is not round."""
    return float(rounded(numbers([shape], ("length",), "a shape") / 2)[0, 0])


def _read_goal(goal: JsonDict) -> JsonDict:
    x, y, theta = numbers([goal], ("x", "y", "angle"), "the goal")[0].tolist()
    keys = {"distance": "pos_threshold", "angle": "angle_threshold"}
    tolerances = {
        name: float(rounded(numbers([goal], (key,), "goal"))[0, 0]) for name, key in keys.items() if key in goal
    }
    return goal_of([x, y], theta, **tolerances)
