"""Where the robot starts and where it shall go: never on each other, and never without a way between."""

from __future__ import annotations

import numpy as np

from ..core.entities import Goal, Limits, Robot
from ..core.geometry import Barriers, Disc, Pose, inside_polygon, quantised
from ..core.navigation import FreeSpace
from ..core.portable_math import PI
from ..core.rng import RandomStream
from ..errors import SceneError
from .placement import Layout, Spot
from .scenario.config import ScenarioConfig
from .scenario.people import ways_of

PATH_MARGIN = 0.05  # m, that the robot can keep off everything that stands on its way


def reserved(config: ScenarioConfig) -> list[Spot]:
    """Outlines that keep a given start and a given goal free."""
    disc = Disc(config.robot.radius + PATH_MARGIN)
    given = (config.robot.pose, config.goal.position)
    return [(disc, Pose(*place).rounded()) for place in given if place is not None]


def draw_journey(config: ScenarioConfig, layout: Layout, barriers: Barriers, rng: RandomStream) -> tuple[Robot, Goal]:
    """The robot at its start, and its goal; what is not given is drawn.

    Args:
        layout: the room with everything else in its place.
        barriers: all that the robot must go round.

    Raises:
        SceneError: a given start or goal is not free, there is no way between two that are given, or no pair of start
            and goal with a way between them was found in `max_attempts`.
    """
    space = FreeSpace(layout.plan.outline, barriers, config.robot.radius + PATH_MARGIN)
    _refuse_given(config, space)
    ways = ways_of(config.people)
    for _ in range(config.max_attempts):
        start = _draw_start(config, layout, ways, rng)
        goal = _draw_goal(config, layout, ways, rng)
        if start and goal and _is_journey(config, space, start, goal):
            return _robot(config, start), _goal(config, goal, rng)
    fewer = "or ask for fewer people and things"
    if config.robot.on_ways is not None:
        fewer = "ask for fewer people and things, or set robot.on_ways to null"
    raise SceneError(
        f"no free start and goal for the robot in a {layout.plan.size} room after {config.max_attempts} attempts; "
        f"widen the room, {fewer}"
    )


def _refuse_given(config: ScenarioConfig, space: FreeSpace) -> None:
    """A given start and a given goal must be free, and joined by a way."""
    given = (("start", config.robot.pose), ("goal", config.goal.position))
    places = {what: Pose(*place).rounded().position for what, place in given if place is not None}
    for what, (x, y) in places.items():
        point = np.array([(x, y)], dtype=float)
        if not space.is_free(point)[0]:
            inside = inside_polygon(point, space.outline)[0]
            where = "in a wall or thing, or too near one or somebody who stands" if inside else "outside the room"
            raise SceneError(f"the robot's {what} ({x:g}, {y:g}) is {where}; move it")
    if len(places) == 2 and space.path(places["start"], places["goal"]) is None:
        (x, y), (u, v) = places["start"], places["goal"]
        raise SceneError(f"the robot has no way from its start ({x:g}, {y:g}) to its goal ({u:g}, {v:g}); move either")


def _is_on_way(config: ScenarioConfig, ways: Barriers, place: Pose) -> bool:
    """Whether a drawn place is near enough to where people go."""
    near = config.robot.on_ways
    return near is None or bool((ways.gaps(np.array([place.position], dtype=float)) <= near).any())


def _draw_start(config: ScenarioConfig, layout: Layout, ways: Barriers, rng: RandomStream) -> Pose | None:
    """The given start, or a place if it is free."""
    if config.robot.pose is not None:
        return Pose(*config.robot.pose).rounded()
    pose = Pose(*layout.plan.sample(rng), rng.uniform(-PI, PI)).rounded()
    gap = max(config.robot.clearance, PATH_MARGIN)
    is_free = layout.is_free(Disc(config.robot.radius), pose, gap, gap)
    return pose if is_free and _is_on_way(config, ways, pose) else None


def _draw_goal(config: ScenarioConfig, layout: Layout, ways: Barriers, rng: RandomStream) -> Pose | None:
    """The given goal, or a place if it is free."""
    if config.goal.position is not None:
        return Pose(*config.goal.position).rounded()
    pose = Pose(*layout.plan.sample(rng)).rounded()
    is_free = layout.is_free(Disc(config.robot.radius), pose, PATH_MARGIN, PATH_MARGIN)
    return pose if is_free and _is_on_way(config, ways, pose) else None


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


def _goal(config: ScenarioConfig, place: Pose, rng: RandomStream) -> Goal:
    theta = rng.uniform(-PI, PI) if config.goal.theta is None else config.goal.theta
    pose = Pose(place.x, place.y, theta).rounded()
    return Goal(pose.x, pose.y, pose.theta, quantised(config.goal.distance), quantised(config.goal.angle))
