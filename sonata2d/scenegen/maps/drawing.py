"""Drawings of buildings: lines and shapes in layers become floor, rooms, doors and furniture."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from ...core.geometry import Point
from ...core.portable_math import Array
from ...errors import ConfigError
from .plan import MapOptions, Picture, Piece, Plan, finished_floor, package, polygons_of, rooms_of, shapely, sides

# Exceptions with which the parsers of drawings end on damaged files
UNREADABLE = (ValueError, ArithmeticError, LookupError, TypeError, AttributeError, StopIteration, RecursionError)
_LARGEST = 2000.0  # m, side of a drawing
_SMALLEST_ROOM, _SMALLEST_GAP = 0.5, 0.01  # m²
_TOLERANCE, _JOINED = 0.01, 1e-3  # m, of straightened walls, and by which parts of the floor overlap
_FACE = 0.03  # m, by which a door drawn on the face of a wall reaches into the gap
_SLIT = 0.02  # m, half the width of a gap between a door and a wall that counts as closed
_TOUCHING = 0.01  # m, up to which lines of furniture touch
_LARGEST_OBJECT = 1.0  # m, longest side of a closed outline of walls that counts as an object, such as a pillar
_PICTURE_SIDE = 1600  # pixels of the longer side
_LONGEST_NAME = 60
_TYPES = {  # parts of names of furniture, and the types that they mean; the first one that fits counts
    "chair": "chair", "stool": "chair", "seat": "chair", "desk": "table", "table": "table", "plant": "plant",
    "laptop": "laptop", "tv": "tv", "television": "tv", "shelf": "shelf", "cupboard": "shelf", "wardrobe": "shelf",
    "bookcase": "shelf", "cabinet": "shelf",
}  # fmt: skip


@dataclass(frozen=True)
class DrawnShape:
    """A line or an outline of a drawing.

    Attributes:
        points: (K, 2), m; curves are lines in pieces.
        layers: names of its layer and groups, and its colours as #rrggbb.
        name: of its element or block, for furniture and rooms; may be empty.
        part_of: the element or the block, of which all shapes are one piece of furniture; empty: the shape is one.
        is_filled: whether the outline is an area rather than a line.
        others: further outlines of the same area, (K, 2) each, m: what lies in an even number of outlines is a hole.
        width: of a line, m; 0: `MapOptions.wall_width`.
        group: named group of elements; those that touch each other are one piece of furniture.
    """

    points: Array
    layers: frozenset[str]
    name: str = ""
    part_of: str = ""
    is_filled: bool = False
    others: tuple[Array, ...] = ()
    width: float = 0.0
    group: str = ""


@dataclass(frozen=True)
class DrawnText:
    """A word in a drawing, which names the room around its position (m)."""

    text: str
    position: Point


def plan_of(path: Path, shapes: Sequence[DrawnShape], texts: Sequence[DrawnText], options: MapOptions) -> Plan:
    """The plan of a drawing.

    Doors close the gaps between walls. What is then enclosed is a room; rooms with a common door are one floor, and a
    door to the outside is an entrance.

    Raises:
        ConfigError: the drawing has no walls by the names in the options, or they enclose no floor.
    """
    notes: list[str] = []
    texts = [text for text in texts if re.search(r"[^\W\d_]{2}", text.text)]  # others are dimensions
    shapes = [shape for shape in shapes if np.isfinite(shape.points).all()]
    _check_size(path, shapes)
    walls = [
        _solid(shape, options.wall_width)
        for shape in shapes
        if _matches(shape, options.walls) and not _matches(shape, options.doors)
    ]
    usual = MapOptions()
    for kind in ("walls", "doors", "furniture", "rooms"):
        patterns = getattr(options, kind)
        is_found = bool(walls) if kind == "walls" else any(_matches(shape, patterns) for shape in shapes)
        if not is_found and (kind == "walls" or patterns != getattr(usual, kind)):
            listed = _listed(sorted({name for shape in shapes for name in shape.layers}), 20)
            raise ConfigError(
                f"{path}: no layer, group or colour is named like {', '.join(patterns)}; the drawing has "
                f"{listed or 'no names'}; give the one with {kind} (--{kind} NAME)"
            )
    solid = shapely().union_all(walls)
    drawn = [shapely().LineString(s.points).buffer(_TOLERANCE) for s in shapes if _matches(s, options.doors)]
    doors = [door.convex_hull for door in polygons_of(shapely().union_all(drawn))]  # leaf and swing touch
    found = [_threshold(hull, solid) for hull in doors]
    thresholds = [part for part in found if part is not None]
    closing = shapely().union_all([solid, *thresholds])
    frame = shapely().box(*closing.bounds).buffer(1.0)
    enclosed = [
        part.buffer(_SLIT, join_style="mitre").difference(closing)
        for part in polygons_of(frame.difference(closing.buffer(_SLIT, join_style="mitre")))
        if part.area > _SMALLEST_ROOM and not part.intersects(frame.exterior)
    ]
    outside = [part for part in polygons_of(frame.difference(closing)) if part.intersects(frame.exterior)]
    floors, inner, entrances = _connected(enclosed, thresholds)
    entrances = [door for door in entrances if any(part.distance(door) < _SLIT for part in outside)]
    for hull, part in zip(doors, found, strict=True):
        if not any(part is used for used in (*inner, *entrances)):
            x, y = hull.centroid.coords[0]
            notes.append(
                f"the door at ({x:.2f}, {y:.2f}) is left out: it closes no gap between walls; draw it from wall to wall"
            )
    floor, pillars = finished_floor(floors, options, tolerance=_TOLERANCE, largest_object=_LARGEST_OBJECT, notes=notes)
    furniture = [
        Piece(_type_of(s), hull) for s in _grouped(shapes, options.furniture) if (hull := _hull(s)) is not None
    ]
    inside = [piece for piece in furniture if floor.contains(piece.outline)]
    if len(inside) < len(furniture):
        places = [(piece.type, *piece.outline.centroid.coords[0]) for piece in furniture if piece not in inside]
        left_out = _listed(f"{type} at ({x:.2f}, {y:.2f})" for type, x, y in places)
        notes.append(f"furniture in walls or outside is left out: {left_out}")
    areas = _named(shapes, texts, enclosed, floor, options) or rooms_of(floor)
    lost = [text.text for text in texts if not any(room.contains(shapely().Point(*text.position)) for room in enclosed)]
    if lost:
        notes.append(
            f"these texts are not in an enclosed room: {_listed(map(repr, lost))}; if they name rooms, close gaps in "
            "their walls"
        )
    near = floor.buffer(2.0 * options.wall_width + 0.3)
    doors_outside = [
        (threshold.centroid.coords[0], max(sides(threshold))) for threshold in entrances if near.intersects(threshold)
    ]
    doorways = [threshold.centroid.coords[0] for threshold in inner if floor.contains(threshold.centroid)]
    return Plan(floor, pillars + inside, areas, doors_outside, _picture(shapes), notes, doorways)


def _listed(names: Iterable[str], most: int = 5) -> str:
    """The first names of a list."""
    every = [*names]
    return ", ".join(every[:most]) + (", …" if len(every) > most else "")


def _check_size(path: Path, shapes: Sequence[DrawnShape]) -> None:
    if not shapes:
        raise ConfigError(f"{path.name}: the drawing has no lines")
    points = np.concatenate([shape.points for shape in shapes])
    side = float(np.ptp(points, axis=0).max())
    if side > _LARGEST or np.abs(points).max() > 1e9:
        raise ConfigError(
            f"{path.name}: the drawing is {side:.3g} m wide, at most {_LARGEST:g} m are read; check the unit"
        )


def _matches(shape: DrawnShape, patterns: Iterable[str]) -> bool:
    return any(fnmatch(layer.lower(), pattern.lower()) for layer in shape.layers for pattern in patterns)


def _solid(shape: DrawnShape, width: float) -> Any:
    """A wall: a filled outline, or a line of a given width, m."""
    if shape.is_filled and len(shape.points) > 3:
        area = shapely().Polygon()
        for ring in (shape.points, *shape.others):
            if len(ring) > 3:
                area = area.symmetric_difference(shapely().Polygon(ring).buffer(0.0))
        return area
    line = shapely().LineString(shape.points)
    return line.buffer((shape.width or width) / 2.0, cap_style="square", join_style="mitre")


def _grouped(shapes: Sequence[DrawnShape], patterns: Iterable[str]) -> list[DrawnShape]:
    """The pieces of furniture in a layer, a shape each.

    One piece are the shapes of an element or block, those of a named group that touch each other, and loose lines that
    touch each other, such as the four sides of a table.
    """
    found: dict[str, list[DrawnShape]] = {}
    touching: dict[str, list[DrawnShape]] = {}
    for k, shape in enumerate(shapes):
        if _matches(shape, patterns):
            is_loose = not (
                shape.part_of or shape.name or shape.is_filled or (shape.points[0] == shape.points[-1]).all()
            )
            if not shape.part_of and (shape.group or is_loose):
                touching.setdefault(shape.group, []).append(shape)
            else:
                found.setdefault(shape.part_of or f"shape {k}", []).append(shape)
    groups = [*found.values(), *(part for group in touching.values() for part in _touching(group))]
    place = {id(shape): k for k, shape in enumerate(shapes)}
    groups.sort(key=lambda parts: place[id(parts[0])])  # as in the drawing
    return [
        parts[0]
        if len(parts) == 1
        else DrawnShape(np.concatenate([part.points for part in parts]), parts[0].layers, parts[0].name)
        for parts in groups
    ]


def _touching(shapes: Sequence[DrawnShape]) -> list[list[DrawnShape]]:
    """Shapes that touch each other, together; a closed outline touches what is in it."""
    geometry, found = shapely(), dict[int, list[DrawnShape]]()
    lines = [geometry.LineString(shape.points) for shape in shapes]
    filled = [geometry.Polygon(line.buffer(_TOUCHING).exterior) for line in lines]
    reached = polygons_of(geometry.union_all(filled))
    for line, part in geometry.STRtree(reached).query(lines, "intersects").T.tolist():
        found.setdefault(part, []).append(shapes[line])
    return list(found.values())


def _hull(shape: DrawnShape) -> Any | None:
    """The convex hull of a shape, as a thin rectangle if it is a straight line; None: it has no area."""
    hull = shapely().MultiPoint(shape.points).convex_hull
    if hull.geom_type == "LineString":
        hull = hull.buffer(0.02, cap_style="flat")
    return hull if hull.geom_type == "Polygon" and hull.area > 1e-4 else None


def _threshold(hull: Any, solid: Any) -> Any | None:
    """The part of a door between walls; None: there are no walls around it.

    Args:
        hull: outline around the door, with its swing.
        solid: the walls.
    """
    half = 0.55 * max(sides(hull))
    around = solid.intersection(hull.buffer(3.0 * half))
    closed = around.buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
    gaps = polygons_of(closed.intersection(hull.buffer(_FACE)).difference(solid))
    if gaps and gaps[0].area > _SMALLEST_GAP:
        return gaps[0]
    in_wall = polygons_of(closed.intersection(hull))  # a door drawn on a wall without a gap
    return in_wall[0] if in_wall else None


def _connected(rooms: Sequence[Any], thresholds: Sequence[Any]) -> tuple[list[Any], list[Any], list[Any]]:
    """Floors of rooms that doors connect, the doors between rooms, and those of one room only."""
    inner, entrances = list[Any](), list[Any]()
    for threshold in thresholds:
        reach = threshold.buffer(0.05)
        touched = sum(reach.intersection(room).area > 1e-4 for room in rooms)
        if touched:
            (inner if touched > 1 else entrances).append(threshold)
    parts = [part.buffer(_JOINED, join_style="mitre") for part in (*rooms, *inner)]
    joined = shapely().union_all(parts).buffer(-_JOINED, join_style="mitre")
    return polygons_of(joined), inner, entrances


def _named(
    shapes: Sequence[DrawnShape], texts: Sequence[DrawnText], rooms: Sequence[Any], floor: Any, options: MapOptions
) -> dict[str, Any]:
    """Rooms by name: outlines in the layer of rooms, and enclosed rooms with a text in them."""
    found: dict[str, Any] = {}
    for shape in shapes:
        if _matches(shape, options.rooms) and len(shape.points) > 3:
            outline = shapely().Polygon(shape.points).buffer(0.0)
            words = [text.text for text in texts if outline.contains(shapely().Point(*text.position))]
            _add(found, shape.name or " ".join(words) or "room", outline, floor)
    if found:
        return found
    for room in rooms:
        words = [text.text for text in texts if room.contains(shapely().Point(*text.position))]
        if words:
            _add(found, " ".join(words), room, floor)
    return found


def _add(found: dict[str, Any], name: str, outline: Any, floor: Any) -> None:
    """Add the part of a room that is on the floor, with a name of its own."""
    parts = polygons_of(outline.intersection(floor))
    if parts and parts[0].area > _SMALLEST_ROOM:
        part = shapely().Polygon(parts[0].simplify(_TOLERANCE).exterior)
        name, number = name[:_LONGEST_NAME].strip(), 1
        while (own := name if number == 1 else f"{name} {number}") in found:
            number += 1
        found[own] = part


def _type_of(shape: DrawnShape) -> str:
    name = shape.name.lower()
    return next((kind for part, kind in _TYPES.items() if part in name), name or "object")


def _picture(shapes: Sequence[DrawnShape]) -> Picture:
    """The drawing as an image."""
    low = np.min([shape.points.min(axis=0) for shape in shapes], axis=0) - 0.5
    high = np.max([shape.points.max(axis=0) for shape in shapes], axis=0) + 0.5
    size = float((high - low).max()) / _PICTURE_SIDE
    width, height = (int(side / size) + 1 for side in high - low)
    image = package("PIL.Image").new("L", (width, height), 255)
    brush = package("PIL.ImageDraw").Draw(image)
    picture = Picture(np.asarray(image), (float(low[0]), float(low[1])), 0.0, size)
    for shape in shapes:
        points = [tuple(point) for point in picture.to_pixels(shape.points).tolist()]
        if shape.is_filled and len(points) > 2:
            brush.polygon(points, fill=150)
        else:
            brush.line(points, fill=90, width=2)
    return Picture(np.asarray(image), picture.origin, 0.0, size)
