"""The kinds of room, each from its settings and chance, centred at the origin."""

from __future__ import annotations

from collections.abc import Callable

from ..chance import Chance
from ..entities import Wall
from ..geometry import Point, quantised
from .room_config import RoomConfig, RoomKind
from .rooms import FloorPlan

_BESIDE = 0.3  # m, of wall that stays on either side of a doorway

Corners = tuple[Point, ...]
Walls = tuple[tuple[Point, Point], ...]


def draw_plan(config: RoomConfig, chance: Chance) -> FloorPlan:
    """One of the kinds of room, or the given one."""
    given = tuple(Wall(_rounded((x1, y1)), _rounded((x2, y2))) for x1, y1, x2, y2 in config.walls)
    if config.polygon is not None:
        return FloorPlan("given", _counter_clockwise(config.polygon), given)
    kind = chance.choice(list(config.kinds), list(config.kinds.values()))
    corners, walls = _KINDS[kind](config, chance)
    quarters = 0 if kind in _UNTURNED else config.turns.draw(chance)
    inner = tuple(Wall(_rounded(_turned(a, quarters)), _rounded(_turned(b, quarters))) for a, b in walls)
    return FloorPlan(kind, _counter_clockwise(tuple(_turned(corner, quarters) for corner in corners)), inner + given)


def _square(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    side = config.side.draw(chance)
    return _oblong(side, side), ()


def _rectangle(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    breadth = config.breadth.draw(chance)
    return _oblong(config.length.at_least(breadth).draw(chance), breadth), ()


def _l(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    """An L in a square of three units."""
    u = config.unit.draw(chance)
    a, b = 1.5 * u, 0.5 * u
    return ((-a, -b), (b, -b), (b, -a), (a, -a), (a, a), (-a, a)), ()


def _t(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    """A T: the bar on top, the stem from its middle down."""
    x, y, arm = config.span.draw(chance) / 2, config.depth.draw(chance) / 2, config.arm.draw(chance)
    low, s = y - arm, arm / 2
    return ((-s, -y), (s, -y), (s, low), (x, low), (x, y), (-x, y), (-x, low), (-s, low)), ()


def _u(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    """A U: the bar below, an arm up from either end."""
    x, y, arm = config.span.draw(chance) / 2, config.depth.draw(chance) / 2, config.arm.draw(chance)
    s, low = x - arm, arm - y
    return ((-x, -y), (x, -y), (x, y), (s, y), (s, low), (-s, low), (-s, y), (-x, y)), ()


def _corridor(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    return _oblong(config.corridor_length.draw(chance), config.corridor_width.draw(chance)), ()


def _crossing(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    """A corridor along x and one along y, which cross in their middles."""
    x, y = config.corridor_length.draw(chance) / 2, config.corridor_length.draw(chance) / 2
    a, b = config.corridor_width.draw(chance) / 2, config.corridor_width.draw(chance) / 2  # of y's, of x's
    right = ((a, -y), (a, -b), (x, -b), (x, b), (a, b), (a, y))
    return right + tuple((-p, q) for p, q in right[::-1]), ()


def _doorway(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    """Two rooms side by side, and a wall between them with a doorway."""
    left, right, breadth = (config.chamber.draw(chance) for _ in range(3))
    half, wall = config.door.draw(chance) / 2, (left - right) / 2
    most = max(breadth / 2 - half - _BESIDE, 0.0)
    middle = min(max(config.door_offset.draw(chance), -most), most)
    inner = (((wall, -breadth / 2), (wall, middle - half)), ((wall, middle + half), (wall, breadth / 2)))
    return _oblong(left + right, breadth), inner


def _hall(config: RoomConfig, chance: Chance) -> tuple[Corners, Walls]:
    breadth = config.hall.draw(chance)
    return _oblong(config.hall.at_least(breadth).draw(chance), breadth), ()


_UNTURNED = ("square", "rectangle", "hall")
_KINDS: dict[RoomKind, Callable[[RoomConfig, Chance], tuple[Corners, Walls]]] = {
    "square": _square,
    "rectangle": _rectangle,
    "l": _l,
    "t": _t,
    "u": _u,
    "corridor": _corridor,
    "doorway": _doorway,
    "crossing": _crossing,
    "hall": _hall,
}


def _oblong(length: float, breadth: float) -> Corners:
    x, y = length / 2, breadth / 2
    return (-x, -y), (x, -y), (x, y), (-x, y)


def _turned(point: Point, quarters: int) -> Point:
    """Turned about the origin by quarters of a circle."""
    x, y = point
    for _ in range(quarters):
        x, y = -y, x
    return x, y


def _counter_clockwise(corners: Corners) -> Corners:
    """The corners at a file's precision, counter-clockwise."""
    following = (*corners[1:], corners[0])
    doubled_area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(corners, following, strict=True))
    return tuple(_rounded(corner) for corner in (corners if doubled_area > 0.0 else corners[::-1]))


def _rounded(point: Point) -> Point:
    return quantised(point[0]), quantised(point[1])
