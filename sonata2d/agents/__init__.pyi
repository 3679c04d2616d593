from .controllers.base import Answer as Answer, Controller as Controller, Regenerate as Regenerate, Stop as Stop
from .controllers.compiled import KernelController as KernelController
from .controllers.human_like import HumanLike as HumanLike
from .controllers.labelled import Labelled as Labelled
from .controllers.local_planner import Dwa as Dwa, Mppi as Mppi
from .controllers.planner import SocialPlanner as SocialPlanner
from .controllers.reactive import Orca as Orca, SocialForce as SocialForce, StraightToGoal as StraightToGoal
from .controllers.teleoperation import (
    DEFAULT_MAPPINGS as DEFAULT_MAPPINGS,
    DeviceMapping as DeviceMapping,
    Teleoperation as Teleoperation,
)
from .drives.base import Drive as Drive
from .sensors.base import Reading as Reading, Sensor as Sensor
from .sensors.camera import Camera as Camera
from .sensors.estimates import FieldOfView as FieldOfView, Odometry as Odometry, PeopleDetector as PeopleDetector
from .sensors.lidar import Costmap as Costmap, Lidar as Lidar, costmap as costmap
