"""Fonts, made once a size, and lines of text that nothing in them can break."""

from __future__ import annotations

from functools import lru_cache

import pygame

from .palette import Colour

_MOST = 4000  # characters of a line; more would make no picture
_fonts: dict[int, pygame.font.Font] = {}


def font(size: int) -> pygame.font.Font:
    """pygame's own font in a size, pixels; made anew if pygame was closed meanwhile."""
    if not pygame.font.get_init():
        pygame.font.init()
        _fonts.clear()
    known = _fonts.get(size)
    if known is not None:
        try:
            known.get_height()
        except pygame.error:  # pygame was closed and opened again, which fonts do not outlive
            _fonts.clear()
            known = None
    if known is None:
        known = _fonts[size] = pygame.font.Font(None, max(size, 1))
    return known


def printable(text: str) -> str:
    """The text as one line, without what a font cannot stand: control characters, halves of characters.

    >>> printable("A\\0nna\\n")
    'Anna '
    """
    return "".join(" " if c in "\n\t" else c for c in text[:_MOST] if c.isprintable() or c in "\n\t")


@lru_cache(maxsize=512)
def rendered(text: str, size: int, colour: Colour) -> pygame.Surface:
    """One smooth line of text on nothing; not to be drawn on."""
    return font(size).render(printable(text), True, colour)


@lru_cache(maxsize=2048)
def width_of(text: str, size: int) -> int:
    """How many pixels a line takes."""
    return font(size).size(printable(text))[0]


def shortened(text: str, room: float, size: int) -> str:
    """The text, or as much of its beginning as fits into so many pixels."""
    text = printable(text)
    if width_of(text, size) <= room:
        return text
    low, high = 0, len(text)
    while low < high:  # the longest beginning that fits
        middle = (low + high + 1) // 2
        low, high = (middle, high) if width_of(text[:middle] + "…", size) <= room else (low, middle - 1)
    return text[:low].rstrip() + "…" if low else ""
