"""Numbers of foreign files: what is none, or no finite one, is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.geometry import LARGEST
from ..core.portable_math import Array
from ..errors import RecordError
from ..record.files import read_bytes


def load_json(path: Path, format: str) -> Any:
    """The file as JSON gives it.

    Raises:
        RecordError: it cannot be read or is not whole JSON.
    """
    try:
        return orjson.loads(read_bytes(path))
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is no {format} file, it is not whole JSON: {error}") from error


def numbers(rows: Any, names: tuple[str, ...], place: str) -> Array:
    """(N, columns) of the numbers under these names in a list of objects.

    Raises:
        KeyError: one is missing.
        ValueError: one is no finite number below 1e11.
    """
    return table([[row[name] for name in names] for row in rows], len(names), f"{', '.join(names)} of {place}")


def table(rows: Any, width: int, place: str) -> Array:
    """(N, width) of finite numbers.

    Raises:
        ValueError: it is something else.
    """
    array = np.array(rows) if len(rows) else np.zeros((0, width))
    if array.dtype.kind not in "if" or array.shape != (len(rows), width):
        raise ValueError(f"{place} must be numbers")
    array = array.astype(np.float64)
    if not (np.abs(array) < LARGEST).all():
        raise ValueError(f"{place} must be finite numbers")
    return array
