"""Gaps between the robot and its surroundings in a snapshot.

Zones are E. T. Hall's (The Hidden Dimension, 1966), measured from outline to outline.
"""

from __future__ import annotations

import math

import numpy as np

from .geometry import shoulder_lines, to_shoulder_line
from .portable_math import Array
from .separation import outline_gaps
from .snapshot import RobotState, Snapshot
from .vectors import lengths

INTIMATE_DISTANCE = 0.45  # m
PERSONAL_DISTANCE = 1.2  # m
SOCIAL_DISTANCE = 3.6  # m


def clearances(snapshot: Snapshot) -> Array:
    """Gap between the robot's outline and each pedestrian's, (N,), m; negative where they overlap."""
    humans, robot = snapshot.humans, snapshot.robot
    if len(robot.body.outline.core) > 1:
        left, right = shoulder_lines(humans.position, humans.direction, humans.shoulder)
        lines = np.concatenate((left, right, humans.radius[:, None]), axis=1)
        return _gaps(robot, lines)
    to_line = to_shoulder_line(humans.position - np.array(robot.position), humans.direction, humans.shoulder)
    return lengths(to_line) - humans.radius - robot.radius


def _gaps(robot: RobotState, lines: Array) -> Array:
    """Gaps between the outline of a robot that is no disc and thick lines, (M, 5); (M,), m."""
    position, direction = np.array([robot.position]), np.array([robot.direction])
    gaps: Array = outline_gaps(robot.body.outline, position, direction, lines[None])[0]
    return gaps


def clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest pedestrian, m; infinite without pedestrians."""
    return float(clearances(snapshot).min()) if len(snapshot.humans) else math.inf


def touched_kind(snapshot: Snapshot) -> str | None:
    """Kind of outline that the robot touches: the first of `human`, `robot`, `object`, and `wall` or door.

    None: it touches nothing.
    """
    touched = {"wall" if contact.kind == "door" else contact.kind for contact in snapshot.contacts}
    return next((kind for kind in ("human", "robot", "object", "wall") if kind in touched), None)


def obstacle_clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest wall, door or piece of furniture, m; infinite without obstacles."""
    barriers = snapshot.barriers
    if not len(barriers):
        return math.inf
    if len(snapshot.robot.body.outline.core) > 1:
        return float(_gaps(snapshot.robot, barriers.table[:, :5]).min())
    return float(barriers.gaps(np.array([snapshot.robot.position])).min()) - snapshot.robot.radius
