"""A type of furniture: a settee, on which one person can sit."""

from __future__ import annotations

from sonata2d import FurnitureType
from sonata2d.core.furniture_types import Pen

CLOTH, SEAM = (166, 142, 158), (112, 92, 106)  # red, green, blue


def draw_settee(pen: Pen, depth: float, breadth: float, is_round: bool) -> None:
    """Draw cushions between a back and two arms; `depth` and `breadth` are halves, m, and the front is ahead."""
    pen.box(SEAM, (-depth, -breadth), (depth, breadth))
    for left, right in ((-0.82 * breadth, -0.02 * breadth), (0.02 * breadth, 0.82 * breadth)):
        pen.box(CLOTH, (-0.5 * depth, left), (0.92 * depth, right))


SETTEE = FurnitureType(
    "settee",
    (1.8, 0.85),
    count="settees",  # scenarios have `settees: [1, 2]`
    relation=None,  # people sit on it, and do not stand in front of it
    is_seat=True,
    words={"en": "Settees", "de": "Sitzbänke", "es": "Canapés"},
    names={"socnav3": "chair", "gym": "chair"},  # which have no settees
    draw=draw_settee,
)
