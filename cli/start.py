"""Ctrl-C and SIGTERM while the program starts. Imports little, because it is loaded before everything else."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_USUAL: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, b"\nterminated\n" if number == signal.SIGTERM else b"\ninterrupted\n")
    os._exit(128 + number)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """End the process on Ctrl-C or SIGTERM at once, with one line: for parts of the program that have no result yet.

    A KeyboardInterrupt there can become any other error, as Python wraps errors of class definitions, and click answers
    one with "Aborted!"; SIGTERM would end the process without a line. A signal that is ignored or handled otherwise, as
    in tests, stays so. Before this module is loaded, Python itself answers signals.
    """
    is_main = threading.current_thread() is threading.main_thread()
    numbers = [number for number, usual in _USUAL.items() if is_main and signal.getsignal(number) is usual]
    for number in numbers:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, _USUAL[number])
