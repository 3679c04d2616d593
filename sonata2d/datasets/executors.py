"""Worker processes, which several calls can share: an ordered map, and one that can stop early."""

from __future__ import annotations

import gc
import logging
import os
import pickle
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from functools import cached_property, partial
from itertools import islice
from multiprocessing import current_process, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.synchronize import Event
from multiprocessing.util import Finalize
from typing import Any, Self, TypeVar

from ..core import interruption
from ..errors import PluginWarning, WorkerError
from ..registry import registered_objects, restore_registered

logger = logging.getLogger(__name__)

_PACKAGE = "sonata2d"  # name of the logger of the whole package
CHUNK_SIZE = 4  # items sent to a worker at a time
_POLL = 0.5  # s, between two looks at the processes of a pool that is being stopped
STOP_GRACE = 5.0  # s, that processes have to finish their items after Ctrl-C or SIGTERM
_WORKER = "sonata2d-worker-"  # beginning of the names of worker processes
_UNGUARDED = 78  # exit code of a worker process whose script lacks `if __name__ == "__main__":`
_TERM_GRACE = 2.0  # s, between SIGTERM and the end of a worker process

T = TypeVar("T")
R = TypeVar("R")


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


class Workers:
    """Worker processes that several calls share; they start when a call first needs them, and end with the context.

    Starting a process takes as long as running dozens of episodes.

    Args:
        count: number of processes; with 1 the calling process does the work.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._open_calls = 0  # they share the stop request

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pool = vars(self).get("_pool")
        if pool is not None:
            with self._ended_by_interruption():
                self._stop.set()  # each worker finishes its current item only
                pool.shutdown()

    def ordered(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        """See `parallel_map`."""
        if self.count <= 1 or len(items) <= 1:
            yield from _results(function, items)
            return
        chunks = [items[start : start + CHUNK_SIZE] for start in range(0, len(items), CHUNK_SIZE)]
        with self._submitting() as submit:
            run = partial(_map_chunk, _WithRegistered(function))
            for future, chunk in zip(submit(run, chunks), chunks, strict=True):
                while not wait([future], timeout=_POLL).done:  # without a time limit Windows does not see Ctrl-C
                    interruption.check()
                results = future.result()
                if len(results) < len(chunk):
                    raise WorkerError("the worker processes were ended before their work was done; begin again")
                yield from results

    def unordered(
        self, set_up: Callable[[], Callable[[T], R]], items: Iterator[T], is_last: Callable[[R], bool]
    ) -> Generator[R, None, None]:
        """See `unordered_map`."""
        if self.count <= 1:
            yield from _results(_apply(set_up), items)
            return
        run = partial(_run_chunk, pickle.dumps((_WithRegistered(set_up), is_last)))
        pending: set[Future[list[R]]] = set()
        chunks = iter(lambda: tuple(islice(items, CHUNK_SIZE)), ())
        with self._submitting() as submit:
            while True:
                pending.update(submit(run, list(islice(chunks, 2 * self.count - len(pending)))))
                if not pending:
                    return
                finished, pending = wait(pending, timeout=_POLL, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield from future.result()
                interruption.check()

    @contextmanager
    def _submitting(self) -> Iterator[Callable[[Callable[[Any], Any], list[Any]], list[Future[Any]]]]:
        """Yields a function that lets the processes apply a function to arguments; at the end they are free again.

        Raises:
            WorkerError: a process cannot be started, or crashed.
        """
        with self._starting():
            pool, stop = self._pool, self._stop
        unfinished: set[Future[Any]] = set()
        end = threading.Timer(STOP_GRACE, self._kill)  # a controller may never return
        end.daemon = True

        def submit(function: Callable[[Any], Any], arguments: list[Any]) -> list[Future[Any]]:
            with self._starting():
                submitted = [pool.submit(function, argument) for argument in arguments]
                unfinished.update(submitted)
            for future in submitted:
                future.add_done_callback(unfinished.discard)  # a finished future holds its results
            return submitted

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
            # Pending chunks end at once, because of the stop request, unless another call needs the processes. They
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


def parallel_map(function: Callable[[T], R], items: Sequence[T], *, workers: int | Workers) -> Iterator[R]:
    """Apply a function to each item and yield the results in the order of the items.

    Args:
        function: picklable if `workers` is above 1.
        items: its arguments.
        workers: processes, or their number; with 1, or a single item, the calling process does the work.
    """
    end_if_unguarded()
    with _shared(workers) as pool:
        yield from pool.ordered(function, items)


def unordered_map(
    set_up: Callable[[], Callable[[T], R]], items: Iterator[T], *, workers: int | Workers, is_last: Callable[[R], bool]
) -> Generator[R, None, None]:
    """Apply a function to items and yield the results as they are finished; closing the generator stops the workers.

    `items` may be endless: only a few chunks per worker are requested in advance.

    Args:
        set_up: returns the function; called once in each worker process. Picklable if `workers` is above 1.
        items: arguments of the function.
        workers: processes, or their number; with 1 the calling process does the work.
        is_last: whether a worker skips the rest of its chunk after this result. Picklable if `workers` is above 1.
    """
    with _shared(workers) as pool, closing(pool.unordered(set_up, items, is_last)) as results:
        yield from results


@contextmanager
def _shared(workers: int | Workers) -> Iterator[Workers]:
    """The given workers, or new ones for one call."""
    if isinstance(workers, Workers):
        yield workers
        return
    with Workers(workers) as own:
        yield own


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


# Set in each worker process: the request to stop, and the functions of the present call, pickled and ready for use.
_stop_request: Event
_present_call: tuple[bytes, Any, Any] = b"", None, None


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
    global _stop_request
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
    _stop_request = stop
    interruption.stop_when(stop.is_set)


def _apply(function: Callable[..., R], *arguments: Any) -> R:
    """The result of a function, which may run the code of others."""
    with interruption.surroundings_kept():
        return function(*arguments)


def _results(function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """Results of the calling process, item by item."""
    for item in items:
        interruption.check()
        yield _apply(function, item)


class _WithRegistered:
    """A function for another process, in which the objects that are registered in this one are known as well."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self._registered = function, registered_objects()

    def __call__(self, *arguments: Any) -> Any:
        restore_registered(self._registered)
        return self._function(*arguments)


def _map_chunk(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Results for the items of a chunk, up to a stop request."""
    results: list[R] = []
    for item in items:
        if _stop_request.is_set():
            break
        results.append(_apply(function, item))
    return results


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


def _run_chunk(pickled_call: bytes, items: Sequence[Any]) -> list[Any]:
    """Results for the items of a chunk, up to a stop request or a last result.

    Args:
        pickled_call: `set_up` and `is_last` of `unordered_map`.
        items: arguments of the function.
    """
    global _present_call
    if _present_call[0] != pickled_call:
        set_up, is_last = pickle.loads(pickled_call)
        _present_call = pickled_call, _apply(set_up), is_last
        gc.freeze()  # the imported modules stay: searching them for garbage takes 45 ms each time
    _, function, is_last = _present_call
    results: list[Any] = []
    for item in items:
        if _stop_request.is_set():
            break
        try:
            results.append(_apply(function, item))
        except KeyboardInterrupt:  # of `interruption`: the item's compilation was given up
            break
        if is_last(results[-1]):
            break
    return results
