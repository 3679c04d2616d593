"""What people think of recorded runs: one line a rating, in `ratings/` beside the episodes, never rewritten."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import orjson

from ..errors import NewerFormatError, RecordError
from ..labels import LabelSpec
from .files import LARGEST, read_bytes, safe_stem

FOLDER, SUFFIX = "ratings", ".jsonl"
RATING_VERSION = 1

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Rating:
    """What a person thinks of one run.

    Attributes:
        rater: id of the person, as they gave it.
        file: name of the episode's file.
        episode: id of the episode.
        sha256: of the file as it was when rated; ratings of the same bytes belong together, whatever the file's name.
        label: what the person answered, a value of `spec`.
        showing: 1; 2 where the run was shown once more, unannounced, to see how steady the person's answers are.
        time: when it was given, UTC, ISO 8601.
        seconds: s, real time for which the run was playing before the answer.
        whole: whether the run was watched to its end.
        spec: what was asked.
    """

    rater: str
    file: str
    episode: str
    sha256: str
    label: Any
    showing: int
    time: str
    seconds: float
    whole: bool
    spec: LabelSpec


_KINDS: dict[str, type | tuple[type, ...]] = {
    "rater": str, "file": str, "episode": str, "sha256": str, "showing": int, "time": str,
    "seconds": (int, float), "whole": bool, "spec": dict,
}  # fmt: skip


def path_for(folder: Path, rater: str) -> Path:
    """Where a person's ratings of the episodes of a folder stand; the id itself stands in every line.

    >>> path_for(Path("runs"), "Zoë / lab").name
    'Zoë_lab-ce958c.jsonl'
    """
    return folder / FOLDER / f"{safe_stem(rater)}{SUFFIX}"


def sha256_of(path: Path) -> str:
    """Of the file's bytes as they lie on the disk.

    Raises:
        RecordError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from error


def append_rating(path: Path, rating: Rating) -> None:
    """Add a line, and return once it is on the disk: what was rated is not lost to a crash.

    Raises:
        RecordError: it cannot be written.
    """
    line = orjson.dumps({"version": RATING_VERSION, **asdict(rating)}, option=orjson.OPT_APPEND_NEWLINE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab+") as file:
            _end_last_line(path, file)
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise RecordError(f"{path} cannot be written: {error.strerror or error}") from error


def read_ratings(path: Path) -> list[Rating]:
    """The ratings of a file, in the order in which they were given.

    What a power cut left of the last line is dropped, with a warning in the log.

    Raises:
        RecordError: the file cannot be read, or a line is no rating; names the line.
        NewerFormatError: a line was written by a newer version.
    """
    lines = read_bytes(path, largest=LARGEST).split(b"\n")
    torn = lines.pop()
    if _is_torn(torn):
        _log.warning("%s: line %d was cut short and is left out: %r", path, len(lines) + 1, torn[:60])
    elif torn:
        lines.append(torn)
    return [_rating(line, path, number) for number, line in enumerate(lines, 1)]


def ratings_of(folder: Path) -> list[Rating]:
    """All ratings beside the episodes of a folder, by file name; none where nobody has rated.

    Raises:
        RecordError: a file of ratings is damaged.
    """
    return [rating for path in sorted((folder / FOLDER).glob(f"*{SUFFIX}")) for rating in read_ratings(path)]


def questions(ratings: Iterable[Rating]) -> list[LabelSpec]:
    """What was asked, each question once, in the order of its first rating."""
    return list(dict.fromkeys(rating.spec for rating in ratings))


def _end_last_line(path: Path, file: Any) -> None:
    """Cut off what is left of a line that was never whole, so that the next one begins a line of its own."""
    file.seek(0)
    data = file.read()
    tail = data[data.rfind(b"\n") + 1 :]
    if _is_torn(tail):
        _log.warning("%s: its last line was cut short and is taken out: %r", path, tail[:60])
        file.truncate(len(data) - len(tail))
    elif tail:
        file.write(b"\n")


def _is_torn(tail: bytes) -> bool:
    """Whether this is the beginning of a line only: a JSON object is no object before its last brace."""
    try:
        orjson.loads(tail or b"{}")
    except orjson.JSONDecodeError:
        return True
    return False


def _rating(line: bytes, path: Path, number: int) -> Rating:
    """One line.

    Raises:
        RecordError: it is no rating.
    """
    place = f"{path}, line {number}"
    try:
        told = orjson.loads(line)
        if not isinstance(told, dict):
            raise TypeError(f"it is a JSON {type(told).__name__}")
        _refuse_newer(told, place)
        return _restored(told)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else error
        raise RecordError(f"{place} is no rating: {reason}; mend or remove that line") from error


def _refuse_newer(told: Mapping[str, Any], place: str) -> None:
    version = told["version"]
    if not isinstance(version, int) or version < 1:
        raise ValueError(f"version is {version!r}")
    if version > RATING_VERSION:
        raise NewerFormatError(
            f"{place} was written by version {version}, this sonata2d reads up to {RATING_VERSION}; upgrade sonata2d"
        )


def _restored(told: Mapping[str, Any]) -> Rating:
    """Keys that this version does not know are passed over."""
    for key, kind in _KINDS.items():
        if not isinstance(told[key], kind):
            raise TypeError(f"{key} is {told[key]!r}")
    spec = LabelSpec.restored(told["spec"])
    rest = {field.name: told[field.name] for field in fields(Rating)}
    return Rating(**{**rest, "label": spec.checked(told["label"]), "spec": spec})
