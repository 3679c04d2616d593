"""Straight walls drawn in several pieces: collinear walls that touch or overlap are one wall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .entities import Wall
from .portable_math import Array, BoolArray, IntArray
from .vectors import X, Y, length, lengths

_TOLERANCE = 1e-3  # m, by which ends of the pieces may be off their straight line, and apart


def wall_lines(walls: Sequence[Wall]) -> tuple[int, ...]:
    """For each wall, the smallest index of a wall that is part of the same straight wall.

    All ends of the pieces of a straight wall lie within 1 mm of one line, whatever their order and direction: files
    round positions. The pieces of a curve do not, so that it is divided into pieces that are straight to 1 mm.
    """
    ends = np.array([(wall.start, wall.end) for wall in walls], dtype=float).reshape(-1, 2, 2)
    members = [[k] for k in range(len(walls))]  # indices of the pieces of the straight wall of each wall, shared
    for i, j in _joined_pairs(ends).tolist():
        if members[i] is members[j]:
            continue
        both = members[i] + members[j]
        if _is_straight(ends[both].reshape(1, -1, 2))[0]:
            for k in both:
                members[k] = both
    return tuple(map(min, members))


def straight_walls(walls: Sequence[Wall], lines: Sequence[int]) -> dict[int, Wall]:
    """The whole straight walls by their number in `wall_lines`, in its order, each in the direction of that piece."""
    pieces: dict[int, list[Wall]] = {}
    for wall, line in zip(walls, lines, strict=True):
        pieces.setdefault(line, []).append(wall)
    return {line: parts[0] if len(parts) == 1 else _joined(parts) for line, parts in sorted(pieces.items())}


def _joined(pieces: Sequence[Wall]) -> Wall:
    """The straight wall of several pieces, in the direction of the first one."""
    ends = [end for wall in pieces for end in (wall.start, wall.end)]
    (x, y), (end_x, end_y) = ends[:2]
    far = max(ends, key=lambda end: length(end[0] - x, end[1] - y))
    other = max(ends, key=lambda end: length(end[0] - far[0], end[1] - far[1]))
    is_ahead = (far[0] - other[0]) * (end_x - x) + (far[1] - other[1]) * (end_y - y) > 0.0
    return Wall(other, far) if is_ahead else Wall(far, other)


def _joined_pairs(ends: Array) -> IntArray:
    """Pairs of collinear walls (W, 2, 2), m, without a gap between them: rows of two indices, ascending."""
    low, high = ends.min(axis=1), ends.max(axis=1) + _TOLERANCE
    order = np.argsort(low[:, X], kind="stable")
    # of the walls in the order of their left ends, those that begin before wall k ends
    following = np.searchsorted(low[order, X], high[order, X], side="right") - np.arange(len(order)) - 1
    first = np.repeat(np.arange(len(order)), following)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.add.accumulate(following) - following, following)
    pairs = np.sort(np.stack((order[first], order[second]), axis=1), axis=1)
    i, j = pairs.T
    pairs = pairs[(low[i, Y] <= high[j, Y]) & (low[j, Y] <= high[i, Y])]
    pairs = pairs[_is_straight(ends[pairs].reshape(-1, 4, 2))]
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])])


def _is_straight(points: Array) -> BoolArray:
    """Whether all n points of each row lie on the line through two of them that are far apart; (K, n, 2) to (K,)."""
    rows = np.arange(len(points))
    a = points[rows, _farthest(points, points[:, 0])]
    b = points[rows, _farthest(points, a)]
    along, offset = b - a, points - a[:, None]
    aside = np.abs(along[:, None, X] * offset[..., Y] - along[:, None, Y] * offset[..., X]).max(axis=1)
    return np.asarray(aside <= _TOLERANCE * lengths(along))


def _farthest(points: Array, origin: Array) -> Array:
    """Index of the point of each row (K, n, 2) that is farthest from the row's origin (K, 2); (K,)."""
    offset = points - origin[:, None]
    farthest: Array = (offset * offset).sum(axis=2).argmax(axis=1)
    return farthest
