"""Files and folders on this machine, and in stores that fsspec knows, such as S3 and Google Cloud Storage.

Paths in stores are paths of universal-pathlib, which have the methods of `pathlib.Path`. Objects of a store appear
whole or not at all; a file on this machine, or on a file server, is written under another name and then renamed.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, cast

from ...errors import RecordError

_URL = re.compile(r"(?P<protocol>[A-Za-z][A-Za-z0-9+.-]+)://")
_OBJECT_STORES = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci", "memory", "hf"}
_reached: set[str] = set()  # stores that have answered


def location(path: str | os.PathLike[str]) -> Path:
    """The path of a file or folder.

    Args:
        path: on this machine; or a URL such as `s3://bucket/folder`, as text or as a path of universal-pathlib.

    Returns:
        A `pathlib.Path`, or a path of universal-pathlib, which has the same methods.

    Raises:
        ValueError: fsspec does not know the protocol of the URL, or a package that it needs is not installed.

    >>> location("demo")
    PosixPath('demo')
    >>> location("memory://demo/000000.json").name
    '000000.json'
    """
    if isinstance(path, str) and (url := _URL.match(path)):
        return _in_store(path, url["protocol"].lower())
    return cast(Path, path) if is_location(path) else Path(path)


def _in_store(url: str, protocol: str) -> Path:
    if protocol in ("file", "local"):
        return Path(url.partition("://")[2])
    try:
        from upath import UPath
    except ImportError as error:
        raise ValueError(
            f"{url} is in a store, which needs universal-pathlib: pip install 'sonata2d[stores]'"
        ) from error
    # other workers write to object stores as well, so that a listing is soon out of date
    options: dict[str, Any] = {"use_listings_cache": False} if protocol in _OBJECT_STORES - {"memory"} else {}
    try:
        remote = UPath(url, **options)
        _ = remote.fs
    except ImportError as error:  # its text names the package
        raise ValueError(f"{url} needs a package that is not installed ({error})") from error
    except ValueError as error:
        raise ValueError(
            f"{url}: fsspec knows no protocol {protocol!r}; use a path, or s3://, gs:// or another"
        ) from error
    remote.fs.invalidate_cache()  # some stores keep listings in spite of the option
    _require_reachable(remote, protocol)
    return cast(Path, remote)


def _require_reachable(path: Any, protocol: str) -> None:
    """Ask a store once for the folder that all its paths are in, so that missing credentials are one clear error.

    Raises:
        ValueError: it does not answer.
    """
    place = f"{protocol}://{path.path.split('/')[0]}"
    if protocol == "memory" or place in _reached:
        return
    try:
        path.fs.info(path.path)
    except OSError:  # there is no such object, or no access to it: the store answers
        pass
    except Exception as error:  # each store has errors of its own
        raise ValueError(
            f"{place} cannot be reached ({type(error).__name__}: {error}); credentials and the address of the store "
            "are set as its package says, such as AWS_ACCESS_KEY_ID and AWS_ENDPOINT_URL, or HF_TOKEN"
        ) from error
    _reached.add(place)


def is_location(value: object) -> bool:
    """Whether a value is a path, on this machine or in a store."""
    return isinstance(value, Path) or is_remote(value)


def is_remote(path: object) -> bool:
    """Whether a path is in a store, and not in the file system of this machine."""
    return not isinstance(path, Path) and hasattr(path, "protocol") and hasattr(path, "storage_options")


def is_read_only(path: Path) -> bool:
    """Whether a path is in a repository of Hugging Face, in which each file that is written would be a commit."""
    remote: Any = path
    return is_remote(path) and remote.protocol == "hf" and not remote.path.startswith("buckets/")


def make_folder(folder: Path) -> None:
    """Make a folder of this machine and its parent folders; a store has no folders.

    Raises:
        OSError: it cannot be made.
    """
    if not is_remote(folder):
        folder.mkdir(parents=True, exist_ok=True)


def file_names(folder: Path) -> list[str]:
    """The names of the files in a folder, in no particular order; empty if there is no such folder."""
    if is_remote(folder):
        remote: Any = folder
        try:
            entries = remote.fs.ls(remote.path, detail=True)
        except FileNotFoundError:
            return []
        names = (entry["name"].rstrip("/").rpartition("/")[2] for entry in entries if entry["type"] == "file")
        return [name for name in names if name and name != folder.name]
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in entries if entry.is_file()]
    except (FileNotFoundError, NotADirectoryError):
        return []


def content_of(path: Path, start: int | None = None, end: int | None = None) -> bytes:
    """The content of an object in a store, or a part of it.

    Args:
        path: of the object.
        start, end: first byte, and the one after the last; None: all.

    Raises:
        OSError: it cannot be read.
    """
    remote: Any = path
    with _os_errors():
        data: bytes = remote.fs.cat_file(remote.path, start=start, end=end)
    return data


@contextmanager
def explained(path: Path, action: Literal["read", "written", "deleted"], *more: type[Exception]) -> Iterator[None]:
    """Turn an error of reading, writing or deleting a file into a RecordError that names it.

    Args:
        path: of the file.
        action: of the block, for the message.
        more: classes of errors besides OSError, EOFError and ValueError.

    >>> with explained(Path("a.json"), "read"):
    ...     raise FileNotFoundError(2, "No such file or directory")
    Traceback (most recent call last):
    sonata2d.errors.RecordError: a.json cannot be read: No such file or directory
    """
    kinds: tuple[type[Exception], ...] = (OSError, EOFError, ValueError, *more)  # ValueError: NUL in the path
    try:
        yield
    except kinds as error:
        raise RecordError(f"{path} cannot be {action}: {getattr(error, 'strerror', None) or error}") from error


def delete(path: Path) -> None:
    """Delete a file, if it exists.

    Raises:
        RecordError: it cannot be deleted.
    """
    with explained(path, "deleted"):
        _require_writable(path)
        path.unlink(missing_ok=True)


@contextmanager
def _os_errors() -> Iterator[None]:
    """Turn the errors of a store, whose package has its own classes of errors, into OSError."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        raise OSError(5, f"{type(error).__name__}: {error}") from error


def version_of(path: Path) -> str:
    """A text that changes if an object of a store is written again, as far as the store reports it.

    Raises:
        OSError: there is no such object, or it cannot be read.
    """
    remote: Any = path
    with _os_errors():
        return str(remote.fs.ukey(remote.path))


def put_content(path: Path, data: bytes) -> None:
    """Write an object of a store, or a file of a server, whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    _put(path, lambda fs, name: fs.pipe_file(name, data))


def put_file(path: Path, source: Path) -> None:
    """Copy a file of this machine into a store, whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    _put(path, lambda fs, name: fs.put_file(str(source), name))


def _require_writable(path: Path) -> None:
    """Require that files of a folder can be written.

    Raises:
        OSError: they cannot.
    """
    if is_read_only(path):
        message = "it is in a repository, which is read only; write on this machine, then use `sonata2d push`"
        raise OSError(errno.EROFS, message)


def _put(path: Path, write: Any) -> None:
    remote: Any = path
    _require_writable(path)
    with _os_errors():
        if remote.protocol in _OBJECT_STORES:  # whose objects appear whole or not at all
            write(remote.fs, remote.path)
            return
        temporary = path.with_name(f".sonata2d-{os.urandom(16).hex()}")
        remote.fs.makedirs(remote.parent.path, exist_ok=True)
        write(remote.fs, cast(Any, temporary).path)
        remote.fs.mv(cast(Any, temporary).path, remote.path)
