"""Random numbers that stay the same from release to release, machine to machine and worker to worker.

NumPy guarantees the stream of `SeedSequence` and of PCG64's raw numbers, but not the streams of its distributions.
The few distributions that sonata2d needs are therefore computed here from raw 53-bit fractions.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, Literal, TypeVar, get_args
from zlib import crc32

import numpy as np

from .portable_math import Array, exp_of

T = TypeVar("T")
# Append only: a stream is seeded by the index of its name, so a new order would change every recorded episode.
StreamName = Literal[
    "scene", "people", "noise", "controller", "company", "glances", "manners", "journeys", "deviations", "order",
    "sensors", "attributes", "words",
]  # fmt: skip
_STREAM_NAMES: tuple[StreamName, ...] = get_args(StreamName)
_ULP = 1.0 / 9007199254740992.0  # 2 ** -53, the spacing of 53-bit fractions
_MAX_DRAWS = 10_000
_POISSON_STEP = 30.0  # largest mean that is drawn at once: exp(-mean) must not vanish
_TERMS = 12  # uniform numbers in a sum of variance 1


class RandomStream:
    """A named stream of random numbers of one episode.

    Args:
        seed: seed of the data set, 0 or more.
        episode: index of the episode in the data set.
        name: what the numbers are used for; streams of different names are independent.
        entity: id of the agent, or name of the type of furniture, that the numbers belong to, where each has a stream
            of its own.

    >>> RandomStream(7, 0, "scene").uniform() == RandomStream(7, 0, "scene").uniform()
    True
    """

    def __init__(self, seed: int, episode: int, name: StreamName, entity: int | str | None = None) -> None:
        key = (episode, _STREAM_NAMES.index(name))
        entity = crc32(entity.encode()) if isinstance(entity, str) else entity
        self._bits = np.random.PCG64(_entropy(seed, key if entity is None else (*key, entity)))

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """A float in [low, high)."""
        return low + (high - low) * ((self._bits.random_raw() >> 11) * _ULP)

    def uniforms(self, count: int) -> Array:
        """Floats in [0, 1), equal to as many calls of `uniform`; (count,)."""
        fractions: Any = (self._bits.random_raw(count) >> np.uint64(11)) * _ULP
        return np.asarray(fractions, dtype=np.float64)

    def normals(self, count: int) -> Array:
        """Floats with mean 0 and standard deviation 1, nearly normally distributed, within ±6; (count,).

        Sums of twelve uniform numbers, which have the same bits on every processor; faster than `normal`.
        """
        sums: Array = np.add.reduce(self.uniforms(_TERMS * count).reshape(_TERMS, count), axis=0)
        return sums - _TERMS / 2

    def integer(self, low: int, high: int) -> int:
        """An integer from low to high, both included."""
        return min(low + int(self.uniform() * (high - low + 1)), high)

    def choice(self, items: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """One of the items, with probabilities proportional to the weights; without weights all are equally likely.

        Raises:
            ValueError: there are no items, or no weight is above 0.
        """
        if not items:
            raise ValueError("choice needs at least one item")
        if weights is None:
            return items[self.integer(0, len(items) - 1)]
        total = 0.0
        for weight in weights:  # in order: the result of the built-in sum depends on the Python version
            total += weight
        if not total > 0.0:
            raise ValueError(f"choice needs a weight above 0, got {list(weights)}")
        remainder = self.uniform(0.0, total)
        for item, weight in zip(items, weights, strict=True):
            remainder -= weight
            if remainder < 0.0:
                return item
        # Rounding can leave a remainder of zero after the last item.
        return [item for item, weight in zip(items, weights, strict=True) if weight > 0.0][-1]

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """The items in random order."""
        pool = list(items)
        return [pool.pop(self.integer(0, len(pool) - 1)) for _ in items]

    def poisson(self, mean: float) -> int:
        """A count from the Poisson distribution.

        Args:
            mean: 0 or more.

        Source: D. E. Knuth, The Art of Computer Programming 2 (1969), 3.4.1: uniform numbers are multiplied until the
        product is below exp(-mean). A large mean is split into parts, whose counts are added.
        """
        count = 0
        while mean > 0.0:
            part = min(mean, _POISSON_STEP)
            mean, limit, product = mean - part, exp_of(-part), self.uniform()
            while product >= limit:
                count, product = count + 1, product * self.uniform()
        return count

    def normal(self, mean: float, sd: float, low: float, high: float) -> float:
        """A float from the normal distribution, truncated to [low, high] by rejection.

        Args:
            mean, sd: mean and standard deviation before truncation.
            low, high: bounds of the result.

        Raises:
            ValueError: low is not below high, or none of 10 000 draws fell between them.

        Source: Kinderman & Monahan, ACM Trans. Math. Softw. 3 (1977) 257, ratio of uniforms.
        """
        if not low < high:
            raise ValueError(f"normal needs low < high, got {low}..{high}")
        for _ in range(_MAX_DRAWS):
            u = 1.0 - self.uniform()
            x = 1.7155277699214135 * (self.uniform() - 0.5) / u  # sqrt(8 / e)
            value = mean + sd * x
            if low <= value <= high and u <= exp_of(-x * x / 4):
                return value
        raise ValueError(
            f"none of {_MAX_DRAWS} draws of normal({mean}, {sd}) fell in {low}..{high}; "
            "widen the range or move the mean into it"
        )


def _entropy(seed: int, key: tuple[int, ...]) -> Any:
    """Entropy of a stream, equal to `SeedSequence(seed, spawn_key=key)`.

    NumPy mixes the words of the seed, filled up to four, and the words of the key. An array of these words takes a
    third of the time.
    """
    try:
        return np.frombuffer(struct.pack(f"={4 + len(key)}I", seed, 0, 0, 0, *key), dtype=np.uint32)
    except struct.error:  # a number of more than 32 bits, or one that NumPy rejects
        return np.random.SeedSequence(seed, spawn_key=key)


def stream_key(seed: int, episode: int, name: StreamName) -> tuple[int, int]:
    """Two words of 32 bits that differ between seeds, episodes and names of streams."""
    sequence = np.random.SeedSequence(seed, spawn_key=(episode, _STREAM_NAMES.index(name)))
    first, second = sequence.generate_state(2).tolist()
    return first, second
