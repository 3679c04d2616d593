from . import errors as errors
from .agents.controllers.base import Controller as Controller, Regenerate as Regenerate, Stop as Stop
from .agents.controllers.human_like import HumanLike as HumanLike
from .agents.controllers.loading import load_controller as load_controller
from .agents.controllers.planner import SocialPlanner as SocialPlanner
from .agents.controllers.reactive import Orca as Orca, SocialForce as SocialForce, StraightToGoal as StraightToGoal
from .core.doors import InteriorDoor as InteriorDoor
from .core.entities import Door as Door, Place as Place, Queue as Queue
from .core.furniture_types import FurnitureType as FurnitureType
from .core.geometry import Pose as Pose, Twist as Twist
from .core.person_kinds import PersonKind as PersonKind
from .core.portable_math import Array as Array
from .core.proxemics import (
    INTIMATE_DISTANCE as INTIMATE_DISTANCE,
    PERSONAL_DISTANCE as PERSONAL_DISTANCE,
    SOCIAL_DISTANCE as SOCIAL_DISTANCE,
    clearance as clearance,
)
from .core.scene import Scene as Scene
from .core.snapshot import Frame as Frame, Observer as Observer, Outcome as Outcome, Snapshot as Snapshot
from .datasets.dataset import Dataset as Dataset
from .datasets.generate.run import generate_dataset as generate_dataset
from .datasets.hub import load as load
from .errors import Sonata2dError as Sonata2dError
from .gym.worlds import Worlds as Worlds
from .metrics.comparison import Comparison as Comparison
from .metrics.evaluating import evaluate as evaluate
from .record.reader import read_episode as read_episode
from .record.record import EpisodeRecord as EpisodeRecord
from .record.recorder import EpisodeRecorder as EpisodeRecorder, JsonRecorder as JsonRecorder
from .scenegen.generator import generate as generate
from .scenegen.scenario.config import ScenarioConfig as ScenarioConfig
from .scenegen.scenario.load import load_scenario as load_scenario
from .sim.episode import Episode as Episode
from .testing.controllers import check_controller as check_controller
from .version import __version__ as __version__
from .workers.executors import Workers as Workers
