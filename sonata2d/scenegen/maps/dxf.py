"""DXF drawings of floor plans."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files.optional import optional
from ...core.wording import one_line
from ...errors import ConfigError
from .drawing import UNREADABLE, DrawnShape, DrawnText, plan_of
from .plan import MapOptions, Plan, read_map

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
        try:
            ezdxf = optional("ezdxf", ConfigError)
            units, paths = optional("ezdxf.units", ConfigError), optional("ezdxf.path", ConfigError)
        except ConfigError as error:
            raise ConfigError("DXF drawings need ezdxf; pip install 'sonata2d[maps]'") from error
        read_map(path)  # is a file, and not too large
        try:
            document = ezdxf.readfile(path)
        except (OSError, ezdxf.DXFError, *UNREADABLE) as error:
            raise ConfigError(f"{path.name} is not a DXF drawing: {one_line(error, 200) or 'it is cut off'}") from error
        unit = options.unit
        if unit is None:
            if not document.units:
                raise ConfigError(f"{path} does not say its unit; give the length of its unit, m (--unit)")
            unit = float(units.conversion_factor(document.units, units.M))
        try:
            shapes, texts = _content(document, unit, paths)
        except (ezdxf.DXFError, *UNREADABLE) as error:
            raise ConfigError(f"{path.name} is damaged: {type(error).__name__}: {one_line(error, 200)}") from error
        return plan_of(path, shapes, texts, options)


def _content(document: Any, unit: float, paths: Any) -> tuple[list[DrawnShape], list[DrawnText]]:
    """Lines and texts of the model space of a drawing.

    Args:
        document: of ezdxf.
        unit: of the drawing, m.
        paths: the module `ezdxf.path`.
    """
    shapes, texts = list[DrawnShape](), list[DrawnText]()
    for entity, layers, name in _entities(document.modelspace(), frozenset(), "", 0):
        kind = entity.dxftype()
        if kind in ("TEXT", "MTEXT"):
            words = entity.plain_text() if kind == "MTEXT" else entity.dxf.text
            texts.append(DrawnText(" ".join(words.split()), (entity.dxf.insert.x * unit, entity.dxf.insert.y * unit)))
            continue
        try:
            found = paths.from_hatch(entity) if kind == "HATCH" else [paths.make_path(entity)]
            parts = [part for part in found if 0 < len(part) < _MOST_PIECES and math.isfinite(_side(part))]
            lines = [list(part.flattening(max(_FLATNESS / unit, _COARSE * _side(part)))) for part in parts]
        except UNREADABLE:  # not a line, such as dimensions and images, or damaged
            continue
        for line in lines:
            points = np.array([(point.x, point.y) for point in line]) * unit
            if np.ptp(points, axis=0).max() > 0.0:
                shapes.append(DrawnShape(points, layers, name, kind in ("HATCH", "SOLID")))
    return shapes, texts


def _side(path: Any) -> float:
    """The longer side of the box around the control points of a path."""
    corners = np.array([(point.x, point.y) for point in path.control_vertices()])
    return float(np.ptp(corners, axis=0).max())


def _entities(
    container: Any, layers: frozenset[str], name: str, depth: int
) -> Iterator[tuple[Any, frozenset[str], str]]:
    """All entities, those of blocks included, each with the names of its layers and of its block."""
    for number, entity in enumerate(container):
        own = layers | {str(entity.dxf.get("layer", "0"))}
        if entity.dxftype() == "INSERT":
            if depth < _DEEPEST:
                block = name or f"{entity.dxf.name}#{number}"
                yield from _entities(entity.virtual_entities(), own, block, depth + 1)
        else:
            yield entity, own, name
