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
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, get_args

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..core.snapshot import Status
from ..errors import ControllerError, RecordError, Sonata2dError
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode, author_of, renderer_for
from . import manifest as dataset
from .manifest import DatasetSpec, Entry
from .progress import Failure, LeftOut, Result, Tally, log, log_left_out, logged_left_out

logger = logging.getLogger(__name__)

CHUNK = 4  # episodes handed to a worker at a time
FAILED = "failed"  # folder of what an error left of its episode
KEEPABLE: tuple[Status, ...] = tuple(status for status in get_args(Status) if status != "error")  # that ends a batch

Advance = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Job:
    """What a worker must know to make any episode of a data set."""

    out: Path
    scenario: ScenarioConfig
    plan: DatasetSpec


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
    keep: Sequence[str] = (),
    advance: Advance = lambda step: None,
) -> dict[str, Any]:
    """Make a data set, or what is missing of one.

    Args:
        out: folder for it; new or empty, unless it is to be resumed.
        scenario: what its scenes may look like.
        controller: its name, as on the command line, since each worker makes its own.
        episodes: how many; with `keep`, how many of these.
        seed: of the whole set; episode k is the same whatever the other arguments.
        workers: processes. With more than one, a script must guard its start by `if __name__ == "__main__":`.
        resume: go on with a set that was interrupted, with the same settings.
        suffix: `.json`, `.json.gz` or `.json.zst`.
        keep: outcomes (`frame.Status`). Episodes 0, 1, 2, … are made until so many ended in one of these; the others
            are left out, and the manifest counts them. All are kept if none is named.
        advance: is told how many episodes are done, as they are.

    Returns:
        The manifest.

    Raises:
        RecordError: the folder cannot be used or written, or holds a data set made otherwise; or hardly any episode
            ends as is to be kept.
        ControllerError: the controller cannot be made, or an error ended an episode; whole episodes stay.
        SceneError: a scene cannot be laid out; whole episodes stay.
        ValueError: no episode of a data set ends in an outcome of this name.
    """
    out = Path(out)
    kept = _in_order(keep)
    author = author_of(load_controller(controller), controller)
    plan = DatasetSpec(scenario.name, scenario.settings(), seed, episodes, author, suffix, kept)
    split = dataset.read_manifest(out)["split"] if resume and (out / dataset.MANIFEST).exists() else None
    listed = dataset.start(out, plan, resume=resume)
    tally = Tally(plan, _known(out, plan, listed) if resume else ())
    advance(len(tally.kept))
    lacking = episodes - min(tally.whole, episodes)
    with _logged(out, lacking, workers):
        _make(Job(out, scenario, plan), tally, workers if lacking > 1 else 1, advance)
        if tally.failure is not None:
            raise tally.failure.error(_told(tally.failure, out, tally.whole, episodes))
    shutil.rmtree(out / FAILED, ignore_errors=True)  # what failed is made by now
    if split is not None and lacking:
        logger.warning("%s was split, and has other episodes now; split it again", out)
    return dataset.finish(out, plan, tally.kept, left_out=tally.left_out, split=None if lacking else split)


def _in_order(keep: Sequence[str]) -> tuple[Status, ...]:
    """Outcomes to keep in one order, whichever they are named in."""
    for status in keep:
        if status not in KEEPABLE:
            raise ValueError(f"keep must be of {', '.join(KEEPABLE)}; got {status!r}")
    return tuple(status for status in KEEPABLE if status in keep)


def _known(out: Path, plan: DatasetSpec, listed: Mapping[str, str]) -> list[Entry | LeftOut]:
    """What earlier runs came to."""
    done, faults = dataset.existing(out, plan, listed)
    for fault in faults:
        logger.warning("%s; it is made again", fault)
    left_out = logged_left_out(out) if plan.keep else {}
    return [*(LeftOut(k, outcome) for k, outcome in left_out.items()), *done.values()]


def _make(job: Job, tally: Tally, workers: int, advance: Advance) -> None:
    """Make episodes until the tally is over."""
    with closing(_results(job, tally.missing(), workers)) as results:
        for result in results:
            if isinstance(result, LeftOut):
                log_left_out(job.out, result.episode, result.outcome)
            advance(tally.take(result))
            if tally.is_over:
                return


def _results(job: Job, todo: Iterator[int], workers: int) -> Generator[Result, None, None]:
    """Make the episodes, in this process or in others."""
    if workers <= 1:
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


def _spread(pool: ProcessPoolExecutor, chunks: Iterator[tuple[int, ...]], *, ahead: int) -> Iterator[Result]:
    """Hand out chunks, never more than a few ahead, and give results as they come."""
    running: set[Future[list[Result]]] = set()
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


def _make_chunk(episodes: Sequence[int]) -> list[Result]:
    """Make some episodes in a worker."""
    assert _worker is not None
    job, controller, stop = _worker
    made: list[Result] = []
    for episode in episodes:
        if stop.is_set():
            break
        made.append(_made(job, controller, episode))
        if isinstance(made[-1], Failure):
            break
    return made


def _made(job: Job, controller: Controller, episode: int) -> Result:
    """Run one episode and write its file, if it is one to keep."""
    plan = job.plan
    recorder = EpisodeRecorder(id=f"{episode:06d}", context=job.scenario.context)
    try:
        scene = generate(job.scenario, plan.seed, episode)
        run = Episode(scene, controller, observers=[recorder], author=plan.author, renderer=renderer_for(controller))
        status = run.run().status
        if plan.keep and status not in plan.keep:
            return LeftOut(episode, status)
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
        log(
            out,
            begun=begun,
            seconds=round(time.perf_counter() - start, 1),
            host=platform.node(),
            workers=workers,
            asked=todo,
            command=sys.argv,
            outcome=outcome,
        )
