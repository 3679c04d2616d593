"""Coefficients of agreement equal the examples of the literature and hand calculations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonata2d.collect.agreement import (
    Metric,
    agreement,
    agreements,
    intraclass_correlation,
    krippendorff_alpha,
    weighted_kappa,
)
from sonata2d.collect.rating import Rating
from sonata2d.core.labels import LabelSpec

# K. Krippendorff, Computing Krippendorff's alpha-reliability (2011), example C: 4 observers, 12 units, 7 values missing
OBSERVERS = """
1 2 3 3 2 1 4 1 2 . . .
1 2 3 3 2 2 4 1 2 5 . 3
. 3 3 3 2 3 4 2 2 5 1 .
1 2 3 3 2 4 4 1 2 5 1 .
"""
UNITS = [
    [float(value) for value in unit if value != "."]
    for unit in zip(*(row.split() for row in OBSERVERS.strip().splitlines()), strict=True)
]


@pytest.mark.parametrize(("metric", "alpha"), [("nominal", 0.743), ("ordinal", 0.815), ("interval", 0.849)])
def test_alpha_equals_krippendorffs_example(metric: Metric, alpha: float) -> None:
    assert krippendorff_alpha(UNITS, metric) == pytest.approx(alpha, abs=5e-4)


@pytest.mark.parametrize("metric", ["nominal", "ordinal", "interval"])
def test_alpha_by_sums_of_squares_equals_alpha_by_coincidences(metric: Metric) -> None:
    """Krippendorff's formula, alpha = 1 - (n - 1) Σ o_ck δ² / Σ n_c n_k δ², on pseudo-random data with gaps."""
    bits = np.random.PCG64(5)
    units = [[float(bits.random_raw() % 6) ** 1.5 for _ in range(bits.random_raw() % 5)] for _ in range(40)]
    assert krippendorff_alpha(units, metric) == pytest.approx(_by_coincidences(units, metric), abs=1e-12)


def _by_coincidences(units: list[list[float]], metric: Metric) -> float:
    units = [unit for unit in units if len(unit) > 1]
    levels = sorted({value for unit in units for value in unit})
    o = np.zeros((len(levels), len(levels)))
    for unit in units:
        for i, a in enumerate(unit):
            for b in (*unit[:i], *unit[i + 1 :]):
                o[levels.index(a), levels.index(b)] += 1 / (len(unit) - 1)
    n = o.sum(axis=1)
    delta = np.zeros_like(o)
    for c in range(len(levels)):
        for k in range(len(levels)):
            low, high = min(c, k), max(c, k)
            delta[c, k] = {
                "nominal": float(c != k),
                "ordinal": (n[low : high + 1].sum() - (n[c] + n[k]) / 2) ** 2,
                "interval": (levels[c] - levels[k]) ** 2,
            }[metric]
    return float(1 - (n.sum() - 1) * (o * delta).sum() / (np.outer(n, n) * delta).sum())


def test_alpha_is_undefined_without_pairs_or_variation() -> None:
    assert krippendorff_alpha([], "nominal") is None
    assert krippendorff_alpha([[1.0], [2.0], []], "interval") is None
    assert krippendorff_alpha([[0.1, 0.1], [0.1, 0.1, 0.1]], "interval") is None


def test_alpha_is_one_for_perfect_and_negative_for_opposite_ratings() -> None:
    assert krippendorff_alpha([[1, 1], [2, 2], [3, 3]], "ordinal") == 1.0
    assert krippendorff_alpha([[0, 1], [1, 0]], "nominal") == pytest.approx(-0.5)  # 1 - 3 * 4 / (2 * 2 + 2 * 2)


def test_intraclass_correlation_equals_shrout_and_fleiss_example() -> None:
    """Psychol. Bull. 86 (1979) 420: six targets and four judges of table 2; ICC(2,1) = .29 in table 4."""
    scores = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    assert intraclass_correlation(scores) == pytest.approx(0.29, abs=5e-3)
    assert intraclass_correlation([[1, 1], [2, 2]]) == pytest.approx(1.0)
    assert intraclass_correlation([[1, 1], [1, 1]]) is None
    assert intraclass_correlation([[1, 2]]) is None


def test_weighted_kappa_of_two_classes_equals_cohens_kappa() -> None:
    """50 proposals: 20 yes twice, 15 no twice, 5 and 10 different; p_o = 0.7, p_e = 0.5, kappa = 0.4."""
    first = [1] * 20 + [1] * 5 + [0] * 10 + [0] * 15
    second = [1] * 20 + [0] * 5 + [1] * 10 + [0] * 15
    assert weighted_kappa(first, second) == pytest.approx(0.4)


def test_kappa_is_lower_for_larger_differences() -> None:
    """By hand: squared differences sum to 1 over 3 pairs, and to 1+1+1+4+1+1 = 9 over all nine combinations."""
    assert weighted_kappa([1, 2, 3], [1, 2, 2]) == pytest.approx(1 - (1 / 3) / (9 / 9))
    near, far = weighted_kappa([1, 2, 3, 3], [1, 2, 3, 2]), weighted_kappa([1, 2, 3, 3], [1, 2, 3, 1])
    assert near is not None
    assert far is not None
    assert far < near < 1.0
    assert weighted_kappa([2, 2], [2, 2]) is None
    assert weighted_kappa([2], [2]) is None


SLIDER, YES_NO = LabelSpec("slider"), LabelSpec("yes_no")
CLASSES = LabelSpec("classes", classes=("poor", "fair", "good"))


def _rating(rater: str, run: str, label: object, spec: LabelSpec, showing: int = 1) -> Rating:
    return Rating(rater, f"{run}.json", run, run * 64, label, showing, "2026-01-01T00:00:00Z", 1.0, True, spec)


def test_the_consistency_of_a_rater_compares_first_and_second_showings() -> None:
    labels = [("a", 1, 1), ("b", 2, 2), ("c", 3, 2), ("d", 3, None)]
    ratings = [_rating("ann", run, first, CLASSES) for run, first, _ in labels]
    ratings += [_rating("ann", run, second, CLASSES, 2) for run, _, second in labels if second]
    (ann,) = agreement(ratings, CLASSES).within
    assert (ann.repeats, ann.same, ann.difference) == (3, pytest.approx(2 / 3), pytest.approx(1 / 3))
    assert (ann.measure, ann.value) == ("Cohen's kappa, quadratic weights", pytest.approx(1 - 1 / 3))


def test_between_raters_only_first_ratings_count_and_disputed_runs_are_sorted_by_spread() -> None:
    labels = {"a": (0.1, 0.9), "b": (0.5, 0.6), "c": (0.3, 0.3), "d": (0.7, None)}
    ratings = [_rating("ann", run, first, SLIDER) for run, (first, _) in labels.items()]
    ratings += [_rating("ben", run, second, SLIDER) for run, (_, second) in labels.items() if second is not None]
    result = agreement([_rating("ben", "a", 0.1, SLIDER, 2), *ratings], SLIDER)
    assert (result.raters, result.ratings, result.runs, result.shared) == (("ann", "ben"), 8, 4, 3)
    assert result.alpha == krippendorff_alpha([(0.1, 0.9), (0.5, 0.6), (0.3, 0.3)], "interval")
    assert [(run.file, run.labels) for run in result.disputed] == [
        ("a.json", {"ann": 0.1, "ben": 0.9}),
        ("b.json", {"ann": 0.5, "ben": 0.6}),
    ]
    assert [run.spread for run in result.disputed] == pytest.approx([0.8, 0.1])


def test_a_changed_file_is_another_run() -> None:
    ratings = [_rating("ann", "a", True, YES_NO), replace(_rating("ben", "a", False, YES_NO), sha256="0" * 64)]
    result = agreement(ratings, YES_NO)
    assert (result.runs, result.shared, result.alpha) == (2, 0, None)


def test_each_label_kind_has_its_metric_and_texts_are_only_counted() -> None:
    text = LabelSpec("text")
    ratings = [_rating("ann", "a", "it waited", text), _rating("ben", "a", "it was slow", text)]
    ratings += [_rating("ann", "a", True, YES_NO), _rating("ann", "a", 2, CLASSES), _rating("ann", "a", 0.5, SLIDER)]
    results = {result.spec.kind: result for result in agreements(ratings)}
    assert {kind: result.measure for kind, result in results.items()} == {
        "text": "",
        "yes_no": "Krippendorff's alpha, nominal",
        "classes": "Krippendorff's alpha, ordinal",
        "slider": "Krippendorff's alpha, interval",
    }
    texts = results["text"]
    assert (texts.ratings, texts.shared, texts.within, texts.alpha) == (2, 1, (), None)
