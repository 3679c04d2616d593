"""Layouts of tracks that are no plain tables: TrajNet++, UCY, Stanford Drone, JuPedSim, Vadere, THÖR-MAGNI."""

from __future__ import annotations

import csv
import json
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ...core.files.limits import MAX_CELLS
from ...core.portable_math import Array
from ...core.wording import counted
from ..importing import load_json, numbers
from .observations import LENGTHS, Observations, ids_of, people_and_robot, require_few

TRAJNET_INTERVAL = 0.4  # s between observations
_UCY_RATE, _SDD_RATE, _MAGNI_RATE = 25.0, 30.0, 100.0  # Hz
_UCY_STEP = 10  # frames: 0.4 s, the interval at which the field uses these recordings
_MIRRORED = "y points down in the picture, so that left and right are exchanged; a matrix (homography) can turn it"
_VADERE_STEP = 0.1  # s, between samples of the motion from footstep to footstep


def trajnet(text: str) -> Observations:
    """TrajNet++ (https://github.com/vita-epfl/trajnetplusplusdataset): lines of JSON, scenes and rows of tracks.

    Predictions of models (rows with a `prediction_number`) are no recorded tracks and are left out.

    Raises:
        ValueError: a line is neither, the scenes have different frame rates, or there are only predictions.
    """
    scenes, tracks, predictions = list[dict[str, Any]](), list[dict[str, Any]](), 0
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = _json(line)
        except ValueError as error:
            raise ValueError(f"line {number} is not valid JSON: {error}") from error
        if not isinstance(row, dict) or not isinstance(row.get("scene", row.get("track")), dict):
            raise ValueError(f"line {number} is neither a scene nor a track")
        if "scene" in row:
            scenes.append(row["scene"])
        elif row["track"].get("prediction_number") is None:
            tracks.append(row["track"])
        else:
            predictions += 1
    if not tracks:
        only = f"{counted(predictions, 'prediction')} of a model, but no tracks; import the file that these come from"
        raise ValueError(f"it holds {only if predictions else 'no tracks'}")
    rates = {scene.get("fps") for scene in scenes} - {None}
    if len(rates) > 1:
        raise ValueError(f"its scenes have different frame rates, {sorted(map(str, rates))}")
    rate = float(numbers([{"fps": rates.pop()}], ("fps",), "scenes")[0, 0]) if rates else 1 / TRAJNET_INTERVAL
    if rate <= 0:
        raise ValueError(f"fps must be positive, got {rate:g}")
    table = numbers(tracks, ("f", "p"), "tracks")
    if (table != np.rint(table)).any():
        raise ValueError("f and p must be integers")
    absent = [row["x"] is None or row["y"] is None or row["x"] != row["x"] or row["y"] != row["y"] for row in tracks]
    position = np.full((len(tracks), 2), np.nan)
    present = [row for row, is_absent in zip(tracks, absent, strict=True) if not is_absent]
    position[~np.array(absent)] = numbers(present, ("x", "y"), "tracks")
    ped, notes = ids_of([f"{p:.0f}" for p in table[:, 1]])
    if predictions:
        notes = (*notes, f"left out: {counted(predictions, 'prediction')} of a model")
    return Observations(ped, position, table[:, 0], None, "trajnet", unit=1.0, interval=1 / rate, notes=notes)


def _json(line: str) -> Any:
    try:
        return orjson.loads(line)
    except orjson.JSONDecodeError:
        return json.loads(line)  # Python writes NaN, which is no JSON


def vsp(text: str) -> Observations:
    """Control points of UCY (`.vsp`): x, y in pixels from the centre of the picture, y up, and the frame, 25 Hz.

    A person moves in straight lines between the control points, as in OpenTraj and TrajNet++; A. Lerner et al., "Crowds
    by example", Computer Graphics Forum 26 (2007). Positions are taken every 10 frames.

    Raises:
        ValueError: a line is damaged, or a person is at two places in one frame.
    """
    people, notes = list[list[list[float]]](), list[str]()
    for number, line in enumerate(text.splitlines(), 1):
        content, _, comment = line.partition(" - ")
        cells = content.split()
        if "control points" in comment.lower():
            people.append([])
        elif len(cells) == 4 and people:
            try:
                people[-1].append([float(cell) for cell in cells[:3]])
            except ValueError:
                raise ValueError(f"line {number} is not x, y, frame and gaze: {line.strip()!r}") from None
        elif cells and people:
            break  # obstacles and other things follow in some files
    rows, total = list[Array](), 0.0
    for id, points in enumerate(people, 1):
        if len(points) < 2:
            notes.append(f"person {id} has {len(points)} control points, which is no motion, and is left out")
            continue
        x, y, frame = np.array(sorted(points, key=lambda point: point[2])).T
        if not np.isfinite((x, y, frame)).all() or (np.diff(frame) <= 0).any():
            raise ValueError(f"person {id} has control points without finite numbers, or two in one frame")
        total += (frame[-1] - frame[0]) / _UCY_STEP
        require_few(total, 1, sum(map(len, people)))
        at = np.arange(np.ceil(frame[0] / _UCY_STEP), np.floor(frame[-1] / _UCY_STEP) + 1) * _UCY_STEP
        if not len(at):
            notes.append(f"person {id} is seen between two of every {_UCY_STEP} frames only, and is left out")
        rows.append(np.stack((np.full(len(at), id), at, np.interp(at, frame, x), np.interp(at, frame, y)), axis=1))
    if not rows:
        raise ValueError("it holds no person with two control points or more")
    ped, frames, x, y = np.concatenate(rows).T
    return Observations(
        ped.astype(np.int64), np.stack((x, y), axis=1), frames, None, "vsp", in_pixels=True, frame_rate=_UCY_RATE,
        notes=tuple(notes),
    )  # fmt: skip


def sdd(rows: list[list[str]]) -> Observations:
    """Annotations of the Stanford Drone Dataset: id, xmin, ymin, xmax, ymax, frame, lost, occluded, generated, class.

    Boxes in pixels, 30 Hz; A. Robicquet et al., "Learning social etiquette", ECCV 2016. The position is the centre of
    the box; rows that are marked as lost are left out, and so is whoever is no pedestrian.

    Args:
        rows: cells of each row.

    Raises:
        ValueError: a cell is not a number.
    """
    values = np.array([row[:9] for row in rows], dtype=float)
    if not np.isfinite(values).all():
        raise ValueError("its first nine columns must be finite numbers")
    ids, notes = ids_of([f"{id:.0f}" for id in values[:, 0]])
    is_person, robot, left_out = people_and_robot([row[9] for row in rows], ids)
    kept = is_person & (values[:, 6] == 0)
    return Observations(
        ids[kept], (values[kept, 1:3] + values[kept, 3:5]) / 2, values[kept, 5], None, "sdd", in_pixels=True,
        frame_rate=_SDD_RATE, robot=robot, notes=(*notes, *left_out, _MIRRORED),
    )  # fmt: skip


def jupedsim(path: Path) -> Observations:
    """Trajectories of JuPedSim (`.sqlite`, versions 1 and 2): positions in m, the frame rate, and the walkable area.

    Raises:
        ValueError: the file is damaged, or lacks a table.
    """
    try:
        with closing(sqlite3.connect(f"file:{_quoted(path)}?mode=ro&immutable=1", uri=True)) as base:
            # A view with the name of a table could run for ever.
            tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if missing := {"trajectory_data", "metadata"} - tables:
                raise ValueError(f"it has no table {min(missing)}, as trajectories of JuPedSim have")
            ((count,),) = base.execute("SELECT count(*) FROM trajectory_data")
            if count > MAX_CELLS:
                raise ValueError(f"it holds {count} positions; the limit is {MAX_CELLS}, so divide it by time")
            rows = base.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data").fetchall()
            ((fps,),) = base.execute("SELECT value FROM metadata WHERE key = 'fps'").fetchall() or [(None,)]
            areas = base.execute("SELECT DISTINCT wkt FROM geometry").fetchmany(2) if "geometry" in tables else []
    except sqlite3.Error as error:
        raise ValueError(f"it is not a data base of JuPedSim: {error}") from error
    if not rows:
        raise ValueError("it has no rows")
    frame, ped, x, y = np.array(rows, dtype=float).T
    rate = float(fps) if fps is not None else None
    ids, notes = ids_of([f"{id:.0f}" for id in ped])
    if len(areas) > 1:
        notes = (*notes, "the walkable area changes; the walls are those of its first state")
    walls = polygon_walls(str(areas[0][0])) if areas else np.zeros((0, 4))
    return Observations(
        ids, np.stack((x, y), axis=1), frame, None, "jupedsim", unit=1.0, frame_rate=rate, walls=walls, notes=notes
    )


def _quoted(path: Path) -> str:
    return str(path.absolute()).replace("%", "%25").replace("?", "%3f").replace("#", "%23")


def polygon_walls(wkt: str) -> Array:
    """Walls along the outlines of the polygons in a well-known text (OGC 06-103r4); (W, 4), x1, y1, x2, y2, m.

    Raises:
        ValueError: it holds no polygon, or cells that are no numbers.
    """
    rings = re.findall(r"\(([^()]+)\)", wkt)
    if "POLYGON" not in wkt.upper() or not rings:
        raise ValueError(f"its walkable area is no polygon: {wkt[:60]!r}")
    return np.concatenate(
        [_ring([[float(v) for v in point.split()[:2]] for point in ring.split(",")]) for ring in rings]
    )


def _ring(points: list[list[float]]) -> Array:
    """Walls from point to point and back to the first one; (W, 4)."""
    closed = points if points[0] == points[-1] else [*points, points[0]]
    return np.array([[*a, *b] for a, b in pairwise(closed) if a != b], dtype=float).reshape(-1, 4)


def vadere(text: str, path: Path) -> Observations:
    """Footsteps of Vadere (`.traj`): who steps from where to where between which times, m and s.

    Positions are taken every 0.1 s on the straight lines of the steps. Obstacles and bounds come from the `.scenario`
    file beside, if there is one.

    Args:
        text: the content of the file.
        path: the file.

    Raises:
        ValueError: a column is missing, or a cell is not a number.
    """
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise ValueError("it has no rows")
    if short := next((k for k, row in enumerate(lines) if len(row) < len(lines[0])), None):
        raise ValueError(f"row {short} has {len(lines[short])} cells, not the {len(lines[0])} of its columns")
    names = [name.split("-")[0].lower() for name in lines[0]]
    wanted = ("pedestrianid", "simtime", "endtime", "startx", "starty", "endx", "endy")
    if missing := [name for name in wanted if name not in names]:
        raise ValueError(f"it has no column {missing[0]}; its columns are {', '.join(lines[0])}")
    table = np.array([[float(row[names.index(name)]) for name in wanted] for row in lines[1:]]).reshape(-1, len(wanted))
    if not len(table):
        raise ValueError("it has no rows")
    rows, total = list[Array](), 0.0
    for id in np.unique(table[:, 0]):
        steps = table[table[:, 0] == id]
        steps = steps[np.argsort(steps[:, 1], kind="stable")]
        times, places = steps[:, 1:3].ravel(), steps[:, 3:7].reshape(-1, 2)  # who waits between two steps stands
        order = np.argsort(times, kind="stable")
        times, places = times[order], places[order]
        total += (times[-1] - times[0]) / _VADERE_STEP
        require_few(total, 1, len(table))
        at = np.arange(np.ceil(times[0] / _VADERE_STEP - 1e-9), np.floor(times[-1] / _VADERE_STEP + 1e-9) + 1)
        seconds = at * _VADERE_STEP
        rows.append(
            np.stack((np.full(len(at), id), at, *(np.interp(seconds, times, places[:, k]) for k in (0, 1))), axis=1)
        )
    ped, frame, x, y = np.concatenate(rows).T
    ids, notes = ids_of([f"{id:.0f}" for id in ped])
    walls, found = _vadere_walls(path)
    return Observations(
        ids, np.stack((x, y), axis=1), frame, None, "vadere", unit=1.0, frame_rate=1 / _VADERE_STEP, walls=walls,
        notes=(*notes, *found),
    )  # fmt: skip


def _vadere_walls(path: Path) -> tuple[Array, tuple[str, ...]]:
    """Walls of the `.scenario` file beside: of the same name, else the only one in the folder."""
    beside = path.with_suffix(".scenario")
    others = [beside] if beside.is_file() else sorted(path.parent.glob("*.scenario"))
    if len(others) != 1:
        return np.zeros((0, 4)), ()
    try:
        topography = load_json(others[0], "Vadere scenario")["scenario"]["topography"]
        bounds = topography["attributes"]["bounds"]
        x, y, right, top = bounds["x"], bounds["y"], bounds["x"] + bounds["width"], bounds["y"] + bounds["height"]
        rings = [[[x, y], [right, y], [right, top], [x, top]], *map(_outline, topography["obstacles"])]
    except (KeyError, TypeError, ValueError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise ValueError(
            f"{others[0].name} beside it, which holds its walls, is no scenario of Vadere: {reason}"
        ) from error
    return np.concatenate([_ring(ring) for ring in rings]), (f"walls come from {others[0].name}",)


def _outline(obstacle: dict[str, Any]) -> list[list[float]]:
    shape = obstacle["shape"]
    if shape["type"] == "RECTANGLE":
        x, y, width, height = (float(shape[key]) for key in ("x", "y", "width", "height"))
        return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
    return [[float(point["x"]), float(point["y"])] for point in shape["points"]]


def magni(text: str) -> Observations:
    """Motion capture of THÖR-MAGNI: rows of frames at 100 Hz with the bodies side by side, mm.

    T. Schreiter et al., "THÖR-MAGNI", The International Journal of Robotics Research 44 (2025). Helmets are people; the
    position is the centroid of the markers of a body, or in files without centroids its most often visible marker. The
    mobile robot becomes the robot, other bodies are left out.

    Raises:
        ValueError: the table has no column of a helmet, or cells that are no numbers.
    """
    reader = csv.reader(text.splitlines())
    header = next((row for row in reader if "Frame" in row[:2] and len(row) > 2), None)
    if header is None:
        raise ValueError("it has no header row that begins with Frame and Time")
    places = {name.strip(): k for k, name in enumerate(header)}
    rows = list[list[str]]()
    for row in reader:
        if any(row):
            if len(row) < len(header):
                raise ValueError(f"row {len(rows) + 1} has {len(row)} cells, not the {len(header)} of its header")
            rows.append(row)
    if not rows:
        raise ValueError("it has no rows")
    frame = _column(rows, places["Frame"])
    bodies = dict.fromkeys(
        re.split(r" - | Centroid_| [XYZ]$| R\d$", name)[0] for name in places if name.endswith((" X", "Centroid_X"))
    )
    names, tracks, others = list[str](), list[Array](), list[str]()
    for body in bodies:
        if not body.startswith("Helmet") and "robot" not in body.lower():
            others.append(body)
            continue
        positions = [np.stack((_column(rows, x), _column(rows, y)), axis=1) for x, y in _markers(body, places)]
        best = min(positions, key=lambda position: int(np.isnan(position).sum()))
        seen = ~np.isnan(best).any(axis=1)
        if seen.any():
            names.append(body)
            tracks.append(
                np.concatenate((np.full((seen.sum(), 1), len(names) - 1), frame[seen, None], best[seen]), axis=1)
            )
    if not any(name.startswith("Helmet") for name in names):
        raise ValueError(
            "it has no visible helmet, that is no columns Helmet_1 Centroid_X, Centroid_Y or Helmet_1 - 1 X, Y"
        )
    table = np.concatenate(tracks)
    robots = [name for name in names if not name.startswith("Helmet")]
    number = {name: int(re.sub(r"\D", "", name) or 0) for name in names}
    number |= {name: max(number.values()) + 1 + k for k, name in enumerate(robots)}
    notes = [f"{body} is neither a helmet nor a robot and is left out" for body in others]
    notes += [f"{robot} is left out: an episode has one robot" for robot in robots[1:]]
    kept = np.isin(table[:, 0], [names.index(name) for name in names if name not in robots[1:]])
    table = table[kept]
    return Observations(
        np.array([number[names[int(k)]] for k in table[:, 0]], dtype=np.int64), table[:, 2:], table[:, 1], None,
        "thor-magni", unit=LENGTHS["mm"], frame_rate=_MAGNI_RATE, robot=number[robots[0]] if robots else None,
        notes=tuple(notes),
    )  # fmt: skip


def _markers(body: str, places: dict[str, int]) -> Iterator[tuple[int, int]]:
    """Columns of x and y of a body: of its centroid, or of each marker."""
    if f"{body} Centroid_X" in places:
        yield places[f"{body} Centroid_X"], places[f"{body} Centroid_Y"]
        return
    for name, column in places.items():
        if name.startswith((f"{body} - ", f"{body} X")) and name.endswith(" X"):
            yield column, places[name[:-1] + "Y"]


def _column(rows: list[list[str]], place: int) -> Array:
    return np.array([float(row[place] or "nan") for row in rows])
