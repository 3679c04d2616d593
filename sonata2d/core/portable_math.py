"""Elementary functions that give the same bits on every processor.

The C library's and NumPy's own exp, atan2, sin and cos differ in the last bit between processors (fused multiply-add,
AVX-512), and a simulation amplifies such a difference. Here they are built from ``+ - * /`` and ``sqrt`` alone, which
IEEE 754 defines to the bit. All functions work element by element.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

PI = math.pi
TAN_PI_8 = 0.41421356237309503
# Taylor coefficients of the odd powers of x.
_ATAN = (
    1.0, -1 / 3, 1 / 5, -1 / 7, 1 / 9, -1 / 11, 1 / 13, -1 / 15, 1 / 17, -1 / 19, 1 / 21, -1 / 23, 1 / 25,
)  # fmt: skip


def _polynomial(coefficients: tuple[float, ...], x: Any) -> Any:
    """Evaluate a polynomial by Horner's rule; coefficients from the lowest power up, x a float or an array."""
    total = coefficients[-1] * x + coefficients[-2]
    for coefficient in coefficients[-3::-1]:
        total = total * x + coefficient
    return total


def exp(x: Array) -> Array:
    """Exponential function for x <= 0, with a relative error under 2e-7 for x >= -20; 0 for x < -60.

    Args:
        x: any shape, zero or negative.

    Returns:
        e to the power of x, of the shape of x.
    """
    y = np.maximum(x, -60.0) * (1 / 64)  # exp(x) = exp(x / 64) ** 64: the series converges fast near 0
    y = _polynomial((1.0, 1.0, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720, 1 / 5040), y)
    for _ in range(6):
        y = y * y
    return np.where(x < -60.0, 0.0, y)


def exp_of(x: float) -> float:
    """`exp` of one float, with the same bits; zero or negative."""
    if x < -60.0:
        return 0.0
    y = x * (1 / 64)
    y = ((((((1 / 5040 * y + 1 / 720) * y + 1 / 120) * y + 1 / 24) * y + 1 / 6) * y + 1 / 2) * y + 1.0) * y + 1.0
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    return y * y


def arctan2(y: Array, x: Array) -> Array:
    """Angle of the vectors (x, y), with an absolute error under 1e-10 rad.

    Args:
        y: any shape.
        x: the same shape.

    Returns:
        Radians in (-pi, pi], of the shape of x; 0 for the null vector.
    """
    ax, ay = np.abs(x), np.abs(y)
    low, high = np.minimum(ax, ay), np.maximum(ax, ay)
    t = low / np.where(high > 0.0, high, 1.0)
    is_reduced = t > TAN_PI_8  # atan t = pi/4 + atan((t - 1) / (t + 1))
    t = np.where(is_reduced, (t - 1.0) / (t + 1.0), t)
    angle = t * _polynomial(_ATAN, t * t) + np.where(is_reduced, PI / 4, 0.0)
    # from the first octant back to the octant of (x, y)
    angle = np.where(ay > ax, PI / 2 - angle, angle)
    angle = np.where(x < 0.0, PI - angle, angle)
    signed: Array = np.where(y < 0.0, -angle, angle)
    return signed


def angle_of(y: float, x: float) -> float:
    """`arctan2` of two floats, with the same bits."""
    ax, ay = abs(x), abs(y)
    low, high = (ay, ax) if ax > ay else (ax, ay)
    if high == 0.0:
        return 0.0
    t = low / high
    offset = 0.0
    if t > TAN_PI_8:
        t = (t - 1.0) / (t + 1.0)
        offset = PI / 4
    # Horner's rule written out, as in `exp_of`: kernels compile these functions.
    s = t * t
    p = ((1 / 25 * s - 1 / 23) * s + 1 / 21) * s - 1 / 19
    p = (((p * s + 1 / 17) * s - 1 / 15) * s + 1 / 13) * s - 1 / 11
    p = (((p * s + 1 / 9) * s - 1 / 7) * s + 1 / 5) * s - 1 / 3
    angle = t * (p * s + 1.0) + offset
    angle = PI / 2 - angle if ay > ax else angle
    angle = PI - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


def unit_vector(theta: float) -> tuple[float, float]:
    """Unit vector (cos theta, sin theta) of an angle in radians."""
    quarters = math.floor(theta / (PI / 2) + 0.5)
    x = theta - quarters * (PI / 2)  # in [-pi/4, pi/4], where the series converge fast
    # Horner's rule written out, as in `exp_of`: kernels compile these functions.
    q = x * x
    s = ((1 / 6227020800 * q - 1 / 39916800) * q + 1 / 362880) * q - 1 / 5040
    s = x * (((s * q + 1 / 120) * q - 1 / 6) * q + 1.0)
    c = (((-1 / 87178291200 * q + 1 / 479001600) * q - 1 / 3628800) * q + 1 / 40320) * q - 1 / 720
    c = ((c * q + 1 / 24) * q - 1 / 2) * q + 1.0
    return ((c, s), (-s, c), (-c, -s), (s, -c))[quarters % 4]


def unit_vectors(theta: Array) -> Array:
    """Unit vectors of angles in radians, with the same bits as `unit_vector`; (...) to (..., 2), NaN stays NaN."""
    angle = np.asarray(theta, dtype=float)
    quarters = np.floor(angle / (PI / 2) + 0.5)
    x = angle - quarters * (PI / 2)
    q = x * x
    s = ((1 / 6227020800 * q - 1 / 39916800) * q + 1 / 362880) * q - 1 / 5040
    s = x * (((s * q + 1 / 120) * q - 1 / 6) * q + 1.0)
    c = (((-1 / 87178291200 * q + 1 / 479001600) * q - 1 / 3628800) * q + 1 / 40320) * q - 1 / 720
    c = ((c * q + 1 / 24) * q - 1 / 2) * q + 1.0
    quarters = quarters % 4.0
    is_odd = quarters % 2.0 == 1.0
    along_x, along_y = np.where(is_odd, s, c), np.where(is_odd, c, s)
    negative_x, negative_y = (quarters == 1.0) | (quarters == 2.0), quarters >= 2.0
    return np.stack((np.where(negative_x, -along_x, along_x), np.where(negative_y, -along_y, along_y)), axis=-1)


def rotation(angle: Any) -> tuple[Any, Any]:
    """(cos, sin) of a small angle, normalised to unit length; the error is under 2e-7 for |angle| < 0.5.

    Args:
        angle: radians; a float or an array.

    Returns:
        Cosine and sine, of the type and shape of the angle.
    """
    t = angle * 0.5
    square = t * t
    t = t * (1.0 + square * (1 / 3 + square * (2 / 15 + square * (17 / 315))))  # tan of the half angle
    n = 1.0 + t * t
    return (1.0 - t * t) / n, 2.0 * t / n
