"""Checks: of your controllers, and of how believable the people are."""

from .controllers import SCENARIOS, check_controller, default_scenes

__all__ = ["SCENARIOS", "check_controller", "default_scenes"]
