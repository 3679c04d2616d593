"""Functions that numba compiles and the interpreter can run: one text, the same bits.

A kernel is written in the subset of Python that numba compiles: numbers, NumPy arrays, named tuples of them, loops and
branches. Where numba is missing or broken, or `NUMBA_DISABLE_JIT=1` is set, the interpreter runs the same text, more
slowly.

- `kernel` marks a function that ordinary Python calls. Numba compiles it at its first call; `compiled.cache` keeps the
  machine code in a file, from which later processes load it.
- `subroutine` marks a function that kernels call; it becomes a part of them. Called from ordinary Python, as in tests,
  it is run by the interpreter.

Kernels use ``+ - * /``, `sqrt` and comparisons only, and add in a fixed order, so that every processor gives the same
bits: fast-math stays off, and `core.scalar` has the elementary functions. Numba does not check indices unless
`NUMBA_BOUNDSCHECK=1` is set, as in some of the tests.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def _load_numba() -> tuple[Any, str]:
    """Numba, or None, and how kernels run, in words."""
    # Read here, although numba reads it too: importing numba takes longer than a short interpreted run.
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return None, "interpreted, because NUMBA_DISABLE_JIT is set"
    try:
        numba = import_module("numba")
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "numba":
            return None, "interpreted, some 30 times slower than compiled; pip install numba"
        # a version of NumPy that numba does not support, a missing library, ...
        cause = f"numba cannot be imported ({type(error).__name__}: {error})"
        return None, f"interpreted, because {cause}; pip install -U numba"
    if numba.config.DISABLE_JIT:  # by a configuration file
        return None, "interpreted, because numba's configuration disables compilation"
    return numba, f"compiled by numba {numba.__version__}"


_numba, BACKEND = _load_numba()
IS_COMPILED: bool = _numba is not None


# nogil: threads can run several worlds at a time. The error model "numpy" leaves out the check of every division.
_OPTIONS = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}


@cache
def say_if_slow() -> None:
    """Log a warning, once, that numba is missing; not where it was disabled or cannot be installed."""
    from multiprocessing import parent_process

    is_wanted = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0") and sys.platform != "emscripten"
    if is_wanted and not IS_COMPILED and parent_process() is None:
        with suppress(ValueError):  # standard error is closed
            logging.getLogger(__name__).warning("the simulation is %s", BACKEND)


def subroutine(function: F) -> F:
    """Mark a function that kernels call; see the module."""
    if _numba is None:
        return function
    from .linked import as_subroutine  # imports numba

    compiled: F = as_subroutine(_numba.njit(**_OPTIONS, no_cpython_wrapper=True)(function))
    return compiled


def kernel(function: F) -> F:
    """Mark a function that ordinary Python calls; see the module.

    A kernel releases the interpreter's lock and may be called first by several threads or processes at a time. Give
    its arguments the same types in every call: numba compiles it anew for an int in the place of a float, or for an
    array that is not contiguous.

    >>> import numpy as np
    >>> @kernel
    ... def total(values):
    ...     result = 0.0
    ...     for value in values:
    ...         result += value
    ...     return result
    >>> float(total(np.array([1.0, 2.0])))
    3.0
    """
    if _numba is None:
        return function
    from .cache import use_cache  # imports numba

    compiled: F = use_cache(_numba.njit(**_OPTIONS)(function))
    return compiled
