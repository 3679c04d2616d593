"""A sitting in which a person rates recorded runs: in which order, what comes again, what is done already."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import ceil
from pathlib import Path
from typing import Any

from .errors import ConfigError, RecordError
from .labels import LabelSpec
from .proof import files_of
from .record import EpisodeRecord, Listed, read_episode
from .record.ratings import Rating, append_rating, path_for, read_ratings, sha256_of

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
