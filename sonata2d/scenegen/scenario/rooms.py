"""The section `room` of a scenario: kinds and sizes of floor plans."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from ...core.bounds import NotNegative, Number
from ...core.files.limits import MAX_COUNT
from ...core.geometry import Barriers, Point, inside_polygon, segments_cross
from ...core.portable_math import Array
from ...registry import ROOM_KINDS
from .base import Entities, IntRange, Range, Settings, TupleOf, require_registered, weights_of, within
from .problems import setting_error

_TOUCHING = 1e-3  # m, gap of edges that touch
_MIN_DOOR_WIDTH = 0.7  # m: diameter of the default robot, with its path margin on both sides
_RoomKindName = Annotated[str, AfterValidator(partial(require_registered, ROOM_KINDS))]
_RoomSize = Annotated[Range, within("a room's size must be above 0", 0.0, above=True)]
_DoorWidth = Annotated[Range, within(f"a door must be {_MIN_DOOR_WIDTH} m wide or more", _MIN_DOOR_WIDTH)]


def _check_wall(wall: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if wall[:2] == wall[2:]:
        raise setting_error(f"wall {list(wall)} has no length")
    return wall


def _check_polygon(corners: tuple[Point, ...]) -> tuple[Point, ...]:
    if not _is_simple_polygon(corners):
        raise setting_error("edges of the polygon cross or touch each other, or it is too thin")
    return corners


WallEnds = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_check_wall)]  # x1, y1, x2, y2, m
Polygon = Annotated[TupleOf[Point], Field(min_length=3, max_length=MAX_COUNT), AfterValidator(_check_polygon)]


class RoomConfig(Settings):
    """The floor plan: one of nine kinds, drawn by weight and centred at the origin, or a given polygon.

    The kinds are `square`, `rectangle`, `l`, `t`, `u`, `corridor`, `doorway` (two rooms side by side, connected by a
    doorway), `crossing` (two corridors that cross) and `hall` (a large open rectangle). Sizes are drawn for each scene.

    Attributes:
        kinds: weight of each kind; a name or a list of names gives equal weights.
        side: of the square, m.
        breadth, length: of the rectangle along y and x, m; the length is at least the breadth.
        unit: m, of the L: a rectangle of 3 x 2 units with a square of 1 x 1 units below one end.
        span, depth, arm: m, of the T and the U: length of the bar; total depth, bar included; width of the bar, the
            stem and the arms.
        corridor_length, corridor_width: m, of the corridor, and of each of the two crossing corridors.
        chamber: m, sides of the two rooms that a doorway connects; the length of each room is drawn separately.
        door: width of the doorway, 0.7 m or more; `door_offset`: of its centre from the centre of the wall, m.
        hall: both sides of the hall, m.
        turns: number of quarter turns of a plan other than square, rectangle and hall.
        polygon: corners of a given room in order, m; edges must not cross. Replaces `kinds`.
        walls: inner walls, as x1, y1, x2, y2, m; a closed loop counts as a solid object, without paths inside.
        holes: parts without floor, such as pillars, thick walls and courtyards, each as corners in order, m; edges
            must not cross.
    """

    _optional = frozenset({"holes"})

    kinds: Annotated[dict[_RoomKindName, NotNegative], *weights_of("kind of room")] = Field(
        default={"square": 1.0, "rectangle": 1.0, "l": 1.0}
    )
    side: _RoomSize = Range(6, 10, 1)
    breadth: _RoomSize = Range(5, 10, 1)
    length: _RoomSize = Range(5, 10, 1)
    unit: _RoomSize = Range(3, 4, 1)
    span: _RoomSize = Range(8.0, 12.0)
    depth: _RoomSize = Range(7.0, 10.0)
    arm: _RoomSize = Range(2.5, 3.5)
    corridor_length: _RoomSize = Range(10.0, 16.0)
    corridor_width: _RoomSize = Range(2.0, 3.0)
    chamber: _RoomSize = Range(4.0, 7.0)
    door: _DoorWidth = Range(0.9, 1.2)
    door_offset: Range = Range(-1.0, 1.0)
    hall: _RoomSize = Range(12.0, 18.0)
    turns: IntRange = IntRange(0, 3)
    polygon: Polygon | None = None
    walls: Entities[WallEnds] = ()
    holes: Entities[Polygon] = ()

    @model_validator(mode="after")
    def _check_holes(self) -> Self:
        """Check that holes lie in the polygon, apart from it and from each other."""
        if not self.holes:
            return self
        if self.polygon is None:
            raise setting_error("holes need a given room (polygon)", "holes")
        rings = [np.array(ring, dtype=float) for ring in (self.polygon, *self.holes)]
        first = np.array([ring[0] for ring in rings[1:]])
        inside = np.array([inside_polygon(first, ring) for ring in rings])  # (rings, holes)
        for k in range(len(self.holes)):
            if not _are_apart(_edges(rings[k + 1]), _edges(*rings[: k + 1])):
                raise setting_error("the hole crosses or touches the outline or another hole", "holes", k)
            if not inside[0, k]:
                raise setting_error("the hole is outside the room", "holes", k)
            if inside[1 : k + 1, k].any() or inside[k + 1, :k].any():
                raise setting_error("a hole lies in another one", "holes", k)
        return self

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        """Check that for all sizes in the ranges, arms leave a gap between them and a doorway fits into its wall."""
        for key, limit, limit_name in (
            ("arm", self.span.min / 2, "half the span"),
            ("arm", self.depth.min, "the depth"),
            ("corridor_width", self.corridor_length.min, "the corridor's length"),
            ("door", self.chamber.min, "a chamber's side"),
        ):
            value = getattr(self, key).max
            if not value < limit:
                raise setting_error(f"{value:g} m must be less than {limit_name}, which may be {limit:g} m", key)
        length, breadth = self.length.max, self.breadth.min
        if self.kinds.get("rectangle") and self.polygon is None and length < breadth:
            message = f"no length up to {length:g} m is at least the breadth, {breadth:g} m; exchange them"
            raise setting_error(message, "length")
        return self


def _edges(*rings: Array) -> Barriers:
    """The edges of closed rings, (K, 2) each, m, as segments of radius 0."""
    start = np.concatenate(rings)
    return Barriers(start, np.concatenate([np.roll(ring, -1, axis=0) for ring in rings]), np.zeros(len(start)))


def _are_apart(edges: Barriers, others: Barriers) -> bool:
    """Return whether the edges of rings neither cross nor touch."""
    if segments_cross(edges.start, edges.end, others).any():
        return False
    return min(float(edges.gaps(others.start).min()), float(others.gaps(edges.start).min())) > _TOUCHING


def _is_simple_polygon(corners: tuple[Point, ...]) -> bool:
    """Return whether edges meet at their common corners only."""
    edges = _edges(np.array(corners, dtype=float))
    gaps = edges.gaps(edges.start)  # (K, K), m, edges in rows, corners in columns
    is_start = np.eye(len(corners), dtype=bool)
    gaps[is_start | np.roll(is_start, 1, axis=1)] = np.inf  # a corner lies on the two edges that it joins
    return not (segments_cross(edges.start, edges.end, edges).any() or (gaps < _TOUCHING).any())
