"""Observers that record an episode and write its file."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import orjson

from ..core.files.locations import location
from ..core.geometry import PRECISION, quantised
from ..core.labels import LabelSpec
from ..core.relations import ACTIVITIES
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Outcome, Snapshot, Status
from ..core.wording import counted
from ..errors import RecordError
from ..version import FORMAT, FORMAT_VERSION, PHYSICS_VERSION
from .canonical import rounded, serialise, to_json_value
from .counts import run_counts
from .files import compress, file_stem, write_atomically
from .frames import Answer, Observation, frame_lines, never_entered, observation, presence
from .layout import JsonDict, columns, software_versions
from .reader import record_from_document
from .record import EpisodeRecord
from .validate import consistent_scene


class EpisodeRecorder:
    """Recorder of one episode in memory; `record()` returns it, and `document()` the content of its file.

    A tick only keeps references; angles, rounding and JSON are computed at the end for the whole episode.

    Args:
        id: of the episode; default: name of the scenario, seed and episode number.
        contributor: name of the person who drives or records.
        context: text for the raters of the episode; default: the text of the scenario.
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
        >>> recorder.record().outcome.status
        'goal'
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
        self._scene_json: JsonDict = {}
        self._controller_info = ControllerInfo("")
        self.outcome: Outcome | None = None
        self._last: Snapshot | None = None
        self._observations: list[Observation] = []
        self._answers: list[Answer] = []  # one item for each frame

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        """Begin the episode.

        Raises:
            RecordError: this recorder has recorded an episode already, or a file of this scene could not be read.
        """
        if self.scene is not None:
            raise RecordError(
                f"this recorder already holds an episode of {self.scene.name}; use a new recorder for each episode"
            )
        self._scene_json = consistent_scene(scene)  # before the run, not after it
        self.scene, self._controller_info = scene, controller_info

    def on_frame(self, frame: Frame) -> None:
        """Record one tick.

        Raises:
            RecordError: JSON cannot represent the label.
        """
        snapshot, label = frame.snapshot, frame.label
        if label is not None:
            label = to_json_value(label, f"label at tick {snapshot.tick}")
        self._add(snapshot)
        self._answers.append((frame.command, label))

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """End the episode with its final state."""
        self.outcome = outcome
        # the world did not move after a frame of the same tick: its command was not executed, and it is left out
        if self._last is not None and self._last.tick == last.tick:
            self._observations.pop()
            self._answers.pop()
        self._add(last)

    def document(self) -> bytes:
        """Return the content of the file: JSON, with each top-level key and each frame on a line of its own.

        Raises:
            RecordError: the episode has not ended, or contains a value that a file cannot represent.
        """
        scene, outcome = self.scene, self.outcome
        if scene is None or outcome is None:
            raise RecordError("the episode is not complete; run it to its end, or call close()")
        frames, final = frame_lines(self._observations, self._answers, scene.human_table.id.tolist())
        header = self._header(scene, outcome)
        return serialise({**header, "frames": frames, "final": final, "software": software_versions()})

    def record(self) -> EpisodeRecord:
        """The recorded episode, as `read_episode` returns it from a file; there is no file at its path.

        Raises:
            RecordError: as for `document`.
        """
        document = orjson.loads(self.document())
        return record_from_document(document, Path(f"{document['id']}.json"))

    def __repr__(self) -> str:
        content = "empty" if self.scene is None else f"{self.scene.family}, {counted(len(self._answers), 'frame')}"
        ended = f", {self.outcome.status}" if self.outcome else ""
        name = type(self).__name__ + (f" {self.id}" if self.id else "")
        return f"<{name}: {content}{ended}>"

    def counts(self) -> JsonDict:
        """Return the contacts, and the commands beyond the robot's limits, as a manifest holds them.

        Raises:
            RecordError: the episode has not begun.
        """
        if self.scene is None:
            raise RecordError("the episode has not begun")
        commands = np.array([(twist.vx, twist.vy, twist.omega) for twist, _ in self._answers], dtype=float)
        contacts = (contacts for _, _, _, _, contacts, _ in self._observations)
        return run_counts(self.scene.robot, contacts, rounded(commands.reshape(-1, 3)))

    def _add(self, snapshot: Snapshot) -> None:
        self._observations.append(observation(snapshot))
        self._last = snapshot

    def _header(self, scene: Scene, outcome: Outcome) -> JsonDict:
        """Return the keys before the frames, in the file's order."""
        missing = never_entered(scene.humans, presence(self._observations, len(scene.humans)), outcome.tick)
        controller_info, branched, spec = self._controller_info, self._branched_from, self._label_spec
        # the label that the driver was asked for, and the label of the whole run
        label_keys = {"label_spec": to_json_value(asdict(spec), "label")} if spec.kind != "command" else {}
        label_keys |= {"label": to_json_value(self.label, "label of the run")} if spec.per_run else {}
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
            **self._scene_json,
            "controller": {
                "path": controller_info.path,
                "version": controller_info.version,
                "settings": to_json_value(controller_info.settings, "settings of the controller", exact=True),
            },
            "labels": to_json_value(controller_info.labels, "meaning of the labels"),
            **label_keys,
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
            **({"never_entered": missing} if missing else {}),
        }


class JsonRecorder(EpisodeRecorder):
    """Recorder of one episode, whose file it writes at the end.

    As a context manager it also writes the file if an exception ends the episode early.

    >>> import sonata2d as s2
    >>> scene = s2.generate(s2.load_scenario("empty"), seed=1)
    >>> with s2.JsonRecorder("polite.json") as recorder:
    ...     outcome = s2.Episode(scene, s2.StraightToGoal(), observers=[recorder]).run()

    Args:
        path: of the file; ends in `.json`, `.json.gz` or `.json.zst`. Missing folders are created.
        id: of the episode; default: the file's name without its suffix.
        contributor: name of the person who drives or records.
        context: text for the raters of the episode; default: the text of the scenario.
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
        self.path = location(path)
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
            try:
                self.close(self._last, Outcome(status, reason, self._last.tick, self._last.time))
            except RecordError as failure:
                if error is None:
                    raise
                error.add_note(f"and its episode could not be written: {failure}")  # the first error is raised
