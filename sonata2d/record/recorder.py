"""Observers that turn an episode into its document, and write it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from ..core.geometry import PRECISION, quantised
from ..core.humans import ACTIVITIES
from ..core.labels import LabelSpec
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Author, Frame, Outcome, Snapshot, Status
from ..errors import RecordError
from ..version import FORMAT, FORMAT_VERSION, PHYSICS_VERSION
from .canonical import plain, refuse_unfinite, rounded, written
from .files import packed, stem_of, write_atomically
from .frames import Act, Told, event_rows, frame_of, human_rows, looks_of, robot_rows
from .layout import ABSENT, COMMAND_NAMES, Tree, columns, layout_of, software


class EpisodeRecorder:
    """Notes one episode; `document()` is its file.

    A tick costs it a few copies; angles and rounding are done once, at the end, for the whole episode.

    Args:
        id: of the episode; by default scenario, seed and number.
        contributor: who drove or recorded.
        context: text for whoever judges the episode; by default the scenario's.
        branched_from: id and tick of the episode that this one shares its beginning with.
        label_spec: what a person is asked for.

    Attributes:
        label: of the whole run, where the person is asked for one; may be given until the document is written.
        scene: of the episode; None before it begins.
        outcome: None while it runs.
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
        self._author = Author("")
        self.outcome: Outcome | None = None
        self._last: Snapshot | None = None
        self._robot: list[tuple[float, ...]] = []  # one a look: place, heading, velocity, omega, executed twist
        self._people: list[Array] = []
        self._activity: list[Any] = []
        self._told: list[Told] = []
        self._acts: list[Act] = []  # one a frame

    def open(self, scene: Scene, author: Author) -> None:
        """The episode begins.

        Raises:
            RecordError: this recorder holds an episode already.
        """
        if self.scene is not None:
            raise RecordError(f"this recorder holds an episode of {self.scene.name} already; use one for each")
        self.scene, self._author = scene, author

    def note(self, frame: Frame) -> None:
        """One tick.

        Raises:
            RecordError: the label is nothing JSON can hold.
        """
        snapshot, command = frame.snapshot, frame.command
        label = None if frame.label is None else plain(frame.label, f"label at tick {snapshot.tick}")
        self._look(snapshot)
        self._acts.append(((command.vx, command.vy, command.omega), label, snapshot.events))

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """The episode is over. A frame after which the world did not move is no frame: its look is the last one."""
        self.outcome = outcome
        if self._told and self._told[-1][0] == last.tick:
            for rows in (self._robot, self._people, self._activity, self._told, self._acts):
                rows.pop()
        self._look(last)

    def document(self) -> bytes:
        """The whole file: JSON, a top-level key or a frame on each line.

        Raises:
            RecordError: the episode still runs, or holds what a file cannot.
        """
        scene, outcome = self.scene, self.outcome
        if scene is None or outcome is None:
            raise RecordError("there is no whole episode to write; run it to its end, or leave it by close()")
        frames, final = self._frames([human.id for human in scene.humans])
        return written({**self._head(scene, outcome), "frames": frames, "final": final, "software": software()})

    def _look(self, snapshot: Snapshot) -> None:
        """Copy what a snapshot shows."""
        robot, humans = snapshot.robot, snapshot.humans
        done = robot.executed
        self._robot.append(
            (*robot.position, *robot.direction, *robot.velocity, robot.omega, done.vx, done.vy, done.omega)
        )
        count = len(snapshot.scene.humans)
        self._people.append(humans.among_all(humans.state, count, 0.0))
        self._activity.append(humans.among_all(humans.activity_index, count, ABSENT))
        self._told.append((snapshot.tick, snapshot.time, robot.guarded, snapshot.interactions, snapshot.contacts))
        self._last = snapshot

    def _head(self, scene: Scene, outcome: Outcome) -> Tree:
        """What stands once, in the file's order."""
        author, branched = self._author, self._branched_from
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
            **layout_of(scene),
            "controller": {
                "path": author.path,
                "version": author.version,
                "settings": plain(author.settings, "settings of the controller", exact=True),
            },
            "labels": plain(author.labels, "meaning of the labels"),
            **self._asked(),
            "contributor": plain(self._contributor, "contributor"),
            "context": plain(self._context or (scene.settings or {}).get("context"), "context"),
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

    def _asked(self) -> Tree:
        """What a person was asked for, and what they answered of the whole run."""
        spec = self._label_spec
        asked = {"label_spec": plain(asdict(spec), "label")} if spec.kind != "command" else {}
        return asked | ({"label": plain(self.label, "label of the run")} if spec.per_run else {})

    def _frames(self, ids: list[int]) -> tuple[list[Tree], Tree]:
        """The frames, and the final look."""
        robot, executed = robot_rows(np.array(self._robot))
        activity = np.array(self._activity, dtype=np.int64).reshape(len(robot), -1)
        humans = human_rows(np.array(self._people), activity != ABSENT, ids)
        command = np.array([act[0] for act in self._acts], dtype=float).reshape(-1, 3)
        refuse_unfinite(command, COMMAND_NAMES, "the command")
        looks = looks_of(self._told, robot.tolist(), humans, activity)
        moves = zip(rounded(command).tolist(), executed[1:].tolist(), self._told[1:], self._acts, strict=True)
        frames = [frame_of(look, *move) for look, move in zip(looks[:-1], moves, strict=True)]
        events = self._last.events if self._last else ()
        final = looks[-1] | ({"events": event_rows(events, looks[-1]["tick"])} if events else {})
        return frames, final


class JsonRecorder(EpisodeRecorder):
    """Writes the episode to a file when it is over. As a context manager it loses nothing to an error.

    >>> with JsonRecorder("polite.json") as recorder:             # doctest: +SKIP
    ...     Episode(scene, Polite(), observers=[recorder]).run()

    Args:
        path: where to; `.json`, `.json.gz` or `.json.zst`. Folders are made.
        id: of the episode; by default the file's name without its suffix.
        contributor: who drove or recorded.
        context: text for whoever judges the episode; by default the scenario's.
        branched_from: id and tick of the episode that this one shares its beginning with.

    Raises:
        RecordError: the suffix is none of these.
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
        name = id or stem_of(self.path)
        super().__init__(id=name, contributor=contributor, context=context, branched_from=branched_from)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """The episode is over: write it.

        Raises:
            RecordError: it cannot be written.
        """
        super().close(last, outcome)
        write_atomically(self.path, packed(self.document(), self.path))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what there is of an episode that did not come to its end."""
        if self.outcome is None and self._last is not None:
            status: Status = "stopped"
            reason = "recording was left before the episode ended"
            if error is not None:
                status, reason = "error", f"{type(error).__name__}: {error}"
            self._close_early(self._last, Outcome(status, reason, self._last.tick, self._last.time), error)

    def _close_early(self, last: Snapshot, outcome: Outcome, error: BaseException | None) -> None:
        """Close; where that fails too, the first error stays the one that is raised."""
        try:
            self.close(last, outcome)
        except RecordError as failure:
            if error is None:
                raise
            error.add_note(f"and its episode is lost: {failure}")
