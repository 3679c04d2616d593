"""Grid map of a robot with a laser scanner and odometry, and the way to the goal on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.portable_math import Array, BoolArray
from ...core.vectors import X, Y
from .cost_field import CELL, grid_coordinate, interpolated, solve

_MARGIN = 8.0  # m, of the grid beyond start and goal
_HIT, _PASSED = 1.0, 0.6  # evidence that a scan adds to cells in which rays end, and takes from those that they cross
_OCCUPIED, _CERTAIN = 0.9, 4.0  # evidence above which a cell counts as occupied, and largest evidence
_BLOCKED, _NEAR_PRICE, _NEAR = 60.0, 3.0, 0.35  # prices of cells; m, beyond the robot, where they are dear


class LocalMap(NamedTuple):
    """A grid in the frame of the odometry.

    Attributes:
        low: (2,), m, position of the cell (0, 0).
        evidence: (NX, NY), that a cell is occupied.
        price, value: (NX, NY), cost per metre of each cell, and cost of the cheapest path from it to the goal, m.
    """

    low: Array
    evidence: Array
    price: Array
    value: Array


def local_map(start: tuple[float, float], goal: tuple[float, float]) -> LocalMap:
    """An empty grid around start and goal, m."""
    low = np.minimum(start, goal) - _MARGIN
    nx, ny = (math.ceil(side / CELL) + 1 for side in (np.maximum(start, goal) + _MARGIN - low).tolist())
    return LocalMap(np.asarray(low, dtype=float), np.zeros((nx, ny)), np.ones((nx, ny)), np.zeros((nx, ny)))


@kernel
def add_scan(low: Array, evidence: Array, x: float, y: float, ends: Array, is_hit: BoolArray) -> None:
    """Add the evidence of a scan.

    Args:
        low, evidence: see `LocalMap`; the evidence is updated.
        x, y: where the rays begin, m.
        ends: (R, 2), where they end, m.
        is_hit: (R,), whether they end at something.
    """
    nx, ny = evidence.shape
    for r in range(len(ends)):
        dx, dy = ends[r, X] - x, ends[r, Y] - y
        size = math.sqrt(dx * dx + dy * dy)
        steps = int(size / (0.7 * CELL))
        last_i, last_j = -1, -1
        end_i, end_j = int((ends[r, X] - low[X]) / CELL + 0.5), int((ends[r, Y] - low[Y]) / CELL + 0.5)
        for k in range(steps):
            part = k / max(steps, 1)
            i, j = int((x + part * dx - low[X]) / CELL + 0.5), int((y + part * dy - low[Y]) / CELL + 0.5)
            if (i != last_i or j != last_j) and (i != end_i or j != end_j) and 0 <= i < nx and 0 <= j < ny:
                evidence[i, j] = max(evidence[i, j] - _PASSED, 0.0)
            last_i, last_j = i, j
        if is_hit[r] and 0 <= end_i < nx and 0 <= end_j < ny:
            evidence[end_i, end_j] = min(evidence[end_i, end_j] + _HIT, _CERTAIN)


@kernel
def find_way(low: Array, evidence: Array, price: Array, value: Array, radius: float, x: float, y: float) -> None:
    """Fill the prices and the values of a map for a robot of a radius, m, and a goal at (x, y), m."""
    nx, ny = evidence.shape
    reach = int((radius + _NEAR) / CELL) + 1
    nearest = np.full((nx, ny), 1e9)  # squared distance from the nearest occupied cell, in cells
    for i in range(nx):
        for j in range(ny):
            if evidence[i, j] > _OCCUPIED:
                for a in range(max(i - reach, 0), min(i + reach + 1, nx)):
                    for b in range(max(j - reach, 0), min(j + reach + 1, ny)):
                        nearest[a, b] = min(nearest[a, b], (a - i) * (a - i) + (b - j) * (b - j))
    for i in range(nx):
        for j in range(ny):
            gap = CELL * math.sqrt(nearest[i, j]) - radius
            price[i, j] = _BLOCKED if gap < 0.0 else 1.0 + _NEAR_PRICE * max(1.0 - gap / _NEAR, 0.0)
    forbidden = np.zeros((0, 0), dtype=np.int64)
    solve(price, value, forbidden, int((x - low[X]) / CELL + 0.5), int((y - low[Y]) / CELL + 0.5))


@subroutine
def value_at(low: Array, value: Array, x: float, y: float) -> float:
    """Cost of the cheapest path to the goal from a point, m: bilinear interpolation."""
    nx, ny = value.shape
    return interpolated(value, grid_coordinate(x, low[X], nx), grid_coordinate(y, low[Y], ny))
