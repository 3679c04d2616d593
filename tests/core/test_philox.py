"""The generator against its published test vectors; draws do not depend on the order of agents."""

from __future__ import annotations

import numpy as np
import pytest

from sonata2d.core.compiled.kernel import kernel
from sonata2d.core.philox import Draws, draws_of, philox, uniform
from sonata2d.core.portable_math import Array

ONES = 0xFFFFFFFF


@kernel
def words(counter: Array, key: Array, out: Array) -> None:
    """`philox`, compiled."""
    out[0], out[1], out[2], out[3] = philox(counter[0], counter[1], counter[2], counter[3], key[0], key[1])


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ((0, 0, 0, 0), (0, 0), "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ((ONES,) * 4, (ONES,) * 2, "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            "d16cfe09 94fdcceb 5001e420 24126ea1",
        ),
    ],
)
def test_the_words_are_those_of_the_known_answers(
    counter: tuple[int, ...], key: tuple[int, ...], expected: str
) -> None:
    """Random123, kat_vectors, philox4x32 with 10 rounds."""
    out = np.zeros(4, dtype=np.int64)
    words(np.array(counter, dtype=np.int64), np.array(key, dtype=np.int64), out)
    assert " ".join(f"{word:08x}" for word in out.tolist()) == expected
    assert philox(*counter, *key) == tuple(out.tolist())


def drawn(order: list[int]) -> list[list[float]]:
    """Three numbers of each of three agents for each of two purposes, drawn in an order of agents."""
    draws: Draws = draws_of(5, 7, "people", [3, 11, 4], 2)
    numbers: list[list[float]] = [[], [], []]
    for _ in range(3):
        for k in order:
            numbers[k] += [uniform(draws, k, 0), uniform(draws, k, 1)]
    return numbers


def test_numbers_depend_on_agent_and_purpose_but_not_on_the_order() -> None:
    numbers = drawn([0, 1, 2])
    assert numbers == drawn([2, 0, 1])
    everything = [number for own in numbers for number in own]
    assert len(set(everything)) == 18
    assert 0.0 <= min(everything) < max(everything) < 1.0


def test_numbers_are_uniform() -> None:
    draws = draws_of(0, 0, "people", [1], 1)
    numbers = np.array([uniform(draws, 0, 0) for _ in range(4000)])
    counts = np.histogram(numbers, bins=10, range=(0.0, 1.0))[0]
    assert ((counts - 400.0) ** 2 / 400.0).sum() < 27.9  # chi-squared, 9 degrees of freedom, p = 0.001
