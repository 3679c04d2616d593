"""Progress of a generation run: the batches that count towards the data set, and the run log `run.jsonl`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import orjson

from ...core.files.locations import is_remote
from ...core.files.reading import require_readable
from ...errors import RecordError, Sonata2dError
from ...record.canonical import to_json_value
from ...record.files import read_stored, write_atomically
from ...record.layout import JsonDict
from ..manifest.names import LOG
from ..manifest.write import counts_of
from .specification import DatasetSpec

_ABORT_AFTER = 200  # episodes before a run may be aborted because too few of them are kept
_MAXIMUM_EPISODES_PER_KEPT = 50  # abort if fewer than 1 in 50 episodes is kept


@dataclass(frozen=True, slots=True)
class Batch:
    """Episodes that were generated together: the episodes of a shard, or in a folder of files a single one.

    Attributes:
        number: of the batch, see `DatasetSpec.covered`.
        stop: episode number after the last one that the batch covers.
        row: of the shard or of the file in the manifest; None: the only episode is not kept.
        counts: number of episodes by outcome and by family.
        left_out: number of episodes that were run and not kept, by outcome.
        is_split: whether the manifest of the shard divides its episodes among parts.
    """

    number: int
    stop: int
    row: JsonDict | None
    counts: JsonDict
    left_out: dict[str, int]
    is_split: bool = False

    @property
    def episodes(self) -> int:
        """Number of kept episodes."""
        return sum(self.counts["outcome"].values())


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


class Progress:
    """The batches of a generation run that count: the first ones, by number, until enough episodes are kept.

    Results are counted in the order of their numbers, so neither the kept episodes nor an abort depend on which worker
    finishes first.

    Args:
        spec: specification of the data set.
        known: batches of earlier runs.

    Attributes:
        batches: the counted batches, without a gap.
        kept: number of their episodes.
        failure: the failed episode that ends the run; None if there is none.

    Raises:
        RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
    """

    def __init__(self, spec: DatasetSpec, known: Iterable[Batch] = ()) -> None:
        self._spec = spec
        self._results: dict[int, Batch | FailedEpisode] = {batch.number: batch for batch in known}
        self._left_out = Counter[str]()  # of the counted batches, by outcome
        self.batches: list[Batch] = []
        self.kept = 0
        self.failure: FailedEpisode | None = None
        self._count()

    @property
    def is_finished(self) -> bool:
        """Whether the run needs no further result."""
        return self.failure is not None or self.kept >= self._spec.episodes

    @property
    def stored(self) -> list[Batch]:
        """All batches with kept episodes, including batches that are not counted yet."""
        return [batch for batch in self._results.values() if isinstance(batch, Batch) and batch.row is not None]

    def add(self, result: Batch | FailedEpisode) -> int:
        """Add a result and return the number of newly kept episodes.

        Raises:
            RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
        """
        before = min(self.kept, self._spec.episodes)
        number = result.number if isinstance(result, Batch) else result.episode // (self._spec.shard_size or 1)
        self._results[number] = result
        self._count()
        return min(self.kept, self._spec.episodes) - before

    def pending(self) -> Iterator[int]:
        """Numbers of batches without a result: endless with `keep`, empty if the run is finished."""
        if self.is_finished:
            return iter(())
        numbers = count() if self._spec.keep else range(-(-self._spec.episodes // (self._spec.shard_size or 1)))
        return (number for number in numbers if number not in self._results)

    def _count(self) -> None:
        """Count results up to the first missing number, a failure, or the last requested episode."""
        while not self.is_finished and (result := self._results.get(len(self.batches))) is not None:
            if isinstance(result, FailedEpisode):
                self.failure = result
                return
            covers_all = result.stop == self._spec.covered(result.number)[1]
            if not covers_all and self.kept + result.episodes < self._spec.episodes:
                del self._results[result.number]  # it was the last shard of a smaller data set
                return
            self.batches.append(result)
            self.kept += result.episodes
            self._left_out.update(result.left_out)
            self._require_progress()

    def _require_progress(self) -> None:
        """End a run that would hardly come to its end.

        Raises:
            RecordError: fewer than 1 in 50 episodes is kept after 200 episodes.
        """
        run = self.kept + self._left_out.total()
        if run >= _ABORT_AFTER and self.kept * _MAXIMUM_EPISODES_PER_KEPT < run:
            others = ", ".join(f"{number} {outcome}" for outcome, number in sorted(self._left_out.items()))
            raise RecordError(
                f"only {self.kept} of the first {run} episodes ended in {' or '.join(self._spec.keep)}"
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
        require_readable(folder / LOG)
        with (folder / LOG).open("ab") as file:
            file.write(line)
    except OSError as error:
        raise RecordError(f"{folder / LOG} cannot be written: {error.strerror or error}") from error


def log_excluded(folder: Path, batch: Batch) -> None:
    """Log an excluded episode of a folder of files, so that a resumed run does not run it again; in a store it does.

    Raises:
        RecordError: the log cannot be written.
    """
    if not is_remote(folder):  # which would have to write the whole log again each time
        append_to_log(folder, left_out=batch.number, outcome=next(iter(batch.left_out)))


def logged_exclusions(folder: Path) -> list[Batch]:
    """The excluded episodes of earlier runs; incomplete lines of the log are skipped."""
    outcomes: dict[int, str] = {}
    for line in read_stored(folder / LOG).splitlines() if (folder / LOG).is_file() else ():
        try:
            row = orjson.loads(line)
        except orjson.JSONDecodeError:
            continue
        if isinstance(row, dict) and isinstance(row.get("left_out"), int):
            outcomes[row["left_out"]] = str(row.get("outcome"))
    return [Batch(episode, episode + 1, None, counts_of(()), {outcome: 1}) for episode, outcome in outcomes.items()]
