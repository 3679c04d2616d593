"""Fixed-point arithmetic: numbers are multiples of a power of two, short enough that no sum of products is rounded.

Neither the order of a sum nor a fused multiply-add changes the result, so a matrix product by any BLAS gives the same
bits on every processor. Only this module rounds numbers to fixed point.
"""

from __future__ import annotations

import numpy as np

from ..core.portable_math import Array, IntArray, exp

UNIT, LARGEST_VALUE = 1.0 / (1 << 14), 64.0  # of values: 20 bits
WEIGHT_UNIT, LARGEST_WEIGHT = 1.0 / (1 << 13), 32.0  # 18 bits: a sum of 2^14 products has 52 bits; a double holds 53
SLOPE = 0.01  # of the leaky ReLU below 0
BLOCK = 1 << 17  # multiplications per call: from 2^18 on OpenBLAS starts threads, which cost more than they save here


def round_values(numbers: Array) -> Array:
    """Clip numbers to ±64 and round them to multiples of 2^-14; any shape."""
    rounded: Array = np.rint(np.minimum(np.maximum(numbers, -LARGEST_VALUE), LARGEST_VALUE) / UNIT) * UNIT
    return rounded


def round_weights(numbers: Array) -> Array:
    """Round weights to multiples of 2^-13; any shape.

    Raises:
        ValueError: a weight is beyond ±32.
    """
    if not (np.abs(numbers) <= LARGEST_WEIGHT).all():
        raise ValueError(f"weights must be within ±{LARGEST_WEIGHT:g}, got {np.abs(numbers).max():g}")
    rounded: Array = np.rint(np.asarray(numbers) / WEIGHT_UNIT) * WEIGHT_UNIT
    return rounded


def leaky_relu(numbers: Array, slope: float = SLOPE) -> Array:
    """Leaky ReLU."""
    activated: Array = np.where(numbers > 0.0, numbers, numbers * slope)
    return activated


def tanh(numbers: Array) -> Array:
    """Hyperbolic tangent; relative error below 1e-6."""
    small = exp(-2.0 * np.abs(numbers))
    activated: Array = np.where(numbers < 0.0, -1.0, 1.0) * (1.0 - small) / (1.0 + small)
    return activated


def product(rows: Array, weight: Array) -> Array:
    """Matrix product of rounded values and rounded weights; exact for `in` up to 2^15.

    Args:
        rows: (n, in), from `round_values`.
        weight: (in, out), from `round_weights`.

    Returns:
        (n, out).
    """
    count = max(BLOCK // weight.size, 1)
    if len(rows) <= count:
        whole: Array = rows @ weight
        return whole
    return np.concatenate([rows[k : k + count] @ weight for k in range(0, len(rows), count)])


def dot(rows: Array, weight: Array) -> Array:
    """Scalar products of rounded values and rounded weights along the last axis; (..., n) each, to (...)."""
    products: Array = np.add.reduce(rows * weight, axis=-1)
    return products


def scatter_sum(rows: Array, index: IntArray, count: int) -> Array:
    """Add up rows by index; exact if the rows are rounded values.

    Args:
        rows: (E, ...).
        index: (E,), where each row is added, 0 to count - 1.
        count: number of sums.

    Returns:
        (count, ...).
    """
    total: Array = np.zeros((count, *rows.shape[1:]))
    np.add.at(total, index, rows)
    return total
