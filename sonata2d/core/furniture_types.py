"""Types of furniture: one instance of `FurnitureType` each, with its size, its use and its drawing.

Packages add types through the entry-point group `sonata2d.furniture_types`; `registry.furniture_type` finds them all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from .floats import make_floats
from .relations import AT_LAPTOP, AT_OBJECT, AT_PLANT, Colour

Point = tuple[float, float]
OBJECT_TYPES = ("table", "laptop", "plant", "chair", "shelf", "tv", "other")  # saved policies know their numbers


class Pen(Protocol):
    """Drawing of shapes in the frame of a piece of furniture: its front is ahead (+x), y is left; m.

    `edge` is the colour of an outline of the given width, centred on the shape's boundary.
    """

    def box(self, colour: Colour, low: Point, high: Point, edge: Colour | None = None, width: float = 0.0) -> None:
        """Draw a rectangle from its rear right corner to its front left corner."""

    def disc(self, colour: Colour, centre: Point, radius: float) -> None:
        """Draw a filled circle."""

    def ellipse(
        self, colour: Colour, centre: Point, semi_axes: Point, edge: Colour | None = None, width: float = 0.0
    ) -> None:
        """Draw a filled ellipse; `semi_axes` are its extents ahead and to the left."""

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        """Draw a filled polygon."""

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """Draw a line through points, with round ends and bends."""

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        """Draw a translucent polygon; alpha is 0 (invisible) to 255."""


Drawing = Callable[[Pen, float, float, bool], None]


@dataclass(frozen=True, slots=True)
class FurnitureType:
    """A type of furniture: its size, what people do at it, its names elsewhere, and its drawing.

    Attributes:
        name: in scenarios and files; the same as of the entry point.
        size: radius of a disc, or length (x) and width (y) of a rectangle, m; None: each piece has a size of its own.
        count: key of scenarios with the number of drawn pieces, such as `tables`; empty: they are not drawn at random.
        relation: name of the relation of a pedestrian that attends to a piece; None: nobody does.
        clearance: between the outlines of a piece and of a pedestrian that comes to attend to it, m.
        is_seat: whether one pedestrian can sit on a piece, above its centre and facing its front.
        on: name of the type of furniture on which a piece lies where they overlap; None: pieces stand on the floor.
        words: what the pieces of a count are called in the window, by language; `en` is required with a count.
        names: name of the type in formats that have other types, such as `{"socnav3": "chair"}`, and in observations of
            Gymnasium environments, `{"gym": "chair"}`: one of `OBJECT_TYPES`, by default `other`.
        draw: draws a piece, given a pen, half its depth from back to front and half its breadth, m, and whether it is
            round. None: a plain block with the name of the type.

    >>> FurnitureType("sofa", (1.8, 0.8), count="sofas", words={"en": "Sofas"}, is_seat=True, relation=None).number
    6
    """

    name: str
    size: float | Point | None = None
    count: str = ""
    relation: str | None = AT_OBJECT
    clearance: float = 0.30
    is_seat: bool = False
    on: str | None = None
    words: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    draw: Drawing | None = None

    def __post_init__(self) -> None:
        make_floats(self)
        if self.count and (self.size is None or self.on is not None or "en" not in self.words):
            raise ValueError(
                f"furniture of type {self.name!r} has the count {self.count!r}; it needs a size and an English word, "
                "and must not lie on other furniture"
            )

    @property
    def number(self) -> int:
        """Index in `OBJECT_TYPES`."""
        name = self.names.get("gym", self.name)
        return OBJECT_TYPES.index(name if name in OBJECT_TYPES else "other")


# Drawings. a and b are half the depth (from back to front) and half the breadth, m.

_LINE = 0.025  # m, outlines
WOOD: Colour = (222, 196, 158)
WOOD_EDGE: Colour = (158, 124, 82)
METAL: Colour = (196, 200, 206)
_GRAIN, _DARK_WOOD = (203, 174, 135), (206, 178, 139)
_LEAF, _PALE_LEAF, _LEAF_EDGE = (122, 160, 104), (111, 149, 94), (78, 116, 66)
_POT, _SCREEN = (176, 128, 100), (150, 190, 220)
_DARK, _FAINT = (52, 56, 64), (118, 124, 134)
CLOTH: Colour = (178, 186, 196)
_CLOTH_EDGE: Colour = (122, 132, 146)


def draw_solid(pen: Pen, a: float, b: float, is_round: bool, colour: Colour, edge: Colour) -> None:
    """Draw an ellipse or a box with an outline, whose outer edge is the edge of the piece."""
    inset = _LINE / 2
    if is_round:
        pen.ellipse(colour, (0.0, 0.0), (a - inset, b - inset), edge, _LINE)
    else:
        pen.box(colour, (inset - a, inset - b), (a - inset, b - inset), edge, _LINE)


def _draw_table(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw a wooden top of planks."""
    draw_solid(pen, a, b, is_round, WOOD, WOOD_EDGE)
    for fraction in () if is_round else (-0.5, 0.0, 0.5):
        pen.stroke(_GRAIN, [(fraction * a, -0.94 * b), (fraction * a, 0.94 * b)], 0.012)


def _draw_laptop(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw a keyboard in front of an open screen; the user is at the front."""
    pen.box(METAL, (-0.35 * a, -b), (a, b), _FAINT, 0.015)
    pen.box(_DARK, (-0.2 * a, -0.82 * b), (0.4 * a, 0.82 * b))
    pen.box(_FAINT, (0.55 * a, -0.3 * b), (0.88 * a, 0.3 * b))
    pen.box(_DARK, (-a, -b), (-0.35 * a, b))
    pen.box(_SCREEN, (-0.88 * a, -0.88 * b), (-0.42 * a, 0.88 * b))


_D, _C = 0.7071067811865476, 0.8660254037844386  # cosines of 45 and 30 degrees
_EIGHT = ((1.0, 0.0), (_D, _D), (0.0, 1.0), (-_D, _D), (-1.0, 0.0), (-_D, -_D), (0.0, -1.0), (_D, -_D))
_SIX = ((_C, 0.5), (0.0, 1.0), (-_C, 0.5), (-_C, -0.5), (0.0, -1.0), (_C, -0.5))
_HALF_LEAF = ((0.0, 0.0), (0.25, 0.15), (0.5, 0.22), (0.75, 0.17), (1.0, 0.0))
_LEAF_OUTLINE = (*_HALF_LEAF, *((x, -y) for x, y in _HALF_LEAF[-2:0:-1]))


def _draw_plant(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw leaves around a pot."""
    r = min(a, b)
    pen.disc(_POT, (0.0, 0.0), 0.55 * r)
    for directions, length, colour in ((_EIGHT, r, _PALE_LEAF), (_SIX, 0.72 * r, _LEAF)):
        for c, s in directions:
            outline = [(length * (x * c - y * s), length * (x * s + y * c)) for x, y in _LEAF_OUTLINE]
            pen.polygon(colour, outline, _LEAF_EDGE, 0.008)
            pen.stroke(_LEAF_EDGE, [(0.0, 0.0), (0.8 * length * c, 0.8 * length * s)], 0.008)
    pen.disc(_LEAF_EDGE, (0.0, 0.0), 0.12 * r)


def _draw_chair(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw a seat with a back rest behind it."""
    pen.box(CLOTH, (-0.8 * a, -0.85 * b), (0.95 * a, 0.85 * b), _CLOTH_EDGE, _LINE)
    for side in (0.92 * b, -0.92 * b):
        pen.stroke(_CLOTH_EDGE, [(0.4 * a, side), (-0.4 * a, side)], 0.05)
    pen.stroke(_DARK, [(-0.85 * a, -0.8 * b), (-0.95 * a, 0.0), (-0.85 * a, 0.8 * b)], 0.07)


def _draw_shelf(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw boards full of books."""
    draw_solid(pen, a, b, False, _DARK_WOOD, WOOD_EDGE)
    spines = (CLOTH, _POT, _SCREEN, _LEAF, METAL)
    count = max(int(2 * (b - 0.05) / 0.11), 1)
    width = 2 * (b - 0.05) / count
    for k in range(count):
        left = 0.05 - b + k * width
        depth = a * (0.7, 0.5, 0.62)[k % 3]
        pen.box(spines[k * 3 % len(spines)], (-0.75 * a, left + 0.012), (depth, left + width - 0.012))


def _draw_tv(pen: Pen, a: float, b: float, is_round: bool) -> None:
    """Draw a flat screen that glows at its front."""
    draw_solid(pen, a, b, False, _DARK, _DARK)
    pen.box(_SCREEN, (0.3 * a, -0.92 * b), (0.85 * a, 0.92 * b))
    pen.wash(_SCREEN, 70, [(a, -0.92 * b), (a, 0.92 * b), (a + 0.22, 1.1 * b), (a + 0.22, -1.1 * b)])


# The table is as in SocNav3, the others have typical commercial sizes.
TABLE = FurnitureType(
    "table", (0.8, 0.8), count="tables", relation=None, draw=_draw_table,
    words={"en": "Tables", "de": "Tische", "es": "Mesas", "zh": "桌子"},
)  # fmt: skip
LAPTOP = FurnitureType("laptop", (0.35, 0.25), relation=AT_LAPTOP, on="table", draw=_draw_laptop)
PLANT = FurnitureType(
    "plant", 0.2, count="plants", relation=AT_PLANT, draw=_draw_plant,
    words={"en": "Plants", "de": "Pflanzen", "es": "Plantas", "zh": "植物"},
)  # fmt: skip
CHAIR = FurnitureType(
    "chair", (0.45, 0.45), count="chairs", relation=None, is_seat=True, draw=_draw_chair,
    words={"en": "Chairs", "de": "Stühle", "es": "Sillas", "zh": "椅子"},
)  # fmt: skip
SHELF = FurnitureType(
    "shelf", (1.0, 0.35), count="shelves", draw=_draw_shelf,
    words={"en": "Shelves", "de": "Regale", "es": "Estantes", "zh": "架子"},
)  # fmt: skip
TV = FurnitureType(
    "tv", (1.0, 0.1), count="tvs", draw=_draw_tv,
    words={"en": "TVs", "de": "Fernseher", "es": "Televisores", "zh": "电视"},
)  # fmt: skip
BUILT_IN = (TABLE, LAPTOP, PLANT, CHAIR, SHELF, TV)  # in the order of counts and lists
