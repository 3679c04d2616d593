"""Work in several processes or on several machines: an ordered map, and one that can stop early."""

from __future__ import annotations

import logging
import os
import pickle
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeVar

from ..core.arguments import whole_number
from ..core.files import interruption
from ..core.wording import described, shown
from ..errors import WorkerError
from .processes import ENDED, STOP_GRACE, Processes
from .tasks import Answer, Call, RaisedInWorker, applied, marked, origin, run_task

logger = logging.getLogger(__name__)

_POLL = 0.5  # s, between two looks whether Ctrl-C was pressed
_AHEAD = 4  # tasks for each worker that an ordered map may run ahead of the result that it waits for
_GROWTH = 2  # a task has at most this many times the items of the one before

T = TypeVar("T")
R = TypeVar("R")


class Workers:
    """Processes of this machine, or any executor, that do the work of one or several calls.

    The bytes of data sets do not depend on it. A context manager: at its end the processes that it started end; an
    executor that was given is left to the caller. Processes work in the folder in which the program is when a call
    begins.

    Args:
        executor: a number of processes, which start when they are first needed; with 1 the calling process does the
            work. Or a `concurrent.futures.Executor`, or an object with its method `submit`, such as the executors of
            mpi4py and submitit; `sonata2d.workers.DaskExecutor` connects to a Dask cluster.
        count: number of tasks that an executor runs at a time; None: as it says, or the number of processors.
        task_size: number of episodes that are sent at a time; None: as many as take about 0.25 s in a process of this
            machine, and 2 s in an executor, by the time that the last ones took.

    Raises:
        TypeError: the executor is something else.
        ValueError: a number is not positive.

    Example:
        >>> from concurrent.futures import ThreadPoolExecutor
        >>> import sonata2d as s2
        >>> with ThreadPoolExecutor(2) as executor, s2.Workers(executor) as workers:
        ...     comparison = s2.evaluate("straight-to-goal", "empty", episodes=4, workers=workers)
    """

    def __init__(self, executor: int | Executor = 1, *, count: int | None = None, task_size: int | None = None) -> None:
        self.task_size = task_size if task_size is None else whole_number("task_size", task_size, 1)
        if count is not None:
            whole_number("count", count, 1)
        self._backend: Processes | _CallersExecutor
        if callable(getattr(executor, "submit", None)):
            self._backend = _CallersExecutor(executor, count)
        elif isinstance(executor, float) or not hasattr(executor, "__index__"):
            raise TypeError(
                f"workers are a number of processes, or a concurrent.futures.Executor, got {shown(executor)}"
            )
        elif count is not None:
            raise ValueError("count is the number of tasks of an executor; a number of processes is given alone")
        else:
            self._backend = Processes(whole_number("workers", executor, 1))

    @property
    def count(self) -> int:
        """Number of tasks that run at a time."""
        return self._backend.count

    @property
    def is_local(self) -> bool:
        """Whether the workers are processes of this machine that end with this program."""
        return isinstance(self._backend, Processes)

    def place(self, path: Path) -> Path:
        """A path as the workers know it: only processes of this program share its working folder."""
        return path if self.is_local else path.absolute()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes that were started."""
        self._backend.close()

    def results(self, call: Call, items: Iterable[T], total: int | None, *, in_order: bool) -> Generator[Any]:
        """Apply the function of a call to items; closing the generator stops the workers.

        Args:
            call: the function, and the paths that it uses.
            items: arguments of the function; may be endless: only a few tasks for each worker are requested in advance.
            total: number of items; None: unknown.
            in_order: whether the results have the order of the items; else they come as they are finished.
        """
        if (self.is_local and self.count == 1) or total == 1:
            yield from _results_here(call, items)
            return
        sizes = _TaskSizes(self.task_size, self._backend.task_seconds, total)
        rest, lost, running = iter(items), deque[_Task](), dict[Any, _Task]()
        ready: dict[int, Answer] = {}  # of an ordered map, by number of the task
        submitted = yielded = 0  # tasks
        with self._backend.submitting(call) as submit:
            while True:
                count = max(self._backend.count, 1)
                while len(running) < 2 * count:
                    if lost:
                        task = lost.popleft()
                    elif in_order and submitted - yielded >= _AHEAD * count:
                        break
                    elif chunk := tuple(islice(rest, sizes.following(count))):
                        task = _Task(submitted, chunk)
                        submitted += 1
                    else:
                        break
                    running[submit(task.items)] = task
                if not running:
                    return
                for future in _finished(set(running)):
                    task = running.pop(future)
                    answer = self._backend.answer(future)
                    if answer is None:
                        lost.append(task)
                        continue
                    if answer[0] == "done":
                        sizes.learn(len(answer[1]), answer[2])
                    if not in_order:
                        yield from _results_of(answer)
                        continue
                    ready[task.number] = answer
                    while yielded in ready:
                        yield from _results_of(ready.pop(yielded))
                        yielded += 1
                interruption.check()


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    number: int
    items: Sequence[Any]


class _TaskSizes:
    """Numbers of items such that each task takes about the same time, whatever an item takes.

    Args:
        fixed: number of items; None: by the time that items take.
        seconds: that a task should take.
        total: number of all items; None: unknown, or without end.
    """

    def __init__(self, fixed: int | None, seconds: float, total: int | None) -> None:
        self._fixed, self._seconds, self._left = fixed, seconds, total
        self._size = 1  # the first items of a process also compile the simulation

    def following(self, count: int) -> int:
        """Number of items of the next task.

        Args:
            count: number of workers, among which the last items are divided.
        """
        size = self._fixed or self._size
        if self._left is not None:
            if self._fixed is None:
                size = max(1, min(size, self._left // (2 * count)))
            self._left = max(0, self._left - size)
        return size

    def learn(self, items: int, seconds: float) -> None:
        """Note how long the items of a task took."""
        if items:
            wanted = int(self._seconds / max(seconds / items, 1e-6))
            self._size = max(1, min(wanted, _GROWTH * max(items, self._size)))


class _CallersExecutor:
    """Backend that submits tasks to an executor, which belongs to the caller."""

    task_seconds = 2.0  # an executor may take milliseconds to send a task, and seconds to see that it is finished

    def __init__(self, executor: Any, count: int | None) -> None:
        self._executor, self._count = executor, count
        self._remarks: set[str] = set()

    @property
    def count(self) -> int:
        """As given, or what the executor says, which may change."""
        for name in ("count", "num_workers", "_max_workers"):  # of DaskExecutor, mpi4py, and the standard library
            count = getattr(self._executor, name, None)  # DaskExecutor also looks for lost tasks
            if isinstance(count, int):
                return self._count or count
        return self._count or os.cpu_count() or 1

    def close(self) -> None:
        """The executor belongs to the caller."""

    @contextmanager
    def submitting(self, call: Call) -> Iterator[Callable[[Sequence[Any]], Any]]:
        """Yields a function that submits a task; at the end the tasks that are not finished are cancelled."""
        submitted: set[Any] = set()

        def submit(items: Sequence[Any]) -> Any:
            try:
                future = self._executor.submit(run_task, origin(), pickled, items)
            except Exception as error:  # whatever the executor does
                raise WorkerError(f"{self._name} takes no tasks: {described(error)}") from error
            submitted.difference_update([task for task in submitted if task.done()])  # they hold their results
            submitted.add(future)
            return future

        try:
            with marked(call.writes) as mark:
                pickled = call.pickled(mark)
                yield submit
        finally:
            for future in submitted:
                if not future.done():
                    future.cancel()
            deadline = time.monotonic() + STOP_GRACE  # tasks that are running stop when they miss the mark
            while call.writes and any(not task.done() for task in submitted) and time.monotonic() < deadline:
                time.sleep(0.05)

    def answer(self, future: Any) -> Answer | None:
        """The answer of a finished task; None if the executor has lost it and has recovered.

        Raises:
            WorkerError: the executor cannot run it.
        """
        try:
            answer: Answer = future.result()
        except BaseException as error:  # whatever the executor and its futures raise
            interruption.reraise(error)
            recover = getattr(self._executor, "recover", None)
            if recover is not None and recover(future, error):
                return None
            is_version = isinstance(error, ImportError | AttributeError | pickle.UnpicklingError)
            remedy = "; install the same version of sonata2d on all machines" if is_version else ""
            raise WorkerError(f"{self._name} cannot run a task: {described(error)}{remedy}") from error
        if answer[3] and answer[3] not in self._remarks:
            self._remarks.add(answer[3])
            logger.warning("%s; files differ from files of this machine in their software block", answer[3])
        return answer

    @property
    def _name(self) -> str:
        return type(self._executor).__name__


def _finished(futures: set[Any]) -> set[Any]:
    """The tasks that are finished, after waiting for one for a time; futures of foreign classes are polled."""
    if all(isinstance(future, Future) for future in futures):
        return wait(futures, timeout=_POLL, return_when=FIRST_COMPLETED).done
    deadline = time.monotonic() + _POLL
    while not (done := {future for future in futures if future.done()}) and time.monotonic() < deadline:
        time.sleep(0.05)
    return done


def _results_of(answer: Answer) -> list[Any]:
    """The results of a task.

    Raises:
        WorkerError: the worker is refused, or was ended.
        Exception: the one that the worker's function raised.
    """
    kind, value = answer[:2]
    if kind == "raised":
        error, text = value
        raise error from RaisedInWorker(text)
    if kind == "refused":
        raise WorkerError(value)
    if kind == "stopped":
        raise WorkerError(ENDED)
    results: list[Any] = value
    return results


def parallel_map(
    function: Callable[[T], R],
    items: Iterable[T],
    *,
    workers: int | Executor | Workers,
    total: int | None = None,
    reads: Path | None = None,
    writes: Path | None = None,
) -> Iterator[R]:
    """Apply a function to each item and yield the results in the order of the items.

    Only a few items for each worker are in work or waiting at a time.

    Args:
        function: picklable if there are several workers.
        items: its arguments.
        workers: see `Workers`; with 1, or a single item, the calling process does the work.
        total: number of items, if they are no sequence.
        reads: a path that all workers must see, see `tasks.Call`.
        writes: folder in which workers write.
    """
    call = Call(partial(_itself, function), reads=reads, writes=writes)
    total = len(items) if isinstance(items, Sequence) else total
    with shared_workers(workers) as pool, closing(pool.results(call, items, total, in_order=True)) as results:
        yield from results


def _itself(function: Callable[[T], R]) -> Callable[[T], R]:
    return function


def shared_workers(workers: int | Executor | Workers) -> AbstractContextManager[Workers]:
    """The given workers, which stay as they are; or new ones for one call.

    Raises:
        TypeError, ValueError: as of `Workers`.
    """
    return nullcontext(workers) if isinstance(workers, Workers) else Workers(workers)


def _results_here(call: Call, items: Iterable[Any]) -> Iterator[Any]:
    """Results of the calling process, item by item."""
    function: Callable[[Any], Any] = applied(call.set_up)
    for item in items:
        result = applied(function, item)
        interruption.check()  # otherwise what a library made of the interruption is taken for a result
        yield result
