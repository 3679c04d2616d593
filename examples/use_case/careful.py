"""An expert that keeps a little further from walls and furniture, for learners who never steer to the centimetre."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonata2d import SocialPlanner
from sonata2d.agents.controllers.planner import STEP, Ways
from sonata2d.core.snapshot import Snapshot

CLEAR = 0.15  # m, gap to a thing from which on it costs nothing
PRICE = 2.0  # a second at the skin of a thing, beside 1 for a metre of way


class Careful(SocialPlanner):
    """The stock expert passes things at two centimetres where that is shorter; this one would rather not."""

    def _bumps(self, ways: Ways, snapshot: Snapshot) -> Any:
        gap = self._gaps_to_things(ways, snapshot) - snapshot.robot.radius
        near = np.minimum(np.maximum(1.0 - gap / CLEAR, 0.0), 1.0)
        return super()._bumps(ways, snapshot) + PRICE * STEP * np.add.reduce(near, axis=0)
