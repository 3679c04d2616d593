"""Mirrors episodes and data sets left-right, exactly: mirroring twice gives the original bytes.

The mirror axis is the world's x axis, so y becomes -y. Only signs change, therefore no digit is lost. The vertices of
polygons are reversed to stay counter-clockwise, and the ends of walls are swapped to keep the room on the same side;
the walls keep their order and indices. Pedestrians, the robot and most objects are symmetric, so theta becomes
-theta. An oblong object has its front at -y; theta becomes pi - theta to keep it there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from ...agents.sensors.base import definition_of, sensor_from
from ...core.files.locations import location
from ...core.geometry import quantised
from ...core.notebook import Advance
from ...core.portable_math import PI
from ...core.vectors import wrap_angle
from ...errors import RecordError
from ...record.canonical import serialise, to_json_value
from ...record.files import compress, file_stem, file_suffix, read_stored, write_atomically
from ...record.layout import JsonDict, moving_doors
from ...record.motion import HEAD, OMEGA, THETA, VY, Y
from ...record.reader import read_episode
from ...record.record import EpisodeRecord, record_from_document
from ...workers.executors import Workers, parallel_map, shared_workers
from ...workers.processes import end_if_unguarded
from ...workers.tasks import stop_if_over, stop_if_unwanted
from ..card.write import licence_of, write_manifest_and_card, write_tables_as
from ..manifest.names import SCENARIO
from ..manifest.read import read_document
from ..manifest.rows import listing, read_listed_file, read_stored_manifest, stored_form, warn_if_incomplete, with_rows
from ..shards import write_shard
from .new_folder import new_folder

MARK = "-mirror"  # suffix of the id and the file name of a mirrored episode
LabelImage = Callable[[Any], Any]

HALF_TURN = 3.1416  # pi at the precision of files, which do not contain -3.1416: it is its own mirror image
_ROBOT_SIGNS = (Y, THETA, VY, OMEGA)  # columns that change sign
_HUMAN_SIGNS = (*_ROBOT_SIGNS, HEAD)
_TWIST_SIGNS = (1, 2)  # vy, omega
_SIDEWAYS_AXES = ("left", "turn")  # axes of the robot in device mappings


def mirrored(record: EpisodeRecord, *, label: LabelImage | None = None) -> EpisodeRecord:
    """The mirror image of an episode, or the original of a mirror image.

    y, theta, heads, lateral and angular velocities and commands, and the side of evasion change sign. Ids,
    interactions, activities, contacts (walls keep their indices), device events and times stay; the device mappings of
    a driver give the mirrored twist. Seed and settings stay too: they describe the original, and `mirrored_from` marks
    the episode as its image.

    Args:
        record: a recorded episode.
        label: maps the label of a frame to its mirror image and back; without it labels stay unchanged.

    Raises:
        RecordError: `label` is not its own inverse.
    """
    document = _document_image(record.document, _checked(label) if label else None)
    path = record.path.with_name(mirror_name(record.path.name))
    return record_from_document(document, path)


def mirror_file(path: str | Path, out: str | Path, *, label: LabelImage | None = None) -> EpisodeRecord:
    """Mirror an episode file.

    Args:
        path: an episode file.
        out: output file: `.json`, `.json.gz` or `.json.zst`.
        label: as in `mirrored`; `twist_image` mirrors labels that are twists.

    Returns:
        The mirrored episode.

    Raises:
        RecordError: the input cannot be read or the output cannot be written, or the input is an image whose labels
            were mirrored and `label` is missing, or the reverse.
    """
    out, image = location(out), _read_image(location(path), label)
    write_atomically(out, compress(serialise(image.document), out))
    return image


def mirror_dataset(
    folder: str | Path,
    out: str | Path,
    *,
    label: LabelImage | None = None,
    workers: int | Executor | Workers = 1,
    advance: Advance = lambda step: None,
) -> JsonDict:
    """Mirror every episode of a data set into a new one; ratings are not copied, because they refer to the originals.

    A data set in shards is mirrored shard by shard.

    Args:
        folder: folder of the data set.
        out: a new folder; it appears only when it is complete.
        label: as in `mirror_file`.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        advance: progress callback; its argument is the number of episodes mirrored.

    Returns:
        The manifest of the new data set.

    Raises:
        RecordError: the data set is damaged, the folder cannot be written, or as `mirror_file`.
        WorkerError: a worker crashed, was killed, or has other software.
    """
    end_if_unguarded()
    folder, out = location(folder), location(out)
    manifest = read_stored_manifest(folder)
    warn_if_incomplete(folder, manifest)
    image = _manifest_image(folder, stored_form(manifest))
    with shared_workers(workers) as pool, new_folder(out) as work:
        folder, work = pool.place(folder), pool.place(work)
        rows, store = list[JsonDict](), partial(_listed_image, folder, work, label)
        for row in parallel_map(store, listing(manifest), workers=pool, reads=folder, writes=work):
            rows.append(row)
            advance(row.get("episodes", 1))
        image["shards" if "shards" in manifest else "files"] = rows
        if (folder / SCENARIO).is_file():
            write_atomically(work / SCENARIO, read_stored(folder / SCENARIO))
        write_manifest_and_card(work, with_rows(image, work), licence=licence_of(folder))
        write_tables_as(work, [folder], pool)
    return read_stored_manifest(out)


def mirror_name(name: str) -> str:
    """The file name of an episode's mirror image, and the reverse.

    >>> mirror_name("000007.json"), mirror_name("000007-mirror.json.gz")
    ('000007-mirror.json', '000007.json.gz')
    """
    stem, suffix = file_stem(Path(name)), file_suffix(Path(name))
    return f"{stem.removesuffix(MARK) if stem.endswith(MARK) and stem != MARK else stem + MARK}{suffix}"


def twist_image(label: Any) -> list[Any]:
    """The mirror image of a label that is a twist [vx, vy, omega]: vy and omega change sign.

    >>> twist_image([0.5, 0.1, -0.3])
    [0.5, -0.1, 0.3]

    Raises:
        RecordError: the label is not a twist.
    """
    if not isinstance(label, list) or len(label) != 3 or any(type(value) not in (int, float) for value in label):
        raise RecordError(f"the label {label!r} is not a twist [vx, vy, omega]; mirror without changing the labels")
    return _row_image(label, _TWIST_SIGNS)


def _checked(label: LabelImage) -> LabelImage:
    """Wrap `label` to raise RecordError where it is not its own inverse."""

    def checked(value: Any) -> Any:
        image = to_json_value(label(value), "image of a label")
        if to_json_value(label(image), "image of a label") != value:
            raise RecordError(
                f"the image of the label {value!r} is {image!r}, whose image is another; `label` must be its own"
                " inverse"
            )
        return image

    return checked


# Files and manifests


def _read_image(path: Path, label: LabelImage | None) -> EpisodeRecord:
    """The image of an episode file; the labels of an image must be treated as when it was made."""
    record = read_episode(path)
    origin = record.document.get("mirrored_from")
    if origin and origin["labels"] is not (label is not None):
        remedy = "were mirrored: mirror them again" if origin["labels"] else "were not mirrored: do not mirror them now"
        raise RecordError(f"{path} is a mirror image whose labels {remedy}")
    return mirrored(record, label=label)


def _listed_image(folder: Path, work: Path, label: LabelImage | None, row: JsonDict) -> JsonDict:
    """Mirror a listed file or shard into a folder, and return its row."""
    if "episodes" in row:  # of a shard
        shard = folder / row["name"]
        manifest = read_document(shard)
        members = (_packed_image(shard, label, member) for member in manifest["files"])
        return write_shard(work / row["name"], _manifest_image(shard, manifest), members)
    row, data = _packed_image(folder, label, row)
    stop_if_unwanted()
    write_atomically(work / row["name"], data)
    return row


def _packed_image(folder: Path, label: LabelImage | None, row: JsonDict) -> tuple[JsonDict, bytes]:
    """The row and the stored bytes of the image of a listed file."""
    stop_if_over()
    read_listed_file(folder, row)
    image = _read_image(folder / row["name"], label)
    data = compress(serialise(image.document), image.path)
    return row | {"name": image.path.name, "sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}, data


def _manifest_image(place: Path, manifest: JsonDict) -> JsonDict:
    """The image of a manifest as it is stored; the rows of files or shards stay, and are replaced later.

    Args:
        place: folder or shard of the manifest.
        manifest: of a data set or of a shard.

    Raises:
        RecordError: two mirrored files would have one name.
    """
    names = {row["name"]: mirror_name(row["name"]) for row in manifest.get("files", ())}
    if len(set(names.values())) < len(names):
        raise RecordError(f"{place}: mirrored files would share a name; rename the files ending in {MARK}")
    image = _with_mark_toggled(manifest, after="version")
    image["controller"] = _controller_image(manifest["controller"])
    if manifest["split"] is not None and names:  # the manifest of a data set in shards has numbers only
        image["split"] = {part: [names[name] for name in files] for part, files in manifest["split"].items()}
    if manifest.get("sources"):
        image["sources"] = [
            _with_mark_toggled(source, after="name")
            | ({"files": [names[name] for name in source["files"]]} if "files" in source else {})
            | {"controller": _controller_image(source["controller"])}
            for source in manifest["sources"]
        ]
    return image


def _with_mark_toggled(document: JsonDict, after: str) -> JsonDict:
    """The document with `mirrored: true` after the given key, or without it if it has one."""
    result: JsonDict = {}
    for key, value in document.items():
        if key != "mirrored":
            result[key] = value
        if key == after and not document.get("mirrored"):
            result["mirrored"] = True
    return result


# Parts of an episode document; each function is its own inverse, to the bit.


def _document_image(document: JsonDict, label: LabelImage | None) -> JsonDict:
    """The image of an episode document, with the keys in the same order."""
    origin = document.get("mirrored_from")
    original_thetas = dict(origin["thetas"]) if origin else {}
    hinged = [door["kind"] == "hinged" for door in moving_doors(document)]

    def state_image(state: JsonDict) -> JsonDict:
        image = _frame_image(state, label)
        return _doors_image(image, hinged) if hinged else image

    images: dict[str, Callable[[Any], Any]] = {
        "rules": lambda rules: rules | {"side": flipped(rules["side"])},  # pedestrians evade to the other side
        "room": _room_image,
        "areas": lambda areas: [_area_image(area) for area in areas],
        "walls": lambda walls: [[x2, flipped(y2), x1, flipped(y1)] for x1, y1, x2, y2 in walls],  # with swapped ends
        "objects": lambda objects: _objects_image(objects, original_thetas),
        "doors": lambda doors: [_pose_image(door) for door in doors],
        "interior_doors": lambda doors: [_interior_door_image(door) for door in doors],
        "queues": lambda queues: [_pose_image(queue) for queue in queues],
        "places": lambda places: [place | {"y": flipped(place["y"])} for place in places],
        "humans": lambda humans: [_human_image(human) for human in humans],
        **_IMAGES_OF_ROBOT,
        "robots": lambda robots: [_robot_image(other) for other in robots],
        "frames": lambda frames: [state_image(frame) for frame in frames],
        "final": lambda frame: state_image(frame),
    }
    sensors = [_sensors_of(robot) for robot in (document, *(document.get("robots") or ()))]
    if any(sensors):
        images["frames"] = lambda frames: [_readings_image(state_image(frame), sensors) for frame in frames]
    image: JsonDict = {}
    for key, value in document.items():
        if key != "mirrored_from":
            image[key] = images[key](value) if key in images else value
        if key == "branched_from" and not origin:
            image["mirrored_from"] = _origin(document, label)
    image["id"] = origin["id"] if origin else f"{document['id']}{MARK}"
    return image


def _room_image(room: JsonDict) -> JsonDict:
    """The image of the outline and of the holes; reversed, the corners stay counter-clockwise."""
    image = room | {"polygon": _points_image(reversed(room["polygon"]))}
    return image | ({"holes": [_points_image(reversed(hole)) for hole in room["holes"]]} if room.get("holes") else {})


def _origin(document: JsonDict, label: LabelImage | None) -> JsonDict:
    """The value of `mirrored_from` in the image of a document."""
    irreversible = [
        [k, thing["theta"]]
        for k, thing in enumerate(document["objects"])
        if _is_oblong(thing) and not is_turn_reversible(thing["theta"])
    ]
    return {
        "id": document["id"],
        "sha256": hashlib.sha256(serialise(document)).hexdigest(),
        "labels": label is not None,
        "thetas": irreversible,
    }


def flipped(value: Any) -> Any:
    """The number with the opposite sign; an int stays an int, and zero never becomes -0.0."""
    return 0 - value


def flipped_angle(theta: Any) -> Any:
    """The mirror image of an angle, -theta."""
    return theta if abs(theta) == HALF_TURN else flipped(theta)


def turned_angle(theta: Any) -> float:
    """The mirror image of the angle of an oblong object, pi - theta.

    The result is rounded to the precision of files if theta is; then applying the function twice gives theta.
    """
    if quantised(theta) != theta:
        return wrap_angle(PI - theta)
    turned = quantised(HALF_TURN - theta)
    return turned if turned <= HALF_TURN else quantised(turned - 2 * HALF_TURN)


def is_turn_reversible(theta: Any) -> bool:
    """Whether applying `turned_angle` twice gives theta in the same notation."""
    return repr(turned_angle(turned_angle(theta))) == repr(theta)


def _is_oblong(thing: JsonDict) -> bool:
    shape = thing["shape"]
    return shape["type"] == "rectangle" and bool(shape["length"] > shape["width"])


def _pose_image(entity: JsonDict) -> JsonDict:
    return entity | {"y": flipped(entity["y"]), "theta": flipped_angle(entity["theta"])}


def _shape_image(entity: JsonDict) -> JsonDict:
    """The entity with the image of its outline: of a polygon, whose corners stay counter-clockwise."""
    shape = entity.get("shape") or {}
    if shape.get("type") != "polygon":
        return entity
    return entity | {"shape": shape | {"points": _points_image(reversed(shape["points"]))}}


def _human_image(human: JsonDict) -> JsonDict:
    points = {key: _points_image(human[key]) for key in ("goals", "track")}
    return _pose_image(human) | points | {"velocity": _points_image([human["velocity"]])[0]}


def _goal_image(goal: JsonDict) -> JsonDict:
    image = _pose_image(goal)
    return image | {"then": _points_image(goal["then"])} if "then" in goal else image


def _area_image(area: JsonDict) -> JsonDict:
    """The image of an area."""
    image = area | {"polygon": _points_image(reversed(area["polygon"]))}
    return image | {"one_way": flipped_angle(area["one_way"])} if "one_way" in area else image


def _interior_door_image(door: JsonDict) -> JsonDict:
    """The image of an interior door; a hinged one opens to the other side."""
    image = _pose_image(door)
    is_turned = door["kind"] == "hinged" and "opening" in door
    return image | {"opening": flipped(door["opening"])} if is_turned else image


def _doors_image(state: JsonDict, hinged: list[bool]) -> JsonDict:
    """The image of a state in the openings of its doors."""
    openings = [flipped(each) if turns else each for each, turns in zip(state["doors"], hinged, strict=True)]
    return state | {"doors": openings}


def _points_image(points: Iterable[list[Any]]) -> list[list[Any]]:
    return [[x, flipped(y)] for x, y in points]


def _objects_image(objects: list[JsonDict], original_thetas: dict[int, Any]) -> list[JsonDict]:
    """The images of objects.

    Args:
        objects: as in the file.
        original_thetas: angles, by index, that `turned_angle` does not restore.
    """
    images = [_shape_image(_pose_image(thing)) for thing in objects]
    for k, thing in enumerate(objects):
        if _is_oblong(thing):
            images[k]["theta"] = original_thetas.get(k, turned_angle(thing["theta"]))
    return images


def _controller_image(controller: JsonDict | None) -> JsonDict | None:
    """The image of a controller; for teleoperation the device mappings are mirrored.

    The recorded device events stay the same and then give the mirrored twists, whatever the mappings are.
    """
    mappings = ((controller or {}).get("settings") or {}).get("hands")
    if controller is None or controller["path"] != "teleoperation" or not mappings:
        return controller
    image = {}
    for kind, mapping in mappings.items():
        controls = {
            control: [axis, flipped(gain) if axis in _SIDEWAYS_AXES else gain]
            for control, (axis, gain) in mapping["controls"].items()
        }
        image[kind] = mapping | {"controls": controls}
    return controller | {"settings": controller["settings"] | {"hands": image}}


# of the keys of each robot
_IMAGES_OF_ROBOT: dict[str, Callable[[Any], Any]] = {
    "robot": lambda robot: _shape_image(_pose_image(robot)),
    "goal": _goal_image,
    "controller": _controller_image,
    "sensors": lambda sensors: [_sensor_image(definition) for definition in sensors],
}


def _sensor_image(definition: JsonDict) -> JsonDict:
    """The image of the definition of a sensor, with its keys in the same order."""
    sensor = sensor_from(definition)
    if sensor is None:
        raise RecordError(
            f"readings of {definition['type']} cannot be mirrored without its code; register it as a sensor, see "
            "CONTRIBUTING.md, or record without it"
        )
    settings = definition_of(sensor.mirrored())["settings"]
    return definition | {"settings": definition["settings"] | to_json_value(settings, "settings", exact=True)}


def _sensors_of(robot: JsonDict) -> dict[str, Any]:
    return {each["name"]: sensor_from(each) for each in robot.get("sensors") or ()}


def _readings_image(frame: JsonDict, sensors: list[dict[str, Any]]) -> JsonDict:
    """Mirror the readings in a frame.

    Args:
        frame: with all other values mirrored.
        sensors: of each robot, by name.
    """
    robots = [frame, *(frame.get("robots") or ())]
    images = [
        robot | {"sensors": {name: own[name].mirrored_json(value) for name, value in robot["sensors"].items()}}
        if robot.get("sensors")
        else robot
        for robot, own in zip(robots, sensors, strict=True)
    ]
    image: JsonDict = images[0] | ({"robots": images[1:]} if "robots" in frame else {})
    return image


def _robot_image(other: JsonDict) -> JsonDict:
    return {key: _IMAGES_OF_ROBOT.get(key, lambda value: value)(value) for key, value in other.items()}


def _frame_image(frame: JsonDict, label: LabelImage | None) -> JsonDict:
    """The image of a frame, of the final state, or of another robot in them.

    The final state of an imported run may have a command.
    """
    image = frame | {"robot": _row_image(frame["robot"], _ROBOT_SIGNS)}
    if "humans" in frame:
        image["humans"] = [None if row is None else _row_image(row, _HUMAN_SIGNS) for row in frame["humans"]]
    if "robots" in frame:
        image["robots"] = [_frame_image(other, label) for other in frame["robots"]]
    for key in ("command", "executed"):
        if key in frame:
            image[key] = _row_image(frame[key], _TWIST_SIGNS)
    if label is not None and "label" in frame:
        image["label"] = label(frame["label"])
    return image


def _row_image(row: list[Any], sign_columns: tuple[int, ...]) -> list[Any]:
    """A row with the opposite sign in some columns; angles stay in (-pi, pi]."""
    image = list(row)
    is_twist = len(row) == 3  # twists have no angle columns
    for k in sign_columns:
        image[k] = flipped_angle(row[k]) if k in (THETA, HEAD) and not is_twist else flipped(row[k])
    return image
