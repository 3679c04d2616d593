"""`trajnet`: lines of JSON, scenes first, then a track row for each person and frame, 2.5 frames a second.

A scene is 21 frames (9 seen, 12 to be predicted) in which its primary person is present throughout; `tag` is 0, since
nobody has said of what kind it is. The robot is no pedestrian and stays out. Frame numbers are ticks.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..errors import RecordError
from ..record.files import read_bytes
from ..record.layout import Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing
from .parse import numbers
from .refuse import refuse_uneven
from .tracks import Tracks, document_of_tracks, sightings

NAME = "trajnet"
INTERVAL = 0.4  # s between frames
LENGTH = 21  # frames of a scene


def export(record: EpisodeRecord, options: Options) -> bytes:
    """The file of an episode.

    Raises:
        RecordError: its ticks do not fall on 0.4 s, or nobody is there for the 8 s of a scene.
    """
    refuse_uneven(record, NAME)
    stride = _stride(record)
    ids = [human.id for human in record.scene().humans]
    seen = record.looks.humans[::stride]
    scenes = list(_scenes(~np.isnan(seen[..., 0]), ids, stride))
    if not scenes:
        raise RecordError(
            f"{record.path}: nobody is in it for {(LENGTH - 1) * INTERVAL:g} s, the least that readers of {NAME} need;"
            " leave such episodes out"
        )
    rows, who, place = sightings(seen, ids)
    tracks = (
        {"track": {"f": f, "p": p, "x": x, "y": y}}
        for f, p, (x, y) in zip((rows * stride).tolist(), who.tolist(), place.tolist(), strict=True)
    )
    told = [{"scene": {"id": k, **scene, "fps": 1 / INTERVAL, "tag": 0}} for k, scene in enumerate(scenes)]
    return b"\n".join([orjson.dumps(line) for line in (*told, *tracks)]) + b"\n"


def _stride(record: EpisodeRecord) -> int:
    """Ticks between frames."""
    dt = record.scene().rules.dt
    stride = round(INTERVAL / dt)
    if stride < 1 or abs(stride * dt - INTERVAL) > 1e-9:
        raise RecordError(
            f"{record.path}: ticks of {dt:g} s do not fall on the {INTERVAL} s between frames of {NAME}; record with a"
            " tick of 0.1, 0.2 or 0.4 s"
        )
    return stride


def _scenes(present: Any, ids: list[int], stride: int) -> Iterator[Tree]:
    """Stretches of `LENGTH` frames, end to end, in which somebody is present; (T, N) of bool."""
    for k, id in enumerate(ids):
        first = 0
        while first + LENGTH <= len(present):
            gaps = np.flatnonzero(~present[first : first + LENGTH, k])
            if not len(gaps):
                yield {"p": id, "s": first * stride, "e": (first + LENGTH - 1) * stride}
            first += int(gaps[-1]) + 1 if len(gaps) else LENGTH


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The tracks of a file, as an episode; its scenes only say who is to be predicted.

    Raises:
        RecordError: it is damaged.
    """
    with parsing(path, NAME):
        yield document_of_tracks(read_tracks(path, options), NAME, path, np.zeros((0, 4)), None)


def read_tracks(path: Path, options: Options) -> Tracks:
    """The tracks of a file.

    Raises:
        RecordError: it is damaged.
    """
    with parsing(path, NAME):
        scenes, rows = _read(path)
        table = numbers(rows, ("f", "p", "x", "y"), "tracks")
        if (table[:, :2] != np.rint(table[:, :2])).any():
            raise ValueError("f and p must be whole numbers")
        frame, ped = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
        seconds = options.frame_time or _frame_time(scenes, frame)
        return Tracks(frame.astype(np.float64), ped, table[:, 2:4], seconds)


def _read(path: Path) -> tuple[list[Tree], list[Tree]]:
    """What its lines hold under `scene` and `track`."""
    scenes, tracks = [], []
    for number, line in enumerate(read_bytes(path).splitlines(), 1):
        if not line.strip():
            continue
        try:
            told = orjson.loads(line)
        except orjson.JSONDecodeError as error:
            raise ValueError(f"line {number} is not whole JSON: {error}") from error
        if not isinstance(told, dict) or not isinstance(told.get("scene", told.get("track")), dict):
            raise ValueError(f"line {number} is neither a scene nor a track")
        if "scene" in told:
            scenes.append(told["scene"])
        elif "prediction_number" not in told["track"]:  # what a model thought is no track
            tracks.append(told["track"])
    return scenes, tracks


def _frame_time(scenes: list[Tree], frame: Any) -> float:
    """Seconds that a frame number stands for."""
    rates = {scene.get("fps") for scene in scenes} - {None}
    if len(rates) > 1:
        raise ValueError(f"its scenes have different rates, {sorted(map(str, rates))}")
    rate = float(numbers([{"fps": rates.pop()}], ("fps",), "scenes")[0, 0]) if rates else 1 / INTERVAL
    if rate <= 0:
        raise ValueError(f"fps must be positive, got {rate:g}")
    steps, counts = np.unique(np.diff(np.unique(frame)), return_counts=True)
    if not len(steps):
        raise ValueError("it must tell of two frames or more")
    return 1 / rate / float(steps[np.argmax(counts)])


FORMAT = Format("tracks of people as TrajNet++ reads them, 2.5 frames a second", ".ndjson", import_, export=export)
