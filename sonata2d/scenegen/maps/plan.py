"""A floor plan as a map reader returns it, and the geometry that all readers share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...core.doors import DoorKind
from ...core.files.optional import optional
from ...core.files.reading import read_at_most
from ...core.floats import FloatFields
from ...core.geometry import Point
from ...core.portable_math import Array
from ...core.vectors import lengths
from ...errors import ConfigError

_PARALLEL = math.radians(15.0)  # edges that differ by less have no reliable intersection
_ROUND, _BOXLIKE, _CONVEX = 0.92, 0.87, 0.8  # shares of an outline in a circle, a rectangle, its convex hull
_MOST_CORNERS = 12  # of the outline of a piece of furniture
_DOOR = 1.05  # m, between rooms; wider openings and corridors connect parts of one room
_LARGE = 2.5  # m, longest side of an obstacle that may separate rooms
_MOST_BYTES = 100_000_000
_LARGEST_TOLERANCE = 0.25  # m
_TOUCHING, _CLEARANCE = 1e-3, 3e-3  # m
_SMALLEST_FLOOR = 1.0  # m²
_SMALLEST_MIDDLE = 0.5  # m², of a room without a margin of half the width of a door


@dataclass(frozen=True)
class Picture(FloatFields):
    """The map as an image, to draw the result on.

    Attributes:
        grey: (H, W) of uint8, the first row on top.
        origin: x, y of the lower left corner, m.
        theta: rotation of the image about this corner, rad.
        size: of a pixel, m.
    """

    grey: Any
    origin: Point
    theta: float
    size: float

    def to_pixels(self, points: Array) -> Array:
        """Positions (N, 2), m, as columns and rows from the top left corner, (N, 2)."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        x, y = (np.asarray(points, dtype=float).reshape(-1, 2) - self.origin).T
        return np.stack(((x * c + y * s) / self.size, len(self.grey) - (y * c - x * s) / self.size), axis=1)


@dataclass(frozen=True)
class Piece:
    """A piece of furniture of a map: its type, and its outline, a polygon of shapely, m."""

    type: str
    outline: Any


@dataclass(frozen=True)
class Plan:
    """A floor plan.

    Attributes:
        floor: connected polygon of shapely, with holes, m.
        furniture: pieces on the floor.
        areas: named parts of the floor, as polygons of shapely.
        entrances: middle and width of each door to the outside, m.
        doorways: middle of each door between rooms of a drawing, m.
        picture: the map.
        notes: what was left out or changed, for the user.
    """

    floor: Any
    furniture: list[Piece]
    areas: dict[str, Any]
    entrances: list[tuple[Point, float]]
    picture: Picture
    notes: list[str] = field(default_factory=list)
    doorways: list[Point] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class MapOptions(FloatFields):
    """Options of all map readers.

    Attributes:
        unit: length of a unit of the map, m: of a pixel of an image, of a unit of a drawing. Default: as the map says.
        robot_at: x, y, m: the connected floor around this point is used. Default: the largest one inside the map.
        smallest: obstacles that are smaller in both directions are left out, m.
        narrowest: passages and recesses of the floor that are narrower are closed, m.
        thin: lines of an image that are thinner are no walls, such as swings of doors, texts and dimensions, m.
        tolerance: largest distance of straightened walls from the map, m. Default: half a cell, 1 cm in drawings.
        most_walls: where there are more, they are straightened with a larger tolerance.
        threshold: darkness from which a pixel of an image is a wall, 0 (white) to 1 (black).
        wall_width: width of walls that a drawing shows as single lines, m.
        walls, doors, furniture, rooms: names of layers or groups of a drawing, with `*` and `?`, or colours such as
            #ff0000. Default: names that contain wall, door, furn, or room.
        leaves: doors between rooms of a drawing open and close, with leaves of this kind. Default: doorways are free.
    """

    unit: float | None = None
    robot_at: Point | None = None
    smallest: float = 0.15
    narrowest: float = 0.3
    thin: float | None = None
    tolerance: float | None = None
    most_walls: int = 1000
    threshold: float = 0.5
    wall_width: float = 0.1
    walls: Sequence[str] = ("*wall*",)
    doors: Sequence[str] = ("*door*",)
    furniture: Sequence[str] = ("*furn*",)
    rooms: Sequence[str] = ("*room*",)
    leaves: DoorKind | None = None

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ConfigError: a length is not above 0, a threshold not within 0..1, or a list of names is a text.
        """
        super().__post_init__()
        for name in ("unit", "smallest", "narrowest", "tolerance", "wall_width"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < 1e4:
                raise ConfigError(f"{name} must be above 0 and below 10000 m, got {value:g}")
        if self.thin is not None and not 0.0 <= self.thin < 1e4:
            raise ConfigError(f"thin must be 0 or more, got {self.thin:g}")
        if not 0.0 <= self.threshold <= 1.0:
            raise ConfigError(f"threshold must be within 0 and 1, got {self.threshold:g}")
        if self.most_walls < 10:
            raise ConfigError(f"most_walls must be 10 or more, got {self.most_walls}")
        for name in ("walls", "doors", "furniture", "rooms"):
            if isinstance(getattr(self, name), str):
                raise ConfigError(f"{name} is a list of names, got the text {getattr(self, name)!r}")


def read_map(path: Path) -> bytes:
    """The content of a file of a map.

    Raises:
        ConfigError: it cannot be read, or is too large.
    """
    try:
        return read_at_most(path, _MOST_BYTES, remedy="simplify the map")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error


@cache
def package(name: str) -> Any:
    """A package, or a module of one, of the extra `maps`.

    Raises:
        ConfigError: it is not installed.
    """
    return optional(name, ConfigError, extra="maps")


def shapely() -> Any:
    """The package shapely with its module of affine transformations.

    Raises:
        ConfigError: it is not installed.
    """
    package("shapely.affinity")
    return package("shapely")


def polygons_of(geometry: Any) -> list[Any]:
    """The polygons of a geometry of shapely, the largest first."""
    parts = getattr(geometry, "geoms", [geometry])
    found = [part for one in parts for part in getattr(one, "geoms", [one]) if part.geom_type == "Polygon"]
    return sorted((part for part in found if not part.is_empty), key=lambda part: -part.area)


def finished_floor(
    floors: Sequence[Any], options: MapOptions, *, tolerance: float, largest_object: float, notes: list[str]
) -> tuple[Any, list[Piece]]:
    """The chosen floor with straight walls, and the obstacles on it that are furniture.

    Args:
        floors: connected parts of the map, polygons of shapely, m.
        options: of the reader.
        tolerance: of straightened walls, m, unless the options have one.
        largest_object: longest side of an obstacle that counts as furniture, m.
        notes: gets lines about what was left out or changed.

    Raises:
        ConfigError: there is no floor, or none at `robot_at`, or there are too many walls.
    """
    wide = [part for floor in floors if floor.area > _SMALLEST_FLOOR for part in _opened(floor, options.narrowest)]
    floor = _without_specks(_chosen_floor(wide, options.robot_at, notes), options.smallest, notes)
    floor, pieces = _with_objects(floor, largest_object)
    return _straightened(floor, options.tolerance or tolerance, options.most_walls, notes), pieces


def _chosen_floor(candidates: Sequence[Any], robot_at: Point | None, notes: list[str]) -> Any:
    """The connected floor around a point, or the largest one.

    Args:
        candidates: polygons of shapely, of which at least one is needed.
        robot_at: x, y, m; None: the largest.
        notes: gets a line about the floors that are left out.

    Raises:
        ConfigError: there is no floor, or none around the point.
    """
    found = sorted(candidates, key=lambda floor: -floor.area)
    if not found:
        raise ConfigError(
            "no floor is enclosed by walls; close gaps in the outer walls, draw doors there, or check the layers"
        )
    chosen = found[0]
    if robot_at is not None:
        point = shapely().Point(*robot_at)
        around = [floor for floor in found if floor.covers(point)]
        if not around:
            inside = found[0].representative_point()
            raise ConfigError(
                f"({robot_at[0]:g}, {robot_at[1]:g}) is not on the floor; the largest floor is around "
                f"({inside.x:.2f}, {inside.y:.2f})"
            )
        chosen = around[0]
    others = [floor.area for floor in found if floor is not chosen and floor.area > _SMALLEST_FLOOR]
    if others:
        sizes = ", ".join(f"{area:.0f}" for area in others[:5]) + (", …" if len(others) > 5 else "")
        notes.append(f"{len(others)} separate floors are left out, {sizes} m²; --robot-at X Y chooses another one")
    return chosen


def _opened(floor: Any, narrowest: float) -> list[Any]:
    """The connected parts of a floor without passages and recesses that are narrower than a limit, m."""
    half = narrowest / 2.0
    wide = floor.buffer(-half, join_style="mitre").buffer(half * 1.001, join_style="mitre", mitre_limit=2.0)
    return polygons_of(wide.intersection(floor))


def _straightened(floor: Any, tolerance: float, most_walls: int, notes: list[str]) -> Any:
    """A floor with straight edges: lines fitted to the outline, which meet in corners.

    Args:
        floor: polygon of shapely, m.
        tolerance: largest distance of corners of the floor from the fitted lines, m.
        most_walls: number of edges up to which the tolerance is kept; it is raised until there are no more.
        notes: gets a line about a raised tolerance.
    """
    used = tolerance
    floor = _with_corners(floor.simplify(0.02 * tolerance), 1.6 * tolerance).segmentize(2.0 * tolerance)
    rings = [np.array(ring.coords)[:-1] for ring in (floor.exterior, *floor.interiors)]
    while True:
        fitted = [ring for ring in (straight_ring(ring, used) for ring in rings) if len(ring) > 2]
        result = _apart(shapely().Polygon(fitted[0], fitted[1:]), floor.simplify(used))
        count = sum(len(ring.coords) - 1 for ring in (result.exterior, *result.interiors))
        if count <= most_walls:
            break
        used *= 1.25
        if used > max(_LARGEST_TOLERANCE, tolerance):
            raise ConfigError(
                f"the map has {count} walls even if they are straightened by {used / 1.25:.2g} m; leave out small "
                "obstacles (--smallest), or allow more (--most-walls)"
            )
    if used > tolerance:
        notes.append(f"walls are straightened by up to {used:.3g} m, not {tolerance:.3g}, to have at most {most_walls}")
    return result


def _with_corners(polygon: Any, short: float) -> Any:
    """A polygon without the bevels by which outlines of grids cut corners, or the same one if edges would cross."""
    rings = [_with_sharp_corners(np.array(ring.coords)[:-1], short) for ring in (polygon.exterior, *polygon.interiors)]
    sharp = shapely().Polygon(rings[0], rings[1:])
    return sharp if sharp.is_valid else polygon


def _with_sharp_corners(ring: Array, short: float) -> Array:
    """A ring (K, 2), m, in which edges shorter than `short` between two long ones become corners."""
    k = 0
    while k < len(ring) and len(ring) > 4:
        a, b, c, d = (ring[(k + step) % len(ring)] for step in range(4))
        sizes = [math.dist(a, b), math.dist(b, c), math.dist(c, d)]
        corner = None
        if sizes[1] < short and min(sizes[0], sizes[2]) > 1.5 * short:
            corner = _intersection(b, (b - a) / sizes[0], c, (d - c) / sizes[2])
        if corner is not None and max(math.dist(corner, b), math.dist(corner, c)) < short:
            ring[(k + 1) % len(ring)] = corner
            ring = np.delete(ring, (k + 2) % len(ring), axis=0)
        else:
            k += 1
    return ring


def _apart(*floors: Any) -> Any:
    """The first of several forms of a floor whose edges neither cross nor touch.

    If there is none, narrow parts of the last one are closed.
    """
    for floor in floors:
        if floor.is_valid and floor.minimum_clearance > _CLEARANCE:
            return floor
    floor = floors[-1].buffer(0.0)
    for margin in (0.01, 0.02, 0.05, 0.1):
        wide = floor.buffer(-margin, join_style="mitre").buffer(margin, join_style="mitre").simplify(margin / 10.0)
        if polygons_of(wide) and polygons_of(wide)[0].minimum_clearance > _CLEARANCE:
            break
    return polygons_of(wide)[0]


def straight_ring(ring: Array, tolerance: float) -> Array:
    """The corners of straight lines through the points of a closed ring.

    The ring is divided at the points that are farthest from their chords, as by Douglas & Peucker (Cartographica 10
    (1973) 112), until all points are near the lines that fit them best.

    Args:
        ring: (K, 2), m.
        tolerance: largest distance of a point from its line, m.

    Returns:
        (C, 2), m.
    """
    start = int(np.argmax(lengths(ring - ring.mean(axis=0))))
    points = np.roll(ring, -start, axis=0)
    points = np.concatenate((points, points[:1]))  # closed
    middle = int(np.argmax(lengths(points - points[0])))
    breaks = [0, *_breaks(points, 0, middle, tolerance), middle, *_breaks(points, middle, len(ring), tolerance)]
    k = 0
    while len(breaks) > 3 and k < len(breaks):  # divisions that the fitted lines do not need
        i, j = breaks[k - 1], breaks[(k + 1) % len(breaks)]
        if _is_straight(_between(points, i, j), tolerance):
            del breaks[k]
        else:
            k += 1
    lines = [_best_line(_between(points, i, j)) for i, j in zip(breaks, breaks[1:] + breaks[:1], strict=True)]
    corners = []
    for k, i in enumerate(breaks):
        (a, u), (b, v) = lines[k - 1], lines[k]
        corner = _intersection(a, u, b, v)
        if corner is not None and math.dist(corner, points[i]) < 3.0 * tolerance:
            corners.append(corner)
        else:  # a step: both lines end beside the point
            corners += [a + u * float((points[i] - a) @ u), b + v * float((points[i] - b) @ v)]
    return np.array(corners)


def _between(points: Array, i: int, j: int) -> Array:
    """The points of a closed ring from i to j, both included."""
    return points[i : j + 1] if i < j else np.concatenate((points[i:-1], points[: j + 1]))


def _breaks(points: Array, i: int, j: int, tolerance: float) -> list[int]:
    """Indices between i and j at which the points from i to j are divided into straight parts."""
    found, parts = list[int](), [(i, j)]
    while parts:
        i, j = parts.pop()
        if j - i < 2 or _is_straight(points[i : j + 1], tolerance):
            continue
        chord = points[j] - points[i]
        offset = points[i + 1 : j] - points[i]
        size = float(np.hypot(*chord))
        aside = np.abs(offset[:, 0] * chord[1] - offset[:, 1] * chord[0]) if size > 0.0 else lengths(offset)
        middle = i + 1 + int(np.argmax(aside))
        found.append(middle)
        parts += [(i, middle), (middle, j)]
    return sorted(found)


def _best_line(points: Array) -> tuple[Array, Array]:
    """A point and the direction of the line with the least squares of the distances of points (K, 2)."""
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    return middle, direction


def _is_straight(points: Array, tolerance: float) -> bool:
    """Whether all points (K, 2) are within the tolerance of the line that fits them best, m."""
    middle, u = _best_line(points)
    offset = points - middle
    return bool(np.abs(offset[:, 0] * u[1] - offset[:, 1] * u[0]).max() <= tolerance)


def _intersection(a: Array, u: Array, b: Array, v: Array) -> Array | None:
    """Where two lines, each through a point with a direction of length 1, meet; None if they are nearly parallel."""
    cross = float(u[0] * v[1] - u[1] * v[0])
    if abs(cross) < math.sin(_PARALLEL):
        return None
    along = float((b - a)[0] * v[1] - (b - a)[1] * v[0]) / cross
    corner: Array = a + along * u
    return corner


def _without_specks(floor: Any, smallest: float, notes: list[str]) -> Any:
    """A floor without holes that are smaller than a limit in both directions, m."""
    kept, dropped = [], 0
    for ring in floor.interiors:
        if max(sides(shapely().Polygon(ring))) < smallest:
            dropped += 1
        else:
            kept.append(ring)
    if dropped:
        notes.append(f"{dropped} obstacles smaller than {smallest:g} m are left out; --smallest changes the limit")
    return shapely().Polygon(floor.exterior, kept)


def _with_objects(floor: Any, largest: float) -> tuple[Any, list[Piece]]:
    """Turn holes of simple outline into furniture.

    Args:
        floor: polygon of shapely.
        largest: sides up to which a hole is a piece of furniture, m.

    Returns:
        The floor without these holes, and the pieces.
    """
    kept, pieces = [], []
    for ring in floor.interiors:
        outline = shapely().Polygon(ring)
        if max(sides(outline)) <= largest and outline.area > _CONVEX * outline.convex_hull.area:
            pieces.append(Piece("object", outline))
        else:
            kept.append(ring)
    return shapely().Polygon(floor.exterior, kept), pieces


def sides(outline: Any) -> tuple[float, float]:
    """Length and width of the smallest rectangle around an outline, m."""
    corners = np.array(outline.minimum_rotated_rectangle.exterior.coords)[:3]
    return math.dist(corners[0], corners[1]), math.dist(corners[1], corners[2])


def rooms_of(floor: Any) -> dict[str, Any]:
    """Rooms of a floor: the parts that doors connect, named by size; empty if there are fewer than two.

    Doors are narrower than a disc that moves in the rooms. What this disc does not reach is a doorway if it touches
    several rooms, else a corner of one room.
    """
    half = _DOOR / 2.0
    large = [ring for ring in floor.interiors if max(sides(shapely().Polygon(ring))) > _LARGE]
    whole = shapely().Polygon(floor.exterior, large)
    middles = [middle for middle in polygons_of(whole.buffer(-half)) if middle.area > _SMALLEST_MIDDLE]
    rooms = [polygons_of(middle.buffer(half).intersection(whole))[0] for middle in middles]
    if len(rooms) < 2:
        return {}
    outlines = [room.simplify(0.02) for room in _with_own_corners(rooms, whole)]
    outlines.sort(key=lambda outline: -outline.area)
    return {f"room-{k}": shapely().Polygon(outline.exterior) for k, outline in enumerate(outlines, 1)}


def _with_own_corners(parts: list[Any], floor: Any) -> list[Any]:
    """Parts of a floor with the rest of it that touches one of them only, such as corners that a disc does not reach.

    Args:
        parts: polygons of shapely, apart from each other.
        floor: that they are parts of.
    """
    corners: list[list[Any]] = [[] for _ in parts]
    for rest in polygons_of(floor.difference(shapely().union_all(parts))):
        touched = [k for k, part in enumerate(parts) if part.distance(rest) < _TOUCHING]
        if len(touched) == 1:
            corners[touched[0]].append(rest.buffer(_TOUCHING, join_style="mitre").intersection(floor))
    return [polygons_of(shapely().union_all([part, *own]))[0] for part, own in zip(parts, corners, strict=True)]


def piece_settings(piece: Piece) -> dict[str, Any]:
    """The settings of a piece of furniture: a disc, a rectangle or a convex polygon."""
    outline = piece.outline
    centre, radius = outline.centroid, math.sqrt(outline.area / math.pi)
    common: dict[str, Any] = {"type": piece.type, "attracts": piece.type != "object"}
    box = outline.minimum_rotated_rectangle
    if outline.area > _BOXLIKE * box.area:
        corners = np.array(box.exterior.coords)
        edges = np.diff(corners[:3], axis=0)
        long = int(math.hypot(*edges[1]) > math.hypot(*edges[0]))
        theta = math.remainder(math.atan2(edges[long][1], edges[long][0]), math.pi)
        size = [_mm(math.hypot(*edges[long])), _mm(math.hypot(*edges[1 - long]))]
        middle = corners[:4].mean(axis=0)
        return common | {"x": _mm(middle[0]), "y": _mm(middle[1]), "theta": _mm(theta), "size": size}
    circle = centre.buffer(radius)
    if circle.intersection(outline).area > _ROUND * outline.area:
        return common | {"x": _mm(centre.x), "y": _mm(centre.y), "size": _mm(radius)}
    step, hull = 0.01, outline.convex_hull.simplify(0.01)
    while len(hull.exterior.coords) - 1 > _MOST_CORNERS:
        step *= 1.5
        hull = hull.simplify(step)
    ring = shapely().geometry.polygon.orient(hull).exterior
    points = [[_mm(x - centre.x), _mm(y - centre.y)] for x, y in list(ring.coords)[:-1]]
    return common | {"x": _mm(centre.x), "y": _mm(centre.y), "body": {"shape": "polygon", "points": points}}


def corners_of(ring: Any) -> list[list[float]]:
    """The corners of a ring of shapely, m, without those that coincide at the precision of a millimetre."""
    corners: list[list[float]] = []
    for x, y in list(ring.coords)[:-1]:
        corner = [_mm(x), _mm(y)]
        if not corners or math.dist(corner, corners[-1]) > 2e-3:
            corners.append(corner)
    while len(corners) > 3 and math.dist(corners[0], corners[-1]) <= 2e-3:
        corners.pop()
    return corners


def _mm(value: float) -> float:
    return round(float(value), 3) + 0.0
