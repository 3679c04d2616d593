"""The journal of a run in progress: with the scene, enough to recover every tick after a crash.

Each tick is one line, written to the disk cache at once, so that it survives the program. The file is forced to the
disk whenever the run pauses.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import orjson

from ..core.devices import DeviceEvent
from ..core.files.whole_file import sync_folder
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Outcome, Snapshot
from ..errors import RecordError
from ..record.canonical import to_json_value
from ..record.files import read_stored
from ..record.layout import JsonDict
from ..sim.inputs import TickInput

logger = logging.getLogger(__name__)

_HEADER_KEYS = {"settings", "seed", "episode", "physics", "controller", "contributor"}
UNDONE = "undone"  # key of the header: name of the kept file that the run was taken from


@dataclass(frozen=True, slots=True)
class OpenRun:
    """A run that was neither kept nor discarded.

    Attributes:
        header: settings, seed and controller, which reconstruct the episode.
        ticks: all recorded ticks.
        last_events: device events at the state that ended the run; None if it did not end.
        file_names: names of the episode files that the run was about to be written to.
        dropped_ticks: ticks of real time that were not simulated.
    """

    header: JsonDict
    ticks: list[TickInput]
    last_events: tuple[DeviceEvent, ...] | None
    file_names: list[str]
    dropped_ticks: int = 0


class Journal:
    """Observer that writes the run in progress; a write error does not stop the run, see `failure`.

    Lines that cannot be written are buffered and written with the next line, so that a journal has no gaps.

    Args:
        path: file of the journal.

    Attributes:
        failure: why the journal cannot be written at present; None if it can.
        dropped_ticks: written with the next tick, if there are any.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.dropped_ticks = 0
        self.failure: str | None = None
        self._file: BinaryIO | None = None
        self._size, self._buffer = 0, b""  # bytes of complete lines in the file; lines that are not written yet
        self._ticks_in_file = 0
        self._is_new = False  # whether the name of the file may not be on the disk yet
        self._is_open = False  # whether a run is in progress, written or not

    def begin(self, header: JsonDict) -> None:
        """Begin a run; a run in the file is deleted."""
        self.delete()
        self._is_open = True
        self._write(to_json_value(header, "journal", exact=True))

    def resume(self, ticks: int) -> None:
        """Continue the run in the file after `ticks` complete entries."""
        with self._catch_write_errors():
            self._size = len(self.path.read_bytes().rpartition(b"\n")[0]) + 1
            self._file = self.path.open("r+b", buffering=0)
            self._file.truncate(self._size)
        self._ticks_in_file, self._is_open = ticks, True

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        """Nothing to do: `begin` writes the header."""

    def on_frame(self, frame: Frame) -> None:
        """Write a tick, unless the file has it already."""
        if frame.snapshot.tick < self._ticks_in_file:
            return
        command = frame.command
        row: JsonDict = {"command": [command.vx, command.vy, command.omega], "events": _rows(frame.snapshot.events)}
        row |= {"dropped": self.dropped_ticks} if self.dropped_ticks else {}
        if frame.others:
            row["others"] = [
                [twist.vx, twist.vy, twist.omega, to_json_value(label, "label")] for twist, label in frame.others
            ]
        self._write(row if frame.label is None else row | {"label": to_json_value(frame.label, "label")})

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """Write the end of the run; the run stays in the journal until it is kept or discarded."""
        self._write({"last": _rows(last.events)})
        self.sync()

    def announce(self, name: str) -> None:
        """Write the name of the episode file that is about to be written; if that file exists, the run is complete."""
        self._write({"named": name})
        self.sync()

    def sync(self) -> None:
        """Force the file to the disk."""
        if self._file is not None:
            with self._catch_write_errors():
                os.fsync(self._file.fileno())
                if self._is_new:
                    sync_folder(self.path.parent)
                    self._is_new = False

    def shut(self) -> None:
        """Close the file; the run can be recovered from it."""
        self.sync()
        file, self._file, self._is_open = self._file, None, False
        if file is not None:
            with self._catch_write_errors():
                file.close()

    def delete(self) -> None:
        """Delete the file, because its run was kept or discarded."""
        self.shut()
        self.failure, self._ticks_in_file, self._size, self._buffer = None, 0, 0, b""
        with suppress(FileNotFoundError), self._catch_write_errors():
            self.path.unlink()

    def _write(self, row: JsonDict) -> None:
        """Write the buffered lines and one more, completely or not at all."""
        if not self._is_open:
            return
        self._buffer += orjson.dumps(row, option=orjson.OPT_APPEND_NEWLINE)
        with self._catch_write_errors():
            if self._file is None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self._file, self._is_new = self.path.open("wb", buffering=0), True
            self._file.seek(self._size)
            if self._file.write(self._buffer) < len(self._buffer):
                self._file.truncate(self._size)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._size, self._buffer, self.failure = self._size + len(self._buffer), b"", None

    @contextmanager
    def _catch_write_errors(self) -> Iterator[None]:
        """Turn an OSError, except for a missing file, into `failure`."""
        try:
            yield
        except FileNotFoundError:
            raise
        except OSError as error:
            if self.failure is None:
                logger.warning("%s cannot be written: %s", self.path, error.strerror or error)
            self.failure = f"the journal cannot be written: {error.strerror or error}"


def read_journal(path: Path) -> OpenRun | None:
    """The run in a journal; None if the file does not exist or has no tick.

    An incomplete last line, as after a crash, is ignored.

    Raises:
        RecordError: the file cannot be read or is not a journal.
    """
    if not path.exists():
        return None
    lines = read_stored(path).split(b"\n")
    try:
        header, *rows = list(_parsed(path, lines)) or [{}]
        ticks = [
            TickInput(Twist(*row["command"]), row.get("label"), _events(row["events"]), _others(row.get("others", ())))
            for row in rows
            if "command" in row
        ]
        last_events = [_events(row["last"]) for row in rows if "last" in row]
        if ticks and not header.keys() >= _HEADER_KEYS:
            raise KeyError("settings")
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path} is not the journal of a run ({error!r})") from error
    file_names = [str(row["named"]) for row in rows if "named" in row]
    dropped = [int(row["dropped"]) for row in rows if "dropped" in row]
    if not ticks:
        return None
    return OpenRun(header, ticks, last_events[-1] if last_events else None, file_names, max(dropped, default=0))


def _parsed(path: Path, lines: list[bytes]) -> Iterator[JsonDict]:
    for number, line in enumerate(lines, 1):
        try:
            if line:
                yield orjson.loads(line)
        except orjson.JSONDecodeError as error:
            if number >= len(lines) - 1:
                return
            raise RecordError(f"{path}, line {number} is damaged") from error


def _others(rows: Iterable[list[Any]]) -> tuple[tuple[Twist, Any], ...]:
    """Commands and labels of the other robots."""
    return tuple((Twist(vx, vy, omega), label) for vx, vy, omega, label in rows)


def _rows(events: Iterable[DeviceEvent]) -> list[list[Any]]:
    return [[event.device, event.control, event.value] for event in events]


def _events(rows: list[list[Any]]) -> tuple[DeviceEvent, ...]:
    return tuple(DeviceEvent(device, control, value) for device, control, value in rows)
