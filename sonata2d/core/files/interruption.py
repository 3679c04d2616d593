"""Stopping long computations, and keeping the code of others from ending the process or changing its surroundings."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, NoReturn, TextIO

_MAX_DEPTH = 10  # of compiled functions that call each other
THREAD_GRACE = 1.0  # s, that a process waits at its end for threads that a controller has left running

_is_stop_requested: Callable[[], bool] = bool  # returns False
_ignores_signals = False
_received: KeyboardInterrupt | None = None


def stop_when(is_requested: Callable[[], bool]) -> None:
    """Let long computations of this process, such as compilations, end as soon as a function returns True.

    For worker processes, which ignore Ctrl-C: without a stop request, KeyboardInterrupt is treated as an error, see
    `reraise`.
    """
    global _is_stop_requested, _ignores_signals
    _is_stop_requested, _ignores_signals = is_requested, True


def interrupt(error: KeyboardInterrupt) -> NoReturn:
    """Raise an interruption in a signal handler, and remember it for `check`.

    Python ignores what is raised in a finalizer, and libraries ignore what is raised in some of their callbacks.

    Raises:
        KeyboardInterrupt: always, the one given.
    """
    global _received
    _received = error
    raise error


def forget() -> None:
    """Forget a signal that was received: the command that it interrupts is over."""
    global _received
    _received = None


def reraise(error: BaseException) -> None:
    """Raise an error again if it is an interruption, or follows one: Ctrl-C, SIGTERM or a stop request.

    Any other exception of code of others (controllers, pedestrian models, plug-ins) is an error of that code, also
    `SystemExit`, which would end a batch with exit code 0, and a `KeyboardInterrupt` where signals are ignored.

    >>> try:
    ...     raise GeneratorExit
    ... except BaseException as error:
    ...     reraise(error)
    """
    interruption = interruption_in(error)
    is_in_main = threading.current_thread() is threading.main_thread()  # other threads receive no signals
    if is_in_main and _received is not None:  # pydantic and others make it an error of their own
        raise _received
    if interruption is not None and ((is_in_main and not _ignores_signals) or _is_stop_requested() or _received):
        raise interruption


def interruption_in(error: BaseException) -> KeyboardInterrupt | None:
    """The interruption that an error is or wraps.

    A signal during compiled code makes a SystemError of Python, and one more in each of its callers that is compiled.
    """
    cause: BaseException | None = error
    for _ in range(_MAX_DEPTH):  # causes may form a circle
        if not isinstance(cause, SystemError):
            break
        cause = cause.__cause__
    return cause if isinstance(cause, KeyboardInterrupt) else None


def is_stop_requested() -> bool:
    """Whether this process is a worker that is asked to stop, see `stop_when`."""
    return _is_stop_requested()


def check() -> None:
    """Stop here if that was requested, or if a signal was received.

    Raises:
        KeyboardInterrupt: it was.
    """
    if _received is not None:
        raise _received
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
    """Restore the working folder and the standard streams if the code of others changes or closes them.

    Relative paths would otherwise name other files, and nothing could be printed. Does nothing outside the main thread,
    because all threads share them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    folder = working_folder()
    streams = {name: (getattr(sys, name), _opening(getattr(sys, name))) for name in ("stdout", "stderr")}
    try:
        yield
    finally:
        with suppress(OSError):  # it was removed meanwhile
            os.chdir(folder)
        for name, (stream, reopen) in streams.items():
            setattr(sys, name, reopen() if reopen is not None and stream.closed else stream)


def working_folder() -> str:
    """Absolute path of the working folder; `.` if the folder was removed."""
    try:
        return os.getcwd()
    except OSError:
        return os.curdir


def _opening(stream: Any) -> Callable[[], TextIO] | None:
    """Return a function that opens a standard stream again, whose file Python leaves open; None for other streams."""
    try:
        number = stream.fileno()
    except (OSError, ValueError, AttributeError):  # in memory, closed, or None
        return None
    if number not in (1, 2):
        return None
    return partial(open, number, "w", encoding=stream.encoding, errors=stream.errors, closefd=False)


class Blocks:
    """Context of blocks that take milliseconds and must not be left half done: signals take effect after a block."""

    def __init__(self) -> None:
        self.handlers: dict[int, Callable[[int, Any], Any]] = {}
        self._is_inside = False
        self._received: list[tuple[int, Any]] = []

    def handle(self, number: int, frame: Any) -> None:
        """Handle a signal, now or after the block."""
        if self._is_inside:
            self._received.append((number, frame))
        else:
            self.handlers[number](number, frame)

    def __enter__(self) -> None:
        self._is_inside = True

    def __exit__(self, *_: object) -> None:
        self._is_inside = False
        if self._received:
            received, self._received = self._received, []
            for each in received:
                self.handle(*each)


@contextmanager
def held_back() -> Iterator[Blocks]:
    """Let Ctrl-C and SIGTERM take effect between the blocks of a loop, where handlers are set once, not in each block.

    >>> with held_back() as blocks:
    ...     for _ in range(2):
    ...         with blocks:
    ...             pass  # is not interrupted
    """
    blocks = Blocks()
    if threading.current_thread() is threading.main_thread():  # another one gets no signals
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        blocks.handlers.update((number, handler) for number, handler in handlers.items() if callable(handler))
        for number in blocks.handlers:
            signal.signal(number, blocks.handle)
    try:
        yield blocks
    finally:
        for number, handler in blocks.handlers.items():
            if signal.getsignal(number) == blocks.handle:  # a controller may have set its own
                signal.signal(number, handler)
