"""`orca2011`: optimal reciprocal collision avoidance, which robots and games use for people."""

from __future__ import annotations

import numpy as np

from ...exact import Array
from ...scene import Scene
from ..forces.linear_program import HalfPlane, chosen_velocity
from ..forces.orca2011 import HalfPlanes, Orca2011, reciprocal_half_planes, wall_half_planes
from ..forces.side import leaning
from .walkers import Walkers


class Orca2011Model:
    """Each takes the velocity nearest to the one they want among those that are safe for a while; groups are ignored.

    Who stays, as the robot in the crowd's eyes, and who does not mind one, evades nobody: others do it all.

    Source: van den Berg, Guy, Lin & Manocha, Robotics Research, STAR 70, Springer (2011) 3.
    """

    evaluations = 1

    def __init__(self, scene: Scene) -> None:
        self._barriers, self._side, self._dt, self._law = scene.barriers, scene.rules.side, scene.rules.dt, Orca2011()

    def acceleration(self, walkers: Walkers) -> Array:
        """As the protocol says: what brings the chosen velocity about within the tick."""
        law, direction = self._law, walkers.direction
        walks = ((direction[:, 0] != 0.0) | (direction[:, 1] != 0.0)) & (walkers.desired_speed > 0.0)
        evades = (walkers.weight.T > 0.0) & walks[:, None]  # row j does its share towards column i
        people = reciprocal_half_planes(
            walkers.position,
            walkers.velocity,
            walkers.radius,
            walkers.weight,
            np.where(evades, 0.5, 1.0),
            horizon=law.horizon,
            dt=self._dt,
        )
        walls = wall_half_planes(
            walkers.position, walkers.radius, self._barriers, horizon=law.wall_horizon, dt=self._dt
        )
        most = law.hurry * walkers.desired_speed
        wish = (leaning(direction, self._side) * walkers.desired_speed[:, None]).tolist()
        hard, soft = _of_each(walls, most), _of_each(people, most)
        chosen = np.zeros_like(walkers.velocity)
        for i in np.flatnonzero(walks).tolist():
            chosen[i] = chosen_velocity(hard[i], soft[i], (wish[i][0], wish[i][1]), float(most[i]))
        return (chosen - walkers.velocity) / self._dt


def _of_each(planes: HalfPlanes, most: Array) -> list[list[HalfPlane]]:
    """The half-planes of each walker that some velocity up to the greatest speed breaks, in the order of the rows."""
    column, row = np.nonzero((planes.counts & (planes.least > -most)).T)
    kept = np.stack((planes.x[row, column], planes.y[row, column], planes.least[row, column]), axis=1).tolist()
    lists: list[list[HalfPlane]] = [[] for _ in most]
    for i, (a, b, c) in zip(column.tolist(), kept, strict=True):
        lists[i].append((a, b, c))
    return lists
