"""Stamps that rise by no less than a tick in floating point, whichever two of them are subtracted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.portable_math import Array

_GRID = 2.0**30  # stamps are multiples of 1/_GRID s, so that differences of stamps below 2**23 s are exact


def exact_stamps(tick: Any, dt: float) -> Array:
    """Times at which readers find every tick: those that compare `t - last >= 0.1` lose frames to decimal 0.1 s.

    The step is the tick's length rounded up to a multiple of 2**-30 s: 10 000 ticks end less than 10 microseconds
    late, and n ticks are never shorter than n * dt.

    Args:
        tick: (T,) of int, from 0.
        dt: s.

    Returns:
        (T,), s.
    """
    step = math.ceil(dt * _GRID) / _GRID
    return np.asarray(tick, dtype=np.float64) * step
