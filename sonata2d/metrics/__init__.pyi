from .catalogue import (
    ALL as ALL,
    METRICS as METRICS,
    headline_metrics as headline_metrics,
    select_metrics as select_metrics,
)
from .comparison import Comparison as Comparison
from .definition import DEFINITIONS_VERSION as DEFINITIONS_VERSION, NEEDS as NEEDS, Metric as Metric, metric as metric
from .disturbance import without_robot as without_robot
from .evaluating import evaluate as evaluate
from .evaluation import Evaluation as Evaluation, Measured as Measured
from .interop import VARIANTS as VARIANTS
from .measurement import (
    episode_files as episode_files,
    measure as measure,
    measure_files as measure_files,
    measure_together as measure_together,
    save_metrics as save_metrics,
)
from .scene_difficulty import (
    Certificate as Certificate,
    Difficulty as Difficulty,
    certify as certify,
    difficulty as difficulty,
)
from .summary import (
    Interval as Interval,
    Share as Share,
    Summary as Summary,
    bootstrap_interval as bootstrap_interval,
    differences as differences,
    summarise as summarise,
    wilson_interval as wilson_interval,
)
from .trajectory import Trajectory as Trajectory
