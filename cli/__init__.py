"""The command line of sonata2d, installed as the package `sonata2d_cli`: arguments in, text and exit code out."""

import os
import signal
import threading
from types import FrameType


def _end_start(number: int, frame: FrameType | None) -> None:
    """End the program on Ctrl-C while its modules are loaded, when nothing has been done.

    A KeyboardInterrupt there can become any other error, as Python wraps those of class definitions.
    """
    os.write(2, b"\ninterrupted\n")
    os._exit(128 + number)


_handles_interrupts = (
    threading.current_thread() is threading.main_thread()
    and signal.getsignal(signal.SIGINT) is signal.default_int_handler
)
if _handles_interrupts:
    signal.signal(signal.SIGINT, _end_start)

from .main import main  # noqa: E402

if _handles_interrupts:
    signal.signal(signal.SIGINT, signal.default_int_handler)

__all__ = ["main"]
