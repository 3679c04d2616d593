"""Constant part of an episode file: the scene to and from JSON, columns of frames, software versions."""

from __future__ import annotations

import platform
import sysconfig
from collections.abc import Iterable
from functools import cache
from typing import Any, TypeVar

from ..core.entities import Door, Furniture, Goal, Group, Human, Interaction, Limits, Place, Queue, Robot, Wall
from ..core.geometry import Disc, Pose, Rectangle, Shape
from ..core.scene import Rules, Scene, Social, Unmeasured
from ..version import __version__
from .canonical import to_json_value

JsonDict = dict[str, Any]
T = TypeVar("T")

# name, unit and frame of reference of each column of the rows in frames
ROBOT_COLUMNS = (
    ("x", "m", "world"),
    ("y", "m", "world"),
    ("theta", "rad", "world"),
    ("vx", "m/s", "world"),
    ("vy", "m/s", "world"),
    ("omega", "rad/s", "world"),
)
HUMAN_COLUMNS = (*ROBOT_COLUMNS, ("head", "rad", "world"))
COMMAND_COLUMNS = (("vx", "m/s", "body"), ("vy", "m/s", "body"), ("omega", "rad/s", "body"))

ROBOT_NAMES, HUMAN_NAMES, COMMAND_NAMES = (
    tuple(name for name, _, _ in table) for table in (ROBOT_COLUMNS, HUMAN_COLUMNS, COMMAND_COLUMNS)
)
ROW_X, ROW_Y, ROW_THETA, ROW_VX, ROW_VY, ROW_OMEGA, ROW_HEAD = range(7)  # indices of columns; robots have no head
ROBOT_ANGLES, HUMAN_ANGLES = [ROW_THETA], [ROW_THETA, ROW_HEAD]  # columns with angles
ABSENT = -1  # activity of a pedestrian that is not present


def columns() -> dict[str, list[dict[str, str]]]:
    """Return the value of the key `columns`: name, unit and frame of each column."""
    tables = {"robot": ROBOT_COLUMNS, "humans": HUMAN_COLUMNS, "command": COMMAND_COLUMNS}
    return {
        key: [{"name": name, "unit": unit, "frame": frame} for name, unit, frame in table]
        for key, table in tables.items()
    }


def scene_to_json(scene: Scene) -> JsonDict:
    """Convert a scene to the keys `settings` to `dropped` of a file, in the file's order, without rounding.

    Raises:
        RecordError: a number is not finite, or JSON cannot represent the settings.
    """
    values = {
        "settings": scene.settings,
        "rules": _fields_of(scene.rules),
        "room": {"polygon": scene.polygon},
        "walls": [(*wall.start, *wall.end) for wall in scene.walls],
        "objects": [
            _with_flat_pose(piece) | {"shape": _shape_to_json(piece.shape), "on": piece.on} for piece in scene.furniture
        ],
        "doors": [_with_flat_pose(door) for door in scene.doors],
        "queues": [_with_flat_pose(queue) for queue in scene.queues],
        "places": [_fields_of(place) for place in scene.places],
        "humans": [_with_flat_pose(human) for human in scene.humans],
        "groups": [_fields_of(group) for group in scene.groups],
        "interactions": interaction_rows(scene.interactions),
        "robot": _with_flat_pose(scene.robot) | {"limits": _fields_of(scene.robot.limits)},
        "goal": _fields_of(scene.goal),
        "social": _fields_of(scene.social) if scene.social != Social() else None,
        "dropped": scene.dropped,
    }
    return {key: to_json_value(value, f"{key} of the scene", exact=True) for key, value in values.items()}


def scene_from_json(document: JsonDict) -> Scene:
    """Restore the scene of a document, equal to the recorded scene; unknown keys are ignored.

    Raises:
        KeyError, TypeError, ValueError: the document is invalid.
    """
    robot, rules = document["robot"], document["rules"]
    return Scene(
        name=document["name"],
        family=document["family"],
        polygon=tuple((x, y) for x, y in document["room"]["polygon"]),
        walls=tuple(Wall((x1, y1), (x2, y2)) for x1, y1, x2, y2 in document["walls"]),
        furniture=tuple(
            Furniture(o["id"], o["type"], _pose(o), _shape_from_json(o["shape"]), o["on"], o.get("seat"))
            for o in document["objects"]
        ),
        humans=tuple(_human(h) for h in document["humans"]),
        robot=_restore(Robot, robot, pose=_pose(robot), limits=_restore(Limits, robot["limits"])),
        goal=_restore(Goal, document["goal"]),
        groups=tuple(_group(g) for g in document["groups"]),
        interactions=interactions_from_rows(document["interactions"]),
        rules=_restore(Rules, rules, ends_on=tuple(rules["ends_on"])),
        social=_social(document.get("social")),
        seed=document["seed"],
        episode=document["episode"],
        settings=document["settings"],
        dropped=tuple(document["dropped"]),
        unmeasured=_unmeasured(document.get("imported") or {}),
        # files of earlier versions lack these keys
        doors=tuple(_restore(Door, d, pose=_pose(d)) for d in document.get("doors", ())),
        queues=tuple(
            _restore(Queue, q, pose=_pose(q), service=tuple(q["service"])) for q in document.get("queues", ())
        ),
        places=tuple(_restore(Place, p, stay=tuple(p["stay"])) for p in document.get("places", ())),
    )


def _unmeasured(imported: JsonDict) -> frozenset[Unmeasured]:
    """What an imported episode does not know, from its lists of missing and of derived keys."""
    lacks, derived = (
        {key.removeprefix("frames.") for key in imported.get(name) or ()} for name in ("lacks", "derived")
    )
    found: dict[Unmeasured, bool] = {
        "robot": "robot" in lacks,
        "goal": "goal" in lacks,
        "headings": "humans.theta" in lacks | derived,  # derived from velocities
        "heads": bool({"humans.head", "humans.theta"} & (lacks | derived)),
        "seed": "seed" in lacks,
        "outcome": "outcome" in lacks,
    }
    return frozenset(name for name, is_unmeasured in found.items() if is_unmeasured)


def interaction_rows(interactions: Iterable[Interaction]) -> list[list[Any]]:
    """Convert interactions to rows [src, relation, dst]."""
    return [[i.src, i.relation, i.dst] for i in interactions]


def interactions_from_rows(rows: list[list[Any]]) -> tuple[Interaction, ...]:
    """Convert rows [src, relation, dst] to interactions."""
    return tuple(Interaction(src, relation, dst) for src, relation, dst in rows)


def _with_flat_pose(entity: Furniture | Human | Robot | Door | Queue) -> JsonDict:
    """Return the fields of an entity, with x, y and theta instead of the pose."""
    fields_: JsonDict = {}
    for key, value in _fields_of(entity).items():
        fields_ |= _fields_of(value) if key == "pose" else {key: value}
    return fields_


def _fields_of(value: Any) -> JsonDict:
    """Return the fields of a dataclass; faster than `asdict`, which copies their values."""
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


def _shape_to_json(shape: Shape) -> JsonDict:
    return {"type": "disc" if isinstance(shape, Disc) else "rectangle"} | _fields_of(shape)


def _shape_from_json(values: JsonDict) -> Shape:
    if values["type"] == "disc":
        return _restore(Disc, values)
    if values["type"] == "rectangle":
        return _restore(Rectangle, values)
    raise ValueError(f"shape type must be disc or rectangle, got {values['type']!r}")


def _pose(values: JsonDict) -> Pose:
    return _restore(Pose, values)


def _human(values: JsonDict) -> Human:
    converted: JsonDict = {"pose": _pose(values)}
    converted |= {key: tuple((x, y) for x, y in values.get(key, ())) for key in ("goals", "track")}
    converted["velocity"] = tuple(values.get("velocity", (0.0, 0.0)))
    converted["stays"] = tuple(values.get("stays", ()))
    breadth = values.get("breadth")
    converted["breadth"] = 2 * values["radius"] if breadth is None else breadth  # the bodies of older files are discs
    # files of earlier versions lack some of these
    newer = ("enters", "leaves", "exits", "reaction", "robot_clearance", "seat", "queue", "headway", "politeness")
    return _restore(Human, values, [key for key in newer if key not in values], **converted)


def _social(values: JsonDict | None) -> Social:
    if values is None:
        return Social()
    times = {key: tuple(values[key]) for key in ("visit_time", "talk_time", "sit_time", "pause") if key in values}
    newer = ("sits", "queues", "exits", "sit_time", "pause")  # files of earlier versions lack these keys
    return _restore(Social, values, [key for key in newer if key not in values], **times)


def _group(values: JsonDict) -> Group:
    # files of earlier versions lack the formation
    return _restore(Group, values, members=tuple(values["members"]), formation=values.get("formation"))


def _restore(kind: type[T], values: JsonDict, missing: Iterable[str] = (), **converted: Any) -> T:
    """Create a dataclass from the JSON values of its fields.

    Args:
        kind: the dataclass.
        values: JSON values; keys that are not fields are ignored.
        missing: fields that keep their default.
        converted: fields that are converted already.

    Raises:
        KeyError: a field is missing.
    """
    names = kind.__dataclass_fields__.keys() - {*converted, *missing}  # type: ignore[attr-defined]
    return kind(**{name: values[name] for name in names}, **converted)


def software_versions() -> dict[str, str]:
    """Return the versions of sonata2d, Python, NumPy and pymunk, and the platform: all that bytes may depend on."""
    return dict(_software_versions())


@cache
def _software_versions() -> dict[str, str]:
    return {
        "sonata2d": __version__,
        "python": platform.python_version(),
        "numpy": _version_of("numpy"),
        "pymunk": _version_of("pymunk"),
        "platform": sysconfig.get_platform(),
    }


def _version_of(package: str) -> str:
    # imported here because this import takes a tenth of the time of `import sonata2d`
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
