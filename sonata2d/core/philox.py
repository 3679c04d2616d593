"""Random numbers for kernels, by agent and purpose: the order in which agents draw them does not matter.

The generator computes a number from its key and from a counter, which here is made of the agent, the purpose, and how
many numbers the agent has drawn for it.

Source: Salmon, Moraes, Dror & Shaw, Proc. SC '11 (2011), article 16: Philox4x32-10.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .compiled.kernel import kernel, subroutine
from .compiled.packing import Ints, Ints2
from .portable_math import IntArray
from .rng import StreamName, stream_key

_ROUNDS = 10
_MULTIPLIER_0, _MULTIPLIER_1 = 0xD2511F53, 0xCD9E8D57
_WEYL_0, _WEYL_1 = 0x9E3779B9, 0xBB67AE85
_MASK = 0xFFFFFFFF
_FRACTION = 1.0 / 9007199254740992.0  # 2 ** -53


class Draws(NamedTuple):
    """The random numbers of all agents of an episode.

    Attributes:
        key: (2,) of int, 32 bits each, of the episode.
        id: (N,) of int, of the agents.
        used: (N, P) of int, how many numbers each agent has drawn for each purpose.
    """

    key: Ints
    id: Ints
    used: Ints2


def draws_of(seed: int, episode: int, name: StreamName, ids: Sequence[int], purposes: int) -> Draws:
    """The random numbers of one name, for a number of purposes; none of them is drawn yet."""
    key = np.array(stream_key(seed, episode, name), dtype=np.int64)
    return Draws(key, np.array(ids, dtype=np.int64), np.zeros((len(ids), purposes), dtype=np.int64))


def first_words(seed: int, episode: int, name: StreamName, ids: Sequence[int]) -> IntArray:
    """A random word of 32 bits for each agent, (N,) of int."""
    words, key = np.array(ids, dtype=np.int64), stream_key(seed, episode, name)
    _fill_words(words, *key)
    return words


@kernel
def _fill_words(words: IntArray, key_0: int, key_1: int) -> None:
    """Replace ids by random words."""
    for k in range(len(words)):
        id = int(words[k])  # not a number of NumPy, whose products overflow in the interpreter
        words[k], _, _, _ = philox(0, 0, id & _MASK, (id >> 32) & _MASK, key_0, key_1)


@subroutine
def uniform(draws: Draws, k: int, purpose: int) -> float:
    """The next random number of agent k for a purpose, in [0, 1)."""
    number, agent = int(draws.used[k, purpose]), int(draws.id[k])
    draws.used[k, purpose] += 1
    first, second, _, _ = philox(
        number & _MASK, purpose, agent & _MASK, (agent >> 32) & _MASK, int(draws.key[0]), int(draws.key[1])
    )
    return ((first >> 5) * 67108864.0 + (second >> 6)) * _FRACTION


@subroutine
def uniform_between(draws: Draws, k: int, purpose: int, low: float, high: float) -> float:
    """The next random number of agent k for a purpose, in [low, high)."""
    return low + (high - low) * uniform(draws, k, purpose)


@subroutine
def philox(c0: int, c1: int, c2: int, c3: int, k0: int, k1: int) -> tuple[int, int, int, int]:
    """Philox4x32-10: four random words of 32 bits from a counter and a key, of 32 bits each."""
    for _ in range(_ROUNDS):
        # Compiled products of more than 63 bits overflow into the sign; their lower 64 bits are right all the same.
        a, b = _MULTIPLIER_0 * c0, _MULTIPLIER_1 * c2
        c0, c1, c2, c3 = ((b >> 32) & _MASK) ^ c1 ^ k0, b & _MASK, ((a >> 32) & _MASK) ^ c3 ^ k1, a & _MASK
        k0, k1 = (k0 + _WEYL_0) & _MASK, (k1 + _WEYL_1) & _MASK
    return c0, c1, c2, c3
