"""`sonata2026`: the default pedestrian model, calibrated on recorded pedestrians; formulas are in `docs/models.md`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ....core.compiled.kernel import kernel, subroutine
from ....core.compiled.packing import Floats, Floats2, Ints, Packed, unpack, zeros
from ....core.compiled.scalar import Vector, clipped, exp, extent, length, rotation, turned_towards
from ....core.philox import first_words
from ....core.portable_math import PI, Array, unit_vectors
from ....core.scene import Scene
from .base import KernelModel, Walkers, are_together, fill_walls


class Sonata2026(NamedTuple):
    """Parameters; `docs/realism.md` says how they were found.

    Attributes:
        relaxation_time: time constant of the speed along the chosen direction, s; half of it near a robot.
        turning_time: of the velocity component across it, s; also the shortest time in which a walker would reach a
            thing or a person in its way.
        headway_half_width: half the width of the strip ahead in which others count, m.
        standstill_gap: gap at which the permitted speed is 0, m; below 0, bodies would touch first.
        time_gap: time in which the gap beyond `standstill_gap` would be walked, s.
        matching_time: time for which people ahead are expected to keep their speed, s; so a walker keeps the speed of a
            stream instead of closing every gap. It is shorter for slow people, and 0 for people who stand or come
            nearer, see `headway_speed`.
        look_ahead_time: time for which the motion of others is predicted, and over which the force of a predicted
            approach falls to 1/e, s.
        temperature: difference of values at which the weight of a direction falls to 1/e, m/s.
        side_bonus: additional value of directions to the side of the rules, m/s; over the look-ahead time it gives the
            distance by which others are perceived to the opposite side.
        anticipation_strength: m/s^2, where the outlines would touch.
        anticipation_length: gap over which it falls to 1/e, m.
        proximity_strength: m/s^2, at contact with a person.
        wall_strength: m/s^2, at contact with a wall or furniture, at a brisk pace.
        proximity_length: gap over which both fall to 1/e, m.
        cohesion: rate at which members of a group return to their formation, 1/s.
        spacing: between neighbours abreast, m.
        wander: standard deviation of the angle by which a walker deviates from its direction, rad.
        pace_deviation: standard deviation of the logarithm of the factor by which it deviates from its desired speed;
            twice as much near a robot.
        deviation_time: over which both deviations fall to 1/e, s.
        crowd: sum of the weights of strangers around a walker, 1 for one beside it, at which its deviations are halved.
    """

    relaxation_time: float = 0.6
    turning_time: float = 0.194
    headway_half_width: float = 0.329
    standstill_gap: float = -0.28
    time_gap: float = 1.35
    matching_time: float = 4.0
    look_ahead_time: float = 1.014
    temperature: float = 0.071
    side_bonus: float = 0.107
    anticipation_strength: float = 2.438
    anticipation_length: float = 0.584
    proximity_strength: float = 7.055
    wall_strength: float = 1.911
    proximity_length: float = 0.093
    cohesion: float = 0.229
    spacing: float = 1.062
    wander: float = 0.11
    pace_deviation: float = 0.1
    deviation_time: float = 0.977
    crowd: float = 1.2


PARAMETERS = Sonata2026()

# Along the direction of the drive, m/s^2. Recorded ones exceed 0.9 (corridor_uni) to 1.2 (zara01) in 1 % of the time.
MAXIMUM_ACCELERATION, MAXIMUM_BRAKING = 1.2, 4.0
_FASTEST = 3.0  # m/s, more than people walk
_LONGEST_PREDICTION = 10.0  # s, limit of the time to the closest approach
_ROUNDING = 1e-3  # m, more than the rounding errors of a distance
_SIDE_SINE = 0.1  # of the angle from the desired direction, above which a wall is to the left or right

_NEAR = 1.0  # m, distance over which the weight of a stranger in a crowd falls to 1/e

# How a walker turns. Its velocity deviates from the heading of its body by 45 degrees at most; farther directions make
# the body turn first. A walker that faces more than 60 degrees away slows down, and stands from 120 degrees on; one
# that stands sets off within 25 degrees, and shuffles sideways until then.
_SIDESTEP_COSINE = _SIDESTEP_SINE = 0.7071067811865476
SLOW_PACE, BRISK_PACE = 0.4, 0.8  # m/s, between which the two rules for walking and for standing mix
_SETTING_OFF_COSINE, _SETTING_OFF_RANGE = 0.85, 0.12
# Speed of steps sideways as a fraction of the forward speed: of a walker that turns, and of one that others hold up or
# that is beside a wall. People prefer 0.575 m/s, and walk sideways for a step or two only (Handford & Srinivasan,
# Biology Letters 10 (2014) 20131006).
SHUFFLE, SIDESTEP = 0.15, 0.43


@subroutine
def desired_change(
    velocity: Vector, direction: Vector, speed: float, pull: float, relaxation_time: float, turning_time: float,
    dt: float,
) -> Vector:  # fmt: skip
    """Accelerate towards a desired velocity, with time constants of their own along and across it.

    Args:
        velocity: m/s.
        direction: of the desired velocity, a unit vector; zero to stop.
        speed: of the desired velocity, m/s.
        pull: further acceleration along the direction, m/s^2, which never leads to walking backwards.
        relaxation_time, turning_time: along and across the direction, s.
        dt: tick, s.

    Returns:
        m/s^2.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, eq. 2, which has one time constant.
    """
    vx, vy, ex, ey = velocity[0], velocity[1], direction[0], direction[1]
    ahead = vx * ex + vy * ey
    change = clipped((speed - ahead) / relaxation_time + pull, -MAXIMUM_BRAKING, MAXIMUM_ACCELERATION)
    change = max(change, -max(ahead, 0.0) / dt)
    return ex * change - (vx - ex * ahead) / turning_time, ey * change - (vy - ey * ahead) / turning_time


@subroutine
def with_body(
    body: Vector, x: float, y: float, speed: float, pace: float, side: float, shuffle: float
) -> tuple[float, float, float]:
    """Reduce and deflect a desired velocity to what the direction of the feet permits.

    Args:
        body: unit vector of the direction in which the feet point.
        x, y: desired direction, a unit vector or zero.
        speed: desired speed, m/s.
        pace: present speed, m/s.
        side: of the rules, +1 or -1: to which a walker turns about.
        shuffle: speed of steps sideways as a fraction of the forward speed.

    Returns:
        Direction x, y and speed, m/s.
    """
    cosine = body[0] * x + body[1] * y
    walking = clipped((pace - SLOW_PACE) / (BRISK_PACE - SLOW_PACE), 0.0, 1.0)
    shuffling = shuffle * clipped(1.0 + 2.0 * cosine, 0.0, 1.0)
    standing = max(clipped((cosine - _SETTING_OFF_COSINE) / _SETTING_OFF_RANGE, 0.0, 1.0), shuffling)
    speed = speed * (walking * clipped(0.5 + cosine, 0.0, 1.0) + (1.0 - walking) * standing)
    x, y = turned_towards(body[0], body[1], x, y, _SIDESTEP_COSINE, _SIDESTEP_SINE, side)
    return x, y, speed


# Two bodies: sum of the radii, m; of each body `Walkers.shoulder`, m, and the direction of its feet.
Bodies = tuple[float, float, float, float, float, float, float]


@subroutine
def contact_distance(nx: float, ny: float, bodies: Bodies) -> float:
    """Distance of the centres of two bodies whose outlines touch in a direction, a unit vector; m.

    It is the sum of their extents in this direction: exact straight ahead and aside, up to 4 cm too large in between.
    """
    radii, first, x1, y1, second, x2, y2 = bodies
    return radii + extent(nx, ny, x1, y1, first) + extent(nx, ny, x2, y2, second)


@subroutine
def proximity_acceleration(
    dx: float, dy: float, direction: Vector, weight: float, bodies: Bodies, parameters: Sonata2026
) -> Vector:
    """Repulsion from the present position of a neighbour: in full ahead, nothing behind.

    Args:
        dx, dy: vector to the neighbour, m.
        direction: forward, a unit vector; zero: all directions have equal weight.
        weight: attention to the neighbour, in [0, 1].
        bodies: of the pair.
        parameters: strength and decay length.

    Returns:
        m/s^2.

    Source: Helbing & Johansson, Encyclopedia of Complexity (2009), Pedestrian, Crowd and Evacuation Dynamics, eqs 5-7.
    """
    p = parameters
    d = max(length(dx, dy), 0.01)
    cosine = (dx * direction[0] + dy * direction[1]) / d
    decay = exp(min(contact_distance(dx / d, dy / d, bodies) - d, 0.0) / p.proximity_length)
    push = weight * (0.5 + 0.5 * cosine) * (-p.proximity_strength) * decay / d
    return push * dx, push * dy


@subroutine
def anticipation_acceleration(
    dx: float, dy: float, ux: float, uy: float, weight: float, bodies: Bodies, side: float, parameters: Sonata2026
) -> Vector:
    """Repulsion between the positions of a pair at its closest approach, predicted with constant velocities.

    A pair that does not approach contributes nothing; the force scales with the closing speed, up to 1 m/s.

    Args:
        dx, dy: vector to the neighbour, m.
        ux, uy: velocity of the neighbour relative to the agent, m/s.
        weight: attention to the neighbour, in [0, 1].
        bodies: of the pair.
        side: of the rules, +1 or -1; others are perceived on the opposite side, so that head-on encounters are evaded.
        parameters: strength, decay length, look-ahead time and side bonus.

    Returns:
        m/s^2.

    Source: Zanlungo, Ikeda & Kanda, EPL 93 (2011) 68005, eqs 5-7, with a separate time of closest approach per pair.
    """
    p = parameters
    closing = -(dx * ux + dy * uy)
    if not closing > 0.0:
        return 0.0, 0.0
    square = ux * ux + uy * uy
    t = min(closing / max(square, 1e-4), _LONGEST_PREDICTION)
    closing = min(closing / max(length(dx, dy), 0.01), 1.0)  # m/s
    fx, fy = dx + ux * t, dy + uy * t  # to the neighbour at the closest approach
    offset = side * p.side_bonus * p.look_ahead_time / math.sqrt(max(square, 1e-6))
    fx, fy = fx + uy * offset, fy - ux * offset  # perpendicular to the relative velocity
    d = max(length(fx, fy), 0.01)
    near = exp(min(contact_distance(fx / d, fy / d, bodies) - d, 0.0) / p.anticipation_length - t / p.look_ahead_time)
    push = weight * closing * (-p.anticipation_strength) * near / d
    return push * fx, push * fy


MAXIMUM_GROUP_DISTANCE = 1.0  # m; a larger deviation from the formation pulls no harder
WAITING_LAG = 0.75  # m, beyond the tolerance: members ahead slow down from there on, and wait from twice of it on
FORMATION_TOLERANCE = 1.0 / 3.0  # of the spacing: real groups are not exactly abreast, and not exactly spaced


@subroutine
def group_velocity(
    walkers: Walkers, i: int, looseness: Array, side: float, parameters: Sonata2026
) -> tuple[float, float, float]:
    """Keep walking groups abreast and together: members that lag walk faster, those ahead slower.

    Where there is no room beside each other, members walk in file. A group that comes in a looser formation than that
    of the parameters keeps to that one. Members that walk in the opposite direction have no effect. Members far ahead
    of the others wait.

    Args:
        walkers: all agents.
        i: index of the agent.
        looseness: (M,), m, of each agent's group, see `Memory`; is set when the agent first has company.
        side: of the rules, +1 or -1: to which members that walk exactly in file give way.
        parameters: cohesion and spacing.

    Returns:
        What is added to the desired velocity (x, y), m/s, zero for an agent without a group; and the factor of the
        desired speed, in [0, 1], below 1 for those who wait.

    Source: the aims are from Moussaïd et al., PLoS ONE 5 (2010) e10047; the formula is ours.
    """
    p, limit = parameters, MAXIMUM_GROUP_DISTANCE
    if walkers.group[i] < 0:
        return 0.0, 0.0, 1.0
    ex, ey = walkers.desired_direction[i, 0], walkers.desired_direction[i, 1]
    is_new = math.isnan(looseness[i])
    tolerance = FORMATION_TOLERANCE * p.spacing + (0.0 if is_new else 0.5 * looseness[i])
    cx, cy, left, count = 0.0, 0.0, 0.0, 0.0
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j = walkers.neighbour[n]
        turned = ex * walkers.desired_direction[j, 0] + ey * walkers.desired_direction[j, 1] < 0.0
        if are_together(walkers, i, j) and not turned:
            dx, dy = walkers.position[j, 0] - walkers.position[i, 0], walkers.position[j, 1] - walkers.position[i, 1]
            cx, cy, count = cx + dx, cy + dy, count + 1.0
            aside = ex * dy - ey * dx  # to the left
            missing = clipped(p.spacing - tolerance - abs(aside), 0.0, limit)
            # the one behind goes to the side of the rules, the one ahead to the other
            is_left = aside > 0.0 if abs(aside) > _ROUNDING else side * (ex * dx + ey * dy) > 0.0
            left += -missing if is_left else missing
    if count == 0.0:
        return 0.0, 0.0, 1.0
    cx, cy = cx / count, cy / count
    lag, left = cx * ex + cy * ey, clipped(left, -limit, limit)
    pace = clipped(1.0 - (-lag - tolerance - WAITING_LAG) / WAITING_LAG, 0.0, 1.0)
    lag = clipped(lag - clipped(lag, -tolerance, tolerance), -limit, limit)
    excess = max(length(cx, cy) - p.spacing * 0.5 * (count + 1.0), 0.0)
    if is_new:
        looseness[i] = min(max(abs(lag), abs(left), excess), limit)
        return 0.0, 0.0, 1.0
    if not walkers.is_abreast[i]:
        lag = left = 0.0
    pull = clipped(excess - looseness[i], 0.0, limit) / max(length(cx, cy), 1e-6)
    x, y = lag * ex - left * ey + pull * cx, lag * ey + left * ex + pull * cy
    return p.cohesion * x, p.cohesion * y, pace


@subroutine
def headway_speed(
    ahead: float, aside: float, contact: float, weight: float, time_gap: float, pace: float, matching_time: float,
    parameters: Sonata2026,
) -> float:  # fmt: skip
    """The speed v that a neighbour permits: v = (gap - standstill_gap + (pace - v) matching_time) / time_gap.

    At the same speed that is the gap over the time gap; a faster walker brakes early, and a slower one does not rush
    into a gap that will stay. The gap is the clearance along the path. It grows without bound towards the edge of the
    strip, so that the speed changes continuously when a pedestrian enters the strip.

    Args:
        ahead, aside: position of the neighbour along and across the path, m.
        contact: distance of centres at contact, m.
        weight: attention to the neighbour, in [0, 1]; smaller weights enlarge the gap.
        time_gap: of the agent, s.
        pace: speed of the neighbour along the path, m/s.
        matching_time: for which a neighbour that walks is expected to keep this speed, s. Below `SLOW_PACE` it is
            shorter in proportion to the pace, and 0 for one that stands or comes nearer.
        parameters: half width of the strip and standstill gap.

    Returns:
        m/s; negative if the gap is too small, inf outside the strip.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge and the matching
    of speeds are ours.
    """
    p = parameters
    if not ahead > 0.0:
        return math.inf
    edge = (aside * aside) / (p.headway_half_width * p.headway_half_width)
    effect = weight * (1.0 - edge * edge)
    if not effect > 0.0:
        return math.inf
    matching_time *= clipped(pace / SLOW_PACE, 0.0, 1.0)
    gap = ahead - contact - p.standstill_gap + pace * matching_time
    return gap / (effect * (time_gap + matching_time))


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
    path: Array, walls: Array, direction: Vector, desired_speed: float, time_gap: float, side: float,
    parameters: Sonata2026, value: Array,
) -> tuple[float, float, float]:  # fmt: skip
    """Choose the direction and speed with the best progress.

    The value of a direction is the speed that its headway permits, times its cosine with the desired direction. Where
    others come towards it, it is also limited by walls, so that no pedestrian evades into a wall. Oncoming pedestrians
    count as nearer, and receding ones as farther, by the distance that they walk within the look-ahead time: those that
    walk as fast are followed, slower ones are overtaken. The result is the mean of the directions weighted by their
    values, so that a small change of the positions changes the direction by little.

    Args:
        path: (N, 7), neighbours that the agent attends to; columns `AHEAD` to `WEIGHT`.
        walls: see `base.fill_walls`.
        direction: desired direction, a unit vector; zero for an agent that stands.
        desired_speed: m/s.
        time_gap: of the agent, s.
        side: of the rules, +1 or -1.
        parameters: of the headway and the choice.
        value: (K,), overwritten by the values of the directions, m/s.

    Returns:
        Direction (x, y), a unit vector or zero, and speed, m/s.

    Source: the idea is from Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    p, ex, ey = parameters, direction[0], direction[1]
    free_speed, future_speed = math.inf, math.inf
    for j in range(len(path)):
        ahead, aside, contact, weight = path[j, AHEAD], path[j, ASIDE], path[j, CONTACT], path[j, WEIGHT]
        future = predicted(ahead, path[j, MOVE_AHEAD])
        pace = path[j, MOVE_AHEAD] / p.look_ahead_time
        speed = headway_speed(ahead, aside, contact, weight, time_gap, pace, p.matching_time, p)
        free_speed = min(free_speed, speed)
        future_speed = min(future_speed, headway_speed(future, aside, contact, weight, time_gap, 0.0, 0.0, p))
    free_speed, future_speed = max(free_speed, 0.0), max(future_speed, 0.0)
    # Only pedestrians that are held up choose a direction; the others keep the desired one.
    if not min(free_speed, future_speed) < desired_speed or (ex == 0.0 and ey == 0.0):
        return ex, ey, min(free_speed, desired_speed)

    is_opposed = False
    for k in range(len(ANGLES)):
        value[k] = math.inf
    for j in range(len(path)):
        ahead, aside, move_ahead, move_aside = path[j, AHEAD], path[j, ASIDE], path[j, MOVE_AHEAD], path[j, MOVE_ASIDE]
        contact, weight = path[j, CONTACT], path[j, WEIGHT]
        is_opposed = is_opposed or path[j, ALIGNMENT] < -0.5
        for k in range(len(ANGLES)):
            c, s = _TURNS[k, 0], _TURNS[k, 1]
            future = predicted(ahead * c - aside * s, move_ahead * c - move_aside * s)
            speed = headway_speed(future, ahead * s + aside * c, contact, weight, time_gap, 0.0, 0.0, p)
            value[k] = min(value[k], speed)
    for k in range(len(ANGLES)):
        c, s = _TURNS[k, 0], _TURNS[k, 1]
        for w in range(len(walls) if is_opposed else 0):
            towards_wall = (ex * c - ey * s) * walls[w, 0] + (ey * c + ex * s) * walls[w, 1]
            if value[k] * towards_wall > walls[w, 2]:
                value[k] = walls[w, 2] / towards_wall
    best = -math.inf
    for k in range(len(ANGLES)):
        c, s = _TURNS[k, 0], _TURNS[k, 1]
        value[k] = min(max(value[k], 0.0), desired_speed) * c - side * p.side_bonus * s
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
        pace = (path[j, MOVE_AHEAD] * x - path[j, MOVE_ASIDE] * y) / p.look_ahead_time
        contact, weight = path[j, CONTACT], path[j, WEIGHT]
        speed = min(speed, headway_speed(along, across, contact, weight, time_gap, pace, p.matching_time, p))
    return ex * x - ey * y, ey * x + ex * y, min(max(speed, 0.0), desired_speed)


class Memory(NamedTuple):
    """Memory of the model for each agent, for the kernel.

    Attributes:
        generator: (M,) of int, state of its random number generator.
        deviation: (M, 2), from its direction and from its desired speed, in standard deviations; 0 at the start.
        looseness: (M,), by which its group deviates from an ideal formation when they meet, m; NaN before.
    """

    generator: Ints
    deviation: Floats2
    looseness: Floats


class Input(NamedTuple):
    """Parameters and memory of the model, for the kernel."""

    parameters: Sonata2026
    memory: Memory


_MULTIPLIER, _INCREMENT, _MASK = 1664525, 1013904223, 0xFFFFFFFF  # of the generator, modulo 2^32
_UNIFORM_DRAWS = 4  # uniform random numbers, whose sum approximates a normal distribution
_COURSE, _PACE = range(2)  # columns of `Memory.deviation`
_MOST_WANDER, _MOST_PACE = 0.4, 0.25  # rad, and logarithm of the factor: below the limit of the speed


@subroutine
def deviate(memory: Memory, i: int, keep: float) -> None:
    """Advance the deviations of agent i by one tick: two Ornstein-Uhlenbeck processes of variance 1.

    Args:
        memory: updated.
        i: index of the agent.
        keep: factor by which the deviations fall within a tick, in (0, 1).

    Source: the generator is from Press et al., Numerical Recipes, section 7.1.
    """
    state, kick = memory.generator[i], math.sqrt((1.0 - keep * keep) * 3.0 / _UNIFORM_DRAWS)
    for column in range(2):
        total = 0.0
        for _ in range(_UNIFORM_DRAWS):
            state = (_MULTIPLIER * state + _INCREMENT) & _MASK
            total += state / 2147483648.0 - 1.0  # uniform in [-1, 1), of variance 1/3
        memory.deviation[i, column] = keep * memory.deviation[i, column] + kick * total
    memory.generator[i] = state


@subroutine
def own_course(walkers: Walkers, i: int, memory: Memory, parameters: Sonata2026) -> tuple[float, float]:
    """Angle by which agent i deviates from its direction, rad, and factor of its desired speed.

    Members of a group share the deviations of the first one that walks near by, so that they stay together. In a
    crowd a walker goes where others leave room: its deviations fade. While it heeds a robot, that of the course is
    halved, and that of the speed is doubled.
    """
    p, lead, crowd = parameters, i, 0.0
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j = walkers.neighbour[n]
        if are_together(walkers, i, j):
            lead = min(lead, j) if walkers.walks[j] else lead
        elif walkers.attention[n] > 0.0:
            dx, dy = walkers.position[j, 0] - walkers.position[i, 0], walkers.position[j, 1] - walkers.position[i, 1]
            crowd += walkers.attention[n] * exp(-length(dx, dy) / _NEAR)
    square, watchful = (crowd / p.crowd) * (crowd / p.crowd), 1.0 + walkers.heed[i]
    share = 1.0 / (1.0 + square * square)
    course, pace = memory.deviation[lead, _COURSE], memory.deviation[lead, _PACE]
    course = clipped(p.wander * share / watchful * course, -_MOST_WANDER, _MOST_WANDER)
    return course, exp(clipped(p.pace_deviation * share * watchful * pace, -_MOST_PACE, _MOST_PACE))


@kernel
def _accelerations(
    packed_walkers: Any, packed_input: Any, barriers: Array, side: float, dt: float, acceleration: Array
) -> None:
    """Accelerations of the agents that walk, into `acceleration` (M, 2) of zeros, m/s^2."""
    walkers, memory = unpack(packed_walkers, Walkers), unpack(packed_input, Input).memory
    parameters = unpack(packed_input, Input).parameters
    p, position, velocity, radius = parameters, walkers.position, walkers.velocity, walkers.radius
    direction, desired_speed, body = walkers.desired_direction, walkers.desired_speed, walkers.body_direction
    path, value, pace = np.empty((len(position), 7)), np.empty(len(ANGLES)), np.empty(len(position))
    near = np.empty((len(barriers), 3))
    keep = exp(-dt / p.deviation_time)
    tau, turning_time = max(p.relaxation_time, dt), max(p.turning_time, dt)  # stable also in long ticks
    for i in range(len(position)):
        pace[i] = length(velocity[i, 0], velocity[i, 1])
    for i in range(len(position)):
        if not walkers.walks[i]:
            continue
        deviate(memory, i, keep)
        course, factor = own_course(walkers, i, memory, p)
        c, s = rotation(side * course)
        wanted = factor * desired_speed[i]
        ex, ey = direction[i, 0] * c - direction[i, 1] * s, direction[i, 0] * s + direction[i, 1] * c
        time_gap, politeness = p.time_gap * walkers.headway[i], walkers.politeness[i]
        push_x, push_y, members = 0.0, 0.0, 1.0
        count = 0
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j, weight = walkers.neighbour[n], walkers.attention[n]
            if weight == 0.0:
                continue
            dx, dy, contact = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1], radius[j] + radius[i]
            alignment = direction[j, 0] * ex + direction[j, 1] * ey
            members += are_together(walkers, i, j)
            bodies = (contact, walkers.shoulder[i], body[i, 0], body[i, 1], walkers.shoulder[j], body[j, 0], body[j, 1])
            ux, uy = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
            x, y = anticipation_acceleration(dx, dy, ux, uy, weight * politeness, bodies, side, p)
            push_x += x
            push_y += y
            x, y = proximity_acceleration(dx, dy, (ex, ey), weight * politeness, bodies, p)
            push_x += x
            push_y += y
            # A neighbour out of reach permits the desired speed in every direction.
            reach = headway_reach(contact, pace[j], wanted, time_gap, p)
            if dx * dx + dy * dy <= reach * reach:
                x, y = velocity[j, 0] * p.look_ahead_time, velocity[j, 1] * p.look_ahead_time
                path[count, AHEAD], path[count, ASIDE] = dx * ex + dy * ey, dx * ey - dy * ex
                path[count, MOVE_AHEAD], path[count, MOVE_ASIDE] = x * ex + y * ey, x * ey - y * ex
                path[count, ALIGNMENT] = alignment
                path[count, CONTACT], path[count, WEIGHT] = contact, weight
                count += 1
        outline = (radius[i], walkers.shoulder[i], body[i, 0], body[i, 1])
        reach = radius[i] + abs(walkers.shoulder[i]) + p.turning_time * _FASTEST
        walls = near[: fill_walls(near, walkers, i, barriers, outline, p.turning_time, reach)]
        # Headways slow walkers down; the forces only turn them. Of the walls on each side the strongest push counts, in
        # however many pieces a wall is drawn. People push nobody into a wall: a walker beside the corner of an opening
        # would slide back along it, and never enter the stream that passes.
        left, from_left, from_right = ex * push_y - ey * push_x, 0.0, 0.0
        to_left, to_right = math.inf, math.inf  # largest speeds, m/s
        for w in range(len(walls)):
            sine = ex * walls[w, 1] - ey * walls[w, 0]  # positive on the left
            push = exp(-walls[w, 2] * p.turning_time / p.proximity_length) * sine
            from_left, from_right = max(from_left, push), min(from_right, push)
            if sine > _SIDE_SINE:
                to_left = min(to_left, walls[w, 2] / sine)
            elif sine < -_SIDE_SINE:
                to_right = min(to_right, -walls[w, 2] / sine)
        left -= p.wall_strength * min(pace[i] / BRISK_PACE, 1.0) * (from_left + from_right)
        left = clipped(left, -to_right / p.turning_time, to_left / p.turning_time)
        left *= p.turning_time / turning_time
        push_x, push_y = -ey * left, ex * left
        gx, gy, group_pace = group_velocity(walkers, i, memory.looseness, side, p)
        x, y, speed = steer(path[:count], walls, (ex, ey), wanted, time_gap, side, p, value)
        walkers.steering[i, 0], walkers.steering[i, 1] = x, y
        shuffle = SIDESTEP if len(walls) > 0 or speed < wanted else SHUFFLE
        x, y, speed = with_body((body[i, 0], body[i, 1]), x, y, speed, pace[i], side, shuffle)
        speed *= group_pace
        own_velocity = (velocity[i, 0], velocity[i, 1])
        along = gx * x + gy * y
        own_tau = max(tau / (1.0 + walkers.heed[i]), dt)  # shorter near a robot; the pull of the group stays as it is
        drive = desired_change(own_velocity, (x, y), speed, along / tau, own_tau, turning_time, dt)
        # Each member of a group evades less, so that the group keeps its formation, and others walk round it.
        ax = drive[0] + (gx - along * x) / tau + push_x / members
        ay = drive[1] + (gy - along * y) / tau + push_y / members
        after = (velocity[i, 0] + ax * dt, velocity[i, 1] + ay * dt)
        vx, vy = _without_bumps(walkers, i, after, walls, p.turning_time)
        acceleration[i, 0], acceleration[i, 1] = (vx - velocity[i, 0]) / dt, (vy - velocity[i, 1]) / dt


@subroutine
def held_back(velocity: Vector, normal: Vector, maximum: float) -> Vector:
    """Limit the component of a velocity along a unit vector; all in m/s."""
    excess = max(velocity[0] * normal[0] + velocity[1] * normal[1] - maximum, 0.0)
    return velocity[0] - excess * normal[0], velocity[1] - excess * normal[1]


@subroutine
def _without_bumps(walkers: Walkers, i: int, velocity: Vector, walls: Array, time: float) -> Vector:
    """Limit the velocity of agent i so that it reaches no obstacle and no oncoming person within a given time.

    A walker that evades others, or turns wide, so comes to a wall gently, and goes along it. People that walk the
    same way are left out: their speeds differ by little, and in a full door people do touch.

    Args:
        walkers: all agents.
        i: index of an agent that walks.
        velocity: that it wants, m/s.
        walls: see `base.fill_walls`.
        time: s.

    Returns:
        m/s.

    Source: ours.
    """
    x, y, radius, shoulder = walkers.position[i, 0], walkers.position[i, 1], walkers.radius[i], walkers.shoulder[i]
    bx, by, direction = walkers.body_direction[i, 0], walkers.body_direction[i, 1], walkers.desired_direction
    reach = radius + abs(shoulder) + time * length(velocity[0], velocity[1])
    for _ in range(2):  # a limit may push the walker towards what was passed before
        before = velocity
        for w in range(len(walls)):
            velocity = held_back(velocity, (walls[w, 0], walls[w, 1]), walls[w, 2])
        for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
            j = walkers.neighbour[n]
            dx, dy = walkers.position[j, 0] - x, walkers.position[j, 1] - y
            square, limit = dx * dx + dy * dy, reach + walkers.radius[j] + abs(walkers.shoulder[j])
            alignment = direction[j, 0] * direction[i, 0] + direction[j, 1] * direction[i, 1]
            if square > limit * limit or walkers.attention[n] == 0.0 or alignment > 0.0:
                continue
            distance = max(math.sqrt(square), 1e-6)
            nx, ny = dx / distance, dy / distance
            bodies = (radius + walkers.radius[j], shoulder, bx, by, walkers.shoulder[j], walkers.body_direction[j, 0],
                      walkers.body_direction[j, 1])  # fmt: skip
            gap = max(distance - contact_distance(nx, ny, bodies), 0.0)
            receding = max(walkers.velocity[j, 0] * nx + walkers.velocity[j, 1] * ny, 0.0)
            velocity = held_back(velocity, (nx, ny), receding + gap / time)
        if velocity[0] == before[0] and velocity[1] == before[1]:
            break
    return velocity


@subroutine
def headway_reach(
    contact: float, neighbour_speed: float, desired_speed: float, time_gap: float, parameters: Sonata2026
) -> float:
    """Distance of centres beyond which a neighbour in the strip permits the desired speed, m.

    It is ahead by its distance less the half width of the strip at least, and comes nearer by its own motion.
    """
    p = parameters
    matching_time = p.matching_time * min(neighbour_speed / SLOW_PACE, 1.0)
    gap = p.standstill_gap + (time_gap + matching_time) * desired_speed
    return contact + gap + p.headway_half_width + p.look_ahead_time * neighbour_speed + _ROUNDING


class Sonata2026Model(KernelModel):
    """Headway, steering, anticipation, proximity and groups; parameters in `Sonata2026`."""

    kernel = staticmethod(_accelerations)

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._seeds, self._ids = (scene.seed, scene.episode), scene.human_table.id.tolist()
        # Read here, so that `benchmarks/calibrate.py` can replace the parameters.
        self._input = Packed(Input(PARAMETERS, zeros(Memory, 0)))

    @property
    def memory(self) -> tuple[tuple[Any, ...], ...]:
        return (self._input.value.memory,)

    def packed_parameters(self, count: int) -> Any:
        if count > len(self._input.value.memory.generator):
            self._add_agents(count)
        return self._input.argument

    def _add_agents(self, count: int) -> None:
        """Extend the memory to a number of agents, which may exceed the number of humans: a robot can be an agent."""
        known, ids = self._input.value.memory, self._ids
        others = range(max(ids, default=0) + 1, max(ids, default=0) + 1 + max(count - len(ids), 0))
        added = first_words(*self._seeds, "deviations", [*ids, *others][len(known.generator) : count])
        new = zeros(Memory, len(added), generator=added, looseness=np.full(len(added), math.nan))
        extended: Any = map(np.concatenate, zip(known, new, strict=True))
        self._input = Packed(Input(self._input.value.parameters, Memory(*extended)))
