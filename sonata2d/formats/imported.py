"""Episode documents from foreign recordings: missing velocities, headings and rooms are estimated."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..core.entities import Goal, Human, Robot
from ..core.geometry import PRECISION, Barriers, Pose
from ..core.portable_math import Array, IntArray
from ..core.relations import ACTIVITIES
from ..core.scene import Rules
from ..core.vectors import wrap_angles
from ..record.canonical import rounded, rounded_rows
from ..record.files import sha256_of
from ..record.layout import HUMAN_ANGLES, ROBOT_ANGLES, JsonDict, columns, software_versions
from ..version import FORMAT, FORMAT_VERSION

# Columns of recorded states: x, y, theta, vx, vy, omega, and for pedestrians head.
X, Y, THETA, VX, VY = range(5)
POSITION, POSE, VELOCITY = slice(0, 2), slice(0, 3), slice(3, 5)

WALKING_SPEED = 0.1  # m/s; a slower pedestrian stands
_CORNER_TOLERANCE = 0.05  # m; ends of walls nearer than this are one corner


def velocities(time: Array, poses: Array) -> Array:
    """Return velocities as backward differences of poses, as a simulator's velocities are those of the last step.

    The first frame of an entity has no predecessor and takes the velocity of the next frame.

    Args:
        time: (T,), s, rising.
        poses: (T, ..., 3), columns x, y, theta; NaN where absent.

    Returns:
        (T, ..., 3), m/s, m/s, rad/s; 0 where unknown, NaN where absent.
    """
    rates = np.zeros(poses.shape)
    if len(poses) > 1:
        step = np.diff(time).reshape(-1, *([1] * (poses.ndim - 1)))
        change = np.diff(poses, axis=0)
        change[..., THETA] = wrap_angles(change[..., THETA])
        rates[1:] = change / step
        unknown = np.isnan(rates) & ~np.isnan(poses)  # present now, but not in the frame before
        unknown[0] = True
        following = np.concatenate((rates[1:], np.zeros((1, *poses.shape[1:]))))
        rates = np.where(unknown, np.nan_to_num(following), rates)
    return np.where(np.isnan(poses), np.nan, rates)


def headings_along(velocity: Array) -> Array:
    """Return headings along the velocities; a pedestrian who stands keeps the last heading.

    Args:
        velocity: (T, N, 2), m/s; NaN where absent.

    Returns:
        (T, N), rad; NaN where absent; 0 for pedestrians who never move.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    theta = np.arctan2(velocity[..., 1], velocity[..., 0])
    moving = speed > WALKING_SPEED
    frames = np.arange(len(velocity))[:, None]
    last = np.maximum.accumulate(np.where(moving, frames, -1), axis=0)
    first = np.where(moving.any(axis=0), moving.argmax(axis=0), 0)
    source = np.where(last < 0, first[None], last)  # before the first motion, its heading is used
    heading = np.take_along_axis(np.where(moving, theta, 0.0), source, axis=0)
    return np.where(np.isnan(speed), np.nan, heading)


def activity_of(velocity: Array) -> IntArray:
    """Derive activities, walking or standing, from speeds.

    Args:
        velocity: (T, N, 2), m/s; NaN where absent.

    Returns:
        (T, N), indices into `relations.ACTIVITIES`; -1 where absent.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    activity = np.where(speed > WALKING_SPEED, ACTIVITIES.index("walking"), ACTIVITIES.index("standing"))
    return np.where(np.isnan(speed), -1, activity)


def polygon_of(walls: Array) -> Array | None:
    """Find the room that walls enclose.

    Args:
        walls: (W, 4), x1, y1, x2, y2, m, in any order and direction.

    Returns:
        (K, 2), corners, counter-clockwise; None if the first wall is not part of a closed line.
    """
    distinct = list(dict.fromkeys(map(tuple, walls.tolist())))
    if len(distinct) < 3:
        return None
    # walls by the cell of an end; ends at one corner lie in one cell, or in adjacent ones
    cells: dict[tuple[int, int], dict[int, None]] = {}
    for index, wall in enumerate(distinct[1:], 1):
        for point in (wall[:2], wall[2:]):
            cells.setdefault(_cell(point), {})[index] = None
    corners, end = [distinct[0][:2]], distinct[0][2:]
    # Append the wall that continues at the open end until the line returns to the first corner.
    while len(corners) < len(distinct) and math.dist(end, corners[0]) > _CORNER_TOLERANCE:
        column, row = _cell(end)
        near = {k for dx in (-1, 0, 1) for dy in (-1, 0, 1) for k in cells.get((column + dx, row + dy), ())}
        gaps = [(min(math.dist(end, distinct[k][:2]), math.dist(end, distinct[k][2:])), k) for k in near]
        gap, index = min(gaps, default=(math.inf, 0))
        if gap > _CORNER_TOLERANCE:
            return None
        wall = distinct[index]
        for point in (wall[:2], wall[2:]):
            cells[_cell(point)].pop(index, None)
        corners.append(end)
        end = wall[2:] if math.dist(end, wall[:2]) <= _CORNER_TOLERANCE else wall[:2]
    ring = np.array(corners)
    if len(ring) < 3 or math.dist(end, corners[0]) > _CORNER_TOLERANCE:
        return None
    x, y = ring.T
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    return ring if area > 0 else ring[::-1]


def _cell(point: tuple[float, ...]) -> tuple[int, int]:
    """The cell of a grid in which a point lies; cells are as large as the tolerance."""
    return math.floor(point[0] / _CORNER_TOLERANCE), math.floor(point[1] / _CORNER_TOLERANCE)


def bounding_box(points: Array, margin: float) -> Array:
    """Return the corners of the axis-aligned box around points, widened by a margin.

    Args:
        points: (M, 2), m.
        margin: m.

    Returns:
        (4, 2), counter-clockwise, m.
    """
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


NO_PHYSICS = 0  # version of the physics in imported episodes: no simulator produced them
_OVERLAP, _SMALLEST_RADIUS = 0.02, 0.05  # m
PERSON, ROBOT = Human(1, Pose(0.0, 0.0)), Robot(Pose(0.0, 0.0))  # default values of what a source does not record
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
        missing: keys that hold defaults as this source lacks them, besides those that all sources lack.
        derived: keys that were computed from the source, besides those of all sources.
        header: keys of the episode file that replace the defaults.
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


def episode_document(source: SourceEpisode, format: str, path: Path) -> JsonDict:
    """Make an episode document from a foreign recording.

    Args:
        source: contents of the recording.
        format: name of its format.
        path: its file, for the name of the episode and the hash of its origin.

    Returns:
        The document; its key `imported` lists which values are missing and which are derived.
    """
    dt = _tick_length(source.time)
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
    twists = zip(states, command.tolist(), _executed(source, dt).tolist(), strict=False)
    frames = [_frame(state, *pair) for state, *pair in twists][: len(states) - 1]
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
        "room": {"polygon": rounded(np.asarray(source.polygon, dtype=float)).tolist()},
        "walls": rounded(np.asarray(source.walls, dtype=float)).tolist(),
        "objects": source.objects,
        "humans": _humans(source),
        "groups": [],
        "interactions": source.interactions[0],
        "robot": _robot(source, dt),
        "goal": source.goal,
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
        desired_speed = _round_up(max(PERSON.desired_speed, (float(speeds.max()) - 1.0) / 1.3))
        leaves = int(present[-1]) + 1
        human = Human(
            id,
            PERSON.pose,
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


def _frame(state: JsonDict, command: list[float], executed: list[float]) -> JsonDict:
    return state | {"command": command, "executed": executed, "guarded": False, "events": []}


def goal_of(position: list[float], theta: float = 0.0, **tolerances: float) -> JsonDict:
    """Return a goal with the keys of the episode file, rounded as in files.

    Args:
        position: x, y, m.
        theta: rad.
        tolerances: `distance` (m) and `angle` (rad) of `Goal`; defaults where they are not given.
    """
    pose = Pose(position[0], position[1], theta).rounded()
    return asdict(Goal(pose.x, pose.y, pose.theta, **tolerances))


def fitting_radii(positions: Array, walls: Array) -> list[float]:
    """Choose radii for pedestrians without recorded radii.

    The default radius is reduced where a pedestrian comes nearer to another one or to a wall, so that no check reports
    overlapping outlines when the outlines are unknown.

    Args:
        positions: (T, N, 2 or more), columns x, y, ...; NaN where absent.
        walls: (W, 4), x1, y1, x2, y2, m.

    Returns:
        (N,), m.
    """
    barriers = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in np.asarray(walls).tolist()])
    clearance = np.full(positions.shape[1], np.inf)
    for frame in positions[..., POSITION]:
        present = np.flatnonzero(~np.isnan(frame[:, X]))
        points = frame[present]
        distance = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        np.fill_diagonal(distance, np.inf)
        free = distance.min(axis=1, initial=np.inf) / 2
        if len(barriers) and len(points):
            free = np.minimum(free, barriers.gaps(points).min(axis=0))
        clearance[present] = np.minimum(clearance[present], free)
    radii = np.clip(clearance + _OVERLAP, _SMALLEST_RADIUS, PERSON.radius)
    return [float(radius) for radius in rounded(radii)]
