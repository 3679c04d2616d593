"""`socnav3`: the trajectory files of the SocNav3 data set, world frame, one step a look.

What its schema has no room for stands under extra keys, which its readers pass over: velocities, heads and radii in
each person, what was commanded and what was seen under `sonata2d` in each step, and all else once under `sonata2d`
at the top, things of types that the schema does not list (laptops) under `other_objects` there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import orjson

from ..entities import Furniture
from ..errors import RecordError
from ..exact import Array
from ..geometry import Disc, Shape
from ..record import EpisodeRecord
from ..record.canonical import refuse_unfinite
from ..record.columns import HUMAN_NAMES, ROBOT_NAMES
from ..record.layout import Tree
from .clock import exact_stamps
from .form import Options
from .grid import grid_of
from .refuse import refuse_absences, refuse_short, refuse_uneven, refuse_without_robot

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
