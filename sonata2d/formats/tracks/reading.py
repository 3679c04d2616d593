"""The reader of recorded tracks: detection of the layout, units, times, gaps, and ids that are used again."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from operator import not_
from pathlib import Path

import numpy as np

from ...core.files.limits import MAX_MATRIX_BYTES, MAX_PERSON_SPEED, MAX_TRACKS_BYTES
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.wording import counted
from ...errors import RecordError
from ...record.files import read_bytes
from ...scenegen.scenario.parse import parse_settings
from ..format import Options
from ..importing import load_json, numbers, parsing
from . import sources, tables
from .judgement import RARE, TrackSummary, judged
from .observations import (
    Observations,
    Track,
    Tracks,
    homography_of,
    interpolated,
    length_named,
    require_bounded,
    require_few,
)

NAME = "tracks"
SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".ndjson", ".vsp", ".sqlite", ".db", ".traj")
LONGEST_GAP = 2.0  # s, that is bridged: in this time a pedestrian takes a few steps; after longer ones a track ends
JITTER = 2e-3  # s, that rounded times may differ from an even grid
_SAME_RATE = 0.01  # of a frame rate: a larger difference from what the file says is noted
_LEAST_JUMP = 0.5  # m; shorter ones are noise of the tracker
_GRID = 1e-6  # tolerance of frame numbers on the grid of their most frequent step


def read_tracks(path: Path, options: Options) -> tuple[Tracks, TrackSummary]:
    """Read the recorded tracks of a file, and judge whether people can have walked so.

    The layout is found from the content of the file.

    NAME.obstacles.csv (walls) and NAME.json (`{"desired_speed": m/s}`) beside the file are read too.

    Args:
        path: the file.
        options: `frame_time` or `frame_rate`, `columns`, `unit` or `homography`, and `walls`.

    Returns:
        The tracks, and a summary with remarks and doubts.

    Raises:
        RecordError: the file is damaged, does not show units, times or columns, or nobody can walk as its tracks do.
    """
    with parsing(path, NAME):
        if options.frame_time is not None and options.frame_rate is not None:
            raise ValueError("give the frame time or the frame rate, not both")
        observations = _observations(path, options)
        tracks = _assembled(_in_metres(observations, options, path), options, path)
        walls = read_walls(Path(options.walls)) if options.walls is not None else walls_beside(path)
        tracks = replace(
            tracks, walls=tracks.walls if walls is None else walls, desired_speed=_desired_speed_beside(path)
        )
        return tracks, judged(tracks)


def _observations(path: Path, options: Options) -> Observations:
    """The positions in a file of any layout."""
    data = read_bytes(path, max_bytes=MAX_TRACKS_BYTES)
    is_base = data.startswith(b"SQLite format 3\0")
    text = "" if is_base else _decoded(data)
    if options.columns is None:
        return sources.jupedsim(path) if is_base else _of_text(text, path)
    if is_base or text.lstrip().startswith("{"):
        raise ValueError("columns can be named in tables of text only; leave them out")
    columns: str | tuple[str, ...] = options.columns
    return tables.read_observations(text, columns.split(",") if isinstance(columns, str) else columns)


def _of_text(text: str, path: Path) -> Observations:
    start = text[:4000].lstrip()
    first = start.partition("\n")[0].strip()
    if first.startswith("{"):
        return sources.trajnet(text)
    if "number of splines" in first or path.suffix == ".vsp":
        return sources.vsp(text)
    if first.startswith("#IDXCOL") or re.search(r"\bstartX\b", start):
        return sources.vadere(text, path)
    if first.startswith("FILE_ID") or "N_FRAMES_QTM" in start or "Centroid_X" in start:
        return sources.magni(text)
    cells = first.split()
    if (
        len(cells) == 10
        and re.fullmatch(r'"?[A-Za-z][\w ]*"?', cells[9])
        and not re.search("[A-Za-z]", "".join(cells[:9]))
    ):
        rows = list(csv.reader((" ".join(line.split()) for line in text.splitlines() if line.strip()), delimiter=" "))
        if odd := next((k for k, row in enumerate(rows) if len(row) != 10), None):
            raise ValueError(f"row {odd + 1} has {len(rows[odd])} cells, not the 10 of Stanford Drone annotations")
        return sources.sdd(rows)
    return tables.read_observations(text, None)


def _decoded(data: bytes) -> str:
    encodings = ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "cp1252")
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
    raise ValueError("it is not text, nor a data base of JuPedSim")


def _in_metres(found: Observations, options: Options, path: Path) -> Observations:
    """The observations with positions and walls in metres."""
    if options.unit is not None and options.homography is not None:
        raise ValueError("give the unit or the homography, not both")
    homography, notes = options.homography, found.notes
    if found.in_pixels and options.unit is None and homography is None:
        beside = path.with_name("H.txt")
        if not beside.is_file():
            raise ValueError(
                "its positions are pixels; give --unit METRES, the length of a pixel, or --homography FILE"
            )
        homography, notes = beside, (*notes, "positions are mapped to the ground by H.txt beside it")
    if homography is not None:
        matrix = _homography(Path(homography), path)
        ends = found.walls.reshape(-1, 2)
        return replace(
            found, position=_mapped(found.position, matrix), walls=_mapped(ends, matrix).reshape(-1, 4), notes=notes
        )
    unit = found.unit or 1.0
    if options.unit is not None:
        unit = length_named(str(options.unit))
    return replace(found, position=found.position * unit, walls=found.walls * unit)


def _mapped(points: Array, matrix: Array) -> Array:
    mapped = np.column_stack((points, np.ones(len(points)))) @ matrix.T
    if (np.abs(mapped[:, 2]) < 1e-12).any():
        raise ValueError("the homography maps a position to infinity")
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def _homography(file: Path, path: Path) -> Array:
    """The matrix in a file, or the scale of a video of Stanford Drone in `estimated_scales.yaml` of OpenTraj."""
    if file.suffix not in (".yaml", ".yml"):
        return homography_of(file, _decoded(read_bytes(file, max_bytes=MAX_MATRIX_BYTES)))
    scene, video = path.absolute().parent.parent.name, path.absolute().parent.name
    try:
        scale = parse_settings(file, "scales")[scene][video]["scale"]
    except (KeyError, TypeError) as error:
        raise ValueError(f"{file} gives no scale of {scene}, {video}, the folders of {path.name}") from error
    return homography_of(file, str(scale))


def _assembled(found: Observations, options: Options, path: Path) -> Tracks:
    """Tracks at even times from observations in metres."""
    notes = list(found.notes)
    seen: BoolArray = np.asarray(~np.isnan(found.position).any(axis=1))
    require_bounded(found.position, "positions")
    for values in (found.frame, found.time):
        if values is not None:
            require_bounded(values, "frames and times")
            seen = np.asarray(seen & ~np.isnan(values))
    if unseen := int((~seen).sum()):
        notes.append(f"{unseen} of {len(seen)} rows hold no position: the person was not observed")
    if not seen.any():
        raise ValueError("it holds no position")
    ped, position = found.ped[seen], found.position[seen]
    group = None if found.group is None else _integers(np.nan_to_num(found.group[seen]), "group")
    stamp, seconds_per_stamp = _stamps(found, seen, options, path)
    order = np.lexsort((stamp, ped))
    ped, position, stamp = ped[order], position[order], stamp[order]
    is_frame = found.frame is not None
    repeated = _repeated(ped, position, stamp, is_frame)
    if repeated.any():
        notes.append(f"{counted(int(repeated.sum()), 'row')} repeated: what is there twice counts once")
        ped, position, stamp = ped[~repeated], position[~repeated], stamp[~repeated]
    step = _step(ped, stamp, is_frame)
    given = _given_duration(options)
    if not is_frame and given is not None:
        step = given
    interval = step * seconds_per_stamp if found.interval is None or given is not None else found.interval
    if given is not None and found.frame_rate and abs(given * found.frame_rate - 1.0) > _SAME_RATE:
        notes.append(f"the file says {found.frame_rate:g} Hz; {1.0 / given:g} Hz was given")
    scale = interval / step  # s per stamp
    if not 1e-4 <= interval < 1e6:
        raise ValueError(
            f"a step of {interval:g} s between frames is too {'short' if interval < 1 else 'long'}; check it"
        )
    doubts = list[str]()
    pieces = _pieces(ped, stamp, position, step, scale, notes, doubts)
    groups = {} if group is None else dict(zip(found.ped[seen].tolist(), group.tolist(), strict=True))
    even = _evened(pieces, step, is_frame, JITTER / scale, notes)
    origin = min(float(times[0]) for _, _, times, _ in even)
    people = [Track(id, (times - origin) * scale, places, groups.get(source, 0)) for id, source, times, places in even]
    is_robot = [source == found.robot for _, source, _, _ in even]
    if sum(is_robot) > 1:
        notes.append("the robot's track has long gaps; its longest part counts")
    return Tracks(
        people=tuple(compress(people, map(not_, is_robot))),
        interval=interval,
        layout=found.layout,
        has_groups=group is not None,
        walls=found.walls,
        robot=max(compress(people, is_robot), key=lambda track: len(track.time), default=None),
        notes=tuple(notes),
        doubts=tuple(doubts),
    )


def _repeated(ped: IntArray, position: Array, stamp: Array, is_frame: bool) -> BoolArray:
    """Mark the observations, ordered by person and stamp, that repeat the one before; (M,).

    Raises:
        ValueError: a person is in two places at once.
    """
    repeated = np.zeros(len(ped), dtype=bool)
    repeated[1:] = (np.diff(ped) == 0) & (np.diff(stamp) == 0)
    other = repeated[1:] & (position[1:] != position[:-1]).any(axis=1)
    if other.any():
        k = int(np.argmax(other))
        (x, y), (u, v) = position[k].tolist(), position[k + 1].tolist()
        at = f"frame, {stamp[k]:.15g}" if is_frame else f"moment, {stamp[k]:g} s"
        raise ValueError(
            f"person {ped[k]} is in two places in one {at}: ({x:g}, {y:g}) and ({u:g}, {v:g}); give the second person"
            " another id"
        )
    return repeated


def _given_duration(options: Options) -> float | None:
    """Duration of one frame number that the options give, s; None if they give none.

    Raises:
        ValueError: it is not above 0.
    """
    for name, value in (("frame time", options.frame_time), ("frame rate", options.frame_rate)):
        if value is not None and not value > 0.0:
            raise ValueError(f"the {name} must be above 0, got {value:g}")
    return options.frame_time if options.frame_rate is None else 1.0 / options.frame_rate


def _stamps(found: Observations, seen: BoolArray, options: Options, path: Path) -> tuple[Array, float]:
    """Frame numbers, or times if there are none, of what was seen, and the duration of one, s."""
    if found.frame is None:
        assert found.time is not None, "a table has frames or times"
        time = found.time[seen]
        return np.asarray(time - time.min()), 1.0
    frame = found.frame[seen]
    if (given := _given_duration(options)) is not None:
        return frame, given
    if found.time is not None:
        return frame, _duration(frame, found.time[seen])
    if found.frame_rate is None and found.interval is None:
        raise RecordError(
            f"{path} does not give the duration of a frame; pass it, e.g. --frame-time 0.04, or --frame-rate 25"
        )
    if found.frame_rate is None:
        return frame, 1.0
    if not found.frame_rate > 0.0:
        raise ValueError(f"it gives a frame rate of {found.frame_rate:g} Hz; give the true one with --frame-rate")
    return frame, 1.0 / found.frame_rate


def _duration(frame: Array, t: Array) -> float:
    """Duration of one frame number, s: the slope of the times, which must be constant."""
    first, last = int(np.argmin(frame)), int(np.argmax(frame))
    span = frame[last] - frame[first]
    if not span:
        raise ValueError("it must hold two frames or more")
    per_frame = float((t[last] - t[first]) / span)
    rounding = next((10.0**-digits for digits in range(4) if (np.round(t, digits) == t).all()), 0.0)
    tolerance = max(JITTER, 1.01 * rounding)  # half a digit, of both ends
    if not per_frame > 0.0 or not (np.abs(t - t[first] - (frame - frame[first]) * per_frame) < tolerance).all():
        raise ValueError("its times t are not proportional to its frame numbers; leave one of them out with --columns")
    return per_frame


def _integers(values: Array, name: str) -> IntArray:
    if not (np.abs(values) < 2**53).all() or (values != np.rint(values)).any():
        raise ValueError(f"{name} must be integers")
    return values.astype(np.int64)


def _step(ped: IntArray, stamp: Array, is_frame: bool) -> float:
    """The most frequent step between successive frames of a person; of times, the mean."""
    steps = np.diff(stamp)[np.diff(ped) == 0]
    if not len(steps):
        raise ValueError("it must hold a person who is observed in two frames or more")
    if is_frame:
        values, counts = np.unique(steps, return_counts=True)
        return float(values[np.argmax(counts)])
    median = float(np.median(steps))
    usual = steps[steps < 10 * median]
    return float(usual.sum() / np.maximum(np.rint(usual / median), 1.0).sum())


_Piece = tuple[int, int, Array, Array]  # id, id in the file, (K,) stamps, (K, 2) positions, m


def _pieces(
    ped: IntArray, stamp: Array, position: Array, step: float, scale: float, notes: list[str], doubts: list[str]
) -> list[_Piece]:
    """Divide the observations into tracks: by person, where a person is away for long, and at rare jumps.

    Args:
        ped, stamp, position: (M,), (M,), (M, 2) of the observations, ordered by person and time.
        step: between observations, in stamps.
        scale: duration of a stamp, s.
        notes, doubts: get remarks on divided tracks.
    """
    same, duration = np.diff(ped) == 0, np.diff(stamp) * scale
    distance = np.hypot(*np.diff(position, axis=0).T)
    is_jump = same & (distance > np.maximum(MAX_PERSON_SPEED * duration, _LEAST_JUMP))
    gone = same & (duration > 1.5 * step * scale)
    is_return = gone & (is_jump | (duration > max(LONGEST_GAP, 2.01 * step * scale)))
    is_jump &= ~gone
    if absence := _absence(np.concatenate((position[:-1][is_jump], position[1:][is_jump]))):
        doubts.append(absence)
    if is_jump.sum() > RARE * same.sum():  # units, times or columns are wrong: the tracks will be refused
        is_jump[:] = False
    cuts = np.flatnonzero(~same | is_return | is_jump) + 1
    parts = zip(np.split(ped, cuts), np.split(stamp, cuts), np.split(position, cuts), strict=True)
    used, highest = set[int](), int(ped.max())
    pieces = list[_Piece]()
    for ids, stamps, positions in parts:
        id = source = int(ids[0])
        if source in used:
            highest = id = highest + 1
        used.add(source)
        pieces.append((id, source, stamps, positions))
    seconds = (stamp - stamp.min()) * scale
    for is_cut, remarks, reason in (
        (is_return, notes, "is not observed from {:.6g} to {:.6g} s, too long or too far to be the same walk"),
        (is_jump, doubts, "jumps between {:.6g} and {:.6g} s, faster than people run"),
    ):
        if count := int(is_cut.sum()):
            k = int(np.argmax(is_cut))
            more = f", and {count - 1} more such cases" if count > 1 else ""
            remarks.append(
                f"person {ped[k]} {reason.format(seconds[k], seconds[k + 1])}{more}; what follows has a new id"
            )
    return pieces


def _absence(ends: Array) -> str | None:
    """Remark on a position, such as (-999, -999), from and to which people jump again and again; ends (K, 2), m."""
    places, counts = np.unique(ends, axis=0, return_counts=True)
    if counts.max(initial=0) < 3:  # one absence is two jumps, as is one fault of a track
        return None
    x, y = places[counts.argmax()].tolist()
    return (
        f"{counts.max()} jumps begin or end at the position ({x:g}, {y:g}) m; if it marks missing observations, leave"
        " their cells empty"
    )


def _evened(pieces: Sequence[_Piece], step: float, is_frame: bool, jitter: float, notes: list[str]) -> list[_Piece]:
    """Bring each track to even steps from its first observation, and bridge its gaps by straight lines.

    Args:
        pieces: tracks.
        step: between positions, in stamps.
        is_frame: whether stamps are frame numbers, which lie on the steps; times need not.
        jitter: difference of a time from the steps that is rounding, in stamps.
        notes: gets remarks on bridged gaps and shifted times.

    Raises:
        ValueError: frames of a person are no multiples of the step, or there are too many positions.
    """
    tolerance = _GRID if is_frame else max(_GRID, min(jitter / step, 0.2))
    observed = sum(len(stamp) for _, _, stamp, _ in pieces)
    evened, total, bridged, shifted = list[_Piece](), 0, 0, 0
    for id, source, stamp, position in pieces:
        row = (stamp - stamp[0]) / step
        uneven = np.abs(row - np.rint(row)) > tolerance
        if not uneven.any():
            row = np.rint(row)
        elif is_frame:
            raise ValueError(
                f"frame {float(stamp[np.argmax(uneven)]):.15g} is not a multiple of the most frequent step, {step:g}"
                f" frames, after the first frame of person {source}"
            )
        else:
            shifted += int(uneven.sum())
        total += int(row[-1]) + 1
        require_few(total, 1, observed)
        even = np.arange(np.floor(row[-1] + tolerance) + 1)
        if not uneven.any():
            bridged += len(even) - len(stamp)
        evened.append((id, source, stamp[0] + even * step, interpolated(even, row, position)))
    if bridged:
        notes.append(f"gaps of up to {LONGEST_GAP:g} s are bridged by straight lines: {counted(bridged, 'position')}")
    if shifted:
        notes.append(f"{shifted} positions at uneven times are moved to even ones, on straight lines")
    return sorted(evened, key=lambda piece: piece[0])


def walls_beside(path: Path) -> Array | None:
    """Read NAME.obstacles.csv beside NAME.csv; (W, 4), None if the file does not exist.

    Raises:
        RecordError: the file is damaged.
    """
    walls = path.with_name(f"{path.name.split('.')[0]}.obstacles.csv")
    return read_walls(walls) if walls.is_file() else None


def read_walls(path: Path) -> Array:
    """Read a file of walls; (W, 4), x1, y1, x2, y2, m.

    Raises:
        RecordError: the file has other columns, or values that are not finite numbers.
    """
    with parsing(path, "walls"):
        return tables.read_numbers(_decoded(read_bytes(path)), ("x1", "y1", "x2", "y2"))


def _desired_speed_beside(path: Path) -> float | None:
    """Read the desired speed of all people, m/s, from NAME.json beside NAME.csv; None if it is not given.

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
