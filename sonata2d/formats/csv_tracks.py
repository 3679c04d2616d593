"""`csv`: one row a person and frame, `frame, ped, x, y`, the usual four columns of pedestrian tracks.

The robot is no pedestrian and stays out. Read are files with these columns by name, in any order, with `t` (s) or not,
and files without names, split by commas, tabs or blanks, in this order. Beside NAME.csv may lie NAME.obstacles.csv
(`x1, y1, x2, y2`, walls) and NAME.json (`{"desired_speed": m/s}`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..core.geometry import LARGEST
from ..core.portable_math import Array
from ..errors import RecordError
from ..record.files import read_bytes
from ..record.layout import Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing
from .parse import load_json, numbers
from .refuse import refuse_uneven
from .tracks import Tracks, document_of_tracks, sightings

NAME = "csv"
COLUMNS = ("frame", "ped", "x", "y")
OBSTACLES = ("x1", "y1", "x2", "y2")


def export(record: EpisodeRecord, options: Options) -> bytes:
    """The file of an episode; the frame number is the tick.

    Raises:
        RecordError: nobody is in it, or its stamps are uneven.
    """
    refuse_uneven(record, NAME)
    rows, ids, place = sightings(record.looks.humans, [human.id for human in record.scene().humans])
    if not len(rows):
        raise RecordError(f"{record.path}: nobody is in it, and {NAME} holds tracks of people; leave it out")
    lines = [
        f"{tick},{id},{x!r},{y!r}"
        for tick, id, (x, y) in zip(record.looks.tick[rows].tolist(), ids.tolist(), place.tolist(), strict=True)
    ]
    return "\n".join([",".join(COLUMNS), *lines, ""]).encode()


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The tracks of a file, as an episode.

    Raises:
        RecordError: it is damaged, or says nothing of time and `options.frame_time` does not either.
    """
    with parsing(path, NAME):
        yield document_of_tracks(read_tracks(path, options), NAME, path, walls_beside(path), desired_speed_beside(path))


def read_tracks(path: Path, options: Options) -> Tracks:
    """The tracks of a file.

    Raises:
        RecordError: it is damaged, or says nothing of time and `options.frame_time` does not either.
    """
    with parsing(path, NAME):
        names, cells = _read(path)
        for name in COLUMNS:
            if name not in names:
                raise ValueError(f"it has no column {name}; its columns are {', '.join(names)}")
        if not len(cells):
            raise ValueError("nobody is in it: it has no rows")
        columns = {name: cells[:, k] for k, name in enumerate(names)}
        tracks = Tracks(
            frame=columns["frame"],
            ped=_whole(columns["ped"], "ped"),
            place=np.stack((columns["x"], columns["y"]), axis=1),
            frame_time=_frame_time(columns, options, path),
            group=_groups(columns),
        )
        if not (np.abs(tracks.frame) < LARGEST).all() or not (np.abs(tracks.place) < LARGEST).all():
            raise ValueError("frame, x and y must be finite numbers")
        return tracks


def _read(path: Path) -> tuple[list[str], Array]:
    """Names of the columns, and (M, columns) of numbers; NaN where a cell is empty or no number."""
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"it is no text: {error}") from error
    lines = [line.strip() for line in text.splitlines()]
    rows = [_cells(line) for line in lines if line and not line.startswith("#")]
    if not rows:
        raise ValueError("it is empty")
    named = any(re.search("[A-Za-z]", cell) and not _is_number(cell) for cell in rows[0])
    names = [cell.strip().lower() for cell in rows[0]] if named else list(COLUMNS)
    body = rows[1:] if named else rows
    for number, row in enumerate(body):
        if len(row) != len(names):
            raise ValueError(f"row {number + 1} has {len(row)} cells, not the {len(names)} of {', '.join(names)}")
    cells = [[_number(cell) for cell in row] for row in body]
    return names, np.array(cells, dtype=float).reshape(-1, len(names))


def _cells(line: str) -> list[str]:
    return line.split(",") if "," in line else line.split()


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(cell: str) -> float:
    return float(cell) if _is_number(cell) else float("nan")


def _whole(values: Array, name: str) -> Array:
    if not (np.abs(values) < 2**53).all() or (values != np.rint(values)).any():
        raise ValueError(f"{name} must be whole numbers")
    return values.astype(np.int64)


def _frame_time(columns: dict[str, Array], options: Options, path: Path) -> float:
    """Seconds that a frame number stands for: from the option, or from the column of times."""
    if options.frame_time is not None:
        return options.frame_time
    frame, t = columns["frame"], columns.get("t")
    if t is None:
        raise RecordError(f"{path} does not say how long a frame is; tell it, e.g. --frame-time 0.04")
    first, last = int(np.argmin(frame)), int(np.argmax(frame))
    span = frame[last] - frame[first]
    per_frame = float((t[last] - t[first]) / span) if span else 0.0
    if not per_frame > 0.0 or not (np.abs(t - t[first] - (frame - frame[first]) * per_frame) < 2e-3).all():
        raise ValueError("its times t are no multiple of its frame numbers")
    return per_frame


def _groups(columns: dict[str, Array]) -> dict[int, int] | None:
    """Of each person their group's number, 0 for nobody's; None where nobody annotated groups."""
    if "group" not in columns or np.isnan(columns["group"]).all():
        return None
    group = _whole(np.nan_to_num(columns["group"]), "group")
    return dict(zip(_whole(columns["ped"], "ped").tolist(), group.tolist(), strict=True))


def walls_beside(path: Path) -> Array:
    """(W, 4), from the file beside it, if there is one."""
    beside = path.with_name(f"{path.name.split('.')[0]}.obstacles.csv")
    return read_walls(beside) if beside.is_file() else np.zeros((0, 4))


def read_walls(path: Path) -> Array:
    """(W, 4), x1, y1, x2, y2, m.

    Raises:
        RecordError: the file holds something else.
    """
    with parsing(path, "walls"):
        names, cells = _read(path)
    if names != list(OBSTACLES) or not (np.abs(cells) < LARGEST).all():
        raise RecordError(f"{path} must hold numbers under {', '.join(OBSTACLES)}")
    return cells


def desired_speed_beside(path: Path) -> float | None:
    """m/s, from the file beside it, if there is one."""
    beside = path.with_name(f"{path.name.split('.')[0]}.json")
    if not beside.is_file():
        return None
    told = load_json(beside, "settings")
    if not isinstance(told, dict) or "desired_speed" not in told:
        return None
    return float(numbers([told], ("desired_speed",), beside.name)[0, 0])


FORMAT = Format("tracks of people: frame, ped, x, y", ".csv", import_, export=export)
