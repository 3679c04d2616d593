"""Scenes: from settings and a seed to a `Scene`, a value; no physics."""

from .config import ScenarioConfig
from .generate import generate
from .load import load_scenario, scenario_names

__all__ = ["ScenarioConfig", "generate", "load_scenario", "scenario_names"]
