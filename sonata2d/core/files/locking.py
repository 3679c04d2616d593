"""Locks of folders that only one program may write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import RecordError

if TYPE_CHECKING:
    from filelock import FileLock


def acquired_lock(path: Path, problem: str) -> FileLock:
    """Acquire the lock of a folder, which is created; the system releases it when the program ends, also after a crash.

    Args:
        path: of the lock file, in the folder.
        problem: message if another program holds the lock.

    Raises:
        RecordError: another program holds the lock, or the folder cannot be written.
    """
    from filelock import FileLock, Timeout  # takes as long to import as reading a data set

    lock = FileLock(path, timeout=0, thread_local=False)  # a server opens and closes it in different threads
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout:
        raise RecordError(problem) from None
    except OSError as error:
        raise RecordError(f"{path.parent} cannot be written: {error.strerror or error}") from error
    return lock
