"""Minds: controllers of the robot, and the crowd."""

from .controller import Answer, Controller, Regenerate, Stop
from .social_force import SocialForce
from .social_planner import SocialPlanner
from .straight import StraightToGoal

STOCK: dict[str, type[Controller]] = {
    "straight-to-goal": StraightToGoal,
    "social-force": SocialForce,
    "social-planner": SocialPlanner,
}

__all__ = [
    "STOCK", "Answer", "Controller", "Regenerate", "SocialForce", "SocialPlanner", "Stop", "StraightToGoal",
]  # fmt: skip
