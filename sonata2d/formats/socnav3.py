"""`socnav3`: trajectory files of the SocNav3 data set, world frame, one step per frame."""

from __future__ import annotations

import numpy as np
import orjson

from ..core.entities import Furniture
from ..core.geometry import Disc, Polygon, Shape
from ..core.portable_math import Array
from ..core.scene import Scene
from ..errors import RecordError, UnsuitableEpisode
from ..record.canonical import require_finite
from ..record.layout import HUMAN_NAMES, ROBOT_NAMES, JsonDict
from ..record.record import EpisodeRecord
from ..registry import furniture_type
from .format import (
    ROBOT_OPTIONS,
    Format,
    Options,
    exact_stamps,
    header_of,
    require_duration,
    require_even_times,
    require_robot,
)
from .occupancy import occupancy_grid
from .robots import ONE_OF
from .socnav3_import import EXTRAS, NAME, import_

TYPES = ("chair", "table", "plant", "tv", "shelf", "floor_lamp")
_ROBOT = "robot"  # type of other robots in `Options.types`
# Types of the presets and usual ones: the listed type that people use most alike.
_SIMILAR = {
    "counter": "table", "desk": "table", "bar": "table", "bed": "table", "bench": "chair", "sofa": "chair",
    "couch": "chair", "armchair": "chair", "stool": "chair", "wardrobe": "shelf", "cabinet": "shelf",
    "cupboard": "shelf", "bookcase": "shelf", "screen": "tv", "lamp": "floor_lamp",
}  # fmt: skip
_ANY_TYPE = "*"  # key of `Options.types` for all types of solid objects that have no key of their own
# The loader of the format requires a context that is a row of its table; this row states as little as possible.
DEFAULT_CONTEXT = "A robot is performing routine tasks in a home."
_EXTRA_STEP_KEYS = (
    "activity",
    "interactions",
    "contacts",
    "command",
    "executed",
    "guarded",
    "events",
    "label",
    "sensors",
)


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the trajectory file of an episode.

    Raises:
        UnsuitableEpisode: readers of the format would misinterpret the episode.
        RecordError: a number is not finite, or `options.types` names a type that the format does not have.
    """
    _check_exportable(record, options)
    document, scene = record.document, record.scene()
    written_types = {thing.id: _written_type(thing, options) for thing in scene.furniture}
    other_objects = [thing for thing in document["objects"] if written_types[thing["id"]] is None]
    file: JsonDict = {
        "grid": occupancy_grid(scene),
        "walls": _walls(record),
        "sequence": _sequence(record, written_types, options),
    }
    if context := _context(record, options):
        file["context_description"] = context
    if (label := _label(record)) is not None:
        file["label"] = label
    if ONE_OF not in document:  # else it is imported like a file of another program
        file[EXTRAS] = {"header": header_of(document), "other_objects": other_objects}
    return orjson.dumps(file) + b"\n"


def note(record: EpisodeRecord, options: Options) -> str | None:
    """Say that the context of an exported file, or the type of an object, is a default and not that of the scenario."""
    notes = []
    if options.context is None and record.context is None:
        notes.append(
            f"no context is recorded, so context_description is {DEFAULT_CONTEXT!r}, on which the model's rating "
            "depends; pass --context TEXT, or --context '' to write none"
        )
    written = {thing.type for thing in record.scene().furniture if _written_type(thing, options)}
    similar = {type: _similar_type(type, options) for type in sorted(written)}
    if listed := ", ".join(f"{type} as {other}" for type, other in similar.items() if other):
        notes.append(f"objects of unlisted types are written as similar ones: {listed}; choose others with --as")
    return "; ".join(notes) or None


def _context(record: EpisodeRecord, options: Options) -> str | None:
    if options.context is not None:
        return options.context
    return DEFAULT_CONTEXT if record.context is None else record.context


def _written_type(thing: Furniture, options: Options) -> str | None:
    """The type under which an object is written; None: it is not written."""
    if thing.type in TYPES:
        return thing.type
    name = options.types.get(thing.type) or furniture_type(thing.type).names.get(NAME)
    if name or not _must_be_written(thing):
        return name
    return options.types.get(_ANY_TYPE) or _similar_type(thing.type, options)


def _similar_type(type: str, options: Options) -> str | None:
    """The listed type in place of an unlisted one for which nobody has chosen another; None: there is none."""
    is_chosen = (
        type in TYPES or type in options.types or _ANY_TYPE in options.types or NAME in furniture_type(type).names
    )
    return None if is_chosen else _SIMILAR.get(type)


def _must_be_written(thing: Furniture) -> bool:
    """Whether readers would take the place of an object for free; nothing collides with a laptop, on a table or not."""
    return thing.on is None and furniture_type(thing.type).on is None


def _check_exportable(record: EpisodeRecord, options: Options) -> None:
    if unknown := sorted(set(options.types.values()) - set(TYPES)):
        raise RecordError(f"socnav3 has no objects of type {unknown[0]!r}; its types are {', '.join(TYPES)}")
    require_robot(record, NAME)
    require_even_times(record, NAME)
    dt = record.scene().rules.dt
    require_duration(record, NAME, dt * len(record), dt)
    if dt < 0.1:
        raise UnsuitableEpisode(
            record.path,
            f"a tick is {dt:g} s, but readers of socnav3 drop frames less than 0.1 s apart",
            "record with a tick of 0.1 s or more",
        )
    if record.scene().robots and _ROBOT not in options.types:
        raise UnsuitableEpisode(
            record.path,
            f"other robots are to be objects, but socnav3 only has {', '.join(TYPES)}",
            f"choose a type with --as, such as --as {_ROBOT}=shelf",
        )
    states = record.states
    require_finite(states.robot, ROBOT_NAMES, "the robot")
    present_rows = np.where(states.present[..., None], states.humans, 0.0)
    require_finite(present_rows, HUMAN_NAMES, "human", record.scene().human_table.id.tolist())
    for thing in record.scene().furniture:
        if _written_type(thing, options) is None and _must_be_written(thing):
            raise UnsuitableEpisode(
                record.path,
                f"object {thing.id} is of type {thing.type!r}, but socnav3 only has {', '.join(TYPES)}; without the"
                " object, readers would see free space in its place",
                f"write it as another type with --as, such as --as {thing.type}=plant",
            )


def _label(record: EpisodeRecord) -> float | None:
    """The label of the run if it is what the format calls a label: a number from 0 to 1."""
    label = record.label
    if isinstance(label, dict) and len(label) == 1:
        (label,) = label.values()
    if isinstance(label, bool) or not isinstance(label, int | float) or not 0 <= label <= 1:
        return None
    return float(label)


def _sequence(record: EpisodeRecord, written_types: dict[int, str | None], options: Options) -> list[JsonDict]:
    """A step per frame, and one for the final state."""
    states, scene = record.states, record.scene()
    stamps = exact_stamps(states.tick, scene.rules.dt).tolist()
    frames = [*record.document["frames"], record.document["final"]]
    goal = _goal(record)
    objects = [_object(thing, type) for thing in scene.furniture if (type := written_types[thing.id]) is not None]
    shape = _shape(scene.robot.outline)
    return [
        {
            "timestamp": stamp,
            "robot": _robot(row, shape),
            "people": _people(record, rows, present),
            "objects": [*objects, *_robots(scene, others, options)],
            "goal": goal,
            EXTRAS: {key: frame[key] for key in _EXTRA_STEP_KEYS if key in frame},
        }
        for stamp, row, rows, present, frame, others in zip(
            stamps, states.robot, states.humans.tolist(), states.present.tolist(), frames, states.robots.tolist(),
            strict=True,
        )
    ]  # fmt: skip


def _robots(scene: Scene, rows: list[list[float]], options: Options) -> list[JsonDict]:
    """Robots that are objects, in a step."""
    return [
        {
            "id": other.id, "type": options.types[_ROBOT], "x": x, "y": y, "angle": theta,
            "shape": _shape(other.robot.outline),
        }
        for other, (x, y, theta, *_) in zip(scene.robots, rows, strict=True)
    ]  # fmt: skip


def _robot(row: Array, shape: JsonDict) -> JsonDict:
    """The robot; the format's velocities are in the body frame."""
    x, y, theta, vx, vy, omega = row.tolist()
    c, s = float(np.cos(theta)), float(np.sin(theta))
    return {
        "x": x, "y": y, "angle": theta, "speed_x": vx * c + vy * s, "speed_y": vy * c - vx * s, "speed_a": omega,
        "shape": shape,
    }  # fmt: skip


def _people(record: EpisodeRecord, rows: list[list[float]], present: list[bool]) -> list[JsonDict]:
    """Poses of the pedestrians who are present, and their velocities (world frame), heads and bodies.

    SocNav3 itself has no keys for the latter.

    Readers match the pedestrians of two steps by id, and mask pedestrians who are in one of them only.
    """
    return [
        {
            "id": human.id, "x": x, "y": y, "angle": theta, "vx": vx, "vy": vy, "omega": omega, "head": head,
            "radius": human.radius, "breadth": human.breadth,
        }
        for human, (x, y, theta, vx, vy, omega, head), is_present in zip(
            record.scene().humans, rows, present, strict=True
        )
        if is_present
    ]  # fmt: skip


def _object(thing: Furniture, type: str) -> JsonDict:
    x, y = thing.pose.position
    return {"id": thing.id, "type": type, "x": x, "y": y, "angle": thing.pose.theta, "shape": _shape(thing.shape)}


def _shape(shape: Shape) -> JsonDict:
    length, width = shape.sides
    if isinstance(shape, Polygon):  # the rectangle around its centre that contains it
        length, width = (2.0 * max(abs(point[axis]) for point in shape.points) for axis in (0, 1))
    return {"type": "circle" if isinstance(shape, Disc) else "rectangle", "width": width, "length": length}


def _walls(record: EpisodeRecord) -> list[list[float]]:
    scene = record.scene()
    if scene.moving_doors:
        raise UnsuitableEpisode(
            record.path, "it has doors that open and close, and walls of socnav3 do not move", "export to sonata or npz"
        )
    leaves = [door.leaf(door.opening) for door in scene.interior_doors]
    return [[*wall.start, *wall.end] for wall in scene.walls] + [[*start, *end] for start, end, _ in leaves]


def _goal(record: EpisodeRecord) -> JsonDict:
    goal = record.scene().goal
    if not goal.is_plain:
        raise UnsuitableEpisode(
            record.path,
            f"the robot has the task {goal.task!r}, and socnav3 has one position only",
            "export to sonata or npz",
        )
    return {
        "type": "go-to", "human": None, "x": goal.x, "y": goal.y, "angle": goal.theta,
        "pos_threshold": goal.distance, "angle_threshold": goal.angle,
    }  # fmt: skip


FORMAT = Format(
    "trajectory files of the SocNav3 data set, with an occupancy grid",
    ".json",
    import_,
    export=export,
    note=note,
    options=frozenset({"context", "types", "renumber", "walls"}) | ROBOT_OPTIONS,
)
