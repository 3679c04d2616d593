"""The robots as pedestrians know them: where they are, and their outlines."""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Floats, Floats2, Ints
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.separation import SEPARATION_SIZE
from ...core.state import ROBOT_SIZE


class Robots(NamedTuple):
    """The R robots of a scene.

    Attributes:
        state: (R, 13), columns of `core.state`, of the present tick.
        core: (M, 2), corners of the outlines, each robot's in its own frame, m.
        first: (R + 1,) of int, where the corners of each robot begin.
        rounding: (R,), m, of the outlines.
        radius: (R,), m, of the circles around them.
        corners: (M, 2), scratch.
        found: (5,), scratch, a separation.
    """

    state: Floats2
    core: Floats2
    first: Ints
    rounding: Floats
    radius: Floats
    corners: Floats2
    found: Floats


def robots_of(scene: Scene) -> Robots:
    """The robots of a scene at its start."""
    robots = [robot for robot, _ in scene.tasks]
    core = [corner for robot in robots for corner in robot.outline.core]
    state = np.zeros((len(robots), ROBOT_SIZE))
    state[:, :2] = [robot.pose.position for robot in robots]
    return Robots(
        state=state,
        core=np.array(core),
        first=np.array([*accumulate((len(robot.outline.core) for robot in robots), initial=0)], dtype=np.int64),
        rounding=np.array([float(robot.outline.rounding) for robot in robots]),
        radius=np.array([robot.radius for robot in robots]),
        corners=np.array(core),
        found=np.zeros(SEPARATION_SIZE),
    )


@subroutine
def core_of(robots: Robots, r: int) -> Array:
    """Corners of the outline of robot r in its frame, (K, 2), m."""
    return robots.core[robots.first[r] : robots.first[r + 1]]


@subroutine
def corners_of(robots: Robots, r: int) -> Array:
    """Scratch for the corners of robot r, (K, 2), m."""
    return robots.corners[robots.first[r] : robots.first[r + 1]]
