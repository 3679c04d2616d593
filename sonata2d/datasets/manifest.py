"""A data set: a folder of episode files with a manifest, a data card and a run log."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import orjson
from pydantic import Field

from ..core.geometry import PRECISION
from ..core.snapshot import Author, Status
from ..errors import NewerFormatError, RecordError
from ..record.canonical import head_of, plain
from ..record.files import SUFFIXES, TEMPORARY, packed, read_bytes, stem_of, suffix_of, write_atomically
from ..record.layout import Tree, software
from ..record.models import Controller, Count, Part, Positive, Software
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..version import PHYSICS_VERSION
from .card import card


class ManifestFile(Part):
    """One file of a data set."""

    name: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: Count
    episode: Count
    family: str
    outcome: Status
    ticks: Count = Field(description="number of frames")
    contributor: str | None = Field(default=None, description="who drove; of collected runs")
    seed: int | None = Field(default=None, description="of the scenes; of collected runs")


class Source(Part):
    """A data set that was merged into this one; its files tell the same of themselves."""

    name: str = Field(description="begins the names of its files")
    mirrored: bool = Field(default=False, description="its episodes are mirror images")
    scenario: str | None = Field(description="its name; null: collected")
    settings: dict[str, Any] | None
    seed: int | None
    episodes: Count
    keep: list[Status] | None = Field(default=None, description="as of a data set")
    left_out: dict[str, Count] | None = Field(default=None, description="as of a data set")
    controller: Controller | None
    files: list[str]


class Counts(Part):
    """Episodes by what they are."""

    outcome: dict[str, Count]
    family: dict[str, Count]
    contributor: dict[str, Count] | None = Field(default=None, description="of collected runs")


class Manifest(Part):
    """What a data set holds: `manifest.json`."""

    format: Literal["sonata2d-dataset"]
    version: Literal[1]
    mirrored: bool = Field(default=False, description="mirror images of the episodes that settings and seed give")
    collected: bool = Field(default=False, description="driven by people, kept run by run: each file tells its own")
    name: str | None = Field(description="of the scenario; null: collected")
    settings: dict[str, Any] | None = Field(description="resolved settings of the scenario")
    seed: int | None
    episodes: Count = Field(description="how many were asked for; where some are kept, how many of these")
    keep: list[Status] | None = Field(
        default=None, description="outcomes that were kept: the first ones by number that ended so; absent: all"
    )
    controller: Controller | None
    precision: Positive
    physics: int
    complete: bool = Field(description="false while it is being made, or where that was interrupted")
    counts: Counts
    left_out: dict[str, Count] | None = Field(
        default=None, description="by outcome, how many before the last one listed were not kept; only with `keep`"
    )
    split: dict[str, list[str]] | None = Field(description="names of files by part: train, dev, test; null: not split")
    sources: list[Source] | None = Field(default=None, description="what it was merged from; each has its own seed")
    files: list[ManifestFile]
    software: Software


DATASET_FORMAT, DATASET_VERSION = "sonata2d-dataset", 1
MANIFEST, SCENARIO, CARD = "manifest.json", "scenario.json", "README.md"
CROISSANT = "croissant.json"  # what `sonata2d card` writes for machines
METRICS = "metrics.json"  # what `sonata2d evaluate` leaves beside the episodes


@dataclass(frozen=True, slots=True)
class DatasetSpec:
    """What a data set is asked to be: all that decides its bytes.

    Attributes:
        name: of the scenario.
        settings: resolved settings of the scenario.
        seed: of the data set.
        episodes: how many; where only some are kept, how many of these.
        author: who drives.
        suffix: of the files.
        keep: outcomes that are kept; all if none is named.
    """

    name: str
    settings: dict[str, Any] | None
    seed: int
    episodes: int
    author: Author
    suffix: str = ".json"
    keep: tuple[Status, ...] = ()

    def file_name(self, episode: int) -> str:
        """`{episode:06d}.json`"""
        return f"{episode:06d}{self.suffix}"


@dataclass(frozen=True, slots=True)
class Entry:
    """What the manifest says of a file."""

    name: str
    sha256: str
    bytes: int
    episode: int
    family: str
    outcome: Status
    ticks: int


def start(folder: Path, plan: DatasetSpec, *, resume: bool = False) -> dict[str, str]:
    """Begin a data set in a new or empty folder, or go on with one that was interrupted.

    Returns:
        The SHA-256 of each file that an earlier manifest lists.

    Raises:
        RecordError: the folder holds something else, or another data set, or one and `resume` is False.
    """
    listed: dict[str, str] = {}
    if (folder / MANIFEST).exists():
        if not resume:
            raise RecordError(f"{folder} holds a data set already; resume it, or choose another folder")
        _refuse_another(folder, plan)
        _refuse_other_packing(folder, plan)
        listed = {told["name"]: told["sha256"] for told in read_manifest(folder)["files"]}
    elif folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")
    elif folder.exists() and any(not path.name.startswith(TEMPORARY) for path in folder.iterdir()):
        raise RecordError(f"{folder} is not empty and holds no {MANIFEST}; choose another folder")
    for left in folder.glob(f"{TEMPORARY}*"):
        left.unlink(missing_ok=True)
    write_tree(folder / MANIFEST, manifest_of(plan, (), complete=False))  # first: it is what a resumption looks for
    if plan.settings is not None:
        write_tree(folder / SCENARIO, plan.settings)
    return listed


def store(folder: Path, plan: DatasetSpec, episode: int, document: bytes) -> Entry:
    """Write an episode's document to its place; what the manifest will say of it."""
    path, head = folder / plan.file_name(episode), head_of(document)
    data, outcome = packed(document, path), head["outcome"]
    write_atomically(path, data)
    return Entry(
        path.name, _sha256(data), len(data), head["episode"], head["family"], outcome["status"], outcome["tick"]
    )


def entry_of(record: EpisodeRecord) -> Entry:
    """What the manifest says of an episode that was read."""
    data, status = record.path.read_bytes(), record.outcome.status
    return Entry(record.path.name, _sha256(data), len(data), record.episode, record.family, status, len(record))


def existing(folder: Path, plan: DatasetSpec, listed: Mapping[str, str]) -> tuple[dict[int, Entry], list[str]]:
    """The whole episodes of this plan that a folder holds, and why others must be made again.

    Args:
        listed: SHA-256 by file name, from `start`; a file that differs from it was changed since.

    Returns:
        Entries by number of episode, and a line for each file of the plan that is there but of no use.
    """
    entries, faults = {}, []
    for episode in _numbers(folder, plan):
        path = folder / plan.file_name(episode)
        try:
            record = read_episode(path)
            _refuse_stranger(record, plan, episode)
            entry = entry_of(record)
            if listed.get(path.name, entry.sha256) != entry.sha256:
                raise RecordError(f"{path} was changed since it was made")
            entries[episode] = entry
        except NewerFormatError:
            raise
        except RecordError as error:
            faults.append(str(error))
    return entries, faults


def _numbers(folder: Path, plan: DatasetSpec) -> list[int]:
    """The numbers of episodes that files in the folder are named after, as far as the plan may ask for them."""
    stems = (path.name.removesuffix(plan.suffix) for path in folder.iterdir() if path.name.endswith(plan.suffix))
    numbers = sorted(int(stem) for stem in stems if stem.isdecimal() and stem.isascii())
    return [k for k in numbers if (plan.keep or k < plan.episodes) and (folder / plan.file_name(k)).is_file()]


def finish(
    folder: Path,
    plan: DatasetSpec,
    entries: Iterable[Entry],
    *,
    left_out: Mapping[str, int] | None = None,
    split: Mapping[str, list[str]] | None = None,
) -> Tree:
    """Write manifest and card; complete if every episode is there.

    Where only some are kept, files of episodes beyond the last one that was asked for are removed.

    Args:
        left_out: how many before the last one were not kept, by outcome.

    Returns:
        The manifest.
    """
    files = sorted(entries, key=lambda entry: entry.episode)
    numbers = [entry.episode for entry in files]
    complete = len(numbers) == plan.episodes if plan.keep else numbers == list(range(plan.episodes))
    for beyond in set(_numbers(folder, plan)).difference(numbers) if plan.keep else ():
        (folder / plan.file_name(beyond)).unlink(missing_ok=True)
    manifest = manifest_of(plan, files, complete=complete, left_out=left_out, split=split)
    write_atomically(folder / CARD, card(manifest).encode())
    write_tree(folder / MANIFEST, manifest)
    return manifest


def read_manifest(folder: Path) -> Tree:
    """The manifest of a data set.

    Raises:
        RecordError: there is none, it is damaged, or was written by a newer version.
    """
    path = folder / MANIFEST
    if not path.exists():
        raise RecordError(f"{folder} holds no {MANIFEST}, so it is no data set")
    try:
        manifest = orjson.loads(read_bytes(path))
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not whole JSON: {error}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != DATASET_FORMAT:
        raise RecordError(f"{path} is no {DATASET_FORMAT} manifest")
    version = manifest.get("version")
    if not isinstance(version, int) or not 1 <= version <= DATASET_VERSION:
        raise RecordError(
            f"{path} was written by version {version!r}, this sonata2d reads up to {DATASET_VERSION}; upgrade sonata2d"
        )
    from pydantic import ValidationError

    try:
        Manifest.model_validate_json(orjson.dumps(manifest))
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        raise RecordError(f"{path} is no whole manifest: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    return {"collected": False} | manifest


def manifest_of(
    plan: DatasetSpec,
    files: Iterable[Entry],
    *,
    complete: bool,
    left_out: Mapping[str, int] | None = None,
    split: Mapping[str, list[str]] | None = None,
) -> Tree:
    """The manifest of these files."""
    rows = [asdict(entry) for entry in files]
    others = {"left_out": dict(sorted((left_out or {}).items()))} if plan.keep else {}
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        **_identity(plan),
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": complete,
        "counts": {key: dict(sorted(Counter(row[key] for row in rows).items())) for key in ("outcome", "family")},
        **others,
        "split": None if split is None else dict(split),
        "files": rows,
        "software": software(),
    }


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _identity(plan: DatasetSpec) -> Tree:
    author = plan.author
    controller = {"path": author.path, "version": author.version, "settings": author.settings}
    told = {
        "name": plan.name,
        "settings": plan.settings,
        "seed": plan.seed,
        "episodes": plan.episodes,
        **({"keep": plan.keep} if plan.keep else {}),
        "controller": controller,
    }
    return {key: plain(value, f"{key} of the data set", exact=True) for key, value in told.items()}


def _refuse_another(folder: Path, plan: DatasetSpec) -> None:
    """Only the same data set can be resumed, or the same with more episodes."""
    there, asked = read_manifest(folder), {"keep": None, **_identity(plan), "physics": PHYSICS_VERSION}
    if there.get("mirrored"):
        raise RecordError(f"{folder} holds mirror images; resume the data set that they are of, and mirror that")
    for key, value in asked.items():
        if key == "episodes" and there.get(key, 0) <= value:
            continue
        if there.get(key) != value:
            told = f"{there.get(key)!r} there, {value!r} asked" if key != "settings" else _difference(there[key], value)
            raise RecordError(f"{folder} holds another data set: {key} {told}; choose another folder")


def _refuse_other_packing(folder: Path, plan: DatasetSpec) -> None:
    """One data set, one way to pack files."""
    for path in folder.iterdir():
        is_episode = path.name.split(".")[0].isdigit() and path.name.endswith(SUFFIXES)
        if is_episode and suffix_of(path) != plan.suffix:
            raise RecordError(f"{folder} holds files like {path.name}; go on with the same --compress")


def _difference(there: Tree | None, asked: Tree | None) -> str:
    """The first setting that differs."""
    there, asked = there or {}, asked or {}
    key = next(key for key in {**there, **asked} if there.get(key) != asked.get(key))
    return f"{key} {there.get(key)!r} there, {asked.get(key)!r} asked"


def _refuse_stranger(record: EpisodeRecord, plan: DatasetSpec, episode: int) -> None:
    """An episode counts only if this plan would make it, and if it came to its end."""
    asked = {**_identity(plan), "episode": episode, "physics": PHYSICS_VERSION, "id": stem_of(record.path)}
    for key, value in asked.items():
        if key not in ("episodes", "keep") and record.document[key] != value:
            raise RecordError(f"{record.path} is of another data set: its {key} differs")
    status = record.outcome.status
    if status == "error":
        raise RecordError(f"{record.path} ended in an error: {record.outcome.reason}")
    if plan.keep and status not in plan.keep:
        raise RecordError(f"{record.path} ended in {status}, kept are {', '.join(plan.keep)}")


def write_tree(path: Path, tree: Tree) -> None:
    """Indented, to be read and compared by people too."""
    write_atomically(path, orjson.dumps(tree, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))
