"""Stopping long computations, and keeping the code of others from ending the process or changing its surroundings."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

THREAD_GRACE = 1.0  # s, that a process waits at its end for threads that a controller has left running

_is_stop_requested: Callable[[], bool] = lambda: False  # noqa: E731
_ignores_signals = False


def stop_when(is_requested: Callable[[], bool]) -> None:
    """Let long computations of this process, such as compilations, end as soon as a function returns True.

    For worker processes, which ignore Ctrl-C: a KeyboardInterrupt without that request is none, see `reraise`.
    """
    global _is_stop_requested, _ignores_signals
    _is_stop_requested, _ignores_signals = is_requested, True


def reraise(error: BaseException) -> None:
    """Raise an error again if it is an interruption: Ctrl-C, SIGTERM or a stop request.

    Everything else that the code of others (controllers, pedestrian models, plug-ins) raises is an error of that code:
    also `SystemExit`, which would end a batch with exit code 0, and a `KeyboardInterrupt` where signals are ignored.

    >>> try:
    ...     raise GeneratorExit
    ... except BaseException as error:
    ...     reraise(error)
    """
    if isinstance(error, KeyboardInterrupt) and (not _ignores_signals or _is_stop_requested()):
        raise error


def check() -> None:
    """Stop here if that was requested.

    Raises:
        KeyboardInterrupt: it was.
    """
    if _is_stop_requested():
        raise KeyboardInterrupt


@contextmanager
def exits_raised() -> Iterator[None]:
    """Turn `os._exit` into `SystemExit` in the main thread of this process.

    It would end the whole command, with any exit code, although work is missing. Other threads and processes that are
    forked in the meantime exit as usual.
    """
    process, real_exit = os.getpid(), os._exit

    def raise_exit(status: int) -> NoReturn:
        if os.getpid() != process or threading.current_thread() is not threading.main_thread():
            real_exit(status)
        raise SystemExit(status)

    os._exit = raise_exit
    try:
        yield
    finally:
        os._exit = real_exit


@contextmanager
def surroundings_kept() -> Iterator[None]:
    """Go back to the working folder, and open standard output again, if the code of others leaves or closes it.

    Relative paths would otherwise name other files, and nothing could be printed.
    """
    try:
        folder = os.getcwd()
    except OSError:  # it was removed
        folder = os.curdir
    stdout, encoding = sys.stdout, getattr(sys.stdout, "encoding", None)
    try:
        yield
    finally:
        with suppress(OSError):  # it was removed meanwhile
            os.chdir(folder)
        if stdout is not None and stdout.closed and stdout is sys.__stdout__:
            # Python leaves the file open, and closes only its own object
            sys.stdout = open(1, "w", encoding=encoding, closefd=False)  # noqa: SIM115
