"""Checks of arguments, with one clear error."""

from __future__ import annotations

import operator

from .wording import shown


def whole_number(name: str, value: object, least: int = 0) -> int:
    """A number that an argument must be.

    Args:
        name: of the argument.
        value: what was given.
        least: the smallest valid number.

    Raises:
        TypeError: it is no whole number.
        ValueError: it is too small.
    """
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be a whole number, got {shown(value)}") from None
    if number < least:
        raise ValueError(f"{name} must be {least} or more, got {number}")
    return number
