"""Runs the episodes of a data set in a worker."""

from __future__ import annotations

import logging
import os
import sysconfig
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ...agents.controllers.base import Controller
from ...agents.controllers.loading import ControllerSource
from ...core.files import interruption
from ...core.scene import Scene
from ...core.snapshot import ControllerInfo, Frame, Outcome, Snapshot
from ...core.wording import described, one_line, text_of
from ...errors import ControllerError, RecordError, SceneError, Sonata2dError
from ...record.recorder import EpisodeRecorder
from ...scenegen.generator import generate
from ...scenegen.scenario.config import ScenarioConfig
from ...sim.episode import Episode, renderer_for
from ..manifest.read import FAILED, DatasetSpec, ManifestEntry, store_episode
from ..workers.processes import end_if_forked
from ..workers.tasks import stop_if_unwanted
from .progress import EpisodeResult, ExcludedEpisode, FailedEpisode

logger = logging.getLogger(__name__)

FAILURES = SceneError, RecordError, ControllerError  # of an episode
_PACKAGE_FOLDER = Path(__file__).resolve().parents[2]
Store = Callable[[int, EpisodeRecorder], ManifestEntry]


@dataclass(frozen=True, slots=True)
class Job:
    """Everything that a worker needs to generate any episode of a data set.

    Attributes:
        out: folder of the data set; absolute, because a controller may change the working folder.
        scenario: settings of the scenes.
        spec: specification of the data set.
        source: of the controller.
        process: id of the process that runs the episodes; set there.
    """

    out: Path
    scenario: ScenarioConfig
    spec: DatasetSpec
    source: ControllerSource
    process: int = 0


def episode_runner(job: Job) -> Callable[[int], EpisodeResult]:
    """A function that runs an episode by number and writes its file; all its episodes share one controller."""
    return partial(prepared(job).run, store=partial(store_episode, job.out, job.spec))


def prepared(job: Job) -> EpisodeRuns:
    """What runs the episodes in this process.

    Raises:
        ControllerError: the controller cannot be created.
    """
    process = os.getpid()
    controller = job.source.create()
    end_if_forked(process)
    return EpisodeRuns(replace(job, process=process), controller)


@dataclass(frozen=True, slots=True)
class EpisodeRuns:
    """Runs episodes of a data set with one controller.

    Attributes:
        job: with the number of this process.
        controller: which drives the robot.
    """

    job: Job
    controller: Controller

    def run(self, episode: int, store: Store) -> EpisodeResult:
        """Run one episode.

        Args:
            episode: its number.
            store: stores the recording if the outcome is kept.
        """
        job, spec = self.job, self.job.spec
        recorder = EpisodeRecorder(id=f"{episode:06d}", context=job.scenario.context)
        try:
            scene = generate(job.scenario, spec.seed, episode)
            run = Episode(
                scene,
                self.controller,
                observers=[_ForkGuard(job.process), recorder],
                controller_info=spec.controller_info,
                renderer=renderer_for(self.controller),
            )
            status = run.run().status
        except BaseException as error:
            interruption.reraise(error)
            return _failed(job, recorder, episode, error)
        logger.info("episode %d: %s after %d frames", episode, status, len(run.past))
        if spec.keep and status not in spec.keep:
            return ExcludedEpisode(episode, status)
        if spec.shard_size is None:
            stop_if_unwanted()
        try:
            return store(episode, recorder)
        except RecordError as error:
            return _failed(job, recorder, episode, error)


class _ForkGuard:
    """An observer that ends copies of the process which the controller has forked, in the tick in which it did.

    Args:
        process: id of the process that runs the batch.
    """

    def __init__(self, process: int) -> None:
        self._process = process

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        end_if_forked(self._process)

    def note(self, frame: Frame) -> None:
        end_if_forked(self._process)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        end_if_forked(self._process)


def _failed(job: Job, recorder: EpisodeRecorder, episode: int, error: BaseException) -> FailedEpisode:
    """The result of an episode that an error ended; its frames are kept for debugging."""
    # not the class itself, which a controller may have defined where pickle cannot find it
    kind = next((one for one in FAILURES if isinstance(error, one)), ControllerError)
    partial_file = _store_partial(job, recorder, episode)
    text = "".join(traceback.format_exception(error))
    return FailedEpisode(episode, kind, _message(error), partial_file, text)


def is_failure(result: object) -> bool:
    """Whether an error ended an episode, so that the run ends."""
    return isinstance(result, FailedEpisode)


def _store_partial(job: Job, recorder: EpisodeRecorder, episode: int) -> str | None:
    """Write the frames of a failed episode for debugging, and return the file's name; None if there are none."""
    try:
        return store_episode(job.out / FAILED, job.spec, episode, recorder).name
    except RecordError:
        return None


def _message(error: BaseException) -> str:
    """The error on one line; for an error of the code of others also its class and its innermost place there."""
    notes = getattr(error, "__notes__", [])
    if isinstance(error, Sonata2dError):
        return "; ".join([one_line(text_of(error) or type(error).__name__, 1000), *notes])
    text = "; ".join([described(error), *notes])
    places = traceback.extract_tb(error.__traceback__)
    libraries = {_PACKAGE_FOLDER, *(Path(path) for path in sysconfig.get_paths().values())}
    foreign = [
        place
        for place in places
        if place.filename != "<string>" and libraries.isdisjoint(Path(place.filename).resolve().parents)
    ]
    return f"{text} ({Path(foreign[-1].filename).name}, line {foreign[-1].lineno})" if foreign else text
