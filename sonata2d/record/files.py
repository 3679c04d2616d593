"""Files that are whole or not there, packed or plain, with names that every system takes."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from uuid import uuid4

import zstandard

from ..errors import RecordError

SUFFIXES = (".json", ".json.gz", ".json.zst")
LARGEST = 2**30  # bytes of one unpacked file: more than an hour with a thousand people
TEMPORARY = ".sonata2d-"  # how the names of files begin that are not whole yet
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)  # devices, on Windows


def suffix_of(path: Path) -> str:
    """Which of `SUFFIXES` a path ends with.

    Raises:
        RecordError: with none of them.
    """
    for suffix in SUFFIXES:
        if path.name.endswith(suffix) and path.name != suffix:
            return suffix
    raise RecordError(f"{path}: an episode file ends in {', '.join(SUFFIXES)}")


def stem_of(path: Path) -> str:
    """The file's name without its suffix."""
    return path.name.removesuffix(suffix_of(path))


def safe_name(contributor: str, when: datetime, id: str, suffix: str = ".json") -> str:
    """A file's name for a person's run, fit for every system: `{contributor}__{UTC time}__{id}.json`.

    >>> safe_name("Zoë / lab", datetime(2025, 1, 2, 3, 4, 5, tzinfo=UTC), "run:1")
    'Zoë_lab-ce958c__20250102T030405Z__run_1.json'
    """
    return f"{safe_stem(contributor)}__{when.astimezone(UTC):%Y%m%dT%H%M%SZ}__{safe_text(id)}{suffix}"


def safe_stem(name: str) -> str:
    """A person's name as part of a file's name; no two people share one, not even where case does not count.

    >>> safe_stem("zoe"), safe_stem("Zoe")
    ('zoe', 'Zoe-458556')
    """
    safe = safe_text(name)
    if safe == name and name == name.casefold():
        return safe
    return f"{safe}-{hashlib.sha256(name.encode()).hexdigest()[:6]}"


def safe_text(text: str) -> str:
    """Letters, digits, dashes, dots; at most 80 bytes; no device's name."""
    clean = re.sub(r"[^\w.-]+", "_", text)
    clean = re.sub(r"_+", "_", clean).strip("._-")
    clean = clean.encode()[:80].decode(errors="ignore").rstrip("._-") or "unnamed"
    return f"_{clean}" if _RESERVED.match(clean) else clean


def safe_texts(texts: Sequence[str]) -> list[str]:
    """Each as `safe_text`, but no two alike, however long they are and not even where case does not count.

    >>> safe_texts(["runs/a.npz", "b/c", "b_c"])
    ['runs_a.npz', 'b_c-b9e2be', 'b_c']
    """
    alike = Counter(safe_text(text).casefold() for text in texts)
    return [safe_text(text) if alike[safe_text(text).casefold()] == 1 else safe_stem(text) for text in texts]


def packed(document: bytes, path: Path) -> bytes:
    """The bytes to write to a file of this name; the same document gives the same bytes."""
    suffix = suffix_of(path)
    if suffix == ".json.gz":
        return gzip.compress(document, compresslevel=6, mtime=0)
    if suffix == ".json.zst":
        return zstandard.ZstdCompressor(level=3, write_checksum=True).compress(document)
    return document


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that at every moment the old one or the new one is there, whole, even if the power fails.

    Raises:
        RecordError: it cannot be written; nothing of it is left behind.
    """
    temporary = path.parent / f"{TEMPORARY}{uuid4().hex}.tmp"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write_through(temporary, data)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        sync_folder(path.parent)
    except OSError as error:
        raise RecordError(f"{path} cannot be written: {error.strerror or error}") from error


def _write_through(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Make a rename last; Windows neither needs nor allows it."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_bytes(path: Path, *, largest: int = LARGEST) -> bytes:
    """The unpacked content of a file; how it is packed is told by its first bytes, not by its name.

    Args:
        path: of the file.
        largest: bytes of the unpacked content; no more is ever unpacked.

    Raises:
        RecordError: it cannot be read or unpacked, or is larger than that.
    """
    try:
        data = _unpacked(path, largest)
    except (OSError, EOFError, zlib.error, zstandard.ZstdError) as error:
        raise RecordError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if len(data) > largest:
        raise RecordError(f"{path} unpacks to more than {largest} bytes; no episode is that long")
    return data


def _unpacked(path: Path, largest: int) -> bytes:
    """At most one byte more than `largest`."""
    with path.open("rb") as file:
        packed_data = file.read(largest + 1)
    if packed_data.startswith(b"\x1f\x8b"):
        with gzip.GzipFile(fileobj=io.BytesIO(packed_data)) as stream:
            return stream.read(largest + 1)
    if packed_data.startswith(b"\x28\xb5\x2f\xfd"):
        return _unpacked_zstd(packed_data, largest)
    return packed_data


def _unpacked_zstd(data: bytes, largest: int) -> bytes:
    """The same for Zstandard, whose stream reader takes a file that was cut short for a whole one."""
    decompressor = zstandard.ZstdDecompressor(max_window_size=2**27)
    size_is_told = 0 <= zstandard.frame_content_size(data) <= largest
    with decompressor.stream_reader(data) as reader:
        unpacked: bytes = decompressor.decompress(data) if size_is_told else reader.read(largest + 1)
    return unpacked
