"""The difficulty of a scene for a robot, from its geometry, and certificates from episodes of the expert."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..core.entities import Human
from ..core.geometry import Barriers
from ..core.navigation import FreeSpace
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.vectors import lengths
from ..errors import SceneError
from ..record.recorder import EpisodeRecorder
from ..sim.episode import Episode
from .measurement import measure
from .space import human_clearance_min, obstacle_clearance_min

_EXPERT = "social-planner"
_STEP = 0.1  # m, between the points of the path at which gaps are measured
_MARGIN = 0.05  # m, gap of the robot to obstacles along its path
_NEAR = 1.0  # m, gap between outlines up to which a person counts as encountered
_WIDE = 3.0  # m: a wider passage does not slow the robot down
_BESIDE = 0.5  # sine of the smallest angle between the path and the direction to what is beside it
_AROUND = 3.0  # m, from the path, within which the density is measured

# Predicted time, s: fitted to the expert, `social-planner`, by benchmarks/fit_difficulty.py.
_START, _PER_TIME, _PER_ENCOUNTER, _PER_STANDING, _PER_NARROWNESS, _PER_TURN = 0.8, 1.13, 2.04, 0.73, 0.96, 1.93

_MARGIN_OF_TIME, _MARGIN_OF_GAP = 0.5, 0.1  # a wide margin: share of the time limit, and m to people and obstacles


@dataclass(frozen=True)
class Difficulty:
    """The difficulty of a scene for its robot, with its parts.

    Attributes:
        value: predicted time of the expert, s; infinite if walls and furniture leave no path to the goal.
        free_time: length of the shortest path divided by the robot's top speed, s.
        straightness: distance of the goal divided by the length of the path, 0 to 1.
        turns: sum of the changes of direction of the path, rad.
        passage: width of the narrowest passage on the path, m; 3 if all are wider.
        density: people within 3 m of the path, 1/m².
        narrowness: 1 if the narrowest passage is as wide as the robot, 0 from 3 m on.
        encounters: number of walking people that are expected to come within 1 m of the robot.
        standing: number of people that stand within 1 m of the path.
    """

    value: float
    free_time: float
    straightness: float
    turns: float
    passage: float
    density: float
    narrowness: float
    encounters: float
    standing: int


@dataclass(frozen=True)
class Certificate:
    """A proof that a scene can be solved: an episode of the expert.

    Attributes:
        solvable: `widely` (the expert reaches the goal in half of the time limit, and keeps 0.1 m from people and
            obstacles), `yes` (it reaches the goal without contact), or `unknown`: another controller may.
        time: until the goal, s; None: it did not reach it.
        clearance: smallest gap of the robot to people and obstacles, m.
    """

    solvable: Literal["widely", "yes", "unknown"]
    time: float | None
    clearance: float


def difficulty(scene: Scene) -> Difficulty:
    """The difficulty of a scene, from its geometry and its people at the start.

    The robot is expected to drive along the shortest path among walls, furniture and standing people at its top speed.
    People with goals walk straight to them; of those who wander, which may go anywhere, a number is encountered as
    particles of a gas are: their density times the area that the robot and the person sweep.

    Raises:
        SceneError: the goal moves, so that its way is not known at the start.

    Source: width of passages and tortuosity are among the measures of Perille et al., Benchmarking Metric Ground
    Navigation, IEEE SSRR 2020; the other parts are ours, and the weights are fitted to the expert.
    """
    if scene.goal.moves:
        raise SceneError(f"difficulty is defined for one goal, and that of {scene.title} moves ({scene.goal.task})")
    radius, speed = scene.robot.outline.inradius, scene.robot.top_speed
    start, goal = scene.robot.pose.position, scene.goal.position
    space = FreeSpace(scene.outline, scene.robot_barriers, radius + _MARGIN, scene.standing_humans)
    path = space.path(start, goal)
    if path is None:  # standing people can move out of the way
        path = space.with_added(Barriers.of(())).path(start, goal)
    around = [h for h in scene.humans if h.enters == 0]
    if path is None:
        return Difficulty(math.inf, math.inf, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0)
    edges = np.diff(path, axis=0)
    sizes = lengths(edges)
    length = float(sizes.sum())
    points = _along(path)
    free_time = max(length - scene.goal.distance, 0.0) / speed
    passage = _narrowest(scene.robot_barriers, points)
    angles = np.arctan2(edges[sizes > 0.0, 1], edges[sizes > 0.0, 0])
    turns = float(np.abs(np.angle(np.exp(1j * np.diff(angles)))).sum())
    positions = np.array([human.pose.position for human in around], dtype=float).reshape(-1, 2)
    distance = np.array([lengths(points - position).min() for position in positions])
    density = float((distance < _AROUND).sum()) / (2.0 * _AROUND * length + math.pi * _AROUND * _AROUND)
    standing = sum(
        h.behaviour == "standing" and d - h.radius - radius < _NEAR for h, d in zip(around, distance, strict=True)
    )
    encounters = _encounters(scene, around, points, free_time)
    narrowness = max(1.0 - (passage - 2.0 * radius) / (_WIDE - 2.0 * radius), 0.0)
    value = _START + _PER_TIME * free_time + _PER_ENCOUNTER * encounters + _PER_STANDING * standing
    value += _PER_NARROWNESS * narrowness + _PER_TURN * turns
    straightness = min(math.dist(start, goal) / length, 1.0) if length else 1.0
    return Difficulty(value, free_time, straightness, turns, passage, density, narrowness, encounters, standing)


def certify(scene: Scene, expert: Controller | None = None) -> Certificate:
    """Run the expert in a scene.

    Args:
        scene: the scene.
        expert: its controller; default: `social-planner`.
    """
    recorder = EpisodeRecorder()
    scene = replace(scene, rules=replace(scene.rules, ends_on=("goal", "time")))
    outcome = Episode(scene, expert or load_controller(_EXPERT), observers=[recorder]).run()
    found = measure(recorder.record(), [human_clearance_min, obstacle_clearance_min], rerun=False)
    clearance = min((value for value in found.values() if value is not None), default=math.inf)
    if outcome.status != "goal" or clearance <= scene.rules.contact_distance:
        return Certificate("unknown", outcome.time if outcome.status == "goal" else None, clearance)
    is_wide = outcome.time <= _MARGIN_OF_TIME * scene.rules.time_limit and clearance >= _MARGIN_OF_GAP
    return Certificate("widely" if is_wide else "yes", outcome.time, clearance)


def _along(path: Array) -> Array:
    """Points along a path, 0.1 m apart, (P, 2), m."""
    parts = [np.linspace(a, b, max(int(math.dist(a, b) / _STEP), 1), endpoint=False) for a, b in pairwise(path)]
    return np.concatenate([*parts, path[-1:]])


def _narrowest(barriers: Barriers, points: Array) -> float:
    """Width of the narrowest passage on a path: gaps to the left and to the right together, m; 3 if all are wider."""
    along = np.gradient(points, axis=0)
    along /= np.maximum(lengths(along), 1e-9)[:, None]
    x, y = barriers.towards(points)
    distance = np.sqrt(x * x + y * y)
    left = along[:, 0] * y - along[:, 1] * x  # (M, N), of the nearest point of each barrier
    gap = distance - barriers.radius[:, None]
    is_beside = np.abs(left) > _BESIDE * distance
    width = np.zeros(len(points))
    for side in (left > 0.0, left < 0.0):
        width += np.where(is_beside & side, gap, _WIDE).min(axis=0, initial=_WIDE)
    return float(min(width.min(), _WIDE))


def _encounters(scene: Scene, humans: list[Human], points: Array, free_time: float) -> float:
    """Expected number of walking people that come within 1 m of the robot on its path at top speed."""
    radius = scene.robot.outline.inradius
    times = np.linspace(0.0, free_time, len(points))
    area = scene.floor_area
    found = 0.0
    for human in humans:
        reach = _NEAR + radius + human.radius
        if human.goals:
            gap = lengths(_walk(human, times) - points)
            found += float(gap.min() < reach)
        elif human.behaviour == "wandering":
            # relative speed of two velocities in random directions, about the root of the sum of squares
            relative = math.hypot(human.desired_speed, scene.robot.top_speed)
            swept = 2.0 * reach * relative * free_time
            found += 1.0 - math.exp(-swept / area)
    return found


def _walk(human: Human, times: Array) -> Array:
    """Positions of a person that walks straight to its goals at its desired speed, (T, 2), m."""
    corners = np.array([human.pose.position, *human.goals], dtype=float)
    arrival = np.concatenate(([0.0], np.cumsum(lengths(np.diff(corners, axis=0))))) / max(human.desired_speed, 1e-3)
    return np.stack([np.interp(times, arrival, corners[:, axis]) for axis in (0, 1)], axis=1)
