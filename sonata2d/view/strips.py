"""Moments of an episode as pictures for a page, each within a URL; outside the room the page shines through."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pygame

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .camera import Camera
from .draw import Layers, backdrop, camera_for, draw_moment
from .still import url_of
from .trails import Trails

SIDE = 230  # pixels of one moment: sharp at a sixth of a page, small as a file
_AROUND, _LEAST = 1.5, 5.0  # m round the robot's way, and a side that it shall not fall below


def filmstrip(snapshots: Sequence[Snapshot], looks: Sequence[int], *, layers: Layers | None = None) -> list[str]:
    """Some moments of an episode, each with the ways so far: a square PNG in a URL for each, all of the same place.

    What is seen is the part of the room in which the robot goes, and its goal.

    Args:
        snapshots: of one episode, in order.
        looks: which of them.
        layers: what to show; there is no caption.

    Raises:
        RenderError: no moment is asked for, or one that is not there.
    """
    if not looks or not all(0 <= k < len(snapshots) for k in looks):
        raise RenderError(f"cannot show looks {[*looks]} of {len(snapshots)}; ask for some of 0..{len(snapshots) - 1}")
    layers = layers or Layers()
    camera = _camera(snapshots)
    room = backdrop(snapshots[0].scene, camera, layers, outside=None)
    return [url_of(_moment(snapshots[: k + 1], camera, layers, room)) for k in looks]


def _moment(snapshots: Sequence[Snapshot], camera: Camera, layers: Layers, room: pygame.Surface) -> pygame.Surface:
    """The last of these looks, on a copy of the room."""
    surface = room.copy()
    draw_moment(surface, camera, snapshots[-1], layers, Trails.of(snapshots))
    return pygame.transform.smoothscale(surface, camera.size)


def _camera(snapshots: Sequence[Snapshot]) -> Camera:
    """As near as the robot's way allows; the whole room if it goes everywhere."""
    scene = snapshots[0].scene
    places = np.array([scene.goal.position, *(look.robot.position for look in snapshots)])
    low, high = places.min(axis=0), places.max(axis=0)
    whole = camera_for(scene, size=(SIDE, SIDE))
    side = max(float((high - low).max()) + 2.0 * _AROUND, _LEAST)
    x, y = ((low + high) / 2.0).tolist()
    return whole.nearer(max(SIDE / whole.scale / side, 1.0), (x, y))
