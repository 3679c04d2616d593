"""The folder of runs that people drove, from the side of one contributor; the episode files hold all information."""

from __future__ import annotations

import logging
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import orjson
from filelock import FileLock

from ..core.files.locations import explained
from ..core.files.locking import acquired_lock
from ..core.files.whole_file import delete_for_good, sync_folder
from ..core.geometry import PRECISION
from ..core.wording import shown
from ..datasets.card.write import write_manifest_and_card
from ..datasets.generate.progress import append_to_log
from ..datasets.manifest import (
    CROISSANT,
    DATASET_FORMAT,
    DATASET_VERSION,
    LOG,
    MANIFEST,
    METRICS,
    SCENARIO,
    read_manifest,
    row_of,
    write_json,
)
from ..datasets.tables import remove_tables
from ..errors import ConfigError, RecordError
from ..record.canonical import parse_header
from ..record.files import SUFFIXES, file_stem, read_bytes, safe_name, safe_stem, write_atomically, write_document
from ..record.layout import JsonDict, software_versions
from ..record.reader import read_episode
from ..record.recorder import EpisodeRecorder
from ..version import PHYSICS_VERSION

logger = logging.getLogger(__name__)

DISCARDED, _JOURNALS = "discarded", "journal"  # subfolders
_MAXIMUM_NAME_LENGTH = 1000  # characters of a contributor's name


class Collection:
    """Stores kept and discarded runs in a folder, and counts them.

    Args:
        folder: created if it does not exist.
        contributor: name of the driver; only one window per contributor may use the folder.
        settings: settings of the scenario, stored beside the first runs.
        suffix: `.json`, `.json.gz` or `.json.zst`.

    Attributes:
        journal: path of the contributor's journal.
        kept: number of this contributor's runs in the folder.

    Raises:
        ConfigError: the contributor's name is not usable.
        RecordError: the folder holds something else, cannot be written, or is in use by this contributor.
    """

    def __init__(self, folder: Path, contributor: str, settings: dict[str, Any], suffix: str = ".json") -> None:
        self.folder, self.contributor, self._suffix = folder, checked_name(contributor), suffix
        require_collection_folder(folder)
        self.journal = folder / _JOURNALS / f"{safe_stem(self.contributor)}.jsonl"
        self.kept = 0
        message = f"another window of {self.contributor} uses {folder}; close it first"
        self._lock = acquired_lock(self.journal.with_suffix(".lock"), message)
        self._kept_paths: list[Path] = []  # of this session
        try:
            self._rows = self._write_manifest({})
            if settings and not (folder / SCENARIO).exists():
                write_json(folder / SCENARIO, settings)
        except BaseException:
            self.close()
            raise

    def next_number(self, seed: int) -> int:
        """The scene number after the last one of this seed that this contributor kept or discarded, or 0."""
        rows = [row for row in self._rows.values() if row["contributor"] == self.contributor]
        discarded = sorted((self.folder / DISCARDED).glob(f"{self.journal.stem}__*"))
        rows += [header for path in discarded if (header := _header(path))]
        return max((int(row["episode"]) for row in rows if row.get("seed") == seed), default=-1) + 1

    def kept_runs(self, seed: int) -> dict[int, str]:
        """File names of this contributor's runs with a seed, by number of the scene."""
        rows = [row for row in self._rows.values() if row["contributor"] == self.contributor and row["seed"] == seed]
        return {int(row["episode"]): str(row["name"]) for row in rows}

    def keep(self, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run that ended.

        Args:
            recorder: holds the run.
            when: present time, for the file name.
            announce: called with the file name before the file is written.

        Returns:
            The path of the file.

        Raises:
            RecordError: the file cannot be written; no partial file remains, and the call can be repeated.
        """
        path = self._write(self.folder, recorder, when, announce)
        self._kept_paths.append(path)
        try:
            self._rows = self._write_manifest(self._rows)
        except RecordError as error:  # the run is kept; after an error it would be kept once more
            self.kept += 1
            logger.warning("%s; the next run writes the manifest again", error)
        return path

    def discard(self, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run that ended to the folder of discarded runs; otherwise as `keep`."""
        return self._write(self.folder / DISCARDED, recorder, when, announce)

    def contains(self, name: str) -> bool:
        """Whether a kept or discarded run has this file name."""
        return any((place / name).exists() for place in (self.folder, self.folder / DISCARDED))

    @property
    def can_undo(self) -> bool:
        """Whether this session has kept a run."""
        return bool(self._kept_paths)

    @property
    def last_kept(self) -> Path:
        """Path of the run that this session kept last.

        Raises:
            ValueError: this session has kept no run.
        """
        if not self._kept_paths:
            raise ValueError("nothing was kept in this session")
        return self._kept_paths[-1]

    def undo(self) -> Path:
        """Move the run that this session kept last to the discarded runs, and return its new path.

        Raises:
            ValueError: this session has kept no run.
            RecordError: the file cannot be moved.
        """
        path = self.last_kept
        new_path = self.folder / DISCARDED / path.name
        try:
            new_path.parent.mkdir(exist_ok=True)
            os.replace(path, new_path)
        except OSError as error:
            raise RecordError(f"{path} cannot be moved to {new_path}: {error.strerror or error}") from error
        # The run is taken back: what fails from here on is only a warning.
        self._kept_paths.pop()
        self._rows.pop(path.name, None)
        self.kept -= 1
        try:
            sync_folder(new_path.parent)
            sync_folder(path.parent)
            self._rows = self._write_manifest(self._rows)
        except (OSError, RecordError) as error:
            logger.warning("%s; the next run writes the manifest again", error)
        return new_path

    def forget(self) -> list[Path]:
        """Delete all runs of this contributor, kept, discarded and open, and the lines of the log about them.

        Returns:
            The paths of the deleted files.

        Raises:
            RecordError: a file cannot be deleted, or the manifest, which names the runs, cannot be written.
        """
        # Ids may contain dots and underscores: the pattern of one contributor must not match files of another.
        run = re.compile(re.escape(self.journal.stem) + r"__\d{8}T\d{6}Z__.+")
        journal = re.compile(re.escape(self.journal.stem) + r"\.(jsonl|\d+T\d+\.aside)")
        places = [(self.folder, run), (self.folder / DISCARDED, run), (self.journal.parent, journal)]
        try:
            paths = [
                path
                for place, name in places
                for path in (place.iterdir() if place.is_dir() else ())
                if name.fullmatch(path.name)
            ]
            delete_for_good(paths, (place for place, _ in places))
            log = self.folder / LOG
            lines = read_bytes(log).splitlines(keepends=True) if log.exists() else []
            contributor = orjson.dumps({"contributor": self.contributor})[1:-1]
            write_atomically(log, b"".join(line for line in lines if contributor not in line))
        except OSError as error:
            raise RecordError(f"{error.filename} cannot be deleted: {error.strerror}") from error
        self._kept_paths = []
        self._rows = self._write_manifest({}, is_required=True)
        return sorted(paths)

    def log(self, **facts: Any) -> None:
        """Append a line to the run log; a write error is only a warning."""
        try:
            append_to_log(self.folder, contributor=self.contributor, **facts)
        except RecordError as error:
            logger.warning("%s", error)

    def close(self) -> None:
        """Release the lock, so that another window of this contributor can use the folder."""
        self._lock.release()

    def _write(self, folder: Path, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run under an unused file name."""
        assert recorder.scene is not None
        number, attempt = f"{recorder.scene.episode:06d}", 1
        while True:
            id = f"{number}-{attempt}" if attempt > 1 else number
            path = folder / safe_name(self.contributor, when, id, self._suffix)
            if not self.contains(path.name):
                break
            attempt += 1
        recorder.id = file_stem(path)
        document = recorder.complete()
        announce(path.name)
        try:
            write_document(path, document)
        except RecordError:  # also if the file is whole, but its name is not on the disk: it would be written once more
            with suppress(OSError):
                path.unlink()
            raise
        return path

    def _write_manifest(self, known: dict[str, JsonDict], *, is_required: bool = False) -> dict[str, JsonDict]:
        """Write manifest and card for all runs in the folder, and return the manifest rows by file name.

        A write error is only a warning, because the runs themselves are stored; the next run writes the manifest again.

        Args:
            known: rows that need not be read again.
            is_required: whether a write error is raised.
        """
        rows: dict[str, JsonDict] = {}
        try:
            # The folder is listed under the lock: a list from before would omit runs that others have kept since.
            lock = self.folder / _JOURNALS / "manifest.lock"
            with explained(lock, "written"), FileLock(lock, timeout=10):
                rows = _read_rows(self.folder, known)
                manifest = manifest_of_runs(list(rows.values())) | {"split": _valid_split(self.folder, rows)}
                remove_tables(self.folder)  # they would lack the new run; `sonata2d card` writes them again
                write_manifest_and_card(self.folder, manifest)
        except RecordError as error:
            rows = rows or _read_rows(self.folder, known)
            if is_required or not rows:
                raise
            logger.warning("%s; the next run writes the manifest again", error)
        self.kept = sum(row["contributor"] == self.contributor for row in rows.values())
        return rows


def checked_name(contributor: str) -> str:
    """A contributor's name without surrounding spaces.

    Raises:
        ConfigError: the name is empty or too long, or has characters that cannot be displayed or stored.
    """
    name = contributor.strip()
    if not name or len(name) > _MAXIMUM_NAME_LENGTH:
        problem = f"has {len(name)} characters" if name else "is empty"
        raise ConfigError(
            f"the contributor's name {problem}; give a name or a pseudonym of 1 to {_MAXIMUM_NAME_LENGTH} characters"
        )
    if not name.isprintable() or any("\ud800" <= c <= "\udfff" for c in name):
        raise ConfigError(f"the contributor's name {shown(name)} has unprintable characters; remove them")
    return name


def manifest_of_runs(rows: list[JsonDict]) -> JsonDict:
    """The manifest of collected runs; each file holds its own settings, seed and controller.

    Args:
        rows: manifest rows of the files, with `contributor` and `seed`.
    """
    rows = sorted(rows, key=lambda row: str(row["name"]))
    counted = ("outcome", "family", "contributor")
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        "collected": True,
        **dict.fromkeys(("name", "settings", "seed")),
        "episodes": len(rows),
        "controller": None,
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": True,
        "counts": {key: dict(sorted(Counter(row[key] for row in rows).items())) for key in counted},
        "split": None,
        "files": rows,
        "software": software_versions(),
    }


def require_collection_folder(folder: Path) -> None:
    """Raise RecordError unless the folder is new, empty of JSON files, or a collection."""
    if folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")
    if (folder / _JOURNALS).is_dir():
        return  # a collection, even if its manifest is damaged: the manifest is rebuilt from the files
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder)
        if manifest.get("mirrored"):
            raise RecordError(f"{folder} holds mirror images; choose another folder for collected runs")
        if not manifest["collected"]:
            raise RecordError(f"{folder} holds a generated data set; choose another folder for collected runs")
    elif folder.exists() and any(path.suffix == ".json" for path in folder.iterdir()):
        raise RecordError(f"{folder} holds JSON files but no {MANIFEST}; choose another folder")


def _read_rows(folder: Path, known: dict[str, JsonDict]) -> dict[str, JsonDict]:
    """Manifest rows of all runs in a folder, by file name.

    A file is read only if its row is neither known nor listed in the manifest, or if its size has changed.
    """
    try:
        listed = {row["name"]: row for row in read_manifest(folder)["files"]} if (folder / MANIFEST).exists() else {}
    except RecordError as error:
        listed = {}
        logger.warning("%s; it is rebuilt from the episode files", error)
    known = listed | known
    rows = {}
    for path in sorted(folder.iterdir()):
        is_other_file = path.name in (MANIFEST, SCENARIO, METRICS, CROISSANT) or path.name.startswith(".")
        if is_other_file or not path.name.endswith(SUFFIXES):
            continue
        row = known.get(path.name)
        try:
            if row is None or row["bytes"] != path.stat().st_size:
                row = _read_row(path)
        except FileNotFoundError:
            continue  # another contributor has taken the run back
        except RecordError as error:
            logger.warning("%s; the file is omitted from the manifest", error)
        else:
            rows[path.name] = row
    return rows


def _read_row(path: Path) -> JsonDict:
    record = read_episode(path)
    return row_of(record) | {"contributor": record.contributor or "", "seed": record.seed}


def _valid_split(folder: Path, names: Iterable[str]) -> JsonDict | None:
    """The split in the stored manifest, if it still covers exactly these files."""
    try:
        manifest = read_manifest(folder)
    except RecordError:
        return None
    split: JsonDict | None = manifest["split"]
    return split if {row["name"] for row in manifest["files"]} == set(names) else None


def _header(path: Path) -> JsonDict | None:
    """The keys before the frames of a discarded run; None if the file cannot be read."""
    try:
        return parse_header(read_bytes(path))
    except (RecordError, ValueError):
        return None
