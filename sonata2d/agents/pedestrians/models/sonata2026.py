"""`sonata2026`: the default pedestrian model, calibrated on recorded pedestrians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....core.portable_math import PI, Array, exp, unit_vectors
from ....core.scene import Scene
from .base import Gait, Walkers, paced_acceleration, wall_acceleration


def nearness_acceleration(
    dx: Array,
    dy: Array,
    looking: Array,
    weight: Array,
    touching: Array,
    *,
    strength: float,
    reach: float,
    anisotropy: float,
) -> Array:
    """Push away from who is near now.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        looking: (M, 2), unit vectors that say where ahead is, or zero: then all sides weigh alike.
        weight: (M, M), how much column i minds row j.
        touching: (M, M), m, distance of their centres when they touch.
        strength: m/s2, at touch.
        reach: m, in which the push falls to 1/e.
        anisotropy: 0..1, how much those behind still count.

    Returns:
        (M, 2), m/s2, on column i.

    Source: Helbing & Johansson, Encyclopedia of Complexity (2009), Pedestrian, Crowd and Evacuation Dynamics, eqs 5-7.
    """
    d = np.maximum(np.sqrt(dx * dx + dy * dy), 0.01)
    cosine = (dx * looking[:, 0] + dy * looking[:, 1]) / d
    seen = anisotropy + (1.0 - anisotropy) * (0.5 + 0.5 * cosine)
    push = weight * seen * (-strength) * exp(np.minimum(touching - d, 0.0) / reach) / d
    return np.stack((np.add.reduce(push * dx, axis=0), np.add.reduce(push * dy, axis=0)), axis=1)


def anticipation_acceleration(
    dx: Array,
    dy: Array,
    velocity: Array,
    weight: Array,
    touching: Array,
    *,
    strength: float,
    reach: float,
    horizon: float,
    side: float,
) -> Array:
    """Push away from where each other will be when both are nearest, if they go on as they do.

    Whom one does not come nearer to counts for nothing, and who is closed in on slowly for little.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        weight: (M, M), how much column i minds row j.
        touching: (M, M), m, distance of their centres when they touch.
        strength: m/s2, where the outlines would touch.
        reach: m, in which the push falls to 1/e.
        horizon: s until then, in which it falls to 1/e.
        side: m, by which the others are seen off to one side, + for the left: who meets head-on evades to the right.

    Returns:
        (M, 2), m/s2, on column i.

    Source: Zanlungo, Ikeda & Kanda, EPL 93 (2011) 68005, eqs 5-7, with a time to the nearest approach for each pair.
    """
    ux, uy = (velocity[:, None, k] - velocity[None, :, k] for k in (0, 1))  # of j as seen from i
    square = ux * ux + uy * uy
    closing = np.maximum(-(dx * ux + dy * uy), 0.0)
    t = np.minimum(closing / np.maximum(square, 1e-4), 10.0)
    closing = np.minimum(closing / np.maximum(np.sqrt(dx * dx + dy * dy), 0.01), 1.0)  # m/s, 1 counts in full
    fx, fy = dx + ux * t, dy + uy * t  # from i to j at the nearest approach
    if side:
        speed = np.sqrt(np.maximum(square, 1e-6))
        off = side * np.where(t > 0.0, 1.0, 0.0) / speed
        fx, fy = fx + uy * off, fy - ux * off  # to the left of the way on which j is met
    d = np.maximum(np.sqrt(fx * fx + fy * fy), 0.01)
    near = exp(np.minimum(touching - d, 0.0) / reach - t / horizon)
    push = weight * closing * (-strength) * near / d
    return np.stack((np.add.reduce(push * fx, axis=0), np.add.reduce(push * fy, axis=0)), axis=1)


FURTHEST = 1.0  # m, beyond which a lag or a distance pulls no harder


def company_acceleration(
    dx: Array, dy: Array, direction: Array, member: Array, bond: Array,
    *, cohesion: float, spacing: float, abreast: float,
) -> Array:  # fmt: skip
    """Draw level with the others of one's group, and close up to them.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        direction: (M, 2), unit vectors to where each wants to go, or zero.
        member: (M, M), 1 where row j walks in column i's group (not i itself), else 0.
        bond: (M,), 0..1, how much each keeps to the group.
        cohesion: 1/s2, pull to the centre of the others for each metre beyond where it would be if all were abreast.
        spacing: m, between neighbours abreast.
        abreast: 1/s2, pull along the way for each metre that they are ahead, or behind.

    Returns:
        (M, 2), m/s2, zero for who walks alone.

    Source: the aims are those of Moussaïd et al., PLoS ONE 5 (2010) e10047; the law is ours: who is behind hurries as
    much as who is ahead waits, so that a group keeps its pace.
    """
    count = np.maximum(np.add.reduce(member, axis=0), 1.0)
    wide = spacing * 0.5 * (count + 1.0)
    cx, cy = np.add.reduce(member * dx, axis=0) / count, np.add.reduce(member * dy, axis=0) / count
    ex, ey = direction[:, 0], direction[:, 1]
    lag = bond * abreast * np.minimum(np.maximum(cx * ex + cy * ey, -FURTHEST), FURTHEST)
    apart = np.sqrt(cx * cx + cy * cy)
    pull = bond * cohesion * np.minimum(np.maximum(apart - wide, 0.0), FURTHEST) / np.maximum(apart, 1e-6)
    return np.stack((lag * ex + pull * cx, lag * ey + pull * cy), axis=1)


@dataclass(frozen=True, slots=True)
class Strip:
    """What a walker needs ahead.

    Attributes:
        breadth: m, half of its width for two of a person's size.
        distance: m, gap that is left when all stand; below 0: they would touch before they stop.
        time: s, in which the gap beyond that would be walked.
    """

    breadth: float
    distance: float
    time: float


def free_speed(ahead: Array, aside: Array, touching: Array, weight: Array, strip: Strip) -> Array:
    """The speed at which nobody ahead is run into: the least over all of (gap - distance) / time.

    The gap is from outline to outline along the way; it grows without bound towards the edge of the strip, so that
    nobody counts of a sudden.

    Args:
        ahead, aside: (M, M), m, of row j from column i, along and across the way that i wants to go.
        touching: (M, M), m, how far apart their centres are when they touch.
        weight: (M, M), how much column i minds row j: gaps to those who count less seem wider.
        strip: what is needed ahead.

    Returns:
        (M,), m/s, 0 or more; inf where nobody is ahead.

    Source: Tordeux, Chraibi & Seyfried, Traffic and Granular Flow '15 (2016) 225, eq. 2; the soft edge is ours.
    """
    edge = (aside * aside) / (strip.breadth * strip.breadth)
    share = weight * (1.0 - edge * edge)
    counts = (ahead > 0.0) & (share > 0.0)
    gap = (ahead - touching - strip.distance) / (np.where(counts, share, 1.0) * strip.time)
    least: Array = np.minimum.reduce(np.where(counts, gap, np.inf), axis=0)
    return np.maximum(least, 0.0)


ANGLES = (0.0, 25.0, -25.0, 50.0, -50.0, 75.0, -75.0)  # degrees from the way that one wants to go, left positive
_TURNS = unit_vectors(np.array(ANGLES) * (PI / 180.0))  # (K, 2)


@dataclass(frozen=True, slots=True)
class Choice:
    """How a way is chosen.

    Attributes:
        outlook: s, that one looks ahead for a way.
        side: m/s, by which directions to the right promise more.
        habit: m/s, by which the direction that one goes already promises more: a side once taken is kept.
        decision: m/s, the loss of promise at which a direction counts 1/e.
        queueing: 0..1, how little those who go the same way are walked round: 1 follows them, 0 overtakes.
    """

    outlook: float
    side: float
    habit: float
    decision: float
    queueing: float


def steered(
    dx: Array, dy: Array, velocity: Array, direction: Array, desired_speed: Array, touching: Array, weight: Array,
    *, choice: Choice, strip: Strip,
) -> tuple[Array, Array]:  # fmt: skip
    """Where to walk, and how fast, so as to get on best.

    Each direction promises the speed that its gap allows, times its cosine with the way; who comes against one counts
    as so much nearer, and who goes away as so much farther off, as they walk in the outlook. Directions are mixed by
    their promises, so that a small change of the world is a small change of the way.

    Args:
        dx, dy: (M, M), m, from column i to row j.
        velocity: (M, 2), m/s.
        direction: (M, 2), unit vectors, or zero for who does not walk.
        desired_speed: (M,), m/s.
        touching, weight, strip: as in `free_speed`.
        choice: how they choose.

    Returns:
        Unit vectors (M, 2), or zero; and (M,), m/s.

    Source: the idea is that of Moussaïd, Helbing & Theraulaz, PNAS 108 (2011) 6884; gaps instead of lines of sight.
    """
    ex, ey = direction[:, 0], direction[:, 1]
    ahead, aside = dx * ex + dy * ey, dx * ey - dy * ex
    vx, vy = velocity[:, 0, None] * choice.outlook, velocity[:, 1, None] * choice.outlook
    later, off = vx * ex + vy * ey, vx * ey - vy * ex  # m, that row j walks along and across the way of column i
    free = free_speed(ahead, aside, touching, weight, strip)
    soon = free_speed(_later(ahead, later), aside, touching, weight, strip)
    held = np.flatnonzero((np.minimum(free, soon) < desired_speed) & (direction != 0.0).any(axis=1))
    if len(held) == 0:
        return direction, np.minimum(free, desired_speed)
    held = np.append(held, held[:1])  # an array one wide would be summed in another order
    promise = np.empty((len(ANGLES), len(held)))
    own, wanted = direction[held], desired_speed[held]
    ahead, aside, touching, weight = ahead[:, held], aside[:, held], touching[:, held], weight[:, held]
    later, off = later[:, held], off[:, held]
    alike = direction[:, 0, None] * own[:, 0] + direction[:, 1, None] * own[:, 1]
    in_the_way = weight * (1.0 - choice.queueing * np.minimum(np.maximum(2.0 * alike, 0.0), 1.0))
    goes = _going(velocity[held], own)
    for k, (c, s) in enumerate(_TURNS.tolist()):
        there = _later(ahead * c - aside * s, later * c - off * s)
        speed = free_speed(there, ahead * s + aside * c, touching, in_the_way, strip)
        promise[k] = np.minimum(speed, wanted) * c - choice.side * s + choice.habit * (goes[:, 0] * c + goes[:, 1] * s)
    share = exp((promise - np.maximum.reduce(promise, axis=0)) / choice.decision)
    x, y = (np.add.reduce(share * _TURNS[:, k, None], axis=0) for k in (0, 1))
    size = np.maximum(np.sqrt(x * x + y * y), 1e-6)
    x, y = x / size, y / size
    way, pace = direction.copy(), np.minimum(free, desired_speed)
    way[held, 0], way[held, 1] = own[:, 0] * x - own[:, 1] * y, own[:, 1] * x + own[:, 0] * y
    there, across = ahead * x - aside * y, ahead * y + aside * x
    pace[held] = np.minimum(free_speed(there, across, touching, weight, strip), wanted)
    return way, pace


def _going(velocity: Array, own: Array) -> Array:
    """(B, 2): the way they go now, ahead and left of the way they want to go; below 1 m/s less than a unit vector."""
    x, y = velocity[:, 0], velocity[:, 1]
    size = np.maximum(np.sqrt(x * x + y * y), 1.0)
    return np.stack(((x * own[:, 0] + y * own[:, 1]) / size, (y * own[:, 0] - x * own[:, 1]) / size), axis=1)


def _later(ahead: Array, by: Array) -> Array:
    """How far ahead others count as being, m: those ahead stay ahead."""
    later: Array = np.where(ahead > 0.0, np.maximum(ahead + by, 1e-3), ahead)
    return later


BACKWARDS = 0.2  # of the speed ahead, that is gone backwards


@dataclass(frozen=True, slots=True)
class Sonata2026:
    """Its parameters, found by `benchmarks/calibrate.py` and by hand: docs/models.md says which."""

    relaxation_time: float = 0.61  # s
    following_time: float = 2.0  # s
    starting_time: float = 0.16  # s
    turning_time: float = 0.36  # s
    breadth: float = 0.3  # m
    standstill: float = -0.13  # m
    headway: float = 0.95  # s
    decision: float = 0.08  # m/s
    habit: float = 0.5  # m/s
    outlook: float = 1.18  # s
    queueing: float = 1.0
    bias: float = 0.08  # m/s
    foresight: float = 1.01  # m/s2
    foresight_reach: float = 0.47  # m
    horizon: float = 0.9  # s
    side: float = 0.1  # m
    nearness: float = 0.45  # m/s2
    nearness_reach: float = 0.22  # m
    anisotropy: float = 0.47
    wall_strength: float = 0.2  # m/s2
    wall_reach: float = 0.05  # m
    abreast: float = 0.25  # 1/s2
    cohesion: float = 0.4  # 1/s2
    spacing: float = 0.85  # m
    among_group: float = 0.42  # how much members mind each other who have goals of their own


class Sonata2026Model:
    """Walk at the speed that the gap ahead allows, keep off where others will be, and a little off who is near."""

    evaluations = 1
    headed = False

    def __init__(self, scene: Scene) -> None:
        law = PARAMETERS
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, law
        radius = np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float)
        self._gait = Gait(law.relaxation_time, law.following_time, law.starting_time, law.turning_time)
        self._strip = Strip(law.breadth, law.standstill, law.headway)
        self._choice = Choice(law.outlook, self._side * law.bias, law.habit, law.decision, law.queueing)
        self._touching = radius[:, None] + radius[None, :]

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, touching = self._law, walkers.position, walkers.velocity, self._touching
        dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
        weight = walkers.weight
        if walkers.member is not None and walkers.bond is not None:
            less = (1.0 - law.among_group) * (1.0 - walkers.bond)
            weight = weight * (1.0 - less * walkers.member)
        way, speed = steered(
            dx, dy, velocity, walkers.desired_direction, walkers.desired_speed, touching, weight,
            choice=self._choice, strip=self._strip,
        )  # fmt: skip
        faces = walkers.body_direction[:, 0] * way[:, 0] + walkers.body_direction[:, 1] * way[:, 1]
        speed = speed * np.minimum(np.maximum(1.0 + faces, BACKWARDS), 1.0)  # who faces away turns before they walk
        total = paced_acceleration(velocity, way, speed, walkers.desired_speed, self._gait)
        if walkers.member is not None and walkers.bond is not None:
            total += company_acceleration(
                dx, dy, walkers.desired_direction, walkers.member, walkers.bond, cohesion=law.cohesion,
                spacing=law.spacing, abreast=law.abreast,
            )  # fmt: skip
        total += anticipation_acceleration(
            dx, dy, velocity, weight, touching, strength=law.foresight, reach=law.foresight_reach,
            horizon=law.horizon, side=self._side * law.side,
        )  # fmt: skip
        total += nearness_acceleration(
            dx, dy, walkers.desired_direction, weight, touching, strength=law.nearness, reach=law.nearness_reach,
            anisotropy=law.anisotropy,
        )  # fmt: skip
        total += wall_acceleration(
            position, walkers.radius, self._barriers, strength=law.wall_strength, reach=law.wall_reach
        )
        return total


PARAMETERS = Sonata2026()
