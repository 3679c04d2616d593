from .api import (
    Omission as Omission,
    TransferResult as TransferResult,
    count_sources as count_sources,
    episodes_in as episodes_in,
    export_to as export_to,
    format_named as format_named,
    import_from as import_from,
    summarised as summarised,
    unsupported_options as unsupported_options,
)
from .format import Format as Format, Options as Options, Tables as Tables, UnsuitableEpisode as UnsuitableEpisode
from .from_tracks import save_scenario as save_scenario, scenario_from_tracks as scenario_from_tracks
