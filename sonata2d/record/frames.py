"""The frames of an episode as lines of its file. Whole columns are computed, rounded and serialised at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.bounds import MAX_MAGNITUDE
from ..core.devices import DeviceEvent
from ..core.entities import Human, Interaction
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, Y
from ..core.portable_math import Array, BoolArray, IntArray, arctan2
from ..core.snapshot import Contact, Frames, Snapshot
from ..core.state import EXECUTED_VX, GUARDED, HUMAN_SIZE, ROBOT_SIZE
from .canonical import dumps, require_finite, rounded, rounded_rows, to_json_value
from .layout import ABSENT, COMMAND_NAMES, HUMAN_ANGLES, HUMAN_NAMES, ROBOT_ANGLES, ROBOT_NAMES, interaction_rows

Command = Sequence[float]  # vx, vy, omega
# Of a frame: command, label as a JSON value, the same of the other robots, and `readings_json` of all robots.
Answer = tuple[Command, Any, tuple[tuple[Command, Any], ...], tuple[bytes, ...]]


class Segment(NamedTuple):
    """Consecutive states that differ in their numbers only, as references to what snapshots hold.

    Attributes:
        rows: (T, 13 + 9 N + 13 M + D), `State.row` of each.
        tick: of the first.
        times: (T,), s.
        activity, is_present: of `State`.
        interactions, contacts, contacts_of_robots: of `Snapshot`.
        events: of the first.
    """

    rows: Array
    tick: int
    times: Sequence[float]
    activity: IntArray
    is_present: BoolArray | None
    interactions: tuple[Interaction, ...]
    contacts: tuple[Contact, ...]
    events: tuple[DeviceEvent, ...]
    contacts_of_robots: tuple[tuple[Contact, ...], ...] = ()

    @classmethod
    def of(cls, frames: Frames) -> Segment:
        """Of many frames."""
        (tick, dt), count = (frames.first.tick, frames.first.dt), len(frames.rows)
        times = [round(n * dt, 4) for n in range(tick, tick + count)]
        return segment_of(frames.first)._replace(rows=frames.rows, times=times)

    def part(self, start: int, stop: int) -> Segment:
        """Some of the states."""
        events = () if start else self.events
        rows, times = self.rows[start:stop], self.times[start:stop]
        return self._replace(rows=rows, tick=self.tick + start, times=times, events=events)


def segment_of(snapshot: Snapshot) -> Segment:
    """A segment of one state."""
    row, activity, is_present, _ = snapshot.state
    return Segment(
        row.reshape(1, -1), snapshot.tick, (snapshot.time,), activity, is_present, snapshot.interactions,
        snapshot.contacts, snapshot.events, snapshot.contacts_of_robots,
    )  # fmt: skip


# Columns of `State.row`, for the robot and for each human.
_POSITION, _VELOCITY, _OMEGA = slice(0, Y + 1), slice(VX, VY + 1), slice(OMEGA, OMEGA + 1)
_BODY, _GAZE = slice(BODY_X, BODY_Y + 1), slice(GAZE_X, GAZE_Y + 1)
_EXECUTED = slice(EXECUTED_VX, EXECUTED_VX + 3)

_STATE = b'{"tick":%b,"time":%b,"robot":%b,"humans":%b,"activity":%b,"interactions":%b,"contacts":%b%b%b%b}'
_FRAME = (
    b'{"tick":%b,"time":%b,"robot":%b,"command":%b,"executed":%b,"guarded":%b,"humans":%b,"activity":%b,'
    b'"interactions":%b,"contacts":%b%b%b,"events":%b%b%b}'
)
# of another robot: the keys that the frame has for the first one
_OTHER = b'{"robot":%b,"command":%b,"executed":%b,"guarded":%b,"contacts":%b%b%b}'
_OTHER_STATE = b'{"robot":%b,"contacts":%b}'
_NULL_ROW = dumps([None] * len(HUMAN_NAMES))


def never_entered(humans: Sequence[Human], has_been_present: BoolArray, last_tick: int) -> list[int]:
    """Ids of the pedestrians whose time to enter came, and who found no free space until the end of the episode.

    Args:
        humans: of the scene.
        has_been_present: (N,), in any state.
        last_tick: of the final state.
    """
    absent = (humans[k] for k in np.flatnonzero(~has_been_present).tolist())
    # recorded ones follow their tracks in any case
    return [human.id for human in absent if human.enters <= last_tick and human.behaviour != "recorded"]


def frame_lines(
    segments: Sequence[Segment], answers: Sequence[Answer], ids: list[int], doors: int = 0
) -> tuple[list[bytes], bytes]:
    """Serialise states, and the answers to them.

    Args:
        segments: of T + 1 states, the last one of which is that after the last frame.
        answers: T.
        ids: of the N humans of the scene.
        doors: number of its doors that move.

    Returns:
        JSON of the T frames, and of the last state.

    Raises:
        RecordError: a number is not finite, or JSON cannot represent a value.
    """
    lengths = [len(segment.rows) for segment in segments]
    tick = [segment.tick + n for segment in segments for n in range(len(segment.rows))]
    table = np.concatenate([segment.rows for segment in segments])
    absent = None
    if any(segment.is_present is not None for segment in segments):
        nobody = np.zeros(len(ids), dtype=bool)
        each = [nobody if segment.is_present is None else ~segment.is_present for segment in segments]
        absent = np.repeat(each, lengths, axis=0)
    robot, executed, humans = _rounded_columns(table, absent, ids, tick[0])
    command = np.array([answer[0] for answer in answers], dtype=float).reshape(-1, 3)
    require_finite(command, COMMAND_NAMES, "the command", tick=tick[0])
    table, openings = table[:, : table.shape[1] - doors], table[:, table.shape[1] - doors :]
    others, others_at_end = _others(table[:, ROBOT_SIZE + HUMAN_SIZE * len(ids) :], segments, answers, lengths)
    time = rounded(np.array([time for segment in segments for time in segment.times], dtype=float))
    require_finite(time[:, None], ("time",), "the state", tick=tick[0])
    people = _items(humans)
    events: list[bytes] = []
    for segment, length in zip(segments, lengths, strict=True):
        events += [dumps(list(segment.events)) if segment.events else b"[]", *[b"[]"] * (length - 1)]
    columns = {  # of T or T + 1 items, in the file's order of keys
        "tick": _items(np.array(tick, dtype=np.int64)),
        "time": _items(time),
        "robot": _items(robot),
        "command": _items(rounded(command)),
        "executed": _items(executed[1:]),  # what was executed after a frame is part of the next state
        "guarded": [b"true" if guarded else b"false" for guarded in table[1:, GUARDED].tolist()],
        "humans": people if absent is None else [item.replace(_NULL_ROW, b"null") for item in people],
        "activity": _repeated([segment[3:5] for segment in segments], _activity_of_present, lengths),
        "interactions": _repeated([segment.interactions for segment in segments], interaction_rows, lengths),
        "contacts": _repeated([segment.contacts for segment in segments], list, lengths),
        "doors": _openings(openings),
        "robots": others,
        "events": events,
        "label": [_label(answer[1]) for answer in answers],
        "sensors": [_readings_of(0, answer) for answer in answers],
    }
    # the last state belongs to no frame: the shorter columns end before it
    frames = [_FRAME % values for values in zip(*columns.values(), strict=False)]
    of_last = ("tick", "time", "robot", "humans", "activity", "interactions", "contacts", "doors")
    last_events = b',"events":' + events[-1] if segments[-1].events else b""
    return frames, _STATE % (*(columns[key][-1] for key in of_last), others_at_end, last_events)


def _openings(table: Array) -> list[bytes]:
    """Serialise the openings of doors, (T, D); nothing if there are none."""
    if not table.shape[1]:
        return [b""] * len(table)
    return [b',"doors":' + item for item in _items(rounded(table))]


def _label(label: Any) -> bytes:
    return b"" if label is None else b',"label":' + dumps(label)


def readings_json(readings: dict[str, Any], tick: int) -> bytes:
    """The end of a frame with readings of sensors; empty if there are none.

    Args:
        readings: by name, see `Frame.readings`.
        tick: of the frame.

    Raises:
        RecordError: JSON cannot represent one.
    """
    if not readings:
        return b""
    values = {name: _reading(value, f"the reading {name} at tick {tick}") for name, value in readings.items()}
    return b',"sensors":' + dumps(values)


def _reading(value: Any, place: str) -> Any:
    """A reading, rounded; arrays of floats are kept, since they are serialised faster than lists."""
    if isinstance(value, dict):
        return {key: _reading(item, place) for key, item in value.items()}
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and not (np.abs(value) > MAX_MAGNITUDE).any():
        return np.ascontiguousarray(rounded(value))
    return to_json_value(value, place)


def _readings_of(robot: int, answer: Answer) -> bytes:
    return answer[3][robot] if answer[3] else b""


def _others(
    table: Array, segments: Sequence[Segment], answers: Sequence[Answer], lengths: Sequence[int]
) -> tuple[list[bytes], bytes]:
    """Serialise the other robots, in each frame and in the last state; nothing if there are none.

    Args:
        table: (T + 1, 13 M), their columns of `State.row`.
        segments, answers: see `frame_lines`.
        lengths: of the segments.

    Raises:
        RecordError: a number is not finite, or JSON cannot represent a label.
    """
    count, tick = table.shape[1] // ROBOT_SIZE, segments[0].tick
    if not count:
        return [b""] * len(answers), b""
    of_frames, at_end = [], []
    for k in range(count):
        rows = table[:, ROBOT_SIZE * k : ROBOT_SIZE * (k + 1)]
        robot, executed, _ = _rounded_columns(rows, None, [], tick)
        command = np.array([answer[2][k][0] for answer in answers], dtype=float).reshape(-1, 3)
        require_finite(command, COMMAND_NAMES, "the command", tick=tick)
        states = _items(robot)
        contacts = _repeated([segment.contacts_of_robots[k] for segment in segments], list, lengths)
        columns = (
            states,
            _items(rounded(command)),
            _items(executed[1:]),
            [b"true" if guarded else b"false" for guarded in rows[1:, GUARDED].tolist()],
            contacts,
            [_label(answer[2][k][1]) for answer in answers],
            [_readings_of(k + 1, answer) for answer in answers],
        )
        of_frames.append([_OTHER % values for values in zip(*columns, strict=False)])
        at_end.append(_OTHER_STATE % (states[-1], contacts[-1]))
    lines = [b',"robots":[%b]' % b",".join(each) for each in zip(*of_frames, strict=True)]
    return lines, b',"robots":[%b]' % b",".join(at_end)


def _rounded_columns(table: Array, absent: BoolArray | None, ids: list[int], tick: int) -> tuple[Array, Array, Array]:
    """Convert rows of states to rows of the file.

    Args:
        table: (T, 13 + 9 N), columns as in `State.row`.
        absent: (T, N) of bool; None: nobody.
        ids: of the N humans.
        tick: of the first row.

    Returns:
        Rows of the robot (T, 6), executed twists (T, 3) and rows of the humans (T, N, 7), rounded; NaN where a human is
        absent.
    """
    robot, executed = table[:, :ROBOT_SIZE], table[:, _EXECUTED]
    humans = table[:, ROBOT_SIZE : ROBOT_SIZE + HUMAN_SIZE * len(ids)].reshape(len(table), len(ids), HUMAN_SIZE)
    directions = np.concatenate((robot[:, None, _BODY], humans[..., _BODY], humans[..., _GAZE]), axis=1)
    theta, body, gaze = np.split(arctan2(directions[..., 1], directions[..., 0]), (1, 1 + len(ids)), axis=1)
    robot = np.concatenate((robot[:, _POSITION], theta, robot[:, _VELOCITY], robot[:, _OMEGA]), axis=1)
    position, velocity, omega = (humans[..., columns] for columns in (_POSITION, _VELOCITY, _OMEGA))
    humans = np.concatenate((position, body[..., None], velocity, omega, gaze[..., None]), axis=2)
    if absent is not None:
        humans[absent] = 0.0
    require_finite(robot, ROBOT_NAMES, "the robot", tick=tick)
    require_finite(executed, COMMAND_NAMES, "the executed command", tick=tick)
    require_finite(humans, HUMAN_NAMES, "human", ids, tick)
    humans = rounded_rows(humans, HUMAN_ANGLES)
    if absent is not None:
        humans[absent] = np.nan
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


def _activity_of_present(value: tuple[IntArray, BoolArray | None]) -> IntArray:
    """Activities, `ABSENT` for pedestrians that are not present."""
    activity, is_present = value
    return activity if is_present is None else np.where(is_present, activity, ABSENT)


def _repeated(values: Sequence[Any], convert: Callable[[Any], Any], lengths: Sequence[int]) -> list[bytes]:
    """Serialise each value as often as its length; the same object as before, as most are, is not serialised again."""
    items: list[bytes] = []
    previous: Any = None
    item = b""
    for value, length in zip(values, lengths, strict=True):
        if previous is None or not _is_same(value, previous):
            previous, item = value, dumps(convert(value))
        items += [item] * length
    return items


def _is_same(value: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Whether two tuples are the same object, or have the same objects."""
    return value is other or (len(value) == len(other) and all(a is b for a, b in zip(value, other, strict=True)))
