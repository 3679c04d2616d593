"""Tracks of people, as `csv` and `trajnet` files hold them: who was where at which frame number.

Scenes of recorded people: the people come and go, velocities and headings follow from the tracks, and a robot and a
goal only stand in for those that an episode must have. They stand apart in a corner of the room, and `imported.lacks`
names them, so that nobody takes them for data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..core.geometry import PRECISION
from ..core.portable_math import Array
from ..core.vectors import wrap_angles
from ..record.layout import Tree
from .imported import (
    ROBOT,
    Found,
    activity_of,
    box_round,
    document_of,
    goal_of,
    headings_along,
    radii_that_fit,
    velocities,
)

_MARGIN = 1.5  # m, of the room round the tracks; the robot's corner is outside them
_MOST = 20_000_000  # rows of persons and frames in an episode
_LACKS = (
    "robot", "goal", "frames.robot", "frames.command", "humans.radius", "humans.head", "frames.interactions",
    "interactions", "objects", "room",
)  # fmt: skip
_DERIVED = ("frames.humans.velocity", "frames.humans.theta", "frames.activity", "room.polygon")


@dataclass(frozen=True, eq=False)
class Tracks:
    """M sightings.

    Attributes:
        frame: (M,), numbers of frames.
        ped: (M,) of int, who.
        place: (M, 2), m, world frame.
        frame_time: s that a frame number stands for.
        group: of each person, where it is known; 0 for nobody's.
    """

    frame: Any
    ped: Any
    place: Array
    frame_time: float
    group: dict[int, int] | None = None


def document_of_tracks(tracks: Tracks, format: str, path: Path, walls: Array, speed: float | None) -> Tree:
    """An episode of recorded people.

    Args:
        tracks: of the people.
        format: of the source.
        path: of the source.
        walls: (W, 4), m; none: no walls are known.
        speed: desired speed of the people, m/s, where it is known.
    """
    found = _found(tracks, walls)
    if len(walls):
        found = replace(found, derived=(*found.derived, "walls"))
    document = document_of(found, format, path)
    if speed is not None:
        document["humans"] = [human | {"desired_speed": speed} for human in document["humans"]]
        document["imported"]["lacks"].remove("humans.desired_speed")
    if tracks.group is None:
        document["imported"]["lacks"] = sorted([*document["imported"]["lacks"], "humans.group", "groups"])
        return document
    return document | _grouped(document["humans"], tracks.group, found.ids)


def _found(tracks: Tracks, walls: Array) -> Found:
    ids, time, place = _dense(tracks)
    rates = velocities(time, np.concatenate((place, np.zeros((*place.shape[:2], 1))), axis=-1))[..., 0:2]
    theta = headings_along(rates)
    poses = np.concatenate((place, theta[..., None]), axis=-1)
    omega = wrap_angles(np.nan_to_num(velocities(time, poses)[..., 2]) * PRECISION) / PRECISION
    rows = np.concatenate((poses, rates, np.where(np.isnan(theta), np.nan, omega)[..., None], theta[..., None]), -1)
    box = box_round(np.concatenate((tracks.place, walls.reshape(-1, 2))), _MARGIN)
    corner = box[0] + _MARGIN / 2
    robot = np.tile((*corner, 0.0, 0.0, 0.0, 0.0), (len(time), 1))
    return Found(
        time=time,
        robot=robot,
        humans=rows,
        ids=ids,
        radii=radii_that_fit(place, walls),
        activity=activity_of(rates),
        interactions=[[] for _ in time],
        polygon=box,
        walls=walls,
        objects=[],
        goal=goal_of(corner.tolist()),
        robot_radius=ROBOT.radius,
        command=np.zeros((len(time) - 1, 3)),
        lacks=_LACKS if len(walls) else (*_LACKS, "walls"),
        derived=_DERIVED,
    )


def _dense(tracks: Tracks) -> tuple[list[int], Array, Array]:
    """Ids from 1, times from 0, and (T, N, 2), NaN where nobody saw them.

    Frames are the numbers at the usual step, those in which nobody is seen too.
    """
    seen = np.unique(tracks.frame)
    if len(seen) < 2:
        raise ValueError("it must tell of two frames or more")
    steps, counts = np.unique(np.diff(seen), return_counts=True)
    step = float(steps[np.argmax(counts)])
    index = (tracks.frame - seen[0]) / step
    rows = np.rint(index).astype(np.int64)
    if (np.abs(index - rows) > 1e-6).any():
        odd = float(tracks.frame[np.argmax(np.abs(index - rows))])
        raise ValueError(f"frame {odd:g} is off the usual step of {step:g} frames")
    people, column = np.unique(tracks.ped, return_inverse=True)
    looks = int(rows.max()) + 1
    if looks * len(people) > _MOST:
        raise ValueError(f"{looks} frames of {len(people)} people are more than one episode holds; cut it in parts")
    if len(np.unique(rows * len(people) + column)) != len(rows):
        raise ValueError("somebody is in two places in one frame")
    place = np.full((looks, len(people), 2), np.nan)
    place[rows, column] = tracks.place
    lowest = min(1, int(people[0]))
    time = np.arange(looks) * (step * tracks.frame_time)
    if not time[1] >= PRECISION:
        raise ValueError(f"a step of {time[1]:g} s between frames is too short; at least {PRECISION:g} s")
    return [int(id) + 1 - lowest for id in people], np.asarray(time, dtype=float), np.asarray(place)


def _grouped(humans: list[Tree], group: dict[int, int], ids: list[int]) -> Tree:
    """Groups of two and more who walk together."""
    by_id = dict(zip(ids, (group.get(ped, 0) for ped in sorted(group)), strict=True))
    members: dict[int, list[int]] = {}
    for id, number in by_id.items():
        if number > 0:
            members.setdefault(number, []).append(id)
    known = {number: who for number, who in members.items() if len(who) > 1}
    return {
        "humans": [human | {"group": by_id[human["id"]] if by_id[human["id"]] in known else None} for human in humans],
        "groups": [{"id": number, "kind": "walking", "members": who} for number, who in sorted(known.items())],
    }


def sightings(document_looks: Any, ids: list[int]) -> tuple[Any, Any, Array]:
    """Row numbers, ids and places of whoever is present; (T, N, 7) to (M,), (M,), (M, 2), frame by frame."""
    rows, column = np.nonzero(~np.isnan(document_looks[..., 0]))
    return rows, np.array(ids, dtype=np.int64)[column], document_looks[rows, column, 0:2]
