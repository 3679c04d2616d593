"""`orca2011`: optimal reciprocal collision avoidance (van den Berg et al., 2011).

Arrays of half-planes have a row (a, b, c) for each.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import unpack
from ....core.compiled.scalar import RADIUS, Vector, clipped, length, towards
from ....core.portable_math import Array, BoolArray
from .base import KernelModel, Walkers, attention_to, biased_direction

HalfPlane = tuple[float, float, float]  # a, b, c of a x + b y >= c, m/s

_PARALLEL = 1e-9
_FAR = 1e6  # m/s: the velocity nearest to a point this far off is the extreme one in that direction


@subroutine
def choose_velocity(planes: Array, hard: int, preferred: Vector, maximum_speed: float, scratch: Array) -> Vector:
    """The permitted velocity nearest to the preferred one.

    If not all constraints can be satisfied, the velocity that minimises the worst violation of the soft ones.

    Args:
        planes: (P, 3), half-planes, m/s: first the hard ones, which are satisfied first, then the soft ones, which have
            unit normals and are satisfied if possible.
        hard: how many are hard.
        preferred: m/s.
        maximum_speed: m/s.
        scratch: (P, 3) at least, overwritten.

    Returns:
        Velocity, m/s. If even the hard constraints conflict, it satisfies those that come first.
    """
    x, y, satisfied = nearest_velocity(planes, preferred, maximum_speed)
    if satisfied < len(planes):
        return _minimise_violation(planes, hard, (x, y), max(satisfied, hard), maximum_speed, scratch)
    return x, y


@subroutine
def nearest_velocity(planes: Array, preferred: Vector, maximum_speed: float) -> tuple[float, float, int]:
    """The velocity nearest to the preferred one within half-planes and the maximum speed.

    Args:
        planes: (P, 3), half-planes, m/s.
        preferred: m/s.
        maximum_speed: m/s.

    Returns:
        The velocity (x, y), m/s, and how many of the half-planes, from the first on, can be satisfied together.
    """
    size = length(preferred[0], preferred[1])
    scale = maximum_speed / size if size > maximum_speed else 1.0
    x, y = preferred[0] * scale, preferred[1] * scale
    for k in range(len(planes)):
        if not planes[k, 0] * x + planes[k, 1] * y >= planes[k, 2]:
            is_possible, edge_x, edge_y = _nearest_on_edge(planes, k, preferred, maximum_speed)
            if not is_possible:
                return x, y, k
            x, y = edge_x, edge_y
    return x, y, len(planes)


@subroutine
def _nearest_on_edge(planes: Array, k: int, preferred: Vector, maximum_speed: float) -> tuple[bool, float, float]:
    """The nearest velocity on the edge of half-plane k that satisfies all earlier ones: whether there is one, x, y."""
    a, b, c = planes[k, 0], planes[k, 1], planes[k, 2]
    size = length(a, b)
    a, b, c = a / size, b / size, c / size
    square = maximum_speed * maximum_speed - c * c
    if square < 0.0:  # the edge lies outside the disc of permitted speeds
        return False, 0.0, 0.0
    high = math.sqrt(square)
    low = -high  # the edge is (a, b) c + (b, -a) t, low <= t <= high
    for j in range(k):
        e, f, g = planes[j, 0], planes[j, 1], planes[j, 2]
        slope, deficit = e * b - f * a, g - c * (e * a + f * b)
        if abs(slope) <= _PARALLEL:
            if deficit > _PARALLEL:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, deficit / slope)
        else:
            high = min(high, deficit / slope)
        if low > high:
            return False, 0.0, 0.0
    t = clipped(preferred[0] * b - preferred[1] * a, low, high)
    return True, a * c + b * t, b * c - a * t


@subroutine
def _minimise_violation(
    planes: Array, hard: int, start: Vector, first: int, maximum_speed: float, scratch: Array
) -> Vector:
    """The velocity that minimises the worst violation of the soft half-planes.

    Solves for the velocity v and the violation d, n·v + d >= c: a linear program in three dimensions. A half-plane that
    is violated by more than the current d holds with equality at the new optimum. This leaves a program in two
    dimensions: go as far as possible along its normal while no earlier half-plane is violated by more.

    Args:
        planes, hard, maximum_speed, scratch: as in `choose_velocity`.
        start: initial velocity, m/s, which satisfies the soft half-planes before `first`.
        first: index of the first soft half-plane to process.
    """
    x, y, violation = start[0], start[1], 0.0
    for j in range(hard):
        scratch[j, 0], scratch[j, 1], scratch[j, 2] = planes[j, 0], planes[j, 1], planes[j, 2]
    for k in range(first, len(planes)):
        a, b, c = planes[k, 0], planes[k, 1], planes[k, 2]
        if c - (a * x + b * y) <= violation:
            continue
        count = hard
        for j in range(hard, k):  # the velocities at which half-plane j is violated by no more than half-plane k
            e, f = planes[j, 0] - a, planes[j, 1] - b
            if abs(e) + abs(f) > _PARALLEL:
                scratch[count, 0], scratch[count, 1], scratch[count, 2] = e, f, planes[j, 2] - c
                count += 1
        found_x, found_y, satisfied = nearest_velocity(scratch[:count], (a * _FAR, b * _FAR), maximum_speed)
        if satisfied == count:  # otherwise a rounding error: keep the current velocity
            x, y = found_x, found_y
        violation = max(violation, c - (a * x + b * y))
    return x, y


_TINY = 1e-9


class Orca2011(NamedTuple):
    """Parameters. The authors leave them to the user; these are common values for people.

    Source: van den Berg, Guy, Lin & Manocha, "Reciprocal n-body collision avoidance", Robotics Research (ISRR 2009),
    STAR 70, Springer (2011) 3.
    """

    horizon: float = 2.0  # τ, s, to other agents
    wall_horizon: float = 1.0  # s, to walls and furniture
    maximum_speed_ratio: float = 1.3  # v_max / desired speed


PARAMETERS = Orca2011()


@subroutine
def reciprocal_half_plane(
    px: float, py: float, velocity: Vector, other_velocity: Vector, r: float, evasion: float, horizon: float, dt: float
) -> HalfPlane:
    """The velocities with which an agent avoids another one if both take on their parts of the evasion.

    Args:
        px, py: vector to the other agent, m.
        velocity, other_velocity: of the two agents, m/s.
        r: distance of centres at contact, m.
        evasion: the part of the evasion that the agent takes on: 1/2, or 1; less if it attends less to the other.
        horizon: time for which the velocity must be free of collisions, s.
        dt: time within which overlapping agents must separate, s.

    Returns:
        Half-plane (a, b, c) with a unit normal, m/s; with a shorter normal for agents at the same position.

    Source: van den Berg et al. (2011), section 4: u is the smallest change of the relative velocity that leaves the
    velocity obstacle VO^τ, n its outward normal there; v >= v_A + u/2 along n.
    """
    vx, vy = velocity[0] - other_velocity[0], velocity[1] - other_velocity[1]
    square = px * px + py * py
    leg = math.sqrt(max(square - r * r, 0.0))  # length of the cone's tangent; 0 for overlapping agents
    side = 1.0 if px * vy - py * vx > 0.0 else -1.0  # the nearer leg of the cone: +1 the left one
    safe_square = max(square, _TINY)
    lx, ly = (px * leg - side * py * r) / safe_square, (py * leg + side * px * r) / safe_square  # along that leg
    if leg > 0.0 and (vx * lx + vy * ly) * horizon >= leg:
        nx, ny = -side * ly, side * lx
        change = -(vx * nx + vy * ny)  # u · n
    else:
        nx, ny, change = _change_to_leave_disc(px, py, vx, vy, r, horizon if leg > 0.0 else dt)
    return nx, ny, nx * velocity[0] + ny * velocity[1] + evasion * change


@subroutine
def _change_to_leave_disc(
    px: float, py: float, vx: float, vy: float, r: float, time: float
) -> tuple[float, float, float]:
    """Normal and size of the change of velocity that leaves the disc of velocities colliding exactly at `time`."""
    wx, wy = vx - px / time, vy - py / time
    size = length(wx, wy)
    if size <= _TINY:  # the centre, where every normal is equally near: go straight back
        wx, wy = -px, -py
    distance = max(length(wx, wy), _TINY)
    return wx / distance, wy / distance, r / time - size


@subroutine
def wall_half_plane(barriers: Array, k: int, x: float, y: float, radius: float, horizon: float, dt: float) -> HalfPlane:
    """The velocities with which an agent avoids a wall or an edge of furniture.

    Args:
        barriers: (B, 8), rows of `Barriers.table`.
        k: row of the barrier.
        x, y: position, m.
        radius: m.
        horizon: time for which the velocity must be free of collisions, s.
        dt: time within which an agent that overlaps a wall must leave it, s.

    Returns:
        Half-plane (a, b, c), m/s, with the normal (0, 0) for an agent on the core line. Standing still is always
        permitted, except to agents that overlap a wall.

    Source: van den Berg et al. (2011), static obstacles: the optimisation velocity is 0, whose nearest point of the
    obstacle in velocity space is the obstacle's nearest point over the horizon.
    """
    wall_x, wall_y = towards(barriers, k, x, y)
    d = length(wall_x, wall_y)
    if d <= _TINY:
        return 0.0, 0.0, 0.0
    gap = d - barriers[k, RADIUS] - radius
    return -wall_x / d, -wall_y / d, -gap / (horizon if gap > 0.0 else dt)


@subroutine
def _restricts(plane: HalfPlane, maximum_speed: float) -> bool:
    """Whether a half-plane has a normal, and a velocity up to the maximum speed can violate it."""
    a, b, c = plane
    return a * a + b * b > 0.5 and c > -maximum_speed


@subroutine
def _is_walking(walkers: Walkers, i: int) -> bool:
    """Whether an agent has a desired velocity, so that it evades others."""
    x, y = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
    return bool((x != 0.0 or y != 0.0) and walkers.desired_speed[i] > 0.0)


@subroutine
def _half_planes(
    walkers: Walkers, i: int, barriers: Array, evades: BoolArray, parameters: Orca2011, dt: float, planes: Array
) -> tuple[int, int]:
    """The half-planes of an agent, into `planes` (B + M, 3): walls and furniture, then agents.

    Args:
        walkers: all agents.
        i: index of the agent.
        barriers: (B, 8), rows of `Barriers.table`.
        evades: (M,), the agents that evade those that they attend to.
        parameters: of the model.
        dt: tick, s.
        planes: overwritten; without those that every velocity up to the maximum speed satisfies.

    Returns:
        The number of half-planes of walls and furniture, and of all.
    """
    p, position, velocity, radius = parameters, walkers.position, walkers.velocity, walkers.radius
    shoulder = walkers.shoulder
    own_radius = radius[i] + abs(shoulder[i])  # the agents are discs around the bodies
    maximum_speed = p.maximum_speed_ratio * walkers.desired_speed[i]
    x, y, own_velocity = position[i, 0], position[i, 1], (velocity[i, 0], velocity[i, 1])
    hard = 0
    for n in range(walkers.wall_start[i], walkers.wall_start[i + 1]):
        plane = wall_half_plane(barriers, walkers.wall[n], x, y, own_radius, p.wall_horizon, dt)
        if _restricts(plane, maximum_speed):
            planes[hard, 0], planes[hard, 1], planes[hard, 2] = plane
            hard += 1
    count = hard
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j, attention = walkers.neighbour[n], walkers.attention[n]
        if attention > 0.0:
            evasion = (0.5 if evades[j] and attention_to(walkers, j, i) > 0.0 else 1.0) * attention
            plane = reciprocal_half_plane(
                position[j, 0] - x, position[j, 1] - y, own_velocity, (velocity[j, 0], velocity[j, 1]),
                radius[j] + abs(shoulder[j]) + own_radius, evasion, p.horizon, dt,
            )  # fmt: skip
            if _restricts(plane, maximum_speed):
                planes[count, 0], planes[count, 1], planes[count, 2] = plane
                count += 1
    return hard, count


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations that reach the chosen velocities within dt, into `acceleration` (M, 2), m/s^2.

    Zero for the agents that do not walk.
    """
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Orca2011)
    count, capacity = len(walkers.position), len(barriers) + len(walkers.position)
    planes, scratch, evades = np.empty((capacity, 3)), np.empty((capacity, 3)), np.empty(count, np.bool_)
    for i in range(count):
        evades[i] = _is_walking(walkers, i)
    for i in range(count):
        if not walkers.walks[i]:
            continue
        x, y = 0.0, 0.0
        if evades[i]:
            hard, total = _half_planes(walkers, i, barriers, evades, parameters, dt, planes)
            speed = walkers.desired_speed[i]
            ex, ey = biased_direction(walkers.desired_direction[i, 0], walkers.desired_direction[i, 1], side)
            maximum_speed = parameters.maximum_speed_ratio * speed
            x, y = choose_velocity(planes[:total], hard, (ex * speed, ey * speed), maximum_speed, scratch)
        acceleration[i, 0] = (x - walkers.velocity[i, 0]) / dt
        acceleration[i, 1] = (y - walkers.velocity[i, 1]) / dt


class Orca2011Model(KernelModel):
    """Each agent takes the velocity nearest to its desired one that is free of collisions for a while.

    Groups are ignored. Agents that stand (as the robot does, for the crowd) or do not attend to another agent do not
    evade it; the other one does the whole evasion.

    Source: van den Berg, Guy, Lin & Manocha, Robotics Research, STAR 70, Springer (2011) 3.
    """

    parameters, kernel = PARAMETERS, staticmethod(_accelerations)
