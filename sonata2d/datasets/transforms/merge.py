"""Merges data sets: the manifest keeps the settings and seed of each source, and every file keeps its bytes."""

from __future__ import annotations

import hashlib
import os
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ...core.files.locations import is_remote, location
from ...core.notebook import Advance
from ...errors import RecordError
from ...record.files import read_bytes, safe_text, write_atomically
from ...record.layout import JsonDict, software_versions
from ..card.write import licence_of, write_manifest_and_card, write_tables_as
from ..manifest.names import shard_name
from ..manifest.read import DATASET_FORMAT, DATASET_VERSION, SHARDED_VERSION
from ..manifest.rows import read_listed_file, read_shard, read_stored_manifest, with_rows
from ..manifest.write import COUNTED, counts_of
from ..shards import write_shard
from .new_folder import new_folder

_EQUAL_KEYS = ("physics", "precision")  # manifest keys that must be equal in all sources
# manifest keys kept for each source
_SOURCE_KEYS = ("settings", "seed", "episodes", "keep", "left_out", "controller", "controller_sha256")


def merge_datasets(folders: Sequence[str | Path], out: str | Path, *, advance: Advance = lambda step: None) -> JsonDict:
    """Copy the episodes of several data sets into a new one, byte for byte.

    Names of files, or of shards, get the name of their source folder as a prefix. If one of the data sets is in shards,
    the new one is, too: shards are copied, and files are put into new ones. The manifest's `sources` hold the origin of
    each data set. Splits are not copied, because a scene may be in several sources; split the merged data set again.
    The licence is the common licence of the data sets, or `other` where they differ.

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
    paths = [location(folder) for folder in folders]
    manifests = [read_stored_manifest(path) for path in paths]
    _require_mergeable(paths, manifests)
    size = max((manifest["shard_size"] for manifest in manifests if "shards" in manifest), default=None)
    rows: list[JsonDict] = []
    sources: list[JsonDict] = []
    with new_folder(location(out)) as work:
        for path, prefix, manifest in zip(paths, _prefixes(paths), manifests, strict=True):
            for source in _sources(manifest):
                if size is None:
                    copied, kind = _copied_files(path, manifest, source, work, prefix, advance), "files"
                else:
                    copied, kind = _copied_shards(path, manifest, source, work, prefix, advance, size), "shards"
                rows += copied
                origin = {key: value for key, value in source.items() if key not in ("files", "shards")}
                origin["name"] = f"{prefix}__{source['name']}" if manifest.get("sources") else prefix
                sources.append(origin | {kind: [row["name"] for row in copied]})
        merged = _merged_manifest(work, manifests[0], rows, sources, size)
        licences = {licence_of(path) for path in paths}
        write_manifest_and_card(work, merged, licence=licences.pop() if len(licences) == 1 else "other")
        write_tables_as(work, paths)
    return read_stored_manifest(location(out))


def _sources(manifest: JsonDict) -> list[JsonDict]:
    """The sources of a merged data set, or another data set as its only source, which has no name yet."""
    if manifest.get("sources"):
        return list(manifest["sources"])
    source: JsonDict = {"name": ""} | ({"mirrored": True} if manifest.get("mirrored") else {})
    return [source | {"scenario": manifest["name"], **{key: manifest[key] for key in _SOURCE_KEYS if key in manifest}}]


def _files_of(manifest: JsonDict, source: JsonDict) -> list[JsonDict]:
    """The rows of the files of a source."""
    by_name = {row["name"]: row for row in manifest["files"]}
    return [by_name[name] for name in source.get("files", by_name)]


def _copied_files(
    path: Path, manifest: JsonDict, source: JsonDict, work: Path, prefix: str, advance: Advance
) -> list[JsonDict]:
    """Copy the files of a source into a folder, and return their rows.

    Args:
        path: of the data set.
        manifest: of the data set.
        source: of the data set.
        work: the folder.
        prefix: of the names of the files.
        advance: progress callback.
    """
    rows = []
    for row in _files_of(manifest, source):
        name = f"{prefix}__{row['name']}"
        write_atomically(work / name, read_listed_file(path, row))
        rows.append(row | {"name": name})
        advance(1)
    return rows


def _copied_shards(
    path: Path, manifest: JsonDict, source: JsonDict, work: Path, prefix: str, advance: Advance, size: int
) -> list[JsonDict]:
    """Copy the shards of a source into a folder, or its files into new shards, and return the rows of the shards.

    Args:
        path, manifest, source, work, prefix, advance: as of `_copied_files`.
        size: number of files in a new shard.
    """
    shards = []
    for name, parent, part in _shards_of(path, manifest, source, size):
        members = ((row, read_listed_file(parent, row)) for row in part["files"])
        shards.append(write_shard(work / f"{prefix}__{name}", part | {"split": None}, members))
        advance(shards[-1]["episodes"])
    return shards


def _shards_of(path: Path, manifest: JsonDict, source: JsonDict, size: int) -> Iterator[tuple[str, Path, JsonDict]]:
    """The shards of a source, or the shards into which its files are put: name, place of the episodes, and manifest."""
    if "shards" in manifest:
        for shard in manifest["shards"]:
            if shard["name"] in source.get("shards", (shard["name"],)):
                yield shard["name"], path / shard["name"], read_shard(path, shard)
        return
    rows = _files_of(manifest, source)
    for first in range(0, len(rows), size):
        name = shard_name(first // size)
        part = _shard_manifest(manifest, source, rows[first : first + size], first)
        yield f"{source['name']}__{name}" if source["name"] else name, path, part


def _shard_manifest(manifest: JsonDict, source: JsonDict, rows: list[JsonDict], first: int) -> JsonDict:
    """The manifest of a shard into which files are put.

    Args:
        manifest: of the data set that the files are copied from.
        source: of the data set.
        rows: of the files.
        first: number of files of the source in the shards before.
    """
    part = {key: value for key, value in manifest.items() if key not in ("left_out", "sources", "mirrored")}
    part |= {key: source[key] for key in _SOURCE_KEYS if key in source} | {"name": source["scenario"]}
    part.pop("left_out", None)
    covered = {"first": first, "stop": first + len(rows)}
    if source.get("mirrored"):
        part["mirrored"] = True
    if part.get("keep"):
        # the manifest of files does not say which episodes were left out
        part["left_out"] = {}
        covered = {"first": rows[0]["episode"], "stop": rows[-1]["episode"] + 1}
    part |= {"counts": counts_of(rows), "episodes": len(rows), "collected": bool(manifest.get("collected"))}
    return part | {"files": rows, "shard": covered}


def _require_mergeable(paths: Sequence[Path], manifests: Sequence[JsonDict]) -> None:
    if len(paths) < 2:
        raise RecordError(f"merging needs two or more data sets, got {len(paths)}")
    digests = array("Q")  # of the episodes: the first eight bytes of each
    for path, manifest in zip(paths, manifests, strict=True):
        if not manifest["complete"]:
            raise RecordError(f"{path} is not complete; resume its generation with --resume first")
        for key in _EQUAL_KEYS:
            if manifest[key] != manifests[0][key]:
                raise RecordError(
                    f"{path} has {key} {manifest[key]} but {paths[0]} has {manifests[0][key]}; they cannot be merged"
                )
        digests.extend(int.from_bytes(_digest(path / row["name"])[:8]) for row in manifest["files"])
    numbers, counts = np.unique(np.frombuffer(digests, dtype=np.uint64), return_counts=True)
    repeated = set(numbers[counts > 1].tolist())
    path_of: dict[bytes, Path] = {}
    for path, manifest in zip(paths, manifests, strict=True) if repeated else ():
        for row in manifest["files"]:
            file = path / row["name"]
            digest = _digest(file)
            if int.from_bytes(digest[:8]) in repeated:
                if digest in path_of:
                    raise RecordError(f"{file} is the same episode as {path_of[digest]}; omit one of the data sets")
                path_of[digest] = file


def _digest(file: Path) -> bytes:
    """SHA-256 of an episode under any compression: of its unpacked document without the software block."""
    return hashlib.sha256(read_bytes(file).rpartition(b'"software"')[0]).digest()


def _prefixes(paths: Sequence[Path]) -> list[str]:
    """A distinct file-name prefix for each source folder."""
    prefixes: list[str] = []
    for path in paths:
        name = path.name if is_remote(path) else os.path.basename(os.path.abspath(path))  # also of `..`
        stem, number = safe_text(name), 1
        while (prefix := f"{stem}-{number}" if number > 1 else stem) in prefixes:
            number += 1
        prefixes.append(prefix)
    return prefixes


def _merged_manifest(
    work: Path, first: JsonDict, rows: list[JsonDict], sources: list[JsonDict], size: int | None
) -> JsonDict:
    """The manifest of a merged data set.

    Args:
        work: its folder.
        first: manifest of the first data set.
        rows: of its files, or of its shards.
        sources: entries of its sources.
        size: number of episodes in its largest shards; None: it is a folder of files.
    """
    manifest = {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION if size is None else SHARDED_VERSION,
        "name": None,
        "settings": None,
        "seed": None,
        "episodes": 0,
        "controller": None,
        **{key: first[key] for key in _EQUAL_KEYS},
        "complete": True,
        "counts": {},
        "split": None,
        "sources": sources,
        **({"files": rows} if size is None else {}),
        "software": software_versions(),
        **({} if size is None else {"shard_size": size, "shards": rows}),
    }
    merged = with_rows(manifest, work)
    counts = counts_of(merged["files"], (*COUNTED, "contributor"))
    merged["counts"] = {key: count for key, count in counts.items() if count or key != "contributor"}
    merged["episodes"] = len(merged["files"])
    return merged
