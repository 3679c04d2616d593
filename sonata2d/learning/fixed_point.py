"""Arithmetic in fixed point: numbers are multiples of a power of two, and so few bits long that no sum is ever rounded.

So neither the order of a sum nor a fused multiply-add matters, and a matrix product by any BLAS gives the same bits on
every processor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.portable_math import Array, exp

UNIT, LARGEST_VALUE = 1.0 / (1 << 14), 64.0  # of values: 20 bits
WEIGHT_UNIT, LARGEST_WEIGHT = 1.0 / (1 << 13), 32.0  # 18 bits: of 2^14 products the sum has 52, and a double holds 53
SLOPE = 0.01  # below 0, of the leaky ReLU
BLOCK = 1 << 17  # multiplications at a time: from 2^18 on OpenBLAS starts threads, which here cost more than they save


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


def product(rows: Array, weight: Array) -> Array:
    """Matrix product of `values` and `weights`, (n, in) and (in, out) to (n, out); exact up to 2^15 in."""
    some = max(BLOCK // weight.size, 1)
    if len(rows) <= some:
        whole: Array = rows @ weight
        return whole
    return np.concatenate([rows[k : k + some] @ weight for k in range(0, len(rows), some)])


def dots(rows: Array, weight: Array) -> Array:
    """Scalar products along the last axis of `values` and `weights`, (…, n) each, to (…,)."""
    told: Array = np.add.reduce(rows * weight, axis=-1)
    return told


def summed(rows: Array, at: Any, count: int) -> Array:
    """Rows added up by index; (E, …) and (E,) to (count, …). Exact, as long as each is a `values`."""
    total: Array = np.zeros((count, *rows.shape[1:]))
    np.add.at(total, at, rows)
    return total
