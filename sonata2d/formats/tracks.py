"""Pedestrian tracks, the content of `csv` and `trajnet` files: which pedestrian was where at which frame number.

An imported track file becomes an episode of recorded pedestrians who come and go; velocities and headings follow from
the tracks. An episode also needs a robot and a goal: placeholders stand in a corner of the room, and `imported.lacks`
lists them, so that they are not mistaken for data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..core.files.limits import MAX_CELLS, MAX_CELLS_PER_OBSERVATION, MAX_CELLS_WITHOUT_RATIO
from ..core.geometry import PRECISION
from ..core.portable_math import Array, IntArray
from ..core.vectors import wrap_angles
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord
from . import estimates
from .estimates import POSITION, THETA, X
from .format import Options
from .imported import ROBOT, SourceEpisode, episode_document, goal_of

_MARGIN = 1.5  # m, of the room around the tracks; the robot stands in this margin
_MISSING = (
    "robot", "goal", "frames.robot", "frames.command", "humans.radius", "humans.head", "frames.interactions",
    "interactions", "objects", "room",
)  # fmt: skip
_DERIVED = ("frames.humans.velocity", "frames.humans.theta", "frames.activity", "room.polygon")


@dataclass(frozen=True, eq=False)
class Tracks:
    """M observed positions of pedestrians.

    Attributes:
        frame: (M,), frame numbers.
        ped: (M,), ids of the pedestrians.
        position: (M, 2), m, world frame.
        frame_time: duration of one frame number, s.
        group: group number of each pedestrian id, 0 without a group; None if groups were not annotated.
    """

    frame: Array
    ped: IntArray
    position: Array
    frame_time: float
    group: dict[int, int] | None = None


def tracks_document(tracks: Tracks, format: str, path: Path, walls: Array, desired_speed: float | None) -> JsonDict:
    """Make an episode document of recorded pedestrians.

    Args:
        tracks: of the pedestrians.
        format: name of the source format.
        path: the source file.
        walls: (W, 4), x1, y1, x2, y2, m; W = 0 if no walls are known.
        desired_speed: of all pedestrians, m/s; None if unknown.

    Raises:
        ValueError: the tracks do not fit one episode: fewer than two frames, uneven steps, or a pedestrian in two
            places at once.
    """
    source = _source_episode(tracks, walls)
    if len(walls):
        source = replace(source, derived=(*source.derived, "walls"))
    document = episode_document(source, format, path)
    if desired_speed is not None:
        document["humans"] = [human | {"desired_speed": desired_speed} for human in document["humans"]]
        document["imported"]["lacks"].remove("humans.desired_speed")
    if tracks.group is None:
        document["imported"]["lacks"] = sorted([*document["imported"]["lacks"], "humans.group", "groups"])
        return document
    return document | _groups(document["humans"], tracks.group, source.ids)


def _source_episode(tracks: Tracks, walls: Array) -> SourceEpisode:
    ids, time, position = _resample(tracks)
    unturned = np.concatenate((position, np.zeros((*position.shape[:2], 1))), axis=-1)
    rates = estimates.velocities(time, unturned)[..., POSITION]
    theta = estimates.headings_along(rates)
    poses = np.concatenate((position, theta[..., None]), axis=-1)
    # Bounds the turn rates of the shortest time steps: |omega| <= pi / PRECISION.
    omega = wrap_angles(np.nan_to_num(estimates.velocities(time, poses)[..., THETA]) * PRECISION) / PRECISION
    rows = np.concatenate((poses, rates, np.where(np.isnan(theta), np.nan, omega)[..., None], theta[..., None]), -1)
    box = estimates.bounding_box(np.concatenate((tracks.position, walls.reshape(-1, 2))), _MARGIN)
    corner = box[0] + _MARGIN / 2
    robot = np.tile((*corner, 0.0, 0.0, 0.0, 0.0), (len(time), 1))
    return SourceEpisode(
        time=time,
        robot=robot,
        humans=rows,
        ids=ids,
        radii=estimates.fitting_radii(position, walls),
        activity=estimates.activity_of(rates),
        interactions=[[] for _ in time],
        polygon=box,
        walls=walls,
        objects=[],
        goal=goal_of(corner.tolist()),
        robot_radius=ROBOT.radius,
        command=np.zeros((len(time) - 1, 3)),
        missing=_MISSING if len(walls) else (*_MISSING, "walls"),
        derived=_DERIVED,
    )


def _resample(tracks: Tracks) -> tuple[list[int], Array, Array]:
    """Arrange positions on a regular grid of frames at the most frequent step between frame numbers.

    Returns:
        N ids from 1, (T,) times from 0, and (T, N, 2) positions, NaN where a pedestrian was not observed.
    """
    frames = np.unique(tracks.frame)
    if len(frames) < 2:
        raise ValueError("it must hold two frames or more")
    steps, counts = np.unique(np.diff(frames), return_counts=True)
    step = float(steps[np.argmax(counts)])
    index = (tracks.frame - frames[0]) / step
    rows = np.rint(index).astype(np.int64)
    if (np.abs(index - rows) > 1e-6).any():
        odd = float(tracks.frame[np.argmax(np.abs(index - rows))])
        raise ValueError(f"frame {odd:g} is not a multiple of the most frequent step, {step:g} frames")
    peds, column = np.unique(tracks.ped, return_inverse=True)
    count = int(rows.max()) + 1
    limit = min(max(MAX_CELLS_WITHOUT_RATIO, MAX_CELLS_PER_OBSERVATION * len(rows)), MAX_CELLS)
    if count * len(peds) > limit:
        raise ValueError(
            f"its {len(rows)} positions spread over {count} frames of {len(peds)} people; the limit is {limit} frames"
            " times people in one episode, so divide it by time"
        )
    if len(np.unique(rows * len(peds) + column)) != len(rows):
        raise ValueError("a pedestrian is in two places in one frame")
    position = np.full((count, len(peds), 2), np.nan)
    position[rows, column] = tracks.position
    lowest = min(1, int(peds[0]))  # id 0 is the robot's in an episode
    time = np.arange(count) * (step * tracks.frame_time)
    if not time[1] >= PRECISION:
        raise ValueError(f"a step of {time[1]:g} s between frames is too short; the minimum is {PRECISION:g} s")
    return [int(id) + 1 - lowest for id in peds], np.asarray(time, dtype=float), np.asarray(position)


def _groups(humans: list[JsonDict], group: dict[int, int], ids: list[int]) -> JsonDict:
    """The keys `humans` and `groups` of the document, with the groups of two or more pedestrians."""
    by_id = dict(zip(ids, (group.get(ped, 0) for ped in sorted(group)), strict=True))
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
