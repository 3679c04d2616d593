"""Runs cases in worker processes with limits on time and memory, so that one bomb ends one case only."""

from __future__ import annotations

import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random

import click

from sonata2d.errors import Sonata2dError

from .mutations import damage_path, mutated
from .targets import KINDS, Refusal, arguments, use_arguments

MAX_SECONDS = 5.0  # of processor time
MAX_MEGABYTES = 500  # beyond what the worker used before the case
MAX_MESSAGE = 2000  # characters
_HARD_SECONDS = 120  # of wall time, after which a worker is killed
_HEADROOM = 2 << 30  # bytes of address space beyond those of the worker
_FAST = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # in memory: cases write and delete many small files

ALL = (*KINDS, "arguments")


class OutOfTimeError(BaseException):
    """The case took more than MAX_SECONDS; no `except Exception` catches it."""


@dataclass(frozen=True)
class Result:
    """The end of one case: `accepted`, `refused` or `failed`, and what it took."""

    kind: str
    index: int
    status: str
    detail: str
    seconds: float
    megabytes: float


def run_case(kind: str, seed: int, index: int, samples: Path, work: Path) -> Result:
    """Run one case in an empty folder, which holds the damaged input afterwards.

    Args:
        kind: of `ALL`.
        seed, index: decide the case.
        samples: folder of `samples.make_samples`.
        work: of the case; it becomes the working folder for a moment.
    """
    rng = Random(f"{seed}/{kind}/{index}")
    before, start, memory = Path.cwd(), time.process_time(), _peak()
    status, detail = "accepted", ""
    os.chdir(work)
    try:
        with time_limit():
            _use(kind, rng, samples, work)
    except (Refusal, Sonata2dError, click.ClickException) as error:
        status, detail = judged(error)
    except (Exception, OutOfTimeError, SystemExit) as error:
        status, detail = "failed", _described(error)
    finally:
        os.chdir(before)
    seconds, megabytes = time.process_time() - start, (_peak() - memory) / 1024
    if status != "failed" and megabytes > MAX_MEGABYTES:
        status, detail = "failed", f"it took {megabytes:.0f} MB"
    return Result(kind, index, status, detail, seconds, megabytes)


def _use(kind: str, rng: Random, samples: Path, work: Path) -> None:
    """Damage a copy of a sample and give it to a reader or a command."""
    if kind == "arguments":
        shutil.copytree(samples / "dataset", work, dirs_exist_ok=True)
        words = arguments(rng)
        (work / "arguments.txt").write_text(repr(words))
        use_arguments(words)
        return
    this = KINDS[kind]
    folder = samples / (this.folder or kind)
    shutil.copytree(folder, work, dirs_exist_ok=True)
    path = rng.choice(sorted(work.glob(rng.choice(this.damaged))))
    if rng.random() < 0.02:
        damage_path(rng, path)
    else:
        every = sorted(file for file in samples.rglob("*") if file.is_file())
        others = [rng.choice(every).read_bytes() for _ in range(3)]
        path.write_bytes(mutated(rng, path.name, path.read_bytes(), others))
    (work / "damaged").mkdir()
    if path.is_file() and path.stat().st_size < 50_000_000:
        shutil.copy(path, work / "damaged")  # commands may write to the file itself
    use = rng.choice(this.uses)
    (work / "damaged" / "use.txt").write_text(f"{path.relative_to(work)}: {use}\n")
    use(path if path.parent.name != "ratings" else path.parent)


def judged(error: Exception) -> tuple[str, str]:
    """Whether a refusal is one: its cause must not be exhausted memory, and its message must be short."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError):
            return "failed", f"refused only after the memory was exhausted: {error}"
        cause = cause.__cause__ or cause.__context__
    text = str(error)
    if len(text) > MAX_MESSAGE and not isinstance(error, Refusal):
        return "failed", f"its message has {len(text)} characters: {text[:200]}"
    if isinstance(error, Sonata2dError) and "\n" in text:
        return "failed", f"its message has several lines: {text[:500]!r}"
    return "refused", text


def _described(error: BaseException) -> str:
    """The exception, and the last lines of sonata2d in its traceback."""
    if isinstance(error, OutOfTimeError):
        stack = [entry for entry in traceback.extract_tb(error.__traceback__) if "fuzz" not in entry.filename]
    else:
        stack = list(traceback.extract_tb(error.__traceback__))
    own = [entry for entry in stack if "/sonata2d/" in entry.filename or "/cli/" in entry.filename]
    places = " < ".join(f"{Path(entry.filename).name}:{entry.lineno}" for entry in reversed(own[-4:]))
    return f"{type(error).__name__}: {str(error)[:200]!r} at {places}"


@contextmanager
def time_limit(seconds: float = MAX_SECONDS) -> Iterator[None]:
    """Raise OutOfTimeError after so many seconds of processor time; wall time depends on what else the machine does."""

    def stop(number: int, frame: object) -> None:
        raise OutOfTimeError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _peak() -> int:
    """The largest memory that the process has used so far, kB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // (1024 if sys.platform == "darwin" else 1)


def run_cases(cases: list[tuple[str, int]], seed: int, samples: Path, failures: Path, workers: int) -> Iterator[Result]:
    """Run cases, (kind, index), in worker processes; the input of failed cases is copied to the folder `failures`."""
    queue, running = list(reversed(cases)), {}
    context = multiprocessing.get_context("fork")
    try:
        while queue or running:
            while queue and len(running) < workers:
                ours, theirs = context.Pipe()
                batch = [queue.pop() for _ in range(min(500, len(queue)))]
                process = context.Process(target=_work, args=(theirs, batch, seed, samples, failures))
                process.start()
                theirs.close()
                running[ours] = (process, batch, time.monotonic())
            for connection in wait(list(running), timeout=1.0):
                assert isinstance(connection, Connection)
                process, batch, _ = running[connection]
                try:
                    result = connection.recv()
                except EOFError:
                    process.join()
                    del running[connection]
                    if batch and process.exitcode:  # the case killed the worker
                        yield Result(*batch.pop(0), "failed", f"the process ended with {process.exitcode}", 0.0, 0.0)
                    queue.extend(reversed(batch))
                    continue
                batch.pop(0)
                running[connection] = (process, batch, time.monotonic())
                yield result
            for process, _, since in running.values():
                if time.monotonic() - since > _HARD_SECONDS:
                    process.kill()
    finally:  # after Ctrl-C; workers that nobody listens to would wait for ever
        for process, _, _ in running.values():
            process.kill()


def _work(connection: Connection, batch: list[tuple[str, int]], seed: int, samples: Path, failures: Path) -> None:
    """Run cases until one of them needs so much memory that the following ones could not be measured."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _HEADROOM, resource.RLIM_INFINITY))
    warnings.simplefilter("error", RuntimeWarning)  # NumPy warns of numbers that the reader should have refused
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, which shows the table
    start = _peak()
    for kind, index in list(batch):
        with tempfile.TemporaryDirectory(prefix="sonata2d-fuzz-", dir=_FAST) as work:
            result = run_case(kind, seed, index, samples, Path(work))
            if result.status == "failed":
                kept = failures / f"{kind}-{seed}-{index}"
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(work, kept, symlinks=True, ignore_dangling_symlinks=True)
                (kept / "failure.txt").write_text(f"{repeat(result, seed)}\n{result.detail}\n", errors="replace")
        connection.send(result)
        if _peak() - start > MAX_MEGABYTES * 512:
            break
    connection.close()
    os._exit(0)  # without the clean-up of libraries, which belongs to the parent


def repeat(result: Result, seed: int) -> str:
    """The command that runs a case again."""
    return f"python -m tests.fuzz --kind {result.kind} --seed {seed} --case {result.index}"
