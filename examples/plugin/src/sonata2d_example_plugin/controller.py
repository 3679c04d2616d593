"""A controller: drives towards the goal and slows down near pedestrians."""

from __future__ import annotations

from typing import Any

import sonata2d as s2

from .sensor import Bumper


class Cautious(s2.Controller):
    """Drives straight to the goal, at a speed that falls with the clearance to the nearest pedestrian.

    Args:
        speed: maximum speed, m/s. Public attributes are recorded in every episode file.
    """

    version = "1"
    sensors = (Bumper(record=True),)
    labels = {"close": "the nearest pedestrian is within personal distance (1.2 m)"}

    def __init__(self, speed: float = 0.8) -> None:
        self.speed = speed

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        ahead, left = snapshot.robot.pose.to_local(snapshot.goal)
        distance = max((ahead * ahead + left * left) ** 0.5, 1e-6)
        speed = self.speed * min(max(s2.clearance(snapshot), 0.1) / s2.PERSONAL_DISTANCE, 1.0)
        return s2.Twist(vx=speed * ahead / distance, vy=speed * left / distance)

    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> dict[str, Any]:
        return {"close": s2.clearance(snapshot) < s2.PERSONAL_DISTANCE}
