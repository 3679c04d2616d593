"""A folder of runs that people drove: one contributor's side of it. What it holds is told by the files themselves."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from ..errors import ConfigError, RecordError
from ..geometry import PRECISION
from ..version import PHYSICS_VERSION
from .card import card
from .dataset import (
    CARD,
    DATASET_FORMAT,
    DATASET_VERSION,
    MANIFEST,
    SCENARIO,
    entry_of,
    log,
    read_manifest,
    write_tree,
)
from .files import SUFFIXES, packed, safe_name, safe_text, stem_of, write_atomically
from .layout import Tree
from .reader import read_episode
from .recorder import EpisodeRecorder
from .software import software

logger = logging.getLogger(__name__)

BIN, JOURNALS = "discarded", "journal"
COUNTED = ("outcome", "family", "contributor")
LONGEST_NAME = 1000  # characters of a contributor's name


class Collection:
    """Keeps runs, puts others into the bin, and counts.

    Args:
        folder: made if it is not there.
        contributor: who drives; only one window of theirs may be open on the folder.
        settings: of the scenario; kept beside the first runs.
        suffix: `.json`, `.json.gz` or `.json.zst`.

    Attributes:
        journal: path for the contributor's open run.

    Raises:
        ConfigError: the contributor's name cannot be used.
        RecordError: the folder holds something else, cannot be written, or is in use by this contributor.
    """

    def __init__(self, folder: Path, contributor: str, settings: dict[str, Any], suffix: str = ".json") -> None:
        self.folder, self.contributor, self._suffix = folder, checked_name(contributor), suffix
        _refuse_other_content(folder)
        stem = safe_text(self.contributor)
        self.journal = folder / JOURNALS / f"{stem}.jsonl"
        self._lock = _locked(self.journal.with_suffix(".lock"), self.contributor)
        self._mine: list[Path] = []
        self._rows = list(_rows(folder))
        self._write_manifest()
        if not (folder / SCENARIO).exists():
            write_tree(folder / SCENARIO, settings)

    @property
    def kept(self) -> int:
        """How many of this contributor's runs the folder holds."""
        return sum(row["contributor"] == self.contributor for row in self._rows)

    @property
    def can_undo(self) -> bool:
        return bool(self._mine)

    @property
    def next_number(self) -> int:
        """Of the scene after the last one that this contributor kept or discarded; 0 to begin with."""
        numbers = [row["episode"] for row in self._rows if row["contributor"] == self.contributor]
        stem = self.journal.stem
        for path in (self.folder / BIN).glob(f"{stem}__*"):
            last = path.name.split("__")[-1].split(".")[0].split("-")[0]
            numbers += [int(last)] if last.isdigit() else []
        return max(numbers, default=-1) + 1

    def keep(self, recorder: EpisodeRecorder, when: datetime) -> Path:
        """Write a run that ended.

        Raises:
            RecordError: it cannot be written; nothing of it is left behind, and it can be tried again.
        """
        path = self._write(self.folder, recorder, when)
        self._mine.append(path)
        self._rows.append(_row_of(path))
        self._write_manifest()
        return path

    def discard(self, recorder: EpisodeRecorder, when: datetime) -> Path:
        """Write a run that ended to the bin.

        Raises:
            RecordError: it cannot be written.
        """
        return self._write(self.folder / BIN, recorder, when)

    def undo(self) -> Path:
        """Move what was kept last since this window opened to the bin; where it lies now.

        Raises:
            ValueError: nothing was kept since.
            RecordError: the file cannot be moved.
        """
        if not self._mine:
            raise ValueError("nothing was kept since this window opened")
        path = self._mine[-1]
        place = self.folder / BIN / path.name
        try:
            place.parent.mkdir(exist_ok=True)
            os.replace(path, place)
        except OSError as error:
            raise RecordError(f"{path} cannot be moved to {place}: {error.strerror or error}") from error
        self._mine.pop()
        self._rows = [row for row in self._rows if row["name"] != path.name]
        self._write_manifest()
        return place

    def log(self, **facts: Any) -> None:
        """Note what is true of this sitting only; a disk that takes no more is passed over."""
        try:
            log(self.folder, contributor=self.contributor, **facts)
        except RecordError as error:
            logger.warning("%s", error)

    def close(self) -> None:
        """Let another window of this contributor open the folder."""
        self._lock.release()
        Path(self._lock.lock_file).unlink(missing_ok=True)

    def _write(self, folder: Path, recorder: EpisodeRecorder, when: datetime) -> Path:
        """Write a run under a name that no other has."""
        assert recorder.scene is not None
        number, again = f"{recorder.scene.episode:06d}", 1
        while True:
            path = folder / safe_name(
                self.contributor, when, f"{number}-{again}" if again > 1 else number, self._suffix
            )
            if not any((place / path.name).exists() for place in (self.folder, self.folder / BIN)):
                break
            again += 1
        recorder.id = stem_of(path)
        write_atomically(path, packed(recorder.document(), path))
        return path

    def _write_manifest(self) -> None:
        """Write manifest and card; they are gathered again where that fails, so nothing is lost."""
        try:
            manifest = manifest_of_runs(self._rows)
            write_atomically(self.folder / CARD, card(manifest).encode())
            write_tree(self.folder / MANIFEST, manifest)
        except RecordError as error:
            if not self._rows:
                raise
            logger.warning("%s; it is brought up to date with the next run", error)


def checked_name(contributor: str) -> str:
    """A contributor's name, without spaces around it.

    Raises:
        ConfigError: it is empty, very long, or no text that a file can hold.
    """
    name = contributor.strip()
    if not name or len(name) > LONGEST_NAME:
        said = f"has {len(name)} characters" if name else "is empty"
        raise ConfigError(f"the contributor's name {said}; give a name or a pseudonym of 1 to {LONGEST_NAME}")
    if not name.isprintable() or any("\ud800" <= c <= "\udfff" for c in name):
        raise ConfigError(f"the contributor's name {name!r:.60} has characters that cannot be shown; leave them out")
    return name


def manifest_of_runs(rows: list[Tree]) -> Tree:
    """The manifest of collected runs; each file tells its own settings, seed and controller."""
    rows = sorted(rows, key=lambda row: str(row["name"]))
    return {
        "format": DATASET_FORMAT,
        "version": DATASET_VERSION,
        "collected": True,
        "name": None,
        "settings": None,
        "seed": None,
        "episodes": len(rows),
        "controller": None,
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": True,
        "counts": {key: dict(sorted(Counter(row[key] for row in rows).items())) for key in COUNTED},
        "split": None,
        "files": rows,
        "software": software(),
    }


def _refuse_other_content(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise RecordError(f"{folder} is a file; choose another name for the folder")
    if (folder / MANIFEST).exists():
        if not read_manifest(folder)["collected"]:
            raise RecordError(f"{folder} holds a generated data set; choose another folder for people's runs")
    elif folder.exists() and any(path.suffix == ".json" for path in folder.iterdir()):
        raise RecordError(f"{folder} holds JSON files but no {MANIFEST}; choose another folder")


def _locked(path: Path, contributor: str) -> FileLock:
    """A lock that the system lets go of when this program ends, however it ends."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path, timeout=0)
        lock.acquire()
    except Timeout:
        raise RecordError(f"another window of {contributor} is open on {path.parent.parent}; close it first") from None
    except OSError as error:
        raise RecordError(f"{path.parent} cannot be written: {error.strerror or error}") from error
    return lock


def _rows(folder: Path) -> Iterator[Tree]:
    """What to say of each run: as the manifest has it, or read anew where it does not or the size differs."""
    known = {row["name"]: row for row in read_manifest(folder)["files"]} if (folder / MANIFEST).exists() else {}
    for path in sorted(folder.iterdir()):
        if path.name in (MANIFEST, SCENARIO) or path.name.startswith(".") or not path.name.endswith(SUFFIXES):
            continue
        row = known.get(path.name)
        try:
            yield row if row is not None and row["bytes"] == path.stat().st_size else _row_of(path)
        except RecordError as error:
            logger.warning("%s; it is left out of the manifest", error)


def _row_of(path: Path) -> Tree:
    record = read_episode(path)
    return asdict(entry_of(record)) | {"contributor": record.contributor or ""}
