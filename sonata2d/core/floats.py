"""Floats of frozen dataclasses: a whole number in their place would give other bytes, and arrays of whole numbers."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from functools import cache
from operator import is_
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from .arguments import finite_number


class FloatFields:
    """Base class of frozen dataclasses whose numbers become floats."""

    __slots__ = ()

    def __post_init__(self) -> None:
        make_floats(self)


def make_floats(value: Any, place: str = "") -> None:
    """Make floats of the numbers that a frozen dataclass declares as floats, also of those in tuples and dataclasses.

    Lists and arrays become tuples. The instance equals the one before, so that it may be shared.

    Args:
        value: an instance of a dataclass.
        place: of the value, for messages.

    Raises:
        TypeError: something else is in the place of a number.
        ValueError: a number is not finite.
    """
    kind: Any = type(value)
    for name in _fields_with_floats(kind):
        given = getattr(value, name)
        if type(given) is float or given is None:  # most are
            continue
        converted = _converted(given, f"{place}.{name}" if place else name)
        if converted is not given:
            object.__setattr__(value, name, converted)


@cache
def _fields_with_floats(dataclass: Any) -> tuple[str, ...]:
    hints = get_type_hints(dataclass)
    return tuple(field.name for field in fields(dataclass) if _has_floats(hints[field.name]))


def _has_floats(hint: Any) -> bool:
    """Whether values of a type are floats, or tuples or dataclasses with floats; one of floats or flags is none."""
    if get_origin(hint) in (Union, UnionType) and bool in get_args(hint):
        return False
    is_record = isinstance(hint, type) and is_dataclass(hint) and bool(_fields_with_floats(hint))
    return hint is float or is_record or any(map(_has_floats, get_args(hint)))


def _converted(value: Any, place: str) -> Any:
    if type(value) is tuple:
        if set(map(type, value)) == {float}:
            return value
        parts = tuple(_converted(part, place) for part in value)
        return value if all(map(is_, parts, value)) else parts
    if is_dataclass(value):
        make_floats(value, place)
        return value
    if isinstance(value, dict):
        return {key: _converted(item, f"{place}.{key}") for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    return _converted(tuple(value), place) if isinstance(value, list) else finite_number(place, value)
