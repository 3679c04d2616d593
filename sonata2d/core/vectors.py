"""Lengths of plane vectors, and angles wrapped to (-pi, pi], with the same bits on every processor."""

from __future__ import annotations

import math

import numpy as np

from .portable_math import PI, Array

X, Y = 0, 1  # columns of an (..., 2) array of points or vectors


def length(x: float, y: float) -> float:
    """Length of one vector."""
    return math.sqrt(x * x + y * y)


def lengths(vectors: Array) -> Array:
    """Lengths of vectors; (..., 2) to (...)."""
    x, y = vectors[..., X], vectors[..., Y]
    norms: Array = np.sqrt(x * x + y * y)
    return norms


def wrap_angle(angle: float) -> float:
    """The equivalent angle in (-pi, pi], radians."""
    wrapped = angle - 2 * PI * math.ceil((angle - PI) / (2 * PI))
    return wrapped if wrapped > -PI else PI  # rounding can leave -pi itself


def wrap_angles(angles: Array) -> Array:
    """The equivalent angles in (-pi, pi], radians; any shape, NaN stays NaN."""
    wrapped: Array = angles - 2 * PI * np.ceil((angles - PI) / (2 * PI))
    return np.where(wrapped <= -PI, PI, wrapped)
