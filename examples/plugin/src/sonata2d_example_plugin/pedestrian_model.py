"""A pedestrian model: isotropic exponential repulsion, the "circular specification" of the social force model."""

from __future__ import annotations

import numpy as np

from sonata2d import Array, Scene
from sonata2d.agents.pedestrians.models.base import Walkers, desired_acceleration, wall_acceleration
from sonata2d.core.portable_math import exp


class CircularModel:
    """Accelerates pedestrians towards their desired velocity, away from each other and from walls.

    Arithmetic uses `+ - * /`, `sqrt` and the functions of `sonata2d.core.portable_math` only, and sums run over the
    first axis, so that an episode has the same bits on every processor.

    Source: A. Johansson, D. Helbing & P. K. Shukla, Advances in Complex Systems 10 (2007) 271, circular specification.
    The parameters are round numbers of the same order, not calibrated.
    """

    evaluations = 1  # force evaluations in a tick of 0.1 s; stiff models need more
    headed = False  # pedestrians need not walk where their bodies face

    strength, reach = 3.0, 0.3  # m/s^2 at contact of the outlines, m
    relaxation_time = 0.5  # s

    def __init__(self, scene: Scene) -> None:
        self._barriers = scene.barriers

    def acceleration(self, walkers: Walkers) -> Array:
        """(M, 2), m/s^2, world frame; the robot is the last row."""
        x, y = (walkers.position[None, :, k] - walkers.position[:, None, k] for k in (0, 1))  # from row j to column i
        distance = np.maximum(np.sqrt(x * x + y * y), 1e-6)
        gap = np.maximum(distance - walkers.radius[:, None] - walkers.radius, 0.0)
        attention = np.ascontiguousarray(walkers.attention.T)  # row j, column i: how much i attends to j
        push = attention * self.strength * exp(-gap / self.reach) / distance
        total = np.stack((np.add.reduce(push * x, axis=0), np.add.reduce(push * y, axis=0)), axis=1)
        total += desired_acceleration(
            walkers.velocity, walkers.desired_direction, walkers.desired_speed, relaxation_time=self.relaxation_time
        )
        total += wall_acceleration(walkers.position, walkers.radius, self._barriers, strength=3.0, decay_length=0.1)
        return total
