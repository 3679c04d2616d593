"""Ctrl-C while the program starts. Imports little, because it is loaded before everything else."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, b"\ninterrupted\n")
    os._exit(128 + number)


@contextmanager
def ended_by_ctrl_c() -> Iterator[None]:
    """End the process on Ctrl-C at once, with one line: for parts of the program that have no result yet.

    A KeyboardInterrupt there can become any other error, as Python wraps errors of class definitions, and click answers
    one with "Aborted!". Does nothing where Ctrl-C is ignored or handled otherwise, as in tests.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
