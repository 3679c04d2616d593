"""Kernels that look at all rows of an episode."""

from __future__ import annotations

import math

import numpy as np

from ...core.compiled.kernel import kernel
from ...core.compiled.scalar import is_inside, quantised
from ...core.humans import X, Y
from ...core.portable_math import Array, BoolArray


@kernel
def first_not_canonical(rows: Array, is_angle: BoolArray) -> int:
    """The first row with a number that files do not hold, see `record.canonical`; -1: there is none.

    Args:
        rows: (R, C); NaN is allowed.
        is_angle: (C,), columns with angles, which must lie in (-3.1416, 3.1416].
    """
    for r in range(len(rows)):
        for c in range(len(is_angle)):
            value = rows[r, c]
            if value != value:
                continue
            if value != quantised(value) or (value == 0.0 and math.copysign(1.0, value) < 0.0):
                return r
            if is_angle[c] and not -3.1416 < value <= 3.1416:
                return r
    return -1


@kernel
def inside_room(rows: Array, edges: Array) -> BoolArray:
    """Whether positions lie in a room; (R,) of bool.

    Args:
        rows: (R, columns), x and y first, m; NaN is outside.
        edges: of the room, see `scalar.is_inside`.
    """
    inside = np.zeros(len(rows), dtype=np.bool_)
    for r in range(len(rows)):
        inside[r] = is_inside(edges, rows[r, X], rows[r, Y])
    return inside
