from .attributes import register_attribute_parts as register_attribute_parts
from .demonstrations import (
    Demonstration as Demonstration,
    EnvSamples as EnvSamples,
    demonstrate as demonstrate,
    save_minari as save_minari,
)
from .env import SocialNavEnv as SocialNavEnv
from .export import save_policy as save_policy
from .parallel import SocialNavParallelEnv as SocialNavParallelEnv
from .parts import (
    Column as Column,
    DerivedPart as DerivedPart,
    ObservationPart as ObservationPart,
    Rows as Rows,
    SnapshotPart as SnapshotPart,
    Table as Table,
)
from .pipeline import restore as restore
from .policy import PolicyController as PolicyController
from .registration import ENVIRONMENT_IDS as ENVIRONMENT_IDS, register_environments as register_environments
from .rewards import (
    REWARDS as REWARDS,
    CrowdNav as CrowdNav,
    Distance as Distance,
    Dsrnn as Dsrnn,
    Reward as Reward,
    SocNavGym as SocNavGym,
    Sparse as Sparse,
    goal_distance as goal_distance,
    human_clearance as human_clearance,
)
from .vector import SocialNavVectorEnv as SocialNavVectorEnv
from .worlds import WorldsStep as WorldsStep
from .wrappers import (
    DiscreteActions as DiscreteActions,
    FieldOfView as FieldOfView,
    Flat as Flat,
    Graph as Graph,
    History as History,
    Lidar as Lidar,
    Noise as Noise,
    WorldFrame as WorldFrame,
)
