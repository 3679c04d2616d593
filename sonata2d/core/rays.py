"""Rays and views from the robot: ranges to outlines, and entities that are visible."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .barrier_grid import Solids, column_of, rows_near_line
from .compiled.kernel import kernel, subroutine
from .compiled.packing import unpack
from .compiled.scalar import Vector, half_line, length
from .humans import BODY_X, BODY_Y, X, Y
from .portable_math import Array, BoolArray, IntArray
from .state import HUMAN_SIZE, ROBOT_SIZE

_BUNDLE = 8  # neighbouring rays for which outlines are chosen together
_MANY = 160  # barriers, above which each ray looks for them in the grid


@kernel
def visible(
    row: Array, is_present: BoolArray, radius: Array, shoulder: Array, objects: Array, walls: Array,
    human_rows: IntArray, object_rows: IntArray, cosine: float, distance: float, occlusion: bool, ends: int,
    is_seen: BoolArray,
) -> None:  # fmt: skip
    """Mark the entities that the robot sees; all others become unseen.

    Args:
        row: of a `State` with N pedestrians.
        is_present: (N,), pedestrians that are in the room.
        radius, shoulder: (N,), of their bodies, m.
        objects: (M, 2), centres, m, world frame.
        walls: (W, 4), both ends, m, world frame.
        human_rows, object_rows: (H,) and (O,), the entity of each row of the observation; -1 for empty rows.
        cosine: of half the angle of the field of view.
        distance: m.
        occlusion: whether walls and pedestrians hide others.
        ends: 1: a pedestrian is seen if its centre or an end of its shoulder line is; 0: if its centre is.
        is_seen: (H + O,), true for rows that can be seen; false is written for entities that are not seen.
    """
    x, y, ahead_x, ahead_y = row[X], row[Y], row[BODY_X], row[BODY_Y]
    for k in range(len(is_seen)):
        if not is_seen[k]:
            continue
        is_seen[k] = False
        itself = human_rows[k] if k < len(human_rows) else -1  # a pedestrian does not hide itself
        for end in range(-ends, ends + 1):
            if itself >= 0:
                at = ROBOT_SIZE + HUMAN_SIZE * itself
                sx, sy = half_line(row[at + BODY_X], row[at + BODY_Y], shoulder[itself])
                dx, dy = row[at + X] + end * sx - x, row[at + Y] + end * sy - y
            else:
                piece = object_rows[k - len(human_rows)]
                dx, dy = objects[piece, 0] - x, objects[piece, 1] - y
            away = length(dx, dy)
            if away > distance or dx * ahead_x + dy * ahead_y < cosine * away:
                continue
            ux, uy, is_hidden = dx / max(away, 1e-9), dy / max(away, 1e-9), False
            for w in range(len(walls) if occlusion else 0):
                ax, ay, bx, by = walls[w, 0] - x, walls[w, 1] - y, walls[w, 2] - x, walls[w, 3] - y
                is_hidden = is_hidden or _range_to_line(ux, uy, ax, ay, bx, by) < away
            for j in range(len(is_present) if occlusion else 0):
                if is_present[j] and j != itself and not is_hidden:
                    is_hidden = _range_to_body(row, j, radius[j], shoulder[j], ux, uy) < away
            if not is_hidden:
                is_seen[k] = True


@kernel
def fill_bodies(row: Array, is_present: BoolArray, radius: Array, shoulder: Array, lines: Array) -> int:
    """The outlines of the pedestrians in the room as thick lines.

    Args:
        row: of a `State` with N pedestrians.
        is_present: (N,), pedestrians that are in the room.
        radius, shoulder: (N,), of their bodies, m.
        lines: (N, 5), output: start, end, radius, m, world frame.

    Returns:
        Their number.
    """
    count = 0
    for k in range(len(is_present)):
        if is_present[k]:
            at = ROBOT_SIZE + HUMAN_SIZE * k
            sx, sy = half_line(row[at + BODY_X], row[at + BODY_Y], shoulder[k])
            lines[count, 0], lines[count, 1] = row[at + X] - sx, row[at + Y] - sy
            lines[count, 2], lines[count, 3], lines[count, 4] = row[at + X] + sx, row[at + Y] + sy, radius[k]
            count += 1
    return count


@kernel
def measure_ranges(
    x: float, y: float, c: float, s: float, packed_solids: Any, lines: Array, directions: Array, ranges: Array
) -> None:
    """Shorten the ranges of rays from a place, m, to the nearest outline in their directions.

    Args:
        x, y: where the rays begin, m, world frame.
        c, s: cosine and sine of the heading of their frame.
        packed_solids: walls and furniture.
        lines: (L, 5), start, end and radius of further outlines, m, world frame.
        directions: (R, 2), unit vectors, from right to left, in the frame of the rays.
        ranges: (R,), m, is updated.
    """
    solids = unpack(packed_solids, Solids)
    in_grid = len(solids.table) > _MANY
    count = 0 if in_grid else len(solids.table)
    outlines, chosen = np.empty((count + len(lines), 5)), np.empty(count + len(lines), np.int64)
    for k in range(len(outlines)):
        line = solids.table[k] if k < count else lines[k - count]
        outlines[k, 0], outlines[k, 1] = line[0] - x, line[1] - y
        outlines[k, 2], outlines[k, 3], outlines[k, 4] = line[2] - x, line[3] - y, line[4]
    for first in range(0, len(directions), _BUNDLE):  # neighbouring rays meet the same few outlines
        end = min(first + _BUNDLE, len(directions))
        number = _choose(outlines, _turned(directions, first, c, s), _turned(directions, end - 1, c, s), chosen)
        for r in range(first, end):
            (ux, uy), nearest = _turned(directions, r, c, s), ranges[r]
            if in_grid:
                nearest = _range_to_solids(solids, x, y, ux, uy, nearest)
            for n in range(number):
                line = outlines[chosen[n]]
                nearest = _nearer(ux, uy, line[0], line[1], line[2], line[3], line[4], nearest)
            ranges[r] = nearest


@subroutine
def _turned(directions: Array, r: int, c: float, s: float) -> Vector:
    """The direction of ray r in the world frame."""
    ahead, left = directions[r, 0], directions[r, 1]
    return ahead * c - left * s, ahead * s + left * c


@subroutine
def _choose(outlines: Array, right: Vector, left: Vector, chosen: IntArray) -> int:
    """The outlines that rays from the origin between two directions can meet: their number; all for a wide angle.

    Args:
        outlines: (L, 5), start, end and radius, m.
        right, left: unit vectors.
        chosen: (L,), output.
    """
    (rx, ry), (lx, ly), number = right, left, 0
    is_narrow = rx * lx + ry * ly > 0.0 and rx * ly - ry * lx >= 0.0
    for k in range(len(outlines)):
        ax, ay, bx, by, reach = outlines[k, 0], outlines[k, 1], outlines[k, 2], outlines[k, 3], outlines[k, 4] + 1e-9
        is_right = rx * ay - ry * ax < -reach and rx * by - ry * bx < -reach
        is_left = lx * ay - ly * ax > reach and lx * by - ly * bx > reach
        if not (is_narrow and (is_right or is_left)):
            chosen[number] = k
            number += 1
    return number


@subroutine
def _range_to_solids(solids: Solids, x: float, y: float, ux: float, uy: float, maximum: float) -> float:
    """Range of a ray from a point to the nearest barrier, at most the maximum, m."""
    grid, nearest = solids.grid, maximum
    column, last, step = column_of(grid, x), column_of(grid, x + ux * maximum), 1 if ux >= 0.0 else -1
    while True:
        # Cells of the columns that the ray passes, up to what it has met so far.
        low, high = rows_near_line(grid, column, x, y, x + ux * maximum, y + uy * maximum, 0.0)
        for n in range(grid.first[column * grid.rows + low], grid.first[column * grid.rows + high + 1]):
            wall = solids.table[grid.item[n]]
            ax, ay, bx, by = wall[0] - x, wall[1] - y, wall[2] - x, wall[3] - y
            nearest = _nearer(ux, uy, ax, ay, bx, by, wall[4], nearest)
        if column == last or step * (column_of(grid, x + ux * nearest) - column) <= 0:
            return nearest
        column += step


@subroutine
def _nearer(ux: float, uy: float, ax: float, ay: float, bx: float, by: float, radius: float, nearest: float) -> float:
    """The smaller one of a range and of the range to a thick line, as of `_range_to_capsule`, m."""
    # Most outlines lie beside the ray, behind its start, or beyond what it has met.
    at_a, at_b = ux * ay - uy * ax, ux * by - uy * bx
    if (at_a > radius and at_b > radius) or (at_a < -radius and at_b < -radius):
        return nearest
    along_a, along_b = ux * ax + uy * ay, ux * bx + uy * by
    if max(along_a, along_b) < -radius or min(along_a, along_b) - radius > nearest + 1e-9:
        return nearest
    return min(nearest, _range_to_capsule(ux, uy, ax, ay, bx, by, radius))


@subroutine
def _range_to_body(row: Array, k: int, radius: float, shoulder: float, ux: float, uy: float) -> float:
    """Range of a ray from the robot's centre to the outline of pedestrian k, m."""
    at = ROBOT_SIZE + HUMAN_SIZE * k
    dx, dy = row[at + X] - row[X], row[at + Y] - row[Y]
    sx, sy = half_line(row[at + BODY_X], row[at + BODY_Y], shoulder)
    return _range_to_capsule(ux, uy, dx - sx, dy - sy, dx + sx, dy + sy, radius)


@subroutine
def _range_to_capsule(ux: float, uy: float, ax: float, ay: float, bx: float, by: float, radius: float) -> float:
    """Range of a ray from the origin to all points within a radius of the line between two points, m."""
    if radius == 0.0:
        return _range_to_line(ux, uy, ax, ay, bx, by)
    nearest = min(_range_to_disc(ux, uy, ax, ay, radius), _range_to_disc(ux, uy, bx, by, radius))
    along_x, along_y = bx - ax, by - ay
    distance = length(along_x, along_y)
    if distance == 0.0:
        return nearest
    nx, ny = -along_y * radius / distance, along_x * radius / distance
    nearest = min(nearest, _range_to_line(ux, uy, ax + nx, ay + ny, bx + nx, by + ny))
    return min(nearest, _range_to_line(ux, uy, ax - nx, ay - ny, bx - nx, by - ny))


@subroutine
def _range_to_disc(ux: float, uy: float, x: float, y: float, radius: float) -> float:
    """Range of a ray from the origin to a circle, m; 0 from its inside, infinite if it misses it."""
    along, square = x * ux + y * uy, x * x + y * y
    if square <= radius * radius:
        return 0.0
    half = radius * radius - (square - along * along)
    if along <= 0.0 or half < 0.0:
        return math.inf
    return along - math.sqrt(half)


@subroutine
def _range_to_line(ux: float, uy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Range of a ray from the origin to the line between two points, m; infinite if it misses it."""
    dx, dy = bx - ax, by - ay
    cross = ux * dy - uy * dx
    if abs(cross) < 1e-12:
        return math.inf
    range_, part = (ax * dy - ay * dx) / cross, (ax * uy - ay * ux) / cross
    return range_ if range_ >= 0.0 and 0.0 <= part <= 1.0 else math.inf
