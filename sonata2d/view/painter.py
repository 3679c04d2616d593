"""Draws a world many times per second: for the window, and as the camera image of a controller."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pygame

from ..core.devices import ImageRequest, View
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .brush import Brush
from .canvas import PixelCanvas
from .draw import backdrop, camera_for, draw_moving_parts, draw_still_parts, draw_words
from .layers import Layers
from .palette import OUTSIDE, Colour
from .projection import Camera, require_drawable
from .sprites import SpriteCache
from .trails import Trails

_VIEW_RANGE = 5.0  # m, from the robot to the upper edge of the follow view
_MAX_PAINTERS = 4  # scenes for which `image_of` keeps a painter
_SMALL_IMAGE = 40_000  # px; images up to this size are supersampled, because their lines are thin


class Painter:
    """Painter of snapshots of one scene, which caches the room and the figures.

    Args:
        scene: the scene of all snapshots.
        outside: colour around the room.
        cut_zones: whether zones end at the outline of the room, which takes longer.
    """

    def __init__(self, scene: Scene, *, outside: Colour = OUTSIDE, cut_zones: bool = False) -> None:
        self._scene, self._sprites = scene, SpriteCache()
        self._outside, self._cut_zones = outside, cut_zones
        self._room: tuple[tuple[Any, ...], pygame.Surface] | None = None

    def draw(
        self,
        surface: pygame.Surface,
        snapshot: Snapshot,
        *,
        view: View = "follow",
        layers: Layers = Layers(caption=False),  # noqa: B008  frozen
        zoom: float = 1.0,
        trails: Trails | None = None,
        view_range: float = _VIEW_RANGE,
        camera: Camera | None = None,
    ) -> Camera:
        """Fill the surface with a snapshot.

        Args:
            view: `follow`, from above and behind the robot, whose direction points up in the picture; or `top`, the
                whole room, which is also shown if the robot was not recorded.
            layers: what to show; caption and legend are never drawn.
            zoom: magnification.
            trails: past paths of robot and pedestrians.
            view_range: distance from the robot to the upper edge of the follow view at zoom 1, m.
            camera: replaces the one of the view and zoom; of several pictures the same.

        Returns:
            The camera, with which callers can place further drawings.

        Raises:
            RenderError: the surface's size, the zoom or the view range is out of range.
        """
        is_fixed = camera is not None
        if camera is None:
            # without a recorded robot there is nothing to follow
            if view == "follow" and "robot" not in self._scene.unmeasured:
                robot, far = snapshot.robot, float(view_range) / float(zoom)
                camera = Camera.behind(robot.position, robot.direction, size=surface.get_size(), view_range=far)
            else:
                camera, is_fixed = camera_for(self._scene, size=surface.get_size()), zoom <= 1.0
                camera = camera if zoom == 1.0 else camera.zoomed(zoom, snapshot.robot.position)
        canvas = PixelCanvas(surface)
        brush = Brush(canvas, camera, cache=partial(self._sprites.put, surface))
        if is_fixed:
            surface.blit(self._fixed_room(camera, layers), (0, 0))
        else:
            surface.fill(self._outside)
            draw_still_parts(brush, self._scene, grid=layers.grid)
        draw_moving_parts(brush, snapshot, layers, trails, cut_zones=self._cut_zones)
        draw_words(canvas, camera, snapshot, layers)
        return camera

    def _fixed_room(self, camera: Camera, layers: Layers) -> pygame.Surface:
        """The picture of the room for a camera that does not move; cached."""
        key = (camera, layers.grid)
        if self._room is None or self._room[0] != key:
            large = backdrop(self._scene, camera, layers, outside=self._outside)
            room = pygame.Surface(camera.size, 0, 32)
            self._room = key, pygame.transform.smoothscale(large, camera.size, room)
        return self._room[1]


_painters: dict[int, Painter] = {}  # by the identity of the scene, which each painter holds


def image_of(snapshot: Snapshot, request: ImageRequest) -> Any:
    """Draw the camera image that a controller requests, as the window would; needs no display.

    Returns:
        (height, width, 3) of uint8: red, green, blue; the upper row first; a new array.

    Raises:
        RenderError: the requested size, view or view range is out of range.

    Example:
        image_of(snapshot, ImageRequest(160, 120, view="follow")).shape  # (120, 160, 3)
    """
    size = request.width, request.height
    require_drawable(size, 1.0)
    if request.view not in ("follow", "top"):
        raise RenderError(f"cannot draw an image with view {request.view!r}; use 'follow' or 'top'")
    fine = 2 if request.width * request.height <= _SMALL_IMAGE else 1
    surface = pygame.Surface((fine * size[0], fine * size[1]), 0, 32)
    _painter_of(snapshot.scene).draw(surface, snapshot, view=request.view, view_range=request.view_range)
    if fine > 1:
        surface = pygame.transform.smoothscale(surface, size)
    image = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
    return image.reshape(request.height, request.width, 3).copy()


def _painter_of(scene: Scene) -> Painter:
    """The cached painter of a scene; scenes are compared by identity, because comparing values would be slow."""
    painter = _painters.get(id(scene))
    if painter is None:
        if len(_painters) >= _MAX_PAINTERS:
            _painters.pop(next(iter(_painters)))
        painter = _painters[id(scene)] = Painter(scene)
    return painter
