"""Facts about a snapshot: how near the robot is to people and things, and how soon it would meet them.

Zones are E. T. Hall's (The Hidden Dimension, 1966), measured from outline to outline.
"""

from __future__ import annotations

import math

import numpy as np

from .portable_math import Array
from .snapshot import Snapshot

INTIMATE_DISTANCE = 0.45  # m
PERSONAL_DISTANCE = 1.2
SOCIAL_DISTANCE = 3.6


def clearances(snapshot: Snapshot) -> Array:
    """Gap between the robot's outline and each person's, (N,), m; negative where they overlap."""
    humans, robot = snapshot.humans, snapshot.robot
    x = humans.state[:, 0] - robot.position[0]
    y = humans.state[:, 1] - robot.position[1]
    return np.sqrt(x * x + y * y) - humans.radius - robot.radius


def clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest person, m; infinite in an empty room."""
    return float(clearances(snapshot).min()) if len(snapshot.humans) else math.inf


def obstacle_clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest wall or piece of furniture, m; infinite where there is none."""
    barriers = snapshot.scene.barriers
    if not len(barriers):
        return math.inf
    return float(barriers.gaps(np.array([snapshot.robot.position])).min()) - snapshot.robot.radius


def times_to_collision(snapshot: Snapshot) -> Array:
    """Seconds until the robot's outline would meet each person's if both kept their velocity, (N,); inf if never.

    Source: the smaller root of |C - V t| = R with C the centres' offset, V the robot's velocity relative to the
    person and R the sum of radii.
    """
    humans, robot = snapshot.humans, snapshot.robot
    cx, cy = humans.state[:, 0] - robot.position[0], humans.state[:, 1] - robot.position[1]
    vx, vy = robot.velocity[0] - humans.state[:, 2], robot.velocity[1] - humans.state[:, 3]
    reach = humans.radius + robot.radius
    closing, square = cx * vx + cy * vy, vx * vx + vy * vy
    beyond = cx * cx + cy * cy - reach * reach
    root = closing * closing - square * beyond
    meets = (closing > 0.0) & (root > 0.0)
    when = (closing - np.sqrt(np.where(meets, root, 0.0))) / np.where(meets, square, 1.0)
    return np.where(beyond <= 0.0, 0.0, np.where(meets, when, math.inf))
