"""Outlines in pixels: bars along lines, polygons made wider or narrower."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from ..core.geometry import Point


def bar(start: Point, end: Point, half: float) -> list[Point]:
    """The corners of a straight line twice `half` wide; none if it has no length."""
    (ax, ay), (bx, by) = start, end
    length = math.hypot(bx - ax, by - ay)
    if length <= 0.0:
        return []
    nx, ny = (by - ay) / length * half, (ax - bx) / length * half
    return [(ax + nx, ay + ny), (bx + nx, by + ny), (bx - nx, by - ny), (ax - nx, ay - ny)]


def widened(points: Sequence[Point], by: float) -> list[Point]:
    """A polygon with its edges moved outward by so many pixels (inward if negative); sharp corners are cut short.

    >>> widened([(0, 0), (4, 0), (4, 4), (0, 4)], 1.0)
    [(-1.0, -1.0), (5.0, -1.0), (5.0, 5.0), (-1.0, 5.0)]
    """
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise([*points, points[0]]))
    side = by if area > 0.0 else -by
    moved = []
    for k, (x, y) in enumerate(points):
        (px, py), (qx, qy) = points[k - 1], points[(k + 1) % len(points)]
        before, after = math.hypot(x - px, y - py) or 1.0, math.hypot(qx - x, qy - y) or 1.0
        nx, ny = (y - py) / before + (qy - y) / after, (px - x) / before + (x - qx) / after
        square = max((nx * nx + ny * ny) / 2, 0.3)  # 2 cos² of half the bend
        moved.append((x + side * nx / square, y + side * ny / square))
    return moved


def filling(points: Sequence[Point]) -> tuple[list[Point], list[list[Point]]]:
    """What makes a polygon with smooth edges: a hard filling, and closed smooth lines one pixel wide.

    A hard filling's edge may lie a pixel off, since its corners lie at whole pixels. So it stays that much within the
    outline, and lines cover what is between; the outer line's outer edge is the outline.
    """
    pairs = list(pairwise([*points, points[0]]))
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2
    around = sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairs)
    if abs(area) < 3.0 * around:  # thinner than 6 pixels
        return widened(points, -0.6), [widened(points, -0.5)]
    return widened(points, -1.9), [widened(points, -by) for by in (2.0, 1.25, 0.5)]


def whole(points: Sequence[Point]) -> list[tuple[int, int]]:
    """The pixels that hold points; pygame by itself would round those left of the picture to the right."""
    return [(math.floor(x), math.floor(y)) for x, y in points]


def middles(points: Sequence[Point]) -> list[Point]:
    """Points as smooth lines take them: told by the middles of pixels, not by their corners."""
    return [(x - 0.5, y - 0.5) for x, y in points]


def ribbon(points: Sequence[Point], half: float) -> list[Point]:
    """The outline of a line through points, twice `half` wide and cut off at its ends."""
    sides = []
    for k, (x, y) in enumerate(points):
        (px, py), (qx, qy) = points[max(k - 1, 0)], points[min(k + 1, len(points) - 1)]
        before, after = math.hypot(x - px, y - py) or 1.0, math.hypot(qx - x, qy - y) or 1.0
        nx, ny = (y - py) / before + (qy - y) / after, (px - x) / before + (x - qx) / after
        by = half / max((nx * nx + ny * ny) / 2 if 0 < k < len(points) - 1 else 1.0, 0.3)
        sides.append((nx * by, ny * by))
    right = [(x + dx, y + dy) for (x, y), (dx, dy) in zip(points, sides, strict=True)]
    left = [(x - dx, y - dy) for (x, y), (dx, dy) in zip(points, sides, strict=True)]
    return right + left[::-1]


def ends_and_bends(points: Sequence[Point]) -> list[Point]:
    """Where a line begins, ends or bends sharply."""
    kept = [points[0], points[-1]]
    for (ax, ay), (bx, by), (cx, cy) in zip(points, points[1:], points[2:], strict=False):
        ux, uy, vx, vy = bx - ax, by - ay, cx - bx, cy - by
        if ux * vx + uy * vy < 0.9 * math.hypot(ux, uy) * math.hypot(vx, vy):
            kept.append((bx, by))
    return kept
