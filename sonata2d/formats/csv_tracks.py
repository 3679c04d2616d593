"""`csv`: one row per pedestrian and frame, `frame, ped, x, y`, the usual columns of pedestrian tracks, and the time.

The robot is not a pedestrian and is not exported. The reader accepts these columns by name, in any order, with or
without `t` (s) and `group`, and files without a header row, separated by commas, tabs or blanks, in this order.
NAME.obstacles.csv (`x1, y1, x2, y2`, walls) and NAME.json (`{"desired_speed": m/s}`) beside NAME.csv are read too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..core.bounds import MAX_MAGNITUDE
from ..core.portable_math import Array, IntArray
from ..errors import RecordError, UnsuitableEpisode
from ..record.files import read_bytes
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from .format import Format, Options, require_even_times
from .importing import load_json, numbers, parsing
from .tracks import Tracks, lost_robot, positions_of_present, tracks_document

NAME = "csv"
_COLUMNS = ("frame", "ped", "x", "y")
_TIME = "t"  # s, last column of exported files; other files may lack it
_WALL_COLUMNS = ("x1", "y1", "x2", "y2")


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


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode of a track file.

    Raises:
        RecordError: the file is damaged, or neither it nor `options.frame_time` gives the time between frames.
    """
    with parsing(path, NAME):
        tracks = read_tracks(path, options)
        walls = walls_beside(path) if options.walls is None else read_walls(options.walls)
        yield tracks_document(tracks, NAME, path, walls, desired_speed_beside(path))


def read_tracks(path: Path, options: Options) -> Tracks:
    """Read the tracks of a file.

    Raises:
        RecordError: the file is damaged, or neither it nor `options.frame_time` gives the time between frames.
    """
    with parsing(path, NAME):
        names, cells = _read(path)
        for name in _COLUMNS:
            if name not in names:
                raise ValueError(f"it has no column {name}; its columns are {', '.join(names)}")
        if not len(cells):
            raise ValueError("it has no rows")
        columns = {name: cells[:, k] for k, name in enumerate(names)}
        tracks = Tracks(
            frame=columns["frame"],
            ped=_integers(columns["ped"], "ped"),
            position=np.stack((columns["x"], columns["y"]), axis=1),
            frame_time=_frame_time(columns, options, path),
            group=_groups(columns),
        )
        if not (np.abs(tracks.frame) < MAX_MAGNITUDE).all() or not (np.abs(tracks.position) < MAX_MAGNITUDE).all():
            raise ValueError("frame, x and y must be finite numbers")
        return tracks


def _read(path: Path) -> tuple[list[str], Array]:
    """Column names, and (M, columns) of numbers; NaN where a cell is empty or not a number."""
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"it is not text: {error}") from error
    lines = [line.strip() for line in text.splitlines()]
    rows = [line.split("," if "," in line else None) for line in lines if line and not line.startswith("#")]
    if not rows:
        raise ValueError("it is empty")
    has_header = any(re.search("[A-Za-z]", cell) and _number(cell) is None for cell in rows[0])  # `nan` is a number
    names = [cell.strip().lower() for cell in rows[0]] if has_header else list(_COLUMNS)
    body = rows[1:] if has_header else rows
    for number, row in enumerate(body):
        if len(row) != len(names):
            raise ValueError(f"row {number + 1} has {len(row)} cells, not the {len(names)} of {', '.join(names)}")
    cells = [[_number(cell) for cell in row] for row in body]
    return names, np.array(cells, dtype=float).reshape(-1, len(names))


def _number(cell: str) -> float | None:
    """The number in a cell; None for other texts."""
    try:
        return float(cell)
    except ValueError:
        return None


def _integers(values: Array, name: str) -> IntArray:
    if not (np.abs(values) < 2**53).all() or (values != np.rint(values)).any():
        raise ValueError(f"{name} must be integers")
    return values.astype(np.int64)


def _frame_time(columns: dict[str, Array], options: Options, path: Path) -> float:
    """Duration of one frame number, s: the option, or the slope of the time column, which must be constant."""
    if options.frame_time is not None:
        return options.frame_time
    frame, t = columns["frame"], columns.get(_TIME)
    if t is None:
        raise RecordError(f"{path} does not give the duration of a frame; pass it, e.g. --frame-time 0.04")
    first, last = int(np.argmin(frame)), int(np.argmax(frame))
    span = frame[last] - frame[first]
    per_frame = float((t[last] - t[first]) / span) if span else 0.0
    if not per_frame > 0.0 or not (np.abs(t - t[first] - (frame - frame[first]) * per_frame) < 2e-3).all():
        raise ValueError("its times t are not proportional to its frame numbers")
    return per_frame


def _groups(columns: dict[str, Array]) -> dict[int, int] | None:
    """Group number of each pedestrian id, 0 without a group; None if groups were not annotated."""
    if "group" not in columns or np.isnan(columns["group"]).all():
        return None
    group = _integers(np.nan_to_num(columns["group"]), "group")
    return dict(zip(_integers(columns["ped"], "ped").tolist(), group.tolist(), strict=True))


def walls_beside(path: Path) -> Array:
    """Read NAME.obstacles.csv beside NAME.csv; (W, 4), W = 0 if the file does not exist.

    Raises:
        RecordError: the file is damaged.
    """
    walls = path.with_name(f"{path.name.split('.')[0]}.obstacles.csv")
    return read_walls(walls) if walls.is_file() else np.zeros((0, 4))


def read_walls(path: Path) -> Array:
    """Read a file of walls; (W, 4), x1, y1, x2, y2, m.

    Raises:
        RecordError: the file has other columns, or values that are not finite numbers.
    """
    with parsing(path, "walls"):
        names, cells = _read(path)
    if names != list(_WALL_COLUMNS) or not (np.abs(cells) < MAX_MAGNITUDE).all():
        columns = ",".join(_WALL_COLUMNS)
        raise RecordError(f"{path} must begin with the line {columns!r}, and hold numbers in these columns")
    return cells


def desired_speed_beside(path: Path) -> float | None:
    """Read the desired speed of all pedestrians, m/s, from NAME.json beside NAME.csv; None if it is not given.

    Raises:
        RecordError: the file is damaged.
    """
    settings_file = path.with_name(f"{path.name.split('.')[0]}.json")
    if not settings_file.is_file():
        return None
    settings = load_json(settings_file, "settings")
    if not isinstance(settings, dict) or "desired_speed" not in settings:
        return None
    return float(numbers([settings], ("desired_speed",), settings_file.name)[0, 0])


FORMAT = Format(
    "pedestrian tracks: frame, ped, x, y, t",
    ".csv",
    import_,
    export=export,
    options=frozenset({"frame_time", "walls"}),
    note=lost_robot,
)
