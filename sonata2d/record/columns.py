"""Numbers of all states of an episode as arrays, and whether frames agree with the schema."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ..core.bounds import MAX_MAGNITUDE
from ..core.files.limits import MAX_ID
from ..core.humans import frozen
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.wording import counted
from .layout import ABSENT, COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict, moving_doors

_ABSENT_ROW = [np.nan] * len(HUMAN_NAMES)


@dataclass(frozen=True, eq=False, repr=False)
class States:
    """States of the world at all ticks, the final state included: T + 1 rows for T frames; N people; read-only arrays.

    Attributes:
        tick: (T + 1,) of int.
        time: (T + 1,), s.
        robot: (T + 1, 6), columns x, y, theta, vx, vy, omega; SI units, world frame.
        robots: (T + 1, M, 6), the same columns of the M other robots.
        humans: (T + 1, N, 7), columns x, y, theta, vx, vy, omega, head; SI units, world frame; NaN where not present.
        present: (T + 1, N) of bool.
        activity: (T + 1, N) of int, into `relations.ACTIVITIES`; -1 where not present.
        doors: (T + 1, D), openings of the interior doors that move, see `InteriorDoor`.
    """

    tick: IntArray
    time: Array
    robot: Array
    robots: Array
    humans: Array
    present: BoolArray
    activity: IntArray
    doors: Array

    def __repr__(self) -> str:
        return f"<States: {counted(len(self.tick), 'tick')}, {counted(self.humans.shape[1], 'person')}>"


class Columns(NamedTuple):
    """Arrays of an episode.

    Attributes:
        states: of all T + 1 states.
        command, executed, guarded: (T, 3), (T, 3) and (T,), see `EpisodeRecord`.
        types: of the values that the floats were made of.
    """

    states: States
    command: Array
    executed: Array
    guarded: BoolArray
    types: set[type]


def columns_of(document: JsonDict) -> Columns:
    """The arrays of a document.

    Raises:
        LookupError, TypeError, ValueError, OverflowError: a frame or the final state has not the values of the schema.
    """
    frames = document["frames"]
    if type(frames) is not list:
        raise TypeError("frames must be a list")
    states = [*frames, document["final"]]
    people, others, types = len(document["humans"]), len(document.get("robots") or ()), set[type]()
    doors = len(moving_doors(document))
    activity = np.array([state["activity"] for state in states], dtype=np.int64).reshape(len(states), people)
    rows = [_ABSENT_ROW if row is None else row for row in _joined((state["humans"] for state in states), people)]
    robots = [other["robot"] for state in states for other in state["robots"]] if others else []
    return Columns(
        States(
            tick=frozen(np.array([state["tick"] for state in states], dtype=np.int64)),
            time=_array([state["time"] for state in states], types),
            robot=_stack([state["robot"] for state in states], types, len(ROBOT_NAMES)),
            robots=_stack(robots, types, len(ROBOT_NAMES)).reshape(len(states), others, len(ROBOT_NAMES)),
            humans=_stack(rows, types, len(HUMAN_NAMES)).reshape(len(states), people, len(HUMAN_NAMES)),
            present=frozen(activity != ABSENT),
            activity=frozen(activity),
            doors=_stack([state["doors"] if doors else [] for state in states], types, doors),
        ),
        command=_stack([frame["command"] for frame in frames], types, len(COMMAND_NAMES)),
        executed=_stack([frame["executed"] for frame in frames], types, len(COMMAND_NAMES)),
        guarded=frozen(np.array([frame["guarded"] for frame in frames], dtype=bool)),
        types=types,
    )


def frames_to_compare(document: JsonDict, columns: Columns) -> list[JsonDict]:
    """The frames that must be compared with `models.Frame`; others agree with it, which takes a fifth of the time.

    Args:
        document: of an episode.
        columns: `columns_of` the document.

    Returns:
        Frames with contacts, events, other robots or readings; all frames if one of the others may not agree.

    Raises:
        LookupError, TypeError, ValueError: a frame has not the values of the schema.
    """
    frames = document["frames"]
    rare = [each for each in frames if each["contacts"] or each["events"] or "robots" in each or "sensors" in each]
    return rare if _agree(frames, columns) else frames


def _agree(frames: list[JsonDict], columns: Columns) -> bool:
    """Whether all frames agree with the schema but for what is in contacts, events, other robots and readings."""
    states, links = columns.states, _joined(frame["interactions"] for frame in frames)
    links_types = {tuple(map(type, row)) for row in links}
    ends = [end for row in links for end in (row[0], row[2])]
    finite = np.count_nonzero(np.abs(states.humans) <= MAX_MAGNITUDE)
    numbers = (states.robot, columns.command, columns.executed)
    return (
        columns.types <= {int, float}
        and finite == len(HUMAN_NAMES) * np.count_nonzero(states.present)
        and all(bool((np.abs(array) <= MAX_MAGNITUDE).all()) for array in numbers)
        and bool(((states.time >= 0.0) & (states.time <= MAX_MAGNITUDE)).all())
        and {type(frame["tick"]) for frame in frames} <= {int}
        and bool((states.tick >= 0).all() and (states.activity >= ABSENT).all())
        and {*map(type, _joined(frame["activity"] for frame in frames))} <= {int}
        and links_types <= {(int, str, int)}
        and (not ends or -MAX_ID <= min(ends) <= max(ends) <= MAX_ID)
        and bool((np.abs(states.doors) <= 1.0).all())
        and (states.doors.size > 0 or not any("doors" in frame for frame in frames))
        and {type(frame["guarded"]) for frame in frames} <= {bool}
        and {type(frame[key]) for frame in frames for key in ("contacts", "events")} <= {list}
    )


def _joined(rows: Iterable[list[Any]], length: int | None = None) -> list[Any]:
    """The values of all rows.

    Raises:
        TypeError: a row is not a list.
        ValueError: a row is not of the length.
    """
    rows = list(rows)
    if not {*map(type, rows)} <= {list}:
        raise TypeError("a row is not a list")
    if length is not None and not {*map(len, rows)} <= {length}:
        raise ValueError(f"a row has not {length} values")
    return list(chain.from_iterable(rows))


def _stack(rows: list[Any], types: set[type], length: int) -> Array:
    """Rows of a length as a read-only array, (R, length)."""
    array: Array = _array(_joined(rows, length), types).reshape(len(rows), length)
    return array


def _array(values: list[Any], types: set[type]) -> Array:
    """Values as a read-only array of floats; their types are noted."""
    types.update(map(type, values))
    return frozen(np.fromiter(values, np.float64, len(values)))
