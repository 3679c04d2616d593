"""Runs the episodes of a data set in a worker."""

from __future__ import annotations

import logging
import os
import sysconfig
import traceback
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ...agents.controllers.base import Controller
from ...agents.controllers.loading import ControllerSource
from ...core.files import interruption
from ...core.scene import Scene
from ...core.snapshot import ControllerInfo, Frame, Frames, Outcome, Snapshot
from ...core.wording import described, one_line, text_of
from ...errors import ControllerError, RecordError, SceneError, Sonata2dError
from ...record.claims import StoreClaim
from ...record.files import compressed, write_atomically
from ...record.layout import JsonDict
from ...record.recorder import EpisodeRecorder
from ...scenegen.generator import generate
from ...scenegen.scenario.config import ScenarioConfig
from ...sim.driver import renderer_for
from ...sim.episode import Episode
from ...workers.processes import end_if_forked
from ..manifest.names import FAILED
from ..manifest.write import file_row
from .progress import FailedEpisode
from .specification import DatasetSpec

logger = logging.getLogger(__name__)

FAILURES = SceneError, RecordError, ControllerError  # of an episode
_PACKAGE_FOLDER = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True)
class Job:
    """Everything that a worker needs to generate any episode of a data set.

    Attributes:
        out: folder of the data set; absolute, because a controller may change the working folder.
        scenario: settings of the scenes.
        spec: specification of the data set.
        source: of the controller.
        claim: of the folder.
    """

    out: Path
    scenario: ScenarioConfig
    spec: DatasetSpec
    source: ControllerSource
    claim: StoreClaim


class Store(Protocol):
    """Destination of the episodes of a batch."""

    def add(self, episode: int, recorder: EpisodeRecorder) -> None:
        """Store a recorded episode."""

    def leave_out(self, episode: int, outcome: str) -> None:
        """Note an episode whose outcome is not kept."""


def created(source: ControllerSource) -> Controller:
    """A new controller; a copy of the process that its creation forks is ended.

    Raises:
        ControllerError: the controller cannot be created.
    """
    process = os.getpid()
    controller = source.create()
    end_if_forked(process)
    return controller


def run_episode(job: Job, controller: Controller, episode: int, store: Store) -> FailedEpisode | None:
    """Run an episode, and store it if its outcome is kept.

    Args:
        job: of the data set.
        controller: drives the robot.
        episode: number of the episode.
        store: of its batch.

    Returns:
        The failure if an error ended the episode, or it cannot be stored; else None.
    """
    spec = job.spec
    recorder = EpisodeRecorder(id=f"{episode:06d}", context=job.scenario.context)
    try:
        scene = generate(job.scenario, spec.seed, episode)
        run = Episode(
            scene,
            controller,
            observers=[_ForkGuard(), recorder],
            controller_info=spec.controller_info,
            renderer=renderer_for(controller),
        )
        status = run.run().status
    except BaseException as error:
        interruption.reraise(error)
        return _failed(job, recorder, episode, error)
    logger.info("episode %d: %s after %d frames", episode, status, len(run.past))
    if spec.keep and status not in spec.keep:
        store.leave_out(episode, status)
        return None
    try:
        store.add(episode, recorder)
    except RecordError as error:
        return _failed(job, recorder, episode, error)
    return None


class _ForkGuard:
    """An observer that ends copies of this process which the controller has forked, in the tick in which it did."""

    def __init__(self) -> None:
        self._process = os.getpid()

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        end_if_forked(self._process)

    def on_frame(self, frame: Frame) -> None:
        end_if_forked(self._process)

    def on_frames(self, frames: Frames) -> None:
        end_if_forked(self._process)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        end_if_forked(self._process)


def packed_episode(spec: DatasetSpec, episode: int, recorder: EpisodeRecorder) -> tuple[JsonDict, bytes]:
    """The manifest row and the stored bytes of a recorded episode."""
    document, name = recorder.complete(), spec.file_name(episode)
    data = b"".join(compressed(document.parts(), document.size, Path(name)))
    return file_row(name, data, document.header(), recorder.counts()), data


def _failed(job: Job, recorder: EpisodeRecorder, episode: int, error: BaseException) -> FailedEpisode:
    """The result of an episode that an error ended; its frames are kept for debugging."""
    # not the class itself, which a controller may have defined where pickle cannot find it
    kind = next((failure for failure in FAILURES if isinstance(error, failure)), ControllerError)
    partial_file: str | None = None
    with suppress(RecordError):  # there may be no frames, or another program has the folder
        job.claim.require()
        row, data = packed_episode(job.spec, episode, recorder)
        write_atomically(job.out / FAILED / row["name"], data)
        partial_file = row["name"]
    text = "".join(traceback.format_exception(error))
    return FailedEpisode(episode, kind, _message(error), partial_file, text)


def is_failure(result: object) -> bool:
    """Whether an error ended an episode, so that the run ends."""
    return isinstance(result, FailedEpisode)


def _message(error: BaseException) -> str:
    """The error on one line; for an error of a controller or plug-in also its class and its innermost place there."""
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
