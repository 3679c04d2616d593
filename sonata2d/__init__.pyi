from .agents.controllers.base import Controller as Controller
from .agents.controllers.base import Regenerate as Regenerate
from .agents.controllers.base import Stop as Stop
from .agents.controllers.human_like import HumanLike as HumanLike
from .agents.controllers.planner import SocialPlanner as SocialPlanner
from .agents.controllers.reactive import Orca as Orca
from .agents.controllers.reactive import SocialForce as SocialForce
from .agents.controllers.reactive import StraightToGoal as StraightToGoal
from .core.geometry import Pose as Pose
from .core.geometry import Twist as Twist
from .core.portable_math import Array as Array
from .core.proxemics import (
    INTIMATE_DISTANCE as INTIMATE_DISTANCE,
)
from .core.proxemics import (
    PERSONAL_DISTANCE as PERSONAL_DISTANCE,
)
from .core.proxemics import (
    SOCIAL_DISTANCE as SOCIAL_DISTANCE,
)
from .core.proxemics import (
    clearance as clearance,
)
from .core.scene import Scene as Scene
from .core.snapshot import Frame as Frame
from .core.snapshot import Observer as Observer
from .core.snapshot import Outcome as Outcome
from .core.snapshot import Snapshot as Snapshot
from .datasets.generate import generate_dataset as generate_dataset
from .errors import Sonata2dError as Sonata2dError
from .record.reader import read_episode as read_episode
from .record.record import EpisodeRecord as EpisodeRecord
from .record.recorder import EpisodeRecorder as EpisodeRecorder
from .record.recorder import JsonRecorder as JsonRecorder
from .scenegen.generator import generate as generate
from .scenegen.scenario.config import ScenarioConfig as ScenarioConfig
from .scenegen.scenario.load import load_scenario as load_scenario
from .sim.episode import Episode as Episode
from .testing.controllers import check_controller as check_controller
from .version import __version__ as __version__
