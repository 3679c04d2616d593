"""Several data sets as one; each keeps its own settings and seed in the manifest, and every file its bytes."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import RecordError
from ..record.files import read_bytes, safe_text, write_atomically
from ..record.layout import Tree, software
from .derived import Advance, listed_bytes, manifest_as_it_stands, new_folder, write_manifest
from .manifest import DATASET_FORMAT, DATASET_VERSION

_ALIKE = ("physics", "precision")
_TOLD = ("settings", "seed", "episodes", "keep", "left_out", "controller")


def merge_datasets(folders: Sequence[str | Path], out: str | Path, *, advance: Advance = lambda step: None) -> Tree:
    """Copy the episodes of several data sets into a new one, byte for byte.

    File names begin with the name of the folder they come from. The manifest's `sources` hold what each data set
    was made from. Splits are left behind, since a scene may be in several of the sets: split the whole again.

    Args:
        folders: data sets, complete ones.
        out: a new folder; it is there only when it is whole.
        advance: is told how many episodes are done, as they are.

    Returns:
        The manifest of the new data set.

    Raises:
        RecordError: a data set is damaged or incomplete, two differ in physics version or precision, hold the same
            episode, or the folder cannot be written.
    """
    paths = [Path(folder) for folder in folders]
    manifests = [manifest_as_it_stands(path) for path in paths]
    _refuse_unfit(paths, manifests)
    names = _names(paths)
    rows: list[Tree] = []
    with new_folder(Path(out)) as work:
        for path, name, manifest in zip(paths, names, manifests, strict=True):
            for row in manifest["files"]:
                write_atomically(work / f"{name}__{row['name']}", listed_bytes(path, row))
                rows.append(row | {"name": f"{name}__{row['name']}"})
                advance(1)
        sources = [one for name, manifest in zip(names, manifests, strict=True) for one in _sources(name, manifest)]
        merged = _manifest(manifests[0], rows, sources)
        write_manifest(work, merged)
    return merged


def _refuse_unfit(paths: Sequence[Path], manifests: Sequence[Tree]) -> None:
    if len(paths) < 2:
        raise RecordError(f"{len(paths)} data set given; merging takes two or more")
    seen: dict[str, Path] = {}
    for path, manifest in zip(paths, manifests, strict=True):
        if not manifest["complete"]:
            raise RecordError(f"{path} is not complete; go on with --resume first")
        for key in _ALIKE:
            if manifest[key] != manifests[0][key]:
                raise RecordError(f"{path} has {key} {manifest[key]}, {paths[0]} {manifests[0][key]}; they stay apart")
        for row in manifest["files"]:
            file = path / row["name"]
            document = hashlib.sha256(read_bytes(file).rpartition(b'"software"')[0]).hexdigest()  # however it is packed
            if document in seen:
                raise RecordError(f"{file} is the same episode as {seen[document]}; leave one of the data sets out")
            seen[document] = file


def _names(paths: Sequence[Path]) -> list[str]:
    """A name for each source, all different."""
    names: list[str] = []
    for path in paths:
        stem, again = safe_text(path.resolve().name), 1
        while (name := f"{stem}-{again}" if again > 1 else stem) in names:
            again += 1
        names.append(name)
    return names


def _sources(name: str, manifest: Tree) -> list[Tree]:
    """What a data set was made from; of one that was merged itself, what each of its own was."""
    if manifest.get("sources"):
        return [
            source | {"name": f"{name}__{source['name']}", "files": [f"{name}__{file}" for file in source["files"]]}
            for source in manifest["sources"]
        ]
    told: dict[str, Any] = {"name": name} | ({"mirrored": True} if manifest.get("mirrored") else {})
    told |= {"scenario": manifest["name"], **{key: manifest[key] for key in _TOLD if key in manifest}}
    return [told | {"files": [f"{name}__{row['name']}" for row in manifest["files"]]}]


def _manifest(first: Tree, rows: list[Tree], sources: list[Tree]) -> Tree:
    counted = ["outcome", "family"] + ["contributor"] * any(row.get("contributor") is not None for row in rows)
    counts = {key: Counter(row[key] for row in rows if row.get(key) is not None) for key in counted}
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        "name": None,
        "settings": None,
        "seed": None,
        "episodes": len(rows),
        "controller": None,
        **{key: first[key] for key in _ALIKE},
        "complete": True,
        "counts": {key: dict(sorted(count.items())) for key, count in counts.items()},
        "split": None,
        "sources": sources,
        "files": rows,
        "software": software(),
    }
