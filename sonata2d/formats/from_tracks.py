"""Scenarios from recorded tracks: the recorded pedestrians in their room, with a robot added."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, SupportsFloat

import numpy as np

from ..core.entities import Human
from ..core.files.limits import MAX_YAML_BYTES
from ..core.geometry import Barriers, Point, Pose, inside_polygon, quantised
from ..core.portable_math import Array
from ..errors import ConfigError, RecordError
from ..record.files import write_atomically
from ..record.layout import JsonDict
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.people import path_segments
from ..scenegen.scenario.sections import GoalConfig
from . import estimates
from .format import Options
from .tracks.habits import NONE, Habits, habits_of, stands_at_ends
from .tracks.judgement import TrackSummary
from .tracks.observations import Track
from .tracks.reading import read_tracks

_BODY_RADIUS = Human(1, Pose(0.0, 0.0)).shape.circumradius  # m: bodies are apart however they turn
_ALLOWED_OVERLAP = 0.03  # m, of outlines at the start; the physics separates them soon
_ITERATIONS = 200  # steps in which bodies are moved apart, at most
_WALKING_SPEED = 0.3  # m/s; slower steps are not used to estimate the desired speed
_STANDING_RADIUS = 0.5  # m; a pedestrian who never leaves this circle around the first position stands
_MINIMUM_WALKING_TIME = 2.0  # s; a shorter walk does not show the desired speed
_VELOCITY_WINDOW = 0.8  # s, over which the velocity at the start is averaged
_END = 1.0  # s, before the end of the window: people who stand then stay there
_ROUND_TRIP_DISTANCE = 2.0  # m; farther away than this and back to within half of it is a round trip
_DESIRED_SPEED_RANGE = (0.3, 2.5)  # m/s

SUFFIXES = (".yaml", ".yml", ".json")
_ROOM_MARGIN = 1.5  # m, between the room's edges and all tracks and walls: pedestrians enter and leave inside the room
_DISTANCE_TO_TRACKS = 1.0  # m, maximum of a drawn start or goal: it must not lie behind walls where no pedestrian walks
_LARGEST_DISTANCE = 10.0  # m, of a given start or goal from all tracks and walls: farther away suggests other units
_NO_DRAWN_PEOPLE: JsonDict = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
_ROOM_DIGITS = 3  # decimal digits of the room's corners, m


def scenario_from_tracks(
    path: str | Path,
    *,
    people: Literal["replayed", "simulated"] = "replayed",
    replay: Collection[int] = (),
    start: float = 0.0,
    seconds: float = 60.0,
    walls: str | Path | None = None,
    robot: tuple[float, float, float] | None = None,
    goal: Point | None = None,
    robot_as: int | None = None,
    frame_time: float | None = None,
    speed: float | None = None,
    frame_rate: float | None = None,
    columns: Sequence[str] | None = None,
    unit: str | SupportsFloat | None = None,
    homography: str | Path | None = None,
) -> ScenarioConfig:
    """Make the scenario of a recording: its pedestrians, its walls, a room around them, and a robot.

    Replayed pedestrians are moved along their tracks. Simulated pedestrians start with the recorded position, time and
    velocity, walk at their recorded mean speed towards the last recorded position, and leave there; they stop, and walk
    by via points, as often and as far as the people of the recording do. Where bodies would overlap at the start, they
    are moved apart by the few centimetres that this takes.

    Args:
        path: a track file in any layout that `import` reads.
        people: what happens with all pedestrians.
        replay: ids of the pedestrians who are replayed while the others are simulated; overrides `people`.
        start: beginning of the time window, s from the first frame; rounded to a frame.
        seconds: length of the time window and time limit of the episodes, s.
        walls: a file of x1, y1, x2, y2; by default NAME.obstacles.csv beside NAME.csv, else the walls in the file.
        robot: start pose x, y, theta, m and rad; by default that of the recorded robot, else drawn for each
            episode within 1 m of a track.
        goal: x, y of the robot's goal, m; by default where the recorded robot is last, or drawn like the start.
        robot_as: id of a person whose place the robot takes: it starts where the person is first in the time window,
            its goal is where the person is last, and the person is left out.
        frame_time: duration of one frame number, s, for files that do not give it.
        speed: desired speed of pedestrians whose tracks are too short to show it, m/s; by default drawn. NAME.json
            beside NAME.csv overrides the desired speed of all pedestrians.
        frame_rate: frame numbers per second, Hz, in place of `frame_time`.
        columns: names of the columns of a table in its order, `-` for one that is left out.
        unit: `m`, `cm`, `mm`, `ft`, or a number of metres.
        homography: a file with the 3 x 3 matrix from picture to ground, m, or with a scale.

    Returns:
        A scenario that `generate` accepts.

    Raises:
        RecordError: a file is damaged, does not show units, times or columns, or holds tracks that no people can walk.
        ConfigError: no pedestrian is present in the time window, an id of `replay` or `robot_as` is not, or the robot's
            start or goal is more than 10 m from all tracks and walls.
        SceneError: the robot would start on a pedestrian, or no path leads from its start to its goal.

    Warns:
        UserWarning: the tracks are doubtful: the frame rate, the unit or ids may be wrong.

    Example:
        >>> rows = [f"{k},{ped},{0.5 * k},{ped}" for k in range(20) for ped in (1, 2)]
        >>> _ = Path("street.csv").write_text("\\n".join(["frame,ped,x,y", *rows]))
        >>> config = scenario_from_tracks("street.csv", people="simulated", frame_time=0.4)
        >>> len(config.people)
        2
    """
    options = Options(
        frame_time=frame_time,
        frame_rate=frame_rate,
        columns=None if columns is None else tuple(columns),
        unit=unit,
        homography=None if homography is None else Path(homography),
        walls=None if walls is None else Path(walls),
    )
    config, summary = scenario_and_summary(
        Path(path),
        options,
        people=people,
        replay=replay,
        start=start,
        seconds=seconds,
        robot=robot,
        goal=goal,
        robot_as=robot_as,
        speed=speed,
    )
    for doubt in summary.doubts:
        warnings.warn(f"{path}: {doubt}", stacklevel=2)
    return config


def scenario_and_summary(
    path: Path,
    options: Options,
    *,
    people: Literal["replayed", "simulated"],
    replay: Collection[int],
    start: float,
    seconds: float,
    robot: tuple[float, float, float] | None,
    goal: Point | None,
    robot_as: int | None = None,
    speed: float | None,
) -> tuple[ScenarioConfig, TrackSummary]:
    """Make the scenario of a recording, and a summary of its tracks; see `scenario_from_tracks`."""
    tracks, summary = read_tracks(path, options)
    begin = round(start / tracks.interval) * tracks.interval
    parts = _in_window(tracks.people, begin, begin + seconds, path)
    _check_ids({*replay, *(() if robot_as is None else (robot_as,))}, [part.id for part, _ in parts], path)
    replaced = next((part for part, _ in parts if part.id == robot_as), None)
    parts = [(part, whole) for part, whole in parts if part is not replaced]
    # the ways of people who meet a robot tell how they avoid it
    is_estimated = tracks.robot is None and (replay or people == "simulated")
    habits = habits_of([part for part, _ in parts], tracks.walls) if is_estimated else NONE
    rows = [
        _replayed_person(part, whole, speed)
        if (part.id in replay if replay else people == "replayed")
        else _simulated_person(part, whole, seconds, speed, habits)
        for part, whole in parts
    ]
    if tracks.desired_speed is not None:
        common = {"desired_speed": tracks.desired_speed}
        rows = [row | common if row.keys() & {"goals", "track"} else row for row in rows]
    walls = tracks.walls
    rows = _separate_bodies([_without_single_group(row, rows) for row in rows], walls)
    recorded = replaced or (tracks.robot and _within(tracks.robot, begin, begin + seconds))
    if recorded:
        robot, goal = robot or _start_of(recorded), goal or _point(recorded.position[-1])
    mode = "mixed" if replay else people
    settings = {
        "name": f"{path.name.split('.')[0]}-{mode}",
        "description": f"people of {path.name}, {begin:g} to {begin + seconds:g} s, {mode}",
        "room": {"polygon": _room(rows, walls, robot, goal), "walls": walls.tolist()},
        "robot": ({} if robot is None else {"pose": robot})
        | ({} if robot and goal else {"on_ways": _DISTANCE_TO_TRACKS}),
        "goal": {"min_distance": _minimum_goal_distance(rows)} if goal is None else {"position": goal},
        "rules": {"time_limit": seconds},
        "people": rows,
    }
    if any("goals" in row for row in rows) and habits.settings:
        settings["social"] = habits.settings
    return _scenario(settings, path), summary


def _point(position: Array) -> Point:
    return quantised(float(position[0])), quantised(float(position[1]))


def _start_of(track: Track) -> tuple[float, float, float]:
    """Pose at the beginning of a track, x, y, theta, along its first motion."""
    away = np.flatnonzero(np.hypot(*(track.position - track.position[0]).T) > _STANDING_RADIUS / 5)
    dx, dy = track.position[away[0] if len(away) else -1] - track.position[0]
    return *_point(track.position[0]), quantised(math.atan2(float(dy), float(dx)))


def _within(track: Track, start: float, end: float) -> Track | None:
    """Return the part in a time window, with times from its start; None with fewer than two observations."""
    inside = (track.time >= start - 1e-9) & (track.time <= end + 1e-9)
    if np.count_nonzero(inside) < 2:
        return None
    return replace(track, time=np.maximum(track.time[inside] - start, 0.0), position=track.position[inside])


def _in_window(tracks: Sequence[Track], start: float, end: float, path: Path) -> list[tuple[Track, Track]]:
    """The pedestrians who are present in a time window: that part of each track, and the whole track."""
    parts = [(part, whole) for whole in tracks if (part := _within(whole, start, end)) is not None]
    if not parts:
        duration = max(float(whole.time[-1]) for whole in tracks)
        raise ConfigError(
            f"{path}: no pedestrian is present from {start:g} to {end:g} s; the recording lasts {duration:g} s"
        )
    return parts


def _check_ids(wanted: set[int], ids: list[int], path: Path) -> None:
    for id in sorted(wanted - set(ids)):
        shown = ", ".join(map(str, ids[:12])) + (", …" if len(ids) > 12 else "")
        raise ConfigError(f"{path}: no pedestrian in the time window has the id {id}; the ids are {shown}")


def _replayed_person(track: Track, whole: Track, default_speed: float | None) -> JsonDict:
    """Return the scenario row of a pedestrian who is moved along the recorded track.

    Args:
        track: the part in the time window.
        whole: the whole track, for the desired speed.
        default_speed: desired speed if the track is too short to show it, m/s; None: it is drawn.
    """
    rows = [
        [quantised(t), quantised(x), quantised(y)]
        for t, (x, y) in zip(track.time.tolist(), track.position.tolist(), strict=True)
    ]
    return {"id": track.id} | _group(track) | _desired_speed(whole, default_speed) | {"track": rows}


def _simulated_person(track: Track, whole: Track, end: float, default_speed: float | None, habits: Habits) -> JsonDict:
    """Return the scenario row of a pedestrian who starts as recorded and walks to the recorded destination.

    Args:
        track: the part in the time window.
        whole: the whole track, for destination and desired speed.
        end: end of the time window, s; a pedestrian who stands until then does not leave.
        default_speed: desired speed if the track is too short to show it, m/s; None: it is drawn.
        habits: of the people of the recording; a pedestrian who stands at first does so for a time like that of a stop.
    """
    enters = float(track.time[0])
    row: JsonDict = {"id": track.id} | dict(zip("xy", map(quantised, track.position[0].tolist()), strict=True))
    if enters > 0.0:
        row["enters"] = quantised(enters)
    distance = np.hypot(*(whole.position - whole.position[0]).T)
    if distance.max() < _STANDING_RADIUS:
        leaves = {"leaves": quantised(float(track.time[-1]))} if track.time[-1] < end - 1e-6 else {}
        return row | leaves
    goals = [whole.position[-1]]
    if distance.max() > _ROUND_TRIP_DISTANCE and distance[-1] < _ROUND_TRIP_DISTANCE / 2:
        goals.insert(0, whole.position[int(np.argmax(distance))])  # a round trip needs its turning point as a goal
    window = track.time <= track.time[0] + _VELOCITY_WINDOW + 1e-9
    window[1] = True  # at least one step, however long
    last = int(np.flatnonzero(window)[-1])
    velocity = (track.position[last] - track.position[0]) / (track.time[last] - track.time[0])
    row["velocity"] = [quantised(v) for v in velocity.tolist()]
    row["goals"] = [[quantised(v) for v in goal.tolist()] for goal in goals]
    stands_at_first, stands_at_last = stands_at_ends(track)
    if stands_at_first:
        shortest = habits.stop_time[0]
        row["pre_movement"] = [shortest, quantised(2.0 * habits.mean_stop - shortest)]
    # Who stands when the window ends has not left.
    if not (stands_at_last and track.time[-1] > end - _END):
        row["exits"] = True
    return row | _group(track) | _desired_speed(whole, default_speed)


def _group(track: Track) -> JsonDict:
    return {"group": track.group} if track.group > 0 else {}


def _desired_speed(whole: Track, default: float | None) -> JsonDict:
    """The mean speed while walking, where the pedestrian walks long enough to show it."""
    speed, duration = whole.speeds(), np.diff(whole.time)
    walking = speed > _WALKING_SPEED
    if duration[walking].sum() < _MINIMUM_WALKING_TIME:
        return {} if default is None else {"desired_speed": default}
    mean = float((speed * duration)[walking].sum() / duration[walking].sum())
    minimum, maximum = _DESIRED_SPEED_RANGE
    return {"desired_speed": quantised(min(max(mean, minimum), maximum))}


def _without_single_group(row: JsonDict, rows: list[JsonDict]) -> JsonDict:
    """The row, without its group if no other member of the group is present."""
    members = sum(other.get("group") == row.get("group") for other in rows)
    return row if members > 1 else {key: value for key, value in row.items() if key != "group"}


def _separate_bodies(rows: list[JsonDict], walls: Array) -> list[JsonDict]:
    """Move simulated pedestrians apart, and away from walls, just as far as their bodies need.

    Pedestrians who enter later wait until there is space, and are only moved away from walls.

    Args:
        rows: pedestrians as listed under `people` of a scenario.
        walls: (W, 4), x1, y1, x2, y2, m.

    Returns:
        The rows with adjusted start positions.
    """
    barriers = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in walls.tolist()])
    placed = [k for k, row in enumerate(rows) if "x" in row]
    from_start = np.array(["enters" not in rows[k] for k in placed], dtype=bool)
    positions = np.array([(rows[k]["x"], rows[k]["y"]) for k in placed], dtype=float).reshape(-1, 2)
    for _ in range(_ITERATIONS):
        push = _push_from_walls(positions, barriers)
        push[from_start] += _push_from_neighbours(positions[from_start])
        if np.abs(push).max(initial=0.0) < 1e-4:
            break
        positions += push
    moved = dict(zip(placed, positions.tolist(), strict=True))
    return [
        row | {"x": quantised(moved[k][0]), "y": quantised(moved[k][1])} if k in moved else row
        for k, row in enumerate(rows)
    ]


def _push_from_neighbours(positions: Array) -> Array:
    """(n, 2), m: half of the overlap of each pair, summed over the neighbours."""
    away = positions[:, None] - positions[None]
    distance = np.hypot(away[..., 0], away[..., 1])
    same = np.triu(distance < 1e-9, 1)
    away[same], away[same.T] = (0.0, 1.0), (0.0, -1.0)  # two on the same point are pushed to opposite sides
    overlap = np.maximum(2 * _BODY_RADIUS - _ALLOWED_OVERLAP - distance, 0.0)
    np.fill_diagonal(overlap, 0.0)
    direction = away / np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-9)[..., None]
    return np.asarray((direction * overlap[..., None] / 2).sum(axis=1))


def _push_from_walls(positions: Array, walls: Barriers) -> Array:
    """(n, 2), m: the overlap with the nearest wall."""
    if not len(walls) or not len(positions):
        return np.zeros_like(positions)
    x, y = walls.towards(positions)
    nearest = np.hypot(x, y).argmin(axis=0), np.arange(len(positions))
    towards = np.stack((x[nearest], y[nearest]), axis=1)
    distance = np.maximum(np.hypot(towards[:, 0], towards[:, 1]), 1e-9)
    overlap = np.maximum(_BODY_RADIUS - _ALLOWED_OVERLAP - distance, 0.0)
    return np.asarray(-towards / distance[:, None] * overlap[:, None])


def _scenario(settings: JsonDict, path: Path) -> ScenarioConfig:
    try:
        config = ScenarioConfig(**_NO_DRAWN_PEOPLE).changed(**settings)
    except ConfigError as error:
        raise ConfigError(f"{path} does not make a scenario: {error}") from None
    _check_robot_is_near(config, path)
    generate(config, seed=0)  # raises now if the scene cannot be laid out
    return config


def _check_robot_is_near(config: ScenarioConfig, path: Path) -> None:
    """Check that a given start and a given goal are near tracks or walls."""
    walls = Barriers.of(((x, y), (u, v), 0.0) for x, y, u, v in config.room.walls)
    segments = path_segments(config.people).joined(walls)
    for what, place in (("start", config.robot.pose), ("goal", config.goal.position)):
        if place is None:
            continue
        x, y, *_ = place
        gap = float(segments.gaps(np.array([(x, y)], dtype=float)).min())
        if gap > _LARGEST_DISTANCE:
            raise ConfigError(
                f"{path}: the robot's {what} ({x:g}, {y:g}) is {gap:.1f} m from all tracks and walls; "
                f"give one within {_LARGEST_DISTANCE:g} m"
            )


def _positions(rows: list[JsonDict]) -> list[list[float]]:
    """All positions x, y, m, on tracks, at goals and at starts."""
    positions = [point[-2:] for row in rows for point in (*row.get("track", ()), *row.get("goals", ()))]
    return positions + [[row["x"], row["y"]] for row in rows if "x" in row]


def _minimum_goal_distance(rows: list[JsonDict]) -> float:
    """Distance of a drawn goal from the start, m, that leads the robot through the pedestrians."""
    positions = np.array(_positions(rows))
    return max(round(float(np.ptp(positions, axis=0).max()) / 2, 1), GoalConfig().min_distance)


def _room(rows: list[JsonDict], walls: Array, robot: tuple[float, ...] | None, goal: Point | None) -> list[list[float]]:
    """Corners of the room, counter-clockwise: of walls that enclose all tracks, start and goal, else of a box around.

    The edges of the box, (4, 2), cut no track.
    """
    positions = np.array(_positions(rows) + [list(place[:2]) for place in (robot, goal) if place is not None])
    enclosing = estimates.polygon_of(walls)
    if enclosing is None or not inside_polygon(positions, enclosing).all():
        enclosing = estimates.bounding_box(np.concatenate((positions, walls.reshape(-1, 2))), _ROOM_MARGIN)
    return [[round(v, _ROOM_DIGITS) for v in corner] for corner in enclosing.tolist()]


def save_scenario(config: ScenarioConfig, path: str | Path) -> None:
    """Write a scenario to a file that `load_scenario` reads: no default values, one line per pedestrian.

    Args:
        config: the scenario.
        path: `.yaml`, `.yml` or `.json`.

    Raises:
        RecordError: the suffix is another one, the scenario is too large for YAML, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise RecordError(f"{path}: the name of a scenario file must end in {', '.join(SUFFIXES)}")
    settings = {"name": config.name} | config.model_dump(mode="json", exclude_defaults=True)
    is_json = path.suffix == ".json"
    text = ",\n".join(_json_lines(settings)) if is_json else "\n".join(_yaml_lines(settings))
    data = (f"{{\n{text}\n}}\n" if is_json else f"{text}\n").encode()
    if not is_json and len(data) > MAX_YAML_BYTES:
        raise RecordError(f"{path}: the scenario has {len(data)} bytes, too many for YAML; name it .json")
    write_atomically(path, data)


def _json_lines(settings: JsonDict) -> list[str]:
    people = ",\n".join(f"  {_json(row)}" for row in settings.get("people", ()))
    return [
        f'"{key}": {f"[{chr(10)}{people}{chr(10)}]" if key == "people" else _json(value)}'
        for key, value in settings.items()
    ]


def _yaml_lines(settings: JsonDict) -> list[str]:
    """The values as JSON, which is a subset of YAML."""
    lines = []
    for key, value in settings.items():
        lines += ["people:", *(f"- {_json(row)}" for row in value)] if key == "people" else [f"{key}: {_json(value)}"]
    return lines


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
