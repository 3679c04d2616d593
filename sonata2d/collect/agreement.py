"""Agreement of ratings: of each rater with their own repeated ratings, and between raters.

Krippendorff's alpha is computed from sums of squares instead of a matrix of coincidences, whose memory grows with the
square of the number of distinct values: too large for sliders. Each value is represented by a point such that squared
distances of points are the squared differences of the metric. The squared distances of all pairs among m points sum to
m times their sum of squares about the mean, which gives observed and expected disagreement.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..core.labels import LabelSpec
from ..core.portable_math import Array
from .rating import Rating, questions

Metric = Literal["nominal", "ordinal", "interval"]
# By kind of the label: metric between raters, and name of the coefficient within a rater. Texts have neither.
_MEASURES: dict[str, tuple[Metric, str]] = {
    "yes_no": ("nominal", "Cohen's kappa"),
    "classes": ("ordinal", "Cohen's kappa, quadratic weights"),
    "slider": ("interval", "intraclass correlation ICC(2,1)"),
}


@dataclass(frozen=True, slots=True)
class RaterConsistency:
    """Agreement of a rater with their own ratings of runs that were shown twice.

    Attributes:
        rater: id of the rater.
        repeats: number of runs that were rated twice.
        same: fraction of these runs with equal labels, 0 to 1; None without repeats.
        difference: mean absolute difference, in classes or in lengths of the slider; None without repeats.
        measure: name of the coefficient.
        value: the coefficient; None if undefined: fewer than two repeats, or all labels equal.
    """

    rater: str
    repeats: int
    same: float | None
    difference: float | None
    measure: str
    value: float | None


@dataclass(frozen=True, slots=True)
class DisputedRun:
    """A run with different labels from different raters.

    Attributes:
        file: file name.
        sha256: hash of the file.
        labels: labels by rater.
        spread: mean absolute difference between two raters, as a fraction of the scale, 0 to 1.
    """

    file: str
    sha256: str
    labels: dict[str, Any]
    spread: float


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of the ratings of one question.

    Attributes:
        spec: specification of the label.
        raters: ids, sorted.
        ratings: number of ratings, repeats included.
        runs: number of rated runs.
        shared: number of runs rated by two or more raters.
        within: consistency of each rater; empty for texts.
        measure: name of the coefficient between raters; empty for texts.
        alpha: the coefficient; None if undefined: no shared runs, or all labels equal.
        disputed: shared runs with different labels, by decreasing spread.
    """

    spec: LabelSpec
    raters: tuple[str, ...]
    ratings: int
    runs: int
    shared: int
    within: tuple[RaterConsistency, ...]
    measure: str
    alpha: float | None
    disputed: tuple[DisputedRun, ...]


def agreements(ratings: Iterable[Rating]) -> list[Agreement]:
    """Agreement for each question."""
    ratings = list(ratings)
    return [agreement([r for r in ratings if r.spec == spec], spec) for spec in questions(ratings)]


def agreement(ratings: Sequence[Rating], spec: LabelSpec) -> Agreement:
    """Agreement of the ratings of one question; between raters only the first rating of a run counts."""
    raters = tuple(sorted({rating.rater for rating in ratings}))
    by_run = _first_ratings(rating for rating in ratings if rating.showing == 1)
    shared = {run: by_rater for run, by_rater in by_run.items() if len(by_rater) > 1}
    counts = (len(ratings), len({rating.sha256 for rating in ratings}), len(shared))
    if spec.kind not in _MEASURES:
        return Agreement(spec, raters, *counts, within=(), measure="", alpha=None, disputed=())
    metric, _ = _MEASURES[spec.kind]
    values = [[float(rating.label) for rating in by_rater.values()] for by_rater in shared.values()]
    return Agreement(
        spec,
        raters,
        *counts,
        within=tuple(_consistency(rater, ratings, spec) for rater in raters),
        measure=f"Krippendorff's alpha, {metric}",
        alpha=krippendorff_alpha(values, metric),
        disputed=_disputed_runs(shared, spec),
    )


def krippendorff_alpha(units: Iterable[Sequence[float]], metric: Metric) -> float | None:
    """Agreement beyond chance for any number of raters and missing values: 1 is perfect, 0 is chance.

    Args:
        units: values given to each unit, in any order; units with fewer than two values are ignored.
        metric: difference of two values: `nominal`, equal or not; `ordinal`, the number of values between them;
            `interval`, their arithmetic difference.

    Returns:
        None if undefined: no unit has two values, or all values are equal.

    Source: K. Krippendorff, Content Analysis, 4th ed. (2019), ch. 12: alpha = 1 - D_o / D_e.
    """
    pairable = [np.asarray(unit, dtype=float) for unit in units if len(unit) > 1]
    if not pairable:
        return None
    values = np.concatenate(pairable)
    points, n = _points(values, metric), len(values)
    total = _sum_of_squares(points)
    if total == 0.0:
        return None
    ends = np.cumsum([len(unit) for unit in pairable])
    within = sum(len(part) / (len(part) - 1) * _sum_of_squares(part) for part in np.split(points, ends[:-1]))
    return 1.0 - (n - 1) / n * within / total


def _points(values: Array, metric: Metric) -> Array:
    """(n, d): points whose squared distances are the squared differences of the metric, up to a common factor."""
    levels, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    if metric == "nominal":
        return np.eye(len(levels))[index]
    if metric == "ordinal":  # δ² = (Σ n_g from c to k - (n_c + n_k) / 2)², the squared difference of mid-ranks
        return (np.cumsum(counts) - counts / 2)[index][:, None]
    return values[:, None]


def _sum_of_squares(points: Array) -> float:
    """Sum of squared distances to the mean; exactly 0 if all points are equal."""
    if (points == points[0]).all():
        return 0.0
    return float(((points - points.mean(axis=0)) ** 2).sum())


def weighted_kappa(first: Sequence[float], second: Sequence[float]) -> float | None:
    """Agreement of two series of ordered classes beyond chance, with quadratic weights.

    With two classes it equals Cohen's kappa without weights.

    Returns:
        None if undefined: fewer than two pairs, or all values equal.

    Source: J. Cohen, Psychol. Bull. 70 (1968) 213, with weights v = (i - j)².
    """
    if len(first) < 2:
        return None
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    expected = float(((a[:, None] - b[None, :]) ** 2).mean())
    return None if expected == 0.0 else 1.0 - float(((a - b) ** 2).mean()) / expected


def intraclass_correlation(scores: ArrayLike) -> float | None:
    """ICC(2,1): absolute agreement of single scores of the same unit.

    Args:
        scores: (n, k), n units with k scores each.

    Returns:
        None if undefined: fewer than two units or scores, or all scores equal.

    Source: P. E. Shrout & J. L. Fleiss, Psychol. Bull. 86 (1979) 420, ICC(2,1); recommended for test and retest
    (absolute agreement) by T. K. Koo & M. Y. Li, J. Chiropr. Med. 15 (2016) 155.
    """
    x = np.asarray(scores, dtype=float)
    n, k = x.shape if x.ndim == 2 else (0, 0)
    if n < 2 or k < 2 or (x == x.flat[0]).all():
        return None
    rows, columns = x.mean(axis=1), x.mean(axis=0)
    bms = k * float(((rows - x.mean()) ** 2).sum()) / (n - 1)  # mean squares: between units
    jms = n * float(((columns - x.mean()) ** 2).sum()) / (k - 1)  # between scores
    residual = x - rows[:, None] - columns[None, :] + x.mean()
    ems = float((residual**2).sum()) / ((n - 1) * (k - 1))  # of the error
    return float((bms - ems) / (bms + (k - 1) * ems + k * (jms - ems) / n))


def _first_ratings(ratings: Iterable[Rating]) -> dict[str, dict[str, Rating]]:
    """The first rating of each rater, by run and rater."""
    by_run: dict[str, dict[str, Rating]] = {}
    for rating in ratings:
        by_run.setdefault(rating.sha256, {}).setdefault(rating.rater, rating)
    return by_run


def _consistency(rater: str, ratings: Iterable[Rating], spec: LabelSpec) -> RaterConsistency:
    """Agreement of a rater's first and repeated ratings."""
    by_showing: defaultdict[int, dict[str, float]] = defaultdict(dict)  # labels by hash of the run
    for rating in ratings:
        if rating.rater == rater:
            by_showing[rating.showing][rating.sha256] = float(rating.label)
    pairs = [(by_showing[1][run], value) for run, value in by_showing[2].items() if run in by_showing[1]]
    metric, measure = _MEASURES[spec.kind]
    if not pairs:
        return RaterConsistency(rater, 0, None, None, measure, None)
    same = sum(a == b for a, b in pairs) / len(pairs)
    difference = sum(abs(a - b) for a, b in pairs) / len(pairs)
    before, after = zip(*pairs, strict=True)
    value = intraclass_correlation(pairs) if metric == "interval" else weighted_kappa(before, after)
    return RaterConsistency(rater, len(pairs), same, difference, measure, value)


def _disputed_runs(shared: dict[str, dict[str, Rating]], spec: LabelSpec) -> tuple[DisputedRun, ...]:
    """Shared runs with different labels, by decreasing spread, then by file name."""
    disputed = []
    for run, by_rater in shared.items():
        pairs = list(combinations([spec.position_of(rating.label) for rating in by_rater.values()], 2))
        spread = sum(abs(a - b) for a, b in pairs) / len(pairs)
        if spread > 0.0:
            file = min(rating.file for rating in by_rater.values())
            labels = {rater: by_rater[rater].label for rater in sorted(by_rater)}
            disputed.append(DisputedRun(file, run, labels, spread))
    return tuple(sorted(disputed, key=lambda run: (-run.spread, run.file)))
