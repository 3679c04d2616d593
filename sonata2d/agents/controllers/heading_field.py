"""The cost of the cheapest motion to the goal for a robot that is no disc: over positions and headings."""

from __future__ import annotations

import heapq
import math

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import angle_of, gap, unit_vector
from ...core.entities import ANY_HEADING
from ...core.humans import X, Y
from ...core.portable_math import PI, Array, BoolArray
from ...core.scene import Scene
from ...core.separation import SEPARATION_SIZE, gap_to_barrier
from ...core.vectors import wrap_angle
from .cost_field import CELL, CLEARANCE, PRICE, CostField

HEADINGS = 16
UNREACHED = 1e6
_BETWEEN = (0.0, 0.3, -0.3)  # bins, headings that are tried for each one
_MARGIN, _TURN_MARGIN = 0.02, 0.04  # m, gap to barriers of a robot that drives straight, and of one that turns
_TURN_COST = 0.3  # m of open ground per rad
_BACK = 2.0  # price of driving back, over the price ahead
_BLOCKED = 2.0  # m of open ground, that a pose costs more if all poses around it are blocked
_TIGHT = 4.0  # price of ground on which the robot cannot turn on the spot
# Cells of a motion ahead with each heading
_STEPS = np.array([
    (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1),
    (-1, 0), (-2, -1), (-1, -1), (-1, -2), (0, -1), (1, -2), (1, -1), (2, -1),
])  # fmt: skip


def heading_field(scene: Scene, field: CostField) -> Array:
    """Cost of the cheapest motion to the goal, (HEADINGS, NX, NY), in metres of open ground.

    The robot moves ahead or back along its heading, where the outline fits with the heading of the bin or with one that
    differs by a third of a bin; and turns on the spot, where it fits with all of these.

    Args:
        scene: its robot, goal, walls, furniture and standing people are used.
        field: of the scene, with the prices of the ground.

    Source: lattice of poses; Latombe, Robot Motion Planning (1991), chapter 7; Dijkstra, Numer. Math. 1 (1959) 269.
    """
    outline, goal = scene.robot.outline, scene.goal
    barriers = scene.robot_barriers.joined(scene.standing_humans).table.copy()
    _, nx, ny = field.layers.shape
    values = np.full((HEADINGS, nx, ny), UNREACHED)
    tolerance = goal.angle if goal.angle < ANY_HEADING else 4.0
    turns = np.abs([wrap_angle(2.0 * PI * h / HEADINGS - goal.theta) for h in range(HEADINGS)])
    is_goal = turns <= max(tolerance, PI / HEADINGS)
    sizes = outline.inradius, outline.circumradius, outline.rounding
    target = goal.x, goal.y, max(goal.distance - CELL, 0.5 * CELL)
    _fill(values, field.layers, field.low, np.array(outline.core), barriers, is_goal, *map(float, (*sizes, *target)))
    return values


@kernel
def _fill(
    values: Array, layers: Array, low: Array, core: Array, barriers: Array, is_goal: BoolArray,
    inradius: float, circumradius: float, rounding: float, goal_x: float, goal_y: float, distance: float,
) -> None:  # fmt: skip
    """Fill the values of a field.

    Args:
        values: (HEADINGS, NX, NY), unreached; is filled.
        layers, low: of the `CostField`.
        core, inradius, circumradius, rounding: of the robot's outline, m.
        barriers: (M, 8), what it must not touch.
        is_goal: (HEADINGS,), headings with which the goal may be reached.
        goal_x, goal_y, distance: the goal, and the distance at which it is reached, m.
    """
    _, nx, ny = layers.shape
    is_free, turns = np.zeros((HEADINGS, nx, ny), dtype=np.bool_), np.zeros((HEADINGS, nx, ny), dtype=np.bool_)
    corners, found = core.copy(), np.empty(SEPARATION_SIZE)
    for i in range(nx):
        for j in range(ny):
            x, y = low[X] + CELL * i, low[Y] + CELL * j
            nearest = layers[CLEARANCE, i, j]
            for k in range(len(barriers)):
                nearest = min(nearest, gap(barriers, k, x, y))
            for h in range(HEADINGS if nearest > inradius + _MARGIN else 0):
                is_free[h, i, j] = turns[h, i, j] = True
                if nearest < circumradius + _TURN_MARGIN:
                    gaps = _gaps(core, rounding, circumradius, barriers, x, y, h, corners, found)
                    is_free[h, i, j], turns[h, i, j] = gaps[1] > _MARGIN, gaps[0] > _TURN_MARGIN
    waiting = [(0.0, 0)]
    waiting.pop()
    for i in range(nx):
        for j in range(ny):
            dx, dy = low[X] + CELL * i - goal_x, low[Y] + CELL * j - goal_y
            for h in range(HEADINGS if dx * dx + dy * dy <= distance * distance else 0):
                if is_free[h, i, j] and is_goal[h]:
                    values[h, i, j] = 0.0
                    heapq.heappush(waiting, (0.0, (h * nx + i) * ny + j))
    turn = _TURN_COST * 2.0 * PI / HEADINGS
    while len(waiting) > 0:
        value, state = heapq.heappop(waiting)
        h, i, j = state // (nx * ny), state // ny % nx, state % ny
        if value > values[h, i, j]:
            continue
        for move in range(4):  # the poses before: behind, ahead, turned to either side
            sign = 1 - 2 * move if move < 2 else 0
            a, b = i - sign * _STEPS[h, X], j - sign * _STEPS[h, Y]
            g = h if move < 2 else (h + 2 * move - 5) % HEADINGS
            if not (0 <= a < nx and 0 <= b < ny) or not is_free[g, a, b]:
                continue
            if move >= 2 and not (turns[h, i, j] and turns[g, a, b]):
                continue
            cost = turn
            if move < 2:
                size = CELL * math.sqrt(_STEPS[h, X] * _STEPS[h, X] + _STEPS[h, Y] * _STEPS[h, Y])
                cost = size * 0.5 * (layers[PRICE, i, j] + layers[PRICE, a, b]) * (1.0 if move == 0 else _BACK)
                cost *= 1.0 if turns[h, i, j] and turns[h, a, b] else _TIGHT
            if value + cost < values[g, a, b]:
                values[g, a, b] = value + cost
                heapq.heappush(waiting, (value + cost, (g * nx + a) * ny + b))


@subroutine
def _gaps(
    core: Array, rounding: float, circumradius: float, barriers: Array, x: float, y: float, h: int, corners: Array,
    found: Array,
) -> tuple[float, float]:  # fmt: skip
    """Least and largest gap of an outline at a place to the barriers, over the headings that are tried for bin h, m."""
    least, largest = math.inf, -math.inf
    for part in _BETWEEN:
        c, s = unit_vector(2.0 * PI * (h + part) / HEADINGS)
        nearest = math.inf
        for k in range(len(barriers)):
            if gap(barriers, k, x, y) < circumradius + _TURN_MARGIN:
                nearest = min(nearest, gap_to_barrier(core, rounding, x, y, c, s, corners, found, barriers, k))
        least, largest = min(least, nearest), max(largest, nearest)
    return least, largest


@subroutine
def heading_cost(values: Array, u: float, v: float, c: float, s: float) -> float:
    """Cost at fractional indices of the grid and a heading, cosine and sine: the mean of the poses around it.

    Poses that were not reached add to it by their share; without others, it is `UNREACHED`.
    """
    w = angle_of(s, c) * (HEADINGS / (2.0 * PI))
    w = w if w >= 0.0 else w + HEADINGS
    h, i, j = int(w), int(u), int(v)
    total, weights = 0.0, 0.0
    for corner in range(8):
        dh, di, dj = corner // 4, corner // 2 % 2, corner % 2
        weight = (w - h if dh == 1 else 1.0 - (w - h)) * (u - i if di == 1 else 1.0 - (u - i))
        weight *= v - j if dj == 1 else 1.0 - (v - j)
        value = values[(h + dh) % HEADINGS, i + di, j + dj]
        if value < UNREACHED and weight > 0.0:
            total, weights = total + weight * value, weights + weight
    return total / weights + _BLOCKED * (1.0 - weights) if weights > 0.0 else UNREACHED
