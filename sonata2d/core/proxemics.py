"""Gaps between the robot and its surroundings in a snapshot.

Zones are E. T. Hall's (The Hidden Dimension, 1966), measured from outline to outline.
"""

from __future__ import annotations

import math

import numpy as np

from .geometry import to_shoulder_line
from .portable_math import Array
from .snapshot import Snapshot
from .vectors import lengths

INTIMATE_DISTANCE = 0.45  # m
PERSONAL_DISTANCE = 1.2  # m
SOCIAL_DISTANCE = 3.6  # m


def clearances(snapshot: Snapshot) -> Array:
    """Gap between the robot's outline and each pedestrian's, (N,), m; negative where they overlap."""
    humans, robot = snapshot.humans, snapshot.robot
    to_line = to_shoulder_line(humans.position - np.array(robot.position), humans.direction, humans.shoulder)
    return lengths(to_line) - humans.radius - robot.radius


def clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest pedestrian, m; infinite without pedestrians."""
    return float(clearances(snapshot).min()) if len(snapshot.humans) else math.inf


def touched_kind(snapshot: Snapshot) -> str | None:
    """Kind of outline that the robot touches: the first of `human`, `object` and `wall`; None for nothing."""
    touched = {contact.kind for contact in snapshot.contacts}
    return next((kind for kind in ("human", "object", "wall") if kind in touched), None)


def obstacle_clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest wall or piece of furniture, m; infinite without obstacles."""
    barriers = snapshot.scene.barriers
    if not len(barriers):
        return math.inf
    return float(barriers.gaps(np.array([snapshot.robot.position])).min()) - snapshot.robot.radius
