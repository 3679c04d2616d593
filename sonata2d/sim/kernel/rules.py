"""Numbers of a scene that stay the same during an episode, as one array for kernels."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from ...core.entities import Human
from ...core.humans import MAXIMUM_SPEED_RATIO, RESPONSE_TIME
from ...core.portable_math import Array
from ...core.scene import Scene
from ...registry import drive_class

# Items of the array. TICK and SUBSTEP in s; CONTACT_DISTANCE, ROBOT_RADIUS (of the circle around the outline) and
# HUMAN_RANGE in m; OWN_SPEED in m/s; HOLONOMIC (moves sideways), COUPLED (turns only as it moves) and GUARD are 0 or 1,
# SIDE is -1 or 1.
(
    TICK, SUBSTEP, SUBSTEPS, CONTACT_DISTANCE, GUARD, SIDE, ROBOT_RADIUS, HOLONOMIC, COUPLED, OWN_SPEED, HUMAN_RANGE,
) = range(11)  # fmt: skip

_PUSH_SPEED = 1.0  # m/s, that a push adds at least


def rules_of(scene: Scene, steps: int, fastest_person: float) -> Array:
    """The array of a scene, (11,).

    Args:
        scene: rules, robot and pedestrians.
        steps: of the physics in a tick.
        fastest_person: m/s; pedestrians are expected to be at least as fast.
    """
    rules, robot = scene.rules, scene.robot
    limits = robot.limits
    speeds = [2.0 * human.desired_speed for human in scene.humans]
    speeds += [_track_speed(human, rules.dt) for human in scene.humans if human.track]
    values = {
        TICK: rules.dt,
        SUBSTEP: rules.dt / steps,
        SUBSTEPS: steps,
        CONTACT_DISTANCE: rules.contact_distance,
        GUARD: rules.guard,
        SIDE: rules.side,
        ROBOT_RADIUS: robot.radius,
        HOLONOMIC: robot.moves_sideways,
        COUPLED: drive_class(robot.kinematics).is_coupled,
        OWN_SPEED: max(limits.ahead + limits.sideways, limits.back + limits.sideways, robot.top_speed),
        HUMAN_RANGE: max([fastest_person, *speeds]) * rules.dt + rules.contact_distance,
    }
    return np.array([float(values[k]) for k in range(len(values))])


def walking_speeds(scene: Scene) -> Array:
    """(N,), m/s, that the pedestrians reach by themselves, or have at the start."""
    starts = np.array([math.sqrt(vx * vx + vy * vy) for vx, vy in (human.velocity for human in scene.humans)])
    speeds: Array = np.maximum(MAXIMUM_SPEED_RATIO * scene.human_table.desired_speed, starts)
    return speeds


def maximum_speeds(scene: Scene) -> Array:
    """(N,), m/s, to which the speeds of pedestrians are limited; recorded ones excepted, and whoever they push.

    A contact gives a pedestrian up to half of the speed of the one that pushes it, of equal mass. Its acceleration was
    chosen before the contact and lasts for the rest of the tick, so that it may exceed the speed that it was chosen for
    by what it changes in a tick. A robot without the guard may run into them. Rigid bodies without friction have no
    such limit: one that is pressed into a narrow angle leaves it at any speed.
    """
    speeds = walking_speeds(scene)
    change = 2.0 * speeds.max(initial=0.0) * min(max(scene.rules.dt / RESPONSE_TIME, 0.25), 1.0)
    push: float = max(_PUSH_SPEED, change)
    return speeds + (push if scene.rules.guard else push + max(robot.top_speed for robot, _ in scene.tasks))


def _track_speed(human: Human, dt: float) -> float:
    """Maximum speed along the track of a recorded pedestrian, m/s."""
    steps = ((x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in pairwise(human.track))
    return max((math.sqrt(dx * dx + dy * dy) for dx, dy in steps), default=0.0) / dt
