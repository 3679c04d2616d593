"""The constant part of an episode file: scene, columns of the frame rows and software versions, to JSON and back."""

from __future__ import annotations

import platform
import sysconfig
from collections.abc import Iterable
from dataclasses import asdict, fields
from functools import cache
from typing import Any, TypeVar

from ..core.entities import Furniture, Goal, Group, Human, Interaction, Limits, Robot, Wall
from ..core.geometry import Disc, Pose, Rectangle, Shape
from ..core.scene import Rules, Scene, Social
from ..version import __version__
from .canonical import plain

ROBOT = (
    ("x", "m", "world"),
    ("y", "m", "world"),
    ("theta", "rad", "world"),
    ("vx", "m/s", "world"),
    ("vy", "m/s", "world"),
    ("omega", "rad/s", "world"),
)
HUMANS = (*ROBOT, ("head", "rad", "world"))
COMMAND = (("vx", "m/s", "body"), ("vy", "m/s", "body"), ("omega", "rad/s", "body"))

ROBOT_NAMES, HUMAN_NAMES, COMMAND_NAMES = (tuple(name for name, _, _ in table) for table in (ROBOT, HUMANS, COMMAND))
ROBOT_ANGLES, HUMAN_ANGLES = [2], [2, 6]  # columns
ABSENT = -1  # activity of a person who is not present


def columns() -> dict[str, list[dict[str, str]]]:
    """The tables as the file holds them, under `columns`."""
    tables = {"robot": ROBOT, "humans": HUMANS, "command": COMMAND}
    return {
        key: [{"name": name, "unit": unit, "frame": frame} for name, unit, frame in table]
        for key, table in tables.items()
    }


T = TypeVar("T")
Tree = dict[str, Any]


def layout_of(scene: Scene) -> Tree:
    """The scene's keys in the file's order, `settings` to `dropped`, with every digit that the world uses.

    Raises:
        RecordError: a number is not finite, or the settings are nothing JSON can hold.
    """
    layout = {
        "settings": scene.settings,
        "rules": asdict(scene.rules),
        "room": {"polygon": scene.polygon},
        "walls": [(*wall.start, *wall.end) for wall in scene.walls],
        "objects": [_flat(thing) | {"shape": _shape(thing.shape), "on": thing.on} for thing in scene.furniture],
        "humans": [_flat(human) for human in scene.humans],
        "groups": [asdict(group) for group in scene.groups],
        "interactions": interaction_rows(scene.interactions),
        "robot": _flat(scene.robot),
        "goal": asdict(scene.goal),
        "social": asdict(scene.social) if scene.social.is_lively else None,
        "dropped": scene.dropped,
    }
    return {key: plain(value, f"{key} of the scene", exact=True) for key, value in layout.items()}


def scene_of(document: Tree) -> Scene:
    """The scene of a file, equal to the one that was recorded. Keys it does not know are passed over."""
    robot, rules = document["robot"], document["rules"]
    return Scene(
        name=document["name"],
        family=document["family"],
        polygon=tuple((x, y) for x, y in document["room"]["polygon"]),
        walls=tuple(Wall((x1, y1), (x2, y2)) for x1, y1, x2, y2 in document["walls"]),
        furniture=tuple(
            Furniture(o["id"], o["type"], _pose(o), _shape_of(o["shape"]), o["on"]) for o in document["objects"]
        ),
        humans=tuple(_human(h) for h in document["humans"]),
        robot=_made(Robot, robot, pose=_pose(robot), limits=_made(Limits, robot["limits"])),
        goal=_made(Goal, document["goal"]),
        groups=tuple(_group(g) for g in document["groups"]),
        interactions=interactions_of(document["interactions"]),
        rules=_made(Rules, rules, ends_on=tuple(rules["ends_on"])),
        social=_social(document.get("social")),
        seed=document["seed"],
        episode=document["episode"],
        settings=document["settings"],
        dropped=tuple(document["dropped"]),
    )


def interaction_rows(interactions: Iterable[Interaction]) -> list[list[Any]]:
    """[[src, relation, dst], …]"""
    return [[i.src, i.relation, i.dst] for i in interactions]


def interactions_of(rows: list[list[Any]]) -> tuple[Interaction, ...]:
    """The inverse of `interaction_rows`."""
    return tuple(Interaction(src, relation, dst) for src, relation, dst in rows)


def _flat(entity: Furniture | Human | Robot) -> Tree:
    """Its fields, with x, y and theta in place of the pose."""
    flat: Tree = {}
    for key, value in asdict(entity).items():
        flat |= value if key == "pose" else {key: value}
    return flat


def _shape(shape: Shape) -> Tree:
    return {"type": "disc" if isinstance(shape, Disc) else "rectangle"} | asdict(shape)


def _shape_of(told: Tree) -> Shape:
    if told["type"] == "disc":
        return _made(Disc, told)
    if told["type"] == "rectangle":
        return _made(Rectangle, told)
    raise ValueError(f"shape type must be disc or rectangle, got {told['type']!r}")


def _pose(told: Tree) -> Pose:
    return _made(Pose, told)


def _human(told: Tree) -> Human:
    given: Tree = {"pose": _pose(told)}
    given |= {key: tuple((x, y) for x, y in told.get(key, ())) for key in ("goals", "track")}
    given["velocity"] = tuple(told.get("velocity", (0.0, 0.0)))
    newer = ("enters", "leaves", "exits", "reaction", "robot_clearance")  # older files have none of them
    return _made(Human, told, [key for key in newer if key not in told], **given)


def _social(told: Tree | None) -> Social:
    if told is None:
        return Social()
    return _made(Social, told, visit_time=tuple(told["visit_time"]), talk_time=tuple(told["talk_time"]))


def _group(told: Tree) -> Group:
    return _made(Group, told, members=tuple(told["members"]), formation=told.get("formation"))  # older files have none


def _made(kind: type[T], told: Tree, lacking: Iterable[str] = (), **given: Any) -> T:
    """A dataclass of this kind from the keys it knows; `given` ones are ready already, `lacking` ones as usual."""
    names = {field.name for field in fields(kind)} - {*given, *lacking}  # type: ignore[arg-type]
    known = {name: told[name] for name in names}
    return kind(**known, **given)


def software() -> dict[str, str]:
    """Versions of sonata2d, Python, NumPy and pymunk, and the platform: what bytes may depend on, and no more."""
    return dict(_software())


@cache
def _software() -> dict[str, str]:
    return {
        "sonata2d": __version__,
        "python": platform.python_version(),
        "numpy": _version_of("numpy"),
        "pymunk": _version_of("pymunk"),
        "platform": sysconfig.get_platform(),
    }


def _version_of(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # a tenth of the time that `import sonata2d` takes

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
