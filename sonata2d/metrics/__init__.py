"""Metrics of recorded runs: each with its formula, unit and source; summaries, tables, pictures, pages."""

from .catalogue import ALL, METRICS, headline, named
from .definition import DEFINITIONS_VERSION, Metric
from .disturbance import without_robot
from .measure import Evaluation, Measured, episode_files, keep, measure, measure_files, tree_of
from .run import Run
from .summary import Interval, Summary, bootstrap_interval, differences, summarise, wilson_interval
from .variants import VARIANTS

__all__ = [
    "ALL",
    "DEFINITIONS_VERSION",
    "METRICS",
    "VARIANTS",
    "Evaluation",
    "Interval",
    "Measured",
    "Metric",
    "Run",
    "Summary",
    "bootstrap_interval",
    "differences",
    "episode_files",
    "headline",
    "keep",
    "measure",
    "measure_files",
    "named",
    "summarise",
    "tree_of",
    "wilson_interval",
    "without_robot",
]
