"""A robot that waits before it serves a person who argues, and labels each frame with `wait` or `serve`.

sonata2d generate argument --scenario examples/scenarios/argument.yaml --controller examples/waiter.py:Waiter
"""

from __future__ import annotations

from typing import Any

import sonata2d as s2
from sonata2d.core.relations import ARGUING


class Waiter(s2.Controller):
    """Drives to the goal like the stock controller `social-planner`, but waits while somebody at the goal argues."""

    version = "1"

    def __init__(self) -> None:
        self.near = 2.5  # m, from the goal, within which people count as served
        self.distance = 2.0  # m, from the people who argue, at which the robot waits
        self.labels = {"advice": "what the robot should do now: serve or wait"}

    def reset(self, scene: s2.Scene) -> None:
        self._planner = s2.SocialPlanner()
        self._planner.reset(scene)

    def act(self, snapshot: s2.Snapshot) -> Any:
        command = self._planner.act(snapshot)
        gap = min((self._away(snapshot, id, snapshot.robot.position) for id in self._arguing(snapshot)), default=99.0)
        if gap > self.distance:
            return command
        self._planner.command_overridden(s2.Twist(0.0, 0.0, 0.0))
        return s2.Twist(0.0, 0.0, 0.0)

    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> dict[str, str]:
        return {"advice": "wait" if self._arguing(snapshot) else "serve"}

    def _arguing(self, snapshot: s2.Snapshot) -> list[int]:
        """Ids of the people near the goal who argue."""
        pairs = (i for i in snapshot.interactions if i.relation == ARGUING)
        return [
            id for i in pairs for id in (i.src, i.dst) if self._away(snapshot, id, snapshot.goal.position) < self.near
        ]

    @staticmethod
    def _away(snapshot: s2.Snapshot, id: int, point: tuple[float, float]) -> float:
        """Distance of a person from a point, m; infinite if it is not present."""
        places = {human.id: human.pose.position for human in snapshot.humans}
        x, y = places.get(id, (float("inf"), 0.0))
        return float(((x - point[0]) ** 2 + (y - point[1]) ** 2) ** 0.5)
