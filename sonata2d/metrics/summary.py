"""Statistics over many episodes: mean, median, confidence intervals, differences between paired episodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from ..core.portable_math import Array, IntArray

LEVEL = 0.95  # of confidence intervals
FEW = 20  # episodes; with fewer, confidence intervals are too narrow
RESAMPLES = 2000  # of the bootstrap
_MAX_DRAWN = 1_000_000  # values drawn at a time, which bounds the memory

Values = Mapping[str, float | None]  # of one episode, by metric


class Interval(NamedTuple):
    """Lower and upper end of a confidence interval."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Summary:
    """One metric over many episodes.

    Attributes:
        n: number of episodes in which the metric is defined.
        mean, median: over these episodes; None if n is 0.
        interval: of the mean, by percentile bootstrap; None if n is below 2.
    """

    n: int
    mean: float | None
    median: float | None
    interval: Interval | None

    def to_json(self) -> dict[str, float | int | None]:
        """The summary as a JSON object."""
        low, high = self.interval or (None, None)
        return {"n": self.n, "mean": self.mean, "median": self.median, "low": low, "high": high}

    @property
    def excludes_zero(self) -> bool:
        """Whether there is an interval and zero lies outside; of a difference, whether it is significant."""
        return self.interval is not None and not self.interval.low <= 0.0 <= self.interval.high

    def text(self, episodes: int) -> str:
        """Format as `0.95 [0.85, 1.00]`, followed by `(n=12)` if n differs from the number of episodes."""
        if self.mean is None:
            return "not defined"
        ends = self.interval and ", ".join(map(format_number, self.interval))
        text = format_number(self.mean) + (f" [{ends}]" if ends else "")
        return text if self.n == episodes else f"{text} (n={self.n})"


@dataclass(frozen=True, slots=True)
class Share:
    """Number of episodes in which something happened, out of the episodes in which the metric is defined."""

    count: int
    total: int

    @property
    def fraction(self) -> float:
        """Of the episodes, 0 to 1."""
        return self.count / self.total

    @property
    def interval(self) -> Interval:
        """Wilson confidence interval of the fraction."""
        return wilson_interval(self.count, self.total)


def format_number(value: float) -> str:
    """Format with two or three significant digits; exact 0 and 1 without decimals."""
    if value in (0.0, 1.0) or abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) >= 0.1 else f"{value:.3f}"


def summarise(values: Sequence[float | None], *, resamples: int = RESAMPLES, seed: int = 0) -> Summary:
    """Summarise one metric of many episodes, leaving out episodes in which it is not defined.

    Args:
        values: one per episode; None where the metric is not defined.
        resamples: of the bootstrap.
        seed: of the bootstrap; the same values and seed give the same interval.
    """
    defined = np.array([value for value in values if value is not None], dtype=float)
    if not len(defined):
        return Summary(0, None, None, None)
    interval = bootstrap_interval(defined, resamples=resamples, seed=seed)
    return Summary(len(defined), _rounded(defined.mean()), _rounded(np.median(defined)), interval)


def differences(
    first: Mapping[Any, Values], second: Mapping[Any, Values], name: str, *, resamples: int = RESAMPLES, seed: int = 0
) -> Summary:
    """Summarise the differences of one metric, second minus first, in the scenes common to both.

    Args:
        first, second: metrics of each episode, by scene.
        name: the metric.
        resamples, seed: of the bootstrap.
    """
    values: list[float | None] = []
    for scene in sorted(first.keys() & second.keys()):
        before, after = first[scene].get(name), second[scene].get(name)
        values.append(None if before is None or after is None else after - before)
    return summarise(values, resamples=resamples, seed=seed)


def bootstrap_interval(
    values: Array, *, level: float = LEVEL, resamples: int = RESAMPLES, seed: int = 0
) -> Interval | None:
    """Confidence interval of a mean: percentiles of the means of resamples.

    Args:
        values: (n,).
        level: between 0 and 1, exclusive.
        resamples: 1 or more.
        seed: of the resampling.

    Returns:
        None for fewer than two values. Equal values give an interval of zero width: no other value was observed,
        which does not mean that no other is possible.

    Raises:
        ValueError: level or resamples are out of range.

    Source: B. Efron, Ann. Statist. 7 (1979) 1; percentile method of Efron & Tibshirani (1993), chapter 13.
    """
    if not 0.0 < level < 1.0 or resamples < 1:
        raise ValueError(f"level must be between 0 and 1 and resamples positive, got {level} and {resamples}")
    if len(values) < 2:
        return None
    in_order = np.sort(np.asarray(values, dtype=float))  # the order of episodes does not matter
    return _bootstrap_interval(in_order.tobytes(), level, resamples, seed)


@lru_cache(maxsize=4096)  # an evaluation needs most intervals several times: all episodes, a family, the successful
def _bootstrap_interval(buffer: bytes, level: float, resamples: int, seed: int) -> Interval:
    values = np.frombuffer(buffer)
    count = len(values)
    if resamples * count <= _MAX_DRAWN:
        means = values[_resampled(count, resamples, seed)].mean(axis=1)
    else:
        generator = np.random.Generator(np.random.PCG64(seed))
        means, rows = np.empty(resamples), max(_MAX_DRAWN // count, 1)
        for start in range(0, resamples, rows):
            part = means[start : start + rows]
            part[:] = values[generator.integers(0, count, size=(len(part), count))].mean(axis=1)
    low, high = np.quantile(means, ((1.0 - level) / 2.0, (1.0 + level) / 2.0))
    return Interval(_rounded(low), _rounded(high))


@lru_cache(maxsize=4)
def _resampled(count: int, resamples: int, seed: int) -> IntArray:
    """Indices of the resamples of `count` values, (resamples, count); the same for all metrics."""
    return np.random.Generator(np.random.PCG64(seed)).integers(0, count, size=(resamples, count))


def wilson_interval(count: int, total: int, *, level: float = LEVEL) -> Interval:
    """Confidence interval of a proportion; it has a positive width even if the count is 0 or the total.

    Args:
        count: 0 to total.
        total: 1 or more.
        level: between 0 and 1, exclusive.

    Raises:
        ValueError: an argument is out of range.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    if not (0 <= count <= total and total > 0 and 0.0 < level < 1.0):
        raise ValueError(
            "count must be in 0..total, total positive and level between 0 and 1,"
            f" got {count} of {total} at level {level}"
        )
    z = NormalDist().inv_cdf((1.0 + level) / 2.0)
    fraction, weight = count / total, z * z / total
    centre = (fraction + weight / 2.0) / (1.0 + weight)
    half = z * (fraction * (1.0 - fraction) / total + weight / (4.0 * total)) ** 0.5 / (1.0 + weight)
    return Interval(_rounded(max(centre - half, 0.0)), _rounded(min(centre + half, 1.0)))


def _rounded(value: Any) -> float:
    """Round to 1e-6, without -0.0."""
    return round(float(value), 6) + 0.0
