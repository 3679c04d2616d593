"""Checks episode files: schema, plausibility of the numbers, and agreement with the manifest that lists them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import orjson

from ...errors import InvalidFileError, RecordError
from ...record.files import file_exists, read_stored, sha256_of, unpacked
from ...record.layout import JsonDict
from ...record.reader import episode_in
from ...record.record import EpisodeRecord
from ..manifest.names import MANIFEST
from ..manifest.write import row_of
from .plausibility import implausible_values

_KEYS_OF_FRAME = 11  # that each frame has
_MAXIMUM_FINDINGS = 20  # of the reader, reported per file


@dataclass(frozen=True, slots=True)
class Problem:
    """A problem in a file of a data set.

    Attributes:
        file: file name.
        place: key in the file, such as `frames.3.robot`, or the name of a check.
        message: what is wrong.
        is_warning: whether the data can be read and reproduced nevertheless.
    """

    file: str
    place: str
    message: str
    is_warning: bool = False

    def __str__(self) -> str:
        return f"{self.file}: {self.place}: {'warning: ' if self.is_warning else ''}{self.message}"


@dataclass(frozen=True, slots=True)
class ListedFile:
    """An episode file or a shard, with the statements of a manifest about it.

    Attributes:
        path: location of the file.
        entry: row of the file in the manifest; empty for a file that belongs to no data set.
        shared: keys of the document, or of the shard's manifest, that all files of a source have in common, with their
            values.
    """

    path: Path
    entry: JsonDict = field(default_factory=dict)
    shared: JsonDict = field(default_factory=dict)


def open_to_check(file: ListedFile) -> tuple[EpisodeRecord | None, bytes, list[Problem]]:
    """The episode of a file, and its bytes; or None, and why it cannot be checked."""
    path, entry = file.path, file.entry
    if entry and not file_exists(path):
        return None, b"", [Problem(MANIFEST, "files", f"{entry['name']} is listed but not in the folder")]
    try:
        stored = read_stored(path)
        return episode_in(path, stored), stored, []
    except InvalidFileError as error:
        problems = [Problem(path.name, *finding) for finding in error.findings[:_MAXIMUM_FINDINGS]]
        if (rest := len(error.findings) - _MAXIMUM_FINDINGS) > 0:
            problems.append(Problem(path.name, "schema", f"{rest} more problems"))
        if entry and sha256_of(path) != entry["sha256"]:
            problems.insert(0, Problem(path.name, "sha256", "differs from the manifest"))
        return None, b"", problems
    except RecordError as error:
        return None, b"", [Problem(path.name, "file", str(error))]


def check_record(record: EpisodeRecord, stored: bytes, file: ListedFile) -> list[Problem]:
    """Problems of an episode, and differences from the manifest that lists its file.

    Args:
        record, stored: the episode, and the bytes of its file.
        file: with what the manifest states.
    """
    path = record.path
    repeated_ones = repeated_keys(path, unpacked(stored, path), record.document, is_episode=True)
    implausible = [Problem(path.name, *finding) for finding in implausible_values(record)]
    return (_differences(record, stored, file) if file.entry else []) + repeated_ones + implausible


def _differences(record: EpisodeRecord, stored: bytes, file: ListedFile) -> list[Problem]:
    """Differences between a file and what the manifest states about it."""
    name, entry = file.entry["name"], file.entry
    actual = row_of(record, stored) | {"name": name}  # with the name of its shard
    problems = [
        Problem(name, key, f"is {actual[key]}, the manifest says {entry[key]}")
        for key in actual
        if key in entry and actual[key] != entry[key]
    ]
    for key, value in file.shared.items():
        if record.document[key] == value:
            continue
        is_id = key == "id"
        message = f"is {record.id!r}, but the file's name says {value!r}" if is_id else "differs from the manifest"
        problems.append(Problem(name, key, message))
    return problems


def repeated_keys(path: Path, content: bytes, document: JsonDict, *, is_episode: bool = False) -> list[Problem]:
    """Report duplicate keys of the JSON objects of a file; parsers silently use one of the values.

    Args:
        path: of the file.
        content: of the file, unpacked.
        document: the parsed content.
        is_episode: whether it is a valid episode, in which less time is needed.
    """
    duplicates: list[str] = []

    def collect(pairs: list[tuple[str, object]]) -> dict[str, object]:
        content = dict(pairs)
        if len(content) < len(pairs):
            duplicates.extend(repeated(key for key, _ in pairs))
        return content

    # A repeated key is a text that a parser drops. Without escaped characters each text has two quotes, and counting
    # them takes a tenth of the time.
    if b"\\" not in content and _quotes(document, is_episode) == content.count(b'"'):
        return []
    json.loads(content, object_pairs_hook=collect)
    return [Problem(path.name, key, "is given twice; one of the values is ignored") for key in duplicates[:1]]


def _quotes(document: JsonDict, is_episode: bool) -> int:
    """The number of quotes in the JSON text of a document without escaped characters."""
    # In most frames only keys and the names of relations are texts.
    plain, parts = 0, []
    for frame in document["frames"] if is_episode else ():
        if len(frame) == _KEYS_OF_FRAME and not frame["contacts"] and not frame["events"]:
            plain += 2 * (len(frame) + len(frame["interactions"]))
        else:
            parts.append(frame)
    rest = document | {"frames": parts} if is_episode else document
    return plain + orjson.dumps(rest).count(b'"')


def repeated(names: Iterable[str]) -> list[str]:
    """The names that occur more than once."""
    return [name for name, count in Counter(names).items() if count > 1]
