"""Whether a notebook runs, and the progress bars that fit it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.util import find_spec
from typing import Any

Advance = Callable[[int], None]  # progress callback; its argument is the number of items finished since the last call
# a context that shows a progress bar: its arguments are the number of items and their name, `episodes`
ProgressBar = Callable[[int, str], AbstractContextManager[Advance]]


def notebook_shell() -> Any:
    """The shell of the running notebook, or None outside a notebook."""
    ipython = sys.modules.get("IPython")  # it is loaded where a notebook runs
    shell = None if ipython is None else ipython.get_ipython()
    return shell if hasattr(shell, "kernel") else None


def bar_of(progress: bool | ProgressBar | None) -> ProgressBar:
    """The function that shows progress.

    Args:
        progress: whether as a bar, in the form that fits a notebook or a terminal; None: only in a notebook. A function
            is returned as it is.
    """
    if callable(progress):
        return progress
    is_notebook = notebook_shell() is not None
    if not (is_notebook if progress is None else progress):
        return lambda total, unit: nullcontext(lambda steps: None)
    # without ipywidgets the form for notebooks fails, and the one for terminals is legible below a cell
    has_widgets = is_notebook and find_spec("ipywidgets") is not None
    tqdm = importlib.import_module("tqdm.notebook" if has_widgets else "tqdm").tqdm

    @contextmanager
    def bar(total: int, unit: str) -> Iterator[Advance]:
        with tqdm(total=total, desc=unit, leave=False) as shown:
            yield lambda steps: shown.update(steps) and None

    return bar
