"""Minds: controllers of the robot, and the crowd."""

from .controller import Answer, Controller, Regenerate, Stop
from .human_like import HumanLike
from .labelled import Labelled
from .social_force import Orca, SocialForce
from .social_planner import SocialPlanner
from .straight import StraightToGoal
from .teleoperation import HANDS, Hand, Teleoperation

STOCK: dict[str, type[Controller]] = {
    "straight-to-goal": StraightToGoal,
    "social-force": SocialForce,
    "social-planner": SocialPlanner,
    "orca": Orca,
    "human-like": HumanLike,
    "teleoperation": Teleoperation,
}

__all__ = [
    "HANDS", "STOCK", "Answer", "Controller", "Hand", "HumanLike", "Labelled", "Orca", "Regenerate", "SocialForce",
    "SocialPlanner", "Stop", "StraightToGoal", "Teleoperation",
]  # fmt: skip
