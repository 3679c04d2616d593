"""The journal of a run that a person drives: with the scene, enough to have every tick again after a crash.

A line a tick goes to the disk's cache at once, so it outlives the program; it is forced to the disk when the run stands
still.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from ..core.devices import DeviceEvent
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Author, Frame, Outcome, Snapshot
from ..errors import RecordError
from ..record.canonical import plain
from ..record.layout import Tree

logger = logging.getLogger(__name__)

HEAD = {"settings", "seed", "episode", "physics", "controller", "contributor"}
Tick = tuple[Twist, Any, tuple[DeviceEvent, ...]]  # command, label, events


@dataclass(frozen=True, slots=True)
class OpenRun:
    """A run that was never put away.

    Attributes:
        head: what it takes to set it up again.
        ticks: all that was driven.
        last: what the person did at the look that ended it; None if it did not end.
        named: the files that it was going to be written to.
    """

    head: Tree
    ticks: list[Tick]
    last: tuple[DeviceEvent, ...] | None
    named: list[str]


class Journal:
    """An observer that writes one run as it is driven. A disk that takes no more does not stop the run: see `failure`.

    What the disk did not take is owed, and written as soon as it does, so that a journal never has a gap.

    Args:
        path: of the file.

    Attributes:
        failure: why the journal cannot be written now; None while all is well.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failure: str | None = None
        self._file: BinaryIO | None = None
        self._size, self._owed = 0, b""  # bytes that are whole on the disk, and those that are not
        self._noted = 0  # ticks that the file holds
        self._is_open = False  # a run is, whether or not the disk takes it

    def begin(self, head: Tree) -> None:
        """A run begins; one that the file holds is forgotten."""
        self.forget()
        self._is_open = True
        self._write(plain(head, "journal", exact=True))

    def go_on(self, ticks: int) -> None:
        """The run that the file holds goes on after so many ticks."""
        with self._noticing():
            self._size = len(self.path.read_bytes().rpartition(b"\n")[0]) + 1
            self._file = self.path.open("r+b", buffering=0)
            self._file.truncate(self._size)
        self._noted, self._is_open = ticks, True

    def open(self, scene: Scene, author: Author) -> None:
        """The head is noted by `begin`."""

    def note(self, frame: Frame) -> None:
        """One tick; those that the file holds are passed over."""
        if frame.snapshot.tick < self._noted:
            return
        command = frame.command
        row: Tree = {"command": [command.vx, command.vy, command.omega], "events": _rows_of(frame.snapshot.events)}
        self._write(row if frame.label is None else row | {"label": plain(frame.label, "label")})

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """The run ended; it is not put away yet."""
        self._write({"last": _rows_of(last.events)})
        self.sync()

    def announce(self, name: str) -> None:
        """The run is about to be written to a file of this name: if that is there, the run is put away."""
        self._write({"named": name})
        self.sync()

    def sync(self) -> None:
        """Force what is noted to the disk."""
        if self._file is not None:
            with self._noticing():
                os.fsync(self._file.fileno())

    def shut(self) -> None:
        """The program ends; the run stays open."""
        self.sync()
        file, self._file, self._is_open = self._file, None, False
        if file is not None:
            with self._noticing():
                file.close()

    def forget(self) -> None:
        """The run is put away: there is nothing left to recover."""
        self.shut()
        self.failure, self._noted, self._size, self._owed = None, 0, 0, b""
        with suppress(FileNotFoundError), self._noticing():
            self.path.unlink()

    def _write(self, row: Tree) -> None:
        """Write a line, and what is owed before it; the whole of it or nothing."""
        if not self._is_open:
            return
        self._owed += orjson.dumps(row, option=orjson.OPT_APPEND_NEWLINE)
        with self._noticing():
            if self._file is None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self._file = self.path.open("wb", buffering=0)
            self._file.seek(self._size)
            if self._file.write(self._owed) < len(self._owed):
                self._file.truncate(self._size)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._size, self._owed, self.failure = self._size + len(self._owed), b"", None

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
    try:
        head, *rows = list(_rows(path, lines)) or [{}]
        ticks = [
            (Twist(*_three(row["command"])), row.get("label"), _events(row["events"]))
            for row in rows
            if "command" in row
        ]
        last = [_events(row["last"]) for row in rows if "last" in row]
        if ticks and not head.keys() >= HEAD:
            raise KeyError("settings")
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path} is no journal of a run ({error!r})") from error
    named = [str(row["named"]) for row in rows if "named" in row]
    return OpenRun(head, ticks, last[-1] if last else None, named) if ticks else None


def _rows(path: Path, lines: list[bytes]) -> Iterator[Tree]:
    for number, line in enumerate(lines, 1):
        try:
            if line:
                yield orjson.loads(line)
        except orjson.JSONDecodeError as error:
            if number >= len(lines) - 1:
                return
            raise RecordError(f"{path}, line {number} is damaged") from error


def _rows_of(events: Iterable[DeviceEvent]) -> list[list[Any]]:
    return [[event.device, event.control, event.value] for event in events]


def _events(rows: list[list[Any]]) -> tuple[DeviceEvent, ...]:
    return tuple(DeviceEvent(device, control, value) for device, control, value in rows)


def _three(values: list[float]) -> tuple[float, float, float]:
    vx, vy, omega = values
    return vx, vy, omega
