"""`trajnet`: TrajNet++ files, lines of JSON: scenes first, then one track row per pedestrian and frame, 2.5 frames/s.

A scene is 21 frames (9 observed, 12 to be predicted) in which its primary pedestrian is present throughout; `tag` is 0,
as the kind of the trajectory is unknown. The robot is not a pedestrian and is not exported. Frame numbers are ticks.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import orjson

from ..core.portable_math import BoolArray, IntArray
from ..errors import UnsuitableEpisode
from ..record.files import read_bytes
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from .csv_tracks import read_walls
from .estimates import X
from .format import Format, Options, require_even_times
from .importing import numbers, parsing
from .tracks import Tracks, lost_robot, positions_of_present, tracks_document

NAME = "trajnet"
_INTERVAL = 0.4  # s between frames
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
            f"no pedestrian is present for {(_LENGTH - 1) * _INTERVAL:g} s, the minimum for readers of {NAME}",
            "leave out such episodes",
        )
    rows, row_ids, positions = positions_of_present(humans, ids)
    tracks = (
        {"track": {"f": f, "p": p, "x": x, "y": y}}
        for f, p, (x, y) in zip((rows * stride).tolist(), row_ids.tolist(), positions.tolist(), strict=True)
    )
    heads = [{"scene": {"id": k, **scene, "fps": 1 / _INTERVAL, "tag": 0}} for k, scene in enumerate(scenes)]
    return b"\n".join([orjson.dumps(line) for line in (*heads, *tracks)]) + b"\n"


def _stride(record: EpisodeRecord) -> int:
    """Ticks between exported frames."""
    dt = record.scene().rules.dt
    stride = round(_INTERVAL / dt)
    if stride < 1 or abs(stride * dt - _INTERVAL) > 1e-9:
        raise UnsuitableEpisode(
            record.path,
            f"ticks of {dt:g} s do not divide the {_INTERVAL} s between frames of {NAME}",
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


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode of a file; scenes are skipped, as they only mark which pedestrian is to be predicted.

    Raises:
        RecordError: the file is damaged.
    """
    with parsing(path, NAME):
        walls = np.zeros((0, 4)) if options.walls is None else read_walls(options.walls)
        yield tracks_document(read_tracks(path, options), NAME, path, walls, None)


def read_tracks(path: Path, options: Options) -> Tracks:
    """Read the tracks of a file.

    Raises:
        RecordError: the file is damaged.
    """
    with parsing(path, NAME):
        scenes, rows = _read(path)
        table = numbers(rows, ("f", "p", "x", "y"), "tracks")
        if (table[:, :2] != np.rint(table[:, :2])).any():
            raise ValueError("f and p must be integers")
        frame, ped = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
        frame_time = options.frame_time or _frame_time(scenes, frame)
        return Tracks(frame.astype(np.float64), ped, table[:, 2:4], frame_time)


def _read(path: Path) -> tuple[list[JsonDict], list[JsonDict]]:
    """The objects under `scene` and under `track` of all lines."""
    scenes, tracks = [], []
    for number, line in enumerate(read_bytes(path).splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = orjson.loads(line)
        except orjson.JSONDecodeError as error:
            raise ValueError(f"line {number} is not valid JSON: {error}") from error
        if not isinstance(row, dict) or not isinstance(row.get("scene", row.get("track")), dict):
            raise ValueError(f"line {number} is neither a scene nor a track")
        if "scene" in row:
            scenes.append(row["scene"])
        elif "prediction_number" not in row["track"]:  # predictions of a model are not recorded tracks
            tracks.append(row["track"])
    return scenes, tracks


def _frame_time(scenes: list[JsonDict], frame: IntArray) -> float:
    """Duration of one frame number, s: the frame rate of the scenes over the most frequent step of frame numbers."""
    rates = {scene.get("fps") for scene in scenes} - {None}
    if len(rates) > 1:
        raise ValueError(f"its scenes have different frame rates, {sorted(map(str, rates))}")
    rate = float(numbers([{"fps": rates.pop()}], ("fps",), "scenes")[0, 0]) if rates else 1 / _INTERVAL
    if rate <= 0:
        raise ValueError(f"fps must be positive, got {rate:g}")
    steps, counts = np.unique(np.diff(np.unique(frame)), return_counts=True)
    if not len(steps):
        raise ValueError("it must hold two frames or more")
    return 1 / rate / float(steps[np.argmax(counts)])


FORMAT = Format(
    "pedestrian tracks of TrajNet++, 2.5 frames a second",
    ".ndjson",
    import_,
    export=export,
    options=frozenset({"frame_time", "walls"}),
    note=lost_robot,
)
