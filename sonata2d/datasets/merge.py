"""Merges data sets: the manifest keeps the settings and seed of each source, and every file keeps its bytes."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ..core.notebook import Advance
from ..errors import RecordError
from ..record.files import read_bytes, safe_text, write_atomically
from ..record.layout import JsonDict, software_versions
from .card import licence_of, write_manifest_and_card
from .manifest import DATASET_FORMAT, DATASET_VERSION, new_folder, read_listed_file, read_stored_manifest

_EQUAL_KEYS = ("physics", "precision")  # manifest keys that must be equal in all sources
_SOURCE_KEYS = (
    "settings",
    "seed",
    "episodes",
    "keep",
    "left_out",
    "controller",
    "controller_sha256",
)  # manifest keys kept for each source


def merge_datasets(folders: Sequence[str | Path], out: str | Path, *, advance: Advance = lambda step: None) -> JsonDict:
    """Copy the episodes of several data sets into a new one, byte for byte.

    File names get the name of their source folder as a prefix. The manifest's `sources` hold the origin of each data
    set. Splits are not copied, because a scene may be in several sources; split the merged data set again. The licence
    is that of the data sets, or `other` where they differ.

    Args:
        folders: complete data sets.
        out: a new folder; it appears only when it is complete.
        advance: progress callback; its argument is the number of episodes copied.

    Returns:
        The manifest of the new data set.

    Raises:
        RecordError: fewer than two folders are given, a data set is damaged or incomplete, two data sets differ in
            physics version or precision or contain the same episode, or the folder cannot be written.
    """
    paths = [Path(folder) for folder in folders]
    manifests = [read_stored_manifest(path) for path in paths]
    _require_mergeable(paths, manifests)
    prefixes = _prefixes(paths)
    rows: list[JsonDict] = []
    with new_folder(Path(out)) as work:
        for path, prefix, manifest in zip(paths, prefixes, manifests, strict=True):
            for row in manifest["files"]:
                name = f"{prefix}__{row['name']}"
                write_atomically(work / name, read_listed_file(path, row))
                rows.append(row | {"name": name})
                advance(1)
        sources = [
            source
            for prefix, manifest in zip(prefixes, manifests, strict=True)
            for source in _sources(prefix, manifest)
        ]
        merged = _merged_manifest(manifests[0], rows, sources)
        licences = {licence_of(path) for path in paths}
        write_manifest_and_card(work, merged, licence=licences.pop() if len(licences) == 1 else "other")
    return merged


def _require_mergeable(paths: Sequence[Path], manifests: Sequence[JsonDict]) -> None:
    if len(paths) < 2:
        raise RecordError(f"merging needs two or more data sets, got {len(paths)}")
    path_of_hash: dict[str, Path] = {}
    for path, manifest in zip(paths, manifests, strict=True):
        if not manifest["complete"]:
            raise RecordError(f"{path} is not complete; resume its generation with --resume first")
        for key in _EQUAL_KEYS:
            if manifest[key] != manifests[0][key]:
                raise RecordError(
                    f"{path} has {key} {manifest[key]} but {paths[0]} has {manifests[0][key]}; they cannot be merged"
                )
        for row in manifest["files"]:
            file = path / row["name"]
            # The unpacked document without its software block identifies an episode under any compression.
            digest = hashlib.sha256(read_bytes(file).rpartition(b'"software"')[0]).hexdigest()
            if digest in path_of_hash:
                raise RecordError(f"{file} is the same episode as {path_of_hash[digest]}; omit one of the data sets")
            path_of_hash[digest] = file


def _prefixes(paths: Sequence[Path]) -> list[str]:
    """A distinct file-name prefix for each source folder."""
    prefixes: list[str] = []
    for path in paths:
        stem, number = safe_text(Path(os.path.abspath(path)).name), 1  # `..` gets the name of its folder
        while (prefix := f"{stem}-{number}" if number > 1 else stem) in prefixes:
            number += 1
        prefixes.append(prefix)
    return prefixes


def _sources(prefix: str, manifest: JsonDict) -> list[JsonDict]:
    """The entries in `sources` for a data set; a merged data set passes on its own sources."""
    if manifest.get("sources"):
        return [
            source | {"name": f"{prefix}__{source['name']}", "files": [f"{prefix}__{file}" for file in source["files"]]}
            for source in manifest["sources"]
        ]
    source: JsonDict = {"name": prefix} | ({"mirrored": True} if manifest.get("mirrored") else {})
    source |= {"scenario": manifest["name"], **{key: manifest[key] for key in _SOURCE_KEYS if key in manifest}}
    return [source | {"files": [f"{prefix}__{row['name']}" for row in manifest["files"]]}]


def _merged_manifest(first: JsonDict, rows: list[JsonDict], sources: list[JsonDict]) -> JsonDict:
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
        **{key: first[key] for key in _EQUAL_KEYS},
        "complete": True,
        "counts": {key: dict(sorted(count.items())) for key, count in counts.items()},
        "split": None,
        "sources": sources,
        "files": rows,
        "software": software_versions(),
    }
