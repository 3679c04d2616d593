"""A room kind: a regular hexagon."""

from __future__ import annotations

from sonata2d.core.rng import RandomStream
from sonata2d.scenegen import RoomKind
from sonata2d.scenegen.scenario.rooms import RoomConfig

Corners = tuple[tuple[float, float], ...]


def hexagon(config: RoomConfig, rng: RandomStream) -> tuple[Corners, tuple[()]]:
    """A hexagon whose sides are half as long as the side of a square room; no inner walls."""
    side = config.side.draw(rng) / 2
    height = side * 0.8660254037844386
    right = ((side, 0.0), (side / 2, height), (-side / 2, height))
    return right + tuple((-x, -y) for x, y in right), ()


HEXAGON = RoomKind(hexagon)
