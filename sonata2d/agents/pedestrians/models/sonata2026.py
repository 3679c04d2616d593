"""`sonata2026`: the default pedestrian model, calibrated on recorded pedestrians; formulas are in `docs/models.md`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ....core.compiled import kernel, subroutine
from ....core.packing import pack, unpack
from ....core.portable_math import PI, Array, unit_vectors
from ....core.scalar import Vector, clipped, exp, length
from ....core.scene import Scene
from .base import KernelModel, Walkers, offset_of_group, wall_acceleration


class Sonata2026(NamedTuple):
    """Parameters, found by `benchmarks/calibrate.py` and set by hand; `docs/models.md` says which.

    Attributes:
        relaxation_time: time constant of the speed of a pedestrian that walks freely, s.
        following_time: of the speed of a pedestrian that others slow down to `FOLLOWING_FRACTION` of its desired speed
            or less, s.
        starting_time: of the speed of a pedestrian that hardly moves, s.
        turning_time: of the velocity component across the path, s.
        headway_half_width: half the width of the strip ahead in which others count, m.
        standstill_gap: gap at which the permitted speed is 0, m; below 0, bodies would touch first.
        time_gap: time in which the gap beyond `standstill_gap` would be walked, s.
        temperature: difference of values at which the weight of a direction falls to 1/e, m/s.
        habit_bonus: additional value of the current direction, m/s, so that a chosen side is kept.
        look_ahead_time: time for which the motion of others is predicted, s.
        queueing: in [0, 1]; 1 follows pedestrians that walk in the same direction, 0 overtakes them.
        side_bonus: additional value of directions to the side of the rules, m/s.
        anticipation_strength: m/s^2, where the outlines would touch.
        anticipation_decay_length: predicted gap over which the force falls to 1/e, m.
        anticipation_decay_time: time to the closest approach over which the force falls to 1/e, s.
        anticipation_offset: by which others are perceived to one side, m: head-on encounters are then evaded to the
            side of the rules.
        proximity_strength: m/s^2, at contact.
        proximity_decay_length: distance over which the repulsion falls to 1/e, m.
        anisotropy: weight of neighbours behind, in [0, 1]; 1 ahead.
        wall_strength: m/s^2, at contact.
        wall_decay_length: distance over which the repulsion falls to 1/e, m.
        abreast: pull along the desired direction, per metre that the other members are ahead (or behind), 1/s^2.
        cohesion: pull towards the centre of the other members, per metre beyond its distance in an abreast formation,
            1/s^2.
        spacing: between neighbours abreast, m.
        group_attention: attention between members of a group with goals of their own.
    """

    relaxation_time: float = 0.61
    following_time: float = 2.0
    starting_time: float = 0.16
    turning_time: float = 0.36
    headway_half_width: float = 0.3
    standstill_gap: float = -0.13
    time_gap: float = 0.95
    temperature: float = 0.08
    habit_bonus: float = 0.5
    look_ahead_time: float = 1.18
    queueing: float = 1.0
    side_bonus: float = 0.08
    anticipation_strength: float = 1.01
    anticipation_decay_length: float = 0.47
    anticipation_decay_time: float = 0.9
    anticipation_offset: float = 0.1
    proximity_strength: float = 0.45
    proximity_decay_length: float = 0.22
    anisotropy: float = 0.47
    wall_strength: float = 0.2
    wall_decay_length: float = 0.05
    abreast: float = 0.25
    cohesion: float = 0.4
    spacing: float = 0.85
    group_attention: float = 0.42


PARAMETERS = Sonata2026()

FAST_WALK = 1.0  # m/s, from which the starting time has no effect
FOLLOWING_FRACTION = 0.8  # of the desired speed; at lower permitted speeds the following time applies in full
MAXIMUM_SPEED_CHANGE = 4.0  # m/s^2, limit of acceleration and braking along the path
LONGEST_PREDICTION = 10.0  # s, limit of the time to the closest approach
EXPONENT = 12.0  # terms of a pair are left out where their decay is below e^-12 = 6e-6
ROUNDING = 1e-3  # m, more than the rounding errors of a distance


@subroutine
def adaptive_acceleration(
    velocity: Vector, direction: Vector, speed: float, desired_speed: float, parameters: Sonata2026
) -> Vector:
    """Like `desired_acceleration`, for pedestrians that start at once, follow others smoothly and turn quickly.

    Args:
        velocity: m/s.
        direction: unit vector; zero to stop.
        speed: the speed that the others permit, m/s.
        desired_speed: the speed without the others, m/s.
        parameters: the time constants.

    Returns:
        m/s^2.

    Source: ours; the time constants were fitted to recorded pedestrians.
    """
    p, vx, vy, ex, ey = parameters, velocity[0], velocity[1], direction[0], direction[1]
    ahead = vx * ex + vy * ey
    # A pedestrian that wants to stop (desired speed 0) is not held back by others.
    reduction = 1.0 - speed / desired_speed if desired_speed > 1e-3 else 0.0
    held = clipped(reduction / (1.0 - FOLLOWING_FRACTION), 0.0, 1.0)
    tau = p.relaxation_time + (p.following_time - p.relaxation_time) * held
    tau = p.starting_time + (tau - p.starting_time) * clipped(ahead / FAST_WALK, 0.0, 1.0)
    change = clipped((speed - ahead) / tau, -MAXIMUM_SPEED_CHANGE, MAXIMUM_SPEED_CHANGE)
    return ex * change - (vx - ex * ahead) / p.turning_time, ey * change - (vy - ey * ahead) / p.turning_time


@subroutine
def proximity_acceleration(
    dx: float, dy: float, direction: Vector, weight: float, contact_distance: float, parameters: Sonata2026
) -> Vector:
    """Repulsion from the present position of a neighbour.

    Args:
        dx, dy: vector to the neighbour, m.
        direction: forward, a unit vector; zero: all directions have equal weight.
        weight: attention to the neighbour, in [0, 1].
        contact_distance: distance of centres at contact, m.
        parameters: strength, decay length and anisotropy.

    Returns:
        m/s^2.

    Source: Helbing & Johansson, Encyclopedia of Complexity (2009), Pedestrian, Crowd and Evacuation Dynamics, eqs 5-7.
    """
    p = parameters
    d = max(length(dx, dy), 0.01)
    cosine = (dx * direction[0] + dy * direction[1]) / d
    sight = p.anisotropy + (1.0 - p.anisotropy) * (0.5 + 0.5 * cosine)
    decay = exp(min(contact_distance - d, 0.0) / p.proximity_decay_length)
    push = weight * sight * (-p.proximity_strength) * decay / d
    return push * dx, push * dy


@subroutine
def anticipation_acceleration(
    dx: float, dy: float, ux: float, uy: float, weight: float, contact_distance: float, side: float,
    parameters: Sonata2026,
) -> Vector:  # fmt: skip
    """Repulsion between the positions of a pair at its closest approach, predicted with constant velocities.

    A pair that does not approach contributes nothing; the force scales with the closing speed, up to 1 m/s.

    Args:
        dx, dy: vector to the neighbour, m.
        ux, uy: velocity of the neighbour relative to the agent, m/s.
        weight: attention to the neighbour, in [0, 1].
        contact_distance: distance of centres at contact, m.
        side: of the rules, +1 or -1; others are perceived on the opposite side.
        parameters: strength, decay length and time, and offset.

    Returns:
        m/s^2.

    Source: Zanlungo, Ikeda & Kanda, EPL 93 (2011) 68005, eqs 5-7, with a separate time of closest approach per pair.
    """
    p = parameters
    closing = -(dx * ux + dy * uy)
    if not closing > 0.0:
        return 0.0, 0.0
    square = ux * ux + uy * uy
    t = min(closing / max(square, 1e-4), LONGEST_PREDICTION)
    closing = min(closing / max(length(dx, dy), 0.01), 1.0)  # m/s
    fx, fy = dx + ux * t, dy + uy * t  # to the neighbour at the closest approach
    scale = side * p.anticipation_offset / math.sqrt(max(square, 1e-6))
    fx, fy = fx + uy * scale, fy - ux * scale  # perpendicular to the relative velocity
    d = max(length(fx, fy), 0.01)
    near = exp(min(contact_distance - d, 0.0) / p.anticipation_decay_length - t / p.anticipation_decay_time)
    push = weight * closing * (-p.anticipation_strength) * near / d
    return push * fx, push * fy


MAXIMUM_GROUP_DISTANCE = 1.0  # m; a larger lag, or a larger excess distance from the group, pulls no harder


@subroutine
def group_cohesion_acceleration(walkers: Walkers, i: int, parameters: Sonata2026) -> Vector:
    """Keep walking groups abreast and close together.

    Members behind speed up as much as members ahead slow down, so that a group keeps its pace.

    Args:
        walkers: all agents.
        i: index of the agent.
        parameters: cohesion, spacing and abreast.

    Returns:
        m/s^2; zero for an agent without a group.

    Source: the aims are those of Moussaïd et al., PLoS ONE 5 (2010) e10047; the formula is ours.
    """
    p, limit, bond = parameters, MAXIMUM_GROUP_DISTANCE, walkers.bond[i]
    cx, cy, count = offset_of_group(walkers, i)
    if count == 0.0:
        return 0.0, 0.0
    width = p.spacing * 0.5 * (count + 1.0)
    cx, cy = cx / count, cy / count
    ex, ey = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
    lag = bond * p.abreast * clipped(cx * ex + cy * ey, -limit, limit)
    distance = length(cx, cy)
    pull = bond * p.cohesion * clipped(distance - width, 0.0, limit) / max(distance, 1e-6)
    return lag * ex + pull * cx, lag * ey + pull * cy


@subroutine
def headway_speed(ahead: float, aside: float, contact_distance: float, weight: float, parameters: Sonata2026) -> float:
    """The speed that a neighbour permits: (gap - standstill_gap) / time_gap.

    The gap is the clearance along the path. It grows without bound towards the edge of the strip, so that the speed
    changes continuously when a pedestrian enters the strip.

    Args:
        ahead, aside: position of the neighbour along and across the path, m.
        contact_distance: distance of centres at contact, m.
        weight: attention to the neighbour, in [0, 1]; smaller weights enlarge the gap.
        parameters: half width of the strip, standstill gap and time gap.

    Returns:
        m/s; negative if the gap is too small, inf outside the strip.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge is ours.
    """
    p = parameters
    if not ahead > 0.0:
        return math.inf
    edge = (aside * aside) / (p.headway_half_width * p.headway_half_width)
    effect = weight * (1.0 - edge * edge)
    if not effect > 0.0:
        return math.inf
    return (ahead - contact_distance - p.standstill_gap) / (effect * p.time_gap)


@subroutine
def predicted(ahead: float, displacement: float) -> float:
    """Distance ahead after a displacement, m; others that are ahead stay ahead, and others behind are unchanged."""
    return max(ahead + displacement, 1e-3) if ahead > 0.0 else ahead


# Columns of the neighbours in an agent's path: position (m) and displacement within the look-ahead time (m), each along
# the desired direction of the agent and across it, to the right; cosine of the two desired directions; distance of
# centres at contact, m; attention of the agent to the neighbour.
AHEAD, ASIDE, MOVE_AHEAD, MOVE_ASIDE, ALIGNMENT, CONTACT, WEIGHT = range(7)

ANGLES = (0.0, 25.0, -25.0, 50.0, -50.0, 75.0, -75.0)  # degrees from the desired direction, positive to the left
_TURNS = unit_vectors(np.array(ANGLES) * (PI / 180.0))  # (K, 2)


@subroutine
def steer(
    path: Array, direction: Vector, velocity: Vector, desired_speed: float, side: float, parameters: Sonata2026,
    value: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """Choose the direction and speed with the best progress.

    The value of a direction is the speed that its headway permits, times its cosine with the desired direction.
    Oncoming pedestrians count as nearer, and receding ones as farther, by the distance that they walk within the
    look-ahead time. The result is the mean of the directions weighted by their values, so that a small change of the
    positions changes the direction by little.

    Args:
        path: (N, 7), neighbours that the agent attends to; columns `AHEAD` to `WEIGHT`.
        direction: desired direction, a unit vector; zero for an agent that stands.
        velocity: m/s.
        desired_speed: m/s.
        side: of the rules, +1 or -1.
        parameters: of the headway and the choice.
        value: (K,), overwritten by the values of the directions, m/s.

    Returns:
        Direction (x, y), a unit vector or zero, and speed, m/s.

    Source: the idea is that of Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    p, ex, ey = parameters, direction[0], direction[1]
    free_speed, future_speed = math.inf, math.inf
    for j in range(len(path)):
        ahead, aside, contact, weight = path[j, AHEAD], path[j, ASIDE], path[j, CONTACT], path[j, WEIGHT]
        future = predicted(ahead, path[j, MOVE_AHEAD])
        free_speed = min(free_speed, headway_speed(ahead, aside, contact, weight, p))
        future_speed = min(future_speed, headway_speed(future, aside, contact, weight, p))
    free_speed, future_speed = max(free_speed, 0.0), max(future_speed, 0.0)
    # Only pedestrians that are held up choose a direction; the others keep the desired one.
    if not min(free_speed, future_speed) < desired_speed or (ex == 0.0 and ey == 0.0):
        return ex, ey, min(free_speed, desired_speed)

    for k in range(len(ANGLES)):
        value[k] = math.inf
    for j in range(len(path)):
        ahead, aside, move_ahead, move_aside = path[j, AHEAD], path[j, ASIDE], path[j, MOVE_AHEAD], path[j, MOVE_ASIDE]
        obstruction = path[j, WEIGHT] * (1.0 - p.queueing * clipped(2.0 * path[j, ALIGNMENT], 0.0, 1.0))
        if obstruction > 0.0:
            for k in range(len(ANGLES)):
                c, s = _TURNS[k, 0], _TURNS[k, 1]
                future = predicted(ahead * c - aside * s, move_ahead * c - move_aside * s)
                speed = headway_speed(future, ahead * s + aside * c, path[j, CONTACT], obstruction, p)
                value[k] = min(value[k], speed)
    # The current direction relative to the desired one: ahead, left; below 1 m/s shorter in proportion to the speed.
    size = max(length(velocity[0], velocity[1]), 1.0)
    current_x = (velocity[0] * ex + velocity[1] * ey) / size
    current_y = (velocity[1] * ex - velocity[0] * ey) / size
    best = -math.inf
    for k in range(len(ANGLES)):
        c, s = _TURNS[k, 0], _TURNS[k, 1]
        habit = p.habit_bonus * (current_x * c + current_y * s)
        value[k] = min(max(value[k], 0.0), desired_speed) * c - side * p.side_bonus * s + habit
        best = max(best, value[k])
    x, y = 0.0, 0.0
    for k in range(len(ANGLES)):
        mix = exp((value[k] - best) / p.temperature)
        x += mix * _TURNS[k, 0]
        y += mix * _TURNS[k, 1]
    size = max(length(x, y), 1e-6)
    x, y = x / size, y / size
    speed = math.inf
    for j in range(len(path)):
        along, across = path[j, AHEAD] * x - path[j, ASIDE] * y, path[j, AHEAD] * y + path[j, ASIDE] * x
        speed = min(speed, headway_speed(along, across, path[j, CONTACT], path[j, WEIGHT], p))
    return ex * x - ey * y, ey * x + ex * y, min(max(speed, 0.0), desired_speed)


BACKWARDS_SPEED = 0.2  # backward speed as a fraction of the forward speed


@kernel
def _accelerations(
    packed_walkers: Any, packed_parameters: Any, barriers: Array, side: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2), m/s^2; zero for the others."""
    walkers, parameters = unpack(packed_walkers, Walkers), unpack(packed_parameters, Sonata2026)
    p, position, velocity, radius = parameters, walkers.position, walkers.velocity, walkers.radius
    direction, desired_speed, group = walkers.desired_direction, walkers.desired_speed, walkers.group
    path, value, pace = np.empty((len(position), 7)), np.empty(len(ANGLES)), np.empty(len(position))
    for i in range(len(position)):
        pace[i] = length(velocity[i, 0], velocity[i, 1])
    for i in range(len(position)):
        acceleration[i, 0], acceleration[i, 1] = 0.0, 0.0
        if not walkers.walks[i]:
            continue
        own_direction, own_velocity = (direction[i, 0], direction[i, 1]), (velocity[i, 0], velocity[i, 1])
        ex, ey = own_direction
        # Members that keep less to their group (bond < 1) attend less to the other members.
        reduction = (1.0 - p.group_attention) * (1.0 - walkers.bond[i])
        anticipation_x, anticipation_y, proximity_x, proximity_y = 0.0, 0.0, 0.0, 0.0
        count = 0
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j, weight = walkers.neighbour[n], walkers.attention[n]
            if group[i] >= 0 and group[j] == group[i]:
                weight = weight * (1.0 - reduction)
            if weight == 0.0:
                continue
            dx, dy, contact = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1], radius[j] + radius[i]
            square = dx * dx + dy * dy
            # Neighbours out of reach contribute next to nothing, or permit the desired speed in every direction.
            if not _is_beyond(square, anticipation_reach(contact, pace[i] + pace[j], p)):
                ux, uy = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
                x, y = anticipation_acceleration(dx, dy, ux, uy, weight, contact, side, p)
                anticipation_x += x
                anticipation_y += y
            if not _is_beyond(square, proximity_reach(contact, p)):
                x, y = proximity_acceleration(dx, dy, own_direction, weight, contact, p)
                proximity_x += x
                proximity_y += y
            if not _is_beyond(square, headway_reach(contact, pace[j], desired_speed[i], p)):
                x, y = velocity[j, 0] * p.look_ahead_time, velocity[j, 1] * p.look_ahead_time
                path[count, AHEAD], path[count, ASIDE] = dx * ex + dy * ey, dx * ey - dy * ex
                path[count, MOVE_AHEAD], path[count, MOVE_ASIDE] = x * ex + y * ey, x * ey - y * ex
                path[count, ALIGNMENT] = direction[j, 0] * ex + direction[j, 1] * ey
                path[count, CONTACT], path[count, WEIGHT] = contact, weight
                count += 1
        x, y, speed = steer(path[:count], own_direction, own_velocity, desired_speed[i], side, p, value)
        # Pedestrians that face away from their direction turn before they walk.
        facing = walkers.body_direction[i, 0] * x + walkers.body_direction[i, 1] * y
        speed = speed * clipped(1.0 + facing, BACKWARDS_SPEED, 1.0)
        drive = adaptive_acceleration(own_velocity, (x, y), speed, desired_speed[i], p)
        cohesion = group_cohesion_acceleration(walkers, i, p)
        wall = wall_acceleration(
            barriers, position[i, 0], position[i, 1], radius[i], p.wall_strength, p.wall_decay_length
        )
        acceleration[i, 0] = drive[0] + cohesion[0] + anticipation_x + proximity_x + wall[0]
        acceleration[i, 1] = drive[1] + cohesion[1] + anticipation_y + proximity_y + wall[1]


@subroutine
def proximity_reach(contact_distance: float, parameters: Sonata2026) -> float:
    """Distance of centres beyond which `proximity_acceleration` is left out, m."""
    return contact_distance + EXPONENT * parameters.proximity_decay_length


@subroutine
def anticipation_reach(contact_distance: float, relative_speed: float, parameters: Sonata2026) -> float:
    """Distance of centres beyond which `anticipation_acceleration` is left out up to a relative speed, m."""
    p = parameters
    gap = EXPONENT * p.anticipation_decay_length + p.anticipation_offset
    return contact_distance + gap + LONGEST_PREDICTION * relative_speed


@subroutine
def headway_reach(
    contact_distance: float, neighbour_speed: float, desired_speed: float, parameters: Sonata2026
) -> float:
    """Distance of centres beyond which a neighbour in the strip permits the desired speed, m.

    It is ahead by its distance less the half width of the strip at least, and comes nearer by its own motion.
    """
    p = parameters
    gap = p.standstill_gap + p.time_gap * desired_speed
    return contact_distance + gap + p.headway_half_width + p.look_ahead_time * neighbour_speed + ROUNDING


@subroutine
def _is_beyond(square: float, reach: float) -> bool:
    """Whether a distance, given its square, exceeds a reach."""
    return square > reach * reach and reach > 0.0


class Sonata2026Model(KernelModel):
    """Headway, steering, anticipation, proximity, walls and group cohesion; parameters in `Sonata2026`."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._parameters = pack(PARAMETERS)  # read here, so that `benchmarks/calibrate.py` can replace it

    def acceleration(self, walkers: Walkers) -> Array:
        acceleration = self._output(walkers)
        _accelerations(self._packed(walkers), self._parameters, self._barriers, self._side, acceleration)
        return acceleration
