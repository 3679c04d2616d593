"""Where the robot starts and where it shall go: never on each other, and never without a way between."""

from __future__ import annotations

import numpy as np

from ..chance import Chance
from ..entities import Goal, Limits, Robot
from ..errors import SceneError
from ..exact import PI
from ..geometry import Barriers, Disc, Pose, quantised
from ..navigation import FreeSpace
from .config import ScenarioConfig
from .placement import Layout, Spot

PATH_MARGIN = 0.05  # m, that the robot can keep off everything that stands on its way


def reserved(config: ScenarioConfig) -> list[Spot]:
    """Outlines that keep a given start and a given goal free."""
    disc = Disc(config.robot.radius + PATH_MARGIN)
    given = (config.robot.pose, config.goal.position)
    return [(disc, Pose(*place).rounded()) for place in given if place is not None]


def draw_journey(config: ScenarioConfig, layout: Layout, barriers: Barriers, chance: Chance) -> tuple[Robot, Goal]:
    """The robot at its start, and its goal; what is not given is drawn.

    Args:
        layout: the room with everything else in its place.
        barriers: all that the robot must go round.

    Raises:
        SceneError: no pair of start and goal with a way between them was found in `max_attempts`.
    """
    space = FreeSpace(layout.plan.outline, barriers, config.robot.radius + PATH_MARGIN)
    for _ in range(config.max_attempts):
        start = _draw_start(config, layout, chance)
        goal = _draw_goal(config, layout, chance)
        if start and goal and _is_journey(config, space, start, goal):
            return _robot(config, start), _goal(config, goal, chance)
    raise SceneError(
        f"no free start and goal for the robot in a {layout.plan.size} room after {config.max_attempts} attempts; "
        "widen the room, or ask for fewer people and things"
    )


def _draw_start(config: ScenarioConfig, layout: Layout, chance: Chance) -> Pose | None:
    """The given start, or a place if it is free."""
    if config.robot.pose is not None:
        return Pose(*config.robot.pose).rounded()
    pose = Pose(*layout.plan.sample(chance), chance.uniform(-PI, PI)).rounded()
    gap = max(config.robot.clearance, PATH_MARGIN)
    return pose if layout.is_free(Disc(config.robot.radius), pose, gap, gap) else None


def _draw_goal(config: ScenarioConfig, layout: Layout, chance: Chance) -> Pose | None:
    """The given goal, or a place if it is free."""
    if config.goal.position is not None:
        return Pose(*config.goal.position).rounded()
    pose = Pose(*layout.plan.sample(chance)).rounded()
    return pose if layout.is_free(Disc(config.robot.radius), pose, PATH_MARGIN, PATH_MARGIN) else None


def _is_journey(config: ScenarioConfig, space: FreeSpace, start: Pose, goal: Pose) -> bool:
    """Whether start and goal are far enough from each other (unless both are given), free, and joined by a way."""
    dx, dy = goal.x - start.x, goal.y - start.y
    both_given = config.robot.pose is not None and config.goal.position is not None
    apart = config.goal.distance if both_given else max(config.goal.min_distance, config.goal.distance)
    if dx * dx + dy * dy <= apart * apart:
        return False
    free = space.is_free(np.array([start.position, goal.position], dtype=float))
    return bool(free.all()) and space.path(start.position, goal.position) is not None


def _robot(config: ScenarioConfig, start: Pose) -> Robot:
    limits = Limits(**{name: quantised(value) for name, value in config.robot.limits.model_dump().items()})
    return Robot(start, quantised(config.robot.radius), config.robot.kinematics, limits)


def _goal(config: ScenarioConfig, place: Pose, chance: Chance) -> Goal:
    theta = chance.uniform(-PI, PI) if config.goal.theta is None else config.goal.theta
    pose = Pose(place.x, place.y, theta).rounded()
    return Goal(pose.x, pose.y, pose.theta, quantised(config.goal.distance), quantised(config.goal.angle))
