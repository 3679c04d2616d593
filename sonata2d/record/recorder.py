"""Observers that record an episode and write its file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from itertools import chain, repeat
from pathlib import Path
from tempfile import SpooledTemporaryFile
from types import TracebackType
from typing import IO, Any, Self
from weakref import finalize

import numpy as np
import orjson

from ..core.files.locations import location
from ..core.geometry import PRECISION, quantised
from ..core.labels import LabelSpec
from ..core.relations import activities_with
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Frames, Outcome, Snapshot, Status
from ..core.state import State
from ..core.wording import counted
from ..errors import RecordError
from ..version import FORMAT, PHYSICS_VERSION
from .canonical import Document, rounded, to_json_value
from .counts import merged_counts, run_counts
from .files import file_stem, write_document
from .frames import Answer, Command, Segment, frame_lines, never_entered, readings_json, segment_of
from .layout import JsonDict, columns, format_version, software_versions
from .record import EpisodeRecord, record_from_document
from .validate import consistent_scene

_SERIALISED_AT_ONCE = 256  # frames
_IN_MEMORY = 1 << 24  # bytes of JSON, beyond which frames are kept in a file


class EpisodeRecorder:
    """Recorder of one episode in memory; `record()` returns it, and `document()` the content of its file.

    A tick only keeps references; angles, rounding and JSON are computed for many ticks at once. The frames of a long
    episode go to a temporary file.

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
        self._cut: Segment | None = None  # the state of a tick that cannot be recorded
        # States that are not serialised yet, and the answers to all of them but the final one.
        self._segments: list[Segment] = []
        self._answers: list[Answer] = []
        self._frames: IO[bytes] | None = None  # JSON of the frames before
        self._count = 0  # of these frames
        self._counts: JsonDict | None = None
        self._has_been_present, self._was_everybody_present = np.zeros(0, dtype=bool), False  # of each person, of all

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
        self._has_been_present = np.zeros(len(scene.humans), dtype=bool)

    def on_frame(self, frame: Frame) -> None:
        """Record one tick.

        Raises:
            RecordError: JSON cannot represent the label, or a reading of a sensor.
        """
        snapshot, label, command = frame.snapshot, frame.label, frame.command
        if label is not None:
            label = to_json_value(label, f"label at tick {snapshot.tick}")
        others = tuple(
            ((twist.vx, twist.vy, twist.omega), to_json_value(its_label, f"label at tick {snapshot.tick}"))
            for twist, its_label in frame.others
        )
        readings = tuple(readings_json(each, snapshot.tick) for each in frame.readings)
        self._add(segment_of(snapshot), [((command.vx, command.vy, command.omega), label, others, readings)])

    def on_frames(self, frames: Frames) -> None:
        """Record many ticks.

        Raises:
            RecordError: JSON cannot represent a label, before which the recording ends, or a number of an earlier tick
                is not finite.
        """
        segment, commands = Segment.of(frames), frames.commands.tolist()
        labels = [None] * len(commands) if frames.labels is None else [*frames.labels]
        for n, label in enumerate(labels):
            try:
                labels[n] = None if label is None else to_json_value(label, f"label at tick {segment.tick + n}")
            except RecordError:
                self._cut = segment.part(n, n + 1)
                if n:
                    self._add(segment.part(0, n), _answers(commands[:n], labels[:n]))
                raise
        self._add(segment, _answers(commands, labels))

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """End the episode with its final state."""
        final = segment_of(last)
        if self._cut is not None:  # later ticks are not recorded
            final, outcome = self._cut, replace(outcome, tick=self._cut.tick, time=self._cut.times[0])
        self.outcome = outcome
        # the world did not move after a frame of the same tick: its command was not executed, and it is left out
        if self._segments and (segment := self._segments[-1]).tick + len(segment.rows) - 1 == final.tick:
            count = len(segment.rows) - 1
            self._segments[-1:] = [segment.part(0, count)] if count else []
            self._answers.pop()
        self._add(final, [])

    def document(self) -> bytes:
        """Return the content of the file: JSON, with each top-level key and each frame on a line of its own.

        Raises:
            RecordError: the episode has not ended, or contains a value that a file cannot represent.
        """
        return b"".join(self.complete().parts())

    def complete(self) -> Document:
        """The content of the file in parts; as `document`, but the frames of a long episode stay in a temporary file.

        Raises:
            RecordError: as for `document`.
        """
        scene, outcome = self.scene, self.outcome
        if scene is None or outcome is None:
            raise RecordError("the episode is not complete; run it to its end, or call close()")
        ids, doors = scene.human_table.id.tolist(), len(scene.moving_doors)
        frames, final = frame_lines(self._segments, self._answers, ids, doors)
        ends = {**self._header(scene, outcome), "frames": [], "final": final, "software": software_versions()}
        return Document.of(ends, self._frames if self._count else None, frames)

    def record(self) -> EpisodeRecord:
        """The recorded episode, as `read_episode` returns it from a file; there is no file at its path.

        Raises:
            RecordError: as for `document`.
        """
        document = orjson.loads(self.document())
        return record_from_document(document, Path(f"{document['id']}.json"))

    def __repr__(self) -> str:
        frames = counted(self._count + len(self._answers), "frame")
        content = "empty" if self.scene is None else f"{self.scene.family}, {frames}"
        ended = f", {self.outcome.status}" if self.outcome else ""
        name = type(self).__name__ + (f" {self.id}" if self.id else "")
        return f"<{name}: {content}{ended}>"

    def counts(self) -> JsonDict:
        """Return the contacts, and the commands beyond the limits, of all robots, as a manifest holds them.

        Raises:
            RecordError: the episode has not begun.
        """
        if self.scene is None:
            raise RecordError("the episode has not begun")
        counts = self._counts_of(self.scene, self._segments, self._answers)
        return merged_counts(self._counts, counts) if self._counts else counts

    @staticmethod
    def _counts_of(scene: Scene, segments: Sequence[Segment], answers: Sequence[Answer]) -> JsonDict:
        """Counts of some states and answers."""
        robots = [robot for robot, _ in scene.tasks]
        commands = np.array([[answer[0], *(other for other, _ in answer[2])] for answer in answers], dtype=float)
        touching = (segment for segment in segments if segment.contacts or segment.contacts_of_robots)
        contacts = chain.from_iterable(
            repeat((*segment.contacts, *chain(*segment.contacts_of_robots)), len(segment.rows)) for segment in touching
        )
        return run_counts(robots, contacts, rounded(commands.reshape(-1, len(robots), 3)).swapaxes(0, 1))

    def _last_snapshot(self) -> Snapshot:
        """The last state that was recorded."""
        assert self.scene is not None
        last = self._segments[-1]
        state = State(last.rows[-1], last.activity, last.is_present, len(self.scene.moving_doors))
        tick = last.tick + len(last.rows) - 1
        return Snapshot.of_state(
            tick, self.scene, state, last.interactions, last.contacts, last.events, last.contacts_of_robots
        )

    def _add(self, segment: Segment, answers: list[Answer]) -> None:
        """Add states and the answers to them."""
        if segment.is_present is not None:
            self._has_been_present |= segment.is_present
        elif not self._was_everybody_present:
            self._has_been_present[:] = self._was_everybody_present = True
        self._segments.append(segment)
        self._answers += answers
        if len(self._answers) - len(answers) >= _SERIALISED_AT_ONCE:
            self._serialise(len(answers))

    def _serialise(self, left: int) -> None:
        """Serialise all frames except those of the last segment.

        What the last one of these frames executed is part of the first state of that segment.

        Args:
            left: number of answers that belong to the last segment.

        Raises:
            RecordError: a number is not finite, or the temporary file cannot be written; all frames stay in memory.
        """
        assert self.scene is not None
        count, last = len(self._answers) - left, self._segments[-1]
        segments, answers = [*self._segments[:-1], last.part(0, 1)], self._answers[:count]
        ids, doors = self.scene.human_table.id.tolist(), len(self.scene.moving_doors)
        lines, _ = frame_lines(segments, answers, ids, doors)
        counts = self._counts_of(self.scene, self._segments[:-1], answers)
        if self._frames is None:
            self._frames = SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115  # it lives as long as the recorder
            finalize(self, self._frames.close)
        size = self._frames.seek(0, os.SEEK_END)
        try:
            self._frames.write((b",\n" if size else b"") + b",\n".join(lines))
        except OSError as error:
            with suppress(OSError):
                self._frames.truncate(size)
            raise RecordError(f"frames cannot be kept in a temporary file: {error.strerror or error}") from error
        self._counts = merged_counts(self._counts, counts) if self._counts else counts
        self._count, self._segments, self._answers = self._count + count, [last], self._answers[count:]

    def _header(self, scene: Scene, outcome: Outcome) -> JsonDict:
        """Return the keys before the frames, in the file's order."""
        missing = never_entered(scene.humans, self._has_been_present, outcome.tick)
        controller_info, branched, spec = self._controller_info, self._branched_from, self._label_spec
        # the label that the driver was asked for, and the label of the whole run
        label_keys = {"label_spec": to_json_value(asdict(spec), "label")} if spec.kind != "command" else {}
        label_keys |= {"label": to_json_value(self.label, "label of the run")} if spec.per_run else {}
        robots = {}
        if scene.robots:
            infos = zip(self._scene_json["robots"], controller_info.others, strict=True)
            robots = {"robots": [other | _controller_keys(info) for other, info in infos]}
        return {
            "format": FORMAT,
            "version": format_version(scene),
            "id": self.id or f"{scene.name}-{scene.seed}-{scene.episode}",
            "name": scene.name,
            "family": scene.family,
            "seed": scene.seed,
            "episode": scene.episode,
            "physics": PHYSICS_VERSION,
            "precision": PRECISION,
            **self._scene_json,
            **robots,
            **_controller_keys(controller_info),
            **label_keys,
            "contributor": to_json_value(self._contributor, "contributor"),
            "context": to_json_value(self._context or (scene.settings or {}).get("context"), "context"),
            "branched_from": branched and {"id": branched[0], "tick": branched[1]},
            "columns": columns(),
            "activities": activities_with(i.relation for i in scene.interactions),
            "outcome": {
                "status": outcome.status,
                "reason": outcome.reason.encode(errors="replace").decode(),
                "tick": outcome.tick,
                "time": quantised(outcome.time),
                **({"arrivals": outcome.arrivals} if scene.robots else {}),
            },
            **({"never_entered": missing} if missing else {}),
        }


def _answers(commands: list[Command], labels: list[Any]) -> list[Answer]:
    """The answers of one robot without recorded sensors."""
    return [(command, label, (), ()) for command, label in zip(commands, labels, strict=True)]


def _controller_keys(info: ControllerInfo) -> JsonDict:
    """The keys of a robot's controller and its recorded sensors."""
    return {
        "controller": {
            "path": info.path,
            "version": info.version,
            "settings": to_json_value(info.settings, "settings of the controller", exact=True),
        },
        "labels": to_json_value(info.labels, "meaning of the labels"),
        **({"sensors": to_json_value(info.sensors, "settings of the sensors", exact=True)} if info.sensors else {}),
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
        write_document(self.path, self.complete())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the frames of an episode that has not ended, with the outcome stopped or error."""
        if self.outcome is None and self._segments:
            status: Status = "stopped"
            reason = "recording was left before the episode ended"
            if error is not None:
                status, reason = "error", f"{type(error).__name__}: {error}"
            try:
                last = self._last_snapshot()
                self.close(last, Outcome(status, reason, last.tick, last.time))
            except RecordError as failure:
                if error is None:
                    raise
                error.add_note(f"and its episode could not be written: {failure}")  # the first error is raised
