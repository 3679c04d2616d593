"""Doors between the parts of a room: where their leaves are, for kernels and for the interpreter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from .barrier_grid import Solids, packed_solids, set_barrier, solids_of, with_grid_of
from .bounds import ADDITIVE, Id, NotNegative, Opening, Positive
from .compiled.kernel import kernel, subroutine
from .compiled.packing import Floats, Floats2, Ints, Ints2, Packed
from .compiled.scalar import rotation
from .geometry import Barriers, Edge, Point, Pose
from .portable_math import Array

DoorKind = Literal["hinged", "sliding"]
OpenedBy = Literal["anyone", "people", "request", "nobody"]

HALF_THICKNESS = 0.02  # m, of a leaf
OPEN = 0.9  # opening, from which a door counts as open
_RIGHT_ANGLE = 1.5707963267948966  # rad

# Columns of `door_frames`: the fixed end of the leaf, m; unit vector along the closed leaf; width, m; whether it turns
# on a hinge; who opens it, as index; change of the opening in a tick; time for which it stays open, s.
HINGE_X, HINGE_Y, CLOSED_X, CLOSED_Y, WIDTH, IS_HINGED, OPENED_BY, STEP, HOLD = range(9)
ANYONE, PEOPLE, REQUEST = range(3)
_OPENED_BY: tuple[OpenedBy, ...] = ("anyone", "people", "request", "nobody")


@dataclass(frozen=True, slots=True)
class InteriorDoor:
    """A door in an opening between walls, with a leaf that opens and closes.

    The opening of a door is a number: 0 is closed. A sliding leaf disappears in the wall at its fixed end, 1 is open. A
    hinged leaf turns on its fixed end to either side, as that of a double-acting door: away from whoever opens it; 1 is
    a right angle to the left of the closed leaf as seen from the hinge, and -1 to the right.

    A leaf stops before people and robots that are in its way. A hinged leaf that cannot open to one side for 2 s opens
    to the other one.

    Attributes:
        id: unique among interior doors.
        pose: the fixed end of the leaf, and the heading from there along the closed leaf; world frame.
        width: length of the leaf, m.
        kind: how the leaf moves.
        opened_by: who opens the door. anyone: people and robots within 1.5 m, by a sensor; people: people within 1.2 m
            that face it, by hand; request: also robots that ask for it, which they do by standing within 1.2 m for 1 s;
            nobody: it stays as it is.
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
    opening_time: Positive = field(default=1.5, metadata=ADDITIVE)
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
        x, y = leaf_end(door_frames([self], 1.0), 0, float(opening))
        return self.pose.position, (float(x), float(y)), HALF_THICKNESS


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


class Doors(NamedTuple):
    """The D interior doors of a world that move, for kernels.

    Attributes:
        frames: (D, 9), see `door_frames`.
        openings: (D,), a part of the row of the state.
        memory: (D, 4), see `sim.kernel.doors`.
        shapes: (D, 3) of int, addresses of the leaves in the engine: a segment and its two ends.
        candidate: (1, 8), scratch, a leaf where it is about to be.
        move: address of `sim.kernel.doors.move_doors`; zeros if there are no doors.
    """

    frames: Floats2
    openings: Floats
    memory: Floats2
    shapes: Ints2
    candidate: Floats2
    move: Ints


def door_frames(doors: Sequence[InteriorDoor], dt: float) -> Array:
    """Doors for kernels, (D, 9), with the columns above.

    Args:
        doors: D.
        dt: tick, s.
    """
    rows = [
        (
            *door.pose.position, *door.pose.direction, door.width, float(door.kind == "hinged"),
            float(_OPENED_BY.index(door.opened_by)), dt / door.opening_time, door.hold,
        )
        for door in doors
    ]  # fmt: skip
    return np.array(rows, dtype=float).reshape(-1, 9)


@subroutine
def leaf_end(frames: Array, d: int, opening: float) -> tuple[float, float]:
    """The free end of the leaf of door d, m.

    Args:
        frames: see `door_frames`.
        d: index of the door.
        opening: of the door.
    """
    ux, uy, width = frames[d, CLOSED_X], frames[d, CLOSED_Y], frames[d, WIDTH]
    if frames[d, IS_HINGED] == 0.0:
        width *= 1.0 - opening
    elif opening != 0.0:
        c, s = rotation(opening * _RIGHT_ANGLE)
        ux, uy = ux * c - uy * s, ux * s + uy * c
    return frames[d, HINGE_X] + ux * width, frames[d, HINGE_Y] + uy * width


@subroutine
def set_leaves(table: Array, frames: Array, openings: Array) -> None:
    """Set the last rows of a table to the leaves of doors.

    Args:
        table: (M + D, 8), rows of `Barriers.table`.
        frames: see `door_frames`.
        openings: (D,).
    """
    first = len(table) - len(frames)
    for d in range(len(frames)):
        x, y = leaf_end(frames, d, openings[d])
        set_barrier(table, first + d, frames[d, HINGE_X], frames[d, HINGE_Y], x, y, HALF_THICKNESS)


@kernel
def move_leaves(table: Array, frames: Array, openings: Array) -> None:
    """`set_leaves`, for the interpreter."""
    set_leaves(table, frames, openings)


def solids_with_doors(barriers: Barriers, doors: Sequence[InteriorDoor]) -> Solids:
    """Barriers and the leaves of doors, the last rows, which `set_leaves` moves; those of the barriers without doors.

    Args:
        barriers: of the room.
        doors: that move. Their leaves are where they are at the start.
    """
    if not doors:
        return solids_of(barriers)
    frames = door_frames(doors, 1.0)
    reach = Barriers.of([(door.pose.position, door.leaf(0.0)[1], door.width + HALF_THICKNESS) for door in doors])
    solids = with_grid_of(barriers.joined(reach).table.copy())  # its cells list a leaf wherever it can be
    move_leaves(solids.table, frames, np.array([door.opening for door in doors], dtype=float))
    return solids


class SolidsInMotion:
    """The barriers of a room with the leaves of doors, for code that is no kernel.

    Args:
        barriers: that do not move.
        doors: that move.

    Attributes:
        packed: for kernels.
    """

    def __init__(self, barriers: Barriers, doors: Sequence[InteriorDoor]) -> None:
        self.packed = Packed(solids_with_doors(barriers, doors)) if doors else packed_solids(barriers)
        self._frames = door_frames(doors, 1.0)

    def move(self, openings: Array) -> None:
        """Move the leaves to their openings, (D,)."""
        if len(openings):
            move_leaves(self.packed.value.table, self._frames, openings.copy())  # kernels take writeable arrays
