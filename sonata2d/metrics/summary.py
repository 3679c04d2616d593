"""What many runs come to: n, mean, median, bootstrap interval; and how two controllers differ on the same scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from ..core.portable_math import Array

LEVEL = 0.95
RESAMPLES = 2000
_AT_ONCE = 1_000_000  # drawn values held in memory

Values = Mapping[str, float | None]


class Interval(NamedTuple):
    """Low and high end."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Summary:
    """One metric over many runs.

    Attributes:
        n: runs in which it is defined.
        mean, median: over these; None if n is 0.
        interval: of the mean, by percentile bootstrap; None if n is below 2.
    """

    n: int
    mean: float | None
    median: float | None
    interval: Interval | None

    def tree(self) -> dict[str, float | int | None]:
        """As JSON."""
        low, high = self.interval or (None, None)
        return {"n": self.n, "mean": self.mean, "median": self.median, "low": low, "high": high}


def summarise(values: Sequence[float | None], *, resamples: int = RESAMPLES, seed: int = 0) -> Summary:
    """Summarise one metric of many runs, leaving out those in which it is not defined.

    Args:
        values: one a run.
        resamples: of the bootstrap.
        seed: of the bootstrap; the same values give the same interval.
    """
    there = np.array([value for value in values if value is not None], dtype=float)
    if not len(there):
        return Summary(0, None, None, None)
    interval = bootstrap_interval(there, resamples=resamples, seed=seed)
    return Summary(len(there), _rounded(there.mean()), _rounded(np.median(there)), interval)


def differences(
    first: Mapping[Any, Values], second: Mapping[Any, Values], name: str, *, resamples: int = RESAMPLES, seed: int = 0
) -> Summary:
    """The second's metric less the first's, run by run where both were in the same scene.

    Args:
        first, second: values of each scene, by what tells scenes apart.
        name: of the metric.
        resamples: of the bootstrap.
        seed: of the bootstrap.
    """
    less: list[float | None] = []
    for scene in sorted(first.keys() & second.keys()):
        before, after = first[scene].get(name), second[scene].get(name)
        less.append(None if before is None or after is None else after - before)
    return summarise(less, resamples=resamples, seed=seed)


def bootstrap_interval(
    values: Array, *, level: float = LEVEL, resamples: int = RESAMPLES, seed: int = 0
) -> Interval | None:
    """Where the mean would lie if the runs were drawn again: the percentiles of means of resamples.

    Args:
        values: (n,).
        level: of the interval, above 0 and below 1.
        resamples: how many, 1 or more.
        seed: of the draws.

    Returns:
        None for fewer than two values. Values that are all alike give an interval of no width, which says that nothing
        else was seen, not that nothing else can happen.

    Raises:
        ValueError: level or resamples are out of range.

    Source: B. Efron, Ann. Statist. 7 (1979) 1; percentile method of Efron & Tibshirani (1993), chapter 13.
    """
    if not 0.0 < level < 1.0 or resamples < 1:
        raise ValueError(f"level must lie in 0..1 and resamples be positive, got {level} and {resamples}")
    if len(values) < 2:
        return None
    generator, count = np.random.Generator(np.random.PCG64(seed)), len(values)
    means, rows = np.empty(resamples), max(_AT_ONCE // count, 1)
    for start in range(0, resamples, rows):
        part = means[start : start + rows]
        part[:] = values[generator.integers(0, count, size=(len(part), count))].mean(axis=1)
    low, high = np.quantile(means, ((1.0 - level) / 2.0, (1.0 + level) / 2.0))
    return Interval(_rounded(low), _rounded(high))


def wilson_interval(count: int, of: int, *, level: float = LEVEL) -> Interval:
    """Where a share would lie if the runs were drawn again; of some width even if the count is none or all.

    Args:
        count: runs of a kind, 0 .. of.
        of: all runs, 1 or more.
        level: of the interval, above 0 and below 1.

    Raises:
        ValueError: one of them is out of range.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    if not (0 <= count <= of and of > 0 and 0.0 < level < 1.0):
        raise ValueError(f"want 0 <= count <= of, of > 0 and a level in 0..1, got {count} of {of} at {level}")
    z = NormalDist().inv_cdf((1.0 + level) / 2.0)
    share, weight = count / of, z * z / of
    middle = (share + weight / 2.0) / (1.0 + weight)
    reach = z * (share * (1.0 - share) / of + weight / (4.0 * of)) ** 0.5 / (1.0 + weight)
    return Interval(_rounded(max(middle - reach, 0.0)), _rounded(min(middle + reach, 1.0)))


def _rounded(value: Any) -> float:
    return round(float(value), 6) + 0.0
