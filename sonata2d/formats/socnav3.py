"""`socnav3`: trajectory files of the SocNav3 data set, world frame, one step per frame."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import orjson

from ..core.entities import Furniture
from ..core.files.limits import MAX_GRID_CELLS, MAX_PERSON_SPEED
from ..core.geometry import Disc, Shape, inside_polygon
from ..core.portable_math import Array, BoolArray
from ..core.scene import Scene
from ..errors import RecordError, UnsuitableEpisode
from ..record.canonical import require_finite, rounded, rounded_rows
from ..record.layout import HUMAN_ANGLES, HUMAN_NAMES, ROBOT_ANGLES, ROBOT_NAMES, JsonDict
from ..record.record import EpisodeRecord
from ..registry import furniture_type
from .base import (
    Format,
    Options,
    exact_stamps,
    require_duration,
    require_even_times,
    require_robot,
)
from .csv_tracks import read_walls
from .imported import (
    POSITION,
    THETA,
    SourceEpisode,
    X,
    activity_of,
    bounding_box,
    episode_document,
    fitting_radii,
    goal_of,
    polygon_of,
    velocities,
)
from .parse import load_json, numbers, parsing, table

NAME = "socnav3"
EXTRAS = "sonata2d"  # key of what the format has no place for: per step, and once per file
TYPES = ("chair", "table", "plant", "tv", "shelf", "floor_lamp")
ANY_TYPE = "*"  # key of `Options.types` for all types of solid objects that have no key of their own
# The loader of the format requires a context that is a row of its table; this row states as little as possible.
DEFAULT_CONTEXT = "A robot is performing routine tasks in a home."
_EXTRA_STEP_KEYS = ("activity", "interactions", "contacts", "command", "executed", "guarded", "events", "label")

CELL = 0.05  # m
UNKNOWN, FREE, OCCUPIED = -1, 0, 1
_RIM = 5  # unknown cells around the room


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the trajectory file of an episode.

    Raises:
        UnsuitableEpisode: readers of the format would misinterpret the episode.
        RecordError: a number is not finite, or `options.types` names a type that the format does not have.
    """
    _check_exportable(record, options)
    document, scene = record.document, record.scene()
    header = {key: value for key, value in document.items() if key not in ("frames", "final")}
    written_types = {thing.id: _written_type(thing, options) for thing in scene.furniture}
    other_objects = [thing for thing in document["objects"] if written_types[thing["id"]] is None]
    file: JsonDict = {
        "grid": occupancy_grid(scene),
        "walls": [[*wall.start, *wall.end] for wall in scene.walls],
        "sequence": _sequence(record, written_types),
    }
    if context := _context(record, options):
        file["context_description"] = context
    if (label := _label(record)) is not None:
        file["label"] = label
    return orjson.dumps(file | {EXTRAS: {"header": header, "other_objects": other_objects}}) + b"\n"


def note(record: EpisodeRecord, options: Options) -> str | None:
    """Say that the context of an exported file is not that of the scenario."""
    if options.context is not None or record.context is not None:
        return None
    return (
        f"no context is recorded, so context_description is {DEFAULT_CONTEXT!r}, on which the model's rating depends;"
        " pass --context TEXT, or --context '' to write none"
    )


def _context(record: EpisodeRecord, options: Options) -> str | None:
    if options.context is not None:
        return options.context
    return DEFAULT_CONTEXT if record.context is None else record.context


def _written_type(thing: Furniture, options: Options) -> str | None:
    """The type under which an object is written; None: it is not written."""
    if thing.type in TYPES:
        return thing.type
    name = options.types.get(thing.type) or furniture_type(thing.type).names.get(NAME)
    return name or (options.types.get(ANY_TYPE) if _must_be_written(thing) else None)


def _must_be_written(thing: Furniture) -> bool:
    """Whether readers would take the place of an object for free; nothing collides with a laptop, on a table or not."""
    return thing.on is None and furniture_type(thing.type).on is None


def _check_exportable(record: EpisodeRecord, options: Options) -> None:
    if unknown := sorted(set(options.types.values()) - set(TYPES)):
        raise RecordError(f"{NAME} has no objects of type {unknown[0]!r}; its types are {', '.join(TYPES)}")
    require_robot(record, NAME)
    require_even_times(record, NAME)
    dt = record.scene().rules.dt
    require_duration(record, NAME, dt * len(record), dt)
    if dt < 0.1:
        raise UnsuitableEpisode(
            record.path,
            f"a tick is {dt:g} s, but readers of {NAME} drop frames less than 0.1 s apart",
            "record with a tick of 0.1 s or more",
        )
    states = record.states
    require_finite(states.robot, ROBOT_NAMES, "the robot")
    present_rows = np.where(states.present[..., None], states.humans, 0.0)
    require_finite(present_rows, HUMAN_NAMES, "human", [human.id for human in record.scene().humans])
    for thing in record.scene().furniture:
        if _written_type(thing, options) is None and _must_be_written(thing):
            raise UnsuitableEpisode(
                record.path,
                f"object {thing.id} is of type {thing.type!r}, but {NAME} only has {', '.join(TYPES)}; without the"
                " object, readers would see free space in its place",
                f"write it as another type with --as, such as --as {thing.type}=plant",
            )


def occupancy_grid(scene: Scene) -> JsonDict:
    """Return the occupancy grid of a scene: -1 unknown, 0 free, 1 occupied.

    A cell is occupied if its centre lies in a piece of furniture with a body, or within half a cell's diagonal of a
    wall; other cells in the room are free. The grid covers the room's bounding box and a rim of 0.25 m. Cells are
    0.05 m, or larger for rooms above 200 m.

    Returns:
        Keys width and height (cells), cell_size, x_orig, y_orig (lower left corner, m), angle_orig, and data: rows of
        cells from the bottom up.
    """
    low, high = scene.outline.min(axis=0), scene.outline.max(axis=0)
    cell = CELL * math.ceil(max(float((high - low).max()) / (CELL * (MAX_GRID_CELLS - 2 * _RIM)), 1.0))
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


def _occupied(scene: Scene, points: Array, cell: float) -> BoolArray:
    """(M,), whether points (M, 2) are occupied."""
    occupied = np.zeros(len(points), dtype=bool)
    for wall in scene.walls:
        occupied |= _near_segment(points, np.array(wall.start), np.array(wall.end), cell * math.sqrt(0.5))
    for thing in scene.furniture:
        if thing.on is None:  # a thing on another one adds no footprint
            occupied |= _inside(points, thing)
    return occupied


def _near_segment(points: Array, start: Array, end: Array, distance: float) -> BoolArray:
    """Whether points are within a distance of a segment; one segment at a time, to limit the memory."""
    along = end - start
    square = float(along @ along)
    fraction = np.clip((points - start) @ along / square, 0.0, 1.0) if square else np.zeros(len(points))
    offset = points - start - fraction[:, None] * along
    return np.hypot(offset[:, 0], offset[:, 1]) <= distance


def _inside(points: Array, thing: Furniture) -> BoolArray:
    """Whether points are inside the outline of a piece of furniture."""
    offset, (c, s) = points - np.array(thing.pose.position), thing.pose.direction
    if isinstance(thing.shape, Disc):
        in_disc: BoolArray = np.hypot(offset[:, 0], offset[:, 1]) <= thing.shape.radius
        return in_disc
    ahead, left = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    in_rectangle: BoolArray = (np.abs(ahead) <= thing.shape.length / 2) & (np.abs(left) <= thing.shape.width / 2)
    return in_rectangle


def _label(record: EpisodeRecord) -> float | None:
    """The label of the run if it is what the format calls a label: a number from 0 to 1."""
    label = record.label
    if isinstance(label, dict) and len(label) == 1:
        (label,) = label.values()
    if isinstance(label, bool) or not isinstance(label, int | float) or not 0 <= label <= 1:
        return None
    return float(label)


def _sequence(record: EpisodeRecord, written_types: dict[int, str | None]) -> list[JsonDict]:
    """A step per frame, and one for the final state."""
    states, scene = record.states, record.scene()
    stamps = exact_stamps(states.tick, scene.rules.dt).tolist()
    frames = [*record.document["frames"], record.document["final"]]
    goal = _goal(record)
    objects = [_object(thing, type) for thing in scene.furniture if (type := written_types[thing.id]) is not None]
    shape = _shape(Disc(scene.robot.radius))
    return [
        {
            "timestamp": stamp,
            "robot": _robot(row, shape),
            "people": _people(record, rows, present),
            "objects": objects,
            "goal": goal,
            EXTRAS: {key: frame[key] for key in _EXTRA_STEP_KEYS if key in frame},
        }
        for stamp, row, rows, present, frame in zip(
            stamps, states.robot, states.humans.tolist(), states.present.tolist(), frames, strict=True
        )
    ]


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

    Readers match the pedestrians of two steps by id, and mask those who are in one of them only.
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
    if isinstance(shape, Disc):
        return {"type": "circle", "width": 2 * shape.radius, "length": 2 * shape.radius}
    return {"type": "rectangle", "width": shape.width, "length": shape.length}


def _goal(record: EpisodeRecord) -> JsonDict:
    goal = record.scene().goal
    return {
        "type": "go-to", "human": None, "x": goal.x, "y": goal.y, "angle": goal.theta,
        "pos_threshold": goal.distance, "angle_threshold": goal.angle,
    }  # fmt: skip


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
    header: JsonDict = dict(file[EXTRAS]["header"])
    software, dt = header.pop("software"), header["rules"]["dt"]
    steps = file["sequence"]
    robot = _robot_rows(steps)
    ids = [human["id"] for human in header["humans"]]
    frames = []
    for t, (step, robot_row) in enumerate(zip(steps, robot.tolist(), strict=True)):
        time, humans = float(rounded(np.array(t * dt))), _human_rows(step["people"], ids, t)
        frames.append({"tick": t, "time": time, "robot": robot_row, "humans": humans} | step[EXTRAS])
    return header | {"frames": [_in_order(frame) for frame in frames[:-1]], "final": frames[-1], "software": software}


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
        raise ValueError(f"ids of people at step {step} are not unique, or not among those of the header, {ids}")
    return [rows.get(float(id)) for id in ids]


def _source_episode(file: JsonDict, options: Options) -> SourceEpisode:
    steps, walls = file["sequence"], _walls(file, options)
    if not isinstance(steps, list) or len(steps) < 2:
        raise ValueError("its sequence must be a list of two steps or more")
    stamps = numbers(steps, ("timestamp",), "steps")[:, 0]
    time = stamps - stamps[0]
    if not (np.diff(time) > 5e-5).all():
        raise ValueError(f"timestamps must rise, step {int(np.argmin(np.diff(time))) + 1} does not")
    if options.renumber:
        steps = _renumbered(steps)
    ids, poses = _poses(steps)
    _check_static(steps)
    if options.renumber:
        _check_continuity(time, poses)
    rates = velocities(time, poses)
    robot = _robot_rows(steps)
    polygon = polygon_of(walls)
    points = np.concatenate((robot[:, POSITION], poses[..., POSITION].reshape(-1, 2), walls.reshape(-1, 2)))
    context, label = file.get("context_description"), file.get("label")
    return SourceEpisode(
        time=time,
        robot=robot,
        humans=np.concatenate((poses, rates, poses[..., THETA : THETA + 1]), axis=-1),  # the head faces ahead
        ids=ids,
        radii=fitting_radii(poses, walls),
        activity=activity_of(rates[..., POSITION]),
        interactions=[[] for _ in steps],
        polygon=bounding_box(points[~np.isnan(points[:, X])], 1.0) if polygon is None else polygon,
        walls=walls,
        objects=_objects(steps[0]["objects"], ids),
        goal=_read_goal(steps[0]["goal"]),
        robot_radius=_radius(steps[0]["robot"]["shape"]),
        missing=_MISSING,
        derived=_DERIVED if options.walls is None else (*_DERIVED, "walls"),
        header=({"context": context} if context is not None else {}) | ({"label": label} if label is not None else {}),
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
    for row, id, (x, y, theta) in zip(rows, ids, placed, strict=True):
        if id in used:
            id, unused = unused, unused + 1
        used.add(id)
        thing = {"id": id, "type": row["type"], "x": x, "y": y, "theta": theta, "shape": _read_shape(row["shape"])}
        objects.append(thing | {"on": None})
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
    given = {name: float(rounded(numbers([goal], (key,), "goal"))[0, 0]) for name, key in keys.items() if key in goal}
    return goal_of([x, y], theta, **given)


FORMAT = Format(
    "trajectory files of the SocNav3 data set, with an occupancy grid",
    ".json",
    import_,
    export=export,
    note=note,
    options=frozenset({"context", "types", "renumber", "walls"}),
)
