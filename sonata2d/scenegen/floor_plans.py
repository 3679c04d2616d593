"""Floor plans: one function for each kind of room creates the outline and the inner walls, centred at the origin."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.entities import Wall
from ..core.geometry import Barriers, Point, Pose, Shape, inside_polygon, inside_rings, quantised
from ..core.outlines import COLUMNS, Line, OutlineRow, has_space, has_space_at, outline_row
from ..core.portable_math import Array, BoolArray
from ..core.rng import RandomStream
from ..registry import ROOM_KINDS
from .scenario.rooms import RoomConfig

_NO_OUTLINES, _NO_LINES = np.empty((0, COLUMNS)), np.empty((0, 4))


@dataclass(frozen=True)
class FloorPlan:
    """An empty room.

    Attributes:
        kind: name of the room kind; `given` for a polygon from the scenario.
        polygon: corners of the outline, counter-clockwise, m.
        inner_walls: walls other than the outline and the holes.
        holes: polygons in which there is no floor, m.
    """

    kind: str
    polygon: tuple[Point, ...]
    inner_walls: tuple[Wall, ...] = ()
    holes: tuple[tuple[Point, ...], ...] = ()

    @cached_property
    def walls(self) -> tuple[Wall, ...]:
        """The edges of the outline and of the holes, then the inner walls."""
        rings = (self.polygon, *self.holes)
        edges = (Wall(a, b) for ring in rings for a, b in zip(ring, (*ring[1:], ring[0]), strict=True))
        return (*edges, *self.inner_walls)

    @cached_property
    def barriers(self) -> Barriers:
        """The walls as segments of radius 0."""
        return Barriers.of((wall.start, wall.end, 0.0) for wall in self.walls)

    @cached_property
    def outline(self) -> Array:
        """(K, 2), m, the polygon."""
        return np.array(self.polygon, dtype=float)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Minimum x, maximum x, minimum y, maximum y, m."""
        xs, ys = zip(*self.polygon, strict=True)
        return min(xs), max(xs), min(ys), max(ys)

    @property
    def size_text(self) -> str:
        """The size for messages: `4.0 m` for a square, else `9.0 x 6.0 m`."""
        left, right, bottom, top = self.bounds
        return f"{right - left:.1f} m" if self.kind == "square" else f"{right - left:.1f} x {top - bottom:.1f} m"

    def sample_point(self, rng: RandomStream, area: Sequence[Point] | None = None) -> Point:
        """Draw a point uniformly from an area, or from the bounding box; m. It may lie outside the room.

        Args:
            rng: random stream of the point.
            area: polygon, m.
        """
        if area is None:
            left, right, bottom, top = self.bounds
            return rng.uniform(left, right), rng.uniform(bottom, top)
        corners = np.array(area, dtype=float)
        (left, bottom), (right, top) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        while True:  # the edges of an area do not cross, so that it has a part of its bounding box
            point = rng.uniform(left, right), rng.uniform(bottom, top)
            if inside_polygon(np.array([point]), corners)[0]:
                return point

    def contains(self, shape: Shape, pose: Pose) -> bool:
        """Return whether the centre lies in the room and no side of a rectangle crosses a wall; touching is allowed."""
        # the edge of a disc has no length, so that it crosses nothing
        sides = [(*start, *end) for start, end, _ in shape.edges(pose)]
        return self.has_space([outline_row(shape, pose, -math.inf)], sight_lines=sides)

    def has_space(
        self,
        outlines: list[OutlineRow],
        others: Array = _NO_OUTLINES,
        clearance: float = 0.0,
        sight_lines: Sequence[Line] = (),
    ) -> bool:
        """Return whether outlines have space in the room.

        Args:
            outlines: each must lie in the room, and keep its gap to the walls and the clearance to all other outlines.
            others: (O, COLUMNS), rows of the outlines in the room.
            clearance: m.
            sight_lines: straight lines that must not cross a wall, m.
        """
        rows = np.array(outlines) if outlines else _NO_OUTLINES
        lines = np.array(sight_lines, dtype=float).reshape(-1, 4) if sight_lines else _NO_LINES
        return bool(has_space(self.barriers.table, self._borders, rows, others, float(clearance), lines))

    def is_on_floor(self, points: Array) -> BoolArray:
        """Whether points lie in the room, and in none of its holes; (N, 2), m, to (N,) of bool."""
        return inside_rings(points, self.polygon, self.holes)

    def sees(self, start: Point, end: Point) -> bool:
        """Return whether no wall crosses the straight line between two points, m."""
        return self.has_space([], sight_lines=[(*start, *end)])

    def has_space_at(self, x: float, y: float, theta: float, outlines: Array, others: Array, clearance: float) -> bool:
        """Return whether outlines have space at poses that are relative to another pose.

        Args:
            x, y, theta: the other pose, m and rad.
            outlines: (N, COLUMNS), rows of outlines, relative to the pose.
            others, clearance: as for `has_space`.
        """
        walls = self.barriers.table
        return bool(has_space_at(x, y, theta, outlines, walls, self._borders, others, clearance))

    @cached_property
    def _borders(self) -> Array:
        """(K, 4), start and end of the edges of the outline and of the holes, m; outside is an even number of them."""
        count = len(self.polygon) + sum(map(len, self.holes))
        return np.ascontiguousarray(self.barriers.table[:count, :4])

    def mirrored(self) -> FloorPlan:
        """Return the mirror image: y changes sign."""
        # 0.0 - y instead of -y, which would give -0.0; the order of corners is reversed to stay counter-clockwise
        corners = tuple((x, 0.0 - y) for x, y in self.polygon[::-1])
        walls = (Wall((w.start[0], 0.0 - w.start[1]), (w.end[0], 0.0 - w.end[1])) for w in self.inner_walls)
        holes = (tuple((x, 0.0 - y) for x, y in hole[::-1]) for hole in self.holes)
        return FloorPlan(self.kind, corners, tuple(walls), tuple(holes))


_MIN_WALL_BESIDE_DOOR = 0.3  # m, on either side of a doorway

Corners = tuple[Point, ...]
WallEnds = tuple[tuple[Point, Point], ...]


@dataclass(frozen=True, slots=True)
class RoomKind:
    """A kind of room.

    Attributes:
        draw: function of the room settings and the scene's random stream. It returns the corners of the outline in
            order, and the inner walls as pairs of end points; m, centred at the origin. All randomness must come from
            the stream.
        turned: whether a scene may turn the plan by quarter turns (`RoomConfig.turns`).

    Example:
        >>> RoomKind(lambda config, rng: (((-2, -1), (2, -1), (2, 1), (-2, 1)), ())).turned
        True
    """

    draw: Callable[[RoomConfig, RandomStream], tuple[Corners, WallEnds]]
    turned: bool = True


def load_room_kind(name: str) -> RoomKind:
    """Load a room kind by name.

    Raises:
        Sonata2dError: no kind has this name, or the plug-in that provides it cannot be loaded.
    """
    kind: RoomKind = ROOM_KINDS.load(name, _problem)
    return kind


def _problem(value: object) -> str | None:
    """Return why an object cannot be used as a room kind, or None."""
    return None if isinstance(value, RoomKind) else "is not a RoomKind; it must be sonata2d.scenegen.RoomKind(draw)"


def draw_floor_plan(config: RoomConfig, rng: RandomStream) -> FloorPlan:
    """Draw a floor plan of one of the kinds, or return the given polygon; both with the given inner walls."""
    given_walls = tuple(Wall(_turned((x1, y1)), _turned((x2, y2))) for x1, y1, x2, y2 in config.walls)
    if config.polygon is not None:
        holes = tuple(map(_counter_clockwise, config.holes))
        return FloorPlan("given", _counter_clockwise(config.polygon), given_walls, holes)
    name = rng.choice(list(config.kinds), list(config.kinds.values()))
    kind = load_room_kind(name)
    corners, walls = kind.draw(config, rng)
    turns = config.turns.draw(rng) if kind.turned else 0
    inner_walls = tuple(Wall(_turned(a, turns), _turned(b, turns)) for a, b in walls)
    return FloorPlan(name, _counter_clockwise(corners, turns), inner_walls + given_walls)


def _square(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    side = config.side.draw(rng)
    return _rectangle_corners(side, side), ()


def _rectangle(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    breadth = config.breadth.draw(rng)
    return _rectangle_corners(config.length.at_least(breadth).draw(rng), breadth), ()


def _l(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    """An L in a square of three by three units."""
    u = config.unit.draw(rng)
    a, b = 1.5 * u, 0.5 * u
    return ((-a, -b), (b, -b), (b, -a), (a, -a), (a, a), (-a, a)), ()


def _t(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    """A T: the bar on top, the stem from its middle downwards."""
    x, y, arm = config.span.draw(rng) / 2, config.depth.draw(rng) / 2, config.arm.draw(rng)
    low, s = y - arm, arm / 2
    return ((-s, -y), (s, -y), (s, low), (x, low), (x, y), (-x, y), (-x, low), (-s, low)), ()


def _u(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    """A U: the bar at the bottom, an arm upwards from either end."""
    x, y, arm = config.span.draw(rng) / 2, config.depth.draw(rng) / 2, config.arm.draw(rng)
    s, low = x - arm, arm - y
    return ((-x, -y), (x, -y), (x, y), (s, y), (s, low), (-s, low), (-s, y), (-x, y)), ()


def _corridor(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    return _rectangle_corners(config.corridor_length.draw(rng), config.corridor_width.draw(rng)), ()


def _crossing(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    """A corridor along x and one along y that cross at their centres."""
    x, y = config.corridor_length.draw(rng) / 2, config.corridor_length.draw(rng) / 2
    # half widths of the corridor along y and of the corridor along x
    a, b = config.corridor_width.draw(rng) / 2, config.corridor_width.draw(rng) / 2
    right = ((a, -y), (a, -b), (x, -b), (x, b), (a, b), (a, y))
    return right + tuple((-p, q) for p, q in right[::-1]), ()


def _doorway(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    """Two rooms side by side, separated by a wall with a doorway."""
    left, right, breadth = (config.chamber.draw(rng) for _ in range(3))
    half, wall_x = config.door.draw(rng) / 2, (left - right) / 2
    max_offset = max(breadth / 2 - half - _MIN_WALL_BESIDE_DOOR, 0.0)
    door_y = min(max(config.door_offset.draw(rng), -max_offset), max_offset)
    walls = (((wall_x, -breadth / 2), (wall_x, door_y - half)), ((wall_x, door_y + half), (wall_x, breadth / 2)))
    return _rectangle_corners(left + right, breadth), walls


def _hall(config: RoomConfig, rng: RandomStream) -> tuple[Corners, WallEnds]:
    breadth = config.hall.draw(rng)
    return _rectangle_corners(config.hall.at_least(breadth).draw(rng), breadth), ()


SQUARE = RoomKind(_square, turned=False)
RECTANGLE = RoomKind(_rectangle, turned=False)
L = RoomKind(_l)
T = RoomKind(_t)
U = RoomKind(_u)
CORRIDOR = RoomKind(_corridor)
DOORWAY = RoomKind(_doorway)
CROSSING = RoomKind(_crossing)
HALL = RoomKind(_hall, turned=False)


def _rectangle_corners(length: float, breadth: float) -> Corners:
    x, y = length / 2, breadth / 2
    return (-x, -y), (x, -y), (x, y), (-x, y)


def _turned(point: Point, quarters: int = 0) -> Point:
    """Rotate a point about the origin by quarter turns, and round it to the precision of files."""
    x, y = point
    for _ in range(quarters):
        x, y = -y, x
    return quantised(x), quantised(y)


def _counter_clockwise(corners: Corners, quarters: int = 0) -> Corners:
    """Rotate and round corners as `_turned` does, and put them into counter-clockwise order."""
    corners = tuple(_turned(corner, quarters) for corner in corners)
    next_corners = (*corners[1:], corners[0])
    doubled_area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(corners, next_corners, strict=True))
    return corners if doubled_area > 0.0 else corners[::-1]
