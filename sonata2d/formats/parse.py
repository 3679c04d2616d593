"""What importers share: reading JSON, checking numbers, and validating the episode documents they make."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.geometry import MAX_MAGNITUDE
from ..core.portable_math import Array
from ..errors import RecordError
from ..record.canonical import serialise
from ..record.files import read_bytes
from ..record.layout import ABSENT, JsonDict

_GEOMETRY_KEYS = ("rules", "room", "walls", "objects", "humans", "robot", "goal", "frames", "final")


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
        raise RecordError(f"{path} is not a valid {format} file: {one_line(error):.200}") from error


def one_line(error: Exception) -> str:
    """The message of an exception with all white space reduced to single blanks."""
    return " ".join(str(error).split())


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
        place: what the objects are, for error messages.

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
        place: what the rows are, for error messages.

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


def encode_episode(document: JsonDict, path: Path) -> bytes:
    """Return the bytes of an episode file, after checking the document against the schema of episode files.

    Args:
        document: episode document made by an importer.
        path: the source, for error messages.

    Raises:
        RecordError: the document violates the schema, or holds values that no episode can have.
    """
    from ..record.models import Episode

    data = serialise(document)
    try:
        Episode.model_validate_json(data)
        _check_presence(document)
        _check_magnitudes(document)
    except ValueError as error:
        raise RecordError(f"{path} describes an impossible episode: {_first_finding(error):.200}") from None
    return data


def _first_finding(error: ValueError) -> str:
    """One line; of a pydantic error, which lists many findings, only the first."""
    findings = getattr(error, "errors", None)
    if findings is None:
        return str(error)
    first = findings(include_url=False, include_context=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"


def _check_presence(document: JsonDict) -> None:
    """Check what a JSON schema cannot: each frame has a row per pedestrian, and no row for absent pedestrians."""
    count, activities = len(document["humans"]), len(document["activities"])
    for frame in (*document["frames"], document["final"]):
        rows, activity = frame["humans"], frame["activity"]
        if len(rows) != count or len(activity) != count:
            raise ValueError(f"{len(rows)} rows and {len(activity)} activities of {count} people at {frame['tick']}")
        if any(
            (row is None) != (index == ABSENT) or index >= activities for row, index in zip(rows, activity, strict=True)
        ):
            raise ValueError(f"activities at tick {frame['tick']} contradict the rows of the people")


def _check_magnitudes(document: JsonDict) -> None:
    """Reject numbers whose squares overflow in later computations."""
    for key in _GEOMETRY_KEYS:
        if (largest := _largest_magnitude(document[key])) > MAX_MAGNITUDE:
            raise ValueError(f"{key} holds {largest:g}, beyond the limit of episode files, {MAX_MAGNITUDE:g}")


def _largest_magnitude(value: Any) -> float:
    """The largest absolute value in a tree; labels are skipped."""
    if isinstance(value, int | float):
        return abs(value)
    if isinstance(value, list | tuple):
        return max(map(_largest_magnitude, value), default=0.0)
    if isinstance(value, dict):
        return max((_largest_magnitude(part) for key, part in value.items() if key != "label"), default=0.0)
    return 0.0
