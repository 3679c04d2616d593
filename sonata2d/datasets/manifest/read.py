"""The manifest of a data set, and the folder of episode files that it lists."""

from __future__ import annotations

import hashlib
import os
import shutil
import warnings
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

import orjson

from ...core.files.locations import file_names, is_remote
from ...core.files.whole_file import TEMPORARY_PREFIX
from ...core.geometry import PRECISION
from ...core.snapshot import ControllerInfo, Status
from ...core.wording import shown
from ...errors import DatasetWarning, NewerFormatError, RecordError
from ...record.canonical import parse_header, to_json_value
from ...record.files import SUFFIXES, compress, file_exists, file_stem, read_bytes, read_stored, write_atomically
from ...record.layout import JsonDict, software_versions
from ...record.reader import read_episode
from ...record.record import EpisodeRecord
from ...record.recorder import EpisodeRecorder
from ...record.shard_file import (
    SHARD_MANIFEST_SUFFIX,
    SHARD_SUFFIX,
    is_member,
    is_shard,
    members_of,
    shard_manifest_path,
)
from ...version import PHYSICS_VERSION
from .models import Manifest, ManifestFile, Shard, ShardedManifest
from .rows import ShardPaths, ShardRows, stored_form, with_rows

DATASET_FORMAT, DATASET_VERSION, SHARDED_VERSION = "sonata2d-dataset", 1, 2
MANIFEST, SCENARIO, CARD = "manifest.json", "scenario.json", "README.md"
LOCK = f"{TEMPORARY_PREFIX}lock"  # held while a data set is generated
CROISSANT, FIGURES = "croissant.json", "card.png"  # written by `sonata2d card`
PREVIEW = "preview.png"  # drawn by `sonata2d generate`
LOG = "run.jsonl"  # of generation runs
FAILED = "failed"  # subfolder for the frames of episodes that ended in an error
METRICS = "metrics.json"  # written by `sonata2d evaluate`
_NOT_EPISODES = (SCENARIO, METRICS, CROISSANT, "evaluation.json")  # JSON beside episodes without a manifest


_BLOCK = 1000  # rows of a manifest that are validated at a time
_FIRST = 10  # files of a manifest of which one must exist
_valid: set[bytes] = set()  # hashes of the manifests that this process has validated


@dataclass(frozen=True, slots=True)
class DatasetSpec:
    """Specification of a generated data set: everything that determines its bytes.

    Attributes:
        name: name of the scenario.
        settings: resolved settings of the scenario.
        seed: seed of the data set.
        episodes: number of episodes; with `keep`, number of kept episodes.
        controller_info: the controller as recorded in files.
        suffix: file suffix: `.json`, `.json.gz` or `.json.zst`.
        keep: outcomes that are kept; empty: all.
        controller_sha256: hashes of the controller's source, see `agents.controllers.loading.source_hashes`.
        shard_size: number of episode numbers that each shard covers; None: the data set is a folder of files.
    """

    name: str
    settings: dict[str, Any] | None
    seed: int
    episodes: int
    controller_info: ControllerInfo
    suffix: str = ".json"
    keep: tuple[Status, ...] = ()
    controller_sha256: Mapping[str, str] = field(default_factory=dict)
    shard_size: int | None = None

    def file_name(self, episode: int) -> str:
        """`{episode:06d}` and the suffix."""
        return f"{episode:06d}{self.suffix}"


@dataclass(frozen=True, slots=True)
class ManifestEntry:
    """The row of the manifest for one file; `contacts` and `commands_beyond_limits` are None if they are unknown."""

    name: str
    sha256: str
    bytes: int
    episode: int
    family: str
    outcome: Status
    ticks: int
    contacts: dict[str, dict[str, int]] | None = None
    commands_beyond_limits: dict[str, dict[str, float]] | None = None
    offset: int | None = None

    def row(self) -> JsonDict:
        """The row as JSON, without the keys whose values are unknown."""
        return {key: value for key, value in asdict(self).items() if value is not None}


def files_of(path: Path) -> Sequence[Path]:
    """Episode files at a path: the file itself, the files listed in its manifest, or else the JSON files of the folder.

    Files in shards are paths such as `demo/shard-000000.tar/000007.json`.

    Raises:
        RecordError: the path does not exist or holds no episode, or its manifest is damaged.

    Warns:
        DatasetWarning: the data set is interrupted.
    """
    if has_manifest(path):
        return files_in_manifest(path, read_manifest(path))
    if is_shard(path):
        return [path / name for name in members_of(path) if name.endswith(SUFFIXES)]
    if path.is_file() or is_member(path):
        return [path]
    names = [name for name in sorted(file_names(path)) if not name.endswith(SHARD_MANIFEST_SUFFIX)]
    files = [path / name for name in names if name.endswith(SUFFIXES) and name not in _NOT_EPISODES]
    if not files:
        if any(name.endswith(SHARD_SUFFIX) for name in names):
            raise RecordError(f"{path} holds shards, but no {MANIFEST}; name one of the shards")
        if path.is_dir():
            raise RecordError(f"{path} holds no episode files")
        raise RecordError(f"{path} is neither a file nor a folder" if path.exists() else f"{path} does not exist")
    return files


def files_in_manifest(folder: Path, manifest: JsonDict) -> Sequence[Path]:
    """The episode files that a manifest lists.

    Raises:
        RecordError: there are many, and the first ones are missing.

    Warns:
        DatasetWarning: the data set is interrupted.
    """
    rows = manifest["files"]
    if rows:  # without any, the caller says more
        warn_if_incomplete(folder, manifest)
    if isinstance(rows, ShardRows):
        return ShardPaths(rows)
    first = [row["name"] for row in rows[:_FIRST]]
    if len(rows) > _FIRST and not any(file_exists(folder / name) for name in first):
        raise RecordError(f"{folder}: {MANIFEST} lists {len(rows)} files, but {first[0]} to {first[-1]} are missing")
    return [folder / row["name"] for row in rows]


def manifest_path(folder: Path) -> Path:
    """Where the manifest of a data set, or of a shard, is stored."""
    return shard_manifest_path(folder) if is_shard(folder) else folder / MANIFEST


def has_manifest(folder: Path) -> bool:
    """Whether a path is that of a data set, or of a shard with its manifest."""
    return manifest_path(folder).exists()


def read_manifest(folder: Path) -> JsonDict:
    """The manifest of a data set; `collected` is always present.

    Raises:
        RecordError: the folder has no manifest, or the manifest is damaged or was written by a newer version.
    """
    return {"collected": False} | read_stored_manifest(folder)


def read_stored_manifest(folder: Path) -> JsonDict:
    """The manifest exactly as stored, so that a rewritten manifest differs only in the changed keys.

    Raises:
        RecordError: as `read_manifest`.
    """
    path = manifest_path(folder)
    if not path.exists():
        raise RecordError(f"{folder} is not a data set: it has no {path.name}; name one of its episode files")
    content = read_bytes(path)
    try:
        manifest = orjson.loads(content)
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not valid JSON: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != DATASET_FORMAT:
        raise RecordError(f"{path} is not a {DATASET_FORMAT} manifest")
    version = manifest.get("version")
    if not isinstance(version, int) or not 1 <= version <= SHARDED_VERSION:
        raise RecordError(
            f"{path} was written by version {shown(version)}, this sonata2d reads up to {SHARDED_VERSION};"
            " upgrade sonata2d"
        )
    digest = hashlib.blake2b(content, digest_size=16).digest()
    if digest not in _valid:  # the manifests of shards are read again and again
        fault = _first_fault(manifest)
        if fault is not None:
            raise RecordError(f"{path} is not a valid manifest: {fault}")
        _valid.add(digest)
    return with_rows(manifest, folder, read_stored_manifest) if version == SHARDED_VERSION else manifest


def _first_fault(manifest: JsonDict) -> str | None:
    """Where and how a manifest breaks the schema; None if it does not.

    Rows are validated in blocks: the objects that pydantic makes of a million rows take gigabytes.
    """
    from pydantic import TypeAdapter, ValidationError

    rows: Any = manifest.get("files")
    start = 0
    is_long = isinstance(rows, list) and len(rows) > _BLOCK
    try:
        model = ShardedManifest if manifest["version"] == SHARDED_VERSION else Manifest
        model.model_validate_json(orjson.dumps(manifest | {"files": []} if is_long else manifest))
        adapter = TypeAdapter(list[ManifestFile])
        for start in range(0, len(rows), _BLOCK) if is_long else ():
            adapter.validate_json(orjson.dumps(rows[start : start + _BLOCK]))
    except orjson.JSONEncodeError:
        return "its values are nested too deeply"
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        keys = first["loc"]
        if isinstance(keys[0], int):  # of a row in a block
            keys = "files", start + keys[0], *keys[1:]
        return f"{'.'.join(map(str, keys)):.200}: {first['msg']:.200}"
    return None


def read_listed_file(folder: Path, entry: JsonDict) -> bytes:
    """The stored bytes of a file of a data set.

    Args:
        folder: folder of the data set.
        entry: manifest row of the file.

    Raises:
        RecordError: the file cannot be read, or its hash differs from the manifest.
    """
    path = folder / entry["name"]
    data = read_stored(path)
    if _sha256(data) != entry["sha256"]:
        raise RecordError(f"{path} was changed: its hash differs from the manifest; run `sonata2d check`")
    return data


def write_json(path: Path, document: JsonDict) -> None:
    """Write a document as indented JSON, in one atomic step.

    Raises:
        RecordError: the file cannot be written, or JSON cannot represent a value.
    """
    try:
        data = json_bytes(document)
    except orjson.JSONEncodeError as error:
        raise RecordError(f"{path} cannot be written: JSON cannot represent a value: {error}") from error
    write_atomically(path, data)


def json_bytes(document: JsonDict) -> bytes:
    """A document as `write_json` writes it."""
    return orjson.dumps(stored_form(document), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def manifest_entry(record: EpisodeRecord) -> ManifestEntry:
    """The manifest row of an episode file that was read."""
    data, status = read_stored(record.path), record.outcome.status
    return ManifestEntry(
        record.path.name,
        _sha256(data),
        len(data),
        record.episode,
        record.family,
        status,
        len(record),
        **record.counts(),
    )


def manifest_of(
    spec: DatasetSpec,
    entries: Iterable[ManifestEntry],
    *,
    complete: bool,
    left_out: Mapping[str, int] | None = None,
    split: Mapping[str, list[str]] | None = None,
    shard: JsonDict | None = None,
) -> JsonDict:
    """The manifest of a generated data set, or of a shard of one.

    Args:
        spec: specification of the data set.
        entries: its files, in order of episode number.
        complete: whether all requested episodes are present.
        left_out: number of episodes not kept before the last listed one, by outcome; only with `keep`.
        split: file names by part.
        shard: of a shard, see `ShardContent`.
    """
    rows = [entry.row() for entry in entries]
    exclusions = {"left_out": dict(sorted((left_out or {}).items()))} if spec.keep else {}
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        **identity_of(spec),
        **({"controller_sha256": dict(spec.controller_sha256)} if spec.controller_sha256 else {}),
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": complete,
        "counts": {key: dict(sorted(Counter(row[key] for row in rows).items())) for key in ("outcome", "family")},
        **exclusions,
        **({} if shard is None else {"shard": shard}),
        "split": None if split is None else dict(split),
        "files": rows,
        "software": software_versions(),
    }


def sharded_manifest_of(
    folder: Path, spec: DatasetSpec, shards: Sequence[JsonDict], *, complete: bool, split: JsonDict | None = None
) -> JsonDict:
    """The manifest of a generated data set in shards.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        shards: results by shard, with the keys of its row, `counts`, and with `keep` also `left_out`.
        complete: whether all requested episodes are present.
        split: number of episodes by part.
    """
    counts = {key: Counter[str]() for key in ("outcome", "family")}
    left_out = Counter[str]()
    for shard in shards:
        for key, counter in counts.items():
            counter.update(shard["counts"][key])
        left_out.update(shard.get("left_out", {}))
    manifest = manifest_of(spec, (), complete=complete, left_out=left_out)
    software = manifest.pop("software")
    del manifest["files"]
    manifest |= {
        "version": SHARDED_VERSION,
        "counts": {key: dict(sorted(counter.items())) for key, counter in counts.items()},
        "shard_size": spec.shard_size,
        "split": split,
        "shards": [{key: shard[key] for key in Shard.model_fields} for shard in shards],
        "software": software,
    }
    return with_rows(manifest, folder, read_stored_manifest)


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A temporary folder that is renamed to `out` on success and removed on an error.

    Raises:
        RecordError: `out` exists and is not an empty folder, or it cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RecordError(f"{out} already exists and is not empty; choose another name")
    if is_remote(out):  # objects cannot be renamed together: the manifest, which is written last, makes the data set
        try:
            yield out
        except BaseException:
            with suppress(OSError):
                for name in file_names(out):
                    (out / name).unlink(missing_ok=True)
            raise
        return
    work = out.parent / f"{TEMPORARY_PREFIX}{uuid4().hex}"
    try:
        work.mkdir(parents=True)
        yield work
        if out.exists():
            out.rmdir()
        os.replace(work, out)
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def remove_partial_files(folder: Path) -> None:
    """Remove what a killed run left of files that it was writing."""
    for name in file_names(folder):
        if name.startswith(TEMPORARY_PREFIX) and name != LOCK:
            (folder / name).unlink(missing_ok=True)


def warn_if_incomplete(folder: Path, manifest: JsonDict) -> None:
    """Warn of episodes that an interrupted data set does not have yet.

    Warns:
        DatasetWarning: there are such.
    """
    if not manifest["complete"]:
        message = (
            f"{folder} is interrupted: it has {len(manifest['files'])} of {manifest['episodes']} episodes; complete it "
            "with generate --resume"
        )
        warnings.warn(message, DatasetWarning, stacklevel=3)


def store_episode(folder: Path, spec: DatasetSpec, episode: int, recorder: EpisodeRecorder) -> ManifestEntry:
    """Write a recorded episode to its file and return the manifest row."""
    entry, data = packed_episode(spec, episode, recorder)
    write_atomically(folder / entry.name, data)
    return entry


def packed_episode(spec: DatasetSpec, episode: int, recorder: EpisodeRecorder) -> tuple[ManifestEntry, bytes]:
    """The manifest row and the stored bytes of a recorded episode."""
    document = recorder.document()
    name, header = spec.file_name(episode), parse_header(document)
    data, outcome = compress(document, Path(name)), header["outcome"]
    entry = ManifestEntry(
        name,
        _sha256(data),
        len(data),
        header["episode"],
        header["family"],
        outcome["status"],
        outcome["tick"],
        **recorder.counts(),
    )
    return entry, data


def existing_episodes(
    folder: Path, spec: DatasetSpec, listed: Mapping[str, str], *, known: Container[int] = ()
) -> tuple[dict[int, ManifestEntry], list[str]]:
    """Usable episodes of a specification that a folder already holds, and why other files are not usable.

    Args:
        folder: folder of the data set.
        spec: specification of the data set.
        listed: SHA-256 by file name, from `start_dataset`; a file with another hash counts as changed.
        known: numbers of episodes to leave out.

    Returns:
        Manifest rows by episode number, and one message for each unusable file.

    Raises:
        NewerFormatError: a file was written by a newer version.
    """
    entries, faults = {}, []
    for episode in episode_numbers(folder, spec):
        if episode in known:
            continue
        path = folder / spec.file_name(episode)
        try:
            record = read_episode(path)
            require_episode_of(record, spec, episode)
            entry = manifest_entry(record)
            if listed.get(path.name, entry.sha256) != entry.sha256:
                raise RecordError(f"{path} was changed since it was generated")
            entries[episode] = entry
        except NewerFormatError:
            raise  # never overwrite a file of a newer version
        except RecordError as error:
            faults.append(str(error))
    return entries, faults


def episode_numbers(folder: Path, spec: DatasetSpec) -> list[int]:
    """Episode numbers in the file names of a folder; without `keep` only those that the specification requests."""
    names = file_names(folder)
    stems = (name.removesuffix(spec.suffix) for name in names if name.endswith(spec.suffix))
    numbers = sorted(int(stem) for stem in stems if stem.isdecimal() and stem.isascii())
    known = set(names)
    return [k for k in numbers if (spec.keep or k < spec.episodes) and spec.file_name(k) in known]


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def identity_of(spec: DatasetSpec) -> JsonDict:
    """The manifest keys that a specification determines."""
    info = spec.controller_info
    identity = {
        "name": spec.name,
        "settings": spec.settings,
        "seed": spec.seed,
        "episodes": spec.episodes,
        **({"keep": spec.keep} if spec.keep else {}),
        "controller": {"path": info.path, "version": info.version, "settings": info.settings},
    }
    return {key: to_json_value(value, f"{key} of the data set", exact=True) for key, value in identity.items()}


def require_episode_of(record: EpisodeRecord, spec: DatasetSpec, episode: int) -> None:
    """Raise RecordError unless the specification produces this episode and it ran to its end."""
    expected = {**identity_of(spec), "episode": episode, "physics": PHYSICS_VERSION, "id": file_stem(record.path)}
    for key, value in expected.items():
        if key not in ("episodes", "keep") and record.document[key] != value:
            raise RecordError(f"{record.path} belongs to another data set: its {key} differs")
    status = record.outcome.status
    if status == "error":
        raise RecordError(f"{record.path} ended in an error: {record.outcome.reason}")
    if spec.keep and status not in spec.keep:
        raise RecordError(f"{record.path} ended in {status}, but only {', '.join(spec.keep)} is kept")
