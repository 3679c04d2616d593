"""Checking of answers, and the file that holds what a participant has done and answered."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..collect.json_lines import append_line, read_lines
from ..core.wording import shown
from .questions import Entry

_VERSION = 1  # of the events
_TIME = "%Y-%m-%dT%H:%M:%SZ"  # of an event, UTC


SCREENED, FULL = "screened out", "full"  # states of participants whose answers ended the study


class WrongAnswerError(ValueError):
    """The answer to a question that has to be answered until it is right was another one."""


def checked_answers(entries: Iterable[Entry], values: Mapping[str, Any]) -> dict[str, Any]:
    """The answers to questions, as they are stored.

    Args:
        entries: the questions.
        values: answers by name of the question, as `Entry.check` takes them. A question that is not answered is left
            out, or has the answer None, "" or {}.

    Raises:
        ValueError: an answer is missing or does not fit; names the question.
    """
    by_name = {entry.name: entry for entry in entries}
    for name in values:
        if name not in by_name:
            raise ValueError(f"there is no question {shown(name)}")
    checked = {}
    for name, entry in by_name.items():
        value = values.get(name)
        if value not in (None, "", {}):
            checked[name] = entry.check(value)
        elif entry.required:
            raise ValueError(f"{name} is not answered")
    return checked


class AnswerLog:
    """The file of what a participant has done and answered, one event in each line.

    Args:
        path: of the file.

    Attributes:
        lines: the events so far.

    Raises:
        RecordError: the file cannot be read, or a line is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = read_answers(path)

    def append(self, **facts: Any) -> None:
        """Add an event; on return it is on the disk.

        Raises:
            RecordError: the file cannot be written; the event can be added again.
        """
        event = {"version": _VERSION} | facts
        append_line(self.path, event, mode=0o600)
        self.lines.append(event)


def event_time(at: datetime) -> str:
    """A time in UTC as events have it: ISO 8601, to the second."""
    return at.strftime(_TIME)


def time_of(event: Mapping[str, Any]) -> datetime:
    """The time of an event, UTC."""
    return datetime.strptime(event["time"], _TIME).replace(tzinfo=UTC)


def state_of(events: Sequence[Mapping[str, Any]]) -> str:
    """The state of a participant: `not begun`, `begun`, `declined`, `screened out`, `full` or `finished`."""
    ends = [event["event"] for event in events if event["event"] in ("finished", "undone")]
    choices = [event["event"] for event in events if event["event"] in ("declined", "reconsidered", "consented")]
    if (end := next((event["ends"] for event in events if "ends" in event), None)) is not None:
        return str(end)
    if any(event["event"] == "screened_out" for event in events):  # as it was stored by 0.4.0.dev
        return SCREENED
    if ends[-1:] == ["finished"]:  # a run that is taken back makes a finished study unfinished
        return "finished"
    return "declined" if choices[-1:] == ["declined"] else "begun" if events else "not begun"


def read_answers(path: Path) -> list[dict[str, Any]]:
    """The events in the file of a participant, which a server may be writing; empty without a file.

    Raises:
        RecordError: the file cannot be read, or a line is damaged.
    """
    return read_lines(path, _VERSION, dict, "an event") if path.exists() else []
