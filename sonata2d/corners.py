"""Places just off the corners of inflated barriers: where the shortest ways turn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .exact import PI, Array, headings
from .geometry import Barriers

_HEXAGON = headings(np.arange(6) * PI / 3) * 1.1547005383792517  # its edges touch the unit circle
_DODECAGON = headings(np.arange(12) * PI / 6) * 1.0352761804100832
_SQUARE = ((1.0, 1.0), (1.0, -1.0))
_CUT = 0.41421356237309503  # tan 22.5°
_OCTAGON = ((1.0, _CUT), (1.0, -_CUT), (_CUT, 1.0), (_CUT, -1.0))
_SHARP = 0.5  # a corner of less than 60° is treated as two loose ends: its mitre would stick out far
_STRAIGHT = 1e-6  # cosine of half the angle between barriers that go straight on


def surroundings(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], ...]:
    """Polygons round discs, corners and loose ends of barriers inflated by `offset`, m.

    Returns:
        For each kind wide polygons (C, k, 2) and, for where these have no room, closer ones (C, l, 2).
    """
    return (_discs(barriers, offset), *_corners(barriers, offset))


def lengths(vectors: Array) -> Array:
    """Lengths of vectors; (..., 2) to (...)."""
    x, y = vectors[..., 0], vectors[..., 1]
    sizes: Array = np.sqrt(x * x + y * y)
    return sizes


def _discs(barriers: Barriers, offset: float) -> tuple[Array, Array]:
    """Hexagons (D, 6, 2) round the discs among barriers inflated by `offset`, and closer polygons (D, 12, 2)."""
    is_disc = (barriers.start == barriers.end).all(axis=1)
    centre, reach = barriers.start[is_disc][:, None, :], (barriers.radius[is_disc] + offset)[:, None, None]
    return centre + reach * _HEXAGON, centre + reach * _DODECAGON


def _corners(barriers: Barriers, offset: float) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Mitres (C, 1, 2) where two barriers meet, squares (E, 2, 2) round other ends; each also with its corners cut."""
    along = barriers.end - barriers.start
    length = lengths(along)
    long = length > 0.0
    unit = along[long] / length[long, None]
    ends = np.concatenate((barriers.start[long], barriers.end[long]))
    outward = np.concatenate((-unit, unit))
    reach = (np.tile(barriers.radius[long], 2) + offset)[:, None]

    meets = (ends[:, None, :] == ends[None, :, :]).all(axis=2) & ~np.eye(len(ends), dtype=bool)
    partner = meets.argmax(axis=1) if len(ends) else np.zeros(0, dtype=int)
    both = outward + outward[partner]
    cosine = lengths(both) / 2  # of half the angle between the two barriers
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    joined = (meets.sum(axis=1) == 1) & (sine >= _SHARP)
    first = joined & (np.arange(len(ends)) < partner) & (cosine > _STRAIGHT)  # 0: a wall that goes straight on
    bisector = both[first] / (2 * cosine[first, None])
    mitre = _offsets(ends[first], bisector, reach[first], [(1 / sine[first], 0.0)])
    cut = (1.0 - sine[first]) / cosine[first]
    bevel = _offsets(ends[first], bisector, reach[first], [(1.0, cut), (1.0, -cut)])
    loose = (ends[~joined], outward[~joined], reach[~joined])
    return (mitre, bevel), (_offsets(*loose, _SQUARE), _offsets(*loose, _OCTAGON))


def _offsets(origin: Array, ahead: Array, reach: Array, steps: Sequence[tuple[Any, Any]]) -> Array:
    """Places (E, len(steps), 2) at (ahead, left) steps, in units of the reach (E, 1), from origins (E, 2)."""
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
    columns = [origin + reach * (ahead * np.reshape(a, (-1, 1)) + left * np.reshape(b, (-1, 1))) for a, b in steps]
    return np.stack(columns, axis=1)
