"""Local worker processes: how they start, stop, and are ended after a crash."""

from __future__ import annotations

import gc
import logging
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cached_property
from multiprocessing import current_process, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.synchronize import Event
from multiprocessing.util import Finalize
from typing import Any

from ..core.files import interruption
from ..core.files.locations import is_remote
from ..errors import PluginWarning, WorkerError
from . import tasks
from .tasks import Answer, Call, marked, origin, run_task

logger = logging.getLogger(__name__)

_PACKAGE = "sonata2d"  # name of the logger of the whole package
_POLL = 0.5  # s, between two looks at the processes of a pool that is being stopped
STOP_GRACE = 5.0  # s, that processes have to finish their items after Ctrl-C or SIGTERM
_WORKER = "sonata2d-worker-"  # beginning of the names of worker processes
_UNGUARDED = 78  # exit code of a worker process whose script lacks `if __name__ == "__main__":`
ENDED = "the workers were ended before their work was done; begin again"
_TERM_GRACE = 2.0  # s, between SIGTERM and the end of a worker process


class _Context(SpawnContext):
    """Starts processes in the same way on every system, and knows them."""

    def __init__(self) -> None:
        super().__init__()
        self._processes: list[SpawnProcess] = []

    def Process(self, *args: Any, **settings: Any) -> SpawnProcess:  # type: ignore[override]
        """A process that is about to be started."""
        process = SpawnProcess(*args, **settings)
        process.name = f"{_WORKER}{len(self._processes) + 1}"
        self._processes.append(process)
        return process

    def is_alive(self) -> bool:
        """Whether a process is running."""
        return any(process.is_alive() for process in self._processes)

    def lacks_guard(self) -> bool:
        """Whether a process ended because the script that it imported called for processes again."""
        started = [process for process in self._processes if process.pid is not None]
        for process in started:
            process.join(_POLL)
        return any(process.exitcode == _UNGUARDED for process in started)

    def kill(self) -> None:
        """End all processes at once."""
        for process in self._processes:
            if process.pid is not None:  # it was started
                process.kill()


class Processes:
    """Worker processes of this machine, which several calls share.

    They start when a call first needs them: starting one takes as long as running dozens of episodes.

    Args:
        number: of processes.
    """

    task_seconds = 0.25  # a task is short, so that progress is shown often, and much longer than sending it takes

    def __init__(self, number: int) -> None:
        self._number = number
        self._open_calls = 0  # they share the stop request

    @property
    def count(self) -> int:
        """Number of tasks that run at a time."""
        return self._number

    def close(self) -> None:
        """End the processes."""
        pool = vars(self).get("_pool")
        if pool is not None:
            with self._ended_by_interruption():
                self._stop.set()  # each worker finishes its current item only
                pool.shutdown()

    def answer(self, future: Future[Answer]) -> Answer:
        """The answer of a finished task."""
        return future.result()

    @contextmanager
    def submitting(self, call: Call) -> Iterator[Callable[[Sequence[Any]], Future[Answer]]]:
        """Yields a function that lets a process work on items; at the end the processes are free again.

        Raises:
            WorkerError: a process cannot be started, or crashed.
        """
        for path in (call.reads, call.writes):
            if getattr(path, "protocol", None) == "memory":
                raise WorkerError(f"{path} belongs to this process; use one worker (workers=1, --workers 1)")
        written_store = call.writes if is_remote(call.writes) else None
        folder = interruption.working_folder()
        with marked(written_store) as mark, self._submitting(call.pickled(mark, folder)) as submit:
            yield submit

    @contextmanager
    def _submitting(self, pickled: bytes) -> Iterator[Callable[[Sequence[Any]], Future[Answer]]]:
        with self._starting():
            pool, stop = self._pool, self._stop
        unfinished: set[Future[Answer]] = set()
        end = threading.Timer(STOP_GRACE, self._kill)  # a controller may never return
        end.daemon = True

        def submit(items: Sequence[Any]) -> Future[Answer]:
            try:
                with self._starting():
                    future = pool.submit(run_task, origin(), pickled, items)
                    unfinished.add(future)
            except BrokenProcessPool:
                raise
            except RuntimeError as error:  # the pool was shut down
                raise WorkerError(ENDED) from error
            future.add_done_callback(unfinished.discard)  # a finished future holds its results
            return future

        if self._open_calls == 0:
            stop.clear()
        self._open_calls += 1
        try:
            with self._crashes_explained():
                yield submit
        except (KeyboardInterrupt, GeneratorExit) as error:
            # a generator is closed if the caller is interrupted, or needs no further results
            if isinstance(error, KeyboardInterrupt) or isinstance(error.__context__, KeyboardInterrupt):
                with self._ended_by_interruption():
                    end.start()
                    logger.warning("stopping: the worker processes have %.0f s to finish their episodes", STOP_GRACE)
            raise
        finally:
            # Pending tasks end at once, because of the stop request, unless another call needs the processes. They
            # are not cancelled: if a process has been killed meanwhile, the pool fails on cancelled futures (3.11).
            with self._ended_by_interruption():
                self._open_calls -= 1
                if self._open_calls == 0 and vars(self).get("_stop") is stop:
                    stop.set()
                # A future that was submitted while the pool broke is never finished, but then no process is left.
                while self._context.is_alive() and wait(list(unfinished), timeout=_POLL).not_done:
                    pass
            end.cancel()

    @contextmanager
    def _crashes_explained(self) -> Iterator[None]:
        """End all processes after the crash of one, and say what to do.

        Raises:
            WorkerError: a worker process crashed.
        """
        try:
            yield
        except BrokenProcessPool as error:
            lacks_guard = self._context.lacks_guard()
            self._kill()  # the others would finish items of which the caller does not learn
            if lacks_guard:
                raise WorkerError(
                    "each worker process imports the script, which then starts the work again; put the lines that "
                    "start it below if __name__ == '__main__':"
                ) from None
            raise WorkerError(
                "a worker process crashed or was killed; if memory was short, use fewer workers, and if a kernel of "
                "your own is used, look for an index outside an array with NUMBA_BOUNDSCHECK=1 and one worker"
            ) from error

    @contextmanager
    def _ended_by_interruption(self) -> Iterator[None]:
        """End the processes at once on Ctrl-C or SIGTERM while this block waits for them."""
        try:
            yield
        except KeyboardInterrupt:
            self._kill()
            raise

    def _kill(self) -> None:
        """End the processes; their files are complete or not there, because files are written atomically.

        The next call starts new ones, with a new request: a process that is killed may keep the lock of the old one.
        """
        self._context.kill()
        for name in ("_pool", "_stop"):
            vars(self).pop(name, None)

    @contextmanager
    def _starting(self) -> Iterator[None]:
        """Start processes in this block: whole, or not at all.

        Raises:
            WorkerError: the system refuses a process.
        """
        try:
            with _signals_deferred():
                yield
        except OSError as error:
            self._kill()  # they would wait for work, and the program for them
            raise WorkerError(
                f"a worker process cannot be started: {error.strerror or error}; use fewer workers, or raise the limit "
                "of open files (ulimit -n)"
            ) from error

    @cached_property
    def _context(self) -> _Context:
        return _Context()

    @cached_property
    def _pool(self) -> ProcessPoolExecutor:
        arguments = self._stop, logging.getLogger(_PACKAGE).level, warnings.formatwarning
        return ProcessPoolExecutor(self.count, mp_context=self._context, initializer=_start_worker, initargs=arguments)

    @cached_property
    def _stop(self) -> Event:
        return self._context.Event()


@contextmanager
def _signals_deferred() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back until the block ends: in it processes may be started.

    Half-started processes end with a traceback, so the handlers wait; and processes inherit that both are blocked.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, _: caught.append(number)) or signal.SIG_DFL
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, handlers.keys()) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if caught:
            signal.raise_signal(caught[0])


def end_if_unguarded() -> None:
    """End this process if it is a worker that is importing the script of its parent, which calls for work again.

    The parent raises the error: the traceback of each worker would hide it.
    """
    process = current_process()
    if process.name.startswith(_WORKER) and getattr(process, "_inheriting", False):
        os._exit(_UNGUARDED)


def end_if_forked(process: int) -> None:
    """End this process if it is not the given one, but a copy that the code of others has forked from it.

    A copy that returns from a controller would run the batch a second time.

    Args:
        process: id of the process that began the work.
    """
    if os.getpid() != process:
        logger.warning(
            "process %d was forked from process %d by the controller, and is ended because it went on with the batch;"
            " end such a process with os._exit",
            os.getpid(),
            process,
        )
        os._exit(1)


def _start_worker(stop: Event, level: int, format_warning: Callable[..., str]) -> None:
    """Prepare a worker process: it ignores Ctrl-C, exits with its parent or after its work, and logs like it.

    Args:
        stop: request to stop.
        level: of the parent's logger.
        format_warning: the parent's `warnings.formatwarning`.
    """
    warnings.formatwarning = format_warning
    warnings.simplefilter("ignore", PluginWarning)  # the parent has loaded the same plug-ins
    if level != logging.NOTSET:
        logging.getLogger(_PACKAGE).setLevel(level)
        logging.basicConfig()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def exit_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=exit_with_parent, daemon=True).start()
    if hasattr(signal, "sigwait"):
        threading.Thread(target=_exit_after_sigterm, daemon=True).start()
    Finalize(None, _exit_soon, exitpriority=0)  # runs after the last item; otherwise the exit waits for all threads
    interruption.stop_when(stop.is_set)
    tasks.after_set_up = gc.freeze  # the imported modules stay: searching them for garbage takes 45 ms each time


def _exit_after_sigterm() -> None:
    """End this worker process some time after SIGTERM.

    Clusters send SIGTERM to all processes of a batch. A worker that ended at once would break the pool while the parent
    still starts processes, and the pool of Python 3.11 can then wait for ever. So the parent, which gets the signal
    too, has the time to end the batch. The pool ends its processes by SIGTERM as well, after a crash of one of them.
    """
    signal.sigwait({signal.SIGTERM})
    time.sleep(_TERM_GRACE)
    os._exit(128 + signal.SIGTERM)


def _exit_soon() -> None:
    """End a worker process that is done, even if a controller has left threads running."""

    def exit_process() -> None:
        time.sleep(interruption.THREAD_GRACE)
        os._exit(0)

    threading.Thread(target=exit_process, daemon=True).start()
