"""Positions of people as a file gives them, and the tracks that the reader makes of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...core.bounds import MAX_MAGNITUDE
from ...core.files.limits import CELLS_OF_FRAME, MAX_CELLS, MAX_CELLS_PER_OBSERVATION, MAX_CELLS_WITHOUT_RATIO, MAX_ID
from ...core.portable_math import Array, BoolArray, IntArray

LENGTHS = {
    "m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0,
    "dm": 0.1, "cm": 0.01, "centimetres": 0.01, "centimeters": 0.01,
    "mm": 0.001, "millimetres": 0.001, "millimeters": 0.001, "km": 1000.0,
    "ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "in": 0.0254, "inch": 0.0254, "inches": 0.0254,
}  # fmt: skip
"""Units of length that files and `--unit` name, m."""

_ROBOTS, _PEOPLE = (
    frozenset({"robot", "ego"}),
    frozenset({"ped", "pedestrian", "pedestrians", "person", "people", "human", "walker", "adult", "child"}),
)


@dataclass(frozen=True, eq=False)
class Observations:
    """M observed positions.

    Attributes:
        ped: (M,), ids of the people.
        position: (M, 2), in units of `unit`; NaN where somebody was not observed.
        frame: (M,), frame numbers; None if the file gives times only.
        time: (M,), s; None if the file gives frame numbers only.
        layout: name of the layout of the file.
        unit: length of a unit of `position`, m; None if the file does not give it.
        in_pixels: positions are pixels of a picture, so that their scale must be known.
        frame_rate: frame numbers per second, Hz; None if the file does not give it.
        interval: time between successive observations of a person, s, if that is what the layout fixes.
        group: (M,), group numbers, NaN where unknown; None if groups were not annotated.
        walls: (W, 4), x1, y1, x2, y2, in units of `unit`.
        robot: id of the robot; None if no track is a robot's.
        notes: remarks on what was read.
    """

    ped: IntArray
    position: Array
    frame: Array | None
    time: Array | None
    layout: str
    unit: float | None = None
    in_pixels: bool = False
    frame_rate: float | None = None
    interval: float | None = None
    group: Array | None = None
    walls: Array = field(default_factory=lambda: np.zeros((0, 4)))
    robot: int | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Track:
    """Positions of one person at even times.

    Attributes:
        id: of the person, from 1.
        time: (K,), s from the first observation of the file, rising, K >= 1.
        position: (K, 2), m, world frame.
        group: number of the group; 0 without a group.
    """

    id: int
    time: Array
    position: Array
    group: int = 0

    def speeds(self) -> Array:
        """Speeds between successive positions; (K - 1,), m/s."""
        step = np.diff(self.position, axis=0)
        return np.asarray(np.hypot(step[:, 0], step[:, 1]) / np.diff(self.time), dtype=float)


@dataclass(frozen=True, eq=False)
class Tracks:
    """Recorded tracks of people, ready for an episode or a scenario.

    Attributes:
        people: track of each person, by id.
        interval: time between successive positions, s.
        layout: name of the layout of the file.
        has_groups: whether groups were annotated.
        walls: (W, 4), x1, y1, x2, y2, m; W = 0 if none are known.
        robot: track of the robot, if the file has one.
        desired_speed: of all people, m/s; None if it is not known.
        notes: remarks on what was read, left out or repaired.
        doubts: reasons why ids may be wrong.
    """

    people: tuple[Track, ...]
    interval: float
    layout: str
    has_groups: bool = False
    walls: Array = field(default_factory=lambda: np.zeros((0, 4)))
    robot: Track | None = None
    desired_speed: float | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def require_few(frames: float, people: int, observed: int) -> None:
    """Check that not many more positions are made than were observed: one frame number can ask for any number.

    Raises:
        ValueError: there are more than `files.limits` allows.
    """
    cells = min(max(MAX_CELLS_WITHOUT_RATIO, MAX_CELLS_PER_OBSERVATION * observed), MAX_CELLS)
    limit = cells // (people + CELLS_OF_FRAME)
    if frames > limit:
        raise ValueError(
            f"its {observed} positions spread over {frames:.0f} frames of {people} people; the limit is {limit} frames"
            f" for an episode with {people} people: divide the file into shorter ones"
        )


def interpolated(at: Array, row: Array, position: Array) -> Array:
    """Positions on the straight lines between observations; (n, 2).

    Args:
        at: (n,), where.
        row: (K,), of the observations, rising.
        position: (K, 2).
    """
    return np.stack([np.interp(at, row, position[:, k]) for k in (0, 1)], axis=1)


def ids_of(names: Sequence[str]) -> tuple[IntArray, tuple[str, ...]]:
    """Give people ids: their numbers, the numbers at the end of their names, or numbers in the order of appearance.

    Args:
        names: (M,), ids as the file has them, one for each position.

    Returns:
        (M,), ids from 1, and the remarks that these differ from the file's.

    Raises:
        ValueError: a number is not an integer below 2**53.
    """
    distinct = list(dict.fromkeys(names))
    values = [_integer(name) for name in distinct]
    numbers, notes = [value for value in values if value is not None], list[str]()
    if len(numbers) < len(distinct):
        ends = [match and int(match[0]) for match in (re.search(r"\d{1,9}$", name) for name in distinct)]
        found = [end for end in ends if end]
        numbers = found if len(set(found)) == len(distinct) else list(range(1, len(distinct) + 1))
        shown = ", ".join(f"{name!r} is {number}" for name, number in list(zip(distinct, numbers, strict=True))[:3])
        notes.append(f"names of people became ids: {shown}{', …' if len(distinct) > 3 else ''}")
    elif (lowest := min(numbers, default=1)) < 1:  # id 0 is the robot's in an episode
        numbers = [number + 1 - lowest for number in numbers]
    by_name = dict(zip(distinct, numbers, strict=True))
    return np.array([by_name[name] for name in names], dtype=np.int64), tuple(notes)


def _integer(name: str) -> int | None:
    try:
        number = float(name)
    except ValueError:
        return None
    if not abs(number) < MAX_ID or number != round(number):
        raise ValueError(f"the ids in ped must be integers or names, not {name}")
    return round(number)


def people_and_robot(kinds: Sequence[str], ped: IntArray) -> tuple[BoolArray, int | None, tuple[str, ...]]:
    """Tell people, a robot and other things apart by what the file calls them.

    Args:
        kinds: (M,), class of whom each row is about, e.g. `Pedestrian`; an empty one counts as a person.
        ped: (M,), ids.

    Returns:
        (M,), rows of people and of the robot; the id of the robot, if there is one; remarks on rows left out.
    """
    names = np.array([kind.strip().strip('"').lower() for kind in kinds])
    is_robot, is_person = np.isin(names, list(_ROBOTS)), np.isin(names, [*_PEOPLE, ""])
    if not (is_robot | is_person).any():  # numbers of classes, or words that are not known
        words = sorted(name for name in set(names.tolist()) if not name.replace(".", "").isdecimal())
        notes = [f"the classes {', '.join(words[:5])} are unknown: all count as people"] if words else []
        return np.ones(len(ped), dtype=bool), None, tuple(notes)
    robots = np.unique(ped[is_robot])
    notes = [f"{len(robots)} robots: the one with the lowest id is read"] if len(robots) > 1 else []
    others = ~is_robot & ~is_person
    if others.any():
        classes = [f"{len(np.unique(ped[names == name]))} {name}" for name in np.unique(names[others]).tolist()]
        notes.append(f"tracks of others than people are left out: {', '.join(classes)}")
    robot = int(robots[0]) if len(robots) else None
    return is_person | (is_robot & (ped == robot)), robot, tuple(notes)


def require_bounded(values: Array, names: str) -> None:
    """Check that numbers are finite and below 1e11; NaN is allowed.

    Raises:
        ValueError: one is not.
    """
    if (np.abs(np.nan_to_num(values, nan=0.0, posinf=np.inf, neginf=-np.inf)) >= MAX_MAGNITUDE).any():
        raise ValueError(f"{names} must be finite numbers below {MAX_MAGNITUDE:g}")


def length_named(unit: str) -> float:
    """Length of a unit, m: a name such as `cm`, or a number of metres, e.g. 0.038 for the pixels of a picture.

    Raises:
        ValueError: it is neither.
    """
    try:
        length = LENGTHS.get(unit.strip().lower()) or float(unit)
    except ValueError:
        length = 0.0
    if not 0.0 < length < MAX_MAGNITUDE:
        shown = (
            "give metres per pixel, e.g. 0.038" if unit.lower() in ("px", "pixel", "pixels") else "use m, cm, mm, ft"
        )
        raise ValueError(f"unit {unit!r} is unknown; {shown}, or a number of metres")
    return length


def homography_of(path: Path, text: str) -> Array:
    """Matrix from picture to ground, m, from a file of 9 numbers, or of one scale.

    Raises:
        ValueError: it holds neither, or a matrix that has no inverse.
    """
    try:
        numbers = [float(cell) for cell in re.split(r"[\s,;]+", text.strip().strip("[]"))]
    except ValueError:
        numbers = []
    matrix = np.diag([numbers[0], numbers[0], 1.0]) if len(numbers) == 1 else np.array(numbers)
    if matrix.size != 9 or not (np.abs(matrix) < MAX_MAGNITUDE).all():
        raise ValueError(f"{path} must hold a matrix of 3 x 3 numbers, or one number, the metres per pixel")
    matrix = matrix.reshape(3, 3)
    if not abs(np.linalg.det(matrix)) > 0.0:
        raise ValueError(f"{path} holds a matrix that has no inverse, which maps all positions onto a line")
    return matrix
