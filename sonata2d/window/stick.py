"""The stick that the mouse is dragged for."""

from __future__ import annotations

import math

import pygame

from ..view.palette import INK, PAPER
from .hands import Drag


def draw_stick(surface: pygame.Surface, drag: Drag) -> None:
    """A ring where the mouse was pressed, and a knob where it is, no farther than the ring."""
    (x, y), (to_x, to_y), radius = drag
    dx, dy = to_x - x, to_y - y
    reach = math.hypot(dx, dy)
    share = min(radius / reach, 1.0) if reach > 0.0 else 1.0
    knob = (round(x + dx * share), round(y + dy * share))
    side = round(2 * radius) + 4
    tile = pygame.Surface((side, side), pygame.SRCALPHA, 32)
    pygame.draw.aacircle(tile, (*PAPER, 70), (side // 2, side // 2), radius)
    surface.blit(tile, (x - side // 2, y - side // 2))
    pygame.draw.aacircle(surface, INK, (x, y), radius, 2)
    pygame.draw.aacircle(surface, INK, knob, radius * 0.22)
