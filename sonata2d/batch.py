"""Many seeds to many files: a data set, whoever makes which part of it and however often it is interrupted."""

from __future__ import annotations

import logging
import os
import platform
import shutil
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

from .agents.controller import Controller
from .episode import Episode, author_of
from .errors import ControllerError, RecordError, Sonata2dError
from .plugins import eye_of, load_controller
from .record import EpisodeRecorder, dataset
from .record.dataset import Entry, Plan
from .scenegen import ScenarioConfig, generate

logger = logging.getLogger(__name__)

CHUNK = 4  # episodes handed to a worker at a time
FAILED = "failed"  # folder of what an error left of its episode

Advance = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Failure:
    """An episode that an error ended: which, what happened, and where its frames up to there are."""

    episode: int
    error: type[Sonata2dError]
    message: str
    remains: Path | None


@dataclass(frozen=True, slots=True)
class Job:
    """What a worker must know to make any episode of a data set."""

    out: Path
    scenario: ScenarioConfig
    plan: Plan


def generate_dataset(
    out: str | Path,
    scenario: ScenarioConfig,
    controller: str = "social-planner",
    *,
    episodes: int = 20,
    seed: int = 0,
    workers: int = 1,
    resume: bool = False,
    suffix: str = ".json",
    advance: Advance = lambda step: None,
) -> dict[str, Any]:
    """Make a data set, or what is missing of one.

    Args:
        out: folder for it; new or empty, unless it is to be resumed.
        scenario: what its scenes may look like.
        controller: its name, as on the command line, since each worker makes its own.
        episodes: how many.
        seed: of the whole set; episode k is the same whatever the other arguments.
        workers: processes. With more than one, a script must guard its start by `if __name__ == "__main__":`.
        resume: go on with a set that was interrupted, with the same settings.
        suffix: `.json`, `.json.gz` or `.json.zst`.
        advance: is told how many episodes are done, as they are.

    Returns:
        The manifest.

    Raises:
        RecordError: the folder cannot be used or written, or holds a data set made otherwise.
        ControllerError: the controller cannot be made, or an error ended an episode; whole episodes stay.
        SceneError: a scene cannot be laid out; whole episodes stay.
    """
    out = Path(out)
    author = author_of(load_controller(controller), controller)
    plan = Plan(scenario.name, scenario.settings(), seed, episodes, author, suffix)
    split = dataset.read_manifest(out)["split"] if resume and (out / dataset.MANIFEST).exists() else None
    listed = dataset.start(out, plan, resume=resume)
    done, faults = dataset.existing(out, plan, listed) if resume else ({}, [])
    for fault in faults:
        logger.warning("%s; it is made again", fault)
    advance(len(done))
    todo = [episode for episode in range(episodes) if episode not in done]
    with _logged(out, len(todo), workers):
        for result in _results(Job(out, scenario, plan), todo, workers):
            if isinstance(result, Failure):
                raise result.error(_told(result, out, len(done), episodes))
            done[result.episode] = result
            advance(1)
    shutil.rmtree(out / FAILED, ignore_errors=True)  # what failed is made by now
    if split is not None and todo:
        logger.warning("%s was split, and has other episodes now; split it again", out)
    return dataset.finish(out, plan, done.values(), split=None if todo else split)


def _results(job: Job, todo: Sequence[int], workers: int) -> Iterator[Entry | Failure]:
    """Make the episodes, in this process or in others; ends at the first failure."""
    if workers <= 1 or len(todo) <= 1:
        controller = load_controller(job.plan.author.path)
        for episode in todo:
            yield _made(job, controller, episode)
        return
    spawn = get_context("spawn")  # the same on every system
    stop = spawn.Event()
    with ProcessPoolExecutor(workers, mp_context=spawn, initializer=_start_worker, initargs=(job, stop)) as pool:
        try:
            yield from _spread(pool, _chunks(todo), ahead=2 * workers)
        finally:
            stop.set()  # each worker ends after the episode it is at
            pool.shutdown(cancel_futures=True)


def _spread(pool: ProcessPoolExecutor, chunks: Iterator[tuple[int, ...]], *, ahead: int) -> Iterator[Entry | Failure]:
    """Hand out chunks, never more than a few ahead, and give results as they come."""
    running: set[Future[list[Entry | Failure]]] = set()
    while True:
        running |= {pool.submit(_make_chunk, chunk) for chunk in islice(chunks, ahead - len(running))}
        if not running:
            return
        finished, running = wait(running, return_when=FIRST_COMPLETED)
        for future in finished:
            yield from future.result()


def _chunks(todo: Iterable[int]) -> Iterator[tuple[int, ...]]:
    rest = iter(todo)
    while chunk := tuple(islice(rest, CHUNK)):
        yield chunk


_worker: tuple[Job, Controller, Event] | None = None


def _start_worker(job: Job, stop: Event) -> None:
    """Once in each worker: make its controller; see to it that it dies with its parent and not by Ctrl-C."""
    import signal

    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    _worker = job, load_controller(job.plan.author.path), stop


def _make_chunk(episodes: Sequence[int]) -> list[Entry | Failure]:
    """Make some episodes in a worker."""
    assert _worker is not None
    job, controller, stop = _worker
    made: list[Entry | Failure] = []
    for episode in episodes:
        if stop.is_set():
            break
        made.append(_made(job, controller, episode))
        if isinstance(made[-1], Failure):
            break
    return made


def _made(job: Job, controller: Controller, episode: int) -> Entry | Failure:
    """Run one episode and write its file."""
    plan = job.plan
    recorder = EpisodeRecorder(id=f"{episode:06d}", context=job.scenario.context)
    try:
        scene = generate(job.scenario, plan.seed, episode)
        Episode(scene, controller, observers=[recorder], author=plan.author, renderer=eye_of(controller)).run()
        return dataset.store(job.out, plan, episode, recorder.document())
    except Exception as error:
        kind = type(error) if isinstance(error, Sonata2dError) else ControllerError
        return Failure(episode, kind, _message(error), _keep_remains(job, recorder, episode))


def _keep_remains(job: Job, recorder: EpisodeRecorder, episode: int) -> Path | None:
    """Write the frames of an episode that an error ended, for whoever mends it; None if there are none."""
    try:
        return job.out / FAILED / dataset.store(job.out / FAILED, job.plan, episode, recorder.document()).name
    except RecordError:
        return None


def _message(error: Exception) -> str:
    """What happened, on one line, and where in the author's file."""
    notes = getattr(error, "__notes__", [])
    if isinstance(error, Sonata2dError):
        return "; ".join([str(error), *notes])
    told = "; ".join([f"{type(error).__name__}: {error}", *notes])
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{told} ({Path(last.filename).name}, line {last.lineno})"


def _told(failure: Failure, out: Path, done: int, episodes: int) -> str:
    remains = f"; its frames up to there are in {failure.remains}" if failure.remains else ""
    return (
        f"episode {failure.episode}: {failure.message}{remains}; {done} of {episodes} episodes are whole in {out},"
        " resume to go on"
    )


@contextmanager
def _logged(out: Path, todo: int, workers: int) -> Iterator[None]:
    """Note in the run's log what is true of this run only."""
    start, begun = time.perf_counter(), time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    outcome = "interrupted"
    try:
        yield
        outcome = "complete"
    except Sonata2dError as error:
        outcome = f"{type(error).__name__}: {error}"
        raise
    finally:
        dataset.log(
            out,
            begun=begun,
            seconds=round(time.perf_counter() - start, 1),
            host=platform.node(),
            workers=workers,
            asked=todo,
            command=sys.argv,
            outcome=outcome,
        )
