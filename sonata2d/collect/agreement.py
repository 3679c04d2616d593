"""How well ratings agree: of one person with their own of before, and of different people.

Alpha is computed from sums of squares. With x a rating's place on the scale, or the vector with a 1 at its class, the
squared differences of all pairs among m values sum to 2 m times their sum of squares about the mean, so observed and
expected disagreement need no table of coincidences, however many places a slider has.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np

from ..core.labels import LabelSpec
from ..core.portable_math import Array
from .rating import Rating, questions

Metric = Literal["nominal", "ordinal", "interval"]
METRIC: dict[str, Metric] = {"yes_no": "nominal", "classes": "ordinal", "slider": "interval"}
_STEADINESS = {
    "yes_no": "Cohen's kappa",
    "classes": "Cohen's kappa, quadratic weights",
    "slider": "intraclass correlation ICC(2,1)",
}


@dataclass(frozen=True, slots=True)
class Steadiness:
    """How well a person agrees with their own answers, where a run was shown again unannounced.

    Attributes:
        rater: id of the person.
        repeats: how many runs were rated twice.
        same: share of those with the same label both times, 0 to 1; None without any.
        difference: mean size of the difference, in classes, or in lengths of the slider; None without any.
        measure: name of the coefficient.
        value: of the coefficient; None where it is not defined: fewer than two repeats, or all labels alike.
    """

    rater: str
    repeats: int
    same: float | None
    difference: float | None
    measure: str
    value: float | None


@dataclass(frozen=True, slots=True)
class Disputed:
    """A run about which people differ.

    Attributes:
        file: its name.
        sha256: of the file.
        labels: by rater.
        spread: mean difference between two raters, in lengths of the scale, 0 to 1.
    """

    file: str
    sha256: str
    labels: dict[str, Any]
    spread: float


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well the ratings of one question agree.

    Attributes:
        spec: what was asked.
        raters: ids, sorted.
        ratings: how many, repeats included.
        runs: how many different runs.
        shared: how many of them were rated by two people or more.
        within: each rater with themselves; empty for texts.
        measure: name of the coefficient between raters; empty for texts.
        alpha: its value; None where it is not defined: nothing shared, or all labels alike.
        disputed: shared runs on which people differ, the most disputed first.
    """

    spec: LabelSpec
    raters: tuple[str, ...]
    ratings: int
    runs: int
    shared: int
    within: tuple[Steadiness, ...]
    measure: str
    alpha: float | None
    disputed: tuple[Disputed, ...]


def agreements(ratings: Iterable[Rating]) -> list[Agreement]:
    """How well ratings agree, question by question."""
    ratings = list(ratings)
    return [agreement([r for r in ratings if r.spec == spec], spec) for spec in questions(ratings)]


def agreement(ratings: Sequence[Rating], spec: LabelSpec) -> Agreement:
    """How well ratings of one question agree; between raters, each one's first answer about a run counts."""
    raters = tuple(sorted({rating.rater for rating in ratings}))
    units = _by_run(rating for rating in ratings if rating.showing == 1)
    shared = {run: given for run, given in units.items() if len(given) > 1}
    metric = METRIC.get(spec.kind)
    values = [[float(r.label) for r in given.values()] for given in shared.values()] if metric else []
    return Agreement(
        spec=spec,
        raters=raters,
        ratings=len(ratings),
        runs=len({rating.sha256 for rating in ratings}),
        shared=len(shared),
        within=tuple(_steadiness(rater, ratings, spec) for rater in raters) if metric else (),
        measure=f"Krippendorff's alpha, {metric}" if metric else "",
        alpha=krippendorff_alpha(values, metric) if metric else None,
        disputed=_disputed(shared, spec) if metric else (),
    )


def krippendorff_alpha(units: Iterable[Sequence[float]], metric: Metric) -> float | None:
    """Agreement beyond chance: 1 is perfect, 0 what chance gives; any number of raters, values may be missing.

    Args:
        units: the values that each unit was given, in any order; a unit with fewer than two has nothing to compare.
        metric: how far two values are apart: `nominal`, different or not; `ordinal`, by how many values lie between
            them; `interval`, by their difference.

    Returns:
        None where it is not defined: no unit has two values, or all values are alike.

    Source: K. Krippendorff, Content Analysis, 4th ed. (2019), ch. 12: alpha = 1 - D_o / D_e.
    """
    pairable = [np.asarray(unit, dtype=float) for unit in units if len(unit) > 1]
    if not pairable:
        return None
    values = np.concatenate(pairable)
    places, n = _places(values, metric), len(values)
    total = _squares(places)
    if total == 0.0:
        return None
    ends = np.cumsum([len(unit) for unit in pairable])
    parts = np.split(places, ends[:-1])
    within = sum(len(part) / (len(part) - 1) * _squares(part) for part in parts)
    return 1.0 - (n - 1) / n * within / total


def _places(values: Array, metric: Metric) -> Array:
    """(n, d): points whose squared distances are the metric's, up to a common factor."""
    levels, index, counts = np.unique(values, return_inverse=True, return_counts=True)
    if metric == "nominal":
        return np.eye(len(levels))[index]
    if metric == "ordinal":  # δ² = (Σ n_g from c to k, less half of n_c and n_k)², a difference of middle ranks
        return (np.cumsum(counts) - counts / 2)[index][:, None]
    return values[:, None]


def _squares(points: Array) -> float:
    """Sum of squared distances to the mean; exactly 0 if all are alike."""
    if (points == points[0]).all():
        return 0.0
    return float(((points - points.mean(axis=0)) ** 2).sum())


def weighted_kappa(first: Sequence[float], again: Sequence[float]) -> float | None:
    """Agreement of two series of ordered classes beyond chance; disagreement weighs as the square of its size.

    With two classes it is Cohen's kappa without weights. None with fewer than two pairs or all values alike.

    Source: J. Cohen, Psychol. Bull. 70 (1968) 213, with weights v = (i - j)².
    """
    if len(first) < 2:
        return None
    a, b = np.asarray(first, dtype=float), np.asarray(again, dtype=float)
    expected = float(((a[:, None] - b[None, :]) ** 2).mean())
    return None if expected == 0.0 else 1.0 - float(((a - b) ** 2).mean()) / expected


def intraclass_correlation(scores: Any) -> float | None:
    """ICC(2,1): how far single scores of the same unit agree in value, not in order only.

    Args:
        scores: (n, k), n units, each scored k times.

    Returns:
        None with fewer than two units or all scores alike.

    Source: P. E. Shrout & J. L. Fleiss, Psychol. Bull. 86 (1979) 420, ICC(2,1); recommended for test and retest
    (absolute agreement) by T. K. Koo & M. Y. Li, J. Chiropr. Med. 15 (2016) 155.
    """
    x = np.asarray(scores, dtype=float)
    n, k = x.shape if x.ndim == 2 else (0, 0)
    if n < 2 or k < 2 or (x == x.flat[0]).all():
        return None
    rows, columns = x.mean(axis=1), x.mean(axis=0)
    bms = k * float(((rows - x.mean()) ** 2).sum()) / (n - 1)
    jms = n * float(((columns - x.mean()) ** 2).sum()) / (k - 1)
    left = x - rows[:, None] - columns[None, :] + x.mean()
    ems = float((left**2).sum()) / ((n - 1) * (k - 1))
    return float((bms - ems) / (bms + (k - 1) * ems + k * (jms - ems) / n))


def _by_run(ratings: Iterable[Rating]) -> dict[str, dict[str, Rating]]:
    """Ratings by run and rater; of several, the first one given."""
    runs: dict[str, dict[str, Rating]] = {}
    for rating in ratings:
        runs.setdefault(rating.sha256, {}).setdefault(rating.rater, rating)
    return runs


def _steadiness(rater: str, ratings: Iterable[Rating], spec: LabelSpec) -> Steadiness:
    own = [rating for rating in ratings if rating.rater == rater]
    first, again = ({r.sha256: float(r.label) for r in own if r.showing == showing} for showing in (1, 2))
    pairs = [(first[run], value) for run, value in again.items() if run in first]
    measure = _STEADINESS[spec.kind]
    if not pairs:
        return Steadiness(rater, 0, None, None, measure, None)
    same = sum(a == b for a, b in pairs) / len(pairs)
    difference = sum(abs(a - b) for a, b in pairs) / len(pairs)
    before, after = zip(*pairs, strict=True)
    value = intraclass_correlation(pairs) if spec.kind == "slider" else weighted_kappa(before, after)
    return Steadiness(rater, len(pairs), same, difference, measure, value)


def _disputed(shared: dict[str, dict[str, Rating]], spec: LabelSpec) -> tuple[Disputed, ...]:
    """By falling spread, then by name."""
    found = []
    for run, given in shared.items():
        pairs = list(combinations([spec.place_of(rating.label) for rating in given.values()], 2))
        spread = sum(abs(a - b) for a, b in pairs) / len(pairs)
        if spread > 0.0:
            file = min(rating.file for rating in given.values())
            found.append(Disputed(file, run, {rater: given[rater].label for rater in sorted(given)}, spread))
    return tuple(sorted(found, key=lambda run: (-run.spread, run.file)))
