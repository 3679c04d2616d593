"""SVG drawings of floor plans."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...core.portable_math import Array
from ...core.wording import one_line
from ...errors import ConfigError
from .drawing import UNREADABLE, DrawnShape, DrawnText, plan_of
from .plan import MapOptions, Plan, package, read_map

_NOT_DRAWN = {"defs", "symbol", "clipPath", "mask", "marker", "pattern", "metadata", "title", "desc", "style"}
_PIECES = 16  # into which a curve is divided
_INHERITED = ("fill", "fill-opacity", "stroke", "visibility")
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
        patterns = (*options.walls, *options.doors, *options.furniture, *options.rooms)
        classes = _classes(root)
        try:
            for number, (element, matrix, layers, style) in enumerate(
                _elements(root, np.eye(3), frozenset(), {}, classes)
            ):
                matrix, tag = flip @ matrix, _tag(element)
                if tag == "text":
                    words = " ".join("".join(element.itertext()).split())
                    first = next((e for e in element.iter() if e.get("x") is not None), element)
                    at = matrix @ [_number(first.get("x")), _number(first.get("y")), 1.0]
                    texts.append(DrawnText(words, (float(at[0]), float(at[1]))))
                    continue
                title = style.get("title", "")
                if any(fnmatch(title.lower(), pattern.lower()) for pattern in patterns):
                    title = ""  # of a layer
                own = _title(element) or _name(element)
                name, owner, group = own or title, f"element {number}" if own else "", ""
                if title and not own:
                    group = style["group"]
                lines = [
                    (matrix @ np.column_stack((line, np.ones(len(line)))).T)[:2].T for line in _lines(element, tag)
                ]
                if lines and not _is_clear(style.get("fill", "black"), style.get("fill-opacity")):
                    shapes.append(DrawnShape(lines[0], layers, name, owner, True, tuple(lines[1:]), group=group))
                else:
                    shapes += [DrawnShape(line, layers, name, owner, group=group) for line in lines]
        except RecursionError as error:
            raise ConfigError(f"{path.name}: groups are nested too deeply") from error
        clones = sum(_tag(element) == "use" for element in root.iter())
        plan = plan_of(path, shapes, texts, options)
        if clones:
            plan.notes.append(f"{clones} clones (<use>) are left out; unlink them in the drawing")
        return plan


def _elements(
    element: Any, matrix: Array, layers: frozenset[str], style: dict[str, str], classes: dict[str, dict[str, str]]
) -> Iterator[tuple[Any, Array, frozenset[str], dict[str, str]]]:
    """The drawn elements, each with its transformation to user units, the names of its groups, and what it inherits.

    That is its fill, its stroke, and the title or label of its group.
    """
    own = {key: value for key in _INHERITED if (value := _style(element, key, classes))}
    if _tag(element) in _NOT_DRAWN or _style(element, "display", classes) == "none":
        return
    style = style | own
    if transform := element.get("transform"):
        try:
            with warnings.catch_warnings(action="error"):
                matrix = matrix @ np.array(package("svgpathtools.parser").parse_transform(transform))
        except (Warning, *UNREADABLE) as error:
            raise ConfigError(f"the transform {transform[:60]!r} of the drawing cannot be read") from error
    names = {element.get("id"), element.get(_LABEL), *(element.get("class") or "").split()}
    layers = layers | frozenset(name for name in names if name)
    if _tag(element) in ("svg", "g", "a", "switch"):
        if _tag(element) == "g" and (title := _title(element) or element.get(_LABEL, "").strip()):
            style = style | {"title": title, "group": f"group {id(element)}"}
        for child in element:
            if _tag(child) == "svg":
                raise ConfigError("the drawing has another <svg> in it; ungroup it in the drawing")
            yield from _elements(child, matrix, layers, style, classes)
    elif style.get("visibility") not in ("hidden", "collapse"):
        yield element, matrix, layers | {_colour(style[key]) for key in ("fill", "stroke") if key in style}, style


def _classes(root: Any) -> dict[str, dict[str, str]]:
    """Properties by class, from the rules of one class in the style sheets of a drawing."""
    text = " ".join("".join(element.itertext()) for element in root.iter() if _tag(element) == "style")
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
    found: dict[str, dict[str, str]] = {}
    for selectors, body in rules:
        for selector in re.findall(r"(?:^|,)\s*\.([\w-]+)\s*(?=,|$)", selectors):
            pairs = (pair.split(":", 1) for pair in body.split(";") if ":" in pair)
            found.setdefault(selector, {}).update({key.strip(): value.strip() for key, value in pairs})
    return found


def _is_clear(fill: str, opacity: str | None) -> bool:
    """Whether a fill cannot be seen."""
    return fill in ("none", "transparent") or (opacity is not None and _number(opacity) == 0.0)


def _title(element: Any) -> str:
    return next((str(child.text or "").strip() for child in element if _tag(child) == "title"), "")


def _lines(element: Any, tag: str) -> list[Array]:
    """The lines of an element in its own coordinates, (K, 2) each."""
    conversions, values = package("svgpathtools.svg_to_paths"), element.attrib
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
        parts = package("svgpathtools").parse_path(text).continuous_subpaths() if text.strip() else []
    except UNREADABLE as error:
        name = f"{tag} {element.get('id') or ''}".strip()
        raise ConfigError(f"the {name} of the drawing cannot be read: {one_line(error, 200)}") from error
    found = []
    for part in parts:
        points = [part[0].start]
        for segment in part:
            steps = 1 if type(segment).__name__ == "Line" else _PIECES
            points += [segment.point(k / steps) for k in range(1, steps + 1)]
        line = np.array([(point.real, point.imag) for point in points])
        if len(line) > 1 and np.ptp(line, axis=0).max() > 0.0:
            found.append(line)
    return found


def _tag(element: Any) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else "desc"


def _name(element: Any) -> str:
    """The label of an element, or else its id without the number that programs append."""
    name = str(element.get(_LABEL) or re.sub(r"[-_\d]+$", "", element.get("id") or "")).strip()
    return "" if name in _GIVEN_BY_PROGRAMS else name


def _style(element: Any, key: str, classes: dict[str, dict[str, str]]) -> str | None:
    """A property of an element, from its style, its classes, or the attribute of that name."""
    found = re.search(rf"(?:^|;)\s*{key}\s*:\s*([^;]+)", element.get("style") or "")
    of_class = (classes[name][key] for name in (element.get("class") or "").split() if key in classes.get(name, {}))
    value = found.group(1) if found else next(of_class, element.get(key))
    return value.strip() if value else None


def _colour(value: str) -> str:
    """A colour as #rrggbb, where that is possible."""
    value = _NAMED_COLOURS.get(value.lower(), value.lower())
    if parts := re.fullmatch(r"rgb\(\s*(\d+)\s*,\s*(\d+)\s*,\s*(\d+)\s*\)", value):
        return "#" + "".join(f"{min(int(part), 255):02x}" for part in parts.groups())
    return "#" + "".join(2 * digit for digit in value[1:]) if re.fullmatch("#[0-9a-f]{3}", value) else value


def _number(text: str | None) -> float:
    """A length in user units.

    Raises:
        ConfigError: it is in another unit.
    """
    if text is None:
        return 0.0
    found = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:px)?\s*", text.split(",")[0])
    if found is None:
        raise ConfigError(f"the length {text[:40]!r} of the drawing is not in user units; convert it to a number")
    return float(found.group(1))
