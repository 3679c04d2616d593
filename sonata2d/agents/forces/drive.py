"""The drive towards where one wants to go, and the hold of those who stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import Array

BRISK = 1.0  # m/s, from which the starting time counts for nothing
HELD = 0.8  # of the desired speed, below which the following time counts in full
HARDEST = 4.0  # m/s2, at which people start or brake


def desired_acceleration(velocity: Array, direction: Array, desired_speed: Array, *, relaxation_time: float) -> Array:
    """Accelerate each human towards its desired velocity.

    Args:
        velocity: (N, 2), m/s, world frame.
        direction: (N, 2), unit vectors towards each human's next waypoint, or zero to stop.
        desired_speed: (N,), m/s.
        relaxation_time: seconds in which a lag fades; positive.

    Returns:
        (N, 2), m/s2.

    Raises:
        ValueError: relaxation_time is zero or less.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, eq. 2.
    """
    if relaxation_time <= 0.0:
        raise ValueError(f"relaxation_time must be positive, got {relaxation_time}")
    tau = relaxation_time  # τ
    return (direction * desired_speed[:, None] - velocity) / tau


@dataclass(frozen=True, slots=True)
class Gait:
    """In which time a lag fades, s, all positive.

    Attributes:
        relaxation_time: of speed, for one who walks freely.
        following_time: of speed, for one whom others hold to less than `HELD` of the desired speed.
        starting_time: of speed, for one who hardly moves.
        turning_time: of what goes across the way.
    """

    relaxation_time: float
    following_time: float
    starting_time: float
    turning_time: float


def paced_acceleration(velocity: Array, direction: Array, speed: Array, desired_speed: Array, gait: Gait) -> Array:
    """As `desired_acceleration`, for people who start at once, follow others smoothly, and turn quickly.

    Args:
        velocity: (N, 2), m/s.
        direction: (N, 2), unit vectors, or zero to stop.
        speed: (N,), m/s, that the others allow.
        desired_speed: (N,), m/s, without them.
        gait: the times.

    Returns:
        (N, 2), m/s2.

    Source: ours; the times were found on recorded pedestrians.
    """
    ahead = velocity[:, 0] * direction[:, 0] + velocity[:, 1] * direction[:, 1]
    along = direction * ahead[:, None]
    lost = np.where(desired_speed > 1e-3, 1.0 - speed / np.maximum(desired_speed, 1e-3), 0.0)  # who wants to stop, does
    held = np.minimum(np.maximum(lost / (1.0 - HELD), 0.0), 1.0)
    tau = gait.relaxation_time + (gait.following_time - gait.relaxation_time) * held
    tau = gait.starting_time + (tau - gait.starting_time) * np.minimum(np.maximum(ahead / BRISK, 0.0), 1.0)
    wanted = np.minimum(np.maximum((speed - ahead) / tau, -HARDEST), HARDEST)
    return direction * wanted[:, None] - (velocity - along) / gait.turning_time


def standing_acceleration(position: Array, velocity: Array, home: Array, *, rate: float = 2.0) -> Array:
    """Bring back whoever stands and was pushed: a critically damped pull to where they stood.

    Args:
        position: (N, 2), m.
        velocity: (N, 2), m/s.
        home: (N, 2), m, where they stand.
        rate: 1/s; most of the way back takes some 2 / rate seconds.

    Returns:
        (N, 2), m/s2.
    """
    return (home - position) * (rate * rate) - velocity * (2.0 * rate)
