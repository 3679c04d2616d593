"""Checks of arguments, with one clear error."""

from __future__ import annotations

import math
import numbers
import operator

from .wording import shown


def finite_number(name: str, value: object, least: float = -math.inf) -> float:
    """A number that an argument must be.

    Args:
        name: of the argument.
        value: what was given, of any type of real numbers.
        least: the smallest valid number.

    Raises:
        TypeError: it is no number.
        ValueError: it is not finite, or too small.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name} must be a number, got {shown(value)}")
    try:
        number = float(value)
    except OverflowError:  # of a huge int
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {shown(value)}")
    if number < least:
        raise ValueError(f"{name} must be {least:g} or more, got {shown(value)}")
    return number


def positive_number(name: str, value: object) -> float:
    """A number above 0 that an argument must be.

    Raises:
        TypeError: it is no number.
        ValueError: it is not positive, or not finite.
    """
    number = finite_number(name, value)
    if number <= 0.0:
        raise ValueError(f"{name} must be positive, got {shown(value)}")
    return number


def whole_number(name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """A number that an argument must be.

    Args:
        name: of the argument.
        value: what was given.
        least: the smallest valid number.
        most: the largest valid number, None for no limit.

    Raises:
        TypeError: it is no whole number.
        ValueError: it is too small, or too large.
    """
    try:
        number = operator.index(None if isinstance(value, bool) else value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be a whole number, got {shown(value)}") from None
    if number < least:
        raise ValueError(f"{name} must be {least} or more, got {number}")
    if most is not None and number > most:
        raise ValueError(f"{name} must be {most} or less, got {number}")
    return number
