"""What the robot's drive makes of a command: limits of velocity and of acceleration."""

from __future__ import annotations

import math

from ..entities import Robot
from ..geometry import Twist


def executable(asked: Twist, now: Twist, robot: Robot, dt: float) -> Twist:
    """The nearest twist to the one asked for that the drive can reach within a tick.

    Args:
        asked: what the controller wants, body frame.
        now: what the drive does at present, body frame; being pushed about does not count.
        robot: its drive and limits. A unicycle has no sideways velocity.
        dt: s.
    """
    limits = robot.limits
    vx = _clamped(asked.vx, -limits.back, limits.ahead)
    vy = _clamped(asked.vy, -limits.sideways, limits.sideways) if robot.kinematics == "holonomic" else 0.0
    omega = _clamped(asked.omega, -limits.turn, limits.turn)
    from_x, from_y = now.vx, now.vy if robot.kinematics == "holonomic" else 0.0
    dx, dy, most = vx - from_x, vy - from_y, limits.acceleration * dt
    change = math.sqrt(dx * dx + dy * dy)
    if change > most:
        vx, vy = from_x + dx * (most / change), from_y + dy * (most / change)
    turn = limits.turn_acceleration * dt
    return Twist(vx, vy, now.omega + _clamped(omega - now.omega, -turn, turn))


def _clamped(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
