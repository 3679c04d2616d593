"""The section `room` of a scenario: which floor plans, and how large."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, Field, NonNegativeFloat, field_validator, model_validator
from pydantic_core import PydanticCustomError

from ...core.geometry import Barriers, Point, segments_cross
from ...registry import ROOM_KINDS
from .ranges import IntRange, Range, Settings, registered, weighed

NARROWEST = 0.7  # m, of a doorway: a robot of the usual size, with what its ways keep off walls
RoomKindName = Annotated[str, AfterValidator(partial(registered, ROOM_KINDS))]
WallEnds = tuple[float, float, float, float]  # x1, y1, x2, y2, m


class RoomConfig(Settings):
    """The floor plan: one of nine kinds, drawn by weight and centred at the origin, or a given polygon.

    A square, a rectangle, an L, a T or a U; a corridor; two rooms side by side, joined by a doorway; two corridors that
    cross; an open hall. Sizes are drawn for each scene.

    Attributes:
        kinds: weight of each kind; a list of names, or one name, weighs them alike.
        side: of the square.
        breadth, length: of the rectangle, along y and x; the length is at least the breadth.
        unit: of the L: a rectangle of 3 x 2 units with a square of 1 x 1 below one end.
        span, depth, arm: of the T and the U: the length of the bar, how far the stem or the two arms reach, the bar
            included, and how wide bar, stem and arms are.
        corridor_length, corridor_width: of the corridor, and of each of the two that cross.
        chamber: the sides of the two rooms that a doorway joins; each has a length of its own.
        door: width of the doorway, 0.7 m or more; `door_offset`: of its middle from the middle of the wall.
        hall: both sides of the hall.
        turns: quarters of a circle by which a plan other than square, rectangle and hall is turned.
        polygon: corners of a given room, in order, without edges that cross; takes the place of the kinds.
        walls: inner walls, as x1, y1, x2, y2.
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
    polygon: Annotated[tuple[Point, ...], Field(min_length=3)] | None = None
    walls: tuple[WallEnds, ...] = ()

    @field_validator("kinds", mode="before")
    @classmethod
    def _weigh_alike(cls, given: Any) -> Any:
        return weighed(given)

    @field_validator("kinds", mode="after")
    @classmethod
    def _leave_some(cls, kinds: dict[str, float]) -> dict[str, float]:
        if not sum(kinds.values()) > 0.0:
            raise PydanticCustomError("kinds", "at least one kind of room needs a weight above 0")
        return kinds

    @field_validator(
        *("side", "breadth", "length", "unit", "span", "depth", "arm"),
        *("corridor_length", "corridor_width", "chamber", "door", "hall"),
        mode="after",
    )
    @classmethod
    def _be_positive(cls, size: Range) -> Range:
        if not size.min > 0.0:
            raise PydanticCustomError("size", "a room's size must be above 0")
        return size

    @field_validator("door", mode="after")
    @classmethod
    def _be_passable(cls, door: Range) -> Range:
        if not door.min >= NARROWEST:
            raise PydanticCustomError("door", "a door must be {least} m wide or more", {"least": NARROWEST})
        return door

    @field_validator("polygon", mode="after")
    @classmethod
    def _be_simple(cls, corners: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        if corners is not None and not _is_simple(corners):
            raise PydanticCustomError("polygon", "the room's edges cross or touch each other")
        return corners

    @field_validator("walls", mode="after")
    @classmethod
    def _have_length(cls, walls: tuple[WallEnds, ...]) -> tuple[WallEnds, ...]:
        for wall in walls:
            if wall[:2] == wall[2:]:
                raise PydanticCustomError("wall", "wall {wall} has no length", {"wall": list(wall)})
        return walls

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        """Whatever is drawn, arms leave a gap between them, and a doorway fits into its wall."""
        for key, most, whole in (
            ("arm", self.span.min / 2, "half the span"),
            ("arm", self.depth.min, "the depth"),
            ("corridor_width", self.corridor_length.min, "the corridor's length"),
            ("door", self.chamber.min, "a chamber's side"),
        ):
            widest = getattr(self, key).max
            if not widest < most:
                said = {"widest": f"{widest:g}", "whole": whole, "most": f"{most:g}", "path": (key,)}
                raise PydanticCustomError("room", "{widest} m is not less than {whole}, {most} m at least", said)
        return self


def _is_simple(corners: tuple[Point, ...]) -> bool:
    """Whether edges meet at their common corners only."""
    following = [*corners[1:], corners[0]]
    edges = Barriers.of((a, b, 0.0) for a, b in zip(corners, following, strict=True))
    gaps = edges.gaps(edges.start)  # of each edge from each corner
    own = np.eye(len(corners), dtype=bool)
    gaps[own | np.roll(own, 1, axis=1)] = np.inf
    return not (segments_cross(edges.start, edges.end, edges).any() or (gaps < 1e-3).any())
