"""Furniture, seen from above; one function per type.

The front of a piece that is longer (x) than wide (y), such as a laptop, a shelf or a TV, is its right side (-y), where
pedestrians stand who attend to it. A chair faces +x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from ..core.entities import Furniture
from ..core.geometry import Disc, Point
from ..core.scene import Scene
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
    Colour,
    mixed,
)

_LINE = 0.025  # m, outlines


def draw_furniture(brush: Brush, scene: Scene) -> None:
    """Draw all furniture of a scene; pieces that stand on others come last."""
    for item in sorted(scene.furniture, key=lambda item: item.on is not None):
        brush.stamp(item.pose.position, (("thing", item.id), partial(_draw_item, item=item), item.front))


def _draw_item(brush: Brush, item: Furniture) -> None:
    """Draw a piece of furniture centred on the brush, its front ahead."""
    depth, breadth = sorted(half_size(item))
    is_round = isinstance(item.shape, Disc)
    draw = _DRAWINGS.get(item.type)
    if draw is not None:
        draw(brush, depth, breadth, is_round)
    else:
        length, width = half_size(item)
        _draw_unknown(brush, depth, breadth, is_round, item.type, has_front=length > width)


def half_size(item: Furniture) -> tuple[float, float]:
    """Half the length (along the x axis) and half the width of a piece of furniture, m."""
    shape = item.shape
    return (shape.radius, shape.radius) if isinstance(shape, Disc) else (shape.length / 2, shape.width / 2)


# In the following functions, a and b are half the depth (from back to front) and half the breadth, m.


def _draw_unknown(brush: Brush, a: float, b: float, is_round: bool, name: str, *, has_front: bool) -> None:
    """Draw a plain block with the name of its type on it and, if it has a front, a mark there."""
    _draw_body(brush, a, b, is_round, BLOCK, BLOCK_EDGE)
    if has_front:
        tip, half = 0.88 * a, 0.2 * min(a, 0.5)
        brush.polygon(BLOCK_EDGE, [(tip, 0.0), (tip - half, half), (tip - half, -half)])
    if not is_round:
        top = 0.55 if has_front else 0.8
        brush.box(mixed(BLOCK, PAPER, 0.45), (-0.8 * a, -b + 0.2 * a), (top * a, b - 0.2 * a))
    brush.word(INK, name.replace("_", " "), 1.5 * a, 0.18)


def _draw_body(brush: Brush, a: float, b: float, is_round: bool, colour: Colour, edge: Colour) -> None:
    inset = _LINE / 2  # the line is centred on the outline, and its outer edge is the edge of the piece
    if is_round:
        brush.ellipse(colour, (0.0, 0.0), (a - inset, b - inset), edge, _LINE)
    else:
        brush.box(colour, (inset - a, inset - b), (a - inset, b - inset), edge, _LINE)


def _draw_table(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw a wooden top of planks."""
    _draw_body(brush, a, b, is_round, WOOD, WOOD_EDGE)
    if not is_round:
        grain = mixed(WOOD, WOOD_EDGE, 0.3)
        for fraction in (-0.5, 0.0, 0.5):
            brush.stroke(grain, [(fraction * a, -0.94 * b), (fraction * a, 0.94 * b)], 0.012)


def _draw_laptop(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw a keyboard in front of an open screen; the user sits at the front."""
    brush.box(METAL, (-0.35 * a, -b), (a, b), FAINT, 0.015)
    brush.box(DARK, (-0.2 * a, -0.82 * b), (0.4 * a, 0.82 * b))
    brush.box(FAINT, (0.55 * a, -0.3 * b), (0.88 * a, 0.3 * b))
    brush.box(DARK, (-a, -b), (-0.35 * a, b))
    brush.box(SCREEN, (-0.88 * a, -0.88 * b), (-0.42 * a, 0.88 * b))


def _draw_plant(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw leaves around a pot."""
    r = min(a, b)
    brush.disc(POT, (0.0, 0.0), 0.55 * r)
    for leaves, length, start, tone in ((8, 1.0, 0.0, 0.25), (6, 0.72, math.pi / 6, 0.0)):
        for k in range(leaves):
            angle = start + k * 2 * math.pi / leaves
            leaf = _leaf(length * r, angle)
            brush.polygon(mixed(LEAF, LEAF_EDGE, tone), leaf, LEAF_EDGE, 0.008)
            brush.stroke(LEAF_EDGE, [(0.0, 0.0), (0.8 * leaf[4][0], 0.8 * leaf[4][1])], 0.008)
    brush.disc(LEAF_EDGE, (0.0, 0.0), 0.12 * r)


def _leaf(length: float, angle: float) -> list[Point]:
    """Outline of a leaf whose stem is at the origin."""
    c, s = math.cos(angle), math.sin(angle)
    half = [(0.0, 0.0), (0.25, 0.15), (0.5, 0.22), (0.75, 0.17), (1.0, 0.0)]
    outline = half + [(x, -y) for x, y in half[-2:0:-1]]
    return [(length * (x * c - y * s), length * (x * s + y * c)) for x, y in outline]


def _draw_chair(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw a seat with a back rest behind it."""
    brush.box(CLOTH, (-0.8 * a, -0.85 * b), (0.95 * a, 0.85 * b), CLOTH_EDGE, _LINE)
    brush.stroke(CLOTH_EDGE, [(0.4 * a, 0.92 * b), (-0.4 * a, 0.92 * b)], 0.05)
    brush.stroke(CLOTH_EDGE, [(0.4 * a, -0.92 * b), (-0.4 * a, -0.92 * b)], 0.05)
    brush.stroke(DARK, [(-0.85 * a, -0.8 * b), (-0.95 * a, 0.0), (-0.85 * a, 0.8 * b)], 0.07)


def _draw_shelf(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw boards full of books."""
    _draw_body(brush, a, b, False, mixed(WOOD, WOOD_EDGE, 0.25), WOOD_EDGE)
    spines = (CLOTH, POT, SCREEN, LEAF, METAL)
    count = max(int(2 * (b - 0.05) / 0.11), 1)
    width = 2 * (b - 0.05) / count
    for k in range(count):
        left = 0.05 - b + k * width
        depth = a * (0.7, 0.5, 0.62)[k % 3]
        brush.box(spines[k * 3 % len(spines)], (-0.75 * a, left + 0.012), (depth, left + width - 0.012))


def _draw_tv(brush: Brush, a: float, b: float, is_round: bool) -> None:
    """Draw a flat screen that glows at its front."""
    _draw_body(brush, a, b, False, DARK, DARK)
    brush.box(SCREEN, (0.3 * a, -0.92 * b), (0.85 * a, 0.92 * b))
    glow = [(a, -0.92 * b), (a, 0.92 * b), (a + 0.22, 1.1 * b), (a + 0.22, -1.1 * b)]
    brush.wash(SCREEN, 70, glow)


_DRAWINGS: dict[str, Callable[[Brush, float, float, bool], None]] = {
    "table": _draw_table,
    "laptop": _draw_laptop,
    "plant": _draw_plant,
    "chair": _draw_chair,
    "shelf": _draw_shelf,
    "tv": _draw_tv,
}
