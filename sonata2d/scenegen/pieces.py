"""Pieces of furniture: given ones at their positions, and drawn ones before they are placed."""

from __future__ import annotations

from dataclasses import replace

from ..core.entities import Furniture
from ..core.geometry import Disc, Pose, Rectangle, Shape, quantised
from ..core.outlines import shape_gap
from ..registry import furniture_type
from .scenario.config import ScenarioConfig
from .scenario.sections import FurnitureConfig, Size


def shape_of_size(size: Size) -> Shape:
    """Create the outline of a `Size`: a disc for one number, a rectangle for two."""
    return Rectangle(quantised(size[0]), quantised(size[1])) if isinstance(size, tuple) else Disc(quantised(size))


def create_piece(
    config: ScenarioConfig, name: str, shape: Shape | None = None, seat: bool | None = None, on: int | None = None
) -> Furniture:
    """Create a piece of furniture at the origin, with the id 0.

    Args:
        config: sizes of types.
        name: of its type.
        shape, seat: of the piece; None: as the type has them.
        on: what it lies on.
    """
    if shape is None:
        size = config.size_of(name)
        assert size is not None  # a scenario is checked for sizes
        shape = shape_of_size(size)
    if seat is None and furniture_type(name).is_seat:
        seat = True  # a file is read without the type
    return Furniture(0, name, Pose(0.0, 0.0), shape, on, seat)


def _given_shape(settings: FurnitureConfig) -> Shape | None:
    """Return the outline that the settings of a piece give; None: that of its type."""
    if settings.body is not None:
        return settings.body.outline()
    return None if settings.size is None else shape_of_size(settings.size)


def fixed_furniture(config: ScenarioConfig) -> tuple[Furniture, ...]:
    """Create the furniture at fixed positions, numbered from 0; a laptop that overlaps a table lies on it."""
    pieces = [
        replace(
            create_piece(config, p.type, _given_shape(p), p.seat),
            id=k,
            pose=Pose(p.x, p.y, p.theta).rounded(),
            attributes=p.attributes,
        )
        for k, p in enumerate(config.furniture)
    ]
    return tuple(replace(piece, on=_support(piece, pieces)) for piece in pieces)


def faces_ahead(config: ScenarioConfig, settings: FurnitureConfig) -> bool:
    """Return whether the front of a given piece is its +x side, as of a seat that is not longer than wide."""
    piece = create_piece(config, settings.type, _given_shape(settings), settings.seat)
    return piece.is_seat and piece.front == piece.pose.direction


def _support(piece: Furniture, pieces: list[Furniture]) -> int | None:
    """Return the id of the piece that a piece lies on; None if it stands on the floor."""
    support = furniture_type(piece.type).on
    return next((other.id for other in pieces if other.type == support and _overlap(piece, other)), None)


def _overlap(piece: Furniture, other: Furniture) -> bool:
    dx, dy = piece.pose.x - other.pose.x, piece.pose.y - other.pose.y
    is_near = dx * dx + dy * dy < other.shape.circumradius * other.shape.circumradius
    return is_near and shape_gap(piece.shape, piece.pose, other.shape, other.pose) == 0.0
