"""Straight walls drawn in several pieces: collinear walls that touch or overlap are one wall."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .entities import Wall
from .portable_math import Array, BoolArray, IntArray
from .vectors import X, Y, length, lengths

_TOLERANCE = 1e-3  # m, by which ends of the pieces may be off their straight line, and apart
_PAIRS_OF_BLOCK = 200_000  # compared at once, which bounds memory


def wall_lines(walls: Sequence[Wall]) -> tuple[int, ...]:
    """For each wall, the smallest index of a wall that is part of the same straight wall.

    All ends of the pieces of a straight wall lie within 1 mm of one line, whatever their order and direction: files
    round positions. The pieces of a curve do not, so that it is divided into pieces that are straight to 1 mm.
    """
    ends = np.array([(wall.start, wall.end) for wall in walls], dtype=float).reshape(-1, 2, 2)
    line = np.arange(len(walls))
    pieces = [np.array([k]) for k in range(len(walls))]  # of each line: indices of its walls
    for pairs in _collinear_pairs(ends, line):
        for i, j in pairs.tolist():
            if line[i] == line[j]:
                continue
            both = np.concatenate((pieces[line[i]], pieces[line[j]]))
            if _is_straight(ends[both].reshape(1, -1, 2))[0]:
                first = min(line[i], line[j])
                line[both] = first
                pieces[first] = both
    return tuple(line.tolist())


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


def _collinear_pairs(ends: Array, line: IntArray) -> Iterator[IntArray]:
    """Pairs of collinear walls (W, 2, 2), m, without a gap between them: rows of two indices, ascending, in blocks.

    Pairs that are on one line (W,) already, when their block begins, are left out.
    """
    low, high = ends.min(axis=1), ends.max(axis=1) + _TOLERANCE
    along, middle = ends[:, 1] - ends[:, 0], (ends[:, 0] + ends[:, 1]) / 2.0
    rows = max(1, _PAIRS_OF_BLOCK // max(1, len(ends)))
    for begin in range(0, len(ends), rows):
        block = slice(begin, begin + rows)
        meets = np.ones((len(low[block]), len(ends) - begin), dtype=bool)
        for axis in (X, Y):
            meets &= low[block, None, axis] <= high[None, begin:, axis]
            meets &= low[None, begin:, axis] <= high[block, None, axis]
        i, j = begin + np.stack(np.nonzero(np.triu(meets, 1)))
        i, j = i[line[i] != line[j]], j[line[i] != line[j]]
        near = _is_within(along[i], along[j]) & _is_within(along[i], middle[j] - middle[i])  # drops nearly all, cheaply
        if not near.any():
            continue
        pairs = np.stack((i[near], j[near]), axis=1)
        yield pairs[_is_straight(ends[pairs].reshape(-1, 4, 2))]


def _is_within(along: Array, offset: Array) -> BoolArray:
    """Whether walls (K, 2) and offsets (K, 2) from their middles, m, may lie within the tolerance of one line; (K,)."""
    cross = np.abs(along[:, X] * offset[:, Y] - along[:, Y] * offset[:, X])
    return np.asarray(cross <= 3.0 * _TOLERANCE * (lengths(along) + lengths(offset)))


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
