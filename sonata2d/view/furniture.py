"""Furniture, seen from above: each type as `FurnitureType.draw` draws it, other types as plain blocks.

The front of a piece that is longer (x) than wide (y), such as a laptop, a shelf or a TV, is its access side (-y), where
pedestrians stand who attend to it. A chair faces +x.
"""

from __future__ import annotations

from functools import partial

from ..core.entities import Furniture
from ..core.furniture_types import draw_solid
from ..core.geometry import Disc, Polygon
from ..core.scene import Scene
from ..registry import furniture_type
from .brush import Brush
from .palette import BLOCK, BLOCK_EDGE, INK, PAPER, mixed


def draw_furniture(brush: Brush, scene: Scene) -> None:
    """Draw all furniture of a scene; pieces that stand on others come last."""
    for item in sorted(scene.furniture, key=lambda item: item.on is not None):
        brush.stamp(item.pose.position, (("thing", item.id), partial(_draw_item, item=item), item.front))


def _draw_item(brush: Brush, item: Furniture) -> None:
    """Draw a piece of furniture centred on the brush, its front ahead."""
    length, width = half_size(item)
    depth, breadth = sorted((length, width))
    is_round, draw = isinstance(item.shape, Disc), furniture_type(item.type).draw
    if isinstance(item.shape, Polygon):
        brush.polygon(BLOCK, item.shape.points, BLOCK_EDGE, 0.03)
        brush.word(INK, item.type.replace("_", " "), 1.5 * depth, 0.18)
    elif draw is not None:
        draw(brush, depth, breadth, is_round)
    else:
        _draw_unknown(brush, depth, breadth, is_round, item.type, has_front=length > width)


def half_size(item: Furniture) -> tuple[float, float]:
    """Half the length (along the x axis) and half the width of a piece of furniture, m."""
    shape = item.shape
    length, width = shape.sides
    return length / 2, width / 2


def _draw_unknown(brush: Brush, a: float, b: float, is_round: bool, name: str, *, has_front: bool) -> None:
    """Draw a plain block with the name of its type on it and, if it has a front, a mark there.

    Args:
        a, b: half the depth (from back to front) and half the breadth, m.
    """
    draw_solid(brush, a, b, is_round, BLOCK, BLOCK_EDGE)
    if has_front:
        tip, half = 0.88 * a, 0.2 * min(a, 0.5)
        brush.polygon(BLOCK_EDGE, [(tip, 0.0), (tip - half, half), (tip - half, -half)])
    if not is_round:
        top = 0.55 if has_front else 0.8
        brush.box(mixed(BLOCK, PAPER, 0.45), (-0.8 * a, -b + 0.2 * a), (top * a, b - 0.2 * a))
    brush.word(INK, name.replace("_", " "), 1.5 * a, 0.18)
