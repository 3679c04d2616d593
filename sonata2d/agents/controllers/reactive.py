"""Reactive controllers: straight to the goal, a pedestrian model applied to the robot, and ORCA."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np

from ...core.entities import Human
from ...core.geometry import Point, Twist
from ...core.navigation import FreeSpace
from ...core.portable_math import angle_of
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...registry import PEDESTRIAN_MODELS
from ..pedestrians.models.base import Walkers, evaluations_per_tick, pedestrian_model
from .base import Controller

REPLANNING_INTERVAL = 5  # ticks


class StraightToGoal(Controller):
    """Turns towards the goal and drives straight there; ignores pedestrians and obstacles.

    Args:
        speed: m/s.
        gain: turn rate per angle to the goal, 1/s.
    """

    version = "1"

    def __init__(self, speed: float = 0.8, gain: float = 2.0) -> None:
        self.speed, self.gain = speed, gain

    def act(self, snapshot: Snapshot) -> Twist:
        ahead, left = snapshot.robot.pose.to_local(snapshot.goal)
        angle = angle_of(left, ahead)
        facing = max(1.0 - abs(angle), 0.0)  # slow down while turning towards the goal
        return Twist(vx=self.speed * facing, omega=self.gain * angle)


class SocialForce(Controller):
    """Follows the shortest path to the goal under a pedestrian model, like a pedestrian that reacts to all others.

    Args:
        speed: desired speed, m/s.
        gain: turn rate per angle to the direction of motion, 1/s.
        model: name of the pedestrian model (`docs/models.md`).

    Raises:
        ValueError: the model is unknown.
    """

    version = "1"

    def __init__(self, speed: float = 0.9, gain: float = 2.0, model: str = "moussaid2009") -> None:
        if model not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(model))
        self.speed, self.gain, self.model = speed, gain, model

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Reconstruct a recorded controller; settings that are missing keep their defaults."""
        controller = cls()
        vars(controller).update({name: settings[name] for name in vars(controller) if name in settings})
        return controller

    def reset(self, scene: Scene) -> None:
        self._space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing_humans), scene.robot.radius + 0.05)
        self._waypoint = scene.goal.position
        # A scene without humans gets a placeholder, whose attention is 0: NumPy would sum a single column pairwise,
        # in another order than the columns of a wider array.
        humans = scene.humans or (Human(-1, scene.robot.pose),)
        self._row = {human.id: k for k, human in enumerate(humans)}
        self._radius = np.array([*(human.radius for human in humans), scene.robot.radius], dtype=float)
        self._model = pedestrian_model(self.model)(replace(scene, humans=humans))

    def act(self, snapshot: Snapshot) -> Twist:
        robot, goal = snapshot.robot, snapshot.goal
        if snapshot.tick % REPLANNING_INTERVAL == 0:
            path = self._space.path(robot.position, goal.position)
            self._waypoint = goal.position if path is None or len(path) < 2 else (float(path[1][0]), float(path[1][1]))
        dx, dy = self._waypoint[0] - robot.position[0], self._waypoint[1] - robot.position[1]
        distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
        direction = (dx / distance, dy / distance)
        vx, vy = self._next_velocity(snapshot, direction)
        c, s = robot.direction
        ahead, left = vx * c + vy * s, vy * c - vx * s
        if self._model.headed:  # motion follows the body, so the body turns to the waypoint
            turn = angle_of(direction[1] * c - direction[0] * s, direction[0] * c + direction[1] * s)
        else:
            turn = angle_of(left, ahead) if math.sqrt(vx * vx + vy * vy) > 0.1 else 0.0
        return Twist(ahead, left, self.gain * turn)

    def _next_velocity(self, snapshot: Snapshot, direction: Point) -> Point:
        """The robot's velocity one tick later under the model, m/s, world frame; humans keep their velocities."""
        walkers = self._walkers(snapshot, direction)
        evaluations = evaluations_per_tick(self._model.evaluations, snapshot.dt)
        h = snapshot.dt / evaluations
        for _ in range(evaluations):
            velocity = walkers.velocity.copy()
            velocity[-1] += self._model.acceleration(walkers)[-1] * h
            walkers = replace(walkers, velocity=velocity, position=walkers.position + velocity * h)
        return float(walkers.velocity[-1, 0]), float(walkers.velocity[-1, 1])

    def _walkers(self, snapshot: Snapshot, direction: Point) -> Walkers:
        """The model's input: only the robot, the last row, has a desired velocity and attends to others.

        Humans of the scene that are absent from the snapshot get the robot's position and no attention.
        """
        humans, robot, count = snapshot.humans, snapshot.robot, len(self._radius)
        rows = [self._row[k] for k in humans.id.tolist()]
        position, velocity = np.tile([robot.position], (count, 1)), np.zeros((count, 2))
        body_direction, desired_direction = np.tile([robot.direction], (count, 1)), np.zeros((count, 2))
        desired_speed, attention = np.zeros(count), np.zeros((count, count))
        position[rows], velocity[rows], body_direction[rows] = humans.position, humans.velocity, humans.direction
        velocity[-1], desired_direction[-1], desired_speed[-1] = robot.velocity, direction, self.speed
        attention[-1, rows] = 1.0
        return Walkers(position, velocity, desired_direction, body_direction, desired_speed, self._radius, attention)


class Orca(SocialForce):
    """Drives to the goal by optimal reciprocal collision avoidance; the robot does the whole evasion itself.

    Args:
        speed: desired speed, m/s.
        gain: turn rate per angle to the direction of motion, 1/s.
    """

    def __init__(self, speed: float = 0.9, gain: float = 2.0) -> None:
        super().__init__(speed, gain, "orca2011")
