"""Circles of people who talk: where the next one stands, and how large a circle of so many is."""

from __future__ import annotations

from itertools import combinations

from ....core.geometry import Point
from ....core.vectors import length

LARGEST = 6  # people in one circle
MEETING = 1.2  # m, between two who talk
RADIUS = {1: 0.0, 2: 0.6, 3: 0.65, 4: 0.75, 5: 0.85, 6: 1.0}  # m, at least, of a circle of so many
FLATTEST = 1.2  # m, from the middle of two to a third, at most
_ASIDE = ((1.0, 0.0), (0.7071, 0.7071), (0.7071, -0.7071))  # from whom stands alone: ahead, and half left or right


def free_places(homes: list[Point], front: Point, comer: Point) -> list[tuple[Point, Point]]:
    """Where one more could stand, with the centre of the circle then, the best first.

    A circle is open to all its members: a newcomer takes the widest gap, of two alike the nearer one.

    Args:
        homes: m, where the members stand; one may stand alone.
        front: m, what that one faces.
        comer: m, where the newcomer is.

    Returns:
        Centre and place, m.

    Source: the F-formation of A. Kendon, Conducting Interaction (1990): members share a space to which all have equal
        access, and rearrange themselves when one joins.
    """
    if len(homes) == 1:
        return _before(homes[0], front, comer)
    if len(homes) == 2:
        return _beside(homes[0], homes[1], comer)
    centre = _middle(homes)
    spokes = [_unit(x - centre[0], y - centre[1]) for x, y in homes]
    radius = max(*(length(x - centre[0], y - centre[1]) for x, y in homes), RADIUS[len(homes) + 1])
    found = []
    for a, b in combinations(spokes, 2):
        x, y = a[0] + b[0], a[1] + b[1]
        if length(x, y) < 0.05:
            continue
        between = _unit(x, y)
        for ux, uy in (between, (-between[0], -between[1])):
            nearest = max(ux * s + uy * t for s, t in spokes)
            place = centre[0] + radius * ux, centre[1] + radius * uy
            far = apart(place, comer)
            found.append((round(nearest, 1), far, place))
    return [(centre, place) for _, _, place in sorted(found)]


def widened(home: Point, centre: Point, count: int) -> Point:
    """Where a member of a circle of so many stands: no nearer to its centre than such a circle wants."""
    dx, dy = home[0] - centre[0], home[1] - centre[1]
    share = RADIUS[min(count, LARGEST)] / max(length(dx, dy), 1e-6)
    return home if share <= 1.0 else (centre[0] + dx * share, centre[1] + dy * share)


def _before(home: Point, front: Point, comer: Point) -> list[tuple[Point, Point]]:
    """Places opposite somebody who stands alone: where they look first, then half aside, the nearer side first."""
    ux, uy = _unit(front[0] - home[0], front[1] - home[1])
    found = []
    for rank, (c, s) in enumerate(_ASIDE):
        x, y = MEETING * (ux * c - uy * s), MEETING * (uy * c + ux * s)
        place = home[0] + x, home[1] + y
        far = apart(place, comer)
        found.append((min(rank, 1), far, (home[0] + x / 2, home[1] + y / 2), place))
    return [(centre, place) for _, _, centre, place in sorted(found)]


def _beside(one: Point, other: Point, comer: Point) -> list[tuple[Point, Point]]:
    """Places that make an even triangle of two, or a flatter one where they stand far apart; the nearer first."""
    (ax, ay), (bx, by) = one, other
    ux, uy = _unit(bx - ax, by - ay)
    height = min(max(0.866 * length(bx - ax, by - ay), 1.5 * RADIUS[3]), FLATTEST)
    found = []
    for side in (1.0, -1.0):
        x, y = -uy * height * side, ux * height * side
        place, centre = ((ax + bx) / 2 + x, (ay + by) / 2 + y), ((ax + bx) / 2 + x / 3, (ay + by) / 2 + y / 3)
        found.append((apart(place, comer), centre, place))
    return [(centre, place) for _, centre, place in sorted(found)]


def _middle(places: list[Point]) -> Point:
    x = y = 0.0
    for place in places:
        x, y = x + place[0], y + place[1]
    return x / len(places), y / len(places)


def apart(one: Point, other: Point) -> float:
    """m, between two places."""
    return length(one[0] - other[0], one[1] - other[1])


def _unit(x: float, y: float) -> Point:
    size = max(length(x, y), 1e-9)
    return x / size, y / size
