"""The leaves of interior doors for kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .barrier_grid import Solids, packed_solids, set_barrier, solids_of, with_grid_of
from .compiled.kernel import kernel, subroutine
from .compiled.packing import Floats, Floats2, Ints, Ints2, Packed
from .compiled.scalar import RADIUS, unit_vector
from .doors import HALF_THICKNESS, OPEN, RIGHT_ANGLE, InteriorDoor, OpenedBy
from .geometry import Barriers
from .portable_math import Array

# Columns of `door_frames`: the fixed end of the leaf, m; unit vector along the closed leaf; width, m; whether it turns
# on a hinge; who opens it, as index; change of the opening in a tick; time for which it stays open, s.
HINGE_X, HINGE_Y, CLOSED_X, CLOSED_Y, WIDTH, IS_HINGED, OPENED_BY, STEP, HOLD = range(9)
ANYONE, PEOPLE, REQUEST = range(3)
_OPENED_BY: tuple[OpenedBy, ...] = ("anyone", "people", "request", "nobody")


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
        c, s = unit_vector(opening * RIGHT_ANGLE)
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


def reach_of(doors: Sequence[InteriorDoor]) -> Barriers:
    """For each door a thick line that contains its leaf wherever it can be."""
    return Barriers.of([(door.pose.position, door.leaf(0.0)[1], door.width + HALF_THICKNESS) for door in doors])


def solids_with_doors(barriers: Barriers, doors: Sequence[InteriorDoor]) -> Solids:
    """Barriers and the leaves of doors, the last rows, which `set_leaves` moves; those of the barriers without doors.

    Args:
        barriers: of the room.
        doors: that move. Their leaves are where they are at the start.
    """
    if not doors:
        return solids_of(barriers)
    frames = door_frames(doors, 1.0)
    solids = with_grid_of(barriers.joined(reach_of(doors)).table.copy())  # its cells list a leaf wherever it can be
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

    def move(self, openings: Array, margin: float = 0.0) -> None:
        """Move the leaves to their openings.

        Args:
            openings: (D,).
            margin: m, by which leaves are thicker that are not open.
        """
        if len(openings):
            table = self.packed.value.table
            move_leaves(table, self._frames, openings.copy())  # kernels take writeable arrays
            table[len(table) - len(openings) :, RADIUS] += np.where(np.abs(openings) < OPEN, margin, 0.0)
