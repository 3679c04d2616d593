"""Doors between the parts of a room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .bounds import ADDITIVE, Id, NotNegative, Opening, OpeningTime, Positive
from .geometry import Edge, Point, Pose
from .portable_math import Array, unit_vector

DoorKind = Literal["hinged", "sliding"]
OpenedBy = Literal["anyone", "people", "request", "nobody"]

HALF_THICKNESS = 0.02  # m, of a leaf
OPEN = 0.9  # opening, from which a door counts as open
RIGHT_ANGLE = 1.5707963267948966  # rad


@dataclass(frozen=True, slots=True)
class InteriorDoor:
    """A door in an opening between walls, with a leaf that opens and closes.

    The opening of a door is a number: 0 is closed. A sliding leaf disappears in the wall at its fixed end; 1 is open. A
    hinged leaf turns on its fixed end to either side, away from whoever opens it, like a double-acting door: 1 is a
    right angle to the left of the closed leaf as seen from the hinge, -1 a right angle to the right.

    A leaf stops before people and robots that are in its way. A hinged leaf that cannot open to one side for 2 s opens
    to the other one.

    Attributes:
        id: unique among interior doors.
        pose: the fixed end of the leaf, and the heading from there along the closed leaf; world frame.
        width: length of the leaf, m.
        kind: how the leaf moves.
        opened_by: who opens the door. anyone: people and robots within 1.5 m, by a sensor; people: people within 1.2 m
            that face it, by hand; request: also robots that ask for it, which they do by standing within 1.2 m for 1 s;
            nobody: the door does not move.
        opening: at the start.
        opening_time: from closed to open, and back, s.
        hold: for which it stays open after the last one has passed, s.
    """

    id: Id
    pose: Pose
    width: Positive = 0.9
    kind: DoorKind = "hinged"
    opened_by: OpenedBy = "anyone"
    opening: Opening = field(default=0.0, metadata=ADDITIVE)
    opening_time: OpeningTime = field(default=1.5, metadata=ADDITIVE)
    hold: NotNegative = field(default=2.0, metadata=ADDITIVE)

    @property
    def moves(self) -> bool:
        """Whether it can open or close during an episode."""
        return self.opened_by != "nobody"

    @property
    def middle(self) -> Point:
        """Middle of the doorway, m."""
        return self.pose.to_world((self.width / 2, 0.0))

    def leaf(self, opening: float) -> Edge:
        """The leaf as a barrier: its fixed end, its free end, and half its thickness; m, world frame.

        Args:
            opening: of the door, -1 to 1.
        """
        (x, y), (ux, uy), size, opening = self.pose.position, self.pose.direction, self.width, float(opening)
        if self.kind == "sliding":
            size *= 1.0 - opening
        elif opening != 0.0:
            c, s = unit_vector(opening * RIGHT_ANGLE)
            ux, uy = ux * c - uy * s, ux * s + uy * c
        return (x, y), (x + ux * size, y + uy * size), HALF_THICKNESS


@dataclass(frozen=True, slots=True)
class DoorState:
    """State of an interior door at one tick.

    Attributes:
        door: the door.
        opening: 0: closed; 1, and of a hinged door also -1: open; see `InteriorDoor`.
    """

    door: InteriorDoor
    opening: float

    @property
    def is_open(self) -> bool:
        """Whether the leaf leaves nine tenths of the doorway free, or more."""
        return abs(self.opening) >= OPEN

    @property
    def leaf(self) -> Edge:
        """Fixed end, free end and half the thickness of the leaf, m, world frame."""
        return self.door.leaf(self.opening)


def leaf_lines(doors: Sequence[InteriorDoor], openings: Array) -> Array:
    """The leaves of doors as thick lines, (T, D, 5): both ends, m, and the radius.

    Args:
        doors: D.
        openings: (T, D).
    """
    lines = [
        [(*start, *end, radius) for start, end, radius in map(InteriorDoor.leaf, doors, row)]
        for row in openings.tolist()
    ]
    return np.array(lines, dtype=float).reshape(len(openings), len(doors), 5)
