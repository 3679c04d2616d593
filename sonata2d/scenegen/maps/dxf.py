"""DXF drawings of floor plans."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...core.wording import one_line
from ...errors import ConfigError
from .drawing import UNREADABLE, DrawnShape, DrawnText, plan_of
from .plan import MapOptions, Plan, package, read_map

_FLATNESS = 0.01  # m, by which pieces of a curve may differ from it
_COARSE = 1e-4  # the same, as a share of the size of the curve
_MOST_PIECES = 20_000  # of a line; an arc of many turns has more
_DEEPEST = 8  # blocks in blocks


class DxfDrawing:
    """DXF drawings, as of AutoCAD: layers hold walls, doors and furniture, whose blocks are named by their types.

    `unit` is the length of a unit; default: as the file says.
    """

    suffixes = (".dxf",)

    def read(self, path: Path, options: MapOptions) -> Plan:
        """Read the model space of a drawing.

        Raises:
            ConfigError: the unit is not known, the file cannot be read, or no floor is enclosed by walls.
        """
        ezdxf, units = package("ezdxf"), package("ezdxf.units")
        read_map(path)  # is a file, and not too large
        try:
            document = ezdxf.readfile(path)
        except (OSError, ezdxf.DXFError, *UNREADABLE) as error:
            raise ConfigError(f"{path.name} is not a DXF drawing: {one_line(error, 200) or 'it is cut off'}") from error
        unit = options.unit
        if unit is None:
            try:
                unit = float(units.conversion_factor(document.units, units.M)) if document.units else None
            except UNREADABLE:
                unit = None
            if unit is None:
                raise ConfigError(f"{path} does not say its unit; give the length of its unit, m (--unit)")
        try:
            shapes, texts = _content(document, unit)
        except (ezdxf.DXFError, *UNREADABLE) as error:
            raise ConfigError(f"{path.name} is damaged: {type(error).__name__}: {one_line(error, 200)}") from error
        return plan_of(path, shapes, texts, options)


def _content(document: Any, unit: float) -> tuple[list[DrawnShape], list[DrawnText]]:
    """Lines and texts of the model space of a drawing.

    Args:
        document: of ezdxf.
        unit: of the drawing, m.
    """
    paths = package("ezdxf.path")
    shapes, texts = list[DrawnShape](), list[DrawnText]()
    hidden = {layer.dxf.name.lower() for layer in document.layers if layer.is_frozen() or layer.is_off()}
    for entity, layers, (name, owner) in _entities(document.modelspace(), frozenset(), ("", ""), 0):
        kind = entity.dxftype()
        if any(layer.lower() in hidden for layer in layers):
            continue
        if kind in ("TEXT", "MTEXT", "ATTRIB"):
            place = entity.dxf.insert if kind == "MTEXT" else entity.ocs().to_wcs(entity.get_placement()[1])
            texts.append(DrawnText(" ".join(entity.plain_text().split()), (place.x * unit, place.y * unit)))
            continue
        layers = layers | {_colour(entity, document)}
        try:
            found = paths.from_hatch(entity) if kind == "HATCH" else [paths.make_path(entity)]
            parts = [part for part in found if 0 < len(part) < _MOST_PIECES and math.isfinite(_side(part))]
            lines = [list(part.flattening(max(_FLATNESS / unit, _COARSE * _side(part)))) for part in parts]
        except UNREADABLE:  # not a line, such as dimensions and images, or damaged
            continue
        outlines = [np.array([(point.x, point.y) for point in line]) * unit for line in lines]
        outlines = [points for points in outlines if np.ptp(points, axis=0).max() > 0.0]
        if outlines and kind in ("HATCH", "SOLID"):
            shapes.append(DrawnShape(outlines[0], layers, name, owner, True, tuple(outlines[1:])))
        else:
            width = unit * float(entity.dxf.get("const_width", 0.0)) if kind == "LWPOLYLINE" else 0.0
            shapes += [DrawnShape(points, layers, name, owner, width=width) for points in outlines]
    return shapes, texts


def _colour(entity: Any, document: Any) -> str:
    """The colour of an entity or of its layer as #rrggbb; empty: it has none."""
    colours = package("ezdxf.colors")
    layer = document.layers.get(entity.dxf.layer) if document.layers.has_entry(entity.dxf.layer) else None
    number = entity.dxf.get("color", 256)
    if entity.rgb is not None:
        return f"#{colours.rgb2int(entity.rgb):06x}"
    if number == 256 and layer is not None:
        if layer.rgb is not None:
            return f"#{colours.rgb2int(layer.rgb):06x}"
        number = abs(layer.dxf.color)
    return f"#{colours.rgb2int(colours.aci2rgb(number)):06x}" if 1 <= number <= 255 else ""


def _side(path: Any) -> float:
    """The longer side of the box around the control points of a path."""
    corners = np.array([(point.x, point.y) for point in path.control_vertices()])
    return float(np.ptp(corners, axis=0).max())


def _entities(
    container: Any, layers: frozenset[str], block: tuple[str, str], depth: int
) -> Iterator[tuple[Any, frozenset[str], tuple[str, str]]]:
    """All entities, those of blocks included, each with the names of its layers, and the name and id of its block."""
    for number, entity in enumerate(container):
        own = layers | {str(entity.dxf.get("layer", "0"))}
        if entity.dxftype() == "INSERT":
            if depth < _DEEPEST:
                for k, single in enumerate(entity.multi_insert() if entity.mcount > 1 else [entity]):
                    inner = block if block[1] else (str(entity.dxf.name), f"block {number}.{k}")
                    yield from _entities(single.virtual_entities(), own, inner, depth + 1)
                yield from ((attribute, own, block) for attribute in entity.attribs)
        elif entity.dxftype() == "MLINE":
            yield from ((part, own, block) for part in entity.virtual_entities())
        else:
            yield entity, own, block
