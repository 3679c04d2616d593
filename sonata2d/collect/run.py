"""One run at the controls: it waits, is driven, stands still, and ends; and can go on where a journal left it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from ..agents.controllers.teleoperation import STOP, Hand, Teleoperation
from ..core.devices import DeviceEvent
from ..core.geometry import Twist
from ..core.labels import DEVICE, LabelSpec
from ..core.scene import Scene
from ..core.snapshot import Author, Outcome, Snapshot
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode, Moment, ending
from .journal import Journal, OpenRun

State = Literal["waiting", "driving", "paused", "ended"]


class CollectionRun:
    """What `Session` does with the run that is open.

    Args:
        contributor: who drives.
        journal: hears of every tick.

    Attributes:
        state: `waiting` for the first tick, `driving`, `paused` in mid-run, or `ended`.
        scene: of this run.
        before, after: the two looks between which a window draws; the same one while nothing moves.
        outcome: None until it ended.
        dropped: ticks of real time for which the window was too slow.
    """

    state: State
    scene: Scene
    before: Snapshot
    after: Snapshot
    outcome: Outcome | None
    dropped: int
    _run: Episode
    _controller: Teleoperation
    _first: tuple[DeviceEvent, ...]
    _config: ScenarioConfig
    _recorder: EpisodeRecorder

    def __init__(self, contributor: str, journal: Journal) -> None:
        self._contributor, self._journal = contributor, journal

    @property
    def hands(self) -> Mapping[str, Hand]:
        """How this run reads devices."""
        return self._controller.hands

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
        return spec.label_at(waiting[-1]) if waiting else self._controller.label(self.after, Twist())[spec.name]

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

    def _set_up(self, scene: Scene, config: ScenarioConfig, controller: Teleoperation, past: Sequence[Moment]) -> None:
        """An episode and its recorder; a past is driven again."""
        self.scene, self._config, self._controller, self.dropped = scene, config, controller, 0
        self._first = ()
        self._recorder = EpisodeRecorder(
            contributor=self._contributor, context=config.context, label_spec=config.label.spec()
        )
        author = Author("teleoperation", controller.version, controller.settings(), dict(controller.labels) or None)
        observers = (self._recorder, self._journal)
        self._run = Episode(scene, controller, observers=observers, past=past, author=author).caught_up()
        self._stand_still("paused")

    def _stand_still(self, state: State) -> None:
        self.state, self.outcome = state, self._run.outcome
        self.before = self.after = self._run.look()
        self._journal.sync()

    def _resume(self, run: OpenRun) -> float:
        """Set an open run up to where it was left; there the hands are off the controls. Answers how many s that is."""
        head, config = run.head, ScenarioConfig(**run.head["settings"])
        scene = generate(config, head["seed"], head["episode"])
        controller = Teleoperation.from_settings(head["controller"])
        self._set_up(scene, config, controller, [Moment(*tick) for tick in run.ticks])
        seconds = self.after.time
        if run.last is not None:
            self.tick(run.last)
            return seconds
        last = {(event.device, event.control): event.value for event in self._events()}
        self._first = tuple(
            DeviceEvent(device, control, value if device == DEVICE else 0.0)
            for (device, control), value in last.items()
            if value != 0.0 or device == DEVICE
        )
        if ending(self.after) is not None:
            self.tick()
        return seconds

    def _events(self) -> list[DeviceEvent]:
        """All that the person did in this run."""
        return [event for moment in self._run.past for event in moment.events]
