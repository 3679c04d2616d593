"""`trajnet`: TrajNet++ files, lines of JSON: scenes first, then one track row per pedestrian and frame, 2.5 frames/s.

A scene is 21 frames (9 observed, 12 to be predicted) in which its primary pedestrian is present throughout; `tag` is 0,
as the kind of the trajectory is unknown. The robot is not a pedestrian and is not exported. Frame numbers are ticks.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import orjson

from ..core.portable_math import BoolArray
from ..errors import UnsuitableEpisode
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from .estimates import X
from .format import Format, Options, require_even_times
from .tracks.document import TRACK_OPTIONS, import_, lost_robot, positions_of_present
from .tracks.sources import TRAJNET_INTERVAL

NAME = "trajnet"
_LENGTH = 21  # frames of a scene


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the TrajNet++ file of an episode.

    Raises:
        UnsuitableEpisode: 0.4 s is not a multiple of the tick, or no pedestrian is present for the 8 s of a scene.
    """
    require_even_times(record, NAME)
    stride = _stride(record)
    ids = record.scene().human_table.id.tolist()
    humans = record.states.humans[::stride]
    scenes = list(_scenes(~np.isnan(humans[..., X]), ids, stride))
    if not scenes:
        raise UnsuitableEpisode(
            record.path,
            f"no pedestrian is present for {(_LENGTH - 1) * TRAJNET_INTERVAL:g} s, the minimum for readers of {NAME}",
            "leave out such episodes",
        )
    rows, row_ids, positions = positions_of_present(humans, ids)
    tracks = (
        {"track": {"f": f, "p": p, "x": x, "y": y}}
        for f, p, (x, y) in zip((rows * stride).tolist(), row_ids.tolist(), positions.tolist(), strict=True)
    )
    heads = [{"scene": {"id": k, **scene, "fps": 1 / TRAJNET_INTERVAL, "tag": 0}} for k, scene in enumerate(scenes)]
    return b"\n".join([orjson.dumps(line) for line in (*heads, *tracks)]) + b"\n"


def _stride(record: EpisodeRecord) -> int:
    """Ticks between exported frames."""
    dt = record.scene().rules.dt
    stride = round(TRAJNET_INTERVAL / dt)
    if stride < 1 or abs(stride * dt - TRAJNET_INTERVAL) > 1e-9:
        raise UnsuitableEpisode(
            record.path,
            f"ticks of {dt:g} s do not divide the {TRAJNET_INTERVAL} s between frames of {NAME}",
            "record with a tick of 0.1, 0.2 or 0.4 s",
        )
    return stride


def _scenes(present: BoolArray, ids: list[int], stride: int) -> Iterator[JsonDict]:
    """Yield consecutive scenes of each pedestrian: `_LENGTH` frames of uninterrupted presence; present is (T, N)."""
    for k, id in enumerate(ids):
        first = 0
        while first + _LENGTH <= len(present):
            gaps = np.flatnonzero(~present[first : first + _LENGTH, k])
            if not len(gaps):
                yield {"p": id, "s": first * stride, "e": (first + _LENGTH - 1) * stride}
            first += int(gaps[-1]) + 1 if len(gaps) else _LENGTH  # continue after the last gap


FORMAT = Format(
    "pedestrian tracks of TrajNet++, 2.5 frames a second",
    ".ndjson",
    import_,
    export=export,
    options=TRACK_OPTIONS,
    note=lost_robot,
)
