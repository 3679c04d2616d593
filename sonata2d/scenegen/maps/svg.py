"""SVG drawings of floor plans."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...core.files.optional import optional
from ...core.portable_math import Array
from ...core.wording import one_line
from ...errors import ConfigError
from .drawing import UNREADABLE, DrawnShape, DrawnText, plan_of
from .plan import MapOptions, Plan, read_map

_NOT_DRAWN = {"defs", "symbol", "clipPath", "mask", "marker", "pattern", "metadata", "title", "desc", "style"}
_PIECES = 16  # into which a curve is divided
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_GIVEN_BY_PROGRAMS = {"rect", "path", "circle", "ellipse", "polygon", "polyline", "line", "g", "use"}
_NAMED_COLOURS = {"black": "#000000", "red": "#ff0000", "green": "#008000", "blue": "#0000ff", "white": "#ffffff"}


class SvgDrawing:
    """SVG drawings, as of Inkscape: layers are groups with a label or an id; `unit` is the length of a user unit."""

    suffixes = (".svg",)

    def read(self, path: Path, options: MapOptions) -> Plan:
        """Read a drawing.

        Raises:
            ConfigError: the unit is not given, the file cannot be read, or no floor is enclosed by walls.
        """
        if options.unit is None:
            raise ConfigError(
                f"{path}: a drawing in SVG does not say how large it is; give the length of its unit, m (--unit)"
            )
        try:
            root = ElementTree.fromstring(read_map(path))
        except (ElementTree.ParseError, *UNREADABLE) as error:
            raise ConfigError(f"{path.name} is not an SVG drawing: {one_line(error, 200)}") from error
        shapes, texts = list[DrawnShape](), list[DrawnText]()
        flip = np.diag([options.unit, -options.unit, 1.0])  # y of SVG points down
        for number, (element, matrix, layers, style) in enumerate(_elements(root, np.eye(3), frozenset(), {})):
            tag, name = _tag(element), style.get("title") or _name(element)
            if tag == "text":
                words = " ".join("".join(element.itertext()).split())
                first = next((e for e in element.iter() if e.get("x") is not None), element)
                at = flip @ matrix @ [_number(first.get("x")), _number(first.get("y")), 1.0]
                if words:
                    texts.append(DrawnText(words, (float(at[0]), float(at[1]))))
                continue
            for points in _lines(element, tag):
                placed = (flip @ matrix @ np.column_stack((points, np.ones(len(points)))).T)[:2].T
                is_filled = style.get("fill", "black") != "none"
                shapes.append(DrawnShape(placed, layers, f"{name}#{number}" if name else "", is_filled))
        return plan_of(path, shapes, texts, options)


def _elements(
    element: Any, matrix: Array, layers: frozenset[str], style: dict[str, str]
) -> Iterator[tuple[Any, Array, frozenset[str], dict[str, str]]]:
    """The drawn elements, each with its transformation to user units, the names of its groups, and what it inherits.

    That is its fill, its stroke and its title.
    """
    if _tag(element) in _NOT_DRAWN or _style(element, "display") == "none":
        return
    if element.get("transform"):
        matrix = matrix @ np.array(_paths().parser.parse_transform(element.get("transform")))
    style = style | {key: value for key in ("fill", "stroke") if (value := _style(element, key))}
    title = next((str(child.text).strip() for child in element if _tag(child) == "title"), "")
    style |= {"title": title} if title else {}
    names = {element.get("id"), element.get(_LABEL), *(element.get("class") or "").split()}
    layers = layers | frozenset(name for name in names if name)
    if _tag(element) in ("svg", "g", "a"):
        for child in element:
            yield from _elements(child, matrix, layers, style)
    else:
        yield element, matrix, layers | {_colour(style[key]) for key in ("fill", "stroke") if key in style}, style


def _lines(element: Any, tag: str) -> list[Array]:
    """The lines of an element in its own coordinates, (K, 2) each."""
    conversions = _paths().svg_to_paths
    values = element.attrib
    try:
        if tag == "path":
            text = values.get("d", "")
        elif tag == "rect":
            x, y, w, h = (_number(values.get(key)) for key in ("x", "y", "width", "height"))
            text = f"M {x} {y} L {x + w} {y} L {x + w} {y + h} L {x} {y + h} Z"
        elif tag in ("circle", "ellipse"):
            text = conversions.ellipse2pathd(values)
        elif tag in ("polygon", "polyline"):
            text = conversions.polyline2pathd(values, is_polygon=tag == "polygon")
        elif tag == "line":
            text = "M {x1} {y1} L {x2} {y2}".format(
                **{key: _number(values.get(key)) for key in ("x1", "y1", "x2", "y2")}
            )
        else:
            return []
        path = _paths().parse_path(text)
    except UNREADABLE as error:
        name = f"{tag} {element.get('id') or ''}".strip()
        raise ConfigError(f"the {name} of the drawing cannot be read: {one_line(error, 200)}") from error
    found = []
    for part in path.continuous_subpaths():
        points = [part[0].start]
        for segment in part:
            steps = 1 if type(segment).__name__ == "Line" else _PIECES
            points += [segment.point(k / steps) for k in range(1, steps + 1)]
        line = np.array([(point.real, point.imag) for point in points])
        if len(line) > 1 and np.ptp(line, axis=0).max() > 0.0:
            found.append(line)
    return found


def _paths() -> Any:
    try:
        package = optional("svgpathtools", ConfigError)
        for module in ("parser", "svg_to_paths"):
            optional(f"svgpathtools.{module}", ConfigError)
    except ConfigError as error:
        raise ConfigError("SVG drawings need svgpathtools; pip install 'sonata2d[maps]'") from error
    return package


def _tag(element: Any) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else "desc"


def _name(element: Any) -> str:
    """The label of an element, or else its id without the number that programs append."""
    name = str(element.get(_LABEL) or re.sub(r"[-_\d]+$", "", element.get("id") or "")).strip()
    return "" if name in _GIVEN_BY_PROGRAMS else name


def _style(element: Any, key: str) -> str | None:
    """A property of an element, from its style or from the attribute of that name."""
    found = re.search(rf"(?:^|;)\s*{key}\s*:\s*([^;]+)", element.get("style") or "")
    value = found.group(1) if found else element.get(key)
    return value.strip() if value else None


def _colour(value: str) -> str:
    """A colour as #rrggbb, where that is possible."""
    value = _NAMED_COLOURS.get(value.lower(), value.lower())
    return "#" + "".join(2 * digit for digit in value[1:]) if re.fullmatch("#[0-9a-f]{3}", value) else value


def _number(text: str | None) -> float:
    found = re.match(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)", text or "0")
    return float(found.group(1)) if found else 0.0
