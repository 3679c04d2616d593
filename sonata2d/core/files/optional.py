"""Packages that need not be installed."""

from __future__ import annotations

import importlib
from typing import Any

from ...errors import Sonata2dError


def optional(package: str, error: type[Sonata2dError], *, extra: str | None = None) -> Any:
    """Import a package, or a module of one.

    Args:
        package: its name.
        error: class of the exception if it is not installed.
        extra: of sonata2d, which installs it, for the message.

    Raises:
        Sonata2dError: it is not installed; an instance of `error`.
    """
    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as missing:
        name = package.split(".")[0]
        what = name if extra is None else f"'sonata2d[{extra}]'"
        raise error(f"this needs {name}, which is not installed; pip install {what}") from missing
