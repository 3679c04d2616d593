"""Signals, and the end of a command: interruptions, exit codes, and threads that keep the program alive."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import click

from sonata2d.core.files.interruption import THREAD_GRACE, check, forget, interrupt

EXIT_BUG = 70  # EX_SOFTWARE of sysexits.h
_DELICATE_GRACE = 2.0  # s, after which an interruption does not wait any more


class Terminated(KeyboardInterrupt):
    """SIGTERM was received, as from a cluster that needs the machine."""


@contextmanager
def raising_interruptions() -> Iterator[None]:
    """Raise `Terminated` on SIGTERM, so that work in progress ends in an orderly way, as on Ctrl-C.

    Both wait for the end of an import, because some extension modules crash if an exception is raised while they are
    loaded, and until a world was freed, where cffi or Python would print the exception and go on. An error that follows
    a signal is raised as that interruption, because libraries turn interruptions into other errors.
    """
    deadline = math.inf

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal deadline
        now = time.monotonic()
        deadline = min(deadline, now + _DELICATE_GRACE)
        if _is_delicate(frame) and now < deadline:
            again = threading.Timer(0.01, interrupt_main, [number])
            again.daemon = True
            again.start()
            return
        deadline = math.inf
        interrupt(Terminated() if number == signal.SIGTERM else KeyboardInterrupt())

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # a background job of a shell ignores it
        numbers.append(signal.SIGINT)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    except BaseException:
        check()
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        forget()


def _is_delicate(frame: FrameType | None) -> bool:
    """Whether a module is being loaded, or pymunk or a destructor of sonata2d is freeing memory."""
    while frame is not None:
        code = frame.f_code
        if code.co_filename == "<frozen importlib._bootstrap>":
            return True
        path = Path(code.co_filename)
        if "free" in code.co_name and path.parent.name == "pymunk":
            return True
        if code.co_name == "__del__" and "sonata2d" in path.parts:
            return True
        frame = frame.f_back
    return False


def exit_interrupted(error: KeyboardInterrupt, hint: str = "") -> NoReturn:
    """Say that the command was interrupted, and exit with the code that shells expect: 128 plus the signal."""
    forget()
    is_terminated = isinstance(error, Terminated)
    click.echo(f"\n{'terminated' if is_terminated else 'interrupted'}{hint}", err=True)
    raise click.exceptions.Exit(128 + (signal.SIGTERM if is_terminated else signal.SIGINT)) from None


def exit_despite_threads(code: Any) -> None:
    """Let the program end after a moment, even if threads that a controller has left running would keep it alive.

    Args:
        code: of `SystemExit`.
    """
    if not _running_threads():
        return

    def exit_process() -> None:
        deadline = time.monotonic() + THREAD_GRACE
        while threads := _running_threads():
            if time.monotonic() > deadline:
                break
            time.sleep(0.01)
        else:
            return  # the program ends as usual
        names = ", ".join(thread.name for thread in threads)
        with suppress(OSError, ValueError):  # the streams may be closed or full
            click.echo(f"Warning: threads are still running and are ended: {names}; make them daemon threads", err=True)
        with suppress(OSError, ValueError):
            sys.stdout.flush()
        os._exit(code if isinstance(code, int) else int(code is not None))

    threading.Thread(target=exit_process, daemon=True).start()


def _running_threads() -> list[threading.Thread]:
    """Threads that keep the program alive."""
    return [thread for thread in threading.enumerate() if not (thread is threading.main_thread() or thread.daemon)]
