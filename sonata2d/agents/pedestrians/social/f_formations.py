"""F-formations: where a newcomer stands in a talking group, and how large the circle of a group is."""

from __future__ import annotations

from itertools import combinations

from ....core.geometry import Point
from ....core.vectors import length

MAXIMUM_MEMBERS = 6
PAIR_DISTANCE = 1.0  # m, between two people who talk
_MINIMUM_RADIUS = {1: 0.0, 2: 0.5, 3: 0.6, 4: 0.7, 5: 0.85, 6: 1.0}  # m, of the circle, by number of members
_MAXIMUM_TRIANGLE_HEIGHT = 1.2  # m, from the middle of two members to the third
# Directions from a member that stands alone, (cos, sin) relative to its own direction: ahead, half left, half right.
_DIRECTIONS = ((1.0, 0.0), (0.7071, 0.7071), (0.7071, -0.7071))


def joining_positions(members: list[Point], facing_point: Point, newcomer: Point) -> list[tuple[Point, Point]]:
    """Where a newcomer can stand, best position first, with the centre of the resulting formation.

    All members have equal access to a formation: a newcomer takes the widest gap, of equal gaps the nearer one.

    Args:
        members: positions of the members, m; a pedestrian that stands alone is a formation of one.
        facing_point: the point that a single member faces, m.
        newcomer: position of the newcomer, m.

    Returns:
        Pairs of centre and position, m.

    Source: the F-formation of A. Kendon, Conducting Interaction (1990): members share a space to which all have equal
    access, and rearrange themselves when another one joins.
    """
    if len(members) == 1:
        return _facing_positions(members[0], facing_point, newcomer)
    if len(members) == 2:
        return _triangle_positions(members[0], members[1], newcomer)
    centre = _mean(members)
    spokes = [_unit(x - centre[0], y - centre[1]) for x, y in members]  # unit vectors from the centre
    radius = max(*(length(x - centre[0], y - centre[1]) for x, y in members), _MINIMUM_RADIUS[len(members) + 1])
    ranked = []
    for a, b in combinations(spokes, 2):
        x, y = a[0] + b[0], a[1] + b[1]
        if length(x, y) < 0.05:  # opposite members: the bisector is undefined
            continue
        bisector = _unit(x, y)
        for ux, uy in (bisector, (-bisector[0], -bisector[1])):
            # The largest cosine to a member: the smaller, the wider the gap. Rounded, so that equal gaps compare equal.
            nearest = round(max(ux * s + uy * t for s, t in spokes), 1)
            position = centre[0] + radius * ux, centre[1] + radius * uy
            ranked.append((nearest, distance(position, newcomer), position))
    return [(centre, position) for _, _, position in sorted(ranked)]


def widen(member: Point, centre: Point, count: int) -> Point:
    """Where a member of a formation of `count` stands: moved outwards to the minimum radius if it is nearer, m."""
    dx, dy = member[0] - centre[0], member[1] - centre[1]
    scale = _MINIMUM_RADIUS[min(count, MAXIMUM_MEMBERS)] / max(length(dx, dy), 1e-6)
    return member if scale <= 1.0 else (centre[0] + dx * scale, centre[1] + dy * scale)


def distance(a: Point, b: Point) -> float:
    """Distance of two points, m."""
    return length(a[0] - b[0], a[1] - b[1])


def _facing_positions(member: Point, facing_point: Point, newcomer: Point) -> list[tuple[Point, Point]]:
    """Positions opposite a single member: straight ahead first, then half aside, the nearer side first."""
    ux, uy = _unit(facing_point[0] - member[0], facing_point[1] - member[1])
    ranked = []
    for rank, (c, s) in enumerate(_DIRECTIONS):
        x, y = PAIR_DISTANCE * (ux * c - uy * s), PAIR_DISTANCE * (uy * c + ux * s)
        position = member[0] + x, member[1] + y
        centre = (member[0] + x / 2, member[1] + y / 2)
        ranked.append((min(rank, 1), distance(position, newcomer), centre, position))
    return [(centre, position) for _, _, centre, position in sorted(ranked)]


def _triangle_positions(a: Point, b: Point, newcomer: Point) -> list[tuple[Point, Point]]:
    """Positions that form an equilateral triangle with two members, a flatter one if they stand far apart."""
    (ax, ay), (bx, by) = a, b
    ux, uy = _unit(bx - ax, by - ay)
    height = min(max(0.866 * length(bx - ax, by - ay), 1.5 * _MINIMUM_RADIUS[3]), _MAXIMUM_TRIANGLE_HEIGHT)
    ranked = []
    for side in (1.0, -1.0):
        x, y = -uy * height * side, ux * height * side
        position = ((ax + bx) / 2 + x, (ay + by) / 2 + y)
        centre = ((ax + bx) / 2 + x / 3, (ay + by) / 2 + y / 3)
        ranked.append((distance(position, newcomer), centre, position))
    return [(centre, position) for _, centre, position in sorted(ranked)]


def _mean(points: list[Point]) -> Point:
    x = y = 0.0
    for point in points:
        x, y = x + point[0], y + point[1]
    return x / len(points), y / len(points)


def _unit(x: float, y: float) -> Point:
    size = max(length(x, y), 1e-9)
    return x / size, y / size
