"""Fixed-point arithmetic: numbers are multiples of a power of two, short enough that no sum of products is rounded.

Neither the order of a sum nor a fused multiply-add changes the result, so a matrix product by any BLAS gives the same
bits on every processor. Only this module rounds numbers to fixed point.
"""

from __future__ import annotations

import numpy as np

from ..core.compiled.kernel import kernel, subroutine
from ..core.portable_math import Array, exp_of

UNIT, LARGEST_VALUE = 1.0 / (1 << 14), 64.0  # of values: 20 bits
_WEIGHT_UNIT, LARGEST_WEIGHT = 1.0 / (1 << 13), 32.0  # 18 bits: a sum of 2^14 products has 52 bits; a double holds 53
SLOPE = 0.01  # of the leaky ReLU below 0
BLOCK = 1 << 18  # multiplications per call: beyond it OpenBLAS starts threads, which cost more than they save here
_SHIFT = UNIT * (3 << 51)  # doubles of this size are multiples of the unit


@subroutine
def rounded(value: float) -> float:
    """Clip a number to ±64 and round it to a multiple of 2^-14, half to even."""
    return min(max(value, -LARGEST_VALUE), LARGEST_VALUE) + _SHIFT - _SHIFT


@subroutine
def leaky_relu(value: float, slope: float) -> float:
    """Leaky ReLU; the identity for the slope 1."""
    return value if value > 0.0 else value * slope


@kernel
def activate(rows: Array, bias: Array, slope: float) -> None:
    """Add the bias, apply a leaky ReLU, and round; in place.

    Args:
        rows: (n, width).
        bias: (width,).
        slope: of the leaky ReLU; 1: none.
    """
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            rows[i, j] = rounded(leaky_relu(rows[i, j] + bias[j], slope))


def round_weights(numbers: Array) -> Array:
    """Round weights to multiples of 2^-13; any shape.

    Raises:
        ValueError: a weight is beyond ±32.
    """
    if not (np.abs(numbers) <= LARGEST_WEIGHT).all():
        raise ValueError(f"weights must be within ±{LARGEST_WEIGHT:g}, got {np.abs(numbers).max():g}")
    rounded_weights: Array = np.rint(np.asarray(numbers) / _WEIGHT_UNIT) * _WEIGHT_UNIT
    return rounded_weights


def tanh(value: float) -> float:
    """Hyperbolic tangent; relative error below 1e-6."""
    small = exp_of(-2.0 * abs(value))
    return (-1.0 if value < 0.0 else 1.0) * (1.0 - small) / (1.0 + small)


def product(rows: Array, weight: Array, out: Array | None = None) -> Array:
    """Matrix product of rounded values and rounded weights; exact for `in` up to 2^15.

    Args:
        rows: (n, in), of rounded values.
        weight: (in, out), from `round_weights`.
        out: (n, out), written; None: a new array.

    Returns:
        (n, out).
    """
    result = np.empty((len(rows), weight.shape[1])) if out is None else out
    # `np.dot` takes half as long as `@` for the few rows of a relation.
    count = max(BLOCK // weight.size, 1)
    if len(rows) <= count:
        np.dot(rows, weight, result)
    else:
        for k in range(0, len(rows), count):
            np.dot(rows[k : k + count], weight, result[k : k + count])
    return result
