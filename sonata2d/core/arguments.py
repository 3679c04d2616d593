"""Checks of arguments, with one clear error."""

from __future__ import annotations

import math
import numbers
import operator

from .wording import shown


def positive_number(name: str, value: object) -> float:
    """A number that an argument must be.

    Args:
        name: of the argument.
        value: what was given.

    Raises:
        TypeError: it is no number.
        ValueError: it is not positive, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name} must be a number, got {shown(value)}")
    number = float(value)
    if not 0.0 < number < math.inf:
        raise ValueError(f"{name} must be positive and finite, got {shown(value)}")
    return number


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
