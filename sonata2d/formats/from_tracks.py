"""Scenarios from recorded tracks: the recorded pedestrians in their room, with the robot added."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ..core.entities import Human
from ..core.geometry import Barriers, Point, Pose, quantised
from ..core.portable_math import Array
from ..errors import ConfigError, RecordError
from ..record.files import write_atomically
from ..record.layout import Tree
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.people import ways_of
from ..scenegen.scenario.sections import GoalConfig
from . import csv_tracks, trajnet
from .base import Options, parsing
from .imported import box_round
from .tracks import Tracks

BODY = Human(1, Pose(0.0, 0.0)).radius  # m
OVERLAP = 0.03  # m, by which outlines may overlap at the start; the physics soon has them apart
_ROUNDS = 200


def with_room(rows: list[Tree], edges: Array) -> list[Tree]:
    """People of a scenario, those who are simulated moved apart and away from walls just as far as bodies need.

    Who comes in later waits until there is room, and is moved away from walls only.

    Args:
        rows: as `people` of a scenario lists them.
        edges: (W, 4), walls, m.
    """
    walls = Barriers.of([((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in edges.tolist()])
    placed = [k for k, row in enumerate(rows) if "x" in row]
    at_once = np.array(["enters" not in rows[k] for k in placed], dtype=bool)
    places = np.array([(rows[k]["x"], rows[k]["y"]) for k in placed], dtype=float).reshape(-1, 2)
    for _ in range(_ROUNDS):
        push = _from_walls(places, walls)
        push[at_once] += _from_one_another(places[at_once])
        if np.abs(push).max(initial=0.0) < 1e-4:
            break
        places += push
    moved = dict(zip(placed, places.tolist(), strict=True))
    return [
        row | {"x": quantised(moved[k][0]), "y": quantised(moved[k][1])} if k in moved else row
        for k, row in enumerate(rows)
    ]


def _from_one_another(places: Array) -> Array:
    """(n, 2), m, half of what pairs are too near."""
    away = places[:, None] - places[None]
    apart = np.hypot(away[..., 0], away[..., 1])
    same = np.triu(apart < 1e-9, 1)
    away[same], away[same.T] = (0.0, 1.0), (0.0, -1.0)  # two on one spot go to either side
    lacks = np.maximum(2 * BODY - OVERLAP - apart, 0.0)
    np.fill_diagonal(lacks, 0.0)
    unit = away / np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-9)[..., None]
    return np.asarray((unit * lacks[..., None] / 2).sum(axis=1))


def _from_walls(places: Array, walls: Barriers) -> Array:
    """(n, 2), m, what they are too near to the nearest wall."""
    if not len(walls) or not len(places):
        return np.zeros_like(places)
    x, y = walls.towards(places)
    nearest = np.hypot(x, y).argmin(axis=0), np.arange(len(places))
    towards = np.stack((x[nearest], y[nearest]), axis=1)
    apart = np.maximum(np.hypot(towards[:, 0], towards[:, 1]), 1e-9)
    return np.asarray(-towards / apart[:, None] * np.maximum(BODY - OVERLAP - apart, 0.0)[:, None])


FASTEST = 8.0  # m/s, beyond which nobody runs: a jump in the file
WALKS = 0.3  # m/s; slower steps tell nothing of how fast somebody wants to go
STANDS = 0.5  # m, who never gets farther than this from where they came stands
SHORT = 2.0  # s of walking, from which a track shows how fast somebody wants to go
ONWARD = 0.8  # s, over which the velocity at the start is taken
ROUND = 2.0  # m, who comes back from farther off than this to nearer than half of it has gone a round
SLOWEST, QUICKEST = 0.3, 2.5  # m/s, of desired speeds


@dataclass(frozen=True, slots=True)
class Track:
    """One person's way: `time` (K,), s, rising, and `place` (K, 2), m; `group`: 0 for nobody's."""

    id: int
    time: Array
    place: Array
    group: int = 0

    def within(self, start: float, end: float) -> Track | None:
        """The part between two moments, as if the first were 0; None if there are not two sightings in it."""
        inside = (self.time >= start - 1e-9) & (self.time <= end + 1e-9)
        if np.count_nonzero(inside) < 2:
            return None
        return Track(self.id, np.maximum(self.time[inside] - start, 0.0), self.place[inside], self.group)


def tracks_of(tracks: Tracks) -> tuple[list[Track], float]:
    """Everybody's track, times from the first frame on, and the usual time between sightings, s.

    Ids are the file's, or one more if they begin at 0. Frames need be on no grid.

    Raises:
        ValueError: nobody is seen twice, or somebody is lost in between, in two places at once, or jumps.
    """
    order = np.lexsort((tracks.frame, tracks.ped))
    ped, place = tracks.ped[order], tracks.place[order]
    time = (tracks.frame[order] - tracks.frame.min()) * tracks.frame_time
    cuts = np.flatnonzero(np.diff(ped)) + 1
    steps = np.concatenate([np.diff(part) for part in np.split(time, cuts)])
    if not len(steps):
        raise ValueError("it must tell of somebody in two frames or more")
    usual = float(np.median(steps))
    shift, group = 1 - min(1, int(ped[0])), tracks.group or {}
    parts = zip(np.split(ped, cuts), np.split(time, cuts), np.split(place, cuts), strict=True)
    found = [Track(int(who[0]) + shift, when, where, group.get(int(who[0]), 0)) for who, when, where in parts]
    for track in found:
        _refuse_gaps(track, usual)
    return found, usual


def _refuse_gaps(track: Track, usual: float) -> None:
    steps = np.diff(track.time)
    if (steps < 1e-9).any():
        raise ValueError(f"person {track.id} is in two places at {track.time[int(np.argmin(steps))]:g} s")
    lost = np.flatnonzero(steps > 1.5 * usual)
    if len(lost):
        before, after = track.time[lost[0]], track.time[lost[0] + 1]
        raise ValueError(
            f"person {track.id} is lost from {before:g} to {after:g} s; fill the gap, or give whoever comes back"
            " a number of their own"
        )
    speed = speeds(track)
    if len(speed) and speed.max() > FASTEST:
        k = int(np.argmax(speed))
        raise ValueError(
            f"person {track.id} jumps at {speed[k]:.1f} m/s at {track.time[k]:g} s, faster than people run"
            f" ({FASTEST:g} m/s); mend the track, or check the units (m)"
        )


def speeds(track: Track) -> Array:
    """(K - 1,), m/s, from sighting to sighting."""
    way = np.diff(track.place, axis=0)
    return np.asarray(np.hypot(way[:, 0], way[:, 1]) / np.diff(track.time), dtype=float)


def replayed(track: Track, whole: Track, usual: float | None) -> Tree:
    """Somebody who is carried along their track."""
    rows = [
        [quantised(t), quantised(x), quantised(y)]
        for t, (x, y) in zip(track.time.tolist(), track.place.tolist(), strict=True)
    ]
    return {"id": track.id} | _group(track) | _speed(whole, usual) | {"track": rows}


def simulated(track: Track, whole: Track, end: float, usual: float | None) -> Tree:
    """Somebody who starts as recorded, and then goes their own way to where they went.

    Args:
        track: the part that is in the window.
        whole: from when they came to when they left.
        end: s, of the window; who leaves later is there to its end.
        usual: desired speed, m/s, of those whose tracks are too short to show it; None: it is drawn.
    """
    enters = float(track.time[0])
    told: Tree = {"id": track.id} | dict(zip("xy", map(quantised, track.place[0].tolist()), strict=True))
    if enters > 0.0:
        told["enters"] = quantised(enters)
    far = np.hypot(*(whole.place - whole.place[0]).T)
    if far.max() < STANDS:
        gone = {"leaves": quantised(float(track.time[-1]))} if track.time[-1] < end - 1e-6 else {}
        return told | gone
    goals = [whole.place[-1]]
    if far.max() > ROUND and far[-1] < ROUND / 2:  # there and back again
        goals.insert(0, whole.place[int(np.argmax(far))])
    onward = track.time <= track.time[0] + ONWARD + 1e-9
    onward[1] = True
    last = int(np.flatnonzero(onward)[-1])
    velocity = (track.place[last] - track.place[0]) / (track.time[last] - track.time[0])
    told["velocity"] = [quantised(v) for v in velocity.tolist()]
    told["goals"] = [[quantised(v) for v in goal.tolist()] for goal in goals]
    return told | {"exits": True} | _group(track) | _speed(whole, usual)


def _group(track: Track) -> Tree:
    return {"group": track.group} if track.group > 0 else {}


def _speed(whole: Track, usual: float | None) -> Tree:
    """Their desired speed: the mean while they walk, where that is long enough to tell."""
    speed, lasted = speeds(whole), np.diff(whole.time)
    walks = speed > WALKS
    if lasted[walks].sum() < SHORT:
        return {} if usual is None else {"desired_speed": usual}
    mean = float((speed * lasted)[walks].sum() / lasted[walks].sum())
    return {"desired_speed": quantised(min(max(mean, SLOWEST), QUICKEST))}


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
