"""Gaps between the robot and its surroundings in a snapshot, and times to collision.

Zones are E. T. Hall's (The Hidden Dimension, 1966), measured from outline to outline.
"""

from __future__ import annotations

import math

import numpy as np

from .humans import VX, VY, X, Y
from .portable_math import Array
from .snapshot import Snapshot

INTIMATE_DISTANCE = 0.45  # m
PERSONAL_DISTANCE = 1.2  # m
SOCIAL_DISTANCE = 3.6  # m


def clearances(snapshot: Snapshot) -> Array:
    """Gap between the robot's outline and each pedestrian's, (N,), m; negative where they overlap."""
    humans, robot = snapshot.humans, snapshot.robot
    robot_x, robot_y = robot.position
    dx, dy = humans.state[:, X] - robot_x, humans.state[:, Y] - robot_y
    return np.sqrt(dx * dx + dy * dy) - humans.radius - robot.radius


def clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest pedestrian, m; infinite without pedestrians."""
    return float(clearances(snapshot).min()) if len(snapshot.humans) else math.inf


def obstacle_clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest wall or piece of furniture, m; infinite without obstacles."""
    barriers = snapshot.scene.barriers
    if not len(barriers):
        return math.inf
    return float(barriers.gaps(np.array([snapshot.robot.position])).min()) - snapshot.robot.radius


def times_to_collision(snapshot: Snapshot) -> Array:
    """Time until the outlines of the robot and of each pedestrian touch at constant velocities.

    Returns:
        (N,), s; 0 where they overlap, infinite where they never touch.

    Source: the smaller root of |C - V t| = R with C the offset between the centres, V the robot's velocity relative
    to the pedestrian and R the sum of the radii.
    """
    humans, robot = snapshot.humans, snapshot.robot
    (robot_x, robot_y), (robot_vx, robot_vy) = robot.position, robot.velocity
    cx, cy = humans.state[:, X] - robot_x, humans.state[:, Y] - robot_y
    vx, vy = robot_vx - humans.state[:, VX], robot_vy - humans.state[:, VY]
    radii = humans.radius + robot.radius
    closing, square = cx * vx + cy * vy, vx * vx + vy * vy
    excess = cx * cx + cy * cy - radii * radii
    discriminant = closing * closing - square * excess
    collides = (closing > 0.0) & (discriminant > 0.0)
    time = (closing - np.sqrt(np.where(collides, discriminant, 0.0))) / np.where(collides, square, 1.0)
    return np.where(excess <= 0.0, 0.0, np.where(collides, time, math.inf))
