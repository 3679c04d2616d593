"""`sonata2026`: the default pedestrian model, calibrated on recorded pedestrians; `docs/models.md` gives the formulas.

Pair matrices have row j for the neighbour and column i for the pedestrian that the force acts on, see `base`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import PI, Array, exp, unit_vectors
from ....core.scene import Scene
from .base import TimeConstants, Walkers, adaptive_acceleration, pair_weights, wall_acceleration


def proximity_acceleration(
    dx: Array,
    dy: Array,
    direction: Array,
    weight: Array,
    contact_distance: Array,
    *,
    strength: float,
    decay_length: float,
    anisotropy: float,
) -> Array:
    """Repulsion from the present positions of neighbours.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        direction: (M, 2), forward directions, unit vectors; zero: all directions have equal weight.
        weight: (M, M), how much i (column) attends to j (row), in [0, 1].
        contact_distance: (M, M), m, distance of centres at contact.
        strength: m/s^2, at contact.
        decay_length: distance over which the repulsion falls to 1/e, m.
        anisotropy: weight of neighbours behind, in [0, 1]; 1 ahead.

    Returns:
        (M, 2), m/s^2, on i.

    Source: Helbing & Johansson, Encyclopedia of Complexity (2009), Pedestrian, Crowd and Evacuation Dynamics, eqs 5-7.
    """
    d = np.maximum(np.sqrt(dx * dx + dy * dy), 0.01)
    cosine = (dx * direction[:, 0] + dy * direction[:, 1]) / d
    sight = anisotropy + (1.0 - anisotropy) * (0.5 + 0.5 * cosine)
    push = weight * sight * (-strength) * exp(np.minimum(contact_distance - d, 0.0) / decay_length) / d
    return np.stack((np.add.reduce(push * dx, axis=0), np.add.reduce(push * dy, axis=0)), axis=1)


def anticipation_acceleration(
    dx: Array,
    dy: Array,
    velocity: Array,
    weight: Array,
    contact_distance: Array,
    *,
    strength: float,
    decay_length: float,
    decay_time: float,
    offset: float,
) -> Array:
    """Repulsion between the positions of a pair at its closest approach, predicted with constant velocities.

    Pairs that do not approach contribute nothing; the force scales with the closing speed, up to 1 m/s.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        weight: (M, M), how much i (column) attends to j (row), in [0, 1].
        contact_distance: (M, M), m, distance of centres at contact.
        strength: m/s^2, where the outlines would touch.
        decay_length: predicted gap over which the force falls to 1/e, m.
        decay_time: time to the closest approach over which the force falls to 1/e, s.
        offset: m, by which others are perceived to one side, positive to the left: head-on encounters are then evaded
            to the right.

    Returns:
        (M, 2), m/s^2, on i.

    Source: Zanlungo, Ikeda & Kanda, EPL 93 (2011) 68005, eqs 5-7, with a separate time of closest approach per pair.
    """
    ux, uy = (velocity[:, None, k] - velocity[None, :, k] for k in (0, 1))  # velocity of j relative to i
    square = ux * ux + uy * uy
    closing = np.maximum(-(dx * ux + dy * uy), 0.0)
    t = np.minimum(closing / np.maximum(square, 1e-4), 10.0)
    closing = np.minimum(closing / np.maximum(np.sqrt(dx * dx + dy * dy), 0.01), 1.0)  # m/s
    fx, fy = dx + ux * t, dy + uy * t  # from i to j at the closest approach
    if offset:
        speed = np.sqrt(np.maximum(square, 1e-6))
        scale = offset * np.where(t > 0.0, 1.0, 0.0) / speed
        fx, fy = fx + uy * scale, fy - ux * scale  # perpendicular to the relative velocity
    d = np.maximum(np.sqrt(fx * fx + fy * fy), 0.01)
    near = exp(np.minimum(contact_distance - d, 0.0) / decay_length - t / decay_time)
    push = weight * closing * (-strength) * near / d
    return np.stack((np.add.reduce(push * fx, axis=0), np.add.reduce(push * fy, axis=0)), axis=1)


MAXIMUM_GROUP_DISTANCE = 1.0  # m; a larger lag, or a larger excess distance from the group, pulls no harder


def group_cohesion_acceleration(
    dx: Array, dy: Array, direction: Array, member: Array, bond: Array,
    *, cohesion: float, spacing: float, abreast: float,
) -> Array:  # fmt: skip
    """Keep walking groups abreast and close together.

    Members behind speed up as much as members ahead slow down, so that a group keeps its pace.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        direction: (M, 2), desired directions, unit vectors or zero.
        member: (M, M), 1 where two agents walk in one group, else 0; 0 on the diagonal.
        bond: (M,), in [0, 1], how closely each agent keeps to its group.
        cohesion: pull towards the centre of the other members, per metre beyond its distance in an abreast formation,
            1/s^2.
        spacing: between neighbours abreast, m.
        abreast: pull along the desired direction, per metre that the other members are ahead (or behind), 1/s^2.

    Returns:
        (M, 2), m/s^2; zero for agents without a group.

    Source: the aims are those of Moussaïd et al., PLoS ONE 5 (2010) e10047; the formula is ours.
    """
    count = np.maximum(np.add.reduce(member, axis=0), 1.0)
    width = spacing * 0.5 * (count + 1.0)
    cx, cy = np.add.reduce(member * dx, axis=0) / count, np.add.reduce(member * dy, axis=0) / count
    ex, ey = direction[:, 0], direction[:, 1]
    limit = MAXIMUM_GROUP_DISTANCE
    lag = bond * abreast * np.minimum(np.maximum(cx * ex + cy * ey, -limit), limit)
    distance = np.sqrt(cx * cx + cy * cy)
    pull = bond * cohesion * np.minimum(np.maximum(distance - width, 0.0), limit) / np.maximum(distance, 1e-6)
    return np.stack((lag * ex + pull * cx, lag * ey + pull * cy), axis=1)


@dataclass(frozen=True, slots=True)
class Headway:
    """The free space that a pedestrian needs ahead.

    Attributes:
        half_width: half the width of the strip ahead in which others count, m.
        standstill_gap: gap at which the permitted speed is 0, m; below 0, bodies would touch first.
        time_gap: time in which the gap beyond `standstill_gap` would be walked, s.
    """

    half_width: float
    standstill_gap: float
    time_gap: float


def headway_speed(ahead: Array, aside: Array, contact_distance: Array, weight: Array, headway: Headway) -> Array:
    """The speed that the pedestrians ahead permit: the minimum over all of (gap - standstill_gap) / time_gap.

    The gap is the clearance along the path. It grows without bound towards the edge of the strip, so that the speed
    changes continuously when a pedestrian enters the strip.

    Args:
        ahead, aside: (M, M), m, of j (row) relative to i (column), along and across i's path.
        contact_distance: (M, M), m, distance of centres at contact.
        weight: (M, M), how much i (column) attends to j (row), in [0, 1]; smaller weights enlarge the gap.
        headway: the space needed ahead.

    Returns:
        (M,), m/s, not negative; inf where the strip is empty.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge is ours.
    """
    edge = (aside * aside) / (headway.half_width * headway.half_width)
    effect = weight * (1.0 - edge * edge)
    counts = (ahead > 0.0) & (effect > 0.0)
    gap = ahead - contact_distance - headway.standstill_gap
    speed = gap / (np.where(counts, effect, 1.0) * headway.time_gap)
    minimum: Array = np.minimum.reduce(np.where(counts, speed, np.inf), axis=0)
    return np.maximum(minimum, 0.0)


ANGLES = (0.0, 25.0, -25.0, 50.0, -50.0, 75.0, -75.0)  # degrees from the desired direction, positive to the left
_TURNS = unit_vectors(np.array(ANGLES) * (PI / 180.0))  # (K, 2)


@dataclass(frozen=True, slots=True)
class Steering:
    """How a walking direction is chosen.

    Attributes:
        look_ahead_time: time for which the motion of others is predicted, s.
        side_bonus: additional value of directions to the right, m/s; negative: to the left.
        habit_bonus: additional value of the current direction, m/s, so that a chosen side is kept.
        temperature: difference of values at which the weight of a direction falls to 1/e, m/s.
        queueing: in [0, 1]; 1 follows pedestrians that walk in the same direction, 0 overtakes them.
    """

    look_ahead_time: float
    side_bonus: float
    habit_bonus: float
    temperature: float
    queueing: float


def steer(
    dx: Array, dy: Array, velocity: Array, direction: Array, desired_speed: Array, contact_distance: Array,
    weight: Array, *, steering: Steering, headway: Headway,
) -> tuple[Array, Array]:  # fmt: skip
    """Choose the direction and speed with the best progress.

    The value of a direction is the speed that its headway permits, times its cosine with the desired direction.
    Oncoming pedestrians count as nearer, and receding ones as farther, by the distance that they walk within the
    look-ahead time. The result is the mean of the directions weighted by their values, so that a small change of the
    positions changes the direction by little.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        direction: (M, 2), desired directions, unit vectors; zero for agents that stand.
        desired_speed: (M,), m/s.
        contact_distance, weight, headway: as in `headway_speed`.
        steering: the parameters of the choice.

    Returns:
        Directions (M, 2), unit vectors or zero, and speeds (M,), m/s.

    Source: the idea is that of Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    ex, ey = direction[:, 0], direction[:, 1]
    ahead, aside = dx * ex + dy * ey, dx * ey - dy * ex
    vx, vy = velocity[:, 0, None] * steering.look_ahead_time, velocity[:, 1, None] * steering.look_ahead_time
    move_ahead, move_aside = vx * ex + vy * ey, vx * ey - vy * ex  # m, displacement of j along and across i's path
    free_speed = headway_speed(ahead, aside, contact_distance, weight, headway)
    future_speed = headway_speed(_predicted(ahead, move_ahead), aside, contact_distance, weight, headway)
    # Only pedestrians that are held up choose a direction; the others keep the desired one.
    is_held = (np.minimum(free_speed, future_speed) < desired_speed) & (direction != 0.0).any(axis=1)
    held = np.flatnonzero(is_held)
    if len(held) == 0:
        return direction, np.minimum(free_speed, desired_speed)
    held = np.append(held, held[:1])  # NumPy sums a single column pairwise; duplicate it to keep the sequential order
    value = np.empty((len(ANGLES), len(held)))
    held_direction, held_speed = direction[held], desired_speed[held]
    ahead, aside, contact_distance = ahead[:, held], aside[:, held], contact_distance[:, held]
    move_ahead, move_aside, weight = move_ahead[:, held], move_aside[:, held], weight[:, held]
    alignment = direction[:, 0, None] * held_direction[:, 0] + direction[:, 1, None] * held_direction[:, 1]
    obstruction = weight * (1.0 - steering.queueing * np.minimum(np.maximum(2.0 * alignment, 0.0), 1.0))
    current = _relative_direction(velocity[held], held_direction)
    for k, (c, s) in enumerate(_TURNS.tolist()):
        future = _predicted(ahead * c - aside * s, move_ahead * c - move_aside * s)
        speed = headway_speed(future, ahead * s + aside * c, contact_distance, obstruction, headway)
        habit = steering.habit_bonus * (current[:, 0] * c + current[:, 1] * s)
        value[k] = np.minimum(speed, held_speed) * c - steering.side_bonus * s + habit
    mix = exp((value - np.maximum.reduce(value, axis=0)) / steering.temperature)
    x, y = (np.add.reduce(mix * _TURNS[:, k, None], axis=0) for k in (0, 1))
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    x, y = x / size, y / size
    chosen, speed = direction.copy(), np.minimum(free_speed, desired_speed)
    chosen[held, 0] = held_direction[:, 0] * x - held_direction[:, 1] * y
    chosen[held, 1] = held_direction[:, 1] * x + held_direction[:, 0] * y
    along, across = ahead * x - aside * y, ahead * y + aside * x
    speed[held] = np.minimum(headway_speed(along, across, contact_distance, weight, headway), held_speed)
    return chosen, speed


def _relative_direction(velocity: Array, direction: Array) -> Array:
    """The current direction of motion (B, 2) in the frame of the desired one: ahead, left.

    A unit vector; below 1 m/s shorter in proportion to the speed.
    """
    x, y = velocity[:, 0], velocity[:, 1]
    size = np.maximum(np.sqrt(x * x + y * y), 1.0)
    return np.stack(
        ((x * direction[:, 0] + y * direction[:, 1]) / size, (y * direction[:, 0] - x * direction[:, 1]) / size), axis=1
    )


def _predicted(ahead: Array, displacement: Array) -> Array:
    """Distance ahead after a displacement, m; others that are ahead stay ahead, and others behind are unchanged."""
    predicted: Array = np.where(ahead > 0.0, np.maximum(ahead + displacement, 1e-3), ahead)
    return predicted


BACKWARDS_SPEED = 0.2  # backward speed as a fraction of the forward speed


@dataclass(frozen=True, slots=True)
class Sonata2026:
    """Parameters, found by `benchmarks/calibrate.py` and set by hand; `docs/models.md` says which.

    The terms that use them describe them: `TimeConstants`, `Headway`, `Steering`, `anticipation_acceleration`,
    `proximity_acceleration`, `wall_acceleration` and `group_cohesion_acceleration`.
    """

    relaxation_time: float = 0.61  # s
    following_time: float = 2.0  # s
    starting_time: float = 0.16  # s
    turning_time: float = 0.36  # s
    headway_half_width: float = 0.3  # m
    standstill_gap: float = -0.13  # m
    time_gap: float = 0.95  # s
    temperature: float = 0.08  # m/s
    habit_bonus: float = 0.5  # m/s
    look_ahead_time: float = 1.18  # s
    queueing: float = 1.0
    side_bonus: float = 0.08  # m/s
    anticipation_strength: float = 1.01  # m/s^2
    anticipation_decay_length: float = 0.47  # m
    anticipation_decay_time: float = 0.9  # s
    anticipation_offset: float = 0.1  # m
    proximity_strength: float = 0.45  # m/s^2
    proximity_decay_length: float = 0.22  # m
    anisotropy: float = 0.47
    wall_strength: float = 0.2  # m/s^2
    wall_decay_length: float = 0.05  # m
    abreast: float = 0.25  # 1/s^2
    cohesion: float = 0.4  # 1/s^2
    spacing: float = 0.85  # m
    group_attention: float = 0.42  # attention between members of a group with goals of their own


class Sonata2026Model:
    """Headway, steering, anticipation, proximity, walls and group cohesion; parameters in `Sonata2026`."""

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        p = PARAMETERS  # read here, so that `benchmarks/calibrate.py` can replace it
        self._barriers, self._side, self._parameters = scene.barriers, scene.rules.side, p
        radius = np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float)
        self._times = TimeConstants(p.relaxation_time, p.following_time, p.starting_time, p.turning_time)
        self._headway = Headway(p.headway_half_width, p.standstill_gap, p.time_gap)
        self._steering = Steering(
            p.look_ahead_time, self._side * p.side_bonus, p.habit_bonus, p.temperature, p.queueing
        )
        self._contact_distance = radius[:, None] + radius[None, :]

    def acceleration(self, walkers: Walkers) -> Array:
        p, contact_distance = self._parameters, self._contact_distance
        position, velocity = walkers.position, walkers.velocity
        dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
        weight = pair_weights(walkers)
        if walkers.member is not None and walkers.bond is not None:
            # Members that keep less to their group (bond < 1) attend less to the other members.
            reduction = (1.0 - p.group_attention) * (1.0 - walkers.bond)
            weight = weight * (1.0 - reduction * walkers.member)
        direction, speed = steer(
            dx, dy, velocity, walkers.desired_direction, walkers.desired_speed, contact_distance, weight,
            steering=self._steering, headway=self._headway,
        )  # fmt: skip
        # Pedestrians that face away from their direction turn before they walk.
        facing = walkers.body_direction[:, 0] * direction[:, 0] + walkers.body_direction[:, 1] * direction[:, 1]
        speed = speed * np.minimum(np.maximum(1.0 + facing, BACKWARDS_SPEED), 1.0)
        total = adaptive_acceleration(velocity, direction, speed, walkers.desired_speed, self._times)
        if walkers.member is not None and walkers.bond is not None:
            total += group_cohesion_acceleration(
                dx, dy, walkers.desired_direction, walkers.member, walkers.bond, cohesion=p.cohesion,
                spacing=p.spacing, abreast=p.abreast,
            )  # fmt: skip
        total += anticipation_acceleration(
            dx, dy, velocity, weight, contact_distance, strength=p.anticipation_strength,
            decay_length=p.anticipation_decay_length, decay_time=p.anticipation_decay_time,
            offset=self._side * p.anticipation_offset,
        )  # fmt: skip
        total += proximity_acceleration(
            dx, dy, walkers.desired_direction, weight, contact_distance, strength=p.proximity_strength,
            decay_length=p.proximity_decay_length, anisotropy=p.anisotropy,
        )  # fmt: skip
        total += wall_acceleration(
            position, walkers.radius, self._barriers, strength=p.wall_strength, decay_length=p.wall_decay_length
        )
        return total


PARAMETERS = Sonata2026()
