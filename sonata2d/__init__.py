"""sonata2d: labelled, reproducible social-navigation data sets from a light 2-D simulator."""

from .agents import Controller, Regenerate, SocialForce, SocialPlanner, Stop, StraightToGoal
from .episode import Episode
from .errors import Sonata2dError
from .exact import Array
from .frame import Frame, Outcome, Snapshot
from .geometry import Pose, Twist
from .proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, SOCIAL_DISTANCE, clearance
from .record import JsonRecorder
from .scene import Scene
from .scenegen import ScenarioConfig, generate, load_scenario
from .version import __version__

__all__ = [
    "INTIMATE_DISTANCE",
    "PERSONAL_DISTANCE",
    "SOCIAL_DISTANCE",
    "Array",
    "Controller",
    "Episode",
    "Frame",
    "JsonRecorder",
    "Outcome",
    "Pose",
    "Regenerate",
    "ScenarioConfig",
    "Scene",
    "Snapshot",
    "SocialForce",
    "SocialPlanner",
    "Sonata2dError",
    "Stop",
    "StraightToGoal",
    "Twist",
    "__version__",
    "clearance",
    "generate",
    "load_scenario",
]
