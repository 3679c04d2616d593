"""Checks manifests of data sets and of shards: consistency, and agreement with the files that they list.

A folder of files is treated as a shard that is not packed: the same checks compare the list of its episodes with its
counts, its split and the numbers that it covers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import orjson

from ...errors import RecordError
from ...record.files import file_stem, read_bytes, sha256_of
from ...record.layout import JsonDict
from ...record.shard_file import contents_of, is_shard, shard_manifest_path
from ..manifest.models import Manifest, ManifestFile, Shard, ShardedManifest, Source
from ..manifest.names import MANIFEST
from ..manifest.rows import Lazy, ShardRows, read_manifest, read_shard, stored_form
from ..manifest.write import counts_of, sum_of
from .episodes import ListedFile, Problem, repeated, repeated_keys
from .folders import folder_problems, unknown_files
from .plausibility import Finding

if TYPE_CHECKING:
    from pydantic import BaseModel

# keys that the manifest of a shard repeats
_SHARED_BY_SHARDS = ("name", "settings", "seed", "keep", "controller", "precision", "physics", "mirrored", "collected")


def check_manifest(folder: Path, manifest: JsonDict) -> list[Problem]:
    """Problems of a manifest, of the set of files in the folder, and of the files that repeat its content."""
    if is_shard(folder):
        return check_shard(ListedFile(folder))
    findings = _shard_findings(folder, manifest) if "shards" in manifest else _content_findings(manifest)
    return [
        *_problems_of(folder / MANIFEST, manifest, [*findings, *unknown_files(folder, manifest)]),
        *folder_problems(folder, manifest),
    ]


def check_shard(shard: ListedFile) -> list[Problem]:
    """Problems of a shard as a file, and of the manifest beside it; its episodes are not read.

    Args:
        shard: its row may be empty, if only the shard is checked and not its data set.
    """
    path, beside = shard.path, shard_manifest_path(shard.path)
    if not path.is_file():
        return [Problem(MANIFEST, "shards", f"{path.name} is listed but not in the folder")]
    try:
        manifest = read_manifest(path)
    except RecordError as error:
        return [Problem(beside.name, "file", str(error))]
    rows, content = manifest["files"], manifest.get("shard") or {}
    actual = {"sha256": sha256_of(path), "bytes": path.stat().st_size}
    counted = {"episodes": len(rows), "ticks": sum(row["ticks"] for row in rows)}
    problems = [
        Problem(path.name, key, f"is {value}, {MANIFEST} says {shard.entry[key]}")
        for key, value in (actual | counted).items()
        if shard.entry.get(key, value) != value
    ]
    problems += [
        Problem(beside.name, f"shard.{key}", f"is {content.get(key)}, but {path.name} has {value}")
        for key, value in actual.items()
        if content.get(key) != value
    ]
    problems += [
        Problem(beside.name, key, f"differs from {MANIFEST}")
        for key, value in shard.shared.items()
        if manifest.get(key) != value
    ]
    unlisted = sorted(set(contents_of(path)[0]) - {row["name"] for row in rows})
    findings = [("files", f"{name} is in the shard but not listed") for name in unlisted]
    return problems + check_tar(path) + _problems_of(beside, manifest, [*_content_findings(manifest), *findings])


def check_tar(path: Path) -> list[Problem]:
    """Faults of a tar file, see `contents_of`; none of another path."""
    return [Problem(path.name, "tar", fault) for fault in contents_of(path)[1]] if is_shard(path) else []


def _problems_of(path: Path, manifest: JsonDict, findings: Sequence[Finding]) -> list[Problem]:
    """The findings in a manifest, its repeated keys, and its unknown keys as warnings."""
    unknown = [Problem(path.name, *finding, is_warning=True) for finding in _unknown_keys(manifest)]
    content = read_bytes(path)
    repeated_ones = repeated_keys(path, content, orjson.loads(content))
    return [*repeated_ones, *(Problem(path.name, *finding) for finding in findings), *unknown]


def listed_shards(folder: Path, manifest: JsonDict) -> list[ListedFile]:
    """The shards that the manifest of a folder lists; none of a data set without shards."""
    shared = {key: manifest[key] for key in _SHARED_BY_SHARDS if key in manifest}
    shared = {} if manifest.get("sources") else shared  # whose shards are of several data sets
    return [ListedFile(folder / row["name"], row, shared) for row in manifest.get("shards", ())]


def files_in(folder: Path, manifest: JsonDict) -> Sequence[ListedFile]:
    """The files that a manifest lists; members of shards are read from the manifests of the shards when needed."""
    rows, shared_by = manifest["files"], _shared_values(manifest)

    def listed(row: JsonDict) -> ListedFile:
        name = row["name"]
        # by the name of the file, or of its shard; in a data set that is not merged, all files share the values
        shared = shared_by.get(name) or shared_by.get(name.partition("/")[0]) or shared_by.get("")
        if shared:  # a generated episode: its id is the name of the file, after the prefix that merging adds
            stem = file_stem(Path(name))
            shared = shared | {"id": stem if "" in shared_by else stem.rpartition("__")[2]}
        return ListedFile(folder / name, row, shared or {})

    def every() -> Iterator[ListedFile]:
        if not isinstance(rows, ShardRows):
            yield from map(listed, rows)
            return
        for shard in rows.shards:
            with suppress(RecordError):  # of its manifest, which `check_shard` reports
                yield from map(listed, rows.of_shard(shard))

    return Lazy(len(rows), lambda number: listed(rows[number]), every)


def _shared_values(manifest: JsonDict) -> dict[str, JsonDict]:
    """The document values that all files of a source share, by name of the file or shard; by "" without sources."""
    sources = manifest.get("sources") or [manifest | {"scenario": manifest["name"], "files": [""], "shards": None}]
    values: dict[str, JsonDict] = {}
    for source in sources:
        if source["scenario"] is None:
            continue  # collected runs may differ in all values, and have ids of their own
        shared = {key: manifest[key] for key in ("precision", "physics")} | {"name": source["scenario"]}
        shared |= {key: source[key] for key in ("settings", "seed", "controller")}
        values |= dict.fromkeys(source.get("shards") or source["files"], shared)
    return values


def _content_findings(manifest: JsonDict) -> Iterator[Finding]:
    """Contradictions within a manifest that lists episodes: of a folder of files, or of a shard."""
    rows = manifest["files"]
    names = [row["name"] for row in rows]
    yield from _number_findings(manifest, [row["episode"] for row in rows])
    for row in rows if manifest.get("keep") else ():
        if row["outcome"] not in manifest["keep"]:
            yield "keep", f"{row['name']} ended in {row['outcome']}, but only {', '.join(manifest['keep'])} is kept"
    for key, counted in counts_of(rows, manifest["counts"]).items():
        if manifest["counts"][key] != counted:
            yield f"counts.{key}", f"is {manifest['counts'][key]}, but the listed files give {counted}"
    for name in repeated(names):
        yield "files", f"lists {name} more than once"
    sources = manifest.get("sources")
    if sources and sorted(names) != sorted(name for source in sources for name in source["files"]):
        yield "sources", "must list each file once"
    if manifest["split"] is None:
        return
    parts = [name for part in manifest["split"].values() for name in part]
    for name in [*repeated(parts), *sorted(set(parts) - set(names))]:
        yield "split", f"{name} is in two parts, or is not a listed file"
    if omitted := sorted(set(names) - set(parts)):
        yield "split", f"{omitted[0]} is in no part ({len(omitted)} files in all); split the data set again"


def _number_findings(manifest: JsonDict, numbers: list[int]) -> Iterator[Finding]:
    """Contradictions between the listed episodes and the numbers that the manifest covers.

    Args:
        manifest: of a folder of files, or of a shard.
        numbers: of the listed episodes.
    """
    requested, keep, shard = manifest["episodes"], manifest.get("keep"), manifest.get("shard")
    if not manifest["complete"]:
        # an interrupted run may have finished any of the episodes
        yield "complete", f"{len(numbers)} of {requested} episodes exist; generate the others with --resume"
        return
    if manifest["collected"] or manifest.get("sources"):
        return  # any number may occur, also several times
    # a folder covers the requested episodes; with `keep`, the episodes up to the last listed one
    first, stop = (shard["first"], shard["stop"]) if shard else (0, max(numbers, default=-1) + 1 if keep else requested)
    if len(numbers) != requested and (keep or shard):
        yield "files" if keep else "episodes", f"must list {requested} episodes, lists {len(numbers)}"
    is_ordered = numbers == sorted(set(numbers)) and all(first <= number < stop for number in numbers)
    missing = stop - first - len(numbers)
    if not is_ordered or (missing and not keep):
        yield "files", f"must list the episodes {first} to {stop - 1} in order"
    # the shards into which files were merged do not say which episodes were left out
    elif keep and (not shard or "left_out" in shard):
        left_out = manifest.get("left_out") or {}
        run = sorted([*numbers, *(number for number, _ in (shard or {}).get("left_out") or ())])
        lacks_some = shard is not None and run != list(range(first, first + len(numbers) + missing))
        if missing != sum(left_out.values()) or set(left_out) & set(keep) or lacks_some:
            yield "left_out", f"is {left_out}, but {missing} episode numbers are not listed"


def _shard_findings(folder: Path, manifest: JsonDict) -> Iterator[Finding]:
    """Contradictions between the manifest of a data set in shards and the manifests of the shards."""
    rows, count = manifest["shards"], len(manifest["files"])
    is_generated = not (manifest["collected"] or manifest.get("sources"))
    following: int | None = 0  # number of the first episode of the next shard; None: unknown
    totals: dict[str, list[JsonDict]] = {}  # by place in the manifest, of each shard
    for name in repeated(row["name"] for row in rows):
        yield "shards", f"lists {name} more than once"
    for row in rows:
        try:
            shard = read_shard(folder, row)
        except RecordError as error:
            yield "shards", str(error)
            following = None
            continue
        sizes = {part: len(names) for part, names in (shard["split"] or {}).items()}
        counts = {f"counts.{key}": shard["counts"].get(key) or {} for key in manifest["counts"]}
        for key, value in {**counts, "left_out": shard.get("left_out") or {}, "split": sizes}.items():
            totals.setdefault(key, []).append(value)
        content = shard.get("shard") or {}
        # the shards of other data sets may cover any numbers, and an interrupted run may have finished any shard
        if is_generated and manifest["complete"] and following not in (None, content.get("first")):
            yield "shards", f"{row['name']} begins with episode {content.get('first')}, and not {following}"
        following = content.get("stop")
    if not manifest["complete"]:
        yield "complete", f"{count} of {manifest['episodes']} episodes exist; generate the others with --resume"
    elif count != manifest["episodes"]:
        yield "shards", f"have {count} episodes, and not {manifest['episodes']}"
    if any(len(values) < len(rows) for values in totals.values()):
        return  # a shard cannot be read, so the sums over the others say nothing
    split = {part: len(names) for part, names in (manifest["split"] or {}).items()}
    stated = {f"counts.{key}": value for key, value in manifest["counts"].items()} | {"split": split}
    if manifest.get("keep"):  # a merged data set states the episodes that are left out for each source
        stated["left_out"] = manifest.get("left_out") or {}
    for key, value in stated.items():
        total = sum_of(totals.get(key, ()))
        # the sums agree also if both leave out a shard, which then is in no part
        if value != total or (key == "split" and split and sum(split.values()) != count):
            remedy = "; split the data set again" if key == "split" else ""
            yield key, f"is {value or 'none'}, but the shards give {total or 'none'}{remedy}"


def _unknown_keys(manifest: JsonDict) -> Iterator[Finding]:
    """Keys of a manifest that this version does not know: of a newer version, or misspelt."""
    rows: tuple[tuple[str, type[BaseModel], list[JsonDict]], ...] = (
        ("", ShardedManifest if "shards" in manifest else Manifest, [stored_form(manifest)]),
        ("shards", Shard, manifest.get("shards") or []),
        ("files", ManifestFile, [] if "shards" in manifest else manifest["files"]),
        ("sources", Source, manifest.get("sources") or []),
    )
    for place, model, documents in rows:
        unknown = {key for document in documents for key in document} - set(model.model_fields)
        for key in sorted(unknown):
            yield f"{place}.{key}".lstrip("."), "is unknown to this version of sonata2d, and ignored"
