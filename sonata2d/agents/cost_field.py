"""How far it is to the goal from anywhere, over ground that costs more where a robot is unwelcome."""

from __future__ import annotations

import numpy as np

from ..entities import TALKING, WALKING_TOGETHER
from ..exact import Array
from ..geometry import Barriers, inside_polygon
from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..scene import Scene

CELL = 0.1  # m
BLOCKED = 40.0  # times the price of open ground
_SWEEPS = 2000


class CostField:
    """The price of the cheapest way to the goal, on a grid over the room.

    The price of ground is 1 a metre; more close to walls and furniture, in standing people's personal space and
    between those who interact; and out of reach where the robot does not fit.

    Args:
        scene: room, furniture, standing people, interactions, goal, robot's radius.

    Source: eikonal equation |∇D| = price, first-order upwind differences (Sethian, PNAS 93 (1996) 1591), solved by
    Jacobi sweeps until nothing changes.
    """

    def __init__(self, scene: Scene) -> None:
        low, high = scene.outline.min(axis=0) - CELL, scene.outline.max(axis=0) + CELL
        self._low = low
        nx, ny = (int(n) + 1 for n in (high - low) / CELL)
        x, y = low[0] + CELL * np.arange(nx), low[1] + CELL * np.arange(ny)
        points = np.stack((np.repeat(x, ny), np.tile(y, nx)), axis=1)
        self.price = _price(scene, points).reshape(nx, ny)
        self.value = self._solved(scene.goal.position)

    def at(self, x: Array, y: Array) -> Array:
        """Price of the way to the goal from points, m of open ground; any shape."""
        return self._between_cells(self.value, x, y)

    def surcharge(self, x: Array, y: Array) -> Array:
        """What a metre costs at points beyond a metre of open ground; any shape."""
        return self._between_cells(self.price, x, y) - 1.0

    def _between_cells(self, values: Array, x: Array, y: Array) -> Array:
        """Bilinear interpolation on the grid."""
        nx, ny = values.shape
        u = np.minimum(np.maximum((x - self._low[0]) / CELL, 0.0), nx - 1.001)
        v = np.minimum(np.maximum((y - self._low[1]) / CELL, 0.0), ny - 1.001)
        i, j = u.astype(np.intp), v.astype(np.intp)
        u, v = u - i, v - j
        flat, base = values.ravel(), i * ny + j
        near = flat[base] * (1.0 - v) + flat[base + 1] * v
        far = flat[base + ny] * (1.0 - v) + flat[base + ny + 1] * v
        values_there: Array = near * (1.0 - u) + far * u
        return values_there

    def _solved(self, goal: tuple[float, float]) -> Array:
        nx, ny = self.price.shape
        step = self.price * CELL
        value = np.full((nx + 2, ny + 2), 1e6)  # with a rim, so that each cell has four neighbours
        i, j = (int((goal[k] - self._low[k]) / CELL + 0.5) + 1 for k in (0, 1))
        inner = value[1:-1, 1:-1]
        for _ in range(_SWEEPS):
            value[i, j] = 0.0
            a = np.minimum(value[:-2, 1:-1], value[2:, 1:-1])
            b = np.minimum(value[1:-1, :-2], value[1:-1, 2:])
            apart = a - b
            both = (a + b + np.sqrt(np.maximum(2.0 * step * step - apart * apart, 0.0))) * 0.5
            fresh = np.where(np.abs(apart) >= step, np.minimum(a, b) + step, both)
            fresh = np.minimum(fresh, inner)
            if np.array_equal(fresh, inner):
                break
            inner[:] = fresh
        value[i, j] = 0.0
        return inner.copy()


def _price(scene: Scene, points: Array) -> Array:
    """(P,), price of a metre at each point."""
    radius = scene.robot.radius
    price = np.ones(len(points))
    if len(scene.barriers):
        gap = scene.barriers.gaps(points).min(axis=0) - radius
        price += 2.0 * np.maximum(1.0 - np.maximum(gap, 0.0) / 0.3, 0.0)
        price = np.where(gap < -0.01, BLOCKED, price)
    price = np.where(inside_polygon(points, scene.outline), price, BLOCKED)
    if len(scene.standing):
        gaps = scene.standing.gaps(points) - radius
        price += (4.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / INTIMATE_DISTANCE, 0.0)).max(axis=0)
        price += (1.0 * np.maximum(1.0 - np.maximum(gaps, 0.0) / PERSONAL_DISTANCE, 0.0)).max(axis=0)
        price = np.where(gaps.min(axis=0) < 0.02, BLOCKED, price)
    between = interaction_spaces(scene)
    if len(between):
        price += np.where(between.gaps(points).min(axis=0) < radius, 4.0, 0.0)
    return np.minimum(price, BLOCKED)


def interaction_spaces(scene: Scene) -> Barriers:
    """The lines of attention between standing people, and between people and things, that nobody should cut."""
    place = {h.id: h.pose.position for h in scene.humans} | {f.id: f.pose.position for f in scene.furniture}
    ties = [tie for tie in scene.interactions if tie.relation != WALKING_TOGETHER]
    return Barriers.of((place[t.src], place[t.dst], 0.15 if t.relation == TALKING else 0.05) for t in ties)
