"""Mirrored episodes and data sets: left for right, exactly; mirrored twice they are the same bytes again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import RecordError
from ..record.canonical import plain, written
from ..record.files import packed, stem_of, suffix_of, write_atomically
from ..record.layout import Tree
from ..record.reader import read_episode, record_of
from ..record.record import EpisodeRecord, reading
from . import mirror_image as image
from .derived import Advance, listed_bytes, manifest_as_it_stands, new_folder, write_manifest
from .manifest import SCENARIO

MARK = "-mirror"  # ends the id and the file name of a mirrored episode
LabelImage = Callable[[Any], Any]


def mirrored(record: EpisodeRecord, *, label: LabelImage | None = None) -> EpisodeRecord:
    """The mirror image of an episode, or the original of one that is a mirror image.

    y, theta, heads, sideways and turning velocities and commands, and the side to which people evade change sign.
    Ids, interactions, activities, contacts (walls keep their indices), device events and times stay; a person's
    controls mean the mirrored twist. Seed and settings stay too: they tell what the original was made from, and
    `mirrored_from` tells that this is its image.

    Args:
        record: as read.
        label: gives the image of a frame's label, and of an image the label; labels stay as they are without it.

    Raises:
        RecordError: the episode is not whole, or `label` is not its own inverse.
    """
    with reading(record.path):
        document = _image_of(record.document, _checked(label) if label else None)
    path = record.path.with_name(mirror_name(record.path.name))
    return record_of(document, path)


def mirror_file(path: str | Path, out: str | Path, *, label: LabelImage | None = None) -> EpisodeRecord:
    """Mirror an episode file to another.

    Args:
        path: an episode file.
        out: where to; `.json`, `.json.gz` or `.json.zst`.
        label: as in `mirrored`; twist labels are mirrored by `transforms.twist_image`.

    Raises:
        RecordError: the file cannot be read, or the other not be written; or it is an image whose labels were mirrored
            and there is no `label`, or the other way round.
    """
    out, twin = Path(out), _twin(Path(path), label)
    write_atomically(out, packed(written(twin.document), out))
    return twin


def mirror_dataset(
    folder: str | Path, out: str | Path, *, label: LabelImage | None = None, advance: Advance = lambda step: None
) -> Tree:
    """Mirror every episode of a data set into a new one; ratings are of what was seen, and stay behind.

    Args:
        folder: a data set.
        out: a new folder; it is there only when it is whole.
        label: as in `mirror_file`.
        advance: is told how many episodes are done, as they are.

    Returns:
        The manifest of the new data set.

    Raises:
        RecordError: the data set is damaged, or the folder cannot be written; or as `mirror_file`.
    """
    folder, out = Path(folder), Path(out)
    manifest = manifest_as_it_stands(folder)
    names = {row["name"]: mirror_name(row["name"]) for row in manifest["files"]}
    if len(set(names.values())) < len(names):
        raise RecordError(f"{folder}: some files would get the same name when mirrored; rename those ending in {MARK}")
    with new_folder(out) as work:
        rows = []
        for row in manifest["files"]:
            listed_bytes(folder, row)
            rows.append(row | _stored(folder / row["name"], work, label))
            advance(1)
        if (folder / SCENARIO).is_file():
            write_atomically(work / SCENARIO, (folder / SCENARIO).read_bytes())
        twin = _manifest_image(manifest, rows, names)
        write_manifest(work, twin)
    return twin


def mirror_name(name: str) -> str:
    """The file name of an episode's mirror image, and back.

    >>> mirror_name("000007.json"), mirror_name("000007-mirror.json.gz")
    ('000007-mirror.json', '000007.json.gz')
    """
    stem, suffix = stem_of(Path(name)), suffix_of(Path(name))
    return f"{stem.removesuffix(MARK) if stem.endswith(MARK) and stem != MARK else stem + MARK}{suffix}"


def _twin(path: Path, label: LabelImage | None) -> EpisodeRecord:
    """The image of a file, which tells whether its labels were mirrored if it is one itself."""
    record = read_episode(path)
    told = record.document.get("mirrored_from")
    if told and told["labels"] is not (label is not None):
        way = "were mirrored: mirror them too, to have them back" if told["labels"] else "stayed: let them stay again"
        raise RecordError(f"{path} is a mirror image whose labels {way}")
    return mirrored(record, label=label)


def _stored(path: Path, work: Path, label: LabelImage | None) -> Tree:
    """Mirror one file; what the manifest says anew of it."""
    twin = _twin(path, label)
    place = work / twin.path.name
    data = packed(written(twin.document), place)
    write_atomically(place, data)
    return {"name": place.name, "sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}


def _manifest_image(manifest: Tree, rows: list[Tree], names: dict[str, str]) -> Tree:
    """The manifest of the mirrored data set."""
    twin = _toggled(manifest, after="version") | {"files": rows}
    twin["controller"] = image.controller_image(manifest["controller"])
    if manifest["split"] is not None:
        twin["split"] = {part: [names[name] for name in files] for part, files in manifest["split"].items()}
    if manifest.get("sources"):
        twin["sources"] = [
            _toggled(source, after="name") | {
                "files": [names[name] for name in source["files"]],
                "controller": image.controller_image(source["controller"]),
            }
            for source in manifest["sources"]
        ]  # fmt: skip
    return twin


def _toggled(tree: Tree, after: str) -> Tree:
    """With a note that it is mirrored if there is none, without one if there is."""
    twin: Tree = {}
    for key, value in tree.items():
        if key != "mirrored":
            twin[key] = value
        if key == after and not tree.get("mirrored"):
            twin["mirrored"] = True
    return twin


def _image_of(document: Tree, label: LabelImage | None) -> Tree:
    """The document's image, with its keys in the same order."""
    told = document.get("mirrored_from")
    known = dict(told["thetas"]) if told else {}
    parts: dict[str, Callable[[Any], Any]] = {
        "rules": image.rules_image,
        "room": image.room_image,
        "walls": image.walls_image,
        "objects": lambda things: image.objects_image(things, known),
        "humans": lambda people: [image.human_image(human) for human in people],
        "robot": image.placed_image,
        "goal": image.placed_image,
        "controller": image.controller_image,
        "frames": lambda frames: [image.frame_image(frame, label) for frame in frames],
        "final": lambda look: image.frame_image(look, label),
    }
    twin: Tree = {}
    for key, value in document.items():
        if key != "mirrored_from":
            twin[key] = parts[key](value) if key in parts else value
        if key == "branched_from" and not told:
            twin["mirrored_from"] = _note(document, label)
    twin["id"] = told["id"] if told else f"{document['id']}{MARK}"
    return twin


def _note(document: Tree, label: LabelImage | None) -> Tree:
    """What the image says of its original."""
    lost = [
        [k, thing["theta"]]
        for k, thing in enumerate(document["objects"])
        if image.is_oblong(thing) and not image.comes_back(thing["theta"])
    ]
    return {
        "id": document["id"],
        "sha256": hashlib.sha256(written(document)).hexdigest(),
        "labels": label is not None,
        "thetas": lost,
    }


def _checked(label: LabelImage) -> LabelImage:
    """The function, which must give a label again of its image."""

    def checked(value: Any) -> Any:
        twin = plain(label(value), "image of a label")
        if plain(label(twin), "image of a label") != value:
            raise RecordError(f"the image of the label {value!r} is {twin!r}, whose image is another; mend `label`")
        return twin

    return checked
