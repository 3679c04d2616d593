"""Writes manifests, and the rows and counts in them."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import orjson

from ...errors import RecordError
from ...record.files import read_stored, write_atomically
from ...record.layout import JsonDict
from ...record.record import EpisodeRecord
from .rows import stored_form

COUNTED = ("outcome", "family")  # keys of rows whose values a manifest counts


def write_json(path: Path, document: JsonDict) -> None:
    """Write a document as indented JSON, in one atomic step.

    Raises:
        RecordError: the file cannot be written, or JSON cannot represent a value.
    """
    try:
        data = json_bytes(document)
    except orjson.JSONEncodeError as error:
        raise RecordError(f"{path} cannot be written: JSON cannot represent a value: {error}") from error
    write_atomically(path, data)


def json_bytes(document: JsonDict) -> bytes:
    """A document as `write_json` writes it."""
    return orjson.dumps(stored_form(document), option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def file_row(name: str, data: bytes, header: JsonDict, counts: JsonDict) -> JsonDict:
    """The row of an episode file, see `models.ManifestFile`.

    Args:
        name: of the file.
        data: its stored bytes.
        header: keys of its document.
        counts: of contacts and commands, see `record.counts`.
    """
    outcome = header["outcome"]
    return {
        "name": name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "bytes": len(data),
        "episode": header["episode"],
        "family": header["family"],
        "outcome": outcome["status"],
        "ticks": outcome["tick"],
        **counts,
    }


def row_of(record: EpisodeRecord, stored: bytes | None = None) -> JsonDict:
    """The row of an episode file that was read.

    Args:
        record: its episode.
        stored: its bytes; None: they are read.
    """
    data = read_stored(record.path) if stored is None else stored
    return file_row(record.path.name, data, record.document, record.counts())


def counts_of(rows: Iterable[JsonDict], keys: Iterable[str] = COUNTED) -> dict[str, dict[str, int]]:
    """The number of rows by the value of each key, in the order of the values; rows without the key do not count."""
    counters = {key: Counter[str]() for key in keys}
    for row in rows:
        for key, counter in counters.items():
            if row.get(key) is not None:
                counter[row[key]] += 1
    return {key: dict(sorted(counter.items())) for key, counter in counters.items()}


def sum_of(counts: Iterable[JsonDict]) -> dict[str, int]:
    """The sum of several counts, in the order of the counted values."""
    total = Counter[str]()
    for each in counts:
        total.update(each)
    return dict(sorted(total.items()))
