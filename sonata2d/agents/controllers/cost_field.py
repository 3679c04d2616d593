"""The cost of the cheapest path to the goal, on a grid over the room, for `social-planner`."""

from __future__ import annotations

import math

import numpy as np

from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.scalar import END_X, END_Y, RADIUS, START_X, START_Y, clipped, gap
from ...core.geometry import Barriers, inside_rings
from ...core.humans import X, Y
from ...core.portable_math import Array, BoolArray, IntArray, unit_vector
from ...core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ...core.relations import RELATION
from ...core.scene import Scene

CELL = 0.1  # m
_BLOCKED = 40.0  # price per metre where the robot does not fit; 1 is open ground
HIGHEST = 12.0  # of ground where it fits: 1, up to 2 more near walls, 5 near people, 4 between people who interact
_MAXIMUM_SWEEPS = 2000
_ACROSS = 0.2  # cosine of the angle against a one-way direction, up to which a move counts as one across it
_WAY_MARGIN = 0.4  # m, around a one-way area
_UNREACHED = 1e6  # initial cost of each cell
PRICE, VALUE, CLEARANCE = range(3)  # layers of a cost field


class CostField:
    """The cost of the cheapest path to the goal, on a grid over the room.

    A metre of open ground costs 1. The price per metre is higher near walls and furniture, in the intimate and personal
    space of standing people, between people who interact, and in areas with a speed limit. Cells in which the robot
    does not fit, or where it may not go, cost `_BLOCKED`; in one-way areas paths lead in the permitted direction.

    Args:
        scene: gives the room, furniture, standing people, interactions, goal, and the largest circle within the robot's
            outline.

    Attributes:
        low: (2,), m, world frame, position of the cell (0, 0).
        price: (NX, NY), cost per metre of each cell.
        value: (NX, NY), cost of the cheapest path from each cell to the goal, in metres of open ground.
        clearance: (NX, NY), m, from each cell to the nearest wall or piece of furniture, or area where the robot may
            not go; capped beyond the reach of the prices.
        speed_limits: (NX, NY), m/s, at which the robot still brakes in time for areas with a limit; (0, 0) without any.

    Source: eikonal equation |∇D| = price, first-order upwind differences (Sethian, PNAS 93 (1996) 1591), solved by
    Jacobi sweeps until nothing changes.
    """

    def __init__(self, scene: Scene) -> None:
        self.low, high = scene.outline.min(axis=0) - CELL, scene.outline.max(axis=0) + CELL
        nx, ny = (int(n) + 1 for n in (high - self.low) / CELL)
        self.layers = np.empty((3, nx, ny))
        self.price, self.value, self.clearance = self.layers[PRICE], self.layers[VALUE], self.layers[CLEARANCE]
        obstacles = scene.robot_barriers.table, scene.standing_humans.table, _interaction_spaces(scene).table
        goal = float(scene.goal.x), float(scene.goal.y)
        self.speed_limits, slowness = np.zeros((0, 0)), np.zeros((0, 0))
        forbidden: IntArray = np.zeros((0, 0), dtype=np.int64)
        if scene.areas:
            cells = self.low + CELL * np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), axis=-1)
            self.speed_limits, slowness = _limits(scene, cells)
            forbidden = _forbidden_moves(scene, cells)
        _fill_field(
            self.layers, self.low, scene.outline, *obstacles, slowness, forbidden,
            float(scene.robot.outline.inradius), *goal,
        )  # fmt: skip


def _limits(scene: Scene, cells: Array) -> tuple[Array, Array]:
    """Speeds at which the robot can brake in time for areas with a limit, m/s, and factors of the price; (NX, NY).

    Args:
        scene: its areas, and the limits of its robot.
        cells: (NX, NY, 2), m, positions of the cells.

    Returns:
        (0, 0) each without such areas.
    """
    limited = [(area, area.speed_limit) for area in scene.areas if area.speed_limit is not None]
    if not limited:
        return np.zeros((0, 0)), np.zeros((0, 0))
    speeds, slowness = np.full(cells.shape[:2], math.inf), np.ones(cells.shape[:2])
    points, acceleration = cells.reshape(-1, 2), scene.robot.limits.acceleration
    for area, limit in limited:
        is_inside = inside_rings(points, area.polygon, ())
        distance = np.where(is_inside, 0.0, Barriers.of(area.edges()).gaps(points).min(axis=0))
        braking = np.sqrt(limit * limit + 2.0 * acceleration * np.maximum(distance - CELL, 0.0))
        speeds = np.minimum(speeds, braking.reshape(speeds.shape))
        slower = max(scene.robot.top_speed / limit, 1.0)
        slowness = np.maximum(slowness, np.where(is_inside, slower, 1.0).reshape(speeds.shape))
    return speeds, slowness


def _forbidden_moves(scene: Scene, cells: Array) -> IntArray:
    """Moves that one-way areas forbid, (NX, NY) of int: bits for -x, +x, -y, +y; (0, 0) without such areas.

    Args:
        scene: its areas.
        cells: (NX, NY, 2), m, positions of the cells.
    """
    ways = [(area, area.one_way) for area in scene.areas if area.one_way is not None]
    if not ways:
        return np.zeros((0, 0), dtype=np.int64)
    forbidden = np.zeros(cells.shape[:2], dtype=np.int64)
    for area, heading in ways:
        c, s = unit_vector(heading)
        against = sum(1 << bit for bit, cosine in enumerate((-c, c, -s, s)) if cosine < -_ACROSS)
        points = cells.reshape(-1, 2)
        # paths keep a little away from the area, since the robot does not follow them exactly
        is_near = Barriers.of(area.edges()).gaps(points).min(axis=0) < _WAY_MARGIN
        is_inside = (inside_rings(points, area.polygon, ()) | is_near).reshape(forbidden.shape)
        forbidden |= np.where(is_inside, against, 0)
    return forbidden


def _interaction_spaces(scene: Scene) -> Barriers:
    """Lines of attention between standing people, and between people and objects, that others should not cross."""
    position = {h.id: h.pose.position for h in scene.humans} | {f.id: f.pose.position for f in scene.furniture}
    lines = ((i, RELATION[i.relation].line_radius) for i in scene.interactions)
    return Barriers.of((position[i.src], position[i.dst], radius) for i, radius in lines if radius)


@kernel
def _fill_field(
    layers: Array, low: Array, outline: Array, barriers: Array, standing: Array, between: Array, slowness: Array,
    forbidden: IntArray, radius: float, goal_x: float, goal_y: float,
) -> None:  # fmt: skip
    """Compute the layers of a cost field.

    Args:
        layers: (3, NX, NY), overwritten.
        low: (2,), m, position of the cell (0, 0).
        outline: (K, 2), m, polygon of the room.
        barriers, standing, between: (M, 8), tables of the solids, standing people and lines of attention.
        slowness: factors of the price, (NX, NY), or (0, 0).
        forbidden: see `_forbidden_moves`.
        radius: of the robot, m.
        goal_x, goal_y: m.
    """
    _, nx, ny = layers.shape
    reach = radius + PERSONAL_DISTANCE + 0.05  # m, to barriers that can change a price
    people, lines, inside = np.empty(ny), np.empty(ny), np.empty(ny, dtype=np.bool_)
    for i in range(nx):
        x = low[X] + CELL * i
        walls = layers[CLEARANCE, i]
        _nearest_gaps(barriers, x, low[Y], reach, walls)
        _nearest_gaps(standing, x, low[Y], reach, people)
        _nearest_gaps(between, x, low[Y], reach, lines)
        _inside_outline(outline, x, low[Y], inside)
        for j in range(ny):
            to_wall, to_person = walls[j] - radius, people[j] - radius
            price = 1.0 + 2.0 * max(1.0 - max(to_wall, 0.0) / 0.3, 0.0)
            price += 4.0 * max(1.0 - max(to_person, 0.0) / INTIMATE_DISTANCE, 0.0)
            price += 1.0 * max(1.0 - max(to_person, 0.0) / PERSONAL_DISTANCE, 0.0)
            price += 4.0 if lines[j] < radius else 0.0
            if len(slowness) > 0:
                price *= slowness[i, j]
            fits = inside[j] and to_wall >= 0.0 and to_person >= 0.02
            layers[PRICE, i, j] = min(price, _BLOCKED) if fits else _BLOCKED
    goal_i, goal_j = int((goal_x - low[X]) / CELL + 0.5), int((goal_y - low[Y]) / CELL + 0.5)
    solve(layers[PRICE], layers[VALUE], forbidden, goal_i, goal_j)


@subroutine
def _nearest_gaps(barriers: Array, x: float, low: float, reach: float, gaps: Array) -> None:
    """Distance from the cells of a column of the grid to the nearest barrier, at most `reach`; (NY,), m.

    Args:
        barriers: (M, 8).
        x, low: m, position of the first cell.
        reach: m.
        gaps: (NY,), overwritten.
    """
    count = len(gaps)
    for j in range(count):
        gaps[j] = reach
    for k in range(len(barriers)):
        margin = reach + barriers[k, RADIUS]
        if max(barriers[k, START_X], barriers[k, END_X]) + margin < x:
            continue
        if min(barriers[k, START_X], barriers[k, END_X]) - margin > x:
            continue
        first = (min(barriers[k, START_Y], barriers[k, END_Y]) - margin - low) / CELL
        last = (max(barriers[k, START_Y], barriers[k, END_Y]) + margin - low) / CELL
        for j in range(int(clipped(first, 0.0, count)), int(clipped(last + 1.0, 0.0, count))):
            gaps[j] = min(gaps[j], gap(barriers, k, x, low + CELL * j))


@subroutine
def _inside_outline(outline: Array, x: float, low: float, inside: BoolArray) -> None:
    """Whether the cells of a column of the grid lie in a polygon (even-odd rule).

    Args:
        outline: (K, 2), m.
        x, low: m, position of the first cell.
        inside: (NY,), overwritten.
    """
    for j in range(len(inside)):
        inside[j] = False
    for k in range(len(outline)):
        ax, ay, bx, by = outline[k - 1, X], outline[k - 1, Y], outline[k, X], outline[k, Y]
        for j in range(len(inside)):
            y = low + CELL * j
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside[j] = not inside[j]


@subroutine
def grid_coordinate(x: float, low: float, count: int) -> float:
    """Fractional index of a coordinate in a grid of `count` cells, limited to the grid."""
    return min(max((x - low) / CELL, 0.0), count - 1.001)


@subroutine
def interpolated(grid: Array, u: float, v: float) -> float:
    """Bilinear interpolation of a grid, (NX, NY), at fractional indices."""
    i, j = int(u), int(v)
    u, v = u - i, v - j
    near = grid[i, j] * (1.0 - v) + grid[i, j + 1] * v
    far = grid[i + 1, j] * (1.0 - v) + grid[i + 1, j + 1] * v
    return float(near * (1.0 - u) + far * u)


@subroutine
def solve(price: Array, value: Array, forbidden: IntArray, goal_i: int, goal_j: int) -> None:
    """Solve the eikonal equation by Jacobi sweeps.

    A sweep visits only cells next to one that changed in the last sweep; the others would not change.

    Args:
        price: (NX, NY), per metre.
        value: (NX, NY), overwritten.
        forbidden: (NX, NY) of int, bits of the moves that no path makes from a cell: to -x, +x, -y, +y; (0, 0): none.
        goal_i, goal_j: the goal's cell.
    """
    nx, ny = price.shape
    width = ny + 2  # with a margin, so that each cell has four neighbours
    size = (nx + 2) * width
    cost, step, queued = np.empty(size), np.empty(size), np.empty(size, dtype=np.int64)
    for cell in range(size):
        cost[cell], queued[cell] = _UNREACHED, _MAXIMUM_SWEEPS + 1  # `queued`: the last sweep that visits a cell
    for i in range(nx):
        for j in range(ny):
            cell = (i + 1) * width + j + 1
            step[cell], queued[cell] = price[i, j] * CELL, -1
    queue, changed, costs = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64), np.empty(size)
    # A goal outside of the grid counts as one at its margin.
    changed[0] = min(max(goal_i + 1, 0), nx + 1) * width + min(max(goal_j + 1, 0), ny + 1)
    costs[0], count = 0.0, 1
    for sweep in range(_MAXIMUM_SWEEPS + 1):
        length = 0
        for k in range(count):
            cost[changed[k]] = costs[k]
            for neighbour in (changed[k] - width, changed[k] - 1, changed[k] + 1, changed[k] + width):
                # Costs fall along a path to the goal: a neighbour that costs less does not change.
                if 0 <= neighbour < size and queued[neighbour] < sweep and cost[neighbour] > costs[k] - 1e-6:
                    queued[neighbour] = sweep
                    queue[length] = neighbour
                    length += 1
        count = 0
        for k in range(length):
            cell = queue[k]
            a, b = min(cost[cell - width], cost[cell + width]), min(cost[cell - 1], cost[cell + 1])
            if len(forbidden) > 0:
                moves = forbidden[min(max(cell // width - 1, 0), nx - 1), min(max(cell % width - 1, 0), ny - 1)]
                a = min(
                    _UNREACHED if moves & 1 else cost[cell - width], _UNREACHED if moves & 2 else cost[cell + width]
                )
                b = min(_UNREACHED if moves & 4 else cost[cell - 1], _UNREACHED if moves & 8 else cost[cell + 1])
            difference = a - b
            if abs(difference) >= step[cell]:  # a front that comes along one axis: the one-sided difference
                updated = min(a, b) + step[cell]
            else:
                square = 2.0 * step[cell] * step[cell] - difference * difference
                updated = (a + b + math.sqrt(max(square, 0.0))) * 0.5
            if updated < cost[cell]:
                changed[count], costs[count] = cell, updated
                count += 1
        if count == 0:
            break
    for i in range(nx):
        for j in range(ny):
            value[i, j] = cost[(i + 1) * width + j + 1]
