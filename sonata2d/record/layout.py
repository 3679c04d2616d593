"""Constant part of an episode file: the scene to and from JSON, columns of frames, software versions."""

from __future__ import annotations

import platform
import sysconfig
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar

from ..core.attributes import AttributeSpec
from ..core.doors import InteriorDoor
from ..core.entities import (
    ROBOT_ID,
    Area,
    Door,
    Furniture,
    Goal,
    Group,
    Human,
    Interaction,
    Limits,
    OtherRobot,
    Place,
    Queue,
    Robot,
    Wall,
)
from ..core.geometry import Disc, Polygon, Pose, Rectangle
from ..core.scene import Rules, Scene, Social, Unmeasured
from ..version import __version__
from .canonical import to_json_value

JsonDict = dict[str, Any]
T = TypeVar("T")

# names of the columns of the rows in frames
ROBOT_NAMES, COMMAND_NAMES = ("x", "y", "theta", "vx", "vy", "omega"), ("vx", "vy", "omega")
HUMAN_NAMES = (*ROBOT_NAMES, "head")
COLUMNS = {"robot": ROBOT_NAMES, "humans": HUMAN_NAMES, "command": COMMAND_NAMES}  # by key of `columns` in the file
_UNITS = {"x": "m", "y": "m", "theta": "rad", "vx": "m/s", "vy": "m/s", "omega": "rad/s", "head": "rad"}
ROW_X, ROW_Y, ROW_THETA, ROW_VX, ROW_VY, ROW_OMEGA, ROW_HEAD = range(7)  # indices of columns; robots have no head
ROBOT_ANGLES, HUMAN_ANGLES = [ROW_THETA], [ROW_THETA, ROW_HEAD]  # columns with angles
ABSENT = -1  # activity of a pedestrian that is not present


def columns() -> dict[str, list[dict[str, str]]]:
    """Return the value of the key `columns`: name, unit and frame of each column."""
    frames = {"robot": "world", "humans": "world", "command": "body"}
    return {
        key: [{"name": name, "unit": _UNITS[name], "frame": frames[key]} for name in names]
        for key, names in COLUMNS.items()
    }


def format_version(scene: Scene) -> int:
    """The oldest version of the format that can hold an episode of a scene."""
    if scene.robots or scene.interior_doors:
        return 2
    robot = scene.robot
    is_known = robot.shape is None and robot.drive is None and robot.kinematics in ("holonomic", "unicycle")
    has_polygons = any(isinstance(thing.shape, Polygon) for thing in scene.furniture)
    return 1 if is_known and not has_polygons else 2


def scene_to_json(scene: Scene) -> JsonDict:
    """Convert a scene to the keys `settings` to `dropped` of a file, in the file's order, without rounding.

    Raises:
        RecordError: a number is not finite, or JSON cannot represent the settings.
    """
    values = {
        "settings": scene.settings,
        "rules": _fields_of(scene.rules),
        "room": {"polygon": scene.polygon} | ({"holes": scene.holes} if scene.holes else {}),
        "walls": [(*wall.start, *wall.end) for wall in scene.walls],
        **{key: [_entity_to_json(entity) for entity in getattr(scene, name)] for key, (name, _) in _LISTS.items()},
        **({"areas": [_entity_to_json(area) for area in scene.areas]} if scene.areas else {}),
        **({"interior_doors": [_entity_to_json(d) for d in scene.interior_doors]} if scene.interior_doors else {}),
        **({"attributes": [_entity_to_json(spec) for spec in scene.attributes]} if scene.attributes else {}),
        "interactions": interaction_rows(scene.interactions),
        "robot": _entity_to_json(scene.robot),
        "goal": _entity_to_json(scene.goal),
        **({"robots": [_other_to_json(other) for other in scene.robots]} if scene.robots else {}),
        "social": _entity_to_json(scene.social) if scene.social != Social() else None,
        "dropped": scene.dropped,
    }
    return {key: to_json_value(value, f"{key} of the scene", exact=True) for key, value in values.items()}


def scene_from_json(document: JsonDict) -> Scene:
    """Restore the scene of a document, equal to the recorded scene; unknown keys are ignored.

    Raises:
        KeyError, TypeError, ValueError: the document is invalid.
    """
    lists: Any = {
        name: tuple(_entity_from_json(kind, row) for row in document[key]) for key, (name, kind) in _LISTS.items()
    }
    social = document["social"]
    return Scene(
        name=document["name"],
        family=document["family"],
        polygon=_tuples(document["room"]["polygon"]),
        holes=tuple(map(_tuples, document["room"].get("holes") or ())),
        areas=tuple(_entity_from_json(Area, row) for row in document.get("areas") or ()),
        interior_doors=tuple(_entity_from_json(InteriorDoor, row) for row in document.get("interior_doors") or ()),
        attributes=tuple(_entity_from_json(AttributeSpec, row) for row in document.get("attributes") or ()),
        walls=tuple(Wall((x1, y1), (x2, y2)) for x1, y1, x2, y2 in document["walls"]),
        interactions=interactions_from_rows(document["interactions"]),
        robot=_entity_from_json(Robot, document["robot"]),
        goal=_entity_from_json(Goal, document["goal"]),
        robots=tuple(map(_other_from_json, document.get("robots") or ())),
        robot_id=document.get("robot_id", ROBOT_ID),
        rules=_entity_from_json(Rules, document["rules"]),
        social=Social() if social is None else _entity_from_json(Social, social),
        seed=document["seed"],
        episode=document["episode"],
        settings=document["settings"],
        dropped=tuple(document["dropped"]),
        unmeasured=_unmeasured(document.get("imported") or {}),
        **lists,
    )


def moving_doors(document: JsonDict) -> list[JsonDict]:
    """The interior doors of a document that move, in the order of the openings in its frames."""
    return [door for door in document.get("interior_doors") or () if door["opened_by"] != "nobody"]


def human_to_json(human: Human) -> JsonDict:
    """Return a pedestrian as the file holds it, without rounding."""
    values: JsonDict = to_json_value(_entity_to_json(human), "human", exact=True)
    return values


def _other_to_json(other: OtherRobot) -> JsonDict:
    """Return the keys of another robot but those of its controller."""
    return {"id": other.id, "robot": _entity_to_json(other.robot), "goal": _entity_to_json(other.goal)}


def _other_from_json(values: JsonDict) -> OtherRobot:
    robot, goal = _entity_from_json(Robot, values["robot"]), _entity_from_json(Goal, values["goal"])
    return OtherRobot(values["id"], robot, goal, values["controller"]["path"])


def _unmeasured(imported: JsonDict) -> frozenset[Unmeasured]:
    """Properties that the source of an imported episode lacks, from its lists of missing and of derived keys."""
    lacks, derived = (
        {key.removeprefix("frames.") for key in imported.get(name) or ()} for name in ("lacks", "derived")
    )
    unmeasured: dict[Unmeasured, bool] = {
        "robot": "robot" in lacks,
        "goal": "goal" in lacks,
        "headings": "humans.theta" in lacks | derived,  # derived from velocities
        "heads": bool({"humans.head", "humans.theta"} & (lacks | derived)),
        "seed": "seed" in lacks,
        "outcome": "outcome" in lacks,
    }
    return frozenset(name for name, is_unmeasured in unmeasured.items() if is_unmeasured)


def interaction_rows(interactions: Iterable[Interaction]) -> list[list[Any]]:
    """Convert interactions to rows [src, relation, dst]."""
    return [[i.src, i.relation, i.dst] for i in interactions]


def interactions_from_rows(rows: list[list[Any]]) -> tuple[Interaction, ...]:
    """Convert rows [src, relation, dst] to interactions."""
    return tuple(Interaction(src, relation, dst) for src, relation, dst in rows)


# lists of entities in the file: key, attribute of the scene, class
_LISTS: dict[str, tuple[str, type]] = {
    "objects": ("furniture", Furniture),
    "doors": ("doors", Door),
    "queues": ("queues", Queue),
    "places": ("places", Place),
    "humans": ("humans", Human),
    "groups": ("groups", Group),
}


# defaults of the fields of entities that a file holds only where they differ
_ADDITIVE: dict[Any, dict[str, Any]] = {
    kind: {each.name: each.default for each in fields(kind) if each.metadata.get("additive")}
    for kind in (Robot, Goal, Human, Social, Furniture, Area, AttributeSpec, InteriorDoor)
}
_SHAPES: dict[str, type] = {"disc": Disc, "rectangle": Rectangle, "polygon": Polygon}
_SHAPE_NAMES = {kind: name for name, kind in _SHAPES.items()}


def _entity_to_json(entity: Any) -> JsonDict:
    """Return the fields of an entity; x, y and theta take the place of a pose."""
    found: JsonDict = {}
    for key, value in _fields_of(entity).items():
        additive = _ADDITIVE.get(type(entity), {})
        if key in additive and value == additive[key]:
            continue
        if isinstance(value, Pose):
            found |= _fields_of(value)
        elif type(value) in _SHAPE_NAMES:
            found[key] = {"type": _SHAPE_NAMES[type(value)]} | _fields_of(value)
        else:
            found[key] = _fields_of(value) if isinstance(value, Limits) else value
    return found


def _entity_from_json(kind: type[T], values: JsonDict) -> T:
    """Create an entity from its JSON object, the inverse of `_entity_to_json`; keys that are no fields are ignored.

    Raises:
        KeyError: a field is missing.
    """
    plain, others = _names_of(kind)  # type: ignore[arg-type]
    found = {name: _tuples(value) if type(value := values[name]) is list else value for name in plain}
    for name in others:
        if name == "pose":
            found[name] = Pose(values["x"], values["y"], values["theta"])
        elif name in _ADDITIVE.get(kind, ()) and values.get(name) is None:
            continue
        elif (value := values[name]) is not None:
            part = Limits if name == "limits" else _SHAPES[value["type"]] if name == "shape" else None
            found[name] = _tuples(value) if part is None else _entity_from_json(part, value)
    return kind(**found)


@cache
def _names_of(kind: type) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the fields that JSON holds as they are, or as lists in place of tuples, and of the others."""
    others = {"pose", "shape", "limits", *_ADDITIVE.get(kind, ())}
    names = kind.__dataclass_fields__  # type: ignore[attr-defined]
    return tuple(name for name in names if name not in others), tuple(name for name in names if name in others)


def _fields_of(value: Any) -> JsonDict:
    """Return the fields of a dataclass; faster than `asdict`, which copies their values."""
    return {name: getattr(value, name) for name in value.__dataclass_fields__}


def _tuples(value: Any) -> Any:
    """Convert a list, and lists in it, to tuples; other values are returned as they are."""
    if not isinstance(value, list):
        return value
    return tuple(tuple(item) if isinstance(item, list) else item for item in value)


def software_versions() -> dict[str, str]:
    """Return the versions of sonata2d, Python, NumPy and pymunk, and the platform: all that bytes may depend on."""
    return {
        "sonata2d": __version__,
        "python": platform.python_version(),
        "numpy": _version_of("numpy"),
        "pymunk": _version_of("pymunk"),
        "platform": sysconfig.get_platform(),
    }


@cache
def _version_of(package: str) -> str:
    # imported here because this import takes a tenth of the time of `import sonata2d`
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
