"""Functions that importers share: reading JSON, checking numbers, and validating the episode documents they make."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.bounds import MAX_MAGNITUDE
from ..core.portable_math import Array
from ..core.wording import one_line
from ..errors import InvalidFileError, RecordError
from ..record.canonical import serialise
from ..record.files import read_bytes
from ..record.layout import JsonDict
from ..record.record import record_from_document
from ..record.validate import require_valid


@contextmanager
def parsing(path: Path, format: str) -> Iterator[None]:
    """Turn the exceptions that a damaged or foreign file causes into one RecordError with file and format.

    Args:
        path: the file that is parsed in the block.
        format: name of the format.

    Raises:
        RecordError: the block raised a RecordError, or an exception that invalid content causes.
    """
    try:
        yield
    except RecordError:
        raise
    except KeyError as error:
        raise RecordError(f"{path} is not a complete {format} file: {error} is missing") from error
    except RecursionError as error:
        raise RecordError(f"{path} is not a {format} file: it is nested too deeply") from error
    except MemoryError as error:
        raise RecordError(f"{path} is not a {format} file: its declared size does not fit into memory") from error
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise RecordError(f"{path} is not a valid {format} file: {one_line(error, 400)}") from error


def load_json(path: Path, format: str) -> Any:
    """Read a JSON file.

    Raises:
        RecordError: the file cannot be read, or is not valid JSON.
    """
    try:
        return orjson.loads(read_bytes(path))
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not a {format} file, it is not valid JSON: {error}") from error


def numbers(rows: Any, names: tuple[str, ...], place: str) -> Array:
    """Return the numbers under some keys of a list of objects.

    Args:
        rows: N objects.
        names: C keys.
        place: name of the objects, for error messages.

    Returns:
        (N, C), finite.

    Raises:
        KeyError: a key is missing.
        ValueError: a value is not a finite number below 1e11.
    """
    return table([[row[name] for name in names] for row in rows], len(names), f"{', '.join(names)} of {place}")


def table(rows: Any, width: int, place: str) -> Array:
    """Return nested lists of numbers as an array.

    Args:
        rows: N lists of `width` numbers.
        width: number of columns, C.
        place: name of the rows, for error messages.

    Returns:
        (N, C), finite.

    Raises:
        ValueError: the shape differs, or a value is not a finite number below 1e11.
    """
    array = np.array(rows) if len(rows) else np.zeros((0, width))
    if array.dtype.kind not in "if" or array.shape != (len(rows), width):
        raise ValueError(f"{place} must be numbers")
    array = array.astype(np.float64)
    if not (np.abs(array) < MAX_MAGNITUDE).all():
        raise ValueError(f"{place} must be finite numbers")
    return array


def document_of(header: JsonDict, states: list[JsonDict]) -> JsonDict:
    """The episode document whose header was exported, with keys in the order of the recorder.

    Args:
        header: see `format.header_of`.
        states: the T frames and the final state.
    """
    facts = {key: value for key, value in header.items() if key != "software"}
    return facts | {"frames": states[:-1], "final": states[-1], "software": header["software"]}


def encode_episode(document: JsonDict, path: Path) -> bytes:
    """Return the bytes of an episode file, after checking the document as a file that is read.

    Args:
        document: episode document made by an importer.
        path: the source, for error messages.

    Raises:
        RecordError: the document violates the schema, or holds values that no episode can have.
    """
    data = serialise(document)
    try:
        parsed = orjson.loads(data)
        require_valid(parsed, path)
        record_from_document(parsed, path)
    except InvalidFileError as error:
        place, message = error.findings[0]
        raise RecordError(f"{path} describes an impossible episode: {place}: {one_line(message, 200)}") from None
    return data
