"""A request to stop that long computations of a process look at, such as compilations; worker processes set it."""

from __future__ import annotations

from collections.abc import Callable

is_requested: Callable[[], bool] = lambda: False  # noqa: E731  replaced in worker processes


def check() -> None:
    """Stop here if that was requested.

    Raises:
        KeyboardInterrupt: it was.
    """
    if is_requested():
        raise KeyboardInterrupt
