"""Checking of answers, and the file that holds what a participant has done and answered."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import orjson

from ..core.files.whole_file import sync_folder
from ..core.geometry import quantised
from ..core.wording import shown
from ..errors import RecordError
from ..record.files import read_bytes
from .config import Entry, QuestionConfig, ScaleConfig, name_of_entry
from .load import spec_of

logger = logging.getLogger(__name__)

ANSWERS_VERSION = 1
MAX_TEXT_ANSWER = 5000  # characters
MAX_NUMBER = 2**53  # up to which JSON readers keep integers exact


def checked_answers(entries: Iterable[Entry], values: Mapping[str, Any]) -> dict[str, Any]:
    """The answers to questions, as they are stored.

    Args:
        entries: the questions.
        values: answer by name of the question: a bool, the number of a class from 1, a fraction, a text or a number;
            of tables the point by name of the item, from 1. A question that is not answered is left out, or None.

    Raises:
        ValueError: an answer is missing or does not fit; names the question.
    """
    known = {name_of_entry(entry): entry for entry in entries}
    for name in values:
        if name not in known:
            raise ValueError(f"there is no question {shown(name)}")
    checked = {}
    for name, entry in known.items():
        value = values.get(name)
        if value is None or value == "" or value == {}:
            if entry.required:
                raise ValueError(f"{name} is not answered")
            continue
        checked[name] = _checked_table(name, entry, value) if _is_table(entry) else _checked_value(name, entry, value)
    return checked


def _is_table(entry: Entry) -> bool:
    return isinstance(entry, ScaleConfig) or entry.kind == "likert"


def _checked_table(name: str, entry: Entry, value: Any) -> dict[str, int]:
    definition = entry.definition if isinstance(entry, ScaleConfig) else entry
    items, points = [item.name for item in definition.items or ()], definition.points
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} is {shown(value)}; a number for each item is expected")
    for item, point in value.items():
        if item not in items:
            raise ValueError(f"{name} has no item {shown(item)}")
        if isinstance(point, bool) or not isinstance(point, int) or not 1 <= point <= points:
            raise ValueError(f"{name}.{item} is {shown(point)}; a number from 1 to {points} is expected")
    missing = [item for item in items if item not in value]
    if missing and entry.required:
        raise ValueError(f"{name}.{missing[0]} is not answered")
    return {item: value[item] for item in items if item in value}


def _checked_value(name: str, entry: Entry, value: Any) -> Any:
    assert isinstance(entry, QuestionConfig)
    if entry.kind == "number":
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MAX_NUMBER
        low, high = entry.minimum, entry.maximum
        is_number = is_number and not (entry.integer and value != int(value))
        if not is_number or (low is not None and value < low) or (high is not None and value > high):
            limits = ("" if low is None else f" from {low:g}") + ("" if high is None else f" up to {high:g}")
            number = "whole number" if entry.integer else "number"
            raise ValueError(f"{name} is {shown(value)}; a {number}{limits} is expected")
        return value if isinstance(value, int) else quantised(float(value))
    if entry.kind == "text" and isinstance(value, str):
        if len(value) > MAX_TEXT_ANSWER:
            raise ValueError(f"{name} has {len(value)} characters; up to {MAX_TEXT_ANSWER} are stored")
        return value.encode(errors="replace").decode()
    return spec_of(entry, "").validate(value)


class AnswerLog:
    """A file of lines, each a JSON object, to which a line is added on each event; on return it is on the disk.

    Args:
        path: of the file.

    Attributes:
        lines: the events so far.

    Raises:
        RecordError: the file cannot be read, or a line is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: list[dict[str, Any]] = _read_lines(path, repair=True) if path.exists() else []

    def append(self, **facts: Any) -> None:
        """Add an event.

        Raises:
            RecordError: the file cannot be written; the event can be added again.
        """
        event = {"version": ANSWERS_VERSION} | facts
        data = orjson.dumps(event, option=orjson.OPT_APPEND_NEWLINE)
        try:
            is_new = not self.path.exists()
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab", buffering=0) as file:
                size = file.tell()
                try:
                    if file.write(data) < len(data):
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                    os.fsync(file.fileno())
                except OSError:
                    file.truncate(size)  # a half line would spoil the next one
                    raise
            if is_new:
                os.chmod(self.path, 0o600)
                sync_folder(self.path.parent)
        except OSError as error:
            raise RecordError(f"{self.path} cannot be written: {error.strerror or error}") from error
        self.lines.append(event)


def read_answers(path: Path) -> list[dict[str, Any]]:
    """The events in the file of a participant, which a server may be writing; empty without a file.

    Raises:
        RecordError: the file cannot be read, or a line is damaged.
    """
    return _read_lines(path, repair=False) if path.exists() else []


def _read_lines(path: Path, *, repair: bool) -> list[dict[str, Any]]:
    *lines, tail = read_bytes(path).split(b"\n")
    if tail and repair:  # a crash interrupted the write, so that it was not confirmed to anybody
        logger.warning("%s: the last line is incomplete and is removed: %r", path, tail[:60])
        with path.open("r+b") as file:
            file.truncate(sum(len(line) + 1 for line in lines))
    events = []
    for number, line in enumerate(lines, 1):
        try:
            event = orjson.loads(line)
            if not isinstance(event, dict) or not isinstance(event.get("version"), int):
                raise ValueError("it is not an event")
            if event["version"] > ANSWERS_VERSION:
                raise ValueError(f"it was written by version {event['version']}; upgrade sonata2d")
        except ValueError as error:
            raise RecordError(f"{path}, line {number}: {error}; correct or remove that line") from error
        events.append(event)
    return events
