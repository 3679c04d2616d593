"""Whether the robot is at its goal, in kernels."""

from __future__ import annotations

import numpy as np

from .compiled.kernel import subroutine
from .compiled.scalar import angle_of, length, wrap_angle
from .entities import ANY_HEADING, Goal
from .humans import BODY_X, BODY_Y, X, Y
from .portable_math import Array

THETA, DISTANCE, ANGLE = 2, 3, 4  # columns of a goal after X and Y


def goal_row(goal: Goal) -> Array:
    """(5,): position (m), heading (rad), and the distance (m) and angle (rad) at which it is reached."""
    return np.array([goal.x, goal.y, goal.theta, goal.distance, goal.angle], dtype=float)


@subroutine
def is_at_goal(goal: Array, robot: Array) -> bool:
    """As `Goal.is_reached`; the robot in the columns of `core.state`."""
    if length(goal[X] - robot[X], goal[Y] - robot[Y]) > goal[DISTANCE]:
        return False
    if goal[ANGLE] >= ANY_HEADING:
        return True
    return bool(abs(wrap_angle(angle_of(robot[BODY_Y], robot[BODY_X]) - goal[THETA])) <= goal[ANGLE])
