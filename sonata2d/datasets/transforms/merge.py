"""Merges data sets: the manifest keeps the settings and seed of each source, and every file keeps its bytes."""

from __future__ import annotations

import hashlib
import os
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ...core.files.locations import is_remote, location
from ...core.notebook import Advance
from ...errors import RecordError
from ...record.files import read_bytes, safe_text, write_atomically
from ...record.layout import JsonDict, software_versions
from ..card.write import licence_of, write_manifest_and_card
from ..generate.shard_output import write_shard
from ..manifest.read import (
    DATASET_FORMAT,
    DATASET_VERSION,
    SHARDED_VERSION,
    new_folder,
    read_listed_file,
    read_stored_manifest,
)
from ..manifest.rows import ShardRows, shard_name, with_rows

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

    Names of files, or of shards, get the name of their source folder as a prefix. If one of the data sets is in shards,
    the new one is, too: shards are copied, and files are put into new ones. The manifest's `sources` hold the origin of
    each data set. Splits are not copied, because a scene may be in several sources; split the merged data set again.
    The licence is that of the data sets, or `other` where they differ.

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
    prefixes = _prefixes(paths)
    sizes = [manifest["shard_size"] for manifest in manifests if "shards" in manifest]
    with new_folder(location(out)) as work:
        if sizes:
            copies = [
                _copied_shards(path, prefix, manifest, work, max(sizes), advance)
                for path, prefix, manifest in zip(paths, prefixes, manifests, strict=True)
            ]
        else:
            copies = [
                _copied_files(path, prefix, manifest, work, advance)
                for path, prefix, manifest in zip(paths, prefixes, manifests, strict=True)
            ]
        sources = [
            source
            for prefix, manifest, rows in zip(prefixes, manifests, copies, strict=True)
            for source in _sources(prefix, manifest, rows if sizes else None)
        ]
        rows = [row for own in copies for row in own]
        merged = _merged_manifest(manifests[0], ShardRows(work, rows, read_stored_manifest) if sizes else rows, sources)
        if sizes:
            merged |= {"version": SHARDED_VERSION, "shard_size": max(sizes), "shards": rows}
            merged = with_rows(merged, work, read_stored_manifest)
        licences = {licence_of(path) for path in paths}
        write_manifest_and_card(work, merged, licence=licences.pop() if len(licences) == 1 else "other")
    return read_stored_manifest(location(out))


def _copied_files(path: Path, prefix: str, manifest: JsonDict, work: Path, advance: Advance) -> list[JsonDict]:
    """Copy the files of a data set into a folder, and return their rows."""
    rows = []
    for row in manifest["files"]:
        name = f"{prefix}__{row['name']}"
        write_atomically(work / name, read_listed_file(path, row))
        rows.append(row | {"name": name})
        advance(1)
    return rows


def _copied_shards(
    path: Path, prefix: str, manifest: JsonDict, work: Path, size: int, advance: Advance
) -> list[JsonDict]:
    """Copy the shards of a data set into a folder, or its files into new shards, and return the rows of the shards.

    Args:
        path: of the data set.
        prefix: of the names of the shards.
        manifest: of the data set.
        work: the folder.
        size: number of files in a new shard.
        advance: progress callback.
    """
    contents: Iterable[tuple[str, JsonDict]]
    if is_sharded := "shards" in manifest:
        contents = ((shard["name"], manifest["files"].manifest_of(shard)) for shard in manifest["shards"])
    else:
        contents = _blocks(manifest, size)
    shards = []
    for name, own in contents:
        parent = path / name if is_sharded else path
        members = ((row, read_listed_file(parent, row)) for row in own["files"])
        shards.append(write_shard(work / f"{prefix}__{name}", own | {"split": None}, members))
        advance(shards[-1]["episodes"])
    return shards


def _blocks(manifest: JsonDict, size: int) -> Iterator[tuple[str, JsonDict]]:
    """Names and manifests of the shards into which the files of a data set are put, those of each source apart."""
    rows = {row["name"]: row for row in manifest["files"]}
    for source in manifest.get("sources") or [{"files": list(rows)}]:
        names = source["files"]
        for first in range(0, len(names), size):
            own = [rows[name] for name in names[first : first + size]]
            part = {key: value for key, value in manifest.items() if key not in ("left_out", "sources", "mirrored")}
            if manifest.get("sources"):
                part |= {key: source[key] for key in _SOURCE_KEYS if key in source} | {"name": source["scenario"]}
                part.pop("left_out", None)
            if (source if manifest.get("sources") else manifest).get("mirrored"):
                part["mirrored"] = True
            if part.get("keep"):
                part["left_out"] = {}
            part["counts"] = {
                key: dict(sorted(Counter(row[key] for row in own).items())) for key in ("outcome", "family")
            }
            name = shard_name(first // size)
            if "name" in source:
                name = f"{source['name']}__{name}"
            yield (
                name,
                part
                | {
                    "episodes": len(own),
                    "collected": bool(manifest.get("collected")),
                    "files": own,
                    "shard": {"first": own[0]["episode"], "stop": own[-1]["episode"] + 1}
                    if part.get("keep")
                    else {"first": first, "stop": first + len(own)},
                },
            )


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
        name = path.name if is_remote(path) else os.path.basename(os.path.abspath(path))  # `..` gets that of its folder
        stem, number = safe_text(name), 1
        while (prefix := f"{stem}-{number}" if number > 1 else stem) in prefixes:
            number += 1
        prefixes.append(prefix)
    return prefixes


def _sources(prefix: str, manifest: JsonDict, shards: Sequence[JsonDict] | None) -> list[JsonDict]:
    """The entries in `sources` for a data set; a merged data set passes on its own sources.

    Args:
        prefix: of the names of its files or shards.
        manifest: of the data set.
        shards: rows of its shards in the merged data set; None: it has files.
    """
    if manifest.get("sources"):
        return [
            source
            | {"name": f"{prefix}__{source['name']}"}
            | (
                {"files": [f"{prefix}__{file}" for file in source["files"]]}
                if shards is None
                else {"shards": [shard["name"] for shard in shards if _is_of(shard["name"], prefix, source)]}
            )
            for source in manifest["sources"]
        ]
    source: JsonDict = {"name": prefix} | ({"mirrored": True} if manifest.get("mirrored") else {})
    source |= {"scenario": manifest["name"], **{key: manifest[key] for key in _SOURCE_KEYS if key in manifest}}
    if shards is not None:
        return [source | {"shards": [shard["name"] for shard in shards]}]
    return [source | {"files": [f"{prefix}__{row['name']}" for row in manifest["files"]]}]


def _is_of(shard: str, prefix: str, source: JsonDict) -> bool:
    """Whether a copied shard holds episodes of a source of the data set that it is copied from."""
    name = shard.removeprefix(f"{prefix}__")
    return name in source["shards"] if source.get("shards") else name.startswith(f"{source['name']}__")


def _merged_manifest(first: JsonDict, rows: Sequence[JsonDict], sources: list[JsonDict]) -> JsonDict:
    counted = {"outcome": Counter[str](), "family": Counter[str](), "contributor": Counter[str]()}
    for row in rows:
        for key, counter in counted.items():
            if row.get(key) is not None:
                counter[row[key]] += 1
    counts = {key: dict(sorted(counter.items())) for key, counter in counted.items() if counter or key != "contributor"}
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
        "counts": counts,
        "split": None,
        "sources": sources,
        "files": rows,
        "software": software_versions(),
    }
