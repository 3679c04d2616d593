"""Reading and writing files: atomically, optionally compressed, and with names that are valid on every system."""

from __future__ import annotations

import gzip
import hashlib
import io
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import zstandard

from ..core.limits import MAX_FILE_BYTES, MAX_UNPACKED_RATIO, MAX_UNPACKED_WITHOUT_RATIO
from ..core.reading import read_at_most
from ..core.whole_file import whole_file
from ..errors import RecordError

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
    suffix = file_suffix(path)
    if suffix == ".json.gz":
        return gzip.compress(document, compresslevel=6, mtime=0)
    if suffix == ".json.zst":
        return zstandard.ZstdCompressor(level=3, write_checksum=True).compress(document)
    return document


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that at any moment either the old or the new content exists, even after a power failure.

    Missing folders are created.

    Raises:
        RecordError: the file cannot be written; no partial file remains.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        raise RecordError(f"{path} cannot be written: {error.strerror or error}") from error


def read_bytes(path: Path, *, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Read and decompress a file. The compression is detected from the first bytes, not from the name.

    Args:
        path: of the file.
        max_bytes: maximum size of the file and of its decompressed content; decompression stops there.

    Raises:
        RecordError: the file cannot be read or decompressed, is larger than `max_bytes`, or unpacks to more than
            `limits.MAX_UNPACKED_RATIO` times its size.
    """
    try:
        return _read_decompressed(path, max_bytes)
    except (OSError, EOFError, ValueError, zlib.error, zstandard.ZstdError) as error:  # ValueError: NUL in the path
        raise RecordError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error


def _read_decompressed(path: Path, max_bytes: int) -> bytes:
    """Return the decompressed content.

    Raises:
        RecordError: it exceeds a limit.
    """
    data = read_at_most(path, max_bytes)
    unpack = next((unpack for magic, unpack in _UNPACK.items() if data.startswith(magic)), None)
    if unpack is None:
        return data
    limit = min(max_bytes, max(MAX_UNPACKED_WITHOUT_RATIO, MAX_UNPACKED_RATIO * len(data)))
    content = unpack(data, limit)
    if len(content) > limit:
        raise RecordError(
            f"{path} has {len(data)} bytes and unpacks to more than {limit}; if you trust it, unpack it with gzip or"
            f" zstd first, to at most {max_bytes} bytes"
        )
    return content


def _decompress_gzip(data: bytes, limit: int) -> bytes:
    """Return the content, or its first `limit` + 1 bytes."""
    with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
        return stream.read(limit + 1)


def _decompress_zstd(data: bytes, limit: int) -> bytes:
    """Return the content, or its first `limit` + 1 bytes."""
    decompressor = zstandard.ZstdDecompressor(max_window_size=2**27)
    # the stream reader does not detect truncation, so that it is used only where the size is unknown or too large
    is_size_known = 0 <= zstandard.frame_content_size(data) <= limit
    with decompressor.stream_reader(data) as reader:
        content: bytes = decompressor.decompress(data) if is_size_known else reader.read(limit + 1)
    return content


_UNPACK = {b"\x1f\x8b": _decompress_gzip, b"\x28\xb5\x2f\xfd": _decompress_zstd}  # by the first bytes of a file
