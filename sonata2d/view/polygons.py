"""Outlines of polygons and lines, in pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from ..core.geometry import Point

_MIN_BEND = 0.3  # limits how far a sharp corner is moved


def widened(points: Sequence[Point], distance: float) -> list[Point]:
    """Move the edges of a polygon outward (inward if negative) by a distance in pixels; sharp corners are cut off.

    >>> widened([(0, 0), (4, 0), (4, 4), (0, 4)], 1.0)
    [(-1.0, -1.0), (5.0, -1.0), (5.0, 5.0), (-1.0, 5.0)]
    """
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise([*points, points[0]]))
    side = distance if area > 0.0 else -distance
    moved = []
    for k, (x, y) in enumerate(points):
        nx, ny = _normal_sum(points[k - 1], (x, y), points[(k + 1) % len(points)])
        square = max((nx * nx + ny * ny) / 2, _MIN_BEND)  # 2 cos² of half the bend
        moved.append((x + side * nx / square, y + side * ny / square))
    return moved


def ribbon(points: Sequence[Point], half_width: float) -> list[Point]:
    """The outline of a line through points, cut off at its ends."""
    last, sides = len(points) - 1, []
    for k, (x, y) in enumerate(points):
        nx, ny = _normal_sum(points[max(k - 1, 0)], (x, y), points[min(k + 1, last)])
        # At an end, one of the two normals is zero and the sum is a unit vector.
        offset = half_width / max((nx * nx + ny * ny) / 2 if 0 < k < last else 1.0, _MIN_BEND)
        sides.append((nx * offset, ny * offset))
    right = [(x + dx, y + dy) for (x, y), (dx, dy) in zip(points, sides, strict=True)]
    left = [(x - dx, y - dy) for (x, y), (dx, dy) in zip(points, sides, strict=True)]
    return right + left[::-1]


def _normal_sum(before: Point, corner: Point, after: Point) -> Point:
    """Sum of the unit normals of the two edges that meet in a corner; an edge without length adds zero."""
    (px, py), (x, y), (qx, qy) = before, corner, after
    first, second = math.hypot(x - px, y - py) or 1.0, math.hypot(qx - x, qy - y) or 1.0
    return (y - py) / first + (qy - y) / second, (px - x) / first + (x - qx) / second


def ends_and_bends(points: Sequence[Point]) -> list[Point]:
    """The points where a line starts, ends or bends sharply."""
    kept = [points[0], points[-1]]
    for (ax, ay), (bx, by), (cx, cy) in zip(points, points[1:], points[2:], strict=False):
        ux, uy, vx, vy = bx - ax, by - ay, cx - bx, cy - by
        if ux * vx + uy * vy < 0.9 * math.hypot(ux, uy) * math.hypot(vx, vy):
            kept.append((bx, by))
    return kept


def filling(points: Sequence[Point]) -> tuple[list[Point], list[list[Point]]]:
    """Split a polygon with smooth edges into a hard-edged polygon and closed antialiased lines of one pixel width.

    pygame rounds the corners of polygons to whole pixels, so that their edges can be a pixel off. Therefore the
    hard-edged polygon is smaller than the outline, and lines cover the rest; the outer line ends at the outline.
    """
    pairs = list(pairwise([*points, points[0]]))
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2
    circumference = sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairs)
    if abs(area) < 3.0 * circumference:  # less than 6 pixels wide
        return widened(points, -0.6), [widened(points, -0.5)]
    return widened(points, -1.9), [widened(points, -distance) for distance in (2.0, 1.25, 0.5)]


def pixels_of(points: Sequence[Point]) -> list[tuple[int, int]]:
    """The whole pixels that contain points; pygame rounds negative coordinates up instead."""
    return [(math.floor(x), math.floor(y)) for x, y in points]


def pixel_centres(points: Sequence[Point]) -> list[Point]:
    """Points in the coordinates of pygame's antialiased lines, in which a pixel's centre is a whole number."""
    return [(x - 0.5, y - 0.5) for x, y in points]
