"""Where twists would lead: rolled out under the drive's limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..entities import Robot
from ..exact import Array, rotation
from ..frame import Snapshot
from ..geometry import Twist


@dataclass(frozen=True)
class Ways:
    """K ways of S steps.

    Attributes:
        x, y: (S, K), m, world frame.
        ahead: (2, S, K), unit vectors of the robot's heading.
        vx, vy: (S, K), m/s, world frame.
        speed: (S, K), m/s.
        onset: (K,) and (K,), m/s, world frame: the first step's velocity while the robot still has its present heading.
    """

    x: Array
    y: Array
    ahead: Array
    vx: Array
    vy: Array
    speed: Array
    onset: tuple[Array, Array]


def rolled_out(twists: Array, snapshot: Snapshot, *, horizon: float, step: float) -> Ways:
    """Follow each twist from where the robot is and what its drive does.

    Args:
        twists: (K, 3), body frame: m/s, m/s, rad/s.
        snapshot: now.
        horizon: s.
        step: s.
    """
    robot = snapshot.robot
    limits, count, steps = robot.body.limits, len(twists), int(horizon / step + 0.5)
    now = robot.executed
    sideways = now.vy if robot.body.kinematics == "holonomic" else 0.0
    dvx, dvy, domega = twists[:, 0] - now.vx, twists[:, 1] - sideways, twists[:, 2] - now.omega
    ramp = np.maximum(np.sqrt(dvx * dvx + dvy * dvy) / limits.acceleration, 1e-6)  # s to get there
    turn_ramp = np.maximum(np.abs(domega) / limits.turn_acceleration, 1e-6)
    rows = np.empty((7, steps, count))
    x, y = np.full(count, robot.position[0]), np.full(count, robot.position[1])
    c, s = np.full(count, robot.heading[0]), np.full(count, robot.heading[1])
    for k in range(steps):
        t = (k + 0.5) * step
        part, turned = np.minimum(t / ramp, 1.0), np.minimum(t / turn_ramp, 1.0)
        vx, vy = now.vx + dvx * part, sideways + dvy * part
        if k == 0:
            onset = vx * c - vy * s, vx * s + vy * c
        tc, ts = rotation((now.omega + domega * turned) * (step / 2))
        c, s = c * tc - s * ts, s * tc + c * ts
        wx, wy = vx * c - vy * s, vx * s + vy * c
        x, y = x + wx * step, y + wy * step
        c, s = c * tc - s * ts, s * tc + c * ts
        rows[:, k] = x, y, c, s, wx, wy, np.sqrt(vx * vx + vy * vy)
    return Ways(rows[0], rows[1], rows[2:4], rows[4], rows[5], rows[6], onset)


def candidates(robot: Robot) -> Array:
    """Twists worth trying, (K, 3): a grid over what the drive can do."""
    limits = robot.limits
    ahead = [-limits.back * 0.6, 0.0, *(limits.ahead * part for part in (0.15, 0.3, 0.5, 0.75, 1.0))]
    sideways = [0.0]
    if robot.kinematics == "holonomic":
        sideways = [-limits.sideways * 0.8, 0.0, limits.sideways * 0.8]
    turns = [limits.turn * part for part in (-1.0, -0.5, -0.15, 0.0, 0.15, 0.5, 1.0)]
    return np.array([(v, w, o) for v in ahead for w in sideways for o in turns], dtype=float)


def twist_of(row: Array) -> Twist:
    """A row of candidates as a twist."""
    vx, vy, omega = row.tolist()
    return Twist(vx, vy, omega)
