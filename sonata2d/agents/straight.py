"""The simplest controller: straight to the goal, whoever stands in the way."""

from __future__ import annotations

from ..exact import angle_of
from ..frame import Snapshot
from ..geometry import Twist
from .controller import Controller


class StraightToGoal(Controller):
    """Turns towards the goal and drives there, blind to people and things.

    Args:
        speed: m/s.
        gain: 1/s, how fast it turns towards the goal.
    """

    version = "1"

    def __init__(self, speed: float = 0.8, gain: float = 2.0) -> None:
        self.speed, self.gain = speed, gain

    def act(self, snapshot: Snapshot) -> Twist:
        ahead, left = snapshot.robot.pose.to_local(snapshot.goal)
        angle = angle_of(left, ahead)
        facing = max(1.0 - abs(angle), 0.0)  # drive on only as far as the goal lies ahead
        return Twist(vx=self.speed * facing, omega=self.gain * angle)
