"""Random draws that stay the same from release to release, machine to machine and worker to worker.

NumPy promises the stream of `SeedSequence` and of PCG64's raw numbers, not that of its distributions, so the few that
sonata2d needs are made here from raw 53-bit doubles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeVar

import numpy as np

from .portable_math import exp

T = TypeVar("T")
Child = Literal["scene", "people", "noise", "controller", "company", "glances", "manners"]
_ULP = 1.0 / 9007199254740992.0  # of a 53-bit fraction
_CHILDREN: tuple[Child, ...] = ("scene", "people", "noise", "controller", "company", "glances", "manners")


class RandomStream:
    """One named stream of random numbers of one episode.

    Args:
        seed: the data set's seed, 0 or more.
        episode: number of the episode within the data set.
        child: what the numbers are for; streams of different name never touch.
        of: id of whom they are for, where each has a stream of their own.

    >>> Chance(7, 0, "scene").uniform() == Chance(7, 0, "scene").uniform()
    True
    """

    def __init__(self, seed: int, episode: int, child: Child, of: int | None = None) -> None:
        key = (episode, _CHILDREN.index(child))
        sequence = np.random.SeedSequence(seed, spawn_key=key if of is None else (*key, of))
        self._bits = np.random.PCG64(sequence)

    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """A float in [low, high)."""
        return low + (high - low) * ((int(self._bits.random_raw()) >> 11) * _ULP)

    def integer(self, low: int, high: int) -> int:
        """A whole number in low..high, both included."""
        return min(low + int(self.uniform() * (high - low + 1)), high)

    def choice(self, items: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """One of the items, in proportion to the weights (alike if none)."""
        if weights is None:
            return items[self.integer(0, len(items) - 1)]
        total = 0.0
        for weight in weights:  # in order: the built-in sum differs from Python to Python
            total += weight
        left = self.uniform(0.0, total)
        for item, weight in zip(items, weights, strict=True):
            left -= weight
            if left < 0.0:
                return item
        return [item for item, weight in zip(items, weights, strict=True) if weight > 0.0][-1]

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """The items in random order."""
        pool = list(items)
        return [pool.pop(self.integer(0, len(pool) - 1)) for _ in items]

    def normal(self, mean: float, sd: float, low: float, high: float) -> float:
        """A normal draw, drawn again until it falls in [low, high].

        Source: Kinderman & Monahan, ACM Trans. Math. Softw. 3 (1977) 257, ratio of uniforms.
        """
        if not low < high:
            raise ValueError(f"normal needs low < high, got {low}..{high}")
        for _ in range(10_000):
            u = 1.0 - self.uniform()
            x = 1.7155277699214135 * (self.uniform() - 0.5) / u  # sqrt(8 / e)
            value = mean + sd * x
            if low <= value <= high and u <= float(exp(np.array(-x * x / 4))):
                return value
        raise ValueError(f"normal({mean}, {sd}) hardly ever falls in {low}..{high}")
