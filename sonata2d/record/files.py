"""Files of episodes: their names, compression, checked reading and atomic writing; also of members of tar files."""

from __future__ import annotations

import gzip
import hashlib
import io
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..core.files.limits import MAX_FILE_BYTES, MAX_UNPACKED_RATIO, MAX_UNPACKED_WITHOUT_RATIO
from ..core.files.locations import explained, is_remote, put_content
from ..core.files.reading import read_at_most, require_readable
from ..core.files.whole_file import whole_file
from ..errors import RecordError
from .canonical import PART, Document
from .shard_file import extents, is_member, read_member

SUFFIXES = (".json", ".json.gz", ".json.zst")
_RESERVED_NAME = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)  # device names on Windows


def file_suffix(path: Path) -> str:
    """Return the element of `SUFFIXES` that a file name ends with.

    Raises:
        RecordError: the name has none of these suffixes.
    """
    for suffix in SUFFIXES:
        if path.name.endswith(suffix) and path.name != suffix:
            return suffix
    raise RecordError(f"{path}: an episode file ends in {', '.join(SUFFIXES)}")


def file_stem(path: Path) -> str:
    """Return the file name without its suffix.

    Raises:
        RecordError: the name has none of `SUFFIXES`.
    """
    return path.name.removesuffix(file_suffix(path))


def safe_name(contributor: str, when: datetime, id: str, suffix: str = ".json") -> str:
    """Create a name for the file of a contributor's run: `{contributor}__{UTC time}__{id}{suffix}`, valid everywhere.

    >>> safe_name("Zoë / lab", datetime(2025, 1, 2, 3, 4, 5, tzinfo=UTC), "run:1")
    'Zoë_lab-ce958c__20250102T030405Z__run_1.json'
    """
    return f"{safe_stem(contributor)}__{when.astimezone(UTC):%Y%m%dT%H%M%SZ}__{safe_text(id)}{suffix}"


def safe_stem(name: str) -> str:
    """Convert a name to a unique part of a file name; distinct names stay distinct, even where case is ignored.

    >>> safe_stem("zoe"), safe_stem("Zoe")
    ('zoe', 'Zoe-458556')
    """
    safe = safe_text(name)
    if safe == name and name == name.casefold():
        return safe
    return f"{safe}-{hashlib.sha256(name.encode()).hexdigest()[:6]}"


def safe_text(text: str) -> str:
    """Convert text to letters, digits, dashes, dots and underscores; at most 80 bytes, and never a device name."""
    clean = re.sub(r"[^\w.-]+", "_", text)
    clean = re.sub(r"_+", "_", clean).strip("._-")
    clean = clean.encode()[:80].decode(errors="ignore").rstrip("._-") or "unnamed"
    return f"_{clean}" if _RESERVED_NAME.match(clean) else clean


def safe_texts(texts: Sequence[str]) -> list[str]:
    """Convert each text as `safe_text` does; results that would be equal, ignoring case, get a hash appended.

    >>> safe_texts(["runs/a.npz", "b/c", "b_c"])
    ['runs_a.npz', 'b_c-b9e2be', 'b_c']
    """
    counts = Counter(safe_text(text).casefold() for text in texts)
    return [safe_text(text) if counts[safe_text(text).casefold()] == 1 else safe_stem(text) for text in texts]


def compress(document: bytes, path: Path) -> bytes:
    """Compress a document as the suffix of `path` requires; equal documents give equal bytes."""
    return b"".join(compressed([document], len(document), path))


def compressed(parts: Iterable[bytes], size: int, path: Path) -> Iterator[bytes]:
    """Compress a document in parts as the suffix of `path` requires; equal documents give equal bytes.

    Args:
        parts: of the document.
        size: of all of them, bytes.
        path: of the file.
    """
    suffix = file_suffix(path)
    if suffix == ".json":
        yield from parts
        return
    if suffix == ".json.zst":
        import zstandard  # only where it is used: a page in a browser loads no more than it needs

        stream: Any = zstandard.ZstdCompressor(level=3, write_checksum=True).compressobj(size=size)
    else:
        stream = zlib.compressobj(6, wbits=31)  # as gzip, without a time
    # The parts are cut anew, so that the bytes do not depend on how the document came in parts.
    waiting = b""
    for part in parts:
        waiting += part
        whole = len(waiting) // PART * PART
        for start in range(0, whole, PART):
            yield stream.compress(waiting[start : start + PART])
        waiting = waiting[whole:]
    yield stream.compress(waiting) + stream.flush()


def write_atomically(path: Path, data: bytes | Iterable[bytes]) -> None:
    """Write a file so that at any moment either the old or the new content exists, even after a power failure.

    Missing folders are created.

    Args:
        path: of the file.
        data: its content, whole or in parts.

    Raises:
        RecordError: the file cannot be written; no partial file remains.
    """
    parts = [data] if isinstance(data, bytes) else data
    with explained(path, "written"):
        if is_remote(path):
            put_content(path, b"".join(parts))
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary, temporary.open("wb") as file:
            file.writelines(parts)


def write_document(path: Path, document: Document) -> None:
    """Write a document to an episode file, compressed as the suffix of `path` requires; see `write_atomically`."""
    write_atomically(path, compressed(document.parts(), document.size, path))


def episode_key(files: Sequence[Path]) -> Callable[[Path], str]:
    """Return a function that gives each file a unique text: its stem, with the name of its folder if stems repeat.

    Files of one folder that differ in their suffix only have the same text.

    >>> episode_key([Path("a/000000.json"), Path("a/000001.json")])(Path("a/000001.json"))
    '000001'
    >>> episode_key([Path("a/000000.json"), Path("b/000000.json")])(Path("b/000000.json"))
    'b/000000'
    """
    return file_stem if _distinct(file_stem, files) or not _distinct(_key_with_folder, files) else _key_with_folder


def _key_with_folder(file: Path) -> str:
    return f"{file.parent.name}/{file_stem(file)}"


def _distinct(key: Callable[[Path], str], files: Sequence[Path]) -> bool:
    """Whether a function gives each file a unique text; 8-byte hashes are compared, since there may be millions."""
    digests = (int.from_bytes(hashlib.blake2b(key(file).encode(), digest_size=8).digest()) for file in files)
    hashes = np.fromiter(digests, np.uint64)
    return len(np.unique(hashes)) == len(hashes)


def read_bytes(path: Path, *, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Read and decompress a file. The compression is detected from the first bytes, not from the name.

    Args:
        path: of the file.
        max_bytes: maximum size of the file and of its decompressed content; decompression stops there.

    Raises:
        RecordError: the file cannot be read or decompressed, is larger than `max_bytes`, or unpacks to more than
            `limits.MAX_UNPACKED_RATIO` times its size.
    """
    return unpacked(read_stored(path, max_bytes=max_bytes), path, max_bytes=max_bytes)


def unpacked(data: bytes, path: Path, *, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Decompress the content of a file, see `read_bytes`.

    Args:
        data: as it is stored.
        path: of the file, for messages.
        max_bytes: maximum size of the content.

    Raises:
        RecordError: it cannot be decompressed, or is too large.
    """
    unpack = next((unpack for magic, unpack in _UNPACK.items() if data.startswith(magic)), None)
    if unpack is None:
        return data
    import zstandard

    limit = min(max_bytes, max(MAX_UNPACKED_WITHOUT_RATIO, MAX_UNPACKED_RATIO * len(data)))
    with explained(path, "read", zlib.error, zstandard.ZstdError):
        content = unpack(data, limit)
    if len(content) > limit:
        raise RecordError(
            f"{path} has {len(data)} bytes and unpacks to more than {limit}; if you trust it, unpack it with gzip or"
            f" zstd first, to at most {max_bytes} bytes"
        )
    return content


def read_stored(path: Path, *, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Read a file as it is stored, without decompressing it.

    Args:
        path: of the file.
        max_bytes: maximum size of the file.

    Raises:
        RecordError: it cannot be read, is larger than `max_bytes`, or is no file (`core.files.reading.read_at_most`).
    """
    with explained(path, "read"):
        return read_member(path, max_bytes) if is_member(path) else read_at_most(path, max_bytes)


def file_exists(path: Path) -> bool:
    """Whether there is such a file, or such a member of a tar file."""
    try:
        return path.name in extents(path.parent) if is_member(path) else path.is_file()
    except OSError:
        return False


def read_text(path: Path) -> str:
    """Read a UTF-8 text file, with line ends converted to newline characters; empty if there is no such file.

    Raises:
        RecordError: as `read_stored`.
    """
    text = read_stored(path).decode(errors="replace") if path.is_file() else ""
    return text.replace("\r\n", "\n")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of the stored bytes of a file of any size, in hexadecimal digits.

    Raises:
        RecordError: it cannot be read, or is no file, see `core.files.reading.require_readable`.
    """
    with explained(path, "read"):
        if is_member(path):
            return hashlib.sha256(read_member(path, MAX_FILE_BYTES)).hexdigest()
        require_readable(path)
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def _decompress_gzip(data: bytes, limit: int) -> bytes:
    """Return the content, or its first `limit` + 1 bytes."""
    with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
        return stream.read(limit + 1)


def _decompress_zstd(data: bytes, limit: int) -> bytes:
    """Return the content of all frames, or at least its first `limit` + 1 bytes.

    Raises:
        EOFError: the last frame is incomplete.
    """
    import zstandard

    content, position = bytearray(), 0
    decompressor = zstandard.ZstdDecompressor(max_window_size=2**27)
    while position < len(data):
        frame = decompressor.decompressobj()
        while position < len(data) and not frame.eof:
            # small pieces, because the limit is checked between them only, and each byte can become 32 kB
            content += frame.decompress(data[position : position + _PIECE])
            position += _PIECE
            if len(content) > limit:
                return bytes(content)
        if not frame.eof:
            raise EOFError("the compressed data is truncated")
        position = min(position, len(data)) - len(frame.unused_data)
    return bytes(content)


_PIECE = 1024  # bytes
# by the first bytes of a file; a zstd file may also begin with a skippable frame, of which there are 16 kinds
_UNPACK = {
    b"\x1f\x8b": _decompress_gzip,
    b"\x28\xb5\x2f\xfd": _decompress_zstd,
    **{bytes([0x50 + n]) + b"\x2a\x4d\x18": _decompress_zstd for n in range(16)},
}
