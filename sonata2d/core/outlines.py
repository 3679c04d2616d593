"""Outlines in the plane: gaps between them, and whether they have space in a room."""

from __future__ import annotations

import math

import numpy as np

from .bounds import MAX_MAGNITUDE
from .compiled.kernel import kernel, subroutine
from .compiled.scalar import (
    ALONG_X,
    ALONG_Y,
    END_X,
    END_Y,
    INVERSE,
    RADIUS,
    START_X,
    START_Y,
    Vector,
    canonical_angle,
    crosses,
    gap,
    inverse_square,
    is_inside,
    length,
    line_gap,
    quantised,
    unit_vector,
)
from .geometry import MOST_CORNERS, Outline, Pose, Shape
from .portable_math import Array
from .vectors import X, Y

# Columns of an outline for kernels, after the position of its centre: its heading, radii of the circles around it and
# within it, its rounding, the gap that it must keep from walls, number of corners of its core, and their coordinates in
# the body frame.
THETA, _CIRCUMRADIUS, _INRADIUS, _ROUNDING, _WALL_GAP, _CORNERS, _CORE = range(2, 9)
COLUMNS = _CORE + 2 * MOST_CORNERS

OutlineRow = tuple[float, ...]
Line = tuple[float, float, float, float]  # start and end, m
_FILL = (0.0,) * (2 * MOST_CORNERS)


def outline_row(shape: Outline, pose: Pose, wall_gap: float = 0.0) -> OutlineRow:
    """An outline as a row of COLUMNS numbers for kernels.

    Args:
        shape, pose: of the outline.
        wall_gap: that the outline must keep from walls, m.
    """
    core = shape.core
    sizes = shape.circumradius, shape.inradius, shape.rounding, wall_gap, float(len(core))
    return (pose.x, pose.y, pose.theta, *sizes, *(c for point in core for c in point), *_FILL[2 * len(core) :])


def side_lines(shape: Shape, position: Array, direction: Array) -> Array:
    """Sides of an outline at poses, as thick lines, (L, K, 5): both ends, m, and the radius; a disc has one.

    Args:
        shape: of the outline.
        position, direction: (L, 2), m, and unit vectors of the headings.
    """
    core, c, s = np.array(shape.core), direction[:, :1], direction[:, 1:]
    x, y = position[:, :1] + c * core[:, 0] - s * core[:, 1], position[:, 1:] + s * core[:, 0] + c * core[:, 1]
    ends = x, y, np.roll(x, -1, axis=1), np.roll(y, -1, axis=1), np.full_like(x, shape.rounding)
    return np.stack(ends, axis=-1)


def shape_gap(shape: Outline, pose: Pose, other: Outline, other_pose: Pose) -> float:
    """Gap between the outlines of two shapes at their poses, m; 0 where they touch or overlap."""
    return float(_pair_gap(np.array([outline_row(shape, pose)]), 0, np.array([outline_row(other, other_pose)]), 0))


_TOUCHING = 1e-3  # m, less than this counts as touching


@kernel
def has_space(
    walls: Array, borders: Array, outlines: Array, others: Array, clearance: float, sight_lines: Array
) -> bool:
    """Whether outlines have space in a room.

    Args:
        walls: (M, 8), `Barriers.table` of the walls.
        borders: (K, 4), edges of the room's polygon, m.
        outlines: (N, COLUMNS); each must lie in the room, and keep its gap to the walls and the clearance to the others
            and to each other, except that two discs may touch.
        others: (O, COLUMNS), outlines in the room.
        clearance: m.
        sight_lines: (L, 4), straight lines that must not cross a wall, m.
    """
    for i in range(len(sight_lines)):
        for k in range(len(walls)):
            if crosses(walls, k, sight_lines[i, 0], sight_lines[i, 1], sight_lines[i, 2], sight_lines[i, 3]):
                return False
    return _have_space(walls, borders, outlines, others, clearance)


@kernel
def has_space_at(
    x: float, y: float, theta: float, outlines: Array, walls: Array, borders: Array, others: Array, clearance: float
) -> bool:
    """Whether outlines have space in a room at poses that are relative to another pose.

    Args:
        x, y, theta: the pose, m and rad.
        outlines: (N, COLUMNS), positions and headings relative to this pose. Those in the room are rounded as by
            `Pose.rounded`.
        walls, borders, others, clearance: as for `has_space`.
    """
    moved = outlines.copy()
    c, s = unit_vector(theta)
    for i in range(len(outlines)):
        ahead, left = outlines[i, X], outlines[i, Y]
        moved_x, moved_y = x + ahead * c - left * s, y + ahead * s + left * c
        if max(abs(moved_x), abs(moved_y)) > MAX_MAGNITUDE:
            return False
        moved[i, X], moved[i, Y] = quantised(moved_x), quantised(moved_y)
        moved[i, THETA] = canonical_angle(theta + outlines[i, THETA])
    return _have_space(walls, borders, moved, others, clearance)


@subroutine
def _have_space(walls: Array, borders: Array, outlines: Array, others: Array, clearance: float) -> bool:
    """`has_space` without sight lines."""
    for i in range(len(outlines)):
        if not _is_off_walls(outlines, i, walls) or not is_inside(borders, outlines[i, X], outlines[i, Y]):
            return False
        for k in range(len(others)):
            if not _has_clearance(outlines, i, others, k, clearance):
                return False
        for k in range(i):
            # People who start together may be as near as their arrangement puts them: they need no more than to touch.
            both = outlines[i, _CORNERS] == 1.0 and outlines[k, _CORNERS] == 1.0
            if not _has_clearance(outlines, i, outlines, k, -_TOUCHING if both else clearance):
                return False
    return True


@kernel
def _pair_gap(outlines: Array, i: int, others: Array, k: int) -> float:
    return max(_gap(outlines, i, others, k), 0.0)


@subroutine
def _is_off_walls(outlines: Array, i: int, walls: Array) -> bool:
    """Whether an outline keeps its gap to all walls."""
    x, y = outlines[i, X], outlines[i, Y]
    minimum: float = outlines[i, _WALL_GAP]
    inner_radius: float = outlines[i, _INRADIUS]
    for k in range(len(walls)):
        if gap(walls, k, x, y) < inner_radius + minimum:  # the inscribed circle: a cheap test that rejects most poses
            return False
    if outlines[i, _CORNERS] == 1.0:
        return True
    return bool(_edges_gap(_edges(outlines, i), walls) - outlines[i, _ROUNDING] >= minimum)


@subroutine
def _has_clearance(outlines: Array, i: int, others: Array, k: int, clearance: float) -> bool:
    """Whether outline i keeps a clearance to outline k of the others."""
    dx, dy = outlines[i, X] - others[k, X], outlines[i, Y] - others[k, Y]
    near = outlines[i, _CIRCUMRADIUS] + others[k, _CIRCUMRADIUS] + clearance
    # the circumscribed circles are a cheap test that excludes most pairs
    return bool(dx * dx + dy * dy >= near * near or _gap(outlines, i, others, k) >= clearance)


@subroutine
def _gap(outlines: Array, i: int, others: Array, k: int) -> float:
    """Gap between two outlines, m; 0 where they touch or overlap, below 0 for discs."""
    radius: float = outlines[i, _ROUNDING]
    if outlines[i, _CORNERS] == 1.0 and others[k, _CORNERS] == 1.0:
        distance = length(outlines[i, X] - others[k, X], outlines[i, Y] - others[k, Y])
        between: float = distance - radius - others[k, _ROUNDING]
        return between
    # A shape within the other one has a positive distance to its edges.
    own, their = _edges(outlines, i), _edges(others, k)
    if _contains(outlines, i, their[0, START_X], their[0, START_Y]) or _contains(
        others, k, own[0, START_X], own[0, START_Y]
    ):
        return 0.0
    return max(_edges_gap(own, their) - radius, 0.0)


@subroutine
def _contains(outlines: Array, i: int, x: float, y: float) -> bool:
    """Whether a point lies within an outline; of a polygon, within its core."""
    c, s = unit_vector(outlines[i, THETA])
    dx, dy = x - outlines[i, X], y - outlines[i, Y]
    ahead, left = dx * c + dy * s, dy * c - dx * s
    count = int(outlines[i, _CORNERS])
    if count < 3:
        return bool(ahead * ahead + left * left <= outlines[i, _ROUNDING] * outlines[i, _ROUNDING])
    for e in range(count):
        (ax, ay), (bx, by) = _corner(outlines, i, e), _corner(outlines, i, (e + 1) % count)
        if (bx - ax) * (left - ay) < (by - ay) * (ahead - ax):
            return False
    return True


@subroutine
def _corner(outlines: Array, i: int, e: int) -> Vector:
    """Corner e of the core in the body frame, m."""
    return outlines[i, _CORE + 2 * e], outlines[i, _CORE + 2 * e + 1]


@subroutine
def _edges(outlines: Array, i: int) -> Array:
    """An outline as thick segments, in rows of `Barriers.table` and the order of `Outline.edges`."""
    count = int(outlines[i, _CORNERS])
    edges = np.empty((count, 8))
    c, s = unit_vector(outlines[i, THETA])
    for e in range(count):
        ahead, left = _corner(outlines, i, e)
        edges[e, START_X] = outlines[i, X] + ahead * c - left * s
        edges[e, START_Y] = outlines[i, Y] + ahead * s + left * c
    for e in range(count):
        following = (e + 1) % count
        edges[e, END_X], edges[e, END_Y] = edges[following, START_X], edges[following, START_Y]
        dx, dy = edges[e, END_X] - edges[e, START_X], edges[e, END_Y] - edges[e, START_Y]
        edges[e, ALONG_X], edges[e, ALONG_Y], edges[e, INVERSE] = dx, dy, inverse_square(dx, dy)
        edges[e, RADIUS] = outlines[i, _ROUNDING]
    return edges


@subroutine
def _edges_gap(edges: Array, barriers: Array) -> float:
    """Smallest gap between the core lines of edges and barriers, m; rows of `Barriers.table`."""
    nearest = math.inf
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e, START_X], edges[e, START_Y], edges[e, END_X], edges[e, END_Y]
        for k in range(len(barriers)):
            nearest = min(nearest, line_gap(barriers, k, ax, ay, bx, by))
    return nearest
