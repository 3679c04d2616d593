"""A data-collection session of one driver: run after run, kept or discarded, with crash recovery; without a window."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from ..agents.controllers.teleoperation import DEFAULT_MAPPINGS, STOP, DeviceMapping, Teleoperation
from ..core.devices import NETWORK_DEVICE, DeviceEvent
from ..core.geometry import Point, Twist
from ..core.labels import LABEL_DEVICE, LabelSpec
from ..core.navigation import FreeSpace
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Outcome, Snapshot
from ..errors import RecordError, SceneError, Sonata2dError
from ..record.reader import read_episode
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.driver import controller_info_of
from ..sim.episode import Episode
from ..sim.inputs import TickInput
from ..version import PHYSICS_VERSION
from .collection import Collection
from .journal import UNDONE, Journal, OpenRun, read_journal

logger = logging.getLogger(__name__)

State = Literal["waiting", "driving", "paused", "ended"]
Schedule = Callable[[Mapping[int, str]], tuple[ScenarioConfig, int]]
"""Chooses the next scene: from the file names of the kept runs, by number of their scene, its settings and number."""
_MAXIMUM_SCENE_ATTEMPTS = 20  # consecutive scenes that cannot be generated before it is an error


def warm_up(scene: Scene) -> None:
    """Compile or load what the simulation of a scene needs, so that a driver does not wait for it.

    After an installation this takes up to a minute; otherwise it takes some milliseconds.
    """
    FreeSpace(scene.outline, scene.barriers, scene.robot.radius).warm_up()  # some of its kernels are used rarely
    episode = Episode(scene, Teleoperation(), observers=[EpisodeRecorder()])
    for _ in range(2):  # the second one has a past
        episode.step()


class _Way:
    """An observer that measures the way of the robot, m."""

    def __init__(self) -> None:
        self.length = 0.0
        self._last: Point | None = None

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None: ...

    def on_frame(self, frame: Frame) -> None:
        self._go_to(frame.snapshot.robot.pose.position)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        self._go_to(last.robot.pose.position)

    def _go_to(self, place: Point) -> None:
        if self._last is not None:
            self.length += math.dist(self._last, place)
        self._last = place


class Session:
    """Collects runs of one contributor in one folder.

    A run waits for the first tick (`waiting`); each `tick` advances it (`driving`) until it ends (`ended`). `keep`
    stores the run, `redo` and `next` discard it; all three begin another one. Without a schedule, every contributor
    gets the same scenes in the same order and continues after the last one kept or discarded.

    Args:
        out: folder of the runs.
        contributor: name of the driver.
        config: settings of the scenes and of the label.
        seed: seed of the scenes.
        mappings: device mappings by kind of device.
        suffix: `.json`, `.json.gz` or `.json.zst`.
        schedule: chooses the scenes; by default they are consecutive.
        now: clock for file names and the log.

    Attributes:
        state: `waiting` for the first tick, `driving`, `paused` during the run, or `ended`.
        scene: scene of the present run.
        before, after: the last two snapshots, for interpolation; identical while the world stands still.
        outcome: outcome of the present run; None until it ends.
        dropped_ticks: ticks of real time that the client was too slow for, in the present run.
        recovered: duration in s of an open run that was recovered; None if there was none.
        undone_label: label of the run that was taken back last.
        number_of_runs: number of runs that this session has begun or taken up again, the present one included.
        notice: message for the driver about an open run or a scene that failed; empty if there is none.

    Raises:
        ConfigError: the contributor's name is not usable.
        RecordError: the folder cannot be used, or another window of this contributor uses it.
        SceneError: no scene can be generated.
    """

    state: State
    _first_events: tuple[DeviceEvent, ...]  # precede the device events of the next tick

    def __init__(
        self,
        out: str | Path,
        contributor: str,
        config: ScenarioConfig,
        *,
        seed: int = 0,
        mappings: Mapping[str, DeviceMapping] = DEFAULT_MAPPINGS,
        suffix: str = ".json",
        schedule: Schedule | None = None,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.config, self.seed, self._mappings, self._now = config, seed, dict(mappings), now
        self._collection = Collection(Path(out), contributor, config.settings(), suffix)
        self._journal, self._schedule = Journal(self._collection.journal), schedule
        self.recovered: float | None = None
        self.notice = ""
        self.undone_label: Any = None
        self._kept_dropped: dict[str, int] = {}  # dropped ticks of the runs that this session has kept
        self.number_of_runs = 0
        try:
            if not self._recover():
                number = None if schedule else self._collection.next_number(seed)
                self._begin(*self._next_scene(number, config))
        except BaseException:
            self._collection.close()  # so that the caller can try again
            raise
        self._log("begun", scenario=config.name, seed=seed, recovered=self.recovered)

    @property
    def contributor(self) -> str:
        """Name of the driver."""
        return self._collection.contributor

    @property
    def kept(self) -> int:
        """Number of this contributor's runs in the folder."""
        return self._collection.kept

    @property
    def kept_runs(self) -> Mapping[int, str]:
        """File names of this contributor's runs in the folder, by number of the scene."""
        return self._collection.kept_runs(self.seed)

    @property
    def can_undo(self) -> bool:
        """Whether `undo` can take back a run."""
        return not self.ticks and self._collection.can_undo

    @property
    def mappings(self) -> Mapping[str, DeviceMapping]:
        """Device mappings of the present run."""
        return self._controller.mappings

    @property
    def beginning(self) -> dict[str, Any]:
        """Settings, seed and number of the scene, and the controller, from which others can simulate the same run."""
        scene = self.scene
        header = {"settings": scene.settings, "seed": scene.seed, "episode": scene.episode}
        return header | {"controller": self._controller.settings()}

    @property
    def past_events(self) -> list[tuple[DeviceEvent, ...]]:
        """Device events of each tick of the present run."""
        return [tick.events for tick in self._episode.past]

    @property
    def path_length(self) -> float:
        """Way of the robot in the present run so far, m."""
        return self._way.length

    @property
    def waiting_events(self) -> tuple[DeviceEvent, ...]:
        """Device events that the next tick gets before those of its client: released controls, and a label."""
        return self._first_events

    @property
    def label_spec(self) -> LabelSpec:
        """Label that the present run asks for."""
        return self._run_config.label

    @property
    def ticks(self) -> int:
        """Number of ticks of the present run."""
        return len(self._episode.past)

    @property
    def label(self) -> Any:
        """Label of the next frame, if every frame has one; None before the first answer."""
        spec = self.label_spec
        if not spec.per_frame:
            return None
        # After a recovery the last label is still waiting to be applied.
        waiting = [event.value for event in self._first_events if event.device == LABEL_DEVICE]
        return spec.label_at(waiting[-1]) if waiting else self._controller.label(self.after, Twist())[spec.name]

    @property
    def journal_error(self) -> str | None:
        """Why the journal cannot be written at present; None if it can."""
        return self._journal.failure

    def tick(self, events: Sequence[DeviceEvent] = ()) -> None:
        """Advance the run by one control tick; the first tick begins it.

        Args:
            events: device events since the last tick.
        """
        if self.state == "ended":
            return
        first_events, self._first_events = self._first_events, ()
        self._journal.dropped_ticks = self.dropped_ticks
        frame = self._episode.step((*first_events, *events))
        if frame is None:
            self._stand_still("ended")
        else:
            self.state, self.before, self.after = "driving", frame.snapshot, self._episode.snapshot()

    def pause(self) -> None:
        """Stand still until the next tick."""
        if self.state == "driving":
            self._stand_still("paused")

    def release(self) -> None:
        """Set all controls to zero with the next tick, because their devices are gone, as when a page is closed."""
        if self.state == "ended":
            return
        events = (*self._controller.pressed, *self._first_events)
        released = {(event.device, event.control) for event in events if event.device != LABEL_DEVICE}
        labels = tuple(event for event in self._first_events if event.device == LABEL_DEVICE)
        self._first_events = (*labels, *(DeviceEvent(*key, 0.0) for key in sorted(released)))

    @property
    def has_arrived(self) -> bool:
        """Whether the robot has reached its goal; among other robots the run goes on until they have too."""
        return self._episode.arrivals[0] is not None

    def stop(self) -> None:
        """End a run that has begun, on request of the driver."""
        if self.ticks:
            self.tick((STOP,))

    def set_mappings(self, mappings: Mapping[str, DeviceMapping]) -> None:
        """Change the device mappings: for this run if it has not begun, otherwise from the next run on."""
        if mappings == self._mappings:
            return
        self._mappings = dict(mappings)
        if self.state == "waiting":
            self._begin(self.scene, self._run_config)

    def keep(self, label: Any = None) -> Path:
        """Write the run that ended, and begin one in the next scene.

        Args:
            label: label of the run, if the scenario asks for one.

        Returns:
            The path of the file.

        Raises:
            RecordError: the file cannot be written; nothing is lost, and the call can be repeated.
            ValueError: the run has not ended, or the label does not fit the scenario.
        """
        if self.state != "ended":
            raise ValueError("the run has not ended; stop it before keeping it")
        self._recorder.label = self.label_spec.validate(label) if self.label_spec.per_run else None
        path = self._collection.keep(self._recorder, self._now(), self._journal.announce)
        self._kept_dropped[path.name] = self.dropped_ticks
        self._put_away("kept", path)
        try:
            self._begin(*self._next_scene(self._following(), self.config))
        except SceneError as error:
            self._begin(self.scene, self._run_config)
            self.notice = f"The same scene again: {error}"
        return path

    def redo(self, reason: str = "driven again") -> Path | None:
        """Begin the same scene again; a run that has begun is discarded.

        Args:
            reason: written to the log.

        Returns:
            The path of the discarded run; None if the run had not begun.

        Raises:
            RecordError: the file cannot be written; the run stays, ended.
        """
        path = self._discard(reason)
        self._begin(self.scene, self._run_config)
        return path

    def next(self, config: ScenarioConfig | None = None, reason: str = "another scene") -> Path | None:
        """Begin the next scene; a run that has begun is discarded.

        Args:
            config: new settings, from this scene on.
            reason: written to the log.

        Returns:
            The path of the discarded run; None if the run had not begun.

        Raises:
            RecordError: as `redo`.
            SceneError: the settings give no scene; the run stays unchanged.
        """
        # With new settings the driver waits for the result and can change them again, so one attempt is enough.
        attempts = _MAXIMUM_SCENE_ATTEMPTS if config is None else 1
        scene, config = self._next_scene(self._following(), config or self.config, attempts)
        path = self._discard(reason)
        self._begin(scene, config)
        self.config = config
        return path

    def undo(self) -> Path:
        """Take back the last `keep` of this session: its run is present again, ended, and its file discarded.

        Returns:
            The new path of the file.

        Raises:
            ValueError: nothing was kept in this session, or another run has begun.
            RecordError: the file cannot be moved.
        """
        if self.ticks:
            raise ValueError("another run has begun; end it before taking back the last one")
        record = read_episode(self._collection.last_kept)
        ticks = [
            TickInput(frame.command, frame.label, frame.snapshot.events, frame.others) for frame in record.frames()
        ]
        header = self._header(record.scene(), record.scene().settings or {}, record.controller_info.settings or {})
        name, waiting = record.path.name, (self.scene, self._run_config)
        # The journal is complete before the file moves, and does not count before: a crash loses or doubles no run.
        self._journal.begin(header | {UNDONE: name})
        self._restore(OpenRun(header, ticks, record.snapshot(-1).events, [], self._kept_dropped.get(name, 0)))
        self._journal.sync()
        try:
            if self.journal_error is not None:
                raise RecordError(f"the last run cannot be taken back: {self.journal_error}")
            path = self._collection.undo()
        except RecordError:
            self._begin(*waiting)
            raise
        self._log("undone", file=name)
        self.undone_label = record.label
        return path

    def close(self) -> None:
        """End the session; a run that has begun stays in the journal, and the next session continues it."""
        self._journal.shut()
        if not self.ticks:
            self._journal.delete()
        self._log("closed", open_ticks=self.ticks, dropped_ticks=self.dropped_ticks)
        self._collection.close()

    def _following(self) -> int | None:
        """Number of the scene after the present one; None if a schedule chooses it."""
        return None if self._schedule else self.scene.episode + 1

    def _next_scene(
        self, number: int | None, config: ScenarioConfig, attempts: int = _MAXIMUM_SCENE_ATTEMPTS
    ) -> tuple[Scene, ScenarioConfig]:
        """The first scene that can be generated, from a number on, or the scheduled one; with its settings."""
        if number is None:
            assert self._schedule is not None
            config, number = self._schedule(self.kept_runs)
            return generate(config, self.seed, number), config
        for k in range(number, number + attempts - 1):
            with suppress(SceneError):
                return generate(config, self.seed, k), config
        return generate(config, self.seed, number + attempts - 1), config

    def _begin(self, scene: Scene, config: ScenarioConfig) -> None:
        """Begin a run that waits for its first tick."""
        controller = Teleoperation(self._mappings, config.label)
        self._journal.begin(self._header(scene, config.settings(), controller.settings()))
        self._set_up(scene, config, controller, ())
        self.state = "waiting"

    def _set_up(
        self, scene: Scene, config: ScenarioConfig, controller: Teleoperation, past: Sequence[TickInput]
    ) -> None:
        """Create the episode and its recorder, and replay the past ticks."""
        self.scene, self._run_config, self._controller, self.dropped_ticks = scene, config, controller, 0
        self.number_of_runs += 1
        self._first_events = ()
        self._recorder = EpisodeRecorder(contributor=self.contributor, context=config.context, label_spec=config.label)
        self._way = _Way()
        self._episode = Episode(
            scene,
            controller,
            observers=(self._recorder, self._journal, self._way),
            past=past,
            controller_info=controller_info_of(controller, "teleoperation"),
        ).replay_past()
        self._stand_still("paused")

    def _stand_still(self, state: State) -> None:
        self.state, self.outcome = state, self._episode.outcome
        self.before = self.after = self._episode.snapshot()
        self._journal.sync()

    def _header(self, scene: Scene, settings: dict[str, Any], controller: dict[str, Any]) -> dict[str, Any]:
        """The header of a journal, from which `_restore` reconstructs the run."""
        header = {"settings": settings, "seed": scene.seed, "episode": scene.episode, "physics": PHYSICS_VERSION}
        return header | {"controller": controller, "contributor": self.contributor}

    def _recover(self) -> bool:
        """Continue an open run of the journal, if there is one; an unusable journal is renamed and reported."""
        path = self._journal.path
        try:
            run = read_journal(path)
            # A crash after the episode file was written and before the journal was deleted leaves a completed run.
            if run is None or any(self._collection.contains(name) for name in run.file_names):
                return False
            if (undone := run.header.get(UNDONE)) and (self._collection.folder / undone).exists():
                return False  # a crash came before the run was taken back
            if run.header["physics"] != PHYSICS_VERSION:
                raise RecordError(f"it is of physics version {run.header['physics']}, this is {PHYSICS_VERSION}")
            self._journal.resume(len(run.ticks))
            self.recovered = self._restore(run)
        except (Sonata2dError, KeyError, TypeError, ValueError) as error:
            self._journal.shut()
            aside = path.with_name(f"{path.stem}.{self._now():%Y%m%dT%H%M%S%f}.aside")
            os.replace(path, aside)
            self.notice = f"An open run cannot be continued ({error}); its journal was renamed {aside.name}."
            logger.warning("%s", self.notice)
            return False
        return True

    def _restore(self, run: OpenRun) -> float:
        """Set up a recorded run at its last tick and return its duration in s; all controls are released there."""
        header = run.header
        config = ScenarioConfig(**header["settings"])
        scene = generate(config, header["seed"], header["episode"])
        self._set_up(scene, config, Teleoperation.from_settings(header["controller"]), run.ticks)
        self.dropped_ticks = self._journal.dropped_ticks = run.dropped_ticks
        duration = self.after.time
        if run.last_events is not None:
            self.tick(run.last_events)
            return duration
        # The controls keep their last values in the episode, but the driver does not hold them any more: release each
        # one with the next tick. A label is not a control and keeps its value.
        last_values = {
            (event.device, event.control): event.value for tick in self._episode.past for event in tick.events
        }
        self._first_events = tuple(
            DeviceEvent(device, control, value if device == LABEL_DEVICE else 0.0)
            for (device, control), value in last_values.items()
            if device != NETWORK_DEVICE and (value != 0.0 or device == LABEL_DEVICE)
        )
        if self._episode.ends_here:  # the crash came before the tick that ends the run
            self.tick()
        return duration

    def _discard(self, reason: str) -> Path | None:
        """End a run that has begun and write it to the discarded runs."""
        if not self.ticks:
            return None
        self.stop()
        path = self._collection.discard(self._recorder, self._now(), self._journal.announce)
        self._put_away("discarded", path, reason=reason)
        return path

    def _put_away(self, event: str, path: Path, **facts: Any) -> None:
        """Delete the journal of a stored run and log the event."""
        self._journal.delete()
        seconds = round(self.after.time, 4)
        self._log(event, file=path.name, seconds=seconds, dropped_ticks=self.dropped_ticks, **facts)

    def _log(self, event: str, **facts: Any) -> None:
        """Append an event of this moment to the log of the folder."""
        self._collection.log(event=event, at=f"{self._now():%Y-%m-%dT%H:%M:%SZ}", **facts)
