"""Rating of recorded runs: the order in which a rater sees them, and the file of ratings."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from math import ceil
from pathlib import Path
from typing import Any

import orjson

from ..core.labels import LabelSpec
from ..datasets.check import Listed
from ..datasets.verification import files_of
from ..errors import ConfigError, NewerFormatError, RecordError
from ..record.files import LARGEST, read_bytes, safe_stem
from ..record.reader import read_episode
from ..record.record import EpisodeRecord

FOLDER, SUFFIX = "ratings", ".jsonl"
RATING_VERSION = 1

_log_path = logging.getLogger(__name__)


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
        _log_path.warning("%s: line %d was cut short and is left out: %r", path, len(lines) + 1, torn[:60])
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
        _log_path.warning("%s: its last line was cut short and is taken out: %r", path, tail[:60])
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


REPEATS = 0.1  # share of the runs that are shown again
APART = 5  # at least so many other runs lie between a run and its repeat
BREAK = 50  # ratings after which a rest is due
_LONGEST_ID = 64

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Showing:
    """A run to be shown: which file, and for the how-manieth time (1 or 2)."""

    path: Path
    number: int = 1


class RatingSession:
    """What one person has to rate in a folder, and has rated.

    The order follows from seed, rater and the files' names: the same person finds the same order again, goes on where
    they stopped, and keeps it when files are added. Another person sees another order. Every answer is on the disk,
    in `ratings/` within the folder, before `rate` returns.

    Args:
        folder: of episodes, or one episode file.
        rater: id of the person; a pseudonym is best.
        spec: what is asked.
        seed: of the order.
        repeats: share of the runs that are shown a second time, unannounced, towards the end; 0 to 1.
        break_after: so many ratings in one go.

    Attributes:
        path: the file of this person's ratings.

    Raises:
        ConfigError: the id or the share is no good, or the spec asks nothing.
        RecordError: there is no episode, or the ratings already there are damaged.
    """

    def __init__(
        self,
        folder: str | Path,
        rater: str,
        spec: LabelSpec,
        *,
        seed: int = 0,
        repeats: float = REPEATS,
        break_after: int = BREAK,
    ) -> None:
        if not 0.0 <= repeats <= 1.0:
            raise ConfigError(f"repeats is {repeats}; it is a share of the runs, 0 to 1")
        self.rater = checked_rater(rater)
        self.spec = _checked_spec(spec)
        self.seed, self.break_after = seed, break_after
        paths = [file.path if isinstance(file, Listed) else file for file in files_of(Path(folder))]
        self.folder = paths[0].parent if Path(folder).is_file() else Path(folder)
        self.path = path_for(self.folder, self.rater)
        self._plan = planned(_shuffled(paths, f"{seed}/{self.rater}"), repeats)
        self._bytes: dict[Path, str] = {}
        self._given = self._read()
        self._skipped: set[Path] = set()
        self._since_break = 0

    @property
    def total(self) -> int:
        """How many runs there are to rate, repeats included."""
        return sum(showing.path not in self._skipped for showing in self._plan)

    @property
    def done(self) -> int:
        """How many of these are rated."""
        return self.total - len(self._open())

    @property
    def break_due(self) -> bool:
        """Whether so much was rated in one go that a rest does good; not when all is done."""
        return self._since_break >= self.break_after and self.upcoming is not None

    def rested(self) -> None:
        """The rest was taken."""
        self._since_break = 0

    @property
    def upcoming(self) -> Showing | None:
        """The run to show now; None when all is done."""
        return next((showing for showing in self._open() if self._is_apart(showing)), None)

    def load(self) -> EpisodeRecord | None:
        """The run to show now; files that cannot be read are left out, with a warning in the log."""
        while (showing := self.upcoming) is not None:
            try:
                return read_episode(showing.path)
            except RecordError as error:
                _log.warning("left out: %s", error)
                self._skipped.add(showing.path)
        return None

    @property
    def skipped(self) -> tuple[str, ...]:
        """Names of the files that could not be read."""
        return tuple(sorted(path.name for path in self._skipped))

    def rate(self, record: EpisodeRecord, label: Any, *, seconds: float, whole: bool) -> Rating:
        """Write down what the person thinks of the run that is shown now, and go on to the next one.

        Args:
            record: of `load`.
            label: a value of the spec.
            seconds: s, real time for which it was playing.
            whole: whether it was watched to its end.

        Raises:
            ValueError: the label is none of the spec, or the record is not the one to be rated.
            RecordError: the rating cannot be written; the run is still to be rated.
        """
        showing = self.upcoming
        if showing is None or showing.path != record.path:
            raise ValueError(f"{record.path.name} is not the run to be rated now")
        rating = Rating(
            rater=self.rater,
            file=record.path.name,
            episode=record.id,
            sha256=self._sha256(record.path) or _refuse(record.path),
            label=self.spec.checked(label),
            showing=showing.number,
            time=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
            seconds=round(seconds, 2),
            whole=whole,
            spec=self.spec,
        )
        append_rating(self.path, rating)
        self._given.append((rating.sha256, rating.showing))
        self._since_break += 1
        return rating

    def _read(self) -> list[tuple[str, int]]:
        """What this person has answered to this question so far: which bytes, which showing."""
        ratings = read_ratings(self.path) if self.path.exists() else []
        return [(r.sha256, r.showing) for r in ratings if r.rater == self.rater and r.spec == self.spec]

    def _open(self) -> list[Showing]:
        """What is not rated yet; a file that changed since is another run."""
        given = set(self._given)
        if not given:
            return [showing for showing in self._plan if showing.path not in self._skipped]
        return [
            showing
            for showing in self._plan
            if showing.path not in self._skipped and (self._sha256(showing.path), showing.number) not in given
        ]

    def _is_apart(self, showing: Showing) -> bool:
        """Whether enough was rated since the same run was; of a plan that changed, a repeat may have to wait."""
        if showing.number == 1:
            return True
        lately = [sha256 for sha256, _ in self._given[-APART:]]
        return self._sha256(showing.path) not in lately and (self._sha256(showing.path), 1) in self._given

    def _sha256(self, path: Path) -> str:
        """Of a file's bytes, read once a sitting; of a file that cannot be read, nothing that was ever rated."""
        if path not in self._bytes:
            try:
                self._bytes[path] = sha256_of(path)
            except RecordError:
                self._bytes[path] = ""
        return self._bytes[path]


def checked_rater(rater: str) -> str:
    """The id of a person, without blanks around it.

    Raises:
        ConfigError: it is empty or too long, or holds no letter or digit, or line breaks and the like.
    """
    clean = rater.strip()
    if not any(sign.isalnum() for sign in clean) or not clean.isprintable() or len(clean) > _LONGEST_ID:
        raise ConfigError(
            f"{rater!r} is no rater id; give up to {_LONGEST_ID} signs with a letter or a digit, such as r07"
        )
    return clean


def planned(paths: Sequence[Path], repeats: float) -> list[Showing]:
    """The runs in their order, some of the first two thirds shown again in the last third, `APART` others between."""
    n = len(paths)
    last_third = ceil(2 * n / 3)
    eligible = paths[: max(min(n - APART, last_third), 0)]
    count = min(int(n * repeats + 0.5), len(eligible))
    again: dict[int, list[Showing]] = {}  # index of a run: what is shown again after it
    for k in range(count):
        after = last_third + (k + 1) * (n - last_third) // count - 1  # evenly; never nearer than APART
        again.setdefault(after, []).append(Showing(eligible[k * len(eligible) // count], 2))
    return [showing for k, path in enumerate(paths) for showing in (Showing(path), *again.get(k, ()))]


def _shuffled(paths: Sequence[Path], salt: str) -> list[Path]:
    """In the order of the SHA-256 of salt and name: as good as chance, and steady when files are added."""
    return sorted(paths, key=lambda path: hashlib.sha256(f"{salt}/{path.name}".encode()).digest())


def _checked_spec(spec: LabelSpec) -> LabelSpec:
    """The spec, asked once for the whole run.

    Raises:
        ConfigError: it asks nothing, or its classes are no choice.
    """
    if spec.kind == "command":
        raise ConfigError("the label kind is 'command', which asks nothing; rate with yes_no, classes, slider or text")
    if spec.kind == "classes" and len(spec.classes) < 2:
        raise ConfigError(f"{len(spec.classes)} classes are no choice; name two or more, the lowest first")
    return replace(spec, when="run")


def _refuse(path: Path) -> str:
    raise RecordError(f"{path} cannot be read any more; put it back, or close the window")
