"""Worker processes: an ordered map over files, and a pool of generation workers that can stop early."""

from __future__ import annotations

import gc
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.synchronize import Event
from typing import Any, TypeVar

from ..errors import Sonata2dError

CHUNK_SIZE = 4  # items sent to a worker at a time

Advance = Callable[[int], None]  # progress callback; its argument is the number of items finished since the last call

T = TypeVar("T")
R = TypeVar("R")


def parallel_map(function: Callable[[T], R], items: Sequence[T], *, workers: int) -> Iterator[R]:
    """Apply a function to each item and yield the results in the order of the items.

    Args:
        function: picklable if `workers` is above 1.
        items: its arguments.
        workers: number of processes; with 1, or a single item, the calling process does the work.
    """
    if workers <= 1 or len(items) <= 1:
        yield from map(function, items)
        return
    with _crashes_explained(), ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(function, items, chunksize=CHUNK_SIZE)


@contextmanager
def _crashes_explained() -> Iterator[None]:
    """Turn the crash of a worker process into an error that says what to do.

    Raises:
        Sonata2dError: a worker process crashed.
    """
    try:
        yield
    except BrokenProcessPool as error:
        raise Sonata2dError(
            "a worker process crashed or was killed; if memory was short, use fewer workers, and if a kernel of your "
            "own is used, look for an index outside an array with NUMBA_BOUNDSCHECK=1 and one worker"
        ) from error


def unordered_map(
    set_up: Callable[[], Callable[[T], R]], items: Iterator[T], *, workers: int, is_last: Callable[[R], bool]
) -> Generator[R, None, None]:
    """Apply a function to items and yield the results as they are finished; closing the generator stops the workers.

    `items` may be endless: only a few chunks per worker are requested in advance.

    Args:
        set_up: returns the function; called once in each worker process. Picklable if `workers` is above 1.
        items: arguments of the function.
        workers: number of processes; with 1 the calling process does the work.
        is_last: whether a worker skips the rest of its chunk after this result. Picklable if `workers` is above 1.
    """
    if workers <= 1:
        yield from map(set_up(), items)
        return
    context = get_context("spawn")  # the same start method on every system
    stop = context.Event()
    with (
        _crashes_explained(),
        ProcessPoolExecutor(
            workers, mp_context=context, initializer=_start_worker, initargs=(set_up, is_last, stop)
        ) as pool,
    ):
        try:
            yield from _submit_chunks(pool, _chunks(items), maximum_pending=2 * workers)
        finally:
            stop.set()  # each worker finishes its current item only
            pool.shutdown(cancel_futures=True)


def _submit_chunks(
    pool: ProcessPoolExecutor, chunks: Iterator[Sequence[Any]], *, maximum_pending: int
) -> Iterator[Any]:
    """Keep a bounded number of chunks submitted and yield results in the order in which chunks are finished."""
    pending: set[Future[list[Any]]] = set()
    while True:
        pending |= {pool.submit(_run_chunk, chunk) for chunk in islice(chunks, maximum_pending - len(pending))}
        if not pending:
            return
        finished, pending = wait(pending, return_when=FIRST_COMPLETED)
        for future in finished:
            yield from future.result()


def _chunks(items: Iterable[T]) -> Iterator[tuple[T, ...]]:
    rest = iter(items)
    while chunk := tuple(islice(rest, CHUNK_SIZE)):
        yield chunk


_worker: tuple[Callable[[Any], Any], Callable[[Any], bool], Event] | None = None  # set once in each worker process


def _start_worker(set_up: Callable[[], Callable[[Any], Any]], is_last: Callable[[Any], bool], stop: Event) -> None:
    """Prepare a worker process: it ignores Ctrl-C and exits when its parent process ends."""
    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def exit_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=exit_with_parent, daemon=True).start()
    _worker = set_up(), is_last, stop
    gc.freeze()  # the imported modules stay: searching them for garbage takes 45 ms each time


def _run_chunk(items: Sequence[Any]) -> list[Any]:
    """Results for the items of a chunk, up to a stop request or a last result."""
    assert _worker is not None
    function, is_last, stop = _worker
    results: list[Any] = []
    for item in items:
        if stop.is_set():
            break
        results.append(function(item))
        if is_last(results[-1]):
            break
    return results
