"""Episodes in tar files, the shards of large data sets: the layout of WebDataset, with access to any member.

A path inside a tar file names a member: `demo/shard-000000.tar/000007.json`. Beside each shard lies its manifest, whose
rows say where in the file each member begins; a tar file without a manifest is searched for its members.
"""

from __future__ import annotations

import hashlib
import os
import re
import tarfile
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import IO, NamedTuple, Self

import orjson

from ..core.files.locations import content_of, explained, is_remote, put_file, version_of
from ..core.files.whole_file import sync_folder
from ..core.wording import shown
from ..errors import RecordError

SHARD_SUFFIX = ".tar"
SHARD_MANIFEST_SUFFIX = ".manifest.json"
_BLOCK = tarfile.BLOCKSIZE
_WITHOUT_CONTENT = {
    tarfile.LNKTYPE, tarfile.SYMTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE, tarfile.FIFOTYPE, tarfile.DIRTYPE,
}  # fmt: skip
_REGULAR = {tarfile.REGTYPE, tarfile.AREGTYPE, tarfile.CONTTYPE}  # not sparse files, as in `tarfile.REGULAR_TYPES`
_PAX_KEYS = re.compile(rb"\d (path|linkpath|size|GNU\.sparse[^=]*)=")
_MAX_PAX_HEADER = 1 << 16  # bytes
_REPACK = "pack regular files with `tar --format=ustar`"
_MAX_OFFSET = 1 << 62  # bytes, that a file can have
_APART = 4  # members are read one by one if the range from first to last has over 4 times their bytes
_INDEXES = 128  # number of shards whose index stays in memory: 40 MB for shards of 1000 episodes


class Extent(NamedTuple):
    """Position and length of the content of a member in its tar file, bytes."""

    offset: int
    size: int


def is_shard(path: Path) -> bool:
    """Whether a path names an existing tar file."""
    return path.name.endswith(SHARD_SUFFIX) and path.is_file()


def is_member(path: Path) -> bool:
    """Whether a path names a member of a tar file, which need not exist."""
    return path.parent.name.endswith(SHARD_SUFFIX) and path.parent.is_file()


def shard_manifest_path(shard: Path) -> Path:
    """Path of the manifest beside a shard."""
    return shard.with_name(shard.name.removesuffix(SHARD_SUFFIX) + SHARD_MANIFEST_SUFFIX)


def read_member(path: Path, max_bytes: int) -> bytes:
    """The content of a member.

    Args:
        path: of the member.
        max_bytes: maximum size.

    Raises:
        OSError: there is no such member, it is larger, or the tar file cannot be read or is shorter than it should be.
    """
    return _content(path.parent, _extent(path.parent, extents(path.parent), path.name, max_bytes))


def read_members(shard: Path, names: Sequence[str], max_bytes: int) -> list[bytes]:
    """The contents of members of a tar file in a store, which are read at once if they lie together.

    Args:
        shard: the tar file.
        names: of the members.
        max_bytes: maximum size of each.

    Raises:
        RecordError: it cannot be read, or a member is larger.
    """
    with explained(shard, "read"):
        known = extents(shard)
        members = [_extent(shard, known, name, max_bytes) for name in names]
        first = min(extent.offset for extent in members)
        last = max(extent.offset + extent.size for extent in members)
        if last - first > _APART * sum(extent.size + _BLOCK for extent in members):
            return [_content(shard, extent) for extent in members]
        data = content_of(shard, first, last)
        starts = ((extent, extent.offset - first) for extent in members)
        return [_whole(data[start : start + extent.size], extent) for extent, start in starts]


def _extent(shard: Path, known: Mapping[str, Extent], name: str, max_bytes: int) -> Extent:
    """The extent of a member, by the extents of all members.

    Raises:
        OSError: there is no such member, or it is larger than `max_bytes`.
    """
    extent = known.get(name)
    if extent is None:
        raise FileNotFoundError(2, f"{shard.name} has no member {name}")
    if extent.size > max_bytes:
        raise OSError(27, f"{name} has more than {max_bytes} bytes, the limit for such files")
    return extent


def _content(shard: Path, extent: Extent) -> bytes:
    """The bytes of a tar file that belong to a member.

    Raises:
        OSError: the file cannot be read, or ends before them.
    """
    if is_remote(shard):
        return _whole(content_of(shard, extent.offset, extent.offset + extent.size) if extent.size else b"", extent)
    with shard.open("rb") as file:
        file.seek(extent.offset)
        return _whole(file.read(extent.size), extent)


def _whole(data: bytes, extent: Extent) -> bytes:
    if len(data) < extent.size:
        raise OSError(5, "the tar file ends within it")
    return data


def members_of(shard: Path) -> list[str]:
    """The names of the members that a tar file holds, in their order; its manifest is not used.

    Raises:
        RecordError: the file cannot be read, or a fault leaves no member, see `contents_of`.
    """
    names, faults = contents_of(shard)
    if faults and not names:
        raise RecordError(f"{shard} cannot be read: {faults[0]}")
    return names


def contents_of(shard: Path) -> tuple[list[str], list[str]]:
    """The names of the members of a tar file, and its faults: it is none or is cut, or holds what is not read.

    Raises:
        RecordError: the file cannot be read.
    """
    with explained(shard, "read"):
        entries = list(_entries(shard))
    faults = [entry for entry in entries if isinstance(entry, str)]
    return [entry[0] for entry in entries if not isinstance(entry, str)], faults


def extents(shard: Path) -> Mapping[str, Extent]:
    """The extent of each member of a tar file, by name, in their order.

    Raises:
        OSError: the tar file, or the manifest beside it, cannot be read.
    """
    return _extents(shard, _version(shard))


def _version(shard: Path) -> str:
    """A text that changes if a tar file is written again.

    Raises:
        OSError: there is no such file.
    """
    if is_remote(shard):
        return version_of(shard)
    status = shard.stat()
    return f"{status.st_size} {status.st_mtime_ns}"


@lru_cache(maxsize=_INDEXES)
def _extents(shard: Path, version: str) -> Mapping[str, Extent]:
    index = shard_manifest_path(shard)
    listed: dict[str, Extent] = {}
    if index.is_file():
        try:
            content = content_of(index) if is_remote(index) else index.read_bytes()
            for row in orjson.loads(content)["files"]:
                listed[row["name"]] = Extent(int(row["offset"]), int(row["bytes"]))
            if all(0 <= extent.offset < _MAX_OFFSET and extent.size >= 0 for extent in listed.values()):
                return MappingProxyType(listed)
        except (
            KeyError,
            OverflowError,
            TypeError,
            ValueError,
        ):  # damaged, as `check` says; the members are still there
            pass
    return MappingProxyType(dict(entry for entry in _entries(shard) if not isinstance(entry, str)))


def _entries(shard: Path) -> Iterator[tuple[str, Extent] | str]:
    """Names and extents of the whole regular members of a tar file, which may end abruptly, and texts about faults."""
    names: set[str] = set()
    is_renamed = False  # the next member, by a header before it
    with shard.open("rb") as file:
        end, position = file.seek(0, os.SEEK_END), 0
        while True:
            file.seek(position)
            block = file.read(_BLOCK)
            if len(block) < _BLOCK or not any(block):
                yield from _faults_at_end(file, block, position)
                return
            try:
                info = tarfile.TarInfo.frombuf(block, "utf-8", "strict")
            except (tarfile.HeaderError, ValueError):
                yield f"it has no header of a tar file at byte {position}" if position else "it is not a tar file"
                return
            position += _BLOCK
            size = 0 if info.type in _WITHOUT_CONTENT else info.size
            name = info.name.removeprefix("./")
            if size < 0:  # the next header would lie before this one
                yield f"{shown(name)} has a negative size, {size}"
                return
            if position + size > end:
                yield f"it ends within {shown(name)}"
                return
            if info.type in _REGULAR:
                if name in names:
                    yield f"it holds {shown(name)} twice"
                if "/" in name:
                    if ".json" in name:
                        yield f"{shown(name)} lies in a folder, which is not read; pack the files without their folder"
                elif not is_renamed:
                    yield name, Extent(position, size)
                names.add(name)
                is_renamed = False
            elif info.type in (tarfile.XHDTYPE, tarfile.XGLTYPE):  # times and owners, or a name or size
                is_renamed = size > _MAX_PAX_HEADER or _PAX_KEYS.search(file.read(size)) is not None
                if is_renamed:
                    yield f"it holds a member with a name or size in a pax header, which is not read; {_REPACK}"
            elif info.type == tarfile.GNUTYPE_LONGNAME:
                is_renamed = True
                yield f"it holds a member with a long name of GNU tar, which is not read; {_REPACK}"
            elif not info.isdir():
                kind = "link" if info.issym() or info.islnk() else f"member of type {info.type.decode('latin-1')!r}"
                yield f"{shown(name)} is a {kind}, which is not read; {_REPACK}"
            position += -(-size // _BLOCK) * _BLOCK


def _faults_at_end(file: IO[bytes], block: bytes, position: int) -> Iterator[str]:
    """Faults of what follows the last member: two blocks of zeros, and any number of zeros after them."""
    if not position and not block:
        yield "it is empty"
    elif len(block) < _BLOCK or len(second := file.read(_BLOCK)) < _BLOCK:
        yield "it has no end mark, two blocks of zeros: it was cut" if position else "it is not a tar file"
    elif any(second) or any(piece != bytes(len(piece)) for piece in iter(partial(file.read, 1 << 20), b"")):
        yield "data follow its end mark, which are not read; `tar --concatenate` joins tar files"


class ShardWriter:
    """Writer of a tar file, which gets its name when it is complete; the same members in order give the same bytes.

    A context manager. If it ends before `finish`, what was written stays in the unfinished file, unless that is empty.

    Args:
        path: of the tar file.
        part: of the unfinished file, in the same folder. If that is in a store, the unfinished file is on this machine
            until it is complete, and does not stay.

    Attributes:
        size: bytes written so far.

    Raises:
        RecordError: a file cannot be written; likewise of the methods.
    """

    def __init__(self, path: Path, part: Path) -> None:
        self._path, self._part = path, part
        self._hash = hashlib.sha256()
        self.size = 0
        self._is_remote = is_remote(path)
        with explained(path, "written"):
            if self._is_remote:
                self._part = Path(tempfile.mkdtemp(prefix="sonata2d-")) / path.name
            self._file = self._part.open("wb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._file.close()
        if not self.size or self._is_remote:
            self._part.unlink(missing_ok=True)
        if self._is_remote:
            with suppress(OSError):
                self._part.parent.rmdir()

    def add(self, name: str, data: bytes) -> int:
        """Append a member, and return the offset of its content in the file, bytes."""
        info = tarfile.TarInfo(name)
        info.size = len(data)  # the other fields have fixed values: mode 644, no owner, time 0
        try:
            header = info.tobuf(tarfile.USTAR_FORMAT)
        except ValueError as error:
            raise RecordError(
                f"{self._path}: {name} cannot be its member ({error}); give the file a shorter name"
            ) from error
        with explained(self._path, "written"):
            self._write(header)
            offset = self.size
            self._write(data)
            self._write(bytes(-len(data) % _BLOCK))
            self._file.flush()  # what is written stays if this process is killed
        return offset

    def discard(self) -> None:
        """Remove what was written."""
        with suppress(OSError):
            self._file.close()
        self._part.unlink(missing_ok=True)

    def finish(self) -> str:
        """Write the end of the archive, give the file its name, and return its SHA-256, hexadecimal digits."""
        end = self.size + 2 * _BLOCK
        with explained(self._path, "written"):
            self._write(bytes(2 * _BLOCK + -end % tarfile.RECORDSIZE))
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
            if self._is_remote:
                put_file(self._path, self._part)
            else:
                os.replace(self._part, self._path)
                sync_folder(self._path.parent)
        return self._hash.hexdigest()

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._hash.update(data)
        self.size += len(data)
