"""Observers that record an episode and write its file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from ..core.devices import DeviceEvent
from ..core.entities import Interaction
from ..core.geometry import PRECISION, quantised
from ..core.humans import ACTIVITIES, BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ..core.labels import LabelSpec
from ..core.portable_math import Array, BoolArray, IntArray, arctan2
from ..core.scene import Scene
from ..core.snapshot import Contact, ControllerInfo, Frame, Outcome, Snapshot, Status
from ..errors import RecordError
from ..version import FORMAT, FORMAT_VERSION, PHYSICS_VERSION
from .canonical import require_finite, rounded, rounded_rows, serialise, to_json_value
from .files import compress, file_stem, write_atomically
from .layout import (
    ABSENT,
    COMMAND_NAMES,
    HUMAN_ANGLES,
    HUMAN_NAMES,
    ROBOT_ANGLES,
    ROBOT_NAMES,
    JsonDict,
    columns,
    interaction_rows,
    scene_to_json,
    software_versions,
)

# of a state: tick, time, interactions, contacts
_Observation = tuple[int, float, tuple[Interaction, ...], tuple[Contact, ...]]
# of a frame: command, label, device events
_Answer = tuple[tuple[float, float, float], Any, tuple[DeviceEvent, ...]]


class EpisodeRecorder:
    """Records one episode in memory; `document()` returns the content of its file.

    A tick only copies a few arrays; angles and rounding are computed at the end for the whole episode.

    Args:
        id: of the episode; default: name of the scenario, seed and episode number.
        contributor: name of the person who drives or records.
        context: text for the raters of the episode; default: that of the scenario.
        branched_from: id and tick of the episode with which this one shares its first frames.
        label_spec: the label that the driver is asked for.

    Attributes:
        id: of the episode, or None for the default; may be set until the document is created.
        label: label of the whole run, if the driver is asked for one; may be set until the document is created.
        scene: of the episode; None before it begins.
        outcome: of the episode; None while it runs.

    Example:
        >>> import sonata2d as s2
        >>> recorder, scene = s2.EpisodeRecorder(), s2.generate(s2.load_scenario("empty"), seed=1)
        >>> s2.Episode(scene, s2.StraightToGoal(), observers=[recorder]).run().status
        'goal'
        >>> b'"format":"sonata2d-episode"' in recorder.document()
        True
    """

    def __init__(
        self,
        *,
        id: str | None = None,
        contributor: str | None = None,
        context: str | None = None,
        branched_from: tuple[str, int] | None = None,
        label_spec: LabelSpec | None = None,
    ) -> None:
        self.label: Any = None
        self._label_spec = label_spec or LabelSpec()
        self.id, self._contributor, self._context, self._branched_from = id, contributor, context, branched_from
        self.scene: Scene | None = None
        self._controller_info = ControllerInfo("")
        self.outcome: Outcome | None = None
        self._last: Snapshot | None = None
        # one item for each state; a row of the robot: position, direction, velocity, omega, executed twist
        self._robot: list[tuple[float, ...]] = []
        self._humans: list[Array] = []
        self._activity: list[IntArray] = []
        self._guarded: list[bool] = []
        self._observations: list[_Observation] = []
        self._answers: list[_Answer] = []  # one item for each frame

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        """Begin the episode.

        Raises:
            RecordError: this recorder has recorded an episode already.
        """
        if self.scene is not None:
            raise RecordError(
                f"this recorder already holds an episode of {self.scene.name}; use a new recorder for each episode"
            )
        self.scene, self._controller_info = scene, controller_info

    def note(self, frame: Frame) -> None:
        """Record one tick.

        Raises:
            RecordError: JSON cannot represent the label.
        """
        snapshot, command = frame.snapshot, frame.command
        label = None if frame.label is None else to_json_value(frame.label, f"label at tick {snapshot.tick}")
        self._add_state(snapshot)
        self._answers.append(((command.vx, command.vy, command.omega), label, snapshot.events))

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """End the episode with its final state."""
        self.outcome = outcome
        # the world did not move after a frame of the same tick: its command was not executed, and it is left out
        if self._last is not None and self._last.tick == last.tick:
            for rows in (self._robot, self._humans, self._activity, self._guarded, self._observations, self._answers):
                rows.pop()
        self._add_state(last)

    def document(self) -> bytes:
        """Return the content of the file: JSON, with each top-level key and each frame on a line of its own.

        Raises:
            RecordError: the episode has not ended, or contains a value that a file cannot represent.
        """
        scene, outcome = self.scene, self.outcome
        if scene is None or outcome is None:
            raise RecordError("the episode is not complete; run it to its end, or call close()")
        frames, final = self._frames([human.id for human in scene.humans])
        return serialise(
            {**self._header(scene, outcome), "frames": frames, "final": final, "software": software_versions()}
        )

    def _add_state(self, snapshot: Snapshot) -> None:
        """Copy the state of the world; its arrays may change later."""
        robot, humans = snapshot.robot, snapshot.humans
        twist = robot.executed
        self._robot.append(
            (*robot.position, *robot.direction, *robot.velocity, robot.omega, twist.vx, twist.vy, twist.omega)
        )
        count = len(snapshot.scene.humans)
        self._humans.append(humans.expand(humans.state, count, 0.0))
        self._activity.append(humans.expand(humans.activity_index, count, ABSENT))
        self._guarded.append(robot.guarded)
        self._observations.append((snapshot.tick, snapshot.time, snapshot.interactions, snapshot.contacts))
        self._last = snapshot

    def _header(self, scene: Scene, outcome: Outcome) -> JsonDict:
        """Return the keys before the frames, in the file's order."""
        controller_info, branched = self._controller_info, self._branched_from
        return {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "id": self.id or f"{scene.name}-{scene.seed}-{scene.episode}",
            "name": scene.name,
            "family": scene.family,
            "seed": scene.seed,
            "episode": scene.episode,
            "physics": PHYSICS_VERSION,
            "precision": PRECISION,
            **scene_to_json(scene),
            "controller": {
                "path": controller_info.path,
                "version": controller_info.version,
                "settings": to_json_value(controller_info.settings, "settings of the controller", exact=True),
            },
            "labels": to_json_value(controller_info.labels, "meaning of the labels"),
            **self._label_keys(),
            "contributor": to_json_value(self._contributor, "contributor"),
            "context": to_json_value(self._context or (scene.settings or {}).get("context"), "context"),
            "branched_from": branched and {"id": branched[0], "tick": branched[1]},
            "columns": columns(),
            "activities": ACTIVITIES,
            "outcome": {
                "status": outcome.status,
                "reason": outcome.reason.encode(errors="replace").decode(),
                "tick": outcome.tick,
                "time": quantised(outcome.time),
            },
        }

    def _label_keys(self) -> JsonDict:
        """Return the keys with the label that the driver was asked for, and with the label of the whole run."""
        spec = self._label_spec
        keys = {"label_spec": to_json_value(asdict(spec), "label")} if spec.kind != "command" else {}
        return keys | ({"label": to_json_value(self.label, "label of the run")} if spec.per_run else {})

    def _frames(self, ids: list[int]) -> tuple[list[JsonDict], JsonDict]:
        """Return the frames, and the final state."""
        robot, executed = _robot_rows(np.array(self._robot))
        activity = np.array(self._activity, dtype=np.int64).reshape(len(robot), -1)
        humans = _human_rows(np.array(self._humans), activity != ABSENT, ids)
        command = np.array([command for command, _, _ in self._answers], dtype=float).reshape(-1, 3)
        require_finite(command, COMMAND_NAMES, "the command")
        states = _states(self._observations, robot.tolist(), humans, activity)
        # what was executed after a frame is part of the next state
        actions = zip(rounded(command).tolist(), executed[1:].tolist(), self._guarded[1:], self._answers, strict=True)
        frames = [_frame(state, *action) for state, action in zip(states[:-1], actions, strict=True)]
        events = self._last.events if self._last else ()
        final = states[-1] | ({"events": _event_rows(events, states[-1]["tick"])} if events else {})
        return frames, final


class JsonRecorder(EpisodeRecorder):
    """Records one episode and writes its file at the end.

    As a context manager it also writes the file if an exception ends the episode early.

    >>> import sonata2d as s2
    >>> scene = s2.generate(s2.load_scenario("empty"), seed=1)
    >>> with s2.JsonRecorder("polite.json") as recorder:
    ...     outcome = s2.Episode(scene, s2.StraightToGoal(), observers=[recorder]).run()

    Args:
        path: of the file; ends in `.json`, `.json.gz` or `.json.zst`. Missing folders are created.
        id: of the episode; default: the file's name without its suffix.
        contributor: name of the person who drives or records.
        context: text for the raters of the episode; default: that of the scenario.
        branched_from: id and tick of the episode with which this one shares its first frames.

    Raises:
        RecordError: the path has none of these suffixes.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        id: str | None = None,
        contributor: str | None = None,
        context: str | None = None,
        branched_from: tuple[str, int] | None = None,
    ) -> None:
        self.path = Path(path)
        name = id or file_stem(self.path)
        super().__init__(id=name, contributor=contributor, context=context, branched_from=branched_from)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """End the episode, and write the file.

        Raises:
            RecordError: the file cannot be written.
        """
        super().close(last, outcome)
        write_atomically(self.path, compress(self.document(), self.path))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the frames of an episode that has not ended, with the outcome stopped or error."""
        if self.outcome is None and self._last is not None:
            status: Status = "stopped"
            reason = "recording was left before the episode ended"
            if error is not None:
                status, reason = "error", f"{type(error).__name__}: {error}"
            self._close_early(self._last, Outcome(status, reason, self._last.tick, self._last.time), error)

    def _close_early(self, last: Snapshot, outcome: Outcome, error: BaseException | None) -> None:
        """Close; if that fails, `error` stays the exception that is raised, with a note about the failure."""
        try:
            self.close(last, outcome)
        except RecordError as failure:
            if error is None:
                raise
            error.add_note(f"and its episode could not be written: {failure}")


# Frames from recorded states


def _robot_rows(states: Array) -> tuple[Array, Array]:
    """Convert the recorded rows of the robot.

    Args:
        states: (T, 10), columns x, y, direction (2), vx, vy, omega, executed twist (3).

    Returns:
        Rows of the file (T, 6), and executed twists (T, 3); rounded.
    """
    x, y, direction_x, direction_y, vx, vy, omega = states[:, :7].T
    executed = states[:, 7:]
    robot = np.stack((x, y, arctan2(direction_y, direction_x), vx, vy, omega), axis=1)
    require_finite(robot, ROBOT_NAMES, "the robot")
    require_finite(executed, COMMAND_NAMES, "the executed command")
    return rounded_rows(robot, ROBOT_ANGLES), rounded(executed)


def _human_rows(states: Array, present: BoolArray, ids: list[int]) -> list[Any]:
    """Convert the recorded rows of the humans.

    Args:
        states: (T, N, 9), columns as in `Humans.state`.
        present: (T, N) of bool.
        ids: of the N humans.

    Returns:
        Rows of the file for each of the T states, rounded: an (N, 7) array, or a list with None for absent humans.
    """
    s = states.reshape(len(states), len(ids), 9)
    theta, head = arctan2(s[..., BODY_Y], s[..., BODY_X]), arctan2(s[..., GAZE_Y], s[..., GAZE_X])
    rows = np.stack((s[..., X], s[..., Y], theta, s[..., VX], s[..., VY], s[..., OMEGA], head), axis=-1)
    require_finite(np.where(present[..., None], rows, 0.0), HUMAN_NAMES, "human", ids)
    rows = rounded_rows(rows, HUMAN_ANGLES)
    if present.all():
        return list(rows)
    pairs = (zip(row.tolist(), mask.tolist(), strict=True) for row, mask in zip(rows, present, strict=True))
    return [[row if is_present else None for row, is_present in pair] for pair in pairs]


def _states(
    observations: list[_Observation], robot: list[list[float]], humans: list[Any], activity: IntArray
) -> list[JsonDict]:
    """Return the JSON of all states, without commands."""
    states: list[JsonDict] = []
    previous, rows = None, []
    for (tick, time, interactions, contacts), robot_row, human_rows, activities in zip(
        observations, robot, humans, activity, strict=True
    ):
        if interactions is not previous:  # interactions change seldom, so that their rows are shared between states
            previous, rows = interactions, interaction_rows(interactions)
        states.append(
            {
                "tick": tick,
                "time": quantised(time),
                "robot": robot_row,
                "humans": human_rows,
                "activity": activities,
                "interactions": rows,
                "contacts": [asdict(contact) for contact in contacts],
            }
        )
    return states


def _frame(state: JsonDict, command: list[float], executed: list[float], guarded: bool, answer: _Answer) -> JsonDict:
    """Combine a state with the controller's answer and its result, in the file's order of keys."""
    _, label, events = answer
    frame = {
        "tick": state["tick"],
        "time": state["time"],
        "robot": state["robot"],
        "command": command,
        "executed": executed,
        "guarded": guarded,
        "humans": state["humans"],
        "activity": state["activity"],
        "interactions": state["interactions"],
        "contacts": state["contacts"],
        "events": _event_rows(events, state["tick"]),
    }
    return frame if label is None else frame | {"label": label}


def _event_rows(events: tuple[DeviceEvent, ...], tick: int) -> list[JsonDict]:
    location = f"device event at tick {tick}"
    return [
        {"device": e.device, "control": e.control, "value": to_json_value(float(e.value), location)} for e in events
    ]
