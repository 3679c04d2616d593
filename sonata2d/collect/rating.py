"""Rating of recorded runs: the file of ratings, and the order in which a rater sees the runs."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from math import ceil
from pathlib import Path
from typing import Any

from ..core.bounds import Count, NotNegative
from ..core.labels import LabelSpec
from ..datasets.manifest import files_of
from ..errors import ConfigError, RecordError
from ..record import models
from ..record.files import safe_stem, sha256_of
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..record.validate import schema_findings
from .json_lines import append_line, read_lines

FOLDER, SUFFIX = "ratings", ".jsonl"
_RATING_VERSION = 1
REPEAT_FRACTION = 0.1  # of the runs
MINIMUM_SPACING = 5  # other runs between a run and its repeat
BREAK_AFTER = 50  # ratings
_MAXIMUM_ID_LENGTH = 64

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Rating:
    """The rating of one run by one person.

    Attributes:
        rater: id of the rater.
        file: name of the episode file.
        episode: id of the episode.
        sha256: hash of the rated file; ratings of the same bytes belong together, whatever the file name.
        label: the answer, a value of `spec`.
        showing: 1 for the first showing; 2 for an unannounced repeat, which measures the rater's consistency.
        time: time of the answer, UTC, ISO 8601.
        seconds: playing time before the answer, s of real time.
        whole: whether the run was watched to its end.
        spec: specification of the label.
    """

    rater: str
    file: str
    episode: str
    sha256: str
    label: Any
    showing: Count
    time: str
    seconds: NotNegative
    whole: bool
    spec: LabelSpec


def path_for(folder: Path, rater: str) -> Path:
    """The file with a rater's ratings of the episodes in a folder; each line holds the id itself.

    >>> path_for(Path("runs"), "Zoë / lab").name
    'Zoë_lab-ce958c.jsonl'
    """
    return folder / FOLDER / f"{safe_stem(rater)}{SUFFIX}"


def append_rating(path: Path, rating: Rating) -> None:
    """Append a rating to a file; on return it is on the disk and survives a crash.

    Raises:
        RecordError: the file cannot be written.
    """
    append_line(path, {"version": _RATING_VERSION, **asdict(rating)})


def read_ratings(path: Path) -> list[Rating]:
    """The ratings in a file, in the order in which they were given.

    Raises:
        RecordError, NewerFormatError: as of `read_lines`.
    """
    return read_lines(path, _RATING_VERSION, _rating_of, "a rating")


def ratings_of(folder: Path) -> list[Rating]:
    """All ratings of the episodes in a folder, in the order of the file names; empty without ratings.

    Raises:
        RecordError: a file of ratings is damaged.
    """
    return [rating for path in sorted((folder / FOLDER).glob(f"*{SUFFIX}")) for rating in read_ratings(path)]


def questions(ratings: Iterable[Rating]) -> list[LabelSpec]:
    """The distinct label specifications of ratings, in the order of their first rating."""
    return list(dict.fromkeys(rating.spec for rating in ratings))


def _rating_of(row: Mapping[str, Any]) -> Rating:
    """A rating from its JSON object; unknown keys are ignored."""
    for key, problem in schema_findings(row, models.model_of(Rating)):
        raise ValueError(f"{key}: {problem}")
    spec = LabelSpec.from_settings(row["spec"])
    values = {field.name: row[field.name] for field in fields(Rating)}
    return Rating(**{**values, "label": spec.validate(row["label"]), "spec": spec})


@dataclass(frozen=True, slots=True)
class Showing:
    """A run to be shown: its file, and whether it is the first showing (1) or the repeat (2)."""

    path: Path
    number: int = 1


class RatingSession:
    """The runs in a folder that one person has to rate and has rated.

    The order depends on seed, rater and file names only: a rater finds the same order again after an interruption, and
    added files do not change the order of the others. Different raters see different orders. Every rating is on the
    disk, in the subfolder `ratings`, before `rate` returns.

    Args:
        folder: folder of episodes, or one episode file.
        rater: id of the rater, preferably a pseudonym.
        spec: specification of the label.
        seed: seed of the order.
        repeats: fraction of the runs that are shown again, unannounced, towards the end; 0 to 1.
        break_after: number of ratings after which a break is due.

    Attributes:
        path: file with the ratings of this rater.

    Raises:
        ConfigError: the id, `repeats` or `spec` is not usable.
        RecordError: there is no episode, or the file of ratings is damaged.
    """

    def __init__(
        self,
        folder: str | Path,
        rater: str,
        spec: LabelSpec,
        *,
        seed: int = 0,
        repeats: float = REPEAT_FRACTION,
        break_after: int = BREAK_AFTER,
    ) -> None:
        if not 0.0 <= repeats <= 1.0:
            raise ConfigError(f"repeats is {repeats}; give a fraction of the runs, 0 to 1")
        self.rater = checked_rater(rater)
        self.spec = _checked_spec(spec)
        self.seed, self.break_after = seed, break_after
        paths = files_of(Path(folder))
        self.folder = paths[0].parent if Path(folder).is_file() else Path(folder)
        self.path = path_for(self.folder, self.rater)
        self._plan = plan_showings(_shuffled(paths, f"{seed}/{self.rater}"), repeats)
        self._hashes: dict[Path, str] = {}
        self._rated = self._read()
        self._skipped: set[Path] = set()
        self._ratings_since_break = 0

    @property
    def total(self) -> int:
        """Number of showings, repeats included, without unreadable files."""
        return sum(showing.path not in self._skipped for showing in self._plan)

    @property
    def done(self) -> int:
        """Number of rated showings."""
        return self.total - len(self._open())

    @property
    def break_due(self) -> bool:
        """Whether the rater should take a break; False once all runs are rated."""
        return self._ratings_since_break >= self.break_after and self.upcoming is not None

    def take_break(self) -> None:
        """Restart the count of ratings until the next break."""
        self._ratings_since_break = 0

    @property
    def upcoming(self) -> Showing | None:
        """The showing to rate now; None if all are rated or the remaining repeats come too early."""
        return next((showing for showing in self._open() if self._has_spacing(showing)), None)

    def load(self) -> EpisodeRecord | None:
        """The run to rate now, or None; unreadable files are skipped with a warning in the log."""
        while (showing := self.upcoming) is not None:
            try:
                return read_episode(showing.path)
            except RecordError as error:
                logger.warning("skipped: %s", error)
                self._skipped.add(showing.path)
        return None

    @property
    def skipped(self) -> tuple[str, ...]:
        """Names of the unreadable files."""
        return tuple(sorted(path.name for path in self._skipped))

    def rate(self, record: EpisodeRecord, label: Any, *, seconds: float, whole: bool) -> Rating:
        """Store the rating of the run shown now and continue with the next one.

        Args:
            record: the run that `load` returned.
            label: a value of the specification.
            seconds: playing time, s of real time.
            whole: whether the run was watched to its end.

        Raises:
            ValueError: the label does not fit the specification, or the record is not the run to rate now.
            RecordError: the rating cannot be written; the run remains to be rated.
        """
        showing = self.upcoming
        if showing is None or showing.path != record.path:
            raise ValueError(f"{record.path.name} is not the run to rate now")
        sha256 = self._sha256(record.path)
        if not sha256:
            raise RecordError(f"{record.path} can no longer be read; restore it, or close the window")
        rating = Rating(
            rater=self.rater,
            file=record.path.name,
            episode=record.id,
            sha256=sha256,
            label=self.spec.validate(label),
            showing=showing.number,
            time=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
            seconds=round(seconds, 2),
            whole=whole,
            spec=self.spec,
        )
        append_rating(self.path, rating)
        self._rated.append((rating.sha256, rating.showing))
        self._ratings_since_break += 1
        return rating

    def _read(self) -> list[tuple[str, int]]:
        """Hash and showing of this rater's earlier ratings with the same specification."""
        ratings = read_ratings(self.path) if self.path.exists() else []
        return [(r.sha256, r.showing) for r in ratings if r.rater == self.rater and r.spec == self.spec]

    def _open(self) -> list[Showing]:
        """Showings that are not rated yet; a file that was changed since its rating counts as another run."""
        readable = [showing for showing in self._plan if showing.path not in self._skipped]
        rated = set(self._rated)
        if not rated:
            return readable  # no file needs to be hashed
        return [showing for showing in readable if (self._sha256(showing.path), showing.number) not in rated]

    def _has_spacing(self, showing: Showing) -> bool:
        """Whether a repeat is far enough from its first showing; files added later may have changed the plan."""
        if showing.number == 1:
            return True
        sha256 = self._sha256(showing.path)
        recent = [rated for rated, _ in self._rated[-MINIMUM_SPACING:]]
        return sha256 not in recent and (sha256, 1) in self._rated

    def _sha256(self, path: Path) -> str:
        """Hash of a file, computed once per session; empty for an unreadable file, which equals no rated one."""
        if path not in self._hashes:
            try:
                self._hashes[path] = sha256_of(path)
            except RecordError:  # perhaps for a moment only
                return ""
        return self._hashes[path]


def checked_rater(rater: str) -> str:
    """The id of a rater without surrounding spaces.

    Raises:
        ConfigError: the id is too long, has no letter or digit, or has unprintable characters.
    """
    id = rater.strip()
    if not any(character.isalnum() for character in id) or not id.isprintable() or len(id) > _MAXIMUM_ID_LENGTH:
        raise ConfigError(
            f"{rater!r} is not a rater id; give up to {_MAXIMUM_ID_LENGTH} characters with a letter or a digit, such as"
            " r07"
        )
    return id


def plan_showings(paths: Sequence[Path], repeats: float) -> list[Showing]:
    """Showings of all runs in order; repeats of runs from the first two thirds are spread over the last third.

    Args:
        paths: episode files in the order of their first showings.
        repeats: fraction of the runs to repeat, 0 to 1; at least `MINIMUM_SPACING` other runs precede each repeat.
    """
    n = len(paths)
    last_third = ceil(2 * n / 3)
    eligible = paths[: max(min(n - MINIMUM_SPACING, last_third), 0)]
    count = min(int(n * repeats + 0.5), len(eligible))
    repeats_after: dict[int, list[Showing]] = {}  # by index of the run that precedes them
    for k in range(count):
        after = last_third + (k + 1) * (n - last_third) // count - 1  # evenly; keeps the minimum spacing
        repeats_after.setdefault(after, []).append(Showing(eligible[k * len(eligible) // count], 2))
    return [showing for k, path in enumerate(paths) for showing in (Showing(path), *repeats_after.get(k, ()))]


def _shuffled(paths: Sequence[Path], salt: str) -> list[Path]:
    """Paths in the order of a hash of salt and file name: pseudo-random, and stable when files are added."""
    return sorted(paths, key=lambda path: hashlib.sha256(f"{salt}/{path.name}".encode()).digest())


def _checked_spec(spec: LabelSpec) -> LabelSpec:
    """The specification, with one label for the whole run.

    Raises:
        ConfigError: its kind asks no question, or it has fewer than two classes.
    """
    if spec.kind == "command":
        raise ConfigError(
            "the label kind is 'command', which asks nothing; give a scenario with a label of the kind yes_no, classes,"
            " slider or text, as in collect --rate RUNS --scenario FILE"
        )
    if spec.kind == "classes" and len(spec.classes) < 2:
        raise ConfigError(f"a choice needs two or more classes, got {len(spec.classes)}; name the lowest class first")
    return replace(spec, when="run")
