"""F-formations: where a newcomer stands in a talking group, and how large the circle of a group is.

Source: the F-formation of A. Kendon, Conducting Interaction (1990): members share a space to which all have equal
access, and rearrange themselves when another one joins.
"""

from __future__ import annotations

import math

import numpy as np

from ....core.compiled.kernel import subroutine
from ....core.compiled.scalar import Vector, length
from ....core.portable_math import Array

MAXIMUM_MEMBERS = 6
PAIR_DISTANCE = 1.0  # m, between two people who talk
_MINIMUM_RADIUS = np.array([0.0, 0.0, 0.5, 0.6, 0.7, 0.85, 1.0])  # m, of the circle, by number of members
_MAXIMUM_TRIANGLE_HEIGHT = 1.2  # m, from the middle of two members to the third
# Directions from a member that stands alone, (cos, sin) relative to its own direction: ahead, half left, half right.
_DIRECTIONS = np.array([(1.0, 0.0), (0.7071, 0.7071), (0.7071, -0.7071)])
_NEAREST, _DISTANCE, CENTRE_X, CENTRE_Y, POSITION_X, POSITION_Y = range(6)  # columns of ranked positions
MOST_POSITIONS = MAXIMUM_MEMBERS * MAXIMUM_MEMBERS


@subroutine
def joining_positions(
    members: Array, facing_x: float, facing_y: float, newcomer_x: float, newcomer_y: float, ranked: Array
) -> int:
    """Where a newcomer can stand, best position first, with the centre of the resulting formation.

    All members have equal access to a formation: a newcomer takes the widest gap, of equal gaps the nearer one.

    Args:
        members: (M, 2), positions of the members, m; a pedestrian that stands alone is a formation of one.
        facing_x, facing_y: the point that a single member faces, m.
        newcomer_x, newcomer_y: position of the newcomer, m.
        ranked: (36, 6), is filled; the last columns are centre and position, m.

    Returns:
        Number of rows.
    """
    count = 0
    if len(members) == 1:
        ux, uy = _unit(facing_x - members[0, 0], facing_y - members[0, 1])
        for rank in range(len(_DIRECTIONS)):  # straight ahead first, then half aside
            c, s = _DIRECTIONS[rank, 0], _DIRECTIONS[rank, 1]
            dx, dy = PAIR_DISTANCE * (ux * c - uy * s), PAIR_DISTANCE * (uy * c + ux * s)
            row, count = ranked[count], count + 1
            row[_NEAREST], row[CENTRE_X], row[CENTRE_Y] = min(rank, 1), members[0, 0] + dx / 2, members[0, 1] + dy / 2
            row[POSITION_X], row[POSITION_Y] = members[0, 0] + dx, members[0, 1] + dy
    elif len(members) == 2:
        # An equilateral triangle with the two members, a flatter one if they stand far apart
        along_x, along_y = members[1, 0] - members[0, 0], members[1, 1] - members[0, 1]
        ux, uy = _unit(along_x, along_y)
        height = min(max(0.866 * length(along_x, along_y), 1.5 * _MINIMUM_RADIUS[3]), _MAXIMUM_TRIANGLE_HEIGHT)
        x, y = (members[0, 0] + members[1, 0]) / 2, (members[0, 1] + members[1, 1]) / 2
        for side in range(1, -2, -2):
            dx, dy = -uy * height * side, ux * height * side
            row, count = ranked[count], count + 1
            row[_NEAREST], row[CENTRE_X], row[CENTRE_Y] = 0.0, x + dx / 3, y + dy / 3
            row[POSITION_X], row[POSITION_Y] = x + dx, y + dy
    else:
        count = _gap_positions(members, ranked)
    for n in range(count):
        ranked[n, _DISTANCE] = length(ranked[n, POSITION_X] - newcomer_x, ranked[n, POSITION_Y] - newcomer_y)
        m = n
        while m > 0 and _comes_before(ranked[m], ranked[m - 1]):
            for column in range(6):
                ranked[m, column], ranked[m - 1, column] = ranked[m - 1, column], ranked[m, column]
            m -= 1
    return count


@subroutine
def _gap_positions(members: Array, ranked: Array) -> int:
    """Positions on the bisectors of all pairs of three members or more."""
    size, count, x, y = len(members), 0, 0.0, 0.0
    for n in range(size):
        x, y = x + members[n, 0], y + members[n, 1]
    x, y, radius = x / size, y / size, _MINIMUM_RADIUS[size + 1]
    spokes = np.empty((size, 2))  # unit vectors from the centre
    for n in range(size):
        spokes[n, 0], spokes[n, 1] = _unit(members[n, 0] - x, members[n, 1] - y)
        radius = max(radius, length(members[n, 0] - x, members[n, 1] - y))
    for a in range(size):
        for b in range(a + 1, size):
            dx, dy = spokes[a, 0] + spokes[b, 0], spokes[a, 1] + spokes[b, 1]
            if length(dx, dy) < 0.05:  # opposite members: the bisector is undefined
                continue
            dx, dy = _unit(dx, dy)
            for sign in range(1, -2, -2):
                ux, uy, nearest = sign * dx, sign * dy, -1.0
                for n in range(size):
                    nearest = max(nearest, ux * spokes[n, 0] + uy * spokes[n, 1])
                row, count = ranked[count], count + 1
                # The largest cosine to a member: the smaller, the wider the gap. Rounded, so that equal gaps compare
                # equal.
                row[_NEAREST], row[CENTRE_X], row[CENTRE_Y] = math.floor(10.0 * nearest + 0.5), x, y
                row[POSITION_X], row[POSITION_Y] = x + radius * ux, y + radius * uy
    return count


@subroutine
def _comes_before(row: Array, other: Array) -> bool:
    """Whether a ranked position is better than another one; of equal ones, the one with the smaller coordinates."""
    for column in range(6):
        if row[column] != other[column]:
            return bool(row[column] < other[column])
    return False


@subroutine
def widened(x: float, y: float, centre_x: float, centre_y: float, count: int) -> Vector:
    """Where a member of a formation of `count` stands: moved outwards to the minimum radius if it is nearer, m."""
    dx, dy = x - centre_x, y - centre_y
    scale = _MINIMUM_RADIUS[min(count, MAXIMUM_MEMBERS)] / max(length(dx, dy), 1e-6)
    return (x, y) if scale <= 1.0 else (centre_x + dx * scale, centre_y + dy * scale)


@subroutine
def _unit(x: float, y: float) -> Vector:
    size = max(length(x, y), 1e-9)
    return x / size, y / size
