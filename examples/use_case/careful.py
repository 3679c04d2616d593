"""An expert that keeps more distance from walls and furniture, as a margin for the errors of the learner."""

from __future__ import annotations

import numpy as np

from sonata2d import Array, Snapshot, SocialPlanner
from sonata2d.agents.controllers.planner import STEP, Trajectories

CLEARANCE = 0.15  # m to walls and furniture, below which a trajectory costs more
PRICE = 2.0  # cost per second at zero clearance, falling linearly to 0 at CLEARANCE; a metre of path costs 1


class Careful(SocialPlanner):
    """`social-planner` with a cost of small clearances; the stock one passes obstacles at 2 cm if that is shorter."""

    def _obstacle_cost(self, trajectories: Trajectories, snapshot: Snapshot) -> Array:
        clearance = self._obstacle_distance(trajectories, snapshot) - snapshot.robot.radius  # (S, K), m
        closeness = np.minimum(np.maximum(1.0 - clearance / CLEARANCE, 0.0), 1.0)
        return super()._obstacle_cost(trajectories, snapshot) + PRICE * STEP * np.add.reduce(closeness, axis=0)
