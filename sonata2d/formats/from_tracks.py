"""Scenarios from tracks: recorded people in their room, with the robot put in."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import ConfigError, RecordError
from ..exact import Array
from ..geometry import Barriers, Point
from ..record import write_atomically
from ..record.layout import Tree
from ..scenegen import ScenarioConfig, generate
from ..scenegen.people import ways_of
from ..scenegen.sections import GoalConfig
from . import csv_tracks, trajnet
from .form import Options, parsing
from .motion import box_round
from .starts import with_room
from .tracks import Tracks
from .walkers import Track, replayed, simulated, tracks_of

MARGIN = 1.5  # m, of the room round tracks and walls: people come in and leave this far from its edges
SUFFIXES = (".yaml", ".yml", ".json")
ON_WAYS = 1.0  # m, of a drawn start or goal from somebody's way: not behind walls where nobody goes
FAR = 10.0  # m, of a given start or goal from all tracks and walls: a slip, or other units
_NOBODY: Tree = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
_TIDY = 3  # digits, m, of the room's corners


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
    frame_time: float | None = None,
    speed: float | None = None,
) -> ScenarioConfig:
    """The scenario of a recording: its people, its walls, a room round them, and a robot.

    Who is replayed is carried along their track. Who is simulated starts where, when and as fast as recorded, wants to
    go at their recorded mean speed to where they were last seen, and leaves there. Where bodies would overlap at the
    start, they are moved apart by the centimetres that this takes.

    Args:
        path: a file of tracks: `csv` (frame, ped, x, y, with t and group or not) or TrajNet++ (`.ndjson`).
        people: what becomes of them all.
        replay: ids of those who are replayed among simulated ones.
        start: s from the first frame, from which on people are taken; the nearest frame.
        seconds: how long, s; also the time limit of episodes.
        walls: a file of x1, y1, x2, y2; unless given, NAME.obstacles.csv beside NAME.csv, if there is one.
        robot: its start x, y, theta; unless given, drawn for each episode, within 1 m of somebody's way.
        goal: x, y of its goal; unless given, drawn likewise.
        frame_time: s that a frame number stands for, in files that do not say it.
        speed: m/s, desired by those whose tracks are too short to show it; unless given, the file NAME.json beside it
            may tell that of everybody, else it is drawn.

    Raises:
        RecordError: a file is damaged, or people in it are lost, jump, or are two in one.
        ConfigError: nobody is there in that time, nobody has a number of `replay`, or the robot's start or goal is
            more than 10 m from all tracks and walls.
        SceneError: the robot would start on somebody, or there is no way from its start to its goal.
    """
    path = Path(path)
    everybody, step, crowded = _people(path, frame_time)
    begin = round(start / step) * step
    parts = _there(everybody, begin, begin + seconds, path)
    _refuse_unknown(set(replay), [part.id for part, _ in parts], path)
    rows = [
        replayed(part, whole, speed)
        if (part.id in replay if replay else people == "replayed")
        else simulated(part, whole, seconds, speed)
        for part, whole in parts
    ]
    if crowded is not None:
        rows = [row | {"desired_speed": crowded} if row.keys() & {"goals", "track"} else row for row in rows]
    edges = csv_tracks.read_walls(Path(walls)) if walls is not None else csv_tracks.walls_beside(path)
    rows = with_room([_alone(row, rows) for row in rows], edges)
    how = "mixed" if replay else people
    return _scenario(
        {
            "name": f"{path.name.split('.')[0]}-{how}",
            "description": f"people of {path.name}, {begin:g} to {begin + seconds:g} s, {how}",
            "room": {"polygon": _room(rows, edges, robot, goal), "walls": edges.tolist()},
            "robot": ({} if robot is None else {"pose": robot}) | ({} if robot and goal else {"on_ways": ON_WAYS}),
            "goal": {"min_distance": _far(rows)} if goal is None else {"position": goal},
            "rules": {"time_limit": seconds},
            "people": rows,
        },
        path,
    )


def _there(everybody: list[Track], start: float, end: float, path: Path) -> list[tuple[Track, Track]]:
    """Who is there between two moments: that part of their track, and the whole."""
    parts = [(part, whole) for whole in everybody if (part := whole.within(start, end)) is not None]
    if not parts:
        lasts = max(float(whole.time[-1]) for whole in everybody)
        raise ConfigError(f"{path}: nobody is there from {start:g} to {end:g} s; it lasts {lasts:g} s")
    return parts


def _refuse_unknown(replay: set[int], ids: list[int], path: Path) -> None:
    for id in sorted(replay - set(ids)):
        shown = ", ".join(map(str, ids[:12])) + (", …" if len(ids) > 12 else "")
        raise ConfigError(f"{path}: nobody there in that time has the number {id}; there are {shown}")


def _scenario(told: Tree, path: Path) -> ScenarioConfig:
    try:
        config = ScenarioConfig(**_NOBODY).changed(**told)
    except ConfigError as error:
        raise ConfigError(f"{path} makes no scenario: {error}") from None
    _refuse_far(config, path)
    generate(config, seed=0)  # what cannot be laid out is told now
    return config


def _refuse_far(config: ScenarioConfig, path: Path) -> None:
    """A given start and a given goal must be near tracks or walls."""
    walls = Barriers.of(((x, y), (u, v), 0.0) for x, y, u, v in config.room.walls)
    near = ways_of(config.people).joined(walls)
    for what, place in (("start", config.robot.pose), ("goal", config.goal.position)):
        if place is None:
            continue
        x, y, *_ = place
        gap = float(near.gaps(np.array([(x, y)], dtype=float)).min())
        if gap > FAR:
            raise ConfigError(
                f"{path}: the robot's {what} ({x:g}, {y:g}) is {gap:.1f} m from all tracks and walls; "
                f"give one within {FAR:g} m"
            )


def _people(path: Path, frame_time: float | None) -> tuple[list[Track], float, float | None]:
    """Everybody's track, the usual seconds between sightings, and the desired speed of all if the file knows it."""
    options = Options(frame_time=frame_time)
    is_trajnet = path.suffix == ".ndjson"
    tracks: Tracks = trajnet.read_tracks(path, options) if is_trajnet else csv_tracks.read_tracks(path, options)
    with parsing(path, trajnet.NAME if is_trajnet else csv_tracks.NAME):
        found, step = tracks_of(tracks)
    return found, step, None if is_trajnet else csv_tracks.desired_speed_beside(path)


def _places(rows: list[Tree]) -> list[list[float]]:
    """Where people are to be, x, y, m."""
    places = [place[-2:] for row in rows for place in (*row.get("track", ()), *row.get("goals", ()))]
    return places + [[row["x"], row["y"]] for row in rows if "x" in row]


def _far(rows: list[Tree]) -> float:
    """m, of a drawn goal from the robot's start: so far that its way leads through the people."""
    places = np.array(_places(rows))
    return max(round(float(np.ptp(places, axis=0).max()) / 2, 1), GoalConfig().min_distance)


def _room(rows: list[Tree], edges: Array, robot: tuple[float, ...] | None, goal: Point | None) -> list[list[float]]:
    """The upright oblong round everything, so wide that its edges cut no track; (4, 2)."""
    places = _places(rows) + [list(place[:2]) for place in (robot, goal) if place is not None]
    corners = np.concatenate((np.array(places, dtype=float), edges.reshape(-1, 2)))
    return [[round(v, _TIDY) for v in corner] for corner in box_round(corners, MARGIN).tolist()]


def _alone(row: Tree, rows: list[Tree]) -> Tree:
    """The row, without its group if nobody else of that is there."""
    together = sum(other.get("group") == row.get("group") for other in rows)
    return row if together > 1 else {key: value for key, value in row.items() if key != "group"}


def save_scenario(config: ScenarioConfig, path: str | Path) -> None:
    """Write a scenario to a file that `load_scenario` reads, without what is as usual; a line for each person.

    Args:
        config: the scenario.
        path: `.yaml`, `.yml` or `.json`.

    Raises:
        RecordError: the suffix is another one, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise RecordError(f"{path}: a scenario is written to a file that ends in {', '.join(SUFFIXES)}")
    told = {"name": config.name} | config.model_dump(mode="json", exclude_defaults=True)
    is_json = path.suffix == ".json"
    text = ",\n".join(_json_lines(told)) if is_json else "\n".join(_yaml_lines(told))
    write_atomically(path, (f"{{\n{text}\n}}\n" if is_json else f"{text}\n").encode())


def _json_lines(told: Tree) -> list[str]:
    """A line for each key, and for each person."""
    people = ",\n".join(f"  {_json(row)}" for row in told.get("people", ()))
    return [f'"{key}": {f"[{chr(10)}{people}{chr(10)}]" if key == "people" else _json(v)}' for key, v in told.items()]


def _yaml_lines(told: Tree) -> list[str]:
    """The same in YAML, of which JSON is a part."""
    lines = []
    for key, value in told.items():
        lines += ["people:", *(f"- {_json(row)}" for row in value)] if key == "people" else [f"{key}: {_json(value)}"]
    return lines


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
