"""Means, medians, confidence intervals, differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from sonata2d.metrics.evaluation import Evaluation
from sonata2d.metrics.summary import _resampled, bootstrap_interval, differences, summarise, wilson_interval

from .samples import evaluation, measured

NUMBERS = st.lists(st.floats(-100.0, 100.0).map(lambda v: round(v, 3)), min_size=2, max_size=30)


def test_undefined_values_are_left_out() -> None:
    summary = summarise([1.0, None, 2.0, 6.0, None])
    assert (summary.n, summary.mean, summary.median) == (3, 3.0, 2.0)
    assert summarise([None, None]).to_json() == {"n": 0, "mean": None, "median": None, "low": None, "high": None}
    assert summarise([2.0]).interval is None


def test_interval_of_two_values_is_their_range() -> None:
    """Means of resamples are 0, 1/2 or 1 with odds 1 : 2 : 1, so that 95 % include both ends."""
    assert bootstrap_interval(np.array([0.0, 1.0])) == (0.0, 1.0)


def test_interval_of_many_values_is_that_of_the_normal_distribution() -> None:
    values = np.random.Generator(np.random.PCG64(1)).normal(5.0, 2.0, 400)
    interval = bootstrap_interval(values, resamples=4000)
    assert interval is not None
    half = 1.96 * values.std() / 20.0
    assert interval == pytest.approx((values.mean() - half, values.mean() + half), abs=0.03)


def test_resamples_draw_each_value_as_often() -> None:
    drawn = np.bincount(_resampled(4, 5000, 0).ravel())
    assert drawn == pytest.approx(np.full(4, 5000), rel=0.05)


@settings(max_examples=30)
@given(NUMBERS, st.floats(-10.0, 10.0).map(lambda v: round(v, 2)))
def test_interval_lies_within_the_values_and_shifts_with_them(numbers: list[float], shift: float) -> None:
    interval = bootstrap_interval(np.array(numbers), resamples=300)
    shifted = bootstrap_interval(np.array(numbers) + shift, resamples=300)
    assert interval is not None
    assert shifted is not None
    assert min(numbers) - 1e-6 <= interval.low <= interval.high <= max(numbers) + 1e-6
    assert shifted == pytest.approx((interval.low + shift, interval.high + shift), abs=2e-6)
    assert interval == bootstrap_interval(np.array(numbers), resamples=300)


@pytest.mark.parametrize(("level", "resamples"), [(0.0, 10), (1.0, 10), (0.9, 0)])
def test_invalid_level_or_resamples_is_refused(level: float, resamples: int) -> None:
    with pytest.raises(ValueError, match="level must be between 0 and 1"):
        bootstrap_interval(np.array([1.0, 2.0]), level=level, resamples=resamples)


def test_differences_are_taken_scene_by_scene() -> None:
    """Scenes 0 and 1 are common and defined; 2 is undefined in one, 3 and 4 are not common."""
    first = {0: {"t": 10.0}, 1: {"t": 20.0}, 2: {"t": None}, 3: {"t": 1.0}}
    second = {0: {"t": 11.0}, 1: {"t": 23.0}, 2: {"t": 5.0}, 4: {"t": 1.0}}
    summary = differences(first, second, "t")
    assert (summary.n, summary.mean, summary.interval) == (2, 2.0, (1.0, 3.0))


@given(st.integers(1, 500), st.floats(0.0, 1.0))
def test_wilson_interval_ends_where_the_count_is_not_yet_surprising(total: int, part: float) -> None:
    """At each end p the fraction is 1.96 standard errors of p away, unless the end is 0 or 1."""
    count = round(part * total)
    fraction = count / total
    for end in (interval := wilson_interval(count, total)):
        if 0.0 < end < 1.0:
            assert (fraction - end) ** 2 == pytest.approx(1.959964**2 * end * (1.0 - end) / total, abs=2e-5)
    assert interval.low <= fraction <= interval.high


def test_wilson_interval_of_none_in_ten_has_a_width() -> None:
    assert wilson_interval(0, 10) == (0.0, pytest.approx(0.2775, abs=1e-4))
    with pytest.raises(ValueError, match="got 3 of 2"):
        wilson_interval(3, 2)


VALUES = [0.3, None, 0.9, 0.1, 0.7, 0.7, None, 0.2]


def test_the_order_of_episodes_changes_nothing() -> None:
    for seed in range(5):
        order = np.random.default_rng(seed).permutation(len(VALUES)).tolist()
        assert summarise([VALUES[k] for k in order]) == summarise(VALUES)
    whole, base = evaluation("a", *VALUES), evaluation("b", *VALUES[::-1])
    backwards = Evaluation("a", whole.episodes[::-1])
    assert backwards.difference(base, "spl") == whole.difference(base, "spl")
    assert backwards.quartiles("spl") == whole.quartiles("spl")
    assert backwards.share("spl") == whole.share("spl")


def test_pooling_the_parts_of_a_data_set_gives_the_whole() -> None:
    whole = evaluation("a", *VALUES)
    parts = Evaluation("a", [*whole.episodes[5:], *whole.episodes[:2], *whole.episodes[2:5]])
    assert parts.summary("spl") == whole.summary("spl")
    means = [Evaluation("a", part).summary("spl") for part in (whole.episodes[:3], whole.episodes[3:])]
    assert sum(m.n * (m.mean or 0.0) for m in means) / 6 == pytest.approx(whole.summary("spl").mean)


def test_a_data_set_compared_with_its_copy_has_no_differences() -> None:
    first, copy = evaluation("a", *VALUES), evaluation("copy", *VALUES)
    assert copy.difference(first, "spl").to_json() == {"n": 6, "mean": 0.0, "median": 0.0, "low": 0.0, "high": 0.0}
    assert not copy.differs(first, "spl")
    twice = Evaluation("twice", [*first.episodes, *copy.episodes])
    assert twice.difference(first, "spl") == copy.difference(first, "spl")
    assert (twice.summary("spl").mean, twice.summary("spl").n) == (first.summary("spl").mean, 12)


def test_several_episodes_in_one_scene_count_by_their_mean() -> None:
    """Scene 0: 0.2 and 0.6 against 0.1; scene 1: 0.5 against 0.9."""
    several = Evaluation("a", [measured(0, {"spl": 0.2}), measured(1, {"spl": 0.5}), measured(0, {"spl": 0.6})])
    other = evaluation("b", 0.1, 0.9)
    for each in (several, Evaluation("a", several.episodes[::-1])):
        difference = each.difference(other, "spl")
        assert (difference.n, difference.mean) == (2, pytest.approx((0.3 - 0.4) / 2))
        assert difference.interval == pytest.approx((-0.4, 0.3))
