"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import uuid4

from ...errors import RecordError
from .locations import is_remote, location, put_file

TEMPORARY_PREFIX = ".sonata2d-"  # of the names of incomplete files


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a path to write to instead of `path`, in the same folder and with the same suffix.

    If `path` is in a store, it is a path of this machine, and the file is copied to the store.

    If the block ends without an exception, what was written becomes the file: at any moment either the old or the new
    content exists, even after a power failure. After an exception the file is as before.

    Raises:
        OSError: nothing was written, or it cannot become the file.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "a.txt"
    >>> with whole_file(path) as temporary:
    ...     _ = temporary.write_text("all of it")
    >>> path.read_text()
    'all of it'
    """
    path = location(path)
    if is_remote(path):
        with TemporaryDirectory(prefix="sonata2d-") as folder:
            copy = Path(folder) / f"new{path.suffix}"
            yield copy
            put_file(path, copy)
        return
    temporary = path.parent / f"{TEMPORARY_PREFIX}{uuid4().hex}{path.suffix}"
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to disk, which makes a rename durable; Windows neither needs nor supports it."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def delete_for_good(paths: Iterable[Path], folders: Iterable[Path]) -> None:
    """Delete files, so that a power cut brings none of them back, nor any that were deleted in the folders before.

    Raises:
        RecordError: a file cannot be deleted, or a folder cannot be flushed to disk.
    """
    place = Path()
    try:
        for place in paths:
            place.unlink()
        for place in folders:
            if place.is_dir():
                sync_folder(place)
    except OSError as error:
        raise RecordError(f"{place} cannot be deleted: {error.strerror}") from error
