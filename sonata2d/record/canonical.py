"""Canonical form of the values in episode files: rounded and finite, with one representation for each value."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, Any, NamedTuple

import numpy as np
import orjson

from ..core.files.limits import MAX_DEPTH
from ..core.geometry import quantised
from ..core.portable_math import Array
from ..errors import RecordError

PART = 1 << 20  # bytes
# for `isinstance`, which finds a frequent type faster than an abstract one
_SEQUENCE, _MAPPING, _NUMPY = (list, tuple), (dict, Mapping), (np.generic, np.ndarray)


def rounded(values: Array) -> Array:
    """Round to multiples of `geometry.PRECISION`, without -0.0; any shape, bit for bit as `geometry.quantised`."""
    result: Array = np.rint(values * 10_000.0) / 10_000.0 + 0.0
    return result


def rounded_rows(rows: Array, angle_columns: list[int]) -> Array:
    """Round rows of frames to the precision of files.

    Args:
        rows: (..., columns).
        angle_columns: indices of the columns with angles in (-pi, pi], rad.

    Returns:
        (..., columns), rounded; the angles lie in (-3.1416, 3.1416].
    """
    result = rounded(rows)
    angles = result[..., angle_columns]
    result[..., angle_columns] = np.where(angles <= -3.1416, 3.1416, angles)
    return result


def require_finite(
    rows: Array, names: tuple[str, ...], entity: str, ids: list[int] | None = None, tick: int = 0
) -> None:
    """Check that all numbers are finite.

    Args:
        rows: (T, columns), or (T, N, columns) with N ids.
        names: of the columns.
        entity: what the rows describe, e.g. "human".
        ids: of the entities, where there are several.
        tick: of the first row.

    Raises:
        RecordError: a number is not finite; names column, entity and tick.
    """
    if np.isfinite(rows).all():
        return
    index = np.argwhere(~np.isfinite(rows))[0].tolist()
    name = f"{entity} {ids[index[1]]}" if ids is not None else entity
    value, at = rows[tuple(index)], tick + index[0]
    raise RecordError(f"{names[index[-1]]} of {name} is {value} at tick {at}; files contain finite numbers only")


def to_json_value(value: Any, location: str, *, exact: bool = False) -> Any:
    """Convert a value to a new one of JSON's types: None, bool, int, float, str, list, dict with str keys.

    Args:
        value: may contain NumPy scalars and arrays, tuples and other mappings.
        location: of the value, for error messages, e.g. "label at tick 3".
        exact: whether floats are kept instead of rounded to `geometry.PRECISION`.

    Raises:
        RecordError: JSON cannot represent the value; names location and type.
    """
    return _json_value(value, location, exact, 0)


def _json_value(value: Any, location: str, exact: bool, depth: int) -> Any:
    """Convert a value that lies in `depth` lists or mappings."""
    if value is None or value is True or value is False:
        return value
    if isinstance(value, float):
        return _finite(float(value), location, exact)
    if isinstance(value, str):
        return value if value.isascii() else _encodable(value, location)
    if isinstance(value, int):
        if not -(1 << 63) <= value < 1 << 64:
            raise RecordError(f"{location} contains {value}; files contain integers of 64 bits only")
        return value
    if depth > MAX_DEPTH:
        raise RecordError(f"{location} is nested more than {MAX_DEPTH} deep, or contains itself")
    if isinstance(value, _SEQUENCE):
        return [_json_value(item, location, exact, depth + 1) for item in value]
    if isinstance(value, _MAPPING):
        return {_key(key, location): _json_value(item, location, exact, depth + 1) for key, item in value.items()}
    if isinstance(value, _NUMPY):
        return _json_value(value.tolist(), location, exact, depth)
    raise RecordError(
        f"{location} contains a {type(value).__name__}, which JSON cannot represent; use numbers, text, lists and dicts"
    )


def _finite(value: float, location: str, exact: bool) -> float:
    if not math.isfinite(value):
        raise RecordError(f"{location} contains {value}; files contain finite numbers only")
    if exact:
        return value + 0.0
    try:
        return quantised(value)
    except ValueError as error:
        raise RecordError(f"{location}: {error}") from error


def _key(key: Any, location: str) -> str:
    if not isinstance(key, str):
        raise RecordError(f"{location} has a key of type {type(key).__name__}; JSON needs text keys")
    return _encodable(key, location)


def _encodable(text: str, location: str) -> str:
    """Return the text if UTF-8 can encode it; a lone surrogate cannot be encoded."""
    if text.isascii():
        return text
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise RecordError(f"{location} contains text that is not valid Unicode: {text!r}") from error
    return text


def dumps(value: Any) -> bytes:
    """Serialise a value, which may contain NumPy arrays and dataclasses, as JSON on one line.

    Raises:
        RecordError: JSON cannot represent the value.
    """
    try:
        return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)
    except orjson.JSONEncodeError as error:
        raise RecordError(f"the episode contains a value that JSON cannot represent: {error}") from error


def serialise(document: dict[str, Any]) -> bytes:
    """Serialise a document as JSON, with each top-level key and each frame on a line of its own.

    Args:
        document: values of the top-level keys, and frames; those that are bytes are JSON already.

    Raises:
        RecordError: the document contains a value that JSON cannot represent.
    """
    lines: list[bytes] = []
    for key, value in document.items():
        values = value if key == "frames" else [value]
        items = [item if isinstance(item, bytes) else dumps(item) for item in values] or [b""]
        opening, closing = (b"[\n", b"\n]") if key == "frames" else (b"", b"")
        items[0] = b'"%b":%b%b' % (key.encode(), opening, items[0])
        items[-1] += closing
        lines += items
    lines[0] = b"{\n" + lines[0]
    lines[-1] += b"\n}\n"
    return b",\n".join(lines)  # joined once, because a document may be large


_BEFORE_FRAMES, _AFTER_FRAMES = b',\n"frames":[\n', b"\n]"


class Document(NamedTuple):
    """A document as `serialise` returns it, in parts, since the frames of a long episode need not fit in memory.

    Attributes:
        start: up to the first frame.
        frames: file with the first frames, a comma and a newline between them; or None.
        rest: the other frames, and what follows them.
    """

    start: bytes
    frames: IO[bytes] | None
    rest: bytes

    @classmethod
    def of(cls, document: dict[str, Any], frames: IO[bytes] | None, rest: Sequence[bytes]) -> Document:
        """A document with frames from a file and others.

        Args:
            document: see `serialise`; the value of its key `frames` is an empty list.
            frames: see above.
            rest: the other frames.
        """
        start, end = serialise(document).split(_BEFORE_FRAMES + _AFTER_FRAMES, 1)
        joined = b",\n".join([b"", *rest] if frames and rest else rest)
        return cls(start + _BEFORE_FRAMES, frames, joined + _AFTER_FRAMES + end)

    @property
    def size(self) -> int:
        """Number of bytes."""
        return len(self.start) + len(self.rest) + (self.frames.seek(0, os.SEEK_END) if self.frames else 0)

    def parts(self) -> Iterator[bytes]:
        """The bytes, in their order."""
        yield self.start
        if self.frames:
            self.frames.seek(0)
            while part := self.frames.read(PART):
                yield part
        yield self.rest

    def header(self) -> dict[str, Any]:
        """The keys before `frames`."""
        return parse_header(self.start)


def parse_header(document: bytes) -> dict[str, Any]:
    """Parse the keys before `frames` in the bytes that `serialise` returns, without parsing the frames."""
    header: dict[str, Any] = orjson.loads(document[: document.index(_BEFORE_FRAMES)] + b"}")
    return header
