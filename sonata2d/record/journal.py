"""The journal of a run that a person drives: with the scene, enough to have every tick again after a crash.

A line a tick goes to the disk's cache at once, so it outlives the program; it is forced to the disk when the run stands
still.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from ..entities import Scene
from ..errors import RecordError
from ..frame import Author, Frame, Outcome, Snapshot
from ..geometry import Twist
from ..topics import DeviceEvent
from .canonical import plain
from .layout import Tree

logger = logging.getLogger(__name__)

Tick = tuple[Twist, Any, tuple[DeviceEvent, ...]]  # command, label, events


@dataclass(frozen=True, slots=True)
class OpenRun:
    """A run that was never kept nor discarded.

    Attributes:
        head: what it takes to set it up again.
        ticks: all that was driven.
    """

    head: Tree
    ticks: list[Tick]


class Journal:
    """An observer that writes one run as it is driven. A disk that takes no more does not stop the run: see `failure`.

    Args:
        path: of the file.

    Attributes:
        failure: why the journal could not be written; None while all is well.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failure: str | None = None
        self._file: BinaryIO | None = None
        self._noted = 0  # ticks that the file holds

    def begin(self, head: Tree) -> None:
        """A run begins; one that the file holds is forgotten."""
        self.forget()
        with self._noticing():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("wb", buffering=0)
        self._write(plain(head, "journal", exact=True))

    def go_on(self, ticks: int) -> None:
        """The run that the file holds goes on after so many ticks."""
        with self._noticing():
            whole = self.path.read_bytes().rpartition(b"\n")[0] + b"\n"
            self._file = self.path.open("r+b", buffering=0)
            self._file.truncate(len(whole))
            self._file.seek(0, os.SEEK_END)
        self._noted = ticks

    def open(self, scene: Scene, author: Author) -> None:
        """The head is noted by `begin`."""

    def note(self, frame: Frame) -> None:
        """One tick; those that the file holds are passed over."""
        if frame.snapshot.tick < self._noted:
            return
        command = frame.command
        events = [[event.device, event.control, event.value] for event in frame.snapshot.events]
        row: Tree = {"command": [command.vx, command.vy, command.omega], "events": events}
        self._write(row if frame.label is None else row | {"label": plain(frame.label, "label")})

    def sync(self) -> None:
        """Force what is noted to the disk."""
        if self._file is not None:
            with self._noticing():
                os.fsync(self._file.fileno())

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """The run ended; it is not put away yet."""
        self.sync()

    def shut(self) -> None:
        """The program ends; the run stays open."""
        self.sync()
        file, self._file = self._file, None
        if file is not None:
            with self._noticing():
                file.close()

    def forget(self) -> None:
        """The run is put away: there is nothing left to recover."""
        self.shut()
        self.failure, self._noted = None, 0
        with suppress(FileNotFoundError), self._noticing():
            self.path.unlink()

    def _write(self, row: Tree) -> None:
        if self._file is not None:
            with self._noticing():
                self._file.write(orjson.dumps(row, option=orjson.OPT_APPEND_NEWLINE))

    def _noticing(self) -> _Noticing:
        return _Noticing(self)


class _Noticing:
    """Turns what goes wrong with the disk into the journal's `failure`."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal

    def __enter__(self) -> None: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> bool:
        if not isinstance(error, OSError) or isinstance(error, FileNotFoundError):
            return False
        if self._journal.failure is None:
            logger.warning("%s cannot be written: %s", self._journal.path, error.strerror or error)
        self._journal.failure = f"the journal cannot be written: {error.strerror or error}"
        return True


def read_journal(path: Path) -> OpenRun | None:
    """The run that a journal holds; None if there is none with a tick.

    A last line that was cut short, as by a crash, is left out.

    Raises:
        RecordError: it cannot be read, or is no journal.
    """
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from error
    rows = list(_rows(path, lines))
    if len(rows) < 2:
        return None
    try:
        return OpenRun(rows[0], [_tick(row) for row in rows[1:]])
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path} is no journal of a run ({error!r}); move it away to go on") from error


def _rows(path: Path, lines: list[bytes]) -> Iterator[Tree]:
    for number, line in enumerate(lines, 1):
        try:
            if line:
                yield orjson.loads(line)
        except orjson.JSONDecodeError as error:
            if number >= len(lines) - 1:
                return
            raise RecordError(f"{path}, line {number} is damaged; move the file away to go on") from error


def _tick(row: Tree) -> Tick:
    events = tuple(DeviceEvent(device, control, value) for device, control, value in row["events"])
    vx, vy, omega = row["command"]
    return Twist(vx, vy, omega), row.get("label"), events
