from .names import (
    CARD as CARD,
    CROISSANT as CROISSANT,
    LOG as LOG,
    MANIFEST as MANIFEST,
    METRICS as METRICS,
    PREVIEW as PREVIEW,
    SCENARIO as SCENARIO,
)
from .read import DATASET_FORMAT as DATASET_FORMAT, DATASET_VERSION as DATASET_VERSION
from .rows import (
    files_of as files_of,
    read_manifest as read_manifest,
    read_stored_manifest as read_stored_manifest,
    stored_form as stored_form,
    unlisted_episodes as unlisted_episodes,
)
from .write import counts_of as counts_of, row_of as row_of, write_json as write_json
