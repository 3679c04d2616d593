"""Texts and values of any size within messages: short, and on one line."""

from __future__ import annotations

import reprlib


def one_line(text: object, max_length: int | None = None) -> str:
    """The text without line breaks and repeated spaces.

    Args:
        text: any object with a text, such as an exception.
        max_length: maximum number of characters; a longer text ends in `...`. None: no limit.
    """
    whole = str(text)
    if max_length is None:
        return " ".join(whole.split())
    beginning = whole[: 10 * max_length]  # splitting a text of many megabytes takes seconds
    line = " ".join(beginning.split())
    is_whole = len(line) <= max_length and len(beginning) == len(whole)
    return line if is_whole else f"{line[: max_length - 3]}..."


def shown(value: object, max_length: int = 60) -> str:
    """The value as Python writes it, on one line of at most `max_length` characters.

    Of long lists, texts and numbers only the beginning is converted: the whole may take seconds, and gigabytes.
    """
    short = reprlib.Repr()
    short.maxlist = short.maxtuple = short.maxdict = short.maxset = short.maxfrozenset = short.maxarray = 12
    short.maxstring = short.maxlong = short.maxother = max_length
    return one_line(short.repr(value), max_length)


def text_of(error: BaseException) -> str | None:
    """The text of an error that the code of others may have raised; None if its `__str__` fails."""
    try:
        return str(error)
    except Exception:
        return None


def described(error: BaseException, max_length: int | None = 300) -> str:
    """An error that the code of others raised, on one line: `ValueError: no such wall`.

    Args:
        error: any exception.
        max_length: maximum number of characters, see `one_line`.
    """
    return one_line(f"{one_line(type(error).__name__, 100)}: {text_of(error) or ''}", max_length).removesuffix(":")


def counted(number: int, noun: str) -> str:
    """A number with its noun.

    >>> counted(1, "episode"), counted(3, "person")
    ('1 episode', '3 people')
    """
    plural = {"person": "people"}.get(noun, f"{noun}s")
    return f"{number} {noun if number == 1 else plural}"
