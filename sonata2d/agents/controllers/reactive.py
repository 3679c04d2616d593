"""Reactive controllers: straight to the goal, a social-force law and ORCA."""

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
from ..pedestrians.models.base import Walkers, pedestrian_model, times_a_tick
from .base import Controller


class StraightToGoal(Controller):
    """Turns towards the goal and drives there, blind to people and things.

    Args:
        speed: m/s.
        gain: 1/s, how fast it turns towards the goal.
    """

    version = "1"

    def __init__(self, speed: float = 0.8, gain: float = 2.0) -> None:
        self.speed, self.gain = speed, gain

    def act(self, snapshot: Snapshot) -> Twist:
        ahead, left = snapshot.robot.pose.to_local(snapshot.goal)
        angle = angle_of(left, ahead)
        facing = max(1.0 - abs(angle), 0.0)  # drive on only as far as the goal lies ahead
        return Twist(vx=self.speed * facing, omega=self.gain * angle)


LOOK_EVERY = 5  # ticks between looks for the way


class SocialForce(Controller):
    """Walks the shortest way to the goal under a law of walking, as a person would who minds everybody.

    Args:
        speed: desired speed, m/s.
        gain: 1/s, how fast it turns the way it goes.
        model: name of the law (`docs/models.md`).

    Raises:
        ValueError: there is no such law.
    """

    version = "1"

    def __init__(self, speed: float = 0.9, gain: float = 2.0, model: str = "moussaid2009") -> None:
        if model not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(model))
        self.speed, self.gain, self.model = speed, gain, model

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """As a file tells of it."""
        controller = cls()
        vars(controller).update({name: settings[name] for name in vars(controller) if name in settings})
        return controller

    def reset(self, scene: Scene) -> None:
        self._space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing), scene.robot.radius + 0.05)
        self._towards = scene.goal.position
        people = scene.humans or (Human(-1, scene.robot.pose),)  # an array one wide would be summed in another order
        self._row = {human.id: k for k, human in enumerate(people)}
        self._radius = np.array([*(human.radius for human in people), scene.robot.radius], dtype=float)
        self._law = pedestrian_model(self.model)(replace(scene, humans=people))

    def act(self, snapshot: Snapshot) -> Twist:
        robot, goal = snapshot.robot, snapshot.goal
        if snapshot.tick % LOOK_EVERY == 0:
            way = self._space.path(robot.position, goal.position)
            self._towards = goal.position if way is None or len(way) < 2 else (float(way[1][0]), float(way[1][1]))
        dx, dy = self._towards[0] - robot.position[0], self._towards[1] - robot.position[1]
        apart = max(math.sqrt(dx * dx + dy * dy), 1e-6)
        towards = (dx / apart, dy / apart)
        vx, vy = self._next_velocity(snapshot, towards)
        c, s = robot.direction
        ahead, left = vx * c + vy * s, vy * c - vx * s
        if self._law.headed:
            turn = angle_of(towards[1] * c - towards[0] * s, towards[0] * c + towards[1] * s)
        else:
            turn = angle_of(left, ahead) if math.sqrt(vx * vx + vy * vy) > 0.1 else 0.0
        return Twist(ahead, left, self.gain * turn)

    def _next_velocity(self, snapshot: Snapshot, towards: Point) -> Point:
        """What the law makes of the robot's velocity by the next look, m/s, world frame; the others keep theirs."""
        walkers, often = self._walkers(snapshot, towards), times_a_tick(self._law.evaluations, snapshot.dt)
        h = snapshot.dt / often
        for _ in range(often):
            velocity = walkers.velocity.copy()
            velocity[-1] += self._law.acceleration(walkers)[-1] * h
            walkers = replace(walkers, velocity=velocity, position=walkers.position + velocity * h)
        return float(walkers.velocity[-1, 0]), float(walkers.velocity[-1, 1])

    def _walkers(self, snapshot: Snapshot, towards: Point) -> Walkers:
        """Everybody as the law is told of them: only the robot, the last, minds others and wants to go anywhere.

        Whoever is in the scene but not in the snapshot stands where the robot is, and is not minded.
        """
        humans, robot, count = snapshot.humans, snapshot.robot, len(self._radius)
        rows = [self._row[k] for k in humans.id.tolist()]
        position, velocity = np.tile([robot.position], (count, 1)), np.zeros((count, 2))
        body_direction, direction = np.tile([robot.direction], (count, 1)), np.zeros((count, 2))
        speed, weight = np.zeros(count), np.zeros((count, count))
        position[rows], velocity[rows], body_direction[rows] = humans.position, humans.velocity, humans.direction
        velocity[-1], direction[-1], speed[-1] = robot.velocity, towards, self.speed
        weight[rows, -1] = 1.0
        return Walkers(position, velocity, direction, body_direction, speed, self._radius, weight)


class Orca(SocialForce):
    """Drives to the goal by optimal reciprocal collision avoidance, with all of the evasion its own.

    Args:
        speed: desired speed, m/s.
        gain: 1/s, how fast it turns the way it goes.
    """

    def __init__(self, speed: float = 0.9, gain: float = 2.0) -> None:
        super().__init__(speed, gain, "orca2011")
