from .alt import AltModel as AltModel, fit_alt_model as fit_alt_model
from .baselines import BASELINES as BASELINES, Baseline as Baseline
from .isolated import LIDAR_SENSORS as LIDAR_SENSORS
from .rating import RatingModel as RatingModel, fit_rating_model as fit_rating_model
from .row import (
    Verification as Verification,
    read_row as read_row,
    run_benchmark as run_benchmark,
    verify_row as verify_row,
)
from .scoring import SCORES as SCORES, Score as Score
from .shown import Sensing as Sensing
from .suite import (
    TRACKS as TRACKS,
    Entry as Entry,
    Suite as Suite,
    load_suite as load_suite,
    suite_names as suite_names,
)
from .table import Line as Line, Table as Table, table_of as table_of
