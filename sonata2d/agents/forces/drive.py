"""The drive towards where one wants to go, and the hold of those who stand."""

from __future__ import annotations

from ...exact import Array


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
