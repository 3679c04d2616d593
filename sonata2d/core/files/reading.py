"""Reading of files within limits of size."""

from __future__ import annotations

import errno
from pathlib import Path

from .locations import content_of, is_remote


def read_at_most(path: Path, max_bytes: int, *, remedy: str = "divide it") -> bytes:
    """Read a file, or the pipe that a shell passes in its place, as in `<(command)`.

    A symbolic link is followed: the content is only read, within the same limits.

    Args:
        path: of the file.
        max_bytes: maximum size; more is never read.
        remedy: for a larger file, at the end of the message.

    Raises:
        OSError: it cannot be read, is larger, or is no file, see `require_readable`; `strerror` says which.
        ValueError: the path contains NUL.
    """
    if is_remote(path):
        data = content_of(path, 0, max_bytes + 1)
    else:
        require_readable(path)
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"it has more than {max_bytes} bytes, the limit for such files; {remedy}")
    return data


def require_readable(path: Path) -> None:
    """Require that a path, if it exists, is a file or the pipe of a shell.

    Raises:
        OSError: it is a folder, a device or a named pipe; `strerror` says which, also on Windows, where opening a
            folder is a lack of permission.
        ValueError: the path contains NUL.
    """
    if is_remote(path):
        return
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "it is a folder; name a file in it")
    if path.is_char_device() or path.is_block_device():
        raise OSError(errno.EINVAL, "it is a device, not a file")  # /dev/zero has no end
    if path.is_fifo() and not is_shell_pipe(path):
        raise OSError(errno.EINVAL, "it is a named pipe, not a file")  # opening it waits for a writer


def is_shell_pipe(path: Path) -> bool:
    """Whether a path is a pipe by which a shell passes the output of another program."""
    return path.is_fifo() and any(map(path.is_relative_to, ("/dev/fd", "/dev/stdin", "/proc")))
