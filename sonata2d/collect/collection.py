"""A folder of runs that people drove: one contributor's side of it. What it holds is told by the files themselves."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from ..core.geometry import PRECISION
from ..datasets.card import card
from ..datasets.manifest import (
    CARD,
    CROISSANT,
    DATASET_FORMAT,
    DATASET_VERSION,
    MANIFEST,
    METRICS,
    SCENARIO,
    entry_of,
    read_manifest,
    write_tree,
)
from ..datasets.progress import log
from ..errors import ConfigError, RecordError
from ..record.canonical import head_of
from ..record.files import SUFFIXES, packed, read_bytes, safe_name, safe_stem, stem_of, sync_folder, write_atomically
from ..record.layout import Tree, software
from ..record.reader import read_episode
from ..record.recorder import EpisodeRecorder
from ..version import PHYSICS_VERSION

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
        self.journal = folder / JOURNALS / f"{safe_stem(self.contributor)}.jsonl"
        self._lock = _locked(self.journal.with_suffix(".lock"), self.contributor)
        self._mine: list[Path] = []
        try:
            self._rows = self._write_manifest({})
            if not (folder / SCENARIO).exists():
                write_tree(folder / SCENARIO, settings)
        except BaseException:
            self.close()
            raise

    @property
    def kept(self) -> int:
        """How many of this contributor's runs the folder holds."""
        return self._kept

    def next_number(self, seed: int) -> int:
        """Of the scene after the last one of this seed that this contributor kept or discarded; 0 to begin with."""
        rows = [row for row in self._rows.values() if row["contributor"] == self.contributor]
        rows += [head for path in sorted((self.folder / BIN).glob(f"{self.journal.stem}__*")) if (head := _head(path))]
        numbers = [int(row["episode"]) for row in rows if row.get("seed") == seed]
        return max(numbers, default=-1) + 1

    def keep(self, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run that ended.

        Args:
            recorder: holds it.
            when: the time of day.
            announce: is told the file's name before it is written.

        Raises:
            RecordError: it cannot be written; nothing of it is left behind, and it can be tried again.
        """
        path = self._write(self.folder, recorder, when, announce)
        self._mine.append(path)
        self._rows = self._write_manifest(self._rows)
        return path

    def discard(self, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run that ended to the bin; as `keep`.

        Raises:
            RecordError: it cannot be written.
        """
        return self._write(self.folder / BIN, recorder, when, announce)

    def holds(self, name: str) -> bool:
        """Whether a run of this file name was kept or discarded."""
        return any((place / name).exists() for place in (self.folder, self.folder / BIN))

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
            sync_folder(place.parent)
            sync_folder(path.parent)
        except OSError as error:
            raise RecordError(f"{path} cannot be moved to {place}: {error.strerror or error}") from error
        self._mine.pop()
        self._rows = self._write_manifest(self._rows)
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

    def _write(self, folder: Path, recorder: EpisodeRecorder, when: datetime, announce: Callable[[str], None]) -> Path:
        """Write a run under a name that no other has."""
        assert recorder.scene is not None
        number, again = f"{recorder.scene.episode:06d}", 1
        while True:
            id = f"{number}-{again}" if again > 1 else number
            path = folder / safe_name(self.contributor, when, id, self._suffix)
            if not self.holds(path.name):
                break
            again += 1
        recorder.id = stem_of(path)
        data = packed(recorder.document(), path)
        announce(path.name)
        write_atomically(path, data)
        return path

    def _write_manifest(self, known: dict[str, Tree]) -> dict[str, Tree]:
        """Write manifest and card of what the folder holds now, others' runs included; what they say, by file name.

        Where that fails the runs are safe all the same, and it is gathered again with the next one.
        """
        rows = {str(row["name"]): row for row in _rows(self.folder, known)}
        self._kept: int = sum(row["contributor"] == self.contributor for row in rows.values())
        try:
            with FileLock(self.folder / JOURNALS / "manifest.lock", timeout=10):
                manifest = manifest_of_runs(list(rows.values())) | {"split": _split_of(self.folder, rows)}
                write_atomically(self.folder / CARD, card(manifest).encode())
                write_tree(self.folder / MANIFEST, manifest)
        except (RecordError, Timeout) as error:
            if not rows:
                raise
            logger.warning("%s; it is brought up to date with the next run", error)
        return rows


def checked_name(contributor: str) -> str:
    """A contributor's name, without spaces around it.

    Raises:
        ConfigError: it is empty, very long, or no text that a file can hold.
    """
    name = contributor.strip()
    if not name or len(name) > LONGEST_NAME:
        said = f"has {len(name)} characters" if name else "is empty"
        raise ConfigError(
            f"the contributor's name {said}; give a name or a pseudonym of 1 to {LONGEST_NAME} characters"
        )
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
    if (folder / JOURNALS).is_dir():
        return  # people drove here; a manifest that is damaged is gathered again
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder)
        if manifest.get("mirrored"):
            raise RecordError(f"{folder} holds mirror images; choose another folder for people's runs")
        if not manifest["collected"]:
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


def _rows(folder: Path, known: dict[str, Tree]) -> Iterator[Tree]:
    """What to say of each run: as is known or listed; read anew where it is neither, or its size differs."""
    try:
        listed = {row["name"]: row for row in read_manifest(folder)["files"]} if (folder / MANIFEST).exists() else {}
    except RecordError as error:
        listed = {}
        logger.warning("%s; it is gathered again from the files", error)
    known = listed | known
    for path in sorted(folder.iterdir()):
        if (
            path.name in (MANIFEST, SCENARIO, METRICS, CROISSANT)
            or path.name.startswith(".")
            or not path.name.endswith(SUFFIXES)
        ):
            continue
        row = known.get(path.name)
        try:
            yield row if row is not None and row["bytes"] == path.stat().st_size else _row_of(path)
        except RecordError as error:
            logger.warning("%s; it is left out of the manifest", error)


def _split_of(folder: Path, rows: Iterable[str]) -> Tree | None:
    """The split of a folder, as long as it holds the runs that were split."""
    try:
        manifest = read_manifest(folder)
    except RecordError:
        return None
    split: Tree | None = manifest["split"]
    return split if {row["name"] for row in manifest["files"]} == set(rows) else None


def _row_of(path: Path) -> Tree:
    record = read_episode(path)
    return asdict(entry_of(record)) | {"contributor": record.contributor or "", "seed": record.seed}


def _head(path: Path) -> Tree | None:
    """What stands before the frames of a run in the bin; None if it cannot be read."""
    try:
        return head_of(read_bytes(path))
    except (RecordError, ValueError):
        return None
