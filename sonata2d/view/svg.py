"""A canvas of vectors, written as SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pygame

from ..core.geometry import Point
from ..errors import RenderError
from .fonts import font, printable, width_of
from .palette import Colour

_FONT = {"font-family": "FreeSans, Helvetica, Arial, sans-serif", "font-weight": "bold"}
_EM = 0.6875  # of a size that is asked for, what pygame makes of its own font


class Svg:
    """A picture of so many pixels whose shapes stay shapes; kinds of groups become classes."""

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = (str(side) for side in size)
        self.root = ElementTree.Element(
            "svg",
            {"xmlns": "http://www.w3.org/2000/svg", "width": width, "height": height}
            | {"viewBox": f"0 0 {width} {height}"},
        )
        self._inner = self.root

    def circle(self, colour: Colour, centre: Point, radius: float) -> None:
        self._add("circle", cx=_number(centre[0]), cy=_number(centre[1]), r=_number(radius), fill=_hex(colour))

    def ring(self, colour: Colour, centre: Point, radius: float, width: float) -> None:
        place = {"cx": _number(centre[0]), "cy": _number(centre[1]), "r": _number(max(radius - width / 2, 0.0))}
        self._add("circle", **place, fill="none", stroke=_hex(colour), **{"stroke-width": _number(width)})

    def polygon(self, colour: Colour, points: Sequence[Point], edge: Colour | None = None, width: float = 0.0) -> None:
        line = {"stroke": _hex(edge), "stroke-width": _number(width), "stroke-linejoin": "round"} if edge else {}
        self._add("polygon", points=_points(points), fill=_hex(colour), **line)

    def stroke(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        line = {"stroke-width": _number(width), "stroke-linejoin": "round", "stroke-linecap": "round"}
        self._add("polyline", points=_points(points), fill="none", stroke=_hex(colour), **line)

    def wash(self, colour: Colour, alpha: int, points: Sequence[Point]) -> None:
        self._add("polygon", points=_points(points), fill=_hex(colour), **{"fill-opacity": f"{alpha / 255:.3f}"})

    def rectangle(self, colour: Colour, box: pygame.Rect, edge: Colour | None = None) -> None:
        inset = 0.5 if edge else 0.0
        place = {"x": box.left + inset, "y": box.top + inset, "width": box.w - 2 * inset, "height": box.h - 2 * inset}
        line = {"stroke": _hex(edge), "rx": "4"} if edge else {}
        self._add("rect", **{key: _number(value) for key, value in place.items()}, fill=_hex(colour), **line)

    def text(self, colour: Colour, words: str, place: Point, size: int, anchor: str = "center") -> pygame.Rect:
        box = pygame.Rect(0, 0, width_of(words, size), font(size).get_height())
        setattr(box, anchor, (round(place[0]), round(place[1])))
        if box.width:
            spot = {"x": str(box.left), "y": str(box.top + font(size).get_ascent()), "textLength": str(box.width)}
            element = self._add("text", **spot, fill=_hex(colour), **{"font-size": _number(size * _EM)}, **_FONT)
            element.text = printable(words)
        return box

    @contextmanager
    def group(self, kind: str) -> Iterator[None]:
        with self._within(ElementTree.SubElement(self._inner, "g", {"class": kind})):
            yield

    @contextmanager
    def window(self, size: tuple[int, int]) -> Iterator[None]:
        """What is drawn within is cut off beyond so many pixels right and down."""
        frame = {"width": str(size[0]), "height": str(size[1]), "overflow": "hidden"}
        with self._within(ElementTree.SubElement(self._inner, "svg", frame)):
            yield

    def write(self, path: str | Path) -> None:
        """Write the file.

        Raises:
            RenderError: it cannot be written.
        """
        try:
            ElementTree.ElementTree(self.root).write(path, encoding="utf-8", xml_declaration=True)
        except OSError as error:
            raise RenderError(f"cannot write {path}: {error}") from error

    @contextmanager
    def _within(self, element: ElementTree.Element) -> Iterator[None]:
        outer, self._inner = self._inner, element
        try:
            yield
        finally:
            self._inner = outer

    def _add(self, tag: str, **attributes: str) -> ElementTree.Element:
        return ElementTree.SubElement(self._inner, tag, attributes)


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


def _points(points: Sequence[Point]) -> str:
    return " ".join(f"{_number(x)},{_number(y)}" for x, y in points)


def _hex(colour: Colour | None) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour) if colour else "none"
