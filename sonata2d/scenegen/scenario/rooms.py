"""The section `room` of a scenario: kinds and sizes of floor plans."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...core.files.limits import MAX_COUNT
from ...core.geometry import Barriers, Point, segments_cross
from ...registry import ROOM_KINDS
from .base import Coordinate, Entities, IntRange, Range, Settings, TupleOf, parse_weights, require_registered

MIN_DOOR_WIDTH = 0.7  # m: diameter of the default robot, with its path margin on both sides
RoomKindName = Annotated[str, AfterValidator(partial(require_registered, ROOM_KINDS))]
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

    kinds: dict[RoomKindName, NonNegativeFloat] = Field(default={"square": 1.0, "rectangle": 1.0, "l": 1.0})
    side: Range = Range(6, 10, 1)
    breadth: Range = Range(5, 10, 1)
    length: Range = Range(5, 10, 1)
    unit: Range = Range(3, 4, 1)
    span: Range = Range(8.0, 12.0)
    depth: Range = Range(7.0, 10.0)
    arm: Range = Range(2.5, 3.5)
    corridor_length: Range = Range(10.0, 16.0)
    corridor_width: Range = Range(2.0, 3.0)
    chamber: Range = Range(4.0, 7.0)
    door: Range = Range(0.9, 1.2)
    door_offset: Range = Range(-1.0, 1.0)
    hall: Range = Range(12.0, 18.0)
    turns: IntRange = IntRange(0, 3)
    polygon: Annotated[TupleOf[tuple[Coordinate, Coordinate]], Field(min_length=3, max_length=MAX_COUNT)] | None = None
    walls: Entities[WallEnds] = ()

    @field_validator("kinds", mode="before")
    @classmethod
    def _parse_weights(cls, value: Any) -> Any:
        return parse_weights(value)

    @field_validator("kinds", mode="after")
    @classmethod
    def _require_weight(cls, kinds: dict[str, float]) -> dict[str, float]:
        if not sum(kinds.values()) > 0.0:
            raise PydanticCustomError("kinds", "at least one kind of room needs a weight above 0")
        return kinds

    @field_validator(
        *("side", "breadth", "length", "unit", "span", "depth", "arm"),
        *("corridor_length", "corridor_width", "chamber", "door", "hall"),
        mode="after",
    )
    @classmethod
    def _require_positive(cls, size: Range) -> Range:
        if not size.min > 0.0:
            raise PydanticCustomError("size", "a room's size must be above 0")
        return size

    @field_validator("door", mode="after")
    @classmethod
    def _check_door(cls, door: Range) -> Range:
        if not door.min >= MIN_DOOR_WIDTH:
            raise PydanticCustomError("door", "a door must be {minimum} m wide or more", {"minimum": MIN_DOOR_WIDTH})
        return door

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
