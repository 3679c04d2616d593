"""The section `room` of a scenario: kinds and sizes of floor plans."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...core.files.limits import MAX_COUNT
from ...core.geometry import Barriers, Point, segments_cross
from ...registry import ROOM_KINDS
from .base import (
    Coordinate,
    Entities,
    IntRange,
    Range,
    Settings,
    TupleOf,
    Weights,
    bounded,
    require_registered,
    require_weight,
)

MIN_DOOR_WIDTH = 0.7  # m: diameter of the default robot, with its path margin on both sides
RoomKindName = Annotated[str, AfterValidator(partial(require_registered, ROOM_KINDS))]
RoomWeights = Annotated[Weights[RoomKindName], AfterValidator(partial(require_weight, item="kind of room"))]
_Size = Annotated[Range, bounded("a room's size must be above 0", above=0.0)]
_DoorWidth = Annotated[Range, bounded(f"a door must be {MIN_DOOR_WIDTH} m wide or more", low=MIN_DOOR_WIDTH)]
WallEnds = tuple[Coordinate, Coordinate, Coordinate, Coordinate]  # x1, y1, x2, y2, m


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
        walls: inner walls, as x1, y1, x2, y2, m.
    """

    kinds: RoomWeights = Field(default={"square": 1.0, "rectangle": 1.0, "l": 1.0})
    side: _Size = Range(6, 10, 1)
    breadth: _Size = Range(5, 10, 1)
    length: _Size = Range(5, 10, 1)
    unit: _Size = Range(3, 4, 1)
    span: _Size = Range(8.0, 12.0)
    depth: _Size = Range(7.0, 10.0)
    arm: _Size = Range(2.5, 3.5)
    corridor_length: _Size = Range(10.0, 16.0)
    corridor_width: _Size = Range(2.0, 3.0)
    chamber: _Size = Range(4.0, 7.0)
    door: _DoorWidth = Range(0.9, 1.2)
    door_offset: Range = Range(-1.0, 1.0)
    hall: _Size = Range(12.0, 18.0)
    turns: IntRange = IntRange(0, 3)
    polygon: Annotated[TupleOf[tuple[Coordinate, Coordinate]], Field(min_length=3, max_length=MAX_COUNT)] | None = None
    walls: Entities[WallEnds] = ()

    @field_validator("polygon", mode="after")
    @classmethod
    def _check_polygon(cls, corners: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        if corners is not None and not _is_simple_polygon(corners):
            raise PydanticCustomError("polygon", "the room's edges cross or touch each other")
        return corners

    @field_validator("walls", mode="after")
    @classmethod
    def _check_walls(cls, walls: tuple[WallEnds, ...]) -> tuple[WallEnds, ...]:
        for wall in walls:
            if wall[:2] == wall[2:]:
                raise PydanticCustomError("wall", "wall {wall} has no length", {"wall": list(wall)})
        return walls

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
                context = {"value": f"{value:g}", "name": limit_name, "limit": f"{limit:g}", "path": (key,)}
                raise PydanticCustomError("room", "{value} m must be less than {name}, which may be {limit} m", context)
        return self


def _is_simple_polygon(corners: tuple[Point, ...]) -> bool:
    """Return whether edges meet at their common corners only."""
    next_corners = [*corners[1:], corners[0]]
    edges = Barriers.of((a, b, 0.0) for a, b in zip(corners, next_corners, strict=True))
    gaps = edges.gaps(edges.start)  # (K, K), m, edges in rows, corners in columns
    is_start = np.eye(len(corners), dtype=bool)
    gaps[is_start | np.roll(is_start, 1, axis=1)] = np.inf  # a corner lies on the two edges that it joins
    return not (segments_cross(edges.start, edges.end, edges).any() or (gaps < 1e-3).any())
