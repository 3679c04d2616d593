"""`helbing1995`: the first social force model, with its ellipses ahead of every walker."""

from __future__ import annotations

import numpy as np

from ...exact import Array
from ...scene import Scene
from ..forces.drive import desired_acceleration
from ..forces.helbing1995 import Helbing1995, step_acceleration
from ..forces.side import leaning
from ..forces.walls import wall_acceleration
from .walkers import Walkers


class Helbing1995Model:
    """Drive, the others' next steps, and walls, as published; people are points, and nobody is attracted.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282; the limit of 1.3 times the desired speed is the crowd's.
    """

    evaluations = 2

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Helbing1995()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, direction = self._law, walkers.position, walkers.direction
        stays = (direction[:, 0] == 0.0) & (direction[:, 1] == 0.0)
        looking = np.where(stays[:, None], walkers.heading, direction)
        total = step_acceleration(position, walkers.velocity, looking, walkers.weight, law)
        total += wall_acceleration(  # U0 e^(-r/R), r from the centre: a person is a point
            position,
            np.zeros_like(walkers.radius),
            self._barriers,
            strength=law.wall_repulsion / law.wall_reach,
            reach=law.wall_reach,
        )
        total += desired_acceleration(
            walkers.velocity,
            leaning(direction, self._side),
            walkers.desired_speed,
            relaxation_time=law.relaxation_time,
        )
        return total
