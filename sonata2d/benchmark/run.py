"""Running a controller in the scenes of a suite, and replaying the commands of a row."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from ..agents.controllers.base import Controller, External
from ..agents.controllers.loading import ControllerSource
from ..core.geometry import Twist
from ..core.portable_math import IntArray
from ..core.snapshot import ControllerInfo
from ..errors import BenchmarkError
from ..record.recorder import EpisodeRecorder
from ..sim.episode import Episode
from ..sim.inputs import TickInput
from ..workers.tasks import stop_if_over
from .isolated import FAILED, Isolated
from .recorded import RecordedPerson
from .scorers import LEARNED, column_of, learned_score
from .scoring import values_of
from .suite import Entry, Track, difficulty_of, load_suite, scene_sha256

RECORDED_PERSON = "recorded-person"  # name of the baseline that needs no process of its own: it is no controller
_TOGETHER = 10  # scenes in a task of a worker
_UNITS = 10_000  # of commands in a row: 1e-4 m/s and rad/s, the precision of files


class Run(NamedTuple):
    """A scene that was run.

    Attributes:
        entry, episode: which scene of the suite.
        scene: hash of the scene.
        sha256: of the episode, without its software block.
        status, reason: of the outcome.
        difficulty: of the scene, s; None where it is not defined.
        late: ticks in which the last command was held, since the answer came late.
        values: see `scoring.values_of`.
        commands: of all ticks, three 32-bit integers each, in units of 1e-4 m/s and rad/s.
    """

    entry: str
    episode: int
    scene: str
    sha256: str
    status: str
    reason: str
    difficulty: float | None
    late: tuple[int, ...]
    values: dict[str, float | None]
    commands: bytes

    def to_json(self) -> dict[str, Any]:
        """As rows hold it: the number of ticks in place of the commands, which are in a file of their own."""
        values = self._asdict() | {"ticks": self.ticks}
        del values["commands"]
        return values

    @property
    def has_failed(self) -> bool:
        """Whether an error of the controller ended the run."""
        return self.reason.startswith(FAILED)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.commands) // 12


class Past(NamedTuple):
    """The commands of an earlier run, and why the controller stopped it, if it did."""

    commands: bytes
    status: str
    reason: str


class Task(NamedTuple):
    """Consecutive scenes of an entry for a worker.

    Attributes:
        entry: its name.
        first: number of the first scene.
        scenes: number of scenes.
        pasts: of each scene, to be replayed; None: the controller drives.
    """

    entry: str
    first: int
    scenes: int
    pasts: tuple[Past, ...] | None = None


@dataclass(slots=True)
class Runner:
    """Runs the scenes of a task; in each worker process it starts the process of the controller once.

    Attributes:
        suite: its name.
        seed: of the scenes.
        name: of the controller, in the episodes.
        track: what the controller observes.
        source: of the controller; None: commands are replayed.
        scorers: names of learned scores, or paths of models.
        recordings: folder with the recordings of the suite.
    """

    suite: str
    seed: int
    name: str
    track: Track
    source: ControllerSource | None
    scorers: tuple[str, ...] = ()
    recordings: str | None = None
    _driver: Isolated | None = None

    def __call__(self, task: Task) -> list[Run]:
        """The runs of a task.

        Raises:
            BenchmarkError: the controller breaks a rule.
        """
        entry = load_suite(self.suite, self.recordings).entry(task.entry)
        runs = []
        for k in range(task.scenes):
            stop_if_over()
            past = None if task.pasts is None else task.pasts[k]
            runs.append(self._run(entry, task.first + k, past))
        return runs

    def close(self) -> None:
        """End the process of the controller."""
        if self._driver is not None:
            self._driver.close()
            self._driver = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Runner, (self.suite, self.seed, self.name, self.track, self.source, self.scorers, self.recordings)

    def _run(self, entry: Entry, number: int, past: Past | None) -> Run:
        scene, recorder, info = entry.scene(self.seed, number), EpisodeRecorder(), ControllerInfo(self.name)
        late: tuple[int, ...] = ()
        if past is None:
            driver = self._driver_in(entry, number)
            episode = Episode(scene, driver, observers=[recorder], controller_info=info)
            outcome = episode.run()
            late = tuple(driver.late) if isinstance(driver, Isolated) else ()
        else:
            commands = commands_of(past.commands)
            inputs = [TickInput(Twist(*command)) for command in (commands / _UNITS).tolist()]
            episode = Episode(scene, External(), observers=[recorder], past=inputs, controller_info=info)
            episode.observe()
            if not episode.is_over:
                episode.end("stopped", past.reason if past.status == "stopped" else "the commands end too early")
            assert episode.outcome is not None
            outcome = episode.outcome
        record = recorder.record()
        values = values_of(record, entry.situation)
        for name in self.scorers:
            values[f"{LEARNED}{column_of(name)}"] = learned_score(name, record, values)
        commands = np.array([(c.vx, c.vy, c.omega) for c in (tick.command for tick in episode.past)]).reshape(-1, 3)
        return Run(
            entry=entry.name,
            episode=number,
            scene=scene_sha256(scene),
            sha256=_sha256_of(recorder.document()),
            status=outcome.status,
            reason=outcome.reason if outcome.status == "stopped" else "",
            difficulty=difficulty_of(scene),
            late=late,
            values=values,
            commands=np.rint(commands * _UNITS).astype("<i4").tobytes(),
        )

    def _driver_in(self, entry: Entry, number: int) -> Controller:
        """The controller in its process, or the recorded person whose place the robot takes.

        Raises:
            BenchmarkError: nobody was recorded in this suite.
        """
        if self.name == RECORDED_PERSON:
            if entry.recording is None:
                raise BenchmarkError(f"nobody was recorded in {self.suite}; {self.name} drives in suites of recordings")
            return RecordedPerson(entry.recording.scenario(self.seed, number)[1])
        if self._driver is None:
            assert self.source is not None
            self._driver = Isolated(self.source, self.track)
        self._driver.sensing = entry.sensing
        return self._driver


def commands_of(packed: bytes) -> IntArray:
    """(T, 3), the commands of a run in units of 1e-4."""
    return np.frombuffer(packed, dtype="<i4").astype(np.int64).reshape(-1, 3)


def tasks_of(entries: Sequence[Entry], pasts: Sequence[Past] | None = None) -> list[Task]:
    """All scenes of some entries, in tasks of ten scenes.

    Args:
        entries: of the suite.
        pasts: of all scenes, in their order, to be replayed; None: the controller drives.
    """
    tasks, rest = [], iter(pasts or ())
    for entry in entries:
        for first in range(0, entry.scenes, _TOGETHER):
            count = min(_TOGETHER, entry.scenes - first)
            given = None if pasts is None else tuple(islice(rest, count))
            tasks.append(Task(entry.name, first, count, given))
    return tasks


def _sha256_of(document: bytes) -> str:
    """Hash of an episode file without its software block, which differs between machines."""
    lines = (line for line in document.splitlines(keepends=True) if not line.startswith(b'"software"'))
    return hashlib.sha256(b"".join(lines)).hexdigest()
