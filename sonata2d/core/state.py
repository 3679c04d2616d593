"""The numbers of one tick as one row: the robot, then all pedestrians of the scene, other robots and doors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .humans import OMEGA, frozen
from .portable_math import Array, BoolArray, IntArray

# Columns of the robot: X, Y, VX, VY, BODY_X, BODY_Y and OMEGA as in `core.humans`, then the body-frame twist that the
# drive executed in the last tick, and whether the safety guard reduced the velocity (1) or not (0).
EXECUTED_VX, EXECUTED_VY, EXECUTED_OMEGA, GUARDED = range(OMEGA + 1, OMEGA + 5)
ROBOT_SIZE, HUMAN_SIZE = GUARDED + 1, OMEGA + 1


class State(NamedTuple):
    """The state of the world at one tick; read-only.

    Attributes:
        row: (13 + 9 N + 13 M + D,): the robot's columns above, then for each of the N pedestrians of the scene, present
            or not, the columns of `core.humans`, then those of the M other robots, then the openings of the D interior
            doors that move; SI units, world frame.
        activity: (N,) of int, into `relations.ACTIVITIES`.
        is_present: (N,) of bool; None: all pedestrians are present.
        door_count: D.
    """

    row: Array
    activity: IntArray
    is_present: BoolArray | None = None
    door_count: int = 0

    @property
    def robot(self) -> Array:
        """(13,)."""
        return self.row[:ROBOT_SIZE]

    @property
    def humans(self) -> Array:
        """(N, 9), one row for each pedestrian of the scene; arbitrary for absent ones."""
        return self.row[ROBOT_SIZE : self._end_of_humans].reshape(-1, HUMAN_SIZE)

    @property
    def robots(self) -> Array:
        """(M, 13), one row for each other robot of the scene."""
        return self.row[self._end_of_humans : len(self.row) - self.door_count].reshape(-1, ROBOT_SIZE)

    @property
    def doors(self) -> Array:
        """(D,), openings of the interior doors that move, see `InteriorDoor`."""
        return self.row[len(self.row) - self.door_count :]

    @property
    def _end_of_humans(self) -> int:
        return ROBOT_SIZE + HUMAN_SIZE * len(self.activity)

    def with_robots(self, order: Sequence[int]) -> State:
        """The state with the robots in another order, by their present places, of which 0 is that of `robot`."""
        rows = np.concatenate((self.robot[None], self.robots))[list(order)]
        return self._replace(row=frozen(np.concatenate((rows[0], self.humans.ravel(), rows[1:].ravel(), self.doors))))
