"""Arithmetic in fixed point: numbers are multiples of a power of two, and so few bits long that no sum is ever rounded.

So neither the order of a sum nor a fused multiply-add matters, and a matrix product by any BLAS gives the same bits on
every processor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..exact import Array, exp

UNIT, LARGEST_VALUE = 1.0 / (1 << 14), 64.0  # of values: 20 bits
WEIGHT_UNIT, LARGEST_WEIGHT = 1.0 / (1 << 13), 32.0  # 18 bits: of 2^14 products the sum has 52, and a double holds 53
SLOPE = 0.01  # below 0, of the leaky ReLU


def values(numbers: Any) -> Array:
    """Rounded to fixed point, and kept within ±64."""
    rounded: Array = np.rint(np.minimum(np.maximum(numbers, -LARGEST_VALUE), LARGEST_VALUE) / UNIT) * UNIT
    return rounded


def weights(numbers: Any) -> Array:
    """Rounded to fixed point.

    Raises:
        ValueError: one is beyond ±32.
    """
    if not (np.abs(numbers) <= LARGEST_WEIGHT).all():
        raise ValueError(f"weights must be within ±{LARGEST_WEIGHT:g}, got {np.abs(numbers).max():g}")
    rounded: Array = np.rint(np.asarray(numbers) / WEIGHT_UNIT) * WEIGHT_UNIT
    return rounded


def leaky(numbers: Array, slope: float = SLOPE) -> Array:
    """Leaky ReLU."""
    bent: Array = np.where(numbers > 0.0, numbers, numbers * slope)
    return bent


def tanh(numbers: Array) -> Array:
    """Hyperbolic tangent; relative error under 1e-6."""
    small = exp(-2.0 * np.abs(numbers))
    bent: Array = np.where(numbers < 0.0, -1.0, 1.0) * (1.0 - small) / (1.0 + small)
    return bent


def incidence(at: Any, count: int) -> Array:
    """(count, E) of 0 and 1: times (E, …) it adds up rows by index, exactly, as long as these are `values`.

    Args:
        at: (E,) of int, where each row goes.
        count: of sums.
    """
    ones: Array = np.zeros((count, len(at)))
    ones[at, np.arange(len(at))] = 1.0
    return ones
