"""The robot's outline for kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...core.compiled.packing import Floats, Floats2
from ...core.compiled.scalar import RADIUS
from ...core.geometry import Shape

# Columns of `Body.target`, after the core line and the radius of a near outline, `START_X` to `RADIUS` as of barriers:
# the depth to which the robot may overlap with it, and its gap at the start of the substep (m).
ALLOWED, START_GAP = RADIUS + 1, RADIUS + 2
TARGET_SIZE = RADIUS + 3


class Body(NamedTuple):
    """Outline of the robot: all points within `rounding` of a convex polygon, the core.

    Attributes:
        core: (K, 2), corners of the core in the body frame, counter-clockwise, m.
        rounding: m.
        corners: (K, 2), scratch, the corners at a pose, m.
        target: (N + B + E, 7), scratch, the near outlines.
        found: (5,), scratch, a separation.
        motion: (5,), what `shaped.limit_motion` returns: velocity ahead and to the left, m/s; turn rate, rad/s;
            fraction of the velocity with which the robot pushes pedestrians; whether the guard reduced it.
    """

    core: Floats2
    rounding: float
    corners: Floats2
    target: Floats2
    found: Floats
    motion: Floats


def body_of(outline: Shape, near: int) -> Body:
    """The body of a robot.

    Args:
        outline: its shape.
        near: number of outlines that can be near, for `shaped.limit_motion`.
    """
    core = np.array(outline.core, dtype=float)
    return Body(core, float(outline.rounding), core.copy(), np.zeros((near, TARGET_SIZE)), np.zeros(5), np.zeros(5))
