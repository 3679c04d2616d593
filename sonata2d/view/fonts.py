"""Fonts and lines of text; any string can be drawn."""

from __future__ import annotations

from functools import lru_cache

import pygame

from .palette import Colour

_MAX_LENGTH = 4000  # characters of a line; the rest is cut off
_fonts: dict[int, pygame.font.Font] = {}


def font(size: int) -> pygame.font.Font:
    """pygame's default font at a size in pixels; cached, and created again after pygame was closed."""
    if not pygame.font.get_init():
        pygame.font.init()
        _fonts.clear()
    known = _fonts.get(size)
    if known is not None:
        try:
            known.get_height()
        except pygame.error:  # pygame was closed and opened again, which invalidates its fonts
            _fonts.clear()
            known = None
    if known is None:
        known = _fonts[size] = pygame.font.Font(None, max(size, 1))
    return known


def printable(text: str) -> str:
    """The text as one line, without characters that fonts cannot draw (control characters, surrogates).

    >>> printable("A\\0nna\\n")
    'Anna '
    """
    return "".join(" " if c in "\n\t" else c for c in text[:_MAX_LENGTH] if c.isprintable() or c in "\n\t")


@lru_cache(maxsize=512)
def rendered(text: str, size: int, colour: Colour) -> pygame.Surface:
    """One antialiased line of text on a transparent surface; cached, so callers must not draw on it."""
    return font(size).render(printable(text), True, colour)


@lru_cache(maxsize=2048)
def width_of(text: str, size: int) -> int:
    """Width of a line of text, px."""
    return font(size).size(printable(text))[0]


def shortened(text: str, max_width: float, size: int) -> str:
    """The text, or its longest beginning that fits into `max_width` pixels with an ellipsis."""
    text = printable(text)
    if width_of(text, size) <= max_width:
        return text
    low, high = 0, len(text)
    while low < high:  # bisection over the number of characters
        middle = (low + high + 1) // 2
        low, high = (middle, high) if width_of(text[:middle] + "…", size) <= max_width else (low, middle - 1)
    return text[:low].rstrip() + "…" if low else ""
