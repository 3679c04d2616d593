"""`csv`: one row per pedestrian and frame, `frame, ped, x, y`, the usual columns of pedestrian tracks, and the time.

The robot is not a pedestrian and is not exported. Every layout of `tracks` is read.
"""

from __future__ import annotations

from ..errors import UnsuitableEpisode
from ..record.record import EpisodeRecord
from .format import Format, Options, require_even_times
from .tracks.document import TRACK_OPTIONS, import_, lost_robot, positions_of_present

NAME = "csv"
_COLUMNS = ("frame", "ped", "x", "y")
_TIME = "t"  # s, last column of exported files; other files may lack it


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the track file of an episode; the frame number is the tick.

    Raises:
        UnsuitableEpisode: no pedestrian is present in the episode, or its times are uneven.
    """
    require_even_times(record, NAME)
    rows, ids, positions = positions_of_present(record.states.humans, record.scene().human_table.id.tolist())
    if not len(rows):
        raise UnsuitableEpisode(
            record.path,
            f"no pedestrian is in the episode, and {NAME} holds tracks of pedestrians",
            "leave out such episodes",
        )
    columns = (record.states.tick[rows], ids, positions, record.states.time[rows])
    lines = [
        f"{tick},{id},{x!r},{y!r},{t!r}"
        for tick, id, (x, y), t in zip(*(column.tolist() for column in columns), strict=True)
    ]
    return "\n".join([",".join((*_COLUMNS, _TIME)), *lines, ""]).encode()


FORMAT = Format(
    "pedestrian tracks: frame, ped, x, y, t",
    ".csv",
    import_,
    export=export,
    options=TRACK_OPTIONS,
    note=lost_robot,
)
