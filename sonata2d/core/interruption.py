"""Stopping long computations, and keeping the code of others from ending the process."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

THREAD_GRACE = 1.0  # s, that a process waits at its end for threads that a controller has left running

_is_stop_requested: Callable[[], bool] = lambda: False  # noqa: E731


def stop_when(is_requested: Callable[[], bool]) -> None:
    """Let long computations of this process, such as compilations, end as soon as a function returns True."""
    global _is_stop_requested
    _is_stop_requested = is_requested


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
