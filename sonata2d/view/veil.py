"""A card over a dimmed picture, and a tint over all of it."""

from __future__ import annotations

from collections.abc import Sequence

import pygame

from .palette import INK, PAPER, Colour, mixed
from .pen import Pen

_DIM = (150, 152, 158)  # of 255, what is left of the picture's light
_TITLE, _LINE, _PAD = 34, 23, 26


def draw_veil(surface: pygame.Surface, title: str, lines: Sequence[str] = (), *, scale: float = 1.0) -> None:
    """Dim the picture and show a card in its middle.

    Args:
        title: of the card.
        lines: below it; too long ones are broken, and all are made smaller if there are more than fit.
        scale: of the texts; heeded as far as the surface has room.
    """
    surface.fill(_DIM, special_flags=pygame.BLEND_RGB_MULT)
    pen = Pen.on(surface, scale)
    wide, high = surface.get_size()
    tall = _TITLE * 1.3 + len(lines) * _LINE * 1.3 + 2 * _PAD
    if tall * pen.scale > 0.94 * high:
        pen = Pen(surface, 0.94 * high / tall)
    pad = pen.px(_PAD)
    room = 0.94 * wide - 2 * pad
    head, rows = pen.fitted(title, room, _TITLE), [row for line in lines for row in _wrapped(pen, line, room)]
    tall = _TITLE * 1.3 + len(rows) * _LINE * 1.3 + 2 * _PAD
    width = max([pen.width(head, _TITLE), *(pen.width(row, _LINE) for row in rows), pen.px(220)]) + 2 * pad
    box = pygame.Rect(0, 0, width, round(tall * pen.scale))
    box.center = wide // 2, high // 2
    pen.plate(box, alpha=245)
    y = box.top + pad + pen.px(_TITLE * 0.5)
    pen.write(head, (box.centerx, y), size=_TITLE, anchor="center")
    y += pen.px(_TITLE * 0.8)
    for k, row in enumerate(rows):
        place = box.centerx, y + round((k + 0.5) * _LINE * 1.3 * pen.scale)
        pen.write(row, place, size=_LINE, colour=mixed(INK, PAPER, 0.15), anchor="center")


def _wrapped(pen: Pen, line: str, room: float) -> list[str]:
    """A line in pieces that fit into so many pixels; a word that does not is shortened."""
    rows, words = [""], line.split(" ")
    for word in words:
        longer = f"{rows[-1]} {word}" if rows[-1] else word
        if pen.width(longer, _LINE) <= room or not rows[-1]:
            rows[-1] = longer
        else:
            rows.append(word)
    return [pen.fitted(row, room, _LINE) for row in rows]


def draw_tint(surface: pygame.Surface, colour: Colour, alpha: int) -> None:
    """Lay a colour over the whole picture; alpha 0 (nothing) to 255 (the colour alone)."""
    kept = 255 - alpha
    surface.fill((kept, kept, kept), special_flags=pygame.BLEND_RGB_MULT)
    r, g, b = (value * alpha // 255 for value in colour)
    surface.fill((r, g, b), special_flags=pygame.BLEND_RGB_ADD)
