"""Values as files hold them: rounded, finite, one way to write each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import orjson

from ..core.geometry import quantised
from ..core.portable_math import Array
from ..errors import RecordError


def rounded(values: Array) -> Array:
    """The nearest multiples of `geometry.PRECISION`, any shape, without -0.0; bit for bit `geometry.quantised`."""
    nearest: Array = np.rint(values * 10_000.0) / 10_000.0 + 0.0
    return nearest


def rounded_rows(rows: Array, angles: list[int]) -> Array:
    """Rows as files hold them: rounded, and the columns `angles`, given in (-pi, pi], in (-3.1416, 3.1416]."""
    nearest = rounded(rows)
    turns = nearest[..., angles]
    nearest[..., angles] = np.where(turns <= -3.1416, 3.1416, turns)
    return nearest


def refuse_unfinite(rows: Array, names: tuple[str, ...], who: str, ids: list[int] | None = None) -> None:
    """Raise a RecordError that tells where a number is not finite, if one is.

    Args:
        rows: (T, columns), or (T, N, columns) with N ids.
        names: of the columns.
        who: what the rows tell of, e.g. "human".
        ids: of the entities, where there are several.
    """
    if np.isfinite(rows).all():
        return
    place = np.argwhere(~np.isfinite(rows))[0].tolist()
    entity = f"{who} {ids[place[1]]}" if ids is not None else who
    raise RecordError(f"{names[place[-1]]} of {entity} is {rows[tuple(place)]} at tick {place[0]}; a file holds finite")


def plain(value: Any, place: str, *, exact: bool = False) -> Any:
    """A copy of the value made of what JSON can hold: None, bool, int, float, str, list, dict with str keys.

    Args:
        value: may hold NumPy scalars and arrays, tuples and other mappings.
        place: where it is from, for the error, e.g. "label at tick 3".
        exact: keep floats as they are instead of rounding them to `geometry.PRECISION`.

    Raises:
        RecordError: JSON cannot hold it; names the type.
    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value, place)
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist(), place, exact=exact)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise RecordError(f"{place} holds {value}; a file holds finite numbers")
        try:
            return value + 0.0 if exact else quantised(value)
        except ValueError as error:
            raise RecordError(f"{place}: {error}") from error
    if isinstance(value, int):
        if not -(1 << 63) <= value < 1 << 64:
            raise RecordError(f"{place} holds {value}; a file holds integers of 64 bits")
        return value
    if isinstance(value, list | tuple):
        return [plain(item, place, exact=exact) for item in value]
    if isinstance(value, Mapping):
        return {_key(key, place): plain(item, place, exact=exact) for key, item in value.items()}
    raise RecordError(
        f"{place} holds a {type(value).__name__}, which JSON cannot hold; give numbers, text, lists, dicts"
    )


def _key(key: Any, place: str) -> str:
    if not isinstance(key, str):
        raise RecordError(f"{place} has a key of type {type(key).__name__}; JSON's keys are text")
    return _text(key, place)


def _text(text: str, place: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise RecordError(f"{place} holds text that is no Unicode: {text!r}") from error
    return text


def written(document: dict[str, Any]) -> bytes:
    """JSON with each top-level key and each frame on a line of its own."""
    try:
        lines = [b'"%s":%s' % (key.encode(), _line(key, value)) for key, value in document.items()]
    except orjson.JSONEncodeError as error:
        raise RecordError(f"the episode holds what JSON cannot: {error}") from error
    return b"{\n" + b",\n".join(lines) + b"\n}\n"


def _line(key: str, value: Any) -> bytes:
    if key != "frames":
        return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)
    return b"[\n" + b",\n".join([orjson.dumps(frame, option=orjson.OPT_SERIALIZE_NUMPY) for frame in value]) + b"\n]"


def head_of(document: bytes) -> dict[str, Any]:
    """What stands before the frames in a document that `written` made, without reading them."""
    head: dict[str, Any] = orjson.loads(document[: document.index(b',\n"frames":[\n')] + b"}")
    return head
