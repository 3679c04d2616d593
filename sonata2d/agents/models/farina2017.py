"""`farina2017`: the headed social force model, in which people walk where they face."""

from __future__ import annotations

from ...exact import Array
from ...scene import Scene
from ..forces.drive import desired_acceleration
from ..forces.farina2017 import Farina2017, headed_acceleration, headed_group_acceleration
from ..forces.helbing2000 import pressing_acceleration, pressing_wall_acceleration
from ..forces.side import leaning
from .walkers import Walkers


class Farina2017Model:
    """The forces of Helbing et al. (2000) in the body's frame, and groups, as published.

    How bodies turn is the world's affair: they turn to where their owners want to go (`registry.HEADED`).

    Source: Farina et al., PLoS ONE 12(1) (2017) e0169734.
    """

    evaluations = 10

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, Farina2017()

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, radius = self._law, walkers.position, walkers.velocity, walkers.radius
        others = pressing_acceleration(position, velocity, radius, walkers.weight, law.pressing)
        others += pressing_wall_acceleration(position, velocity, radius, self._barriers, law.pressing)
        drive = desired_acceleration(
            velocity, walkers.direction, walkers.desired_speed, relaxation_time=law.pressing.relaxation_time
        )
        heading = leaning(walkers.heading, self._side)  # a drive that leans would not do: aside it counts for nothing
        total = headed_acceleration(drive, others, velocity, heading, law)
        if walkers.member is not None:
            total += headed_group_acceleration(position, heading, walkers.member, law)
        return total
