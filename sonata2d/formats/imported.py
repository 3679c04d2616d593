"""Episode documents from foreign recordings: missing velocities, headings and rooms are estimated."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..core.entities import Goal, Human, Robot
from ..core.geometry import PRECISION, Barriers, Pose
from ..core.humans import ACTIVITIES
from ..core.portable_math import Array
from ..core.scene import Rules
from ..core.vectors import wrap_angles
from ..record.canonical import rounded, rounded_rows
from ..record.layout import HUMAN_ANGLES, ROBOT_ANGLES, Tree, columns, software
from ..version import FORMAT, FORMAT_VERSION

MOVES = 0.1  # m/s; whoever is slower stands
_MEETS = 0.05  # m, ends of walls that are one corner


def velocities(time: Array, poses: Array) -> Array:
    """Backward differences, as a simulator's velocities are those of the last step; the first row looks ahead.

    Args:
        time: (T,), s, rising.
        poses: (T, …, 3), columns x, y, theta; NaN where not present.

    Returns:
        (T, …, 3), m/s, m/s, rad/s; 0 where nothing tells, NaN where not present.
    """
    rates = np.zeros(poses.shape)
    if len(poses) > 1:
        step = np.diff(time).reshape(-1, *([1] * (poses.ndim - 1)))
        change = np.diff(poses, axis=0)
        change[..., 2] = wrap_angles(change[..., 2])
        rates[1:] = change / step
        unknown = np.isnan(rates) & ~np.isnan(poses)  # they have just come, or are looked at first
        unknown[0] = True
        ahead = np.concatenate((rates[1:], np.zeros((1, *poses.shape[1:]))))
        rates = np.where(unknown, np.nan_to_num(ahead), rates)
    return np.where(np.isnan(poses), np.nan, rates)


def headings_along(velocity: Array) -> Array:
    """Where people face if they look where they go; whoever stands faces as before.

    Args:
        velocity: (T, N, 2), m/s; NaN where not present.

    Returns:
        (T, N), rad; NaN where not present; 0 for those who never move.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    theta = np.arctan2(velocity[..., 1], velocity[..., 0])
    known = speed > MOVES
    rows = np.arange(len(velocity))[:, None]
    last = np.maximum.accumulate(np.where(known, rows, -1), axis=0)
    first = np.where(known.any(axis=0), known.argmax(axis=0), 0)
    source = np.where(last < 0, first[None], last)
    faced = np.take_along_axis(np.where(known, theta, 0.0), source, axis=0)
    return np.where(np.isnan(speed), np.nan, faced)


def activity_of(velocity: Array) -> Any:
    """(T, N) of int into `humans.ACTIVITIES`, by speed alone; -1 where not present."""
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    moves = np.where(speed > MOVES, ACTIVITIES.index("walking"), ACTIVITIES.index("standing"))
    return np.where(np.isnan(speed), -1, moves)


def polygon_of(walls: Array) -> Array | None:
    """The room that walls close off, (K, 2), counter-clockwise; None if the first wall is no part of a closed line.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m, in any order and direction.
    """
    if len(walls) < 3:
        return None
    left = list(walls[1:])
    corners, end = [walls[0, 0:2]], walls[0, 2:4]
    while left and np.hypot(*(end - corners[0])) > _MEETS:
        gaps = [min(np.hypot(*(end - wall[k : k + 2])) for k in (0, 2)) for wall in left]
        nearest = int(np.argmin(gaps))
        if gaps[nearest] > _MEETS:
            return None
        wall = left.pop(nearest)
        corners.append(end)
        end = wall[2:4] if np.hypot(*(end - wall[0:2])) <= _MEETS else wall[0:2]
    ring = np.array(corners)
    if len(ring) < 3 or np.hypot(*(end - ring[0])) > _MEETS:
        return None
    x, y = ring.T
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    return ring if area > 0 else ring[::-1]


def box_round(points: Array, margin: float) -> Array:
    """The upright oblong round points, (4, 2), counter-clockwise; (M, 2), m."""
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


NO_PHYSICS = 0  # a version that never was
_OVERLAP, _SLIGHTEST = 0.02, 0.05  # m
PERSON, ROBOT = Human(1, Pose(0.0, 0.0)), Robot(Pose(0.0, 0.0))  # stand-ins
_LACKS = (
    "seed", "episode", "physics", "settings", "rules.substeps", "rules.iterations", "rules.time_limit", "rules.ends_on",
    "rules.guard", "rules.contact_distance", "rules.side", "robot.limits", "robot.kinematics", "humans.desired_speed",
    "humans.model", "humans.reacts_to_robot", "humans.reaction", "humans.robot_clearance", "controller", "contributor",
    "outcome", "frames.guarded", "frames.contacts", "frames.events",
)  # fmt: skip
_DERIVED = ("frames.executed", "humans.behaviour", "humans.enters", "humans.leaves")


@dataclass(frozen=True, eq=False)
class Found:
    """What a source tells, T looks at N people; SI, world frame.

    Attributes:
        time: (T,), s, from 0.
        robot: (T, 6), columns x, y, theta, vx, vy, omega.
        humans: (T, N, 7), the same and head; NaN where not present.
        ids, radii: (N,), of the people.
        activity: (T, N) of int, -1 where not present.
        interactions: of each look, [src, relation, dst].
        polygon: of the room, counter-clockwise.
        walls: (W, 4).
        objects: as the episode file has them.
        goal: its keys.
        command: (T, 3) or (T - 1, 3), body frame; None: the source has none.
        share: instead of `command`, shares of the robot's limits, -1..1.
        lacks, derived: besides what no source has.
        header: keys that replace stand-ins.
    """

    time: Array
    robot: Array
    humans: Array
    ids: list[int]
    radii: list[float]
    activity: Any
    interactions: list[list[list[Any]]]
    polygon: Any
    walls: Any
    objects: list[Tree]
    goal: Tree
    robot_radius: float
    command: Array | None = None
    share: Array | None = None
    lacks: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    header: Tree = field(default_factory=dict)


def document_of(found: Found, format: str, path: Path) -> Tree:
    """The document of an episode.

    Args:
        found: what the source tells.
        format: of the source.
        path: of the source.
    """
    dt = _tick(found.time)
    head = _head(found, format, path, dt)
    command, lacks = _commands(found, dt, head["robot"]["limits"])
    told = {
        "format": format,
        "file": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "lacks": sorted({*_LACKS, *found.lacks, *lacks} - set(found.header)),
        "derived": sorted({*_DERIVED, *found.derived}),
    }
    looks = _looks(found)
    acts = zip(looks, command.tolist(), _executed(found, dt).tolist(), strict=False)
    frames = [_frame(look, *act) for look, *act in acts][: len(looks) - 1]
    final = looks[-1] | ({"command": command[-1].tolist()} if len(command) == len(looks) else {})
    return {**head, **found.header, "imported": told, "frames": frames, "final": final, "software": software()}


def _tick(time: Array) -> float:
    """The usual step between stamps, s; a whole number of 0.1 ms."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.1
    return max(round(step / PRECISION), 1) / round(1 / PRECISION)


def _commands(found: Found, dt: float, limits: Tree) -> tuple[Array, tuple[str, ...]]:
    """What was asked of the robot; where the source does not tell it, what was carried out stands in."""
    if found.share is not None:
        return rounded(found.share * np.array([limits["ahead"], limits["sideways"], limits["turn"]])), ()
    if found.command is not None:
        return rounded(found.command), ()
    return _executed(found, dt), ("frames.command",)


def _executed(found: Found, dt: float) -> Array:
    """Body-frame twists that explain the change of pose from look to look; (T - 1, 3)."""
    step = np.maximum(np.diff(found.time), PRECISION) if len(found.time) > 1 else np.full(0, dt)
    moved, theta = np.diff(found.robot[:, 0:2], axis=0) / step[:, None], found.robot[:-1, 2]
    turn = wrap_angles(np.diff(found.robot[:, 2])) / step
    c, s = np.cos(theta), np.sin(theta)
    return rounded(np.stack((moved[:, 0] * c + moved[:, 1] * s, moved[:, 1] * c - moved[:, 0] * s, turn), axis=1))


def _head(found: Found, format: str, path: Path, dt: float) -> Tree:
    name, duration = path.name.split(".")[0], float(found.time[-1])
    rules = Rules(dt=dt, time_limit=max(duration, dt), ends_on=(), guard=False)
    return {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "id": name,
        "name": f"imported-{format}",
        "family": f"imported/{format}",
        "seed": 0,
        "episode": 0,
        "physics": NO_PHYSICS,
        "precision": PRECISION,
        "settings": None,
        "rules": asdict(rules) | {"ends_on": []},
        "room": {"polygon": rounded(np.asarray(found.polygon, dtype=float)).tolist()},
        "walls": rounded(np.asarray(found.walls, dtype=float)).tolist(),
        "objects": found.objects,
        "humans": _humans(found),
        "groups": [],
        "interactions": found.interactions[0],
        "robot": _robot(found, dt),
        "goal": found.goal,
        "dropped": [],
        "controller": {"path": f"imported:{format}", "version": None, "settings": None},
        "labels": None,
        "contributor": None,
        "context": None,
        "branched_from": None,
        "columns": columns(),
        "activities": list(ACTIVITIES),
        "outcome": {
            "status": "stopped",
            "reason": "imported; the source does not say how it ended",
            "tick": len(found.time) - 1,
            "time": float(rounded(found.time[-1:])[0]),
        },
    }


def _humans(found: Found) -> list[Tree]:
    """The people as they are first seen."""
    people = []
    rows = rounded_rows(np.nan_to_num(found.humans), HUMAN_ANGLES)
    for k, (id, radius) in enumerate(zip(found.ids, found.radii, strict=True)):
        there = np.flatnonzero(~np.isnan(found.humans[:, k, 0]))
        first, speeds = rows[there[0], k], np.hypot(rows[there, k, 3], rows[there, k, 4])
        walks = bool(speeds.max() > 0.1)
        fastest = _upward(max(PERSON.desired_speed, (float(speeds.max()) - 1.0) / 1.3))
        gone = int(there[-1]) + 1
        person = Human(
            id,
            PERSON.pose,
            radius,
            fastest,
            "wandering" if walks else "standing",
            "imported",
            enters=int(there[0]),
            leaves=gone if gone < len(found.humans) else None,
        )
        flat = {key: value for key, value in asdict(person).items() if key != "pose"}
        people.append({"id": id, "x": first[0].item(), "y": first[1].item(), "theta": first[2].item()} | flat)
    return people


def _robot(found: Found, dt: float) -> Tree:
    """Its start, and limits that no recorded motion is beyond."""
    x, y, theta = rounded_rows(found.robot, ROBOT_ANGLES)[0, :3].tolist()
    most = np.abs(_executed(found, dt)).max(axis=0, initial=0.0)
    usual = ROBOT.limits
    ahead, sideways, turn = (
        _upward(max(float(seen), default))
        for seen, default in zip(most, (usual.ahead, usual.sideways, usual.turn), strict=True)
    )
    limits = asdict(usual) | {"ahead": ahead, "sideways": sideways, "turn": turn}
    kind = ROBOT.kinematics
    return {"x": x, "y": y, "theta": theta, "radius": found.robot_radius, "kinematics": kind, "limits": limits}


def _upward(value: float) -> float:
    """The next multiple of 0.1."""
    return math.ceil(value * 10 - 1e-9) / 10


def _looks(found: Found) -> list[Tree]:
    """What is seen at each look."""
    there = ~np.isnan(found.humans[..., 0])
    robot = rounded_rows(found.robot, ROBOT_ANGLES).tolist()
    humans = rounded_rows(np.nan_to_num(found.humans), HUMAN_ANGLES).tolist()
    rows = [
        [row if here else None for row, here in zip(people, seen, strict=True)]
        for people, seen in zip(humans, there.tolist(), strict=True)
    ]
    times, activity = rounded(found.time).tolist(), np.asarray(found.activity).tolist()
    return [
        {
            "tick": t,
            "time": times[t],
            "robot": robot[t],
            "humans": rows[t],
            "activity": activity[t],
            "interactions": found.interactions[t],
            "contacts": [],
        }
        for t in range(len(times))
    ]


def _frame(look: Tree, command: list[float], executed: list[float]) -> Tree:
    return look | {"command": command, "executed": executed, "guarded": False, "events": []}


def goal_of(place: list[float], theta: float = 0.0, **told: float) -> Tree:
    """A goal's keys, rounded as files hold them; what is not told is the usual."""
    pose = Pose(place[0], place[1], theta).rounded()
    return asdict(Goal(pose.x, pose.y, pose.theta, **told))


def radii_that_fit(rows: Array, walls: Any) -> list[float]:
    """Stand-ins for radii that nobody tells: the usual one, less where people come nearer to others or to walls.

    So that no check speaks of outlines that overlap, when nothing is known of outlines.

    Args:
        rows: (T, N, 2 or more), columns x, y, …; NaN where not present.
        walls: (W, 4), m.

    Returns:
        (N,), m.
    """
    barriers = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in np.asarray(walls).tolist()])
    room = np.full(rows.shape[1], np.inf)
    for look in rows[..., 0:2]:
        there = np.flatnonzero(~np.isnan(look[:, 0]))
        place = look[there]
        apart = np.hypot(*(place[:, None] - place[None]).transpose(2, 0, 1))
        np.fill_diagonal(apart, np.inf)
        free = apart.min(axis=1, initial=np.inf) / 2
        if len(barriers) and len(place):
            free = np.minimum(free, barriers.gaps(place).min(axis=0))
        room[there] = np.minimum(room[there], free)
    fitting = np.clip(room + _OVERLAP, _SLIGHTEST, PERSON.radius)
    return [float(radius) for radius in rounded(fitting)]
