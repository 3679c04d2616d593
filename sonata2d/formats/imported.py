"""Episode documents of foreign recordings."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..core.entities import Goal, Human, Robot
from ..core.geometry import PRECISION, Pose
from ..core.portable_math import Array, IntArray
from ..core.relations import ACTIVITIES
from ..core.scene import Rules
from ..core.vectors import wrap_angles
from ..record.canonical import rounded, rounded_rows
from ..record.files import sha256_of
from ..record.layout import HUMAN_ANGLES, ROBOT_ANGLES, JsonDict, columns, software_versions
from ..version import FORMAT
from .estimates import POSE, POSITION, THETA, VX, VY, X, Y

_NO_PHYSICS = 0  # version of the physics in imported episodes: no simulator produced them
_PERSON, ROBOT = Human(1, Pose(0.0, 0.0)), Robot(Pose(0.0, 0.0))  # default values of what a source does not record
_MISSING = (
    "seed", "episode", "physics", "settings", "rules.substeps", "rules.iterations", "rules.time_limit", "rules.ends_on",
    "rules.guard", "rules.contact_distance", "rules.side", "robot.limits", "robot.kinematics", "humans.desired_speed",
    "humans.model", "humans.reacts_to_robot", "humans.reaction", "humans.robot_clearance", "controller", "contributor",
    "outcome", "frames.guarded", "frames.contacts", "frames.events",
)  # fmt: skip
_DERIVED = ("frames.executed", "humans.behaviour", "humans.enters", "humans.leaves")


@dataclass(frozen=True, eq=False)
class SourceEpisode:
    """Contents of a foreign recording: T frames of N pedestrians; SI units, world frame.

    Attributes:
        time: (T,), s, from 0.
        robot: (T, 6), columns x, y, theta, vx, vy, omega.
        humans: (T, N, 7), the same columns and head; NaN where absent.
        ids, radii: (N,), of the pedestrians; radii in m.
        activity: (T, N), indices into `relations.ACTIVITIES`; -1 where absent.
        interactions: [src, relation, dst] of each frame.
        polygon: (K, 2), corners of the room, counter-clockwise, m.
        walls: (W, 4), x1, y1, x2, y2, m.
        objects: furniture with the keys of the episode file.
        goal: goal with the keys of the episode file.
        robot_radius: m.
        command: (T, 3) or (T - 1, 3), twists in the body frame; None if the source has no commands.
        command_fraction: commands as fractions of the robot's limits, -1..1, instead of `command`.
        missing: keys that hold defaults as this source lacks them, besides the keys that all sources lack.
        derived: keys that were computed from the source, besides the keys that are computed for all sources.
        header: keys of the episode file that replace the defaults.
        interval: step between even times, s; None: the median step, as a multiple of 0.1 ms.
    """

    time: Array
    robot: Array
    humans: Array
    ids: list[int]
    radii: list[float]
    activity: IntArray
    interactions: list[list[list[Any]]]
    polygon: Array
    walls: Array
    objects: list[JsonDict]
    goal: JsonDict
    robot_radius: float
    command: Array | None = None
    command_fraction: Array | None = None
    missing: tuple[str, ...] = ()
    derived: tuple[str, ...] = ()
    header: JsonDict = field(default_factory=dict)
    interval: float | None = None


def episode_document(source: SourceEpisode, format: str, path: Path) -> JsonDict:
    """Make an episode document from a foreign recording.

    Args:
        source: contents of the recording.
        format: name of its format.
        path: its file, for the name of the episode and the hash of its origin.

    Returns:
        The document; its key `imported` lists which values are missing and which are derived.
    """
    dt = _tick_length(source.time) if source.interval is None else round(source.interval, 12)
    header = _header(source, format, path, dt)
    command, missing = _commands(source, dt, header["robot"]["limits"])
    origin = {
        "format": format,
        "file": path.name,
        "sha256": sha256_of(path),
        "lacks": sorted({*_MISSING, *source.missing, *missing} - set(source.header)),
        "derived": sorted({*_DERIVED, *source.derived}),
    }
    states = _states(source)
    twists = zip(states[:-1], command.tolist(), _executed(source, dt).tolist(), strict=False)
    frames = [
        state | {"command": command, "executed": executed, "guarded": False, "events": []}
        for state, command, executed in twists
    ]
    final = states[-1] | ({"command": command[-1].tolist()} if len(command) == len(states) else {})
    return {
        **header,
        **source.header,
        "imported": origin,
        "frames": frames,
        "final": final,
        "software": software_versions(),
    }


def _tick_length(time: Array) -> float:
    """The median step between time stamps, s, as a multiple of 0.1 ms."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.1
    return max(round(step / PRECISION), 1) / round(1 / PRECISION)


def _commands(source: SourceEpisode, dt: float, limits: JsonDict) -> tuple[Array, tuple[str, ...]]:
    """The commands, and the keys that are missing: executed twists stand in for commands that were not recorded."""
    if source.command_fraction is not None:
        scale = np.array([limits["ahead"], limits["sideways"], limits["turn"]])
        return rounded(source.command_fraction * scale), ()
    if source.command is not None:
        return rounded(source.command), ()
    return _executed(source, dt), ("frames.command",)


def _executed(source: SourceEpisode, dt: float) -> Array:
    """Body-frame twists, (T - 1, 3), that explain the change of the robot's pose from frame to frame."""
    step = np.maximum(np.diff(source.time), PRECISION) if len(source.time) > 1 else np.full(0, dt)
    velocity, theta = np.diff(source.robot[:, POSITION], axis=0) / step[:, None], source.robot[:-1, THETA]
    omega = wrap_angles(np.diff(source.robot[:, THETA])) / step
    c, s = np.cos(theta), np.sin(theta)
    ahead = velocity[:, 0] * c + velocity[:, 1] * s
    left = velocity[:, 1] * c - velocity[:, 0] * s
    return rounded(np.stack((ahead, left, omega), axis=1))


def _header(source: SourceEpisode, format: str, path: Path, dt: float) -> JsonDict:
    """The keys of the document besides frames and origin, in the file's order."""
    name, duration = path.name.split(".")[0], float(source.time[-1])
    rules = Rules(dt=dt, time_limit=max(duration, dt), ends_on=(), guard=False)
    return {
        "format": FORMAT,
        "version": 1,
        "id": name,
        "name": f"imported-{format}",
        "family": f"imported/{format}",
        "seed": 0,
        "episode": 0,
        "physics": _NO_PHYSICS,
        "precision": PRECISION,
        "settings": None,
        "rules": asdict(rules) | {"ends_on": []},
        "room": {"polygon": rounded(np.asarray(source.polygon, dtype=float)).tolist()},
        "walls": rounded(np.asarray(source.walls, dtype=float)).tolist(),
        "objects": source.objects,
        "doors": [],
        "queues": [],
        "places": [],
        "humans": _humans(source),
        "groups": [],
        "interactions": source.interactions[0],
        "robot": _robot(source, dt),
        "goal": source.goal,
        "social": None,
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
            "tick": len(source.time) - 1,
            "time": float(rounded(source.time[-1:])[0]),
        },
    }


def _humans(source: SourceEpisode) -> list[JsonDict]:
    """The pedestrians at their first appearance, with desired speeds that no recorded motion exceeds by much."""
    humans = []
    rows = rounded_rows(np.nan_to_num(source.humans), HUMAN_ANGLES)
    for k, (id, radius) in enumerate(zip(source.ids, source.radii, strict=True)):
        present = np.flatnonzero(~np.isnan(source.humans[:, k, X]))
        first, speeds = rows[present[0], k], np.hypot(rows[present, k, VX], rows[present, k, VY])
        walks = bool(speeds.max() > 0.1)
        # `check` accepts up to 1.3 times the desired speed and 1 m/s more.
        desired_speed = _round_up(max(_PERSON.desired_speed, (float(speeds.max()) - 1.0) / 1.3))
        leaves = int(present[-1]) + 1
        human = Human(
            id,
            _PERSON.pose,
            radius,
            desired_speed,
            "wandering" if walks else "standing",
            "imported",
            enters=int(present[0]),
            leaves=leaves if leaves < len(source.humans) else None,
            breadth=2 * radius,  # a disc: other programs record no breadth
        )
        fields = {key: value for key, value in asdict(human).items() if key != "pose"}
        humans.append({"id": id, "x": first[X].item(), "y": first[Y].item(), "theta": first[THETA].item()} | fields)
    return humans


def _robot(source: SourceEpisode, dt: float) -> JsonDict:
    """The robot at its start, with limits that no recorded motion exceeds."""
    x, y, theta = rounded_rows(source.robot, ROBOT_ANGLES)[0, POSE].tolist()
    maximum = np.abs(_executed(source, dt)).max(axis=0, initial=0.0)
    default = ROBOT.limits
    ahead, sideways, turn = (
        _round_up(max(float(recorded), limit))
        for recorded, limit in zip(maximum, (default.ahead, default.sideways, default.turn), strict=True)
    )
    limits = asdict(default) | {"ahead": ahead, "sideways": sideways, "turn": turn}
    kinematics = ROBOT.kinematics
    return {
        "x": x, "y": y, "theta": theta, "radius": source.robot_radius, "kinematics": kinematics, "limits": limits
    }  # fmt: skip


def _round_up(value: float) -> float:
    """The next multiple of 0.1."""
    return math.ceil(value * 10 - 1e-9) / 10


def _states(source: SourceEpisode) -> list[JsonDict]:
    """Each frame without its command."""
    present = ~np.isnan(source.humans[..., X])
    robot = rounded_rows(source.robot, ROBOT_ANGLES).tolist()
    positions = iter(rounded_rows(source.humans[present], HUMAN_ANGLES).tolist())  # no lists for who is absent
    rows = [[next(positions) if is_present else None for is_present in mask] for mask in present.tolist()]
    times, activity = rounded(source.time).tolist(), np.asarray(source.activity).tolist()
    return [
        {
            "tick": t,
            "time": times[t],
            "robot": robot[t],
            "humans": rows[t],
            "activity": activity[t],
            "interactions": source.interactions[t],
            "contacts": [],
        }
        for t in range(len(times))
    ]


def goal_of(position: list[float], theta: float = 0.0, **tolerances: Any) -> JsonDict:
    """Return a goal with the keys of the episode file, rounded as in files.

    Args:
        position: x, y, m.
        theta: rad.
        tolerances: `distance` (m) and `angle` (rad) of `Goal`; defaults where they are not given.
    """
    pose = Pose(position[0], position[1], theta).rounded()
    goal = Goal(pose.x, pose.y, pose.theta, **tolerances)
    return {name: getattr(goal, name) for name in ("x", "y", "theta", "distance", "angle")}


def object_row(id: int, type: str, pose: list[float], shape: JsonDict) -> JsonDict:
    """Return a piece of furniture with the keys of the episode file, on no other one."""
    x, y, theta = pose
    return {"id": id, "type": type, "x": x, "y": y, "theta": theta, "shape": shape, "on": None, "seat": None}
