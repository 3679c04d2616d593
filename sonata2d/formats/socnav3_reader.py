"""Reading `socnav3` files: those that sonata2d wrote become the episode they were, others an imported one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..exact import Array
from ..record.canonical import rounded, rounded_rows
from ..record.columns import HUMAN_ANGLES, ROBOT_ANGLES
from ..record.layout import Tree
from .form import Options, parsing
from .given import load_json, numbers, table
from .imported import Found, document_of, goal_of, radii_that_fit
from .motion import activity_of, box_round, polygon_of, velocities
from .socnav3 import NAME, NAME_OF_EXTRAS

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
        goal=_goal(steps[0]["goal"]),
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


def _goal(told: dict[str, Any]) -> Tree:
    x, y, theta = numbers([told], ("x", "y", "angle"), "the goal")[0].tolist()
    keys = {"distance": "pos_threshold", "angle": "angle_threshold"}
    given = {name: float(rounded(numbers([told], (key,), "goal"))[0, 0]) for name, key in keys.items() if key in told}
    return goal_of([x, y], theta, **given)
