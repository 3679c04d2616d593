from .catalogue import ALL as ALL
from .catalogue import METRICS as METRICS
from .catalogue import headline as headline
from .catalogue import named as named
from .definition import DEFINITIONS_VERSION as DEFINITIONS_VERSION
from .definition import Metric as Metric
from .disturbance import without_robot as without_robot
from .interop import VARIANTS as VARIANTS
from .measurement import (
    Evaluation as Evaluation,
)
from .measurement import (
    Measured as Measured,
)
from .measurement import (
    episode_files as episode_files,
)
from .measurement import (
    keep as keep,
)
from .measurement import (
    measure as measure,
)
from .measurement import (
    measure_files as measure_files,
)
from .measurement import (
    tree_of as tree_of,
)
from .summary import (
    Interval as Interval,
)
from .summary import (
    Summary as Summary,
)
from .summary import (
    bootstrap_interval as bootstrap_interval,
)
from .summary import (
    differences as differences,
)
from .summary import (
    summarise as summarise,
)
from .summary import (
    wilson_interval as wilson_interval,
)
from .trajectory import Trajectory as Trajectory
