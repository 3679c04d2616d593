"""What a controller's camera sees: the window's own picture, as an array."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pygame

from ..core.devices import ImageRequest
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .camera import LARGEST
from .live import Painter

_MOST = 4  # scenes whose painters are kept
_SMALLEST = 16  # pixels a side
_SMALL = 40_000  # pixels, up to which an image is drawn larger first, since its lines are thin
_painters: list[tuple[Scene, Painter]] = []  # the one used last at the end; a scene is held, so that it stays itself


def image_of(snapshot: Snapshot, request: ImageRequest) -> Any:
    """Draw one look as the window would; needs no display.

    Returns:
        (height, width, 3) of uint8: red, green, blue; the upper row first; an array of its own.

    Raises:
        RenderError: the request asks for a size or reach that makes no picture.
    """
    _check(request)
    size = request.width, request.height
    fine = 2 if request.width * request.height <= _SMALL else 1
    surface = pygame.Surface((fine * size[0], fine * size[1]), 0, 32)
    _painter_of(snapshot.scene).draw(surface, snapshot, view=request.view, reach=request.reach)
    if fine > 1:
        surface = pygame.transform.smoothscale(surface, size)
    image = np.frombuffer(pygame.image.tobytes(surface, "RGB"), dtype=np.uint8)
    return image.reshape(request.height, request.width, 3).copy()


def _check(request: ImageRequest) -> None:
    sizes = (request.width, request.height)
    if not all(_SMALLEST <= side <= LARGEST for side in sizes):
        raise RenderError(
            f"cannot draw an image of {request.width} x {request.height} pixels; a side has {_SMALLEST} to {LARGEST}"
        )
    if request.view not in ("follow", "top"):
        raise RenderError(f"there is no view {request.view!r}; ask for follow or top")
    if not 0.0 < request.reach < math.inf:
        raise RenderError(f"cannot draw an image that reaches {request.reach:g} m; ask for a reach above 0")


def _painter_of(scene: Scene) -> Painter:
    """The scene's painter; comparing scenes by what is in them would cost more than drawing."""
    for k, (known, painter) in enumerate(_painters):
        if known is scene:
            _painters.append(_painters.pop(k))
            return painter
    del _painters[: max(len(_painters) - _MOST + 1, 0)]
    _painters.append((scene, Painter(scene)))
    return _painters[-1][1]
