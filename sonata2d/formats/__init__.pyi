from .api import (
    Done as Done,
)
from .api import (
    count_sources as count_sources,
)
from .api import (
    episodes_in as episodes_in,
)
from .api import (
    export_to as export_to,
)
from .api import (
    format_named as format_named,
)
from .api import (
    import_from as import_from,
)
from .base import Format as Format
from .base import Options as Options
from .from_tracks import save_scenario as save_scenario
from .from_tracks import scenario_from_tracks as scenario_from_tracks
