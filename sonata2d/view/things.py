"""Furniture from above, one function a type.

A thing's front is ahead of it (its body's x axis) or, if it is longer than wide, to its right; so the broad side of a
screen or a shelf is always its front.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ..core.entities import Furniture
from ..core.geometry import Disc, Point
from .brush import Brush
from .palette import (
    BLOCK,
    BLOCK_EDGE,
    CLOTH,
    CLOTH_EDGE,
    DARK,
    FAINT,
    INK,
    LEAF,
    LEAF_EDGE,
    METAL,
    PAPER,
    POT,
    SCREEN,
    WOOD,
    WOOD_EDGE,
    mixed,
)

_LINE = 0.025  # m, outlines


def draw_thing(brush: Brush, thing: Furniture) -> None:
    """Draw one piece of furniture in the middle of where the brush stands, its front ahead; see `front_of`."""
    depth, breadth = sorted(half_size(thing))
    is_round = isinstance(thing.shape, Disc)
    artist = _ARTISTS.get(thing.type)
    with brush.group("thing"):
        if artist is not None:
            artist(brush, depth, breadth, is_round)
        else:
            _anything(brush, depth, breadth, is_round, thing.type)


def front_of(thing: Furniture) -> Point:
    """Unit vector from a thing to its front, world frame."""
    (x, y), (length, width) = thing.pose.direction, half_size(thing)
    return (y, -x) if length > width else (x, y)


def half_size(thing: Furniture) -> tuple[float, float]:
    """Reach ahead and to the left, m."""
    shape = thing.shape
    return (shape.radius, shape.radius) if isinstance(shape, Disc) else (shape.length / 2, shape.width / 2)


def _anything(brush: Brush, a: float, b: float, is_round: bool, name: str) -> None:
    """A plain block with a mark at its front and its name on it."""
    _body(brush, a, b, is_round, BLOCK, BLOCK_EDGE)
    tip, half = 0.88 * a, 0.2 * min(a, 0.5)
    brush.polygon(BLOCK_EDGE, [(tip, 0.0), (tip - half, half), (tip - half, -half)])
    if not is_round:
        brush.box(mixed(BLOCK, PAPER, 0.45), (-0.8 * a, -b + 0.2 * a), (0.55 * a, b - 0.2 * a))
    brush.word(INK, name.replace("_", " "), 1.5 * a, 0.18)


def _body(
    brush: Brush, a: float, b: float, is_round: bool, colour: tuple[int, int, int], edge: tuple[int, int, int]
) -> None:
    inset = _LINE / 2  # so that the outline's outer edge is the thing's
    if is_round:
        brush.ellipse(colour, (0.0, 0.0), (a - inset, b - inset), edge, _LINE)
    else:
        brush.box(colour, (inset - a, inset - b), (a - inset, b - inset), edge, _LINE)


def _table(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """A top of planks."""
    _body(brush, a, b, is_round, WOOD, WOOD_EDGE)
    if not is_round:
        grain = mixed(WOOD, WOOD_EDGE, 0.3)
        for share in (-0.5, 0.0, 0.5):
            brush.stroke(grain, [(share * a, -0.94 * b), (share * a, 0.94 * b)], 0.012)


def _laptop(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Keyboard before an opened screen; whoever uses it sits at its front."""
    brush.box(METAL, (-0.35 * a, -b), (a, b), FAINT, 0.015)
    brush.box(DARK, (-0.2 * a, -0.82 * b), (0.4 * a, 0.82 * b))
    brush.box(FAINT, (0.55 * a, -0.3 * b), (0.88 * a, 0.3 * b))
    brush.box(DARK, (-a, -b), (-0.35 * a, b))
    brush.box(SCREEN, (-0.88 * a, -0.88 * b), (-0.42 * a, 0.88 * b))


def _plant(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Leaves round a pot."""
    r = min(a, b)
    brush.disc(POT, (0.0, 0.0), 0.55 * r)
    for leaves, reach, turn, tone in ((8, 1.0, 0.0, 0.25), (6, 0.72, math.pi / 6, 0.0)):
        for k in range(leaves):
            angle = turn + k * 2 * math.pi / leaves
            leaf = _leaf(reach * r, angle)
            brush.polygon(mixed(LEAF, LEAF_EDGE, tone), leaf, LEAF_EDGE, 0.008)
            brush.stroke(LEAF_EDGE, [(0.0, 0.0), (0.8 * leaf[4][0], 0.8 * leaf[4][1])], 0.008)
    brush.disc(LEAF_EDGE, (0.0, 0.0), 0.12 * r)


def _leaf(length: float, angle: float) -> list[tuple[float, float]]:
    """A pointed oval from the stem outward."""
    c, s = math.cos(angle), math.sin(angle)
    half = [(0.0, 0.0), (0.25, 0.15), (0.5, 0.22), (0.75, 0.17), (1.0, 0.0)]
    outline = half + [(x, -y) for x, y in half[-2:0:-1]]
    return [(length * (x * c - y * s), length * (x * s + y * c)) for x, y in outline]


def _chair(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """A seat with the back behind it."""
    brush.box(CLOTH, (-0.8 * a, -0.85 * b), (0.95 * a, 0.85 * b), CLOTH_EDGE, _LINE)
    brush.stroke(CLOTH_EDGE, [(0.4 * a, 0.92 * b), (-0.4 * a, 0.92 * b)], 0.05)
    brush.stroke(CLOTH_EDGE, [(0.4 * a, -0.92 * b), (-0.4 * a, -0.92 * b)], 0.05)
    brush.stroke(DARK, [(-0.85 * a, -0.8 * b), (-0.95 * a, 0.0), (-0.85 * a, 0.8 * b)], 0.07)


def _shelf(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Boards full of books, seen from above."""
    _body(brush, a, b, False, mixed(WOOD, WOOD_EDGE, 0.25), WOOD_EDGE)
    backs = (CLOTH, POT, SCREEN, LEAF, METAL)
    count = max(int(2 * (b - 0.05) / 0.11), 1)
    width = 2 * (b - 0.05) / count
    for k in range(count):
        left = 0.05 - b + k * width
        depth = a * (0.7, 0.5, 0.62)[k % 3]
        brush.box(backs[k * 3 % len(backs)], (-0.75 * a, left + 0.012), (depth, left + width - 0.012))


def _tv(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """A flat screen that glows at its front."""
    _body(brush, a, b, False, DARK, DARK)
    brush.box(SCREEN, (0.3 * a, -0.92 * b), (0.85 * a, 0.92 * b))
    glow = [(a, -0.92 * b), (a, 0.92 * b), (a + 0.22, 1.1 * b), (a + 0.22, -1.1 * b)]
    brush.wash(SCREEN, 70, glow)


_ARTISTS: dict[str, Callable[[Brush, float, float, bool], None]] = {
    "table": _table,
    "laptop": _laptop,
    "plant": _plant,
    "chair": _chair,
    "shelf": _shelf,
    "tv": _tv,
}
