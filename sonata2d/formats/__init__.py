"""Episodes in the formats of other programs, out and in."""

from .doors import Done, count_sources, episodes_in, export_to, format_named, import_from
from .form import Format, Options
from .from_tracks import save_scenario, scenario_from_tracks
from .registry import FORMATS

__all__ = [
    "FORMATS",
    "Done",
    "Format",
    "Options",
    "count_sources",
    "episodes_in",
    "export_to",
    "format_named",
    "import_from",
    "save_scenario",
    "scenario_from_tracks",
]
