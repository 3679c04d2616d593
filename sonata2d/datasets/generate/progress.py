"""Progress of a generation run: which episodes count towards the data set, and the run log `run.jsonl`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import orjson

from ...core.files.locations import is_remote
from ...errors import RecordError, Sonata2dError
from ...record.canonical import to_json_value
from ...record.files import read_stored, write_atomically
from ..manifest.read import LOG, DatasetSpec, ManifestEntry

ABORT_AFTER = 200  # episodes before a run may be aborted because too few of them are kept
MAXIMUM_EPISODES_PER_KEPT = 50  # abort if fewer than 1 in 50 episodes is kept


@dataclass(frozen=True, slots=True)
class ExcludedEpisode:
    """An episode that was run and not kept because of its outcome."""

    episode: int
    outcome: str


@dataclass(frozen=True, slots=True)
class FailedEpisode:
    """An episode that an error ended.

    Attributes:
        episode: number of the episode.
        error: class of the error.
        message: what happened.
        partial_file: name of the file with the frames before the error; None if there are none.
        traceback: where the error was raised, as Python prints it.
    """

    episode: int
    error: type[Sonata2dError]
    message: str
    partial_file: str | None
    traceback: str = ""


EpisodeResult = ManifestEntry | ExcludedEpisode | FailedEpisode


class Progress:
    """The kept episodes of a generation run: the first ones, by number, with the requested outcomes.

    Results are counted in the order of their episode numbers, so neither the kept episodes nor an abort depend on which
    worker finishes first.

    Args:
        spec: specification of the data set.
        known: results of earlier runs.

    Attributes:
        kept: manifest rows of the kept episodes, by number.
        left_out: number of excluded episodes before the last kept one, by outcome.
        failure: the failed episode that ends the run; None if there is none.

    Raises:
        RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
    """

    def __init__(self, spec: DatasetSpec, known: Iterable[ManifestEntry | ExcludedEpisode] = ()) -> None:
        self._spec = spec
        self._results: dict[int, EpisodeResult] = {result.episode: result for result in known}
        self._next = 0  # number of the first episode that is not counted yet
        self.kept: list[ManifestEntry] = []
        self.left_out: Counter[str] = Counter()
        self.failure: FailedEpisode | None = None
        self._count()

    @property
    def is_finished(self) -> bool:
        """Whether the run needs no further result."""
        return self.failure is not None or len(self.kept) == self._spec.episodes

    @property
    def stored(self) -> list[ManifestEntry]:
        """Manifest rows of the stored episodes with a requested outcome, including those not counted yet."""
        return [result for result in self._results.values() if isinstance(result, ManifestEntry)]

    def add(self, result: EpisodeResult) -> int:
        """Add a result and return the number of newly kept episodes.

        Raises:
            RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
        """
        before = len(self.kept)
        self._results[result.episode] = result
        self._count()
        return len(self.kept) - before

    def pending(self) -> Iterator[int]:
        """Episode numbers without a result: endless with `keep`, empty if the run is finished."""
        if self.is_finished:
            return iter(())
        numbers = count() if self._spec.keep else range(self._spec.episodes)
        return (k for k in numbers if k not in self._results)

    def _count(self) -> None:
        """Count results up to the first missing number, a failure, or the last requested episode."""
        while not self.is_finished and (result := self._results.get(self._next)) is not None:
            if isinstance(result, FailedEpisode):
                self.failure = result
                return
            self._next += 1
            if isinstance(result, ManifestEntry):
                self.kept.append(result)
            else:
                self.left_out[result.outcome] += 1
                too_few_kept(self._spec, len(self.kept), self._next, self.left_out)


def too_few_kept(spec: DatasetSpec, kept: int, run: int, left_out: Mapping[str, int]) -> None:
    """End a run that would hardly come to its end.

    Args:
        spec: specification of the data set.
        kept: number of episodes that are kept.
        run: number of all episodes that were run.
        left_out: number of the others by outcome.

    Raises:
        RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
    """
    if run >= ABORT_AFTER and kept * MAXIMUM_EPISODES_PER_KEPT < run:
        others = ", ".join(f"{number} {outcome}" for outcome, number in sorted(left_out.items()))
        raise RecordError(
            f"only {kept} of the first {run} episodes ended in {' or '.join(spec.keep)}"
            f" ({others}); keep other outcomes, or change the controller or the scenario"
        )


def append_to_log(folder: Path, **facts: Any) -> None:
    """Append a line to the run log: wall time, host, workers and command line of a run, or an excluded episode.

    Raises:
        RecordError: the log cannot be written.
    """
    line = orjson.dumps(to_json_value(facts, LOG, exact=True), option=orjson.OPT_APPEND_NEWLINE)
    if is_remote(folder):  # objects of a store are written whole
        stored = read_stored(folder / LOG) if (folder / LOG).exists() else b""
        write_atomically(folder / LOG, stored + line)
        return
    try:
        with (folder / LOG).open("ab") as file:
            file.write(line)
    except OSError as error:
        raise RecordError(f"{folder / LOG} cannot be written: {error.strerror or error}") from error


def log_excluded(folder: Path, excluded: ExcludedEpisode) -> None:
    """Log an excluded episode, so that a resumed run does not run it again; in a store it does.

    Raises:
        RecordError: the log cannot be written.
    """
    if not is_remote(folder):  # which would have to write the whole log again each time
        append_to_log(folder, left_out=excluded.episode, outcome=excluded.outcome)


def read_excluded(folder: Path) -> list[ExcludedEpisode]:
    """The excluded episodes of earlier runs; incomplete lines of the log are skipped."""
    outcomes: dict[int, str] = {}
    for line in read_stored(folder / LOG).splitlines() if (folder / LOG).is_file() else ():
        try:
            row = orjson.loads(line)
        except orjson.JSONDecodeError:
            continue
        if isinstance(row, dict) and isinstance(row.get("left_out"), int):
            outcomes[row["left_out"]] = str(row.get("outcome"))
    return [ExcludedEpisode(episode, outcome) for episode, outcome in outcomes.items()]
