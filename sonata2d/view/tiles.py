"""Small pictures drawn larger on a spare surface, made smaller, and put in their place.

Pixels of the spare surface are premultiplied by their alpha, so that no colour of nothing mixes in.
"""

from __future__ import annotations

import pygame

from .palette import Colour

_spare: list[pygame.Surface] = []


def spare(width: int, height: int) -> pygame.Surface:
    """A surface of nothing, to be used before the next is asked for."""
    if not _spare or _spare[0].get_width() < width or _spare[0].get_height() < height:
        old = _spare.pop().get_size() if _spare else (512, 512)
        _spare.append(pygame.Surface((max(old[0], width), max(old[1], height)), pygame.SRCALPHA, 32))
    tile = _spare[0].subsurface((0, 0, width, height))
    tile.fill((0, 0, 0, 0))
    return tile


def premultiplied(colour: Colour, alpha: int) -> tuple[int, int, int, int]:
    """A colour that lets the ground shine through, as premultiplied pixels hold it."""
    r, g, b = (round(value * alpha / 255) for value in colour)
    return r, g, b, alpha


def put(surface: pygame.Surface, image: pygame.Surface, left: int, top: int) -> None:
    """Lay a premultiplied picture over what is there."""
    surface.blit(image, (left, top), special_flags=pygame.BLEND_PREMULTIPLIED)


def in_view(surface: pygame.Surface, left: float, top: float, width: float, height: float) -> bool:
    """Whether anything of a box of pixels lies on the surface."""
    wide, high = surface.get_size()
    return left < wide and top < high and left + width > 0 and top + height > 0
