"""The definition of a format, and the checks and time stamps that exporters share."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, SupportsFloat, get_args

import numpy as np

from ..core.floats import FloatFields
from ..core.portable_math import Array, IntArray
from ..core.relations import RELATIONS
from ..errors import UnsuitableEpisode as UnsuitableEpisode
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord

_STAMP_GRID = 2.0**30  # stamps are multiples of 1/_STAMP_GRID s: differences of stamps below 2**23 s are exact


RobotsAs = Literal["people", "objects"]


@dataclass(frozen=True, slots=True)
class Options(FloatFields):
    """Options of an export or an import; each format uses some of them, see `Format.options`.

    Attributes:
        original: reproduce the quirks of the program that the format comes from.
        frame_time: duration of one frame number, s, for track files without times.
        frame_rate: frame numbers per second, Hz, in place of `frame_time`.
        columns: on import, names of the columns of a track file in its order: `frame`, `ped`, `x`, `y`, `z`, `t`,
            `group`, `kind`, and `-` for others.
        unit: on import of tracks, unit of the positions: `m`, `cm`, `mm`, `ft`, or a number of metres, e.g. of a pixel.
        homography: on import of tracks, a file with the matrix from picture to ground in m, or with the scale.
        context: text for the readers of an exported run; None: the context of the episode; empty: no context.
        types: type of an object that a format does not list: the type that is written in its place.
        renumber: on import, replace ids that a file uses twice by new ones.
        walls: on import, a file with the walls of the room (`x1,y1,x2,y2` in m), for files without walls.
        robot: of several robots, the number of the one that is exported as the robot, 0 the first.
        robots_as: what the other robots are exported as, `people` or `objects`.
        questions: number of questions about an episode; None: as the format has them.
        pictures: whether questions come with a picture of the moment, and episodes of `lerobot` with a film.
    """

    original: bool = False
    frame_time: float | None = None
    frame_rate: float | None = None
    columns: tuple[str, ...] | None = None
    unit: str | SupportsFloat | None = None
    homography: Path | None = None
    context: str | None = None
    types: Mapping[str, str] = field(default_factory=dict)
    renumber: bool = False
    walls: Path | None = None
    robot: int = 0
    robots_as: RobotsAs = "people"
    questions: int | None = None
    pictures: bool = False

    def __post_init__(self) -> None:
        FloatFields.__post_init__(self)  # a class with slots has no super() without arguments
        if self.robots_as not in get_args(RobotsAs):
            raise ValueError(f"robots_as must be people or objects, got {self.robots_as!r}")


ROBOT_OPTIONS = frozenset({"robot", "robots_as"})  # of formats that describe the task of one robot
Export = Callable[[EpisodeRecord, Options], bytes]
Import = Callable[[Path, Options], Iterator[JsonDict]]  # yields episode documents, as `record.read_episode` reads them


@dataclass(frozen=True, slots=True)
class Tables:
    """The export of a format whose files hold the rows of several episodes.

    Attributes:
        pack: converts an episode, its key and the options, in the worker that has read it, to an item for `write`.
        write: writes packed episodes into a folder and returns the files. Its last argument is the number of a part,
            which gets files of its own; None: the tables hold all episodes.
        finish: called at the end with the folder and the number of parts, 0 for tables of all episodes; returns the
            other files of the folder.
        is_divisible: whether the tables can be written in parts.
    """

    pack: Callable[[EpisodeRecord, str, Options], Any]
    write: Callable[[Iterator[Any], Path, int | None], list[Path]]
    finish: Callable[[Path, int], list[Path]]
    is_divisible: bool = True


@dataclass(frozen=True, slots=True)
class Format:
    """A file format of other programs.

    A format that writes one file per episode defines `export`; a format whose files hold several episodes defines
    `tables`.

    Attributes:
        description: one line.
        suffix: suffix of the files; for a format of tables, of each table.
        import_: yields the episode documents of a file (for tables: of a folder); None if the format is only written.
        export: returns the bytes of the file of one episode; raises `UnsuitableEpisode` for an episode that the format
            cannot hold.
        tables: writes tables of all episodes, or of parts of large data sets.
        note: a remark on the exported file of an episode, for the caller; None if there is nothing to remark.
        holds_robots: whether it holds several robots; for others, the other robots are people.
        options: names of the fields of `Options` that the format uses; others are refused.
        other_suffixes: of more files that are read.

    Example:
        >>> Format("goal position: x, y in m", ".goal.txt", export=lambda record, options: b"3.0 0.0").suffix
        '.goal.txt'
    """

    description: str
    suffix: str
    import_: Import | None = None
    export: Export | None = None
    tables: Tables | None = None
    note: Callable[[EpisodeRecord, Options], str | None] | None = None
    holds_robots: bool = False
    options: frozenset[str] = frozenset()
    other_suffixes: tuple[str, ...] = ()


def header_of(document: JsonDict) -> JsonDict:
    """The keys of an episode document besides its frames and its final state."""
    return {key: value for key, value in document.items() if key not in ("frames", "final")}


def require_all_present(record: EpisodeRecord, format: str) -> None:
    """Check that every pedestrian is present in every frame.

    Readers of some formats take the pedestrians of one frame for the pedestrians of all frames.

    Raises:
        UnsuitableEpisode: a pedestrian is absent at some tick.
    """
    absences = np.argwhere(~record.states.present)
    if len(absences):
        tick, k = absences[0].tolist()
        human = record.scene().humans[k].id
        raise UnsuitableEpisode(
            record.path,
            f"human {human} is not present at tick {tick}, but readers of {format} expect the same people in every"
            " frame",
            "export to socnav3, parquet, npz, csv or trajnet",
        )


def require_duration(record: EpisodeRecord, format: str, duration: float, minimum: float) -> None:
    """Check that an episode is long enough for the readers of a format.

    Args:
        record: the episode.
        format: name of the format.
        duration: time from the first to the last exported frame, s.
        minimum: shortest duration that readers accept, s.

    Raises:
        UnsuitableEpisode: the episode is shorter.
    """
    if duration < minimum - 1e-9:
        raise UnsuitableEpisode(
            record.path,
            f"{duration:.4g} s from first to last frame, but readers of {format} need {minimum:g} s",
            "leave out short episodes",
        )


def require_robot(record: EpisodeRecord, format: str) -> None:
    """Check that the robot was recorded, and is not the stand-in that `imported` adds.

    Raises:
        UnsuitableEpisode: the episode was imported from a source without a robot.
    """
    if "robot" in record.document.get("imported", {}).get("lacks", ()):
        raise UnsuitableEpisode(
            record.path,
            f"the episode has no recorded robot, but {format} describes what a robot observes",
            "export to csv, trajnet, npz or parquet",
        )


def require_task(record: EpisodeRecord, format: str) -> None:
    """Check that robot, commands and goal were recorded, and are not the stand-ins that an import adds.

    Raises:
        UnsuitableEpisode: the source of an imported episode lacks one.
    """
    require_robot(record, format)
    lacks = record.document.get("imported", {}).get("lacks", ())
    for key in ("frames.command", "goal"):
        if key in lacks:
            raise UnsuitableEpisode(
                record.path,
                f"the episode has no recorded {key.removeprefix('frames.')}, but {format} is to learn from",
                "export to csv, trajnet, npz or parquet",
            )


def require_consecutive_ids(record: EpisodeRecord, format: str) -> None:
    """Check that the ids of people and objects together are 1..P+O: readers use them as node indices.

    Raises:
        UnsuitableEpisode: the ids have gaps or do not start at 1.
    """
    scene = record.scene()
    ids = [*scene.human_table.row] + [thing.id for thing in scene.furniture] + [other.id for other in scene.robots]
    if sorted(ids) != list(range(1, len(ids) + 1)):
        raise UnsuitableEpisode(
            record.path,
            f"ids are {sorted(ids)}, but readers of {format} use ids as indices and need 1..{len(ids)}",
            "export to socnav3 or parquet, which accept any ids",
        )


def require_known_relations(record: EpisodeRecord, format: str, known: Collection[str] = RELATIONS) -> None:
    """Check that a format has a name for every recorded relation.

    Raises:
        UnsuitableEpisode: an interaction has another relation.
    """
    for frame in (*record.document["frames"], record.document["final"]):
        for src, relation, dst in frame["interactions"]:
            if relation not in known:
                raise UnsuitableEpisode(
                    record.path,
                    f"{format} has no relation {relation} (of {src} and {dst} at tick {frame['tick']})",
                    f"its relations are {', '.join(known)}",
                )


def require_even_times(record: EpisodeRecord, format: str) -> None:
    """Check that frame k was recorded at k * dt; imported episodes may have uneven times.

    Raises:
        UnsuitableEpisode: a time differs from tick * dt by more than 0.2 ms.
    """
    dt, states = record.scene().rules.dt, record.states
    uneven = np.flatnonzero(np.abs(states.time - states.tick * dt) > 2e-4)
    if len(uneven):
        t = int(uneven[0])
        raise UnsuitableEpisode(
            record.path,
            f"frame {t} was recorded at {states.time[t]:g} s, not at {t} * {dt:g} s, but {format} needs even steps",
            "resample the source first",
        )


def exact_stamps(tick: IntArray | list[int], dt: float) -> Array:
    """Return time stamps whose differences are never below the tick length in floating point.

    Readers that compare `t - last >= 0.1` would drop frames with decimal stamps. The step used here is the tick length
    rounded up to a multiple of 2**-30 s: 10 000 ticks end less than 10 microseconds late, and the difference over n
    ticks is never smaller than n * dt.

    Args:
        tick: (T,), from 0.
        dt: tick length, s.

    Returns:
        (T,), s.
    """
    step = math.ceil(dt * _STAMP_GRID) / _STAMP_GRID
    return np.asarray(tick, dtype=np.float64) * step
