"""A floor plan drawn on the map that it was made from, to compare both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np
import pygame

from ..core.geometry import Point
from ..core.portable_math import Array
from ..core.scene import Scene
from .canvas import PixelCanvas
from .palette import BLUE, INK

_SIDE = 1600  # pixels, of the longer side of the picture
_WALL, _HOLE, _AREA, _DOOR = (214, 39, 40), (255, 127, 14), (44, 120, 60), (148, 60, 170)


class MapImage(Protocol):
    """The image of a map, and its frame."""

    @property
    def grey(self) -> Any:
        """(H, W) of uint8."""

    def to_pixels(self, points: Array) -> Array:
        """Positions (N, 2), m, as columns and rows of the image, (N, 2)."""


def draw_on_map(scene: Scene, image: MapImage) -> pygame.Surface:
    """Draw outline (red), holes (orange), furniture (blue), areas (green) and doors (violet) of a scene on a map."""
    height, width = image.grey.shape
    scale = _SIDE / max(height, width)
    pale = (255 - (255 - image.grey.astype(int)) // 2).astype(np.uint8)
    surface = pygame.surfarray.make_surface(np.repeat(pale.T[:, :, None], 3, axis=2))
    surface = pygame.transform.scale(surface, (round(width * scale), round(height * scale)))

    def pixels(points: Iterable[Point]) -> list[Point]:
        return [(x * scale, y * scale) for x, y in image.to_pixels(np.array(list(points), dtype=float)).tolist()]

    def ring(colour: tuple[int, int, int], points: Sequence[Point], thickness: int) -> None:
        pygame.draw.lines(surface, colour, True, pixels(points), thickness)

    for area in scene.areas:
        ring(_AREA, area.polygon, 1)
    ring(_WALL, scene.polygon, 3)
    for hole in scene.holes:
        ring(_HOLE, hole, 3)
    for piece in scene.furniture:
        for start, end, radius in piece.shape.edges(piece.pose):
            (x, y), (u, v) = pixels([start, end])
            if radius > 0.0:
                (rim,) = pixels([(start[0] + radius, start[1])])
                pygame.draw.circle(surface, BLUE, (x, y), math.dist(rim, (x, y)), 3)
            else:
                pygame.draw.line(surface, BLUE, (x, y), (u, v), 3)
    for door in scene.doors:
        pygame.draw.circle(surface, _DOOR, pixels([door.pose.position])[0], 8, 3)
    canvas = PixelCanvas(surface, 1)
    for area in scene.areas:
        canvas.text(_AREA, area.name, pixels([_centroid(area.polygon)])[0], 22)
    for piece in scene.furniture if len(scene.furniture) <= 100 else ():
        canvas.text(INK, piece.type, pixels([piece.pose.position])[0], 14)
    return surface


def _centroid(polygon: Sequence[Point]) -> Point:
    """The centre of gravity of a polygon, m."""
    x, y = np.array(polygon, dtype=float).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    weight = 3.0 * cross.sum()
    centre = ((part + np.roll(part, -1)) @ cross / weight for part in (x, y))
    return float(next(centre)), float(next(centre))
