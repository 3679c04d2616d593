"""Files of lines, each a JSON object with a `version`; programs add a line at a time, and a crash loses none."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import orjson

from ..core.files.whole_file import sync_folder
from ..errors import NewerFormatError, RecordError
from ..record.files import read_bytes

T = TypeVar("T")
logger = logging.getLogger(__name__)


def append_line(path: Path, row: Mapping[str, Any], mode: int = 0o666) -> None:
    """Add a line to a file; on return it is on the disk. An incomplete last line is removed before.

    Args:
        path: of the file; it and its folder are created if they do not exist.
        row: the JSON object.
        mode: permissions of a new file.

    Raises:
        RecordError: the file cannot be written; the line can be added again.
    """
    data = orjson.dumps(row, option=orjson.OPT_APPEND_NEWLINE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        is_new = not path.exists()
        with open(path, "ab+", buffering=0, opener=partial(os.open, mode=mode)) as file:
            if is_new:  # before the line is written: a line that may be there must not raise an error
                _sync_name(path)
            _repair_last_line(path, file)
            size = file.seek(0, os.SEEK_END)
            try:
                if file.write(data) < len(data):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())
            except OSError:
                file.truncate(size)  # half a line would spoil the next one
                raise
    except OSError as error:
        raise RecordError(f"{path} cannot be written: {error.strerror or error}") from error


def _sync_name(path: Path) -> None:
    """Flush the name of a new file to disk; if that fails, the file is removed, so that it is new the next time."""
    try:
        sync_folder(path.parent)
    except OSError:
        with suppress(OSError):
            path.unlink()
        raise


def read_lines(path: Path, version: int, parse: Callable[[dict[str, Any]], T], thing: str) -> list[T]:
    """The rows of a file in their order.

    An incomplete last line, as after a power cut, is ignored with a warning in the log.

    Args:
        path: of the file, which a program may be writing.
        version: the newest one that can be read.
        parse: converts a row; raises KeyError, TypeError, ValueError or OverflowError if it cannot.
        thing: meaning of a line for messages, such as "a rating".

    Raises:
        RecordError: the file cannot be read, or a line is damaged; the message names the line.
        NewerFormatError: a line was written by a newer version.
    """
    lines = read_bytes(path).split(b"\n")
    tail = lines.pop()
    if _is_incomplete(tail):
        logger.warning("%s: line %d is incomplete and is ignored: %r", path, len(lines) + 1, tail[:60])
    elif tail:
        lines.append(tail)
    rows = []
    for number, line in enumerate(lines, 1):
        place = f"{path}, line {number}"
        try:
            row = orjson.loads(line)
            if not isinstance(row, dict):
                raise TypeError(f"it is a JSON {type(row).__name__}")
            if not isinstance(row["version"], int) or row["version"] < 1:
                raise ValueError(f"version is {row['version']!r}")
            if row["version"] > version:
                remedy = f"this sonata2d reads up to {version}; upgrade sonata2d"
                raise NewerFormatError(f"{place} was written by version {row['version']}, {remedy}")
            rows.append(parse(row))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            reason = f"{error} is missing" if isinstance(error, KeyError) else error
            raise RecordError(f"{place} is not {thing}: {reason}; correct or remove that line") from error
    return rows


def _repair_last_line(path: Path, file: BinaryIO) -> None:
    """Remove an incomplete last line, or add a missing line end, so that the next line begins on its own."""
    file.seek(0)
    data = file.read()
    tail = data[data.rfind(b"\n") + 1 :]
    if _is_incomplete(tail):
        logger.warning("%s: the last line is incomplete and is removed: %r", path, tail[:60])
        file.truncate(len(data) - len(tail))
    elif tail:
        file.write(b"\n")


def _is_incomplete(tail: bytes) -> bool:
    """Whether a line was cut short: a JSON object is invalid without its closing brace."""
    try:
        orjson.loads(tail or b"{}")
    except orjson.JSONDecodeError:
        return True
    return False
