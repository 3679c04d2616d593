"""`moussaid2009`: the law that Moussaïd and colleagues measured, with the groups of their paper of 2010."""

from __future__ import annotations

import numpy as np

from ...exact import Array
from ...scene import Scene
from ..forces.drive import desired_acceleration
from ..forces.groups import Moussaid2010, group_acceleration
from ..forces.moussaid2009 import Moussaid2009, bulk_of, interaction_acceleration
from ..forces.walls import wall_acceleration
from .walkers import Walkers


class Moussaid2009Model:
    """Drive, giving way, walls and groups, as published.

    Valid where it was measured: few people with room to give way. In a crowd it is an extrapolation.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755; Moussaïd et al., PLoS ONE 5 (2010) e10047.
    """

    evaluations = 1

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side = scene.barriers, scene.rules.side
        self._law, self._group_law = Moussaid2009(), Moussaid2010()
        self._bulk = bulk_of(np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float))

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity = self._law, walkers.position, walkers.velocity
        total = interaction_acceleration(position, velocity, walkers.weight, self._bulk, self._side, law)
        total += wall_acceleration(
            position, walkers.radius, self._barriers, strength=law.wall_strength, reach=law.wall_reach
        )
        total += desired_acceleration(
            velocity, walkers.direction, walkers.desired_speed, relaxation_time=law.relaxation_time
        )
        if walkers.member is not None:
            total += group_acceleration(position, velocity, walkers.direction, walkers.member, self._group_law)
        return total
