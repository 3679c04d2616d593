"""A sitting of one person at the controls: run after run, kept or discarded, and nothing lost. It knows no window."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from .agents import HANDS, Hand, Teleoperation
from .agents.teleoperation import STOP
from .entities import Scene
from .episode import Episode, Moment, ending
from .errors import SceneError
from .frame import Author, Outcome, Snapshot
from .geometry import Twist
from .labels import DEVICE, LabelSpec
from .record import EpisodeRecorder
from .record.collection import Collection
from .record.journal import Journal, OpenRun, read_journal
from .scenegen import ScenarioConfig, generate
from .topics import DeviceEvent
from .version import PHYSICS_VERSION

logger = logging.getLogger(__name__)

State = Literal["waiting", "driving", "paused", "ended"]
TRIES = 20  # scenes in a row that find no place for all, before it is an error


class Session:
    """Run after run of one contributor in one folder.

    The world waits for the first tick (`waiting`), each `tick` drives it on (`driving`) until it ends (`ended`), and
    `keep` or `discard` put it away. Everybody gets the same scenes in the same order, and goes on after the last one
    that they kept or discarded.

    Args:
        out: folder of the runs.
        contributor: who drives.
        config: what scenes may look like, and what is asked of the contributor.
        seed: of the scenes.
        hands: how devices are read.
        suffix: `.json`, `.json.gz` or `.json.zst`.
        now: the time of day, for the names of files.

    Attributes:
        state: see above; `paused` is a standstill in mid-run.
        scene: of this run.
        before, after: the two looks between which the window draws; the same one while nothing moves.
        outcome: of the run; None until it ended.
        dropped: ticks of real time in this run for which the window was too slow.
        recovered: seconds of a run that was left open and goes on now; None if there was none.

    Raises:
        ConfigError: the contributor's name cannot be used.
        RecordError: the folder cannot be used, or another window of this contributor is open on it.
        SceneError: a scene cannot be laid out.
    """

    state: State
    scene: Scene
    before: Snapshot
    after: Snapshot
    outcome: Outcome | None
    dropped: int
    _run: Episode
    _first: tuple[DeviceEvent, ...]

    def __init__(
        self,
        out: str | Path,
        contributor: str,
        config: ScenarioConfig,
        *,
        seed: int = 0,
        hands: Mapping[str, Hand] = HANDS,
        suffix: str = ".json",
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.config, self.seed, self._hands, self._now = config, seed, dict(hands), now
        self._folder = Collection(Path(out), contributor, config.settings(), suffix)
        self._journal = Journal(self._folder.journal)
        self.recovered: float | None = None
        open_run = self._left_open()
        if open_run is None:
            self._begin(*self._scene_from(self._folder.next_number, config))
        else:
            self._go_on(open_run)
        self._folder.log(event="begun", at=self._time(), scenario=config.name, seed=seed, recovered=self.recovered)

    @property
    def out(self) -> Path:
        return self._folder.folder

    @property
    def contributor(self) -> str:
        return self._folder.contributor

    @property
    def kept(self) -> int:
        """How many of this contributor's runs the folder holds."""
        return self._folder.kept

    @property
    def can_undo(self) -> bool:
        return self._folder.can_undo

    @property
    def label_spec(self) -> LabelSpec:
        """What this run asks for."""
        return self._config.label.spec()

    @property
    def ticks(self) -> int:
        """How many have been driven in this run."""
        return len(self._run.past)

    @property
    def label(self) -> Any:
        """The label that the next frame will bear, where each frame has one; None before it is given."""
        spec = self.label_spec
        if not spec.per_frame:
            return None
        waiting = [event.value for event in self._first if event.device == DEVICE]  # of a run that was recovered
        return spec.label_at(waiting[-1]) if waiting else self._run.controller.label(self.after, Twist())[spec.name]

    @property
    def trouble(self) -> str | None:
        """What is wrong with the journal's disk, if anything."""
        return self._journal.failure

    def tick(self, events: Sequence[DeviceEvent] = ()) -> None:
        """One control tick: it begins the run, or goes on with it."""
        if self.state == "ended":
            return
        first, self._first = self._first, ()
        frame = self._run.step((*first, *events))
        if frame is None:
            self._stand_still("ended")
        else:
            self.state, self.before, self.after = "driving", frame.snapshot, self._run.look()

    def pause(self) -> None:
        """Stand still until the next tick."""
        if self.state == "driving":
            self._stand_still("paused")

    def stop(self) -> None:
        """End the run here, as the person's doing; nothing if none was begun."""
        if self.ticks:
            self.tick((STOP,))

    def read_by(self, hands: Mapping[str, Hand]) -> None:
        """Read devices otherwise: in this run if it has not begun, else from the next on."""
        self._hands = dict(hands)
        if self.state == "waiting":
            self._begin(self.scene, self._config)

    def keep(self, label: Any = None) -> Path:
        """Write the run that ended, and open the next scene.

        Args:
            label: of the run, where the scenario asks for one.

        Returns:
            The file.

        Raises:
            RecordError: it cannot be written; nothing is lost, and it can be tried again.
            ValueError: the run has not ended, or the label is not what is asked for.
        """
        if self.state != "ended":
            raise ValueError("the run has not ended; stop it before it is kept")
        self._recorder.label = self.label_spec.checked(label) if self.label_spec.per_run else None
        path = self._folder.keep(self._recorder, self._now())
        self._put_away("kept", path)
        self._begin(*self._scene_from(self.scene.episode + 1, self.config))
        return path

    def redo(self, reason: str = "driven again") -> Path | None:
        """The same scene from its start; what was driven goes to the bin.

        Returns:
            Where it lies; None if nothing was driven.

        Raises:
            RecordError: it cannot be written; the run stays as it is.
        """
        path = self._discard(reason)
        self._begin(self.scene, self._config)
        return path

    def next(self, config: ScenarioConfig | None = None, reason: str = "another scene") -> Path | None:
        """Another scene; what was driven goes to the bin.

        Args:
            config: other settings, from this scene on.
            reason: noted in the log.

        Raises:
            RecordError: as `redo`.
            SceneError: the settings give no scene; the run stays as it is.
        """
        scene, config = self._scene_from(self.scene.episode + 1, config or self.config)
        path = self._discard(reason)
        self._begin(scene, config)
        self.config = config
        return path

    def undo(self) -> Path:
        """Take the last keep of this sitting back: its file goes to the bin.

        Raises:
            ValueError: nothing was kept in this sitting.
            RecordError: the file cannot be moved.
        """
        place = self._folder.undo()
        self._folder.log(event="undone", at=self._time(), file=place.name)
        return place

    def close(self) -> None:
        """The sitting is over. An open run stays in the journal, and the next session goes on with it."""
        self._journal.shut()
        if not self.ticks:
            self._journal.forget()
        self._folder.log(event="closed", at=self._time(), open_ticks=self.ticks, dropped_ticks=self.dropped)
        self._folder.close()

    def _scene_from(self, number: int, config: ScenarioConfig) -> tuple[Scene, ScenarioConfig]:
        """The first scene from a number on in which all find a place, and its settings."""
        for k in range(number, number + TRIES):
            try:
                return generate(config, self.seed, k), config
            except SceneError as error:
                failure = error
        raise failure

    def _begin(self, scene: Scene, config: ScenarioConfig) -> None:
        """A fresh run of a scene."""
        controller = Teleoperation(self._hands, config.label.spec())
        head = {"settings": config.settings(), "seed": scene.seed, "episode": scene.episode}
        self._journal.begin({**head, "physics": PHYSICS_VERSION, "controller": controller.settings()})
        self._set_up(scene, config, controller, ())
        self.state = "waiting"

    def _set_up(self, scene: Scene, config: ScenarioConfig, controller: Teleoperation, past: Sequence[Moment]) -> None:
        """An episode and its recorder; a past is driven again."""
        self.scene, self._config, self.dropped = scene, config, 0
        self._first = ()
        self._recorder = EpisodeRecorder(
            contributor=self.contributor, context=config.context, label_spec=config.label.spec()
        )
        author = Author("teleoperation", controller.version, controller.settings(), dict(controller.labels) or None)
        observers = (self._recorder, self._journal)
        self._run = Episode(scene, controller, observers=observers, past=past, author=author).caught_up()
        self._stand_still("paused")

    def _stand_still(self, state: State) -> None:
        self.state, self.outcome = state, self._run.outcome
        self.before = self.after = self._run.look()
        self._journal.sync()

    def _left_open(self) -> OpenRun | None:
        """A run that an earlier session did not put away."""
        path = self._journal.path
        run = read_journal(path)
        if run is not None and run.head["physics"] != PHYSICS_VERSION:
            logger.warning("%s is of another physics version; it is moved aside", path)
            os.replace(path, path.with_suffix(".old"))
            return None
        return run

    def _go_on(self, run: OpenRun) -> None:
        """Drive an open run up to where it was left; there the hands are off the controls, the label stays."""
        head, config = run.head, ScenarioConfig(**run.head["settings"])
        scene = generate(config, head["seed"], head["episode"])
        controller = Teleoperation.restored(head["controller"])
        self._journal.go_on(len(run.ticks))
        self._set_up(scene, config, controller, [Moment(*tick) for tick in run.ticks])
        self.recovered = self.after.time
        last = {(event.device, event.control): event.value for event in self._events()}
        self._first = tuple(
            DeviceEvent(device, control, value if device == DEVICE else 0.0)
            for (device, control), value in last.items()
            if value != 0.0 or device == DEVICE
        )
        if ending(self.after) is not None:
            self.tick()

    def _events(self) -> list[DeviceEvent]:
        """All that the person did in this run."""
        return [event for moment in self._run.past for event in moment.events]

    def _discard(self, reason: str) -> Path | None:
        """End the run, and write it to the bin; nothing if none was begun."""
        if not self.ticks:
            return None
        self.stop()
        path = self._folder.discard(self._recorder, self._now())
        self._put_away("discarded", path, reason=reason)
        return path

    def _put_away(self, event: str, path: Path, **facts: Any) -> None:
        self._journal.forget()
        seconds = round(self.after.time, 4)
        self._folder.log(
            event=event, at=self._time(), file=path.name, seconds=seconds, dropped_ticks=self.dropped, **facts
        )

    def _time(self) -> str:
        return f"{self._now():%Y-%m-%dT%H:%M:%SZ}"
