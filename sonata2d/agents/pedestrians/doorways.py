"""Interior doors on the way of pedestrians: they wait until a door is open, outside the way of its leaf."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.compiled.kernel import subroutine
from ...core.compiled.packing import Bools, Floats, Floats2
from ...core.compiled.scalar import length, to_line
from ...core.doors import OPEN
from ...core.humans import X, Y
from ...core.leaves import CLOSED_X, CLOSED_Y, HINGE_X, HINGE_Y, IS_HINGED, WIDTH, door_frames
from ...core.portable_math import Array, BoolArray
from ...core.scene import Scene
from .models.base import Walkers
from .routes import Routes, stopping_speed

# Our estimates.
_PASSABLE = 0.8  # opening, from which pedestrians pass
_RANGE = 3.0  # m, on the path, within which pedestrians heed a door
_STANDOFF = 0.45  # m, from the closed leaf to the centre of a pedestrian who waits
_BEYOND_LEAF = 0.35  # m, from the way of a leaf that turns towards a pedestrian
_IN_DOORWAY = 0.25  # m, from the closed leaf, within which a pedestrian goes on
_BACKWARDS = 0.5  # m/s, with which it steps back from a leaf


class Doorways(NamedTuple):
    """The D interior doors of a scene that move, as the pedestrians see them.

    Attributes:
        frames: (D, 9), see `core.leaves.door_frames`.
        openings: (D,), of the tick.
        stands_open: (D,) of bool, hinged leaves that stand open, round which paths lead.
    """

    frames: Floats2
    openings: Floats
    stands_open: Bools


def doorways_of(scene: Scene) -> Doorways:
    """The doors of a scene as they are at the start."""
    doors = scene.moving_doors
    openings = np.array([door.opening for door in doors], dtype=float)
    return Doorways(door_frames(doors, scene.rules.dt), openings, np.zeros(len(doors), dtype=bool))


@subroutine
def watch_doors(doors: Doorways) -> bool:
    """Note which hinged leaves stand open; whether this has changed."""
    is_changed = False
    for d in range(len(doors.frames)):
        stands_open = doors.frames[d, IS_HINGED] != 0.0 and abs(doors.openings[d]) >= OPEN
        if stands_open != doors.stands_open[d]:
            doors.stands_open[d], is_changed = stands_open, True
    return is_changed


@subroutine
def wait_at_doors(doors: Doorways, routes: Routes, walkers: Walkers, humans: Array, is_present: BoolArray) -> None:
    """Let pedestrians wait before doors on their paths that are not open.

    Args:
        doors: of the scene.
        routes: of the pedestrians.
        walkers: those who wait get new desired directions and speeds.
        humans: (N, 9), columns of `core.humans`.
        is_present: (N,).
    """
    for k in range(len(humans)):
        if is_present[k] and walkers.walks[k]:
            for d in range(len(doors.frames)):
                if abs(doors.openings[d]) < _PASSABLE and _is_on_path(doors.frames, d, k, routes, humans):
                    _wait(doors, d, k, routes, walkers, humans)


@subroutine
def _is_on_path(frames: Array, d: int, k: int, routes: Routes, humans: Array) -> bool:
    """Whether the path of pedestrian k leads through door d within `_RANGE`."""
    x, y, walked = humans[k, X], humans[k, Y], 0.0
    hinge_x, hinge_y = frames[d, HINGE_X], frames[d, HINGE_Y]
    ux, uy, width = frames[d, CLOSED_X], frames[d, CLOSED_Y], frames[d, WIDTH]
    ahead = ux * (y - hinge_y) - uy * (x - hinge_x)
    for n in range(max(routes.next[k], 0), routes.length[k]):
        to_x, to_y = routes.path[k, n, 0], routes.path[k, n, 1]
        to_ahead = ux * (to_y - hinge_y) - uy * (to_x - hinge_x)
        if ahead * to_ahead < 0.0:
            part = ahead / (ahead - to_ahead)
            crossing_x, crossing_y = x + part * (to_x - x) - hinge_x, y + part * (to_y - y) - hinge_y
            along = crossing_x * ux + crossing_y * uy
            if 0.0 < along < width and walked + part * length(to_x - x, to_y - y) < _RANGE:
                return True
        walked += length(to_x - x, to_y - y)
        if walked > _RANGE:
            return False
        x, y, ahead = to_x, to_y, to_ahead
    return False


@subroutine
def _wait(doors: Doorways, d: int, k: int, routes: Routes, walkers: Walkers, humans: Array) -> None:
    """Let pedestrian k come no closer to a door than the way of its leaf, and step back out of this way."""
    frames = doors.frames
    ux, uy, width = frames[d, CLOSED_X], frames[d, CLOSED_Y], frames[d, WIDTH]
    px, py = humans[k, X] - frames[d, HINGE_X], humans[k, Y] - frames[d, HINGE_Y]
    dx, dy = to_line(px, py, ux * width, uy * width, 1.0 / (width * width))
    distance, side = length(dx, dy), math.copysign(1.0, ux * py - uy * px)
    if distance < _IN_DOORWAY:
        return
    routes.checkpoint[k, 0] = math.nan  # it makes no progress, but is not stuck
    rest = distance - _STANDOFF
    if frames[d, IS_HINGED] != 0.0 and doors.openings[d] * side > 0.0:  # the leaf turns towards it
        rest = length(px, py) - width - _BEYOND_LEAF
        if rest < 0.0:
            walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = -uy * side, ux * side
            walkers.desired_speed[k] = _BACKWARDS
            return
    walkers.desired_speed[k] = min(walkers.desired_speed[k], stopping_speed(max(rest, 0.0)))
