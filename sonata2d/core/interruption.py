"""A request to stop that long computations of a process look at, such as compilations; worker processes set it."""

from __future__ import annotations

from collections.abc import Callable

is_requested: Callable[[], bool] = lambda: False  # noqa: E731  replaced in worker processes
ignores_signals = False  # set in worker processes, where no KeyboardInterrupt comes from Ctrl-C


def reraise(error: BaseException) -> None:
    """Raise an error again if it is an interruption: Ctrl-C, SIGTERM or a stop request.

    Everything else that the code of others (controllers, pedestrian models, plug-ins) raises is an error of that code:
    also `SystemExit`, which would end a batch with exit code 0, and a `KeyboardInterrupt` where signals are ignored.

    >>> try:
    ...     raise GeneratorExit
    ... except BaseException as error:
    ...     reraise(error)
    """
    if isinstance(error, KeyboardInterrupt) and (not ignores_signals or is_requested()):
        raise error


def check() -> None:
    """Stop here if that was requested.

    Raises:
        KeyboardInterrupt: it was.
    """
    if is_requested():
        raise KeyboardInterrupt
