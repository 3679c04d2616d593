"""Episodes of recorded tracks: people who come and go; velocities and headings follow from the tracks.

An episode also needs a robot and a goal. Where the file has no robot, placeholders stand in a corner of the room, and
`imported.lacks` lists them, so that they are not mistaken for data.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ...core.geometry import PRECISION
from ...core.portable_math import Array, IntArray
from ...core.vectors import wrap_angles
from ...record.layout import JsonDict
from ...record.record import EpisodeRecord
from .. import estimates
from ..estimates import POSITION, THETA, VELOCITY, VX, X
from ..format import Format, Options
from ..imported import ROBOT, SourceEpisode, episode_document, goal_of
from ..importing import parsing
from .observations import Track, Tracks, interpolated, require_few
from .reading import JITTER, NAME, SUFFIXES, read_tracks

_MARGIN = 1.5  # m, of the room around the tracks; the robot stands in this margin
_MISSING = (
    "goal", "frames.command", "humans.radius", "humans.head", "frames.interactions",
    "interactions", "objects", "room",
)  # fmt: skip
TRACK_OPTIONS = frozenset({"frame_time", "frame_rate", "columns", "unit", "homography", "walls"})
"""Fields of `Options` that importers of tracks use."""
_DERIVED = ("frames.humans.velocity", "frames.humans.theta", "frames.activity", "room.polygon")


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episode of a file of tracks, in whatever layout it is.

    Args:
        path: the file.
        options: see `reading.read_tracks`.

    Raises:
        RecordError: the file is damaged, does not show units, times or columns, or its tracks do not fit one episode.
    """
    yield _document(path, options)


def _document(path: Path, options: Options) -> JsonDict:
    tracks, summary = read_tracks(path, options)
    with parsing(path, NAME):
        source = _source_episode(tracks, notes := list(summary.notes))
    document = episode_document(source, tracks.layout, path)
    document["imported"]["tracks"] = summary.to_json() | {"notes": notes}
    if tracks.desired_speed is not None:
        document["humans"] = [human | {"desired_speed": tracks.desired_speed} for human in document["humans"]]
        document["imported"]["lacks"].remove("humans.desired_speed")
    if not tracks.has_groups:
        document["imported"]["lacks"] = sorted([*document["imported"]["lacks"], "humans.group", "groups"])
        return document
    return document | _groups(document["humans"], [track.group for track in tracks.people])


def _source_episode(tracks: Tracks, notes: list[str]) -> SourceEpisode:
    moving = [*tracks.people, *([tracks.robot] if tracks.robot else [])]
    time, position, remarks = _common_times(moving, tracks.interval)
    notes += remarks
    unturned = np.concatenate((position, np.zeros((*position.shape[:2], 1))), axis=-1)
    rates = estimates.velocities(time, unturned)[..., POSITION]
    theta = estimates.headings_along(rates)
    poses = np.concatenate((position, theta[..., None]), axis=-1)
    # Bounds the turn rates of the shortest time steps: |omega| <= pi / PRECISION.
    omega = wrap_angles(np.nan_to_num(estimates.velocities(time, poses)[..., THETA]) * PRECISION) / PRECISION
    rows = np.concatenate((poses, rates, np.where(np.isnan(theta), np.nan, omega)[..., None], theta[..., None]), -1)
    walls, count = tracks.walls, len(tracks.people)
    everywhere = position[~np.isnan(position[..., X])]
    box = estimates.bounding_box(np.concatenate((everywhere, walls.reshape(-1, 2))), _MARGIN)
    corner = box[0] + _MARGIN / 2
    robot, goal = np.tile((*corner, 0.0, 0.0, 0.0, 0.0), (len(time), 1)), corner
    if tracks.robot is not None:
        robot, goal = _held(rows[:, count, :6]), tracks.robot.position[-1]
    lacks_robot = ("robot", "frames.robot") if tracks.robot is None else ()
    derived_robot = () if tracks.robot is None else ("frames.robot.theta", "frames.robot.velocity")
    return SourceEpisode(
        time=time,
        interval=tracks.interval,
        robot=robot,
        humans=rows[:, :count],
        ids=[track.id for track in tracks.people],
        radii=estimates.fitting_radii(position[:, :count], walls),
        activity=estimates.activity_of(rows[:, :count, VELOCITY]),
        interactions=[[] for _ in time],
        polygon=box,
        walls=walls,
        objects=[],
        goal=goal_of(goal.tolist()),
        robot_radius=ROBOT.radius,
        command=np.zeros((len(time) - 1, 3)) if tracks.robot is None else None,
        missing=(*_MISSING, *lacks_robot, *(() if len(walls) else ("walls",))),
        derived=(*_DERIVED, *derived_robot, *(("walls",) if len(walls) else ())),
    )


def _held(states: Array) -> Array:
    """States of the robot, which stands where it was seen last, or will be seen first, while it is not seen; (T, 6)."""
    seen = np.flatnonzero(~np.isnan(states[:, X]))
    nearest = seen[np.maximum(np.searchsorted(seen, np.arange(len(states)), "right") - 1, 0)]
    held = states[nearest]
    held[np.isnan(states[:, X]), VX:] = 0.0
    return np.asarray(held)


def _common_times(tracks: Sequence[Track], interval: float) -> tuple[Array, Array, list[str]]:
    """Times of all frames, also of those in which nobody was observed, and the positions at these.

    Tracks that overlap in time share even steps; while nobody is in view, these may shift.

    Returns:
        (T,), s, from 0; (T, N, 2), m, NaN where a track was not observed; remarks.
    """
    end = max(float(track.time[-1]) for track in tracks)
    require_few(end / interval + 1, len(tracks), sum(len(track.time) for track in tracks))
    placed: list[tuple[int, IntArray, Array]] = []
    frames, moved, shift = 0, 0, 0.0  # frames so far
    for together in _overlapping(tracks):
        origin = float(max((tracks[k] for k in together), key=lambda track: len(track.time)).time[0])
        on_grid = [(k, *_on_grid(tracks[k], origin, interval)) for k in together]
        moved += sum(is_moved * len(row) for _, row, _, is_moved in on_grid)
        first = min(row[0] for _, row, _, _ in on_grid)
        exact = (origin + first * interval) / interval  # where nobody is in view, the grid may shift
        begin = max(round(exact), frames) if frames else 0
        shift = max(shift, abs(exact - begin) * interval)
        placed += [(k, (row - first).astype(np.int64) + begin, position) for k, row, position, _ in on_grid]
        frames = max(int(row[-1]) for _, row, _ in placed) + 1
    if frames < 2:
        raise ValueError("it must hold two frames or more")
    positions = np.full((frames, len(tracks), 2), np.nan)
    for k, row, position in placed:
        positions[row, k] = position
    notes = [f"{moved} positions between the frames of others are moved to these, on straight lines"] if moved else []
    if shift > JITTER:
        notes.append(f"frames are shifted by up to {shift:.3g} s to even steps, at times when nobody is in view")
    return np.arange(frames, dtype=float) * interval, positions, notes


def _on_grid(track: Track, origin: float, interval: float) -> tuple[Array, Array, bool]:
    """Rows of a track on the grid of steps from `origin`, its positions there, and whether they were moved."""
    exact = (track.time - origin) / interval
    row = np.rint(exact)
    if (np.abs(exact - row) <= max(1e-6, min(JITTER / interval, 0.2))).all():
        return row, track.position, False
    grid = np.arange(np.ceil(exact[0]), np.floor(exact[-1]) + 1)
    row = grid if len(grid) else row[:1]
    return row, interpolated(row, exact, track.position), True


def _overlapping(tracks: Sequence[Track]) -> list[list[int]]:
    """Group the indices of tracks so that tracks of different groups do not overlap in time."""
    groups, end = list[list[int]](), -np.inf
    for k in sorted(range(len(tracks)), key=lambda k: float(tracks[k].time[0])):
        if not groups or tracks[k].time[0] > end:
            groups.append([])
        groups[-1].append(k)
        end = max(end, float(tracks[k].time[-1]))
    return groups


def _groups(humans: list[JsonDict], numbers: Sequence[int]) -> JsonDict:
    """The keys `humans` and `groups` of the document, with the groups of two or more pedestrians."""
    by_id = dict(zip((human["id"] for human in humans), numbers, strict=True))
    members: dict[int, list[int]] = {}
    for id, number in by_id.items():
        if number > 0:
            members.setdefault(number, []).append(id)
    groups = {number: group_ids for number, group_ids in members.items() if len(group_ids) > 1}
    return {
        "humans": [human | {"group": by_id[human["id"]] if by_id[human["id"]] in groups else None} for human in humans],
        "groups": [
            {"id": number, "kind": "walking", "members": group_ids, "formation": None}
            for number, group_ids in sorted(groups.items())
        ],
    }


def positions_of_present(humans: Array, ids: list[int]) -> tuple[IntArray, IntArray, Array]:
    """List the positions of the pedestrians who are present, frame by frame.

    Args:
        humans: (T, N, 7), states; NaN where absent.
        ids: (N,), of the pedestrians.

    Returns:
        (M,) frame indices, (M,) ids and (M, 2) positions, m.
    """
    rows, column = np.nonzero(~np.isnan(humans[..., X]))
    return rows, np.array(ids, dtype=np.int64)[column], humans[rows, column, POSITION]


def lost_robot(record: EpisodeRecord, options: Options) -> str | None:
    """That the robot is not in exported tracks; None for episodes without a recorded robot."""
    if "robot" in record.scene().unmeasured:
        return None
    return "the files hold the positions of pedestrians only, not the robot; npz and parquet hold everything"


FORMAT = Format(
    "recorded tracks of people, in any known layout",
    SUFFIXES[0],
    import_,
    options=TRACK_OPTIONS,
    other_suffixes=SUFFIXES[1:],
)
