"""The frames of an episode as lines of its file. Whole columns are computed, rounded and serialised at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from ..core.devices import DeviceEvent
from ..core.entities import Human, Interaction
from ..core.geometry import Twist
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, Y
from ..core.portable_math import Array, BoolArray, IntArray, arctan2
from ..core.snapshot import Contact, Snapshot
from ..core.state import EXECUTED_VX, GUARDED, HUMAN_SIZE, ROBOT_SIZE, State
from .canonical import dumps, require_finite, rounded, rounded_rows
from .layout import ABSENT, COMMAND_NAMES, HUMAN_ANGLES, HUMAN_NAMES, ROBOT_ANGLES, ROBOT_NAMES, interaction_rows

# Kept parts of a snapshot: state, tick, time, interactions, contacts, device events. All are read-only.
Observation = tuple[State, int, float, tuple[Interaction, ...], tuple[Contact, ...], tuple[DeviceEvent, ...]]
Answer = tuple[Twist, Any]  # of a frame: command, and label as a JSON value

# Columns of `State.row`, for the robot and for each human.
_POSITION, _VELOCITY, _OMEGA = slice(0, Y + 1), slice(VX, VY + 1), slice(OMEGA, OMEGA + 1)
_BODY, _GAZE = slice(BODY_X, BODY_Y + 1), slice(GAZE_X, GAZE_Y + 1)
_EXECUTED = slice(EXECUTED_VX, EXECUTED_VX + 3)

_STATE = b'{"tick":%b,"time":%b,"robot":%b,"humans":%b,"activity":%b,"interactions":%b,"contacts":%b%b}'
_FRAME = (
    b'{"tick":%b,"time":%b,"robot":%b,"command":%b,"executed":%b,"guarded":%b,"humans":%b,"activity":%b,'
    b'"interactions":%b,"contacts":%b,"events":%b%b}'
)
_NULL_ROW = dumps([None] * len(HUMAN_NAMES))


observation: Callable[[Snapshot], Observation] = attrgetter(
    "state", "tick", "time", "interactions", "contacts", "events"
)
"""Return the parts of a snapshot that a file holds, as references."""


def never_entered(humans: Sequence[Human], present: BoolArray, last_tick: int) -> list[int]:
    """Ids of the pedestrians whose time to enter came, and who found no free space until the end of the episode.

    Args:
        humans: of the scene.
        present: (T + 1, N), whether each one is present at each tick.
        last_tick: of the final state.
    """
    absent = (humans[k] for k in np.flatnonzero(~present.any(axis=0)).tolist())
    # recorded ones follow their tracks in any case
    return [human.id for human in absent if human.enters <= last_tick and human.behaviour != "recorded"]


def presence(observations: Sequence[Observation], count: int) -> BoolArray:
    """(T + 1, N), whether each of N humans is present in each observation."""
    everybody = np.ones(count, dtype=bool)
    return np.array([everybody if seen[0].is_present is None else seen[0].is_present for seen in observations])


def frame_lines(
    observations: Sequence[Observation], answers: Sequence[Answer], ids: list[int]
) -> tuple[list[bytes], bytes]:
    """Serialise the states of an episode, and the answers to them.

    Args:
        observations: T + 1, the final one included.
        answers: T.
        ids: of the N humans of the scene.

    Returns:
        JSON of the T frames, and of the final state.

    Raises:
        RecordError: a number is not finite, or JSON cannot represent a value.
    """
    states, tick, time, interactions, contacts, events = zip(*observations, strict=True)
    table = np.concatenate([state.row for state in states]).reshape(len(states), -1)
    activity = np.concatenate([state.activity for state in states]).reshape(len(states), len(ids))
    present = presence(observations, len(ids))
    robot, executed, humans = _rounded_columns(table, present, ids)
    command = np.array([(twist.vx, twist.vy, twist.omega) for twist, _ in answers], dtype=float).reshape(-1, 3)
    require_finite(command, COMMAND_NAMES, "the command")
    instant = rounded(np.array(time, dtype=float))
    require_finite(instant[:, None], ("time",), "the state")
    columns = {  # of T or T + 1 items, in the file's order of keys
        "tick": _items(np.array(tick, dtype=np.int64)),
        "time": _items(instant),
        "robot": _items(robot),
        "command": _items(rounded(command)),
        "executed": _items(executed[1:]),  # what was executed after a frame is part of the next state
        "guarded": [b"true" if guarded else b"false" for guarded in table[1:, GUARDED].tolist()],
        "humans": _items(humans) if present.all() else [item.replace(_NULL_ROW, b"null") for item in _items(humans)],
        "activity": _items(np.where(present, activity, ABSENT)),
        "interactions": _changing_items(interactions, interaction_rows),
        "contacts": _changing_items(contacts, list),
        "events": _changing_items(events, list),
        "label": [b"" if label is None else b',"label":' + dumps(label) for _, label in answers],
    }
    # the final state belongs to no frame: the shorter columns end before it
    frames = [_FRAME % values for values in zip(*columns.values(), strict=False)]
    of_final = ("tick", "time", "robot", "humans", "activity", "interactions", "contacts")
    final_events = b',"events":' + columns["events"][-1] if events[-1] else b""
    return frames, _STATE % (*(columns[key][-1] for key in of_final), final_events)


def _rounded_columns(table: Array, present: BoolArray, ids: list[int]) -> tuple[Array, Array, Array]:
    """Convert rows of states to rows of the file.

    Args:
        table: (T, 13 + 9 N), columns as in `State.row`.
        present: (T, N) of bool.
        ids: of the N humans.

    Returns:
        Rows of the robot (T, 6), executed twists (T, 3) and rows of the humans (T, N, 7), rounded; NaN where a human is
        absent.
    """
    robot, executed = table[:, :ROBOT_SIZE], table[:, _EXECUTED]
    humans = table[:, ROBOT_SIZE:].reshape(len(table), len(ids), HUMAN_SIZE)
    directions = np.concatenate((robot[:, None, _BODY], humans[..., _BODY], humans[..., _GAZE]), axis=1)
    theta, body, gaze = np.split(arctan2(directions[..., 1], directions[..., 0]), (1, 1 + len(ids)), axis=1)
    robot = np.concatenate((robot[:, _POSITION], theta, robot[:, _VELOCITY], robot[:, _OMEGA]), axis=1)
    position, velocity, omega = (humans[..., columns] for columns in (_POSITION, _VELOCITY, _OMEGA))
    humans = np.concatenate((position, body[..., None], velocity, omega, gaze[..., None]), axis=2)
    humans[~present] = 0.0
    require_finite(robot, ROBOT_NAMES, "the robot")
    require_finite(executed, COMMAND_NAMES, "the executed command")
    require_finite(humans, HUMAN_NAMES, "human", ids)
    humans = rounded_rows(humans, HUMAN_ANGLES)
    humans[~present] = np.nan
    return rounded_rows(robot, ROBOT_ANGLES), rounded(executed), humans


def _items(column: Array | IntArray) -> list[bytes]:
    """Serialise each item of an array of numbers; NaN becomes null."""
    if column.size == 0:
        return [b"[]"] * len(column)
    if column.ndim > 2:  # long items: faster one by one
        return [dumps(np.ascontiguousarray(item)) for item in column]
    opening, closing = b"[" * (column.ndim - 1), b"]" * (column.ndim - 1)
    text = dumps(np.ascontiguousarray(column))[1:-1]
    return text.replace(closing + b"," + opening, closing + b"\n" + opening).split(b"\n")


def _changing_items(values: Sequence[tuple[Any, ...]], convert: Callable[[Any], list[Any]]) -> list[bytes]:
    """Serialise each value; a value that equals its predecessor, as most do, is not serialised again."""
    items: list[bytes] = []
    previous, item = (), b"[]"
    for value in values:
        if value is not previous and value != previous:
            previous, item = value, dumps(convert(value))
        items.append(item)
    return items
