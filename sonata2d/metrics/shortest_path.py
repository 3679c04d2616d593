"""The shortest path of a disc among walls and furniture: straight lines and arcs around the ends of obstacles.

A disc of radius r moves like a point among obstacles that are wider by r. Shortest paths of the point consist of
tangents of the circles around the ends of barriers, and of arcs of these circles.
"""

from __future__ import annotations

import heapq
import math

import numpy as np

from ..core.barrier_grid import is_too_near
from ..core.compiled.kernel import kernel, subroutine
from ..core.compiled.scalar import END_X, END_Y, RADIUS, START_X, START_Y, gap
from ..core.free_space import TOLERANCE
from ..core.portable_math import Array

_ARC_STEPS = 180  # of a whole circle, at which an arc is tested for obstacles
_TURN = 2.0 * math.pi
_ROUNDING = 1e-9  # m, rad
_X, _Y, _REACH = range(3)  # columns of circles: centre and radius, m


@kernel
def shortest_length(
    barriers: Array, radius: float, x: float, y: float, goal_x: float, goal_y: float, distance: float
) -> float:
    """Length of the shortest path of a disc from a point to a free position near a goal, m; infinite without a path.

    Where the point is nearer to a barrier than the radius, the whole path keeps only this smaller distance from it.

    Args:
        barriers: (M, 8), `Barriers.table`.
        radius: of the disc, m.
        x, y: start of its centre, m.
        goal_x, goal_y, distance: the path ends at the first position within the distance of the goal, m.

    Source: tangent graph of Liu & Arimoto, Int. J. Robotics Research 11 (1992) 376; searched by A* (Hart, Nilsson &
    Raphael, IEEE Trans. Syst. Sci. Cybern. 4 (1968) 100).
    """
    straight = math.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2) - distance
    if straight <= 0.0:
        return 0.0
    part = straight / (straight + distance)
    barriers = _passable(barriers, radius, x, y)
    if _is_clear(barriers, radius, x, y, x + part * (goal_x - x), y + part * (goal_y - y)):
        return straight
    circles = _circles(barriers, radius)
    targets = _targets(barriers, circles, radius, goal_x, goal_y, distance)
    # Lines to try: bound of the path length, length to the end of the line, its start and end, circle that it touches
    # there (-1: none, the path ends), and sense in which the path goes on around it (1: counter-clockwise, -1).
    lines = [(straight, 0.0, x, y, x, y, -2, 1)]
    tried = [(0, 0, 0.0, 0.0, 0.0)]  # circle, sense, angle and length on arrival, angle to the next obstacle
    while len(lines) > 0:
        _, travelled, start_x, start_y, end_x, end_y, circle, sense = heapq.heappop(lines)
        if circle != -2 and not _is_clear(barriers, radius, start_x, start_y, end_x, end_y):
            continue
        if circle == -1:
            return travelled
        centre_x, centre_y, reach, angle, free = x, y, 0.0, 0.0, _TURN
        if circle >= 0:
            centre_x, centre_y, reach = circles[circle, _X], circles[circle, _Y], circles[circle, _REACH]
            angle = math.atan2(end_y - centre_y, end_x - centre_x)
            if _is_known(tried, circle, sense, angle, travelled, reach):
                continue
            free = _free_arc(barriers, radius, centre_x, centre_y, reach, angle, sense)
            tried.append((circle, sense, angle, travelled, free))
        for k in range(len(circles) + len(targets)):
            is_circle = k < len(circles)
            other = circles[k] if is_circle else targets[k - len(circles)]
            for turn in range(-1, 2, 2):
                if k == circle or (turn == 1 and not is_circle):
                    continue
                # the tangent from this circle to the other one: its direction, and a unit vector to its left
                dx, dy = other[_X] - centre_x, other[_Y] - centre_y
                other_reach = other[_REACH] if is_circle else 0.0
                aside, square = turn * other_reach - sense * reach, dx * dx + dy * dy
                if square < aside * aside - _ROUNDING or square == 0.0:
                    continue
                size = math.sqrt(max(square - aside * aside, 0.0))
                ux, uy = (size * dx + aside * dy) / square, (size * dy - aside * dx) / square
                scale = math.sqrt(ux * ux + uy * uy)
                ux, uy = ux / scale, uy / scale
                arc = (sense * (math.atan2(-sense * ux, sense * uy) - angle)) % _TURN if circle >= 0 else 0.0
                if arc > _TURN - 1e-6:
                    arc = 0.0
                if arc >= free:
                    continue
                from_x, from_y = centre_x + sense * reach * uy, centre_y - sense * reach * ux
                if not is_circle:
                    if size < other[_REACH]:
                        continue
                    size -= other[_REACH]
                to_x, to_y = from_x + size * ux, from_y + size * uy
                total = travelled + reach * arc + size
                rest = max(math.sqrt((goal_x - to_x) ** 2 + (goal_y - to_y) ** 2) - distance, 0.0)
                heapq.heappush(lines, (total + rest, total, from_x, from_y, to_x, to_y, k if is_circle else -1, turn))
    return math.inf


@subroutine
def _passable(barriers: Array, radius: float, x: float, y: float) -> Array:
    """Barriers with radii so much smaller that a disc can be at a point; it can be on no barrier's core line."""
    passable = barriers.copy()
    for k in range(len(barriers)):
        passable[k, RADIUS] += min(max(gap(barriers, k, x, y), 2.0 * TOLERANCE - barriers[k, RADIUS]) - radius, 0.0)
    return passable


@subroutine
def _is_free(barriers: Array, radius: float, x: float, y: float) -> bool:
    """Whether a disc can be at a point."""
    for k in range(len(barriers)):
        if gap(barriers, k, x, y) < radius - TOLERANCE:
            return False
    return True


@subroutine
def _is_clear(barriers: Array, radius: float, x: float, y: float, end_x: float, end_y: float) -> bool:
    """Whether a disc can move straight from one point to another."""
    for k in range(len(barriers)):
        if is_too_near(barriers, k, radius, TOLERANCE, x, y, end_x, end_y):
            return False
    return True


@subroutine
def _circles(barriers: Array, radius: float) -> Array:
    """The circles around which paths turn, (C, 3): one for each point at which barriers end."""
    circles, count = np.empty((2 * len(barriers), 3)), 0
    for k in range(len(barriers)):
        for side in range(2):
            x, y, reach = barriers[k, 2 * side], barriers[k, 2 * side + 1], barriers[k, RADIUS] + radius
            is_new = True
            for i in range(count):
                if circles[i, _X] == x and circles[i, _Y] == y and circles[i, _REACH] == reach:
                    is_new = False
                    break
            if is_new:
                circles[count, _X], circles[count, _Y], circles[count, _REACH] = x, y, reach
                count += 1
    return circles[:count]


@subroutine
def _targets(barriers: Array, circles: Array, radius: float, x: float, y: float, distance: float) -> Array:
    """Points at which paths end, (T, 3): x, y, and the distance before it at which the path ends, m.

    The goal, and where the circle around it meets a widened obstacle, if the disc can be there.
    """
    targets, count = np.empty((1 + 2 * len(circles) + 4 * len(barriers), 3)), 1
    targets[0, 0], targets[0, 1], targets[0, 2] = x, y, distance
    for k in range(len(circles)):
        dx, dy, reach = circles[k, _X] - x, circles[k, _Y] - y, circles[k, _REACH]
        square = dx * dx + dy * dy
        if square > (reach + distance) ** 2 or square < (reach - distance) ** 2 or square == 0.0:
            continue
        along = (square + distance * distance - reach * reach) / (2.0 * square)
        aside = math.sqrt(max(distance * distance / square - along * along, 0.0))
        for side in range(-1, 2, 2):
            targets[count, 0] = x + along * dx - side * aside * dy
            targets[count, 1] = y + along * dy + side * aside * dx
            count += 1
    for k in range(len(barriers)):
        dx, dy = barriers[k, END_X] - barriers[k, START_X], barriers[k, END_Y] - barriers[k, START_Y]
        size = math.sqrt(dx * dx + dy * dy)
        if size == 0.0:
            continue
        ux, uy = dx / size, dy / size
        ahead = (barriers[k, START_X] - x) * ux + (barriers[k, START_Y] - y) * uy
        left = (barriers[k, START_Y] - y) * ux - (barriers[k, START_X] - x) * uy
        for side in range(-1, 2, 2):
            aside = left + side * (barriers[k, RADIUS] + radius)  # of the widened edge from the goal
            if abs(aside) > distance:
                continue
            half = math.sqrt(distance * distance - aside * aside)
            for end in range(-1, 2, 2):
                if ahead <= end * half <= ahead + size:
                    targets[count, 0] = x + end * half * ux - aside * uy
                    targets[count, 1] = y + end * half * uy + aside * ux
                    count += 1
    kept = 1
    for k in range(1, count):
        if _is_free(barriers, radius, targets[k, 0], targets[k, 1]):
            targets[kept, 0], targets[kept, 1], targets[kept, 2] = targets[k, 0], targets[k, 1], 0.0
            kept += 1
    return targets[:kept]


@subroutine
def _free_arc(barriers: Array, radius: float, x: float, y: float, reach: float, angle: float, sense: int) -> float:
    """Angle by which the disc can move around a circle from an angle on, to the first step that is not free, rad."""
    near, count = np.empty(len(barriers), dtype=np.int64), 0
    for k in range(len(barriers)):
        if gap(barriers, k, x, y) < reach + radius:
            near[count] = k
            count += 1
    for step in range(1, _ARC_STEPS):
        turned = angle + sense * step * _TURN / _ARC_STEPS
        to_x, to_y = x + reach * math.cos(turned), y + reach * math.sin(turned)
        for n in range(count):
            if gap(barriers, near[n], to_x, to_y) < radius - TOLERANCE:
                return step * _TURN / _ARC_STEPS
    return _TURN


@subroutine
def _is_known(
    tried: list[tuple[int, int, float, float, float]],
    circle: int,
    sense: int,
    angle: float,
    travelled: float,
    reach: float,
) -> bool:
    """Whether an earlier path around the circle in the same sense passes this angle, and is not longer."""
    for k in range(1, len(tried)):
        other, other_sense, start, length, free = tried[k]
        if other == circle and other_sense == sense:
            arc = (sense * (angle - start)) % _TURN
            if arc > _TURN - 1e-6:
                arc = 0.0
            if arc < free and length + reach * arc <= travelled + _ROUNDING:
                return True
    return False
