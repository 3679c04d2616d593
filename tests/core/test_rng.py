"""Random streams: their numbers never change, and their distributions are right."""

from typing import Any

import numpy as np
import pytest

from sonata2d.core.rng import RandomStream


def test_the_stream_never_changes() -> None:
    rng = RandomStream(7, 3, "scene")
    drawn = [rng.uniform(), rng.integer(1, 6), rng.normal(1.3, 0.2, 0.8, 1.8)]
    assert drawn == [0.84588954125817, 2, 1.3078922575191396]


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1, 2**32, 2**64 + 5, 2**128 - 1, 2**128, 2**200 + 3])
@pytest.mark.parametrize(("episode", "entity"), [(0, None), (3, 0), (2**32 + 1, 17), (5, 2**40)])
def test_streams_are_seeded_as_by_a_seed_sequence_of_numpy(seed: int, episode: int, entity: int | None) -> None:
    key = (episode, 1) if entity is None else (episode, 1, entity)
    expected = np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key))
    stream = RandomStream(seed, episode, "people", entity)
    assert [stream.uniform() for _ in range(3)] == [(int(expected.random_raw()) >> 11) / 2**53 for _ in range(3)]


@pytest.mark.parametrize(("seed", "error"), [(-1, ValueError), (1.5, TypeError), ("3", TypeError)])
def test_a_seed_that_numpy_refuses_is_refused(seed: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        RandomStream(seed, 0, "people")


def test_streams_differ_by_seed_episode_and_name() -> None:
    streams = [
        RandomStream(7, 3, "scene"),
        RandomStream(8, 3, "scene"),
        RandomStream(7, 4, "scene"),
        RandomStream(7, 3, "people"),
    ]
    assert len({stream.uniform() for stream in streams}) == 4


def test_integers_are_uniform_over_their_range() -> None:
    rng = RandomStream(0, 0, "noise")
    counts = np.bincount([rng.integer(2, 5) for _ in range(8000)], minlength=6)
    assert counts[:2].tolist() == [0, 0]
    assert np.abs(counts[2:] - 2000).max() < 200  # 5 standard deviations


def test_normal_has_its_mean_and_deviation_and_stays_within_bounds() -> None:
    rng = RandomStream(0, 0, "noise")
    drawn = np.array([rng.normal(0.0, 1.0, -4.0, 4.0) for _ in range(8000)])
    assert abs(drawn.mean()) < 0.06
    assert drawn.std() == pytest.approx(1.0, abs=0.05)
    assert np.abs(drawn).max() <= 4.0


def test_choices_are_proportional_to_the_weights() -> None:
    rng = RandomStream(0, 0, "noise")
    picks = [rng.choice("abc", [1.0, 0.0, 3.0]) for _ in range(4000)]
    assert picks.count("b") == 0
    assert picks.count("c") == pytest.approx(3000, abs=150)


@pytest.mark.parametrize(("low", "high", "message"), [(2.0, 1.0, "low < high"), (40.0, 41.0, "none of 10000 draws")])
def test_normal_rejects_a_range_without_draws(low: float, high: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RandomStream(0, 0, "noise").normal(0.0, 1.0, low, high)


def test_many_uniforms_are_those_of_single_draws() -> None:
    one_by_one, together = (RandomStream(7, 3, "glances", 2) for _ in range(2))
    assert together.uniforms(5).tolist() == [one_by_one.uniform() for _ in range(5)]
    assert together.uniform() == one_by_one.uniform()


@pytest.mark.parametrize(
    ("items", "weights", "message"),
    [(["a", "b"], [0.0, 0.0], "a weight above 0"), ([], None, "at least one item"), ([], [], "at least one item")],
)
def test_a_choice_without_possible_items_is_refused(
    items: list[str], weights: list[float] | None, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        RandomStream(1, 0, "scene").choice(items, weights)
