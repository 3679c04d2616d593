"""`helbing2000`: the social force model of escape panic, in which bodies press and rub."""

from __future__ import annotations

from ...exact import Array
from ...scene import Scene
from ..forces.drive import desired_acceleration
from ..forces.helbing2000 import Helbing2000, pressing_acceleration, pressing_wall_acceleration
from ..forces.side import leaning
from .walkers import Walkers


class Helbing2000Model:
    """Drive, pressing and rubbing, as published; the engine's rigid bodies limit how deep the pressing goes.

    Source: Helbing, Farkas & Vicsek, Nature 407 (2000) 487.
    """

    evaluations = 10

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Helbing2000()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, radius = self._law, walkers.position, walkers.velocity, walkers.radius
        total = pressing_acceleration(position, velocity, radius, walkers.weight, law)
        total += pressing_wall_acceleration(position, velocity, radius, self._barriers, law)
        total += desired_acceleration(
            velocity,
            leaning(walkers.direction, self._side),
            walkers.desired_speed,
            relaxation_time=law.relaxation_time,
        )
        return total
