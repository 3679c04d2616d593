"""A sitting of one person at the controls: run after run, kept or discarded, and nothing lost. It knows no window."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..agents.controllers.teleoperation import HANDS, Hand, Teleoperation
from ..core.scene import Scene
from ..errors import RecordError, SceneError, Sonata2dError
from ..record.reader import read_episode
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..version import PHYSICS_VERSION
from .collection import Collection
from .journal import Journal, OpenRun, read_journal
from .run import CollectionRun

logger = logging.getLogger(__name__)

TRIES = 20  # scenes in a row that find no place for all, before it is an error


class Session(CollectionRun):
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
        recovered: seconds of a run that was left open and goes on now; None if there was none.
        answered: the label that a run had that was taken back.
        notice: what the person should know of an open run that cannot go on; empty if there is none.

    Raises:
        ConfigError: the contributor's name cannot be used.
        RecordError: the folder cannot be used, or another window of this contributor is open on it.
        SceneError: a scene cannot be laid out.
    """

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
        super().__init__(self._folder.contributor, Journal(self._folder.journal))
        self.recovered: float | None = None
        self.notice = ""
        self.answered: Any = None
        try:
            if not self._go_on():
                self._begin(*self._scene_from(self._folder.next_number(seed), config))
        except BaseException:
            self._folder.close()  # so that it can be tried again
            raise
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

    def read_by(self, hands: Mapping[str, Hand]) -> None:
        """Read devices otherwise: in this run if it has not begun, else from the next on."""
        if hands == self._hands:
            return
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
        path = self._folder.keep(self._recorder, self._now(), self._journal.announce)
        self._put_away("kept", path)
        try:
            self._begin(*self._scene_from(self.scene.episode + 1, self.config))
        except SceneError as error:
            self._begin(self.scene, self._config)
            self.notice = f"The same scene again: {error}"
        return path

    def redo(self, reason: str = "driven again") -> Path | None:
        """The same scene from its start; what was driven goes to the bin.

        Returns:
            Where it lies; None if nothing was driven.

        Raises:
            RecordError: it cannot be written; the run stays, ended.
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
        tries = TRIES if config is None else 1  # a person waits, and can ask for something else
        scene, config = self._scene_from(self.scene.episode + 1, config or self.config, tries)
        path = self._discard(reason)
        self._begin(scene, config)
        self.config = config
        return path

    def undo(self) -> Path:
        """Take the last keep of this sitting back: the run is open again, ended; its file goes to the bin.

        Returns:
            Where the file lies.

        Raises:
            ValueError: nothing was kept in this sitting, or another run is under way.
            RecordError: the file cannot be moved.
        """
        if self.ticks:
            raise ValueError("another run is under way; end it first, then take the last keep back")
        place = self._folder.undo()
        self._folder.log(event="undone", at=self._time(), file=place.name)
        record = read_episode(place)
        ticks = [(frame.command, frame.label, frame.snapshot.events) for frame in record.frames()]
        head = self._head(record.scene(), record.scene().settings or {}, record.author.settings or {})
        self._journal.begin(head)
        self._resume(OpenRun(head, ticks, record.snapshot(-1).events, []))
        self.answered = record.label
        return place

    def close(self) -> None:
        """The sitting is over. An open run stays in the journal, and the next session goes on with it."""
        self._journal.shut()
        if not self.ticks:
            self._journal.forget()
        self._folder.log(event="closed", at=self._time(), open_ticks=self.ticks, dropped_ticks=self.dropped)
        self._folder.close()

    def _scene_from(self, number: int, config: ScenarioConfig, tries: int = TRIES) -> tuple[Scene, ScenarioConfig]:
        """The first scene from a number on in which all find a place, and its settings."""
        for k in range(number, number + tries - 1):
            with suppress(SceneError):
                return generate(config, self.seed, k), config
        return generate(config, self.seed, number + tries - 1), config

    def _begin(self, scene: Scene, config: ScenarioConfig) -> None:
        """A fresh run of a scene."""
        controller = Teleoperation(self._hands, config.label.spec())
        self._journal.begin(self._head(scene, config.settings(), controller.settings()))
        self._set_up(scene, config, controller, ())
        self.state = "waiting"

    def _head(self, scene: Scene, settings: dict[str, Any], controller: dict[str, Any]) -> dict[str, Any]:
        """What a journal must know to set a run up again."""
        head = {"settings": settings, "seed": scene.seed, "episode": scene.episode, "physics": PHYSICS_VERSION}
        return head | {"controller": controller, "contributor": self.contributor}

    def _go_on(self) -> bool:
        """Go on with an open run, if there is one; one that cannot go on is moved aside, and told."""
        path = self._journal.path
        try:
            run = read_journal(path)
            if run is None or any(self._folder.holds(name) for name in run.named):
                return False
            if run.head["physics"] != PHYSICS_VERSION:
                raise RecordError(f"it is of physics version {run.head['physics']}, this is {PHYSICS_VERSION}")
            self._journal.go_on(len(run.ticks))
            self.recovered = self._resume(run)
        except (Sonata2dError, KeyError, TypeError, ValueError) as error:
            self._journal.shut()
            aside = path.with_name(f"{path.stem}.{self._now():%Y%m%dT%H%M%S%f}.aside")
            os.replace(path, aside)
            self.notice = f"An open run cannot go on ({error}); it was moved to {aside.name}."
            logger.warning("%s", self.notice)
            return False
        return True

    def _discard(self, reason: str) -> Path | None:
        """End the run, and write it to the bin; nothing if none was begun."""
        if not self.ticks:
            return None
        self.stop()
        path = self._folder.discard(self._recorder, self._now(), self._journal.announce)
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
