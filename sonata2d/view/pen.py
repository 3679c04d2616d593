"""Texts, plates and signs over a picture, in pixels, at any scale."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import pygame

from ..core.geometry import Point
from .fonts import rendered, shortened, width_of
from .palette import INK, PAPER, Colour
from .smooth import Smooth
from .tiles import put

SMALLEST = (640, 480)  # pixels, of a window at scale 1
_TEXT, _PAD, _PLATE_ALPHA = 21, 8, 222


@dataclass(frozen=True)
class Pen:
    """Writes on a surface; lengths are pixels at scale 1, places are pixels of the surface."""

    surface: pygame.Surface
    scale: float

    @classmethod
    def on(cls, surface: pygame.Surface, scale: float) -> Pen:
        """A pen as large as asked for, or as the surface has room for."""
        room = min(side / least for side, least in zip(surface.get_size(), SMALLEST, strict=True))
        return cls(surface, max(min(scale, room), 0.25))

    def px(self, length: float) -> int:
        """A length of the layout in pixels of the surface."""
        return max(round(length * self.scale), 1)

    @property
    def canvas(self) -> Smooth:
        return Smooth(self.surface)

    @property
    def row(self) -> int:
        """Height of a plate with one line."""
        return self.px(30)

    @property
    def gap(self) -> int:
        return self.px(8)

    def width(self, text: str, size: float = _TEXT) -> int:
        """How wide a line is, pixels."""
        return width_of(text, self.px(size))

    def fitted(self, text: str, room: float, size: float = _TEXT) -> str:
        """As much of a line's beginning as fits into so many pixels."""
        return shortened(text, room, self.px(size))

    def write(
        self, text: str, place: Point, *, colour: Colour = INK, size: float = _TEXT, anchor: str = "midleft"
    ) -> pygame.Rect:
        line = rendered(text, self.px(size), colour)
        box = line.get_rect(**{anchor: (round(place[0]), round(place[1]))})
        self.surface.blit(line, box)
        return box

    def plate(self, box: pygame.Rect, *, colour: Colour = PAPER, alpha: int = _PLATE_ALPHA) -> None:
        """A light plate with round corners that lets the picture shine through."""
        put(self.surface, _plate(box.size, self.px(7), colour, alpha), *box.topleft)

    def panel(self, text: str, place: Point, anchor: str, *, room: float, colour: Colour = INK) -> pygame.Rect:
        """A line on a plate, shortened to the room there is; nothing, and a box of no size, where there is none."""
        pad = self.px(_PAD)
        line = self.fitted(text, room - 2 * pad)
        box = pygame.Rect(0, 0, self.width(line) + 2 * pad if line else 0, self.row if line else 0)
        setattr(box, anchor, (round(place[0]), round(place[1])))
        if line:
            self.plate(box)
            self.write(line, (box.left + pad, box.centery), colour=colour)
        return box

    def sign(self, kind: str, centre: Point, radius: float, colour: Colour) -> None:
        """A small sign: dot, ring, bars, square, triangle, diamond or eye; radius in pixels."""
        canvas, r, (x, y) = self.canvas, radius, centre
        if kind == "dot":
            canvas.circle(colour, centre, r)
        elif kind in ("ring", "eye"):
            canvas.ring(colour, centre, r, max(r / 3, 1.5))
            if kind == "eye":
                canvas.circle(colour, centre, r * 0.4)
        elif kind == "bars":
            for left in (x - 0.8 * r, x + 0.2 * r):
                canvas.polygon(colour, _box(left, y - 0.9 * r, 0.6 * r, 1.8 * r))
        elif kind == "square":
            canvas.polygon(colour, _box(x - 0.85 * r, y - 0.85 * r, 1.7 * r, 1.7 * r))
        elif kind == "triangle":
            canvas.polygon(colour, [(x, y - r), (x + r, y + 0.8 * r), (x - r, y + 0.8 * r)])
        elif kind == "play":
            canvas.polygon(colour, [(x + r, y), (x - 0.7 * r, y + r), (x - 0.7 * r, y - r)])
        elif kind == "diamond":
            canvas.polygon(colour, [(x + r, y), (x, y + r), (x - r, y), (x, y - r)])

    def arrow(self, tip: Point, angle: float, length: float, colour: Colour) -> None:
        """An arrow head with its tip at a place, pointing along an angle, rad, clockwise from the right."""
        c, s = math.cos(angle), math.sin(angle)
        shape = [(0.0, 0.0), (-1.0, 0.62), (-0.72, 0.0), (-1.0, -0.62)]
        points = [(tip[0] + length * (a * c - b * s), tip[1] + length * (a * s + b * c)) for a, b in shape]
        self.canvas.polygon(colour, points)


def _box(left: float, top: float, width: float, height: float) -> list[Point]:
    return [(left, top), (left + width, top), (left + width, top + height), (left, top + height)]


@lru_cache(maxsize=128)
def _plate(size: tuple[int, int], corner: int, colour: Colour, alpha: int) -> pygame.Surface:
    """A premultiplied plate, drawn larger for its corners."""
    large = pygame.Surface((2 * size[0], 2 * size[1]), pygame.SRCALPHA, 32)
    shade = tuple(round(value * alpha / 255) for value in colour)
    pygame.draw.rect(large, (*shade, alpha), large.get_rect(), border_radius=2 * corner)
    return pygame.transform.smoothscale(large, size)
