"""Progress of a generation run: which episodes count, and the run log `run.jsonl`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import orjson

from ..errors import RecordError, Sonata2dError
from ..record.canonical import plain
from .manifest import DatasetSpec, Entry

LOG = "run.jsonl"


def log(folder: Path, **facts: Any) -> None:
    """Add a line: wall time, host, workers, command line; or an episode that was left out.

    Raises:
        RecordError: it cannot be written.
    """
    try:
        with (folder / LOG).open("ab") as file:
            file.write(orjson.dumps(plain(facts, LOG, exact=True), option=orjson.OPT_APPEND_NEWLINE))
    except OSError as error:
        raise RecordError(f"{folder / LOG} cannot be written: {error.strerror or error}") from error


def log_left_out(folder: Path, episode: int, outcome: str) -> None:
    """Note an episode that was run and not kept, so that it need not be run again.

    Raises:
        RecordError: it cannot be written.
    """
    log(folder, left_out=episode, outcome=outcome)


def logged_left_out(folder: Path) -> dict[int, str]:
    """Outcome by number of the episodes that earlier runs left out; a line that was cut short tells of none."""
    told: dict[int, str] = {}
    for line in (folder / LOG).read_bytes().splitlines() if (folder / LOG).is_file() else ():
        try:
            row = orjson.loads(line)
        except orjson.JSONDecodeError:
            continue
        if isinstance(row, dict) and isinstance(row.get("left_out"), int):
            told[row["left_out"]] = str(row.get("outcome"))
    return told


TRIED, RARE = 200, 50  # from so many episodes on, at least one in so many must be kept


@dataclass(frozen=True, slots=True)
class LeftOut:
    """An episode that ended otherwise than is kept."""

    episode: int
    outcome: str


@dataclass(frozen=True, slots=True)
class Failure:
    """An episode that an error ended: which, what happened, and where its frames up to there are."""

    episode: int
    error: type[Sonata2dError]
    message: str
    remains: Path | None


Result = Entry | LeftOut | Failure


class Tally:
    """The first episodes by number that ended as the plan asks, as many as it asks for.

    Results count in the order of their numbers, so that what is made, and whether an error ends it, does not depend on
    who was quicker.

    Args:
        plan: what is asked for.
        known: results of earlier runs.

    Attributes:
        kept: in order of number.
        left_out: how many of those before the last one kept were not, by outcome.
        failure: the error that ends it here, if one does.

    Raises:
        RecordError: hardly any episode ends as the plan asks.
    """

    def __init__(self, plan: DatasetSpec, known: Iterable[Entry | LeftOut] = ()) -> None:
        self._plan = plan
        self._results: dict[int, Result] = {}
        self._next = 0
        self.kept: list[Entry] = []
        self.left_out: Counter[str] = Counter()
        self.failure: Failure | None = None
        for result in known:
            self._results[result.episode] = result
        self._count()

    @property
    def is_over(self) -> bool:
        """Whether no further result is needed."""
        return self.failure is not None or len(self.kept) == self._plan.episodes

    @property
    def whole(self) -> int:
        """How many episodes are there to be kept, counted yet or not."""
        return sum(isinstance(result, Entry) for result in self._results.values())

    def take(self, result: Result) -> int:
        """Count a result in, and those that waited for it; how many are kept now that were not before."""
        before = len(self.kept)
        self._results[result.episode] = result
        self._count()
        return len(self.kept) - before

    def missing(self) -> Iterator[int]:
        """The numbers that have no result yet, without end where only some are kept; none if it is over."""
        if self.is_over:
            return iter(())
        numbers = count() if self._plan.keep else range(self._plan.episodes)
        return (k for k in numbers if k not in self._results)

    def _count(self) -> None:
        while not self.is_over and (result := self._results.get(self._next)) is not None:
            if isinstance(result, Failure):
                self.failure = result
                return
            self._next += 1
            if isinstance(result, Entry):
                self.kept.append(result)
            else:
                self.left_out[result.outcome] += 1
                self._refuse_rarity()

    def _refuse_rarity(self) -> None:
        if self._next >= TRIED and len(self.kept) * RARE < self._next:
            others = ", ".join(f"{number} {outcome}" for outcome, number in sorted(self.left_out.items()))
            raise RecordError(
                f"only {len(self.kept)} of the first {self._next} episodes ended in {' or '.join(self._plan.keep)}"
                f" ({others}); keep other outcomes, or change the controller or the scenario"
            )
