"""A canvas that writes SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from xml.etree import ElementTree
from zlib import crc32

import pygame

from ..core.geometry import Point
from ..core.portable_math import Array
from .fonts import EM, FAMILY, font, printable, width_of
from .palette import PAPER, Colour, hex_colour

_FONT = {"font-family": f"'{FAMILY}', 'Noto Sans CJK SC', 'Noto Emoji', sans-serif"}
_SPACE = "{http://www.w3.org/XML/1998/namespace}space"


class SvgCanvas:
    """A vector picture with the methods of `RasterCanvas`; a group becomes a `g` element of the class `kind`.

    Args:
        size: width and height, px.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size
        width, height = (str(side) for side in size)
        self.root = ElementTree.Element(
            "svg",
            {"xmlns": "http://www.w3.org/2000/svg", "width": width, "height": height}
            | {"viewBox": f"0 0 {width} {height}"},
        )
        self._parent = self.root

    @classmethod
    def blank(cls, size: tuple[int, int]) -> SvgCanvas:
        """A white picture of a size, px."""
        canvas = cls(size)
        canvas.rectangle(PAPER, pygame.Rect(0, 0, *size))
        return canvas

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        self._add("circle", cx=_number(centre[0]), cy=_number(centre[1]), r=_number(radius), fill=hex_colour(colour))

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        place = {"cx": _number(centre[0]), "cy": _number(centre[1]), "r": _number(max(radius - width / 2, 0.0))}
        self._add("circle", **place, fill="none", stroke=hex_colour(colour), **{"stroke-width": _number(width)})

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        line = {"stroke": hex_colour(edge), "stroke-width": _number(width), "stroke-linejoin": "round"} if edge else {}
        self._add("polygon", points=_points(points), fill=hex_colour(colour), **line)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        line = {"stroke-width": _number(width), "stroke-linejoin": "round", "stroke-linecap": "round"}
        self._add("polyline", points=_points(points), fill="none", stroke=hex_colour(colour), **line)

    def steps(self, colours: Sequence[Colour], steps: Array, width: float) -> None:
        for colour, (start, end) in zip(colours, steps.tolist(), strict=True):
            self.stroke(colour, [tuple(start), tuple(end)], width)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        self._add("polygon", points=_points(points), fill=hex_colour(colour), **{"fill-opacity": f"{alpha / 255:.3f}"})

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        inset = 0.5 if edge else 0.0
        place = {"x": box.left + inset, "y": box.top + inset, "width": box.w - 2 * inset, "height": box.h - 2 * inset}
        line = {"stroke": hex_colour(edge), "rx": "4"} if edge else {}
        self._add("rect", **{key: _number(value) for key, value in place.items()}, fill=hex_colour(colour), **line)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        style = {"fill": hex_colour(colour), "font-size": _number(size * EM), **_FONT}
        if not hasattr(pygame, "font"):  # in a page (`web.in_page`), whose browser measures the text itself
            spot = {"x": _number(place[0]), "y": _number(place[1]), "text-anchor": "middle"}
            self._add("text", **spot, **style, **{"dominant-baseline": "central"}).text = printable(words)
            return None  # type: ignore[return-value]  # nobody asks there how much room a text takes
        box = pygame.Rect(0, 0, width_of(words, size), font(size).get_height())
        setattr(box, anchor, (round(place[0]), round(place[1])))
        if box.width:
            spot = {"x": str(box.left), "y": str(box.top + font(size).get_ascent()), "textLength": str(box.width)}
            spot["lengthAdjust"] = "spacingAndGlyphs"  # of another font; letter spacing stays even
            spot[_SPACE] = "preserve"  # several spaces in a row
            self._add("text", **spot, **style).text = printable(words)
        return box

    @contextmanager
    def group(self, kind: str) -> Iterator[None]:
        with self._nested(ElementTree.SubElement(self._parent, "g", {"class": kind})):
            yield

    @contextmanager
    def inside(self, outline: Sequence[Point]) -> Iterator[None]:
        points = _points(outline)
        name = f"inside-{crc32(points.encode()):x}"  # also unique among pictures that are put together
        path = ElementTree.SubElement(self._parent, "clipPath", id=name)
        ElementTree.SubElement(path, "polygon", points=points)
        with self._nested(ElementTree.SubElement(self._parent, "g", {"clip-path": f"url(#{name})"})):
            yield

    @contextmanager
    def clip(self, size: tuple[int, int]) -> Iterator[None]:
        """Clip all drawing within the context to a box of a size in pixels at the upper left corner."""
        frame = {"width": str(size[0]), "height": str(size[1]), "overflow": "hidden"}
        with self._nested(ElementTree.SubElement(self._parent, "svg", frame)):
            yield

    def place(self, other: SvgCanvas, left: int, top: int) -> None:
        """Add another picture, with its upper left corner at a point, px."""
        width, height = other.size
        part = self._add("svg", x=str(left), y=str(top), width=str(width), height=str(height))
        part.extend(other.root)

    def content(self) -> bytes:
        """The content of an SVG file."""
        text: bytes = ElementTree.tostring(self.root, encoding="utf-8", xml_declaration=True)
        return text

    def inline(self) -> str:
        """The picture as an `svg` element of an HTML page, in which it needs no namespace."""
        root = ElementTree.Element("svg", {name: value for name, value in self.root.items() if name != "xmlns"})
        root.extend(self.root)
        return ElementTree.tostring(root, encoding="unicode")

    @contextmanager
    def _nested(self, element: ElementTree.Element) -> Iterator[None]:
        """Add all shapes drawn within the context to an element."""
        outer, self._parent = self._parent, element
        try:
            yield
        finally:
            self._parent = outer

    def _add(self, tag: str, **attributes: str) -> ElementTree.Element:
        return ElementTree.SubElement(self._parent, tag, attributes)


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _points(points: Sequence[Point]) -> str:
    return " ".join(f"{_number(x)},{_number(y)}" for x, y in points)
