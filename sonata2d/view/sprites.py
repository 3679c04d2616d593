"""Drawings kept as shapes, and stamped onto a surface turned and placed as finely as they move.

A person takes a dozen shapes whose points cost more than their pixels. So the drawing is noted once, and each picture
turns its points by one product of matrices, and draws them on a tile. Large and plain drawings, whose tiles would cost
most, are drawn straight onto the picture instead.
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
from .brush import Brush
from .camera import Camera
from .noted import Noted, Shape, draw_large, draw_straight
from .tiles import in_view, put, spare

_FINE, _QUICK = 4, 2  # times the pixels a side; the latter for drawings larger than
_LARGE, _LARGE_PLAIN = 80.0, 48.0  # pixels a side; the latter for those that are angular, or of
_MANY = 40  # shapes
_STEPS, _TURNS = 8, 400  # parts of a pixel, and of a unit vector, that places and directions are told apart by
_MOST_SPRITES, _MOST_PIXELS = 2000, 6_000_000

Part = tuple[tuple[Any, ...], Callable[["Brush"], None], Point]  # its name, how it is drawn, where it looks


@dataclass(frozen=True, slots=True)
class Sprite:
    """A drawing as shapes.

    Attributes:
        points: (P, 2), pixels right and down from its origin, at `fine` times the picture's.
        margin: (P, 1), pixels that something goes beyond each point.
        far: pixels of the picture, from the origin to what is farthest from it.
        is_round: whether that is a disc or ring round the origin, and the outline therefore the same however it turns.
        shapes: how the points are used, in the order of drawing.
        fine: times the pixels a side; 1 if it is drawn straight onto the picture, line by smooth line.
    """

    points: Array
    margin: Array
    far: float
    is_round: bool
    shapes: tuple[Shape, ...]
    fine: int

    @classmethod
    def of(cls, draw: Callable[[Brush], None], scale: float, fine: int | None = None) -> Sprite:
        """Note what is drawn by a brush that stands at the origin, for a picture of so many pixels a metre.

        Args:
            fine: what suits the drawing's size unless given: large and plain ones are drawn straight onto the picture.
        """
        noted = Noted(fine or _FINE)
        draw(Brush(noted, Camera(scale * noted.fine, 0.0, 0.0, (0, 0)), noted.fine))
        points = np.array(noted.points, dtype=float).reshape(-1, 2)
        margin = np.array(noted.margin, dtype=float).reshape(-1, 1) + 1.0
        size = float(np.max((points + margin).max(axis=0) - (points - margin).min(axis=0)))
        angular, busy = noted.shapes[0][0] == "polygon", len(noted.shapes) > _MANY
        if fine is None and size > (_LARGE_PLAIN if angular or busy else _LARGE) * noted.fine:
            return cls.of(draw, scale, 1 if angular and size > _LARGE * noted.fine else _QUICK)
        beyond = np.sqrt((points * points).sum(axis=1)) + margin[:, 0]
        is_round = bool(margin[0, 0] > 0.98 * beyond.max())
        return cls(points, margin, float(beyond.max()) / noted.fine, is_round, tuple(noted.shapes), noted.fine)

    def turned(self, direction: Point) -> Array:
        """Its points, turned so that it looks along a unit vector in pixels."""
        dx, dy = direction
        turned: Array = self.points @ np.array(((dx, dy), (-dy, dx)))
        return turned

    def box(self, turned: Array) -> tuple[float, float, float, float]:
        """Least x and y, then greatest, of its turned shapes, pixels of the picture from its origin."""
        if self.is_round:
            return -self.far, -self.far, self.far, self.far
        (x0, y0), (x1, y1) = (turned - self.margin).min(axis=0).tolist(), (turned + self.margin).max(axis=0).tolist()
        return x0 / self.fine, y0 / self.fine, x1 / self.fine, y1 / self.fine


class Stamps:
    """Sprites by what they show, and how they came out where they were stamped before: who stands is drawn once."""

    def __init__(self) -> None:
        self._sprites: dict[tuple[Any, ...], Sprite] = {}
        self._images: dict[tuple[Any, ...], tuple[pygame.Surface, int, int]] = {}
        self._held = 0  # pixels of all images

    def put(self, surface: pygame.Surface, camera: Camera, place: Point, *parts: Part, whole: bool = False) -> None:
        """Draw sprites over one another at a place in the world, each turned to look along its heading.

        Args:
            whole: the place may be off by half a pixel, so that the same picture serves everywhere.
        """
        steps = 1 if whole else _STEPS
        x, y = (round(value * steps) * (_STEPS // steps) for value in camera.to_pixels(place))
        turns = [camera.turned(heading) for _, _, heading in parts]
        (column, x), (row, y) = divmod(x, _STEPS), divmod(y, _STEPS)
        rounded = [(round(dx * _TURNS), round(dy * _TURNS)) for dx, dy in turns]
        key = (camera.scale, x, y, *(part[0] for part in parts), *rounded)
        known = self._images.get(key)
        if known is None:
            sprites = self._needed(camera.scale, parts)
            far = max(sprite.far for sprite in sprites)
            if not in_view(surface, column - far, row - far, 2 * far, 2 * far):
                return
            if sprites[0].fine == 1:
                for sprite, turn in zip(sprites, turns, strict=True):
                    draw_straight(surface, sprite.shapes, (sprite.turned(turn) + camera.to_pixels(place)).tolist())
                return
            known = stamped((x / _STEPS, y / _STEPS), list(zip(sprites, turns, strict=True)))
            self._keep(key, known)
        image, left, top = known
        put(surface, image, column + left, row + top)

    def _needed(self, scale: float, parts: Sequence[Part]) -> list[Sprite]:
        """The parts' sprites, as fine as the first one's."""
        first = self._sprite(scale, parts[0], None)
        return [first, *(self._sprite(scale, part, first.fine) for part in parts[1:])]

    def _sprite(self, scale: float, part: Part, fine: int | None) -> Sprite:
        key = scale, fine, part[0]
        known = self._sprites.get(key)
        if known is None:
            if len(self._sprites) >= _MOST_SPRITES:  # a window that is being resized asks for many scales
                self._sprites.clear()
            known = self._sprites[key] = Sprite.of(part[1], scale, fine)
        return known

    def _keep(self, key: tuple[Any, ...], known: tuple[pygame.Surface, int, int]) -> None:
        width, height = known[0].get_size()
        if self._held > _MOST_PIXELS:
            self._images.clear()
            self._held = 0
        self._images[key] = known
        self._held += width * height


def stamped(place: Point, parts: Sequence[tuple[Sprite, Point]]) -> tuple[pygame.Surface, int, int]:
    """A premultiplied picture of sprites over one another, and how far right and down its corner lies.

    Args:
        place: where their origin shall be, pixels right and down.
        parts: sprites, and unit vectors in pixels along which they look.
    """
    fine = parts[0][0].fine
    turned = [sprite.turned(direction) for sprite, direction in parts]
    boxes = [sprite.box(points) for (sprite, _), points in zip(parts, turned, strict=True)]
    left, top = (math.floor(place[k] + min(box[k] for box in boxes)) for k in (0, 1))
    right, bottom = (math.ceil(place[k] + max(box[k + 2] for box in boxes)) for k in (0, 1))
    tile = spare((right - left) * fine, (bottom - top) * fine)
    origin = np.array(((place[0] - left) * fine, (place[1] - top) * fine))
    for (sprite, _), points in zip(parts, turned, strict=True):
        points += origin
        draw_large(tile, sprite.shapes, points.tolist())
    return pygame.transform.smoothscale(tile, (right - left, bottom - top)), left, top
