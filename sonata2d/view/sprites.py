"""Cached drawings that are placed on a surface at any position and direction with subpixel accuracy.

A pedestrian consists of a dozen shapes, and computing their points in Python takes longer than drawing them. Therefore
a drawing is recorded once as primitives; each picture rotates its points by one matrix product and draws them on a
tile. Large and simple drawings, whose tiles would be expensive, are drawn directly on the picture instead. Without the
recording, pictures of the window take 35 % (10 pedestrians) to 100 % (50 pedestrians) longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pygame

from ..core.geometry import Point
from ..core.portable_math import Array
from .brush import Brush, Part
from .canvas import Primitive, RasterCanvas, in_view, premultiplied, put, spare_tile
from .palette import Colour
from .projection import Camera

_FINE, _QUICK = 4, 2  # supersampling factors of tiles; the second for drawings larger than
_LARGE, _LARGE_SIMPLE = 80.0, 48.0  # px a side; the second limit for polygons and for drawings of more than
_MANY = 40  # shapes
_SMALL = 24.0  # px, radius of drawings whose tiles are squares around them
_STEPS, _TURNS = 8, 400  # positions are cached per 1/8 pixel, unit vectors per 1/400
_MAX_SPRITES, _MAX_PIXELS = 2000, 6_000_000

_Shape = tuple[Primitive, Colour, int, int, tuple[Any, ...]]  # primitive, colour, range of its points, settings


class _Recorder(RasterCanvas):
    """A canvas that records primitives, so that they can be drawn at other positions and rotations.

    Args:
        fine: supersampling factor of the transparent tile that they will be drawn on; 1 for the picture itself.

    Attributes:
        points: of all shapes, px.
        margins: pixels by which the shape extends beyond each point.
        shapes: the primitives, which refer to ranges of `points`.
    """

    def __init__(self, fine: int) -> None:
        super().__init__(fine)
        self.points: list[Point] = []
        self.margins: list[float] = []
        self.shapes: list[_Shape] = []

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        if self.fine > 1:
            self.draw(_tile_wash, colour, points, 0.0, alpha)
        else:
            super().wash(colour, alpha, points)

    def draw(
        self, primitive: Primitive, colour: Colour, points: Sequence[Point], margin: float, *settings: Any
    ) -> None:
        start = len(self.points)
        self.points += points
        self.margins += [margin] * len(points)
        self.shapes.append((primitive, colour, start, len(self.points), settings))


def _tile_wash(surface: pygame.Surface, colour: Colour, points: Sequence[Point], alpha: int) -> None:
    """Replace pixels of a tile by a translucent colour, instead of blending as a wash on a picture does."""
    pygame.draw.polygon(surface, premultiplied(colour, alpha), points)


@dataclass(frozen=True, slots=True)
class _Sprite:
    """A recorded drawing.

    Attributes:
        points: (P, 2), pixels right of and below its origin, multiplied by `fine`.
        margin: (P, 1), pixels by which the shape extends beyond each point.
        radius: distance from the origin to the farthest drawn pixel, in pixels of the picture.
        shapes: in drawing order.
        fine: supersampling factor of its tile; 1 if it is drawn directly on the picture, antialiased.
    """

    points: Array
    margin: Array
    radius: float
    shapes: tuple[_Shape, ...]
    fine: int

    @classmethod
    def of(cls, draw: Callable[[Brush], None], scale: float, fine: int | None = None) -> _Sprite:
        """Record a drawing.

        Args:
            draw: draws with a brush at the origin.
            scale: pixels per metre of the picture.
            fine: supersampling factor; by default chosen by the size of the drawing.
        """
        recorder = _Recorder(fine or _FINE)
        draw(Brush(recorder, Camera(scale * recorder.fine, 0.0, 0.0, (0, 0)), recorder.fine))
        points = np.array(recorder.points, dtype=float).reshape(-1, 2)
        margin = np.array(recorder.margins, dtype=float).reshape(-1, 1) + 1.0
        size = float(((points + margin).max(axis=0) - (points - margin).min(axis=0)).max()) / recorder.fine
        first = recorder.shapes[0][0]
        is_angular, is_busy = first is pygame.draw.polygon, len(recorder.shapes) > _MANY
        if fine is None and is_angular and size > _LARGE:
            return cls.of(draw, scale, 1)
        # the edges of a translucent drawing are faint
        if fine is None and (first is _tile_wash or size > (_LARGE_SIMPLE if is_angular or is_busy else _LARGE)):
            return cls.of(draw, scale, _QUICK)
        radius = float((np.sqrt((points * points).sum(axis=1)) + margin[:, 0]).max())
        return cls(points, margin, radius / recorder.fine, tuple(recorder.shapes), recorder.fine)

    def rotated(self, direction: Point) -> Array:
        """The points for a sprite that points along a unit vector of the picture, (P, 2)."""
        dx, dy = direction
        points: Array = self.points @ np.array(((dx, dy), (-dy, dx)))
        return points

    def bounds(self, rotated: Array) -> tuple[float, float, float, float]:
        """Smallest x and y, then largest, of the drawn shapes relative to the origin, in pixels of the picture."""
        if self.radius < _SMALL:  # a larger tile costs less than exact bounds
            return -self.radius, -self.radius, self.radius, self.radius
        x0, y0 = (rotated - self.margin).min(axis=0).tolist()
        x1, y1 = (rotated + self.margin).max(axis=0).tolist()
        return x0 / self.fine, y0 / self.fine, x1 / self.fine, y1 / self.fine

    def draw(self, surface: pygame.Surface, points: Array) -> None:
        """Draw on a surface of `fine` times the picture's resolution, the rotated points moved to their place."""
        places = points.tolist()
        for primitive, colour, start, end, settings in self.shapes:
            primitive(surface, colour, places[start:end], *settings)


class SpriteCache:
    """Sprites by key, and their images, so that a drawing that does not move is made once."""

    def __init__(self) -> None:
        self._sprites: dict[tuple[Any, ...], _Sprite] = {}
        self._images: dict[tuple[Any, ...], tuple[pygame.Surface, int, int]] = {}
        self._pixels = 0  # of all images

    def put(self, surface: pygame.Surface, camera: Camera, place: Point, *parts: Part, whole: bool = False) -> None:
        """Draw sprites on top of each other at one place of the world, each in its own direction.

        Args:
            whole: round the place to whole pixels, so that one image serves all places.
        """
        steps = 1 if whole else _STEPS
        x, y = (round(value * steps) * (_STEPS // steps) for value in camera.to_pixels(place))
        directions = [camera.rotated(direction) for _, _, direction in parts]
        (column, x), (row, y) = divmod(x, _STEPS), divmod(y, _STEPS)
        rounded = [(round(dx * _TURNS), round(dy * _TURNS)) for dx, dy in directions]
        key = (camera.scale, x, y, *(part[0] for part in parts), *rounded)
        known = self._images.get(key)
        if known is None:
            first = self._sprite(camera.scale, parts[0], None)
            # the others share its tile
            sprites = [first, *(self._sprite(camera.scale, part, first.fine) for part in parts[1:])]
            radius = max(sprite.radius for sprite in sprites)
            if not in_view(surface, column - radius, row - radius, 2 * radius, 2 * radius):
                return
            if first.fine == 1:
                for sprite, direction in zip(sprites, directions, strict=True):
                    sprite.draw(surface, sprite.rotated(direction) + camera.to_pixels(place))
                return
            if self._pixels > _MAX_PIXELS:
                self._images.clear()
                self._pixels = 0
            known = self._images[key] = _image((x / _STEPS, y / _STEPS), list(zip(sprites, directions, strict=True)))
            self._pixels += known[0].width * known[0].height
        image, left, top = known
        put(surface, image, column + left, row + top)

    def _sprite(self, scale: float, part: Part, fine: int | None) -> _Sprite:
        key = scale, fine, part[0]
        known = self._sprites.get(key)
        if known is None:
            if len(self._sprites) >= _MAX_SPRITES:  # resizing a window goes through many scales
                self._sprites.clear()
            known = self._sprites[key] = _Sprite.of(part[1], scale, fine)
        return known


def _image(place: Point, parts: Sequence[tuple[_Sprite, Point]]) -> tuple[pygame.Surface, int, int]:
    """A premultiplied image of sprites on top of each other, and its left and top in pixels.

    Args:
        place: of the common origin, px.
        parts: sprites and their directions, unit vectors of the picture.
    """
    fine = parts[0][0].fine
    rotated = [sprite.rotated(direction) for sprite, direction in parts]
    bounds = [sprite.bounds(points) for (sprite, _), points in zip(parts, rotated, strict=True)]
    left, top = (math.floor(place[k] + min(box[k] for box in bounds)) for k in (0, 1))
    right, bottom = (math.ceil(place[k] + max(box[k + 2] for box in bounds)) for k in (0, 1))
    tile = spare_tile((right - left) * fine, (bottom - top) * fine)
    origin = np.array(((place[0] - left) * fine, (place[1] - top) * fine))
    for (sprite, _), points in zip(parts, rotated, strict=True):
        sprite.draw(tile, points + origin)
    return pygame.transform.smoothscale(tile, (right - left, bottom - top)), left, top
