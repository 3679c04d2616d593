"""Reading `.npz` files within limits of size, and writing them so that the same arrays give the same bytes."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from .limits import MAX_ARCHIVE_WITHOUT_RATIO, MAX_UNPACKED_RATIO
from .whole_file import whole_file

_READ_HEADER = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_npz(data: bytes, max_bytes: int, names: Collection[str] | None = None) -> dict[str, Any]:
    """Read the arrays of an archive. Declared sizes are checked before anything is unpacked; nothing is executed.

    Args:
        data: content of the file.
        max_bytes: maximum size of all arrays.
        names: of the arrays to read; None: all.

    Returns:
        Arrays by name.

    Raises:
        KeyError: an array is missing.
        ValueError: the archive is damaged, or its arrays exceed a limit, hold objects or differ from their headers.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
            total = sum(entry.file_size for entry in entries.values())
            limit = min(max_bytes, max(MAX_ARCHIVE_WITHOUT_RATIO, MAX_UNPACKED_RATIO * len(data)))
            if total > limit:
                raise ValueError(f"it unpacks from {len(data)} to {total} bytes; the limit is {limit}")
            return {name: _array(archive.read(entries[name]), name) for name in (entries if names is None else names)}
    except (KeyError, MemoryError, ValueError):
        raise
    except Exception as error:  # e.g. BadZipFile, zlib.error, struct.error, TokenError
        raise ValueError(f"it is truncated or damaged: {error}") from error


def _array(data: bytes, name: str) -> Any:
    """Read an array whose header declares exactly the bytes that follow it."""
    file = io.BytesIO(data)
    version = npy.read_magic(file)
    if version not in _READ_HEADER:
        raise ValueError(f"{name} has version {version} of the array format; known are 1.0 and 2.0")
    try:
        shape, fortran, dtype = _READ_HEADER[version](file)
    except MemoryError as error:  # of Python's parser
        raise ValueError(f"the header of {name} is nested too deeply") from error
    content = data[file.tell() :]
    count = math.prod(shape)  # Python integers do not overflow
    if dtype.hasobject or dtype.kind not in "biufU" or min(shape, default=0) < 0:
        raise ValueError(f"{name} is of {dtype}; arrays must be of numbers or text")
    if count * dtype.itemsize != len(content):
        raise ValueError(f"{name} declares the shape {shape} of {dtype}, but its data differ")
    return np.frombuffer(content, dtype=dtype, count=count).reshape(shape, order="F" if fortran else "C")


def write_npz(path: Path, arrays: Mapping[str, Any]) -> None:
    """Write arrays by name; the same arrays give the same bytes.

    Args:
        path: of the file.
        arrays: of numbers or text, in the order of the file.
    """
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            # A ZipInfo made from a name alone has a fixed date, so the bytes do not depend on the time.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), npy_bytes(array), zipfile.ZIP_DEFLATED)


def npy_bytes(array: Any) -> bytes:
    """An array of numbers or text as the content of a `.npy` file."""
    data = io.BytesIO()
    np.save(data, array, allow_pickle=False)
    return data.getvalue()
