"""The manifest of a data set, and the folder of episode files that it lists."""

from __future__ import annotations

import hashlib
import os
import re
import reprlib
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal
from uuid import uuid4

import orjson
from pydantic import AfterValidator, Field

from ..core.geometry import PRECISION
from ..core.snapshot import ControllerInfo, Status
from ..core.whole_file import TEMPORARY_PREFIX
from ..errors import NewerFormatError, RecordError
from ..record.canonical import parse_header, to_json_value
from ..record.files import SUFFIXES, compress, file_stem, file_suffix, read_bytes, read_stored, write_atomically
from ..record.layout import JsonDict, software_versions
from ..record.models import Controller, Count, Part, Positive, Settings, Software
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..record.recorder import EpisodeRecorder
from ..version import PHYSICS_VERSION

DATASET_FORMAT, DATASET_VERSION = "sonata2d-dataset", 1
MANIFEST, SCENARIO, CARD = "manifest.json", "scenario.json", "README.md"
CROISSANT, FIGURES = "croissant.json", "card.png"  # written by `sonata2d card`
PREVIEW = "preview.png"  # drawn by `sonata2d generate`
LOG = "run.jsonl"  # of generation runs
FAILED = "failed"  # subfolder for the frames of episodes that ended in an error
METRICS = "metrics.json"  # written by `sonata2d evaluate`
_NOT_EPISODES = (METRICS, CROISSANT, "evaluation.json")  # JSON files that may lie beside episodes without a manifest


_EPISODE_NAME = re.compile(r"[0-9]{6,}\.json(\.gz|\.zst)?")
_BLOCK = 1000  # rows of a manifest that are validated at a time
_FIRST = 10  # files of a manifest of which one must exist
_MAXIMUM_DIFFERENCES = 5  # named in a message
_short = reprlib.Repr()
_short.maxstring = _short.maxother = 100


def is_file_name(name: str) -> bool:
    """Whether a name is that of a file in a folder, and does not lead out of it."""
    return name not in ("", ".", "..") and not any(letter in name for letter in "/\\\0")


def _in_folder(name: str) -> str:
    """Require the name of a file in the folder of the data set: a manifest must not lead out of it."""
    if not is_file_name(name):
        raise ValueError(f"{name!r} is not a file name")
    return name


FileName = Annotated[str, AfterValidator(_in_folder)]


_CODE_DESCRIPTION = (
    "SHA-256 of the source file that defines the controller, by its name; of driver+labeller both. Modules that the "
    "file imports are not included. Absent: the controller is part of sonata2d, or its source is unknown"
)


class ContactCount(Part):
    """Frames of an episode in which the robot is in contact with one kind of outline, or with any."""

    frames: Count = Field(description="number of frames in contact")
    robot_at_fault: Count = Field(description="number of these frames in which the robot's own velocity closes the gap")
    other_at_fault: Count = Field(
        description="number of these frames in which the other's velocity closes the gap; both can, or neither"
    )


class CommandExcess(Part):
    """Commands of an episode in which one component exceeds its limit; the drive executes less."""

    frames: Count = Field(description="number of frames with such a command")
    command: float = Field(description="m/s or rad/s, size of the command that exceeds the limit most")
    limit: float = Field(description="m/s or rad/s, the limit that it exceeds")


class ManifestFile(Part):
    """One file of a data set."""

    name: FileName
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: Count
    episode: Count
    family: str
    outcome: Status
    ticks: Count = Field(description="number of frames")
    contacts: dict[Literal["any", "human", "object", "wall"], ContactCount] | None = Field(
        default=None,
        description="by kind of contact, kinds without a contact left out; absent: not counted (version 0.1, imported)",
    )
    commands_beyond_limits: dict[Literal["vx", "vy", "omega"], CommandExcess] | None = Field(
        default=None,
        description="by component of the command, components within their limits left out; absent: not counted",
    )
    contributor: str | None = Field(default=None, description="name of the driver; collected runs only")
    seed: int | None = Field(default=None, description="seed of the scene; collected runs only")


class Source(Part):
    """A data set that was merged into this one."""

    name: str = Field(description="prefix of the names of its files")
    mirrored: bool = Field(default=False, description="whether its episodes are mirror images")
    scenario: str | None = Field(description="name of the scenario; null: collected runs")
    settings: Settings | None
    seed: int | None
    episodes: Count
    keep: list[Status] | None = Field(default=None, description="as in a manifest")
    left_out: dict[str, Count] | None = Field(default=None, description="as in a manifest")
    controller: Controller | None
    controller_sha256: dict[str, str] | None = Field(default=None, description="as in a manifest")
    files: list[FileName]


class Counts(Part):
    """Number of episodes by property."""

    outcome: dict[str, Count]
    family: dict[str, Count]
    contributor: dict[str, Count] | None = Field(default=None, description="collected runs only")


class Manifest(Part):
    """Contents of a data set: `manifest.json`."""

    format: Literal["sonata2d-dataset"]
    version: Literal[1]
    mirrored: bool = Field(
        default=False, description="whether the episodes are mirror images of those that settings and seed produce"
    )
    collected: bool = Field(
        default=False, description="whether people drove; each file then holds its own settings, seed and controller"
    )
    name: str | None = Field(description="name of the scenario; null: collected runs")
    settings: Settings | None = Field(description="resolved settings of the scenario")
    seed: int | None
    episodes: Count = Field(description="number of episodes requested; with `keep`, number of kept episodes requested")
    keep: list[Status] | None = Field(
        default=None, description="outcomes of kept episodes, which are the first ones by number; absent: all"
    )
    controller: Controller | None
    controller_sha256: dict[str, str] | None = Field(default=None, description=_CODE_DESCRIPTION)
    precision: Positive
    physics: int
    complete: bool = Field(description="false during generation and after an interruption")
    counts: Counts
    left_out: dict[str, Count] | None = Field(
        default=None, description="number of episodes not kept before the last listed one, by outcome; only with `keep`"
    )
    split: dict[str, list[FileName]] | None = Field(
        description="file names by part: train, dev, test; null: the data set is not split"
    )
    sources: list[Source] | None = Field(default=None, description="the data sets that were merged")
    files: list[ManifestFile]
    software: Software


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
    """

    name: str
    settings: dict[str, Any] | None
    seed: int
    episodes: int
    controller_info: ControllerInfo
    suffix: str = ".json"
    keep: tuple[Status, ...] = ()
    controller_sha256: Mapping[str, str] = field(default_factory=dict)

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

    def row(self) -> JsonDict:
        """The row as JSON, without the keys whose values are unknown."""
        return {key: value for key, value in asdict(self).items() if value is not None}


def files_of(path: Path) -> list[Path]:
    """Episode files at a path: the file itself, the files listed in its manifest, or else the JSON files of the folder.

    Raises:
        RecordError: the path does not exist or holds no episode, or its manifest is damaged.
    """
    if path.is_file():
        return [path]
    if (path / MANIFEST).exists():
        names = [entry["name"] for entry in read_manifest(path)["files"]]
        first = names[:_FIRST]
        if len(names) > _FIRST and not any((path / name).exists() for name in first):
            raise RecordError(f"{path}: {MANIFEST} lists {len(names)} files, but {first[0]} to {first[-1]} are missing")
        return [path / name for name in names]
    files = sorted(
        file
        for file in path.glob("*.json*")
        if file.is_file() and file.name.endswith(SUFFIXES) and file.name not in _NOT_EPISODES
    )
    if not files:
        if path.is_dir():
            raise RecordError(f"{path} holds no episode files")
        raise RecordError(f"{path} is neither a file nor a folder" if path.exists() else f"{path} does not exist")
    return files


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
    path = folder / MANIFEST
    if not path.exists():
        raise RecordError(f"{folder} is not a data set: it has no {MANIFEST}")
    try:
        manifest = orjson.loads(read_bytes(path))
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not valid JSON: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != DATASET_FORMAT:
        raise RecordError(f"{path} is not a {DATASET_FORMAT} manifest")
    version = manifest.get("version")
    if not isinstance(version, int) or not 1 <= version <= DATASET_VERSION:
        raise RecordError(
            f"{path} was written by version {version!r}, this sonata2d reads up to {DATASET_VERSION}; upgrade sonata2d"
        )
    from pydantic import TypeAdapter, ValidationError

    # The rows are validated in blocks: the objects that pydantic makes of a million rows take gigabytes.
    rows: Any = manifest.get("files")
    start = 0
    is_long = isinstance(rows, list) and len(rows) > _BLOCK
    try:
        Manifest.model_validate_json(orjson.dumps(manifest | {"files": []} if is_long else manifest))
        adapter = TypeAdapter(list[ManifestFile])
        for start in range(0, len(rows), _BLOCK) if is_long else ():
            adapter.validate_json(orjson.dumps(rows[start : start + _BLOCK]))
    except orjson.JSONEncodeError:
        raise RecordError(f"{path} is not a valid manifest: its values are nested too deeply") from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        keys = first["loc"]
        if isinstance(keys[0], int):
            keys = "files", start + keys[0], *keys[1:]
        location = ".".join(map(str, keys))
        raise RecordError(f"{path} is not a valid manifest: {location:.200}: {first['msg']:.200}") from None
    return manifest


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
    return orjson.dumps(document, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


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
) -> JsonDict:
    """The manifest of a generated data set.

    Args:
        spec: specification of the data set.
        entries: its files, in order of episode number.
        complete: whether all requested episodes are present.
        left_out: number of episodes not kept before the last listed one, by outcome; only with `keep`.
        split: file names by part.
    """
    rows = [entry.row() for entry in entries]
    exclusions = {"left_out": dict(sorted((left_out or {}).items()))} if spec.keep else {}
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        **_identity(spec),
        **({"controller_sha256": dict(spec.controller_sha256)} if spec.controller_sha256 else {}),
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": complete,
        "counts": {key: dict(sorted(Counter(row[key] for row in rows).items())) for key in ("outcome", "family")},
        **exclusions,
        "split": None if split is None else dict(split),
        "files": rows,
        "software": software_versions(),
    }


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A temporary folder that is renamed to `out` on success and removed on an error.

    Raises:
        RecordError: `out` exists and is not an empty folder, or it cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RecordError(f"{out} already exists and is not empty; choose another name")
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
    for partial_file in folder.glob(f"{TEMPORARY_PREFIX}*"):
        partial_file.unlink(missing_ok=True)


def start_dataset(folder: Path, spec: DatasetSpec, *, resume: bool = False, overwrite: bool = False) -> dict[str, str]:
    """Begin a data set in a new or empty folder or in place of another one, or continue an interrupted one.

    A data set without episodes, as of a run that failed at once, is always replaced.

    Args:
        folder: of the data set.
        spec: specification of the data set.
        resume: continue the data set that the folder holds.
        overwrite: replace the data set that the folder holds: its episodes and the other files that sonata2d writes.
            Other files stay.

    Returns:
        SHA-256 by file name of the files listed in the manifest of a continued data set.

    Raises:
        RecordError: the folder holds other files, or a data set that can be neither continued nor replaced.
    """
    listed: dict[str, str] = {}
    if folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")
    if (folder / MANIFEST).exists():
        stored = read_manifest(folder)
        _require_replaceable(folder, stored)
        if resume and not (differences := _differences(stored, spec)):
            _require_same_suffix(folder, spec)
            listed = {entry["name"]: entry["sha256"] for entry in stored["files"]}
        elif overwrite or not (stored["files"] or _episode_files(folder)):
            _remove_dataset(folder, stored)
        elif resume:
            remedy = "replace it with generate --overwrite, or choose another folder"
            raise RecordError(f"{folder} holds another data set: {differences}; {remedy}")
        else:
            raise RecordError(
                f"{folder} already holds a data set; continue it with --resume, replace it with --overwrite, or choose "
                "another folder"
            )
    elif folder.exists() and any(not path.name.startswith(TEMPORARY_PREFIX) for path in folder.iterdir()):
        raise RecordError(f"{folder} is not empty and has no {MANIFEST}; choose another folder")
    remove_partial_files(folder)
    # The manifest is written first, because a later resumption recognises the data set by it.
    write_json(folder / MANIFEST, manifest_of(spec, (), complete=False))
    if spec.settings is not None:
        write_json(folder / SCENARIO, spec.settings)
    return listed


def remove_failed_episodes(folder: Path) -> None:
    """Remove the episodes in the subfolder `failed`, and the subfolder if nothing else is in it."""
    failed = folder / FAILED
    if failed.is_dir():
        remove_partial_files(failed)
        for path in _episode_files(failed):
            path.unlink(missing_ok=True)
        with suppress(OSError):
            failed.rmdir()


def _episode_files(folder: Path) -> list[Path]:
    """The files of a folder that are named as generated episodes are."""
    return [path for path in folder.iterdir() if _EPISODE_NAME.fullmatch(path.name) and path.is_file()]


def _remove_dataset(folder: Path, stored: JsonDict) -> None:
    """Remove the files of a data set, its manifest last: if that is interrupted, it can be repeated."""
    own = (*(row["name"] for row in stored["files"]), CARD, FIGURES, CROISSANT, METRICS, PREVIEW, LOG, SCENARIO)
    try:
        for path in (*(folder / name for name in own), *_episode_files(folder)):
            path.unlink(missing_ok=True)
        remove_failed_episodes(folder)
        (folder / MANIFEST).unlink()
    except OSError as error:
        raise RecordError(f"{folder} cannot be overwritten: {error.strerror or error}") from error


def store_episode(folder: Path, spec: DatasetSpec, episode: int, recorder: EpisodeRecorder) -> ManifestEntry:
    """Write a recorded episode to its file and return the manifest row."""
    document = recorder.document()
    path, header = folder / spec.file_name(episode), parse_header(document)
    data, outcome = compress(document, path), header["outcome"]
    write_atomically(path, data)
    return ManifestEntry(
        path.name,
        _sha256(data),
        len(data),
        header["episode"],
        header["family"],
        outcome["status"],
        outcome["tick"],
        **recorder.counts(),
    )


def existing_episodes(
    folder: Path, spec: DatasetSpec, listed: Mapping[str, str]
) -> tuple[dict[int, ManifestEntry], list[str]]:
    """Usable episodes of a specification that a folder already holds, and why other files are not usable.

    Args:
        folder: folder of the data set.
        spec: specification of the data set.
        listed: SHA-256 by file name, from `start_dataset`; a file with another hash counts as changed.

    Returns:
        Manifest rows by episode number, and one message for each unusable file.

    Raises:
        NewerFormatError: a file was written by a newer version.
    """
    entries, faults = {}, []
    for episode in episode_numbers(folder, spec):
        path = folder / spec.file_name(episode)
        try:
            record = read_episode(path)
            _require_episode_of(record, spec, episode)
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
    stems = (path.name.removesuffix(spec.suffix) for path in folder.iterdir() if path.name.endswith(spec.suffix))
    numbers = sorted(int(stem) for stem in stems if stem.isdecimal() and stem.isascii())
    return [k for k in numbers if (spec.keep or k < spec.episodes) and (folder / spec.file_name(k)).is_file()]


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _identity(spec: DatasetSpec) -> JsonDict:
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


def _require_replaceable(folder: Path, stored: JsonDict) -> None:
    """Raise RecordError for data sets that `generate` did not make: it neither continues nor replaces them."""
    if stored["collected"]:
        raise RecordError(f"{folder} holds runs driven by people; choose another folder")
    if stored.get("sources"):
        raise RecordError(f"{folder} holds merged data sets; choose another folder")
    if stored.get("mirrored"):
        raise RecordError(f"{folder} holds mirror images; resume the original data set and mirror it again")


def _differences(stored: JsonDict, spec: DatasetSpec) -> str:
    """In which keys a data set differs from a specification, which may have more episodes; empty if in none."""
    requested = {"keep": None, **_identity(spec), "physics": PHYSICS_VERSION}
    if stored["episodes"] < spec.episodes:
        del requested["episodes"]
    if (stored["controller"] or {}).get("path") != spec.controller_info.path:  # its settings are then others as well
        requested["controller"] = {**(stored["controller"] or {}), "path": spec.controller_info.path}
    found = [
        f"{key} {_short.repr(old)} stored, {_short.repr(new)} requested"
        for key, old, new in _changes({key: stored.get(key) for key in requested}, requested)
    ]
    # version 0.1 stored no hashes; the episodes of such a data set are taken as they are
    code = stored.get("controller_sha256") or {}
    for name, sha256 in spec.controller_sha256.items():
        if code.get(name, sha256) != sha256:
            found.append(f"the code of {name}, SHA-256 {code[name][:12]}… stored, {sha256[:12]}… now")
    rest = len(found) - _MAXIMUM_DIFFERENCES
    return "; ".join(found[:_MAXIMUM_DIFFERENCES] + ([f"and {rest} more differences"] if rest > 0 else []))


def _changes(stored: Any, requested: Any, place: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The keys in which two documents differ, such as `settings.robot.radius`, with both values."""
    if isinstance(stored, dict) and isinstance(requested, dict):
        for key in {**stored, **requested}:
            yield from _changes(stored.get(key), requested.get(key), f"{place}.{key}" if place else key)
    elif stored != requested:
        yield place, stored, requested


def _require_same_suffix(folder: Path, spec: DatasetSpec) -> None:
    """Raise RecordError if the folder holds episode files with another suffix."""
    for path in folder.iterdir():
        is_episode = path.name.split(".")[0].isdigit() and path.name.endswith(SUFFIXES)
        if is_episode and file_suffix(path) != spec.suffix:
            raise RecordError(f"{folder} holds files like {path.name}; resume with the same --compress")


def _require_episode_of(record: EpisodeRecord, spec: DatasetSpec, episode: int) -> None:
    """Raise RecordError unless the specification produces this episode and it ran to its end."""
    expected = {**_identity(spec), "episode": episode, "physics": PHYSICS_VERSION, "id": file_stem(record.path)}
    for key, value in expected.items():
        if key not in ("episodes", "keep") and record.document[key] != value:
            raise RecordError(f"{record.path} belongs to another data set: its {key} differs")
    status = record.outcome.status
    if status == "error":
        raise RecordError(f"{record.path} ended in an error: {record.outcome.reason}")
    if spec.keep and status not in spec.keep:
        raise RecordError(f"{record.path} ended in {status}, but only {', '.join(spec.keep)} is kept")
