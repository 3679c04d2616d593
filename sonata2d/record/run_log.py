"""The log of a data set's runs, `run.jsonl`: what is true of one run only, and no part of the set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from ..errors import RecordError
from .canonical import plain

LOG = "run.jsonl"


def log(folder: Path, **facts: Any) -> None:
    """Add a line: wall time, host, workers, command line; or an episode that was left out.

    Raises:
        RecordError: it cannot be written.
    """
    try:
        with (folder / LOG).open("ab") as file:
            file.write(orjson.dumps(plain(facts, LOG, exact=True), option=orjson.OPT_APPEND_NEWLINE))
    except OSError as error:
        raise RecordError(f"{folder / LOG} cannot be written: {error.strerror or error}") from error


def log_left_out(folder: Path, episode: int, outcome: str) -> None:
    """Note an episode that was run and not kept, so that it need not be run again.

    Raises:
        RecordError: it cannot be written.
    """
    log(folder, left_out=episode, outcome=outcome)


def logged_left_out(folder: Path) -> dict[int, str]:
    """Outcome by number of the episodes that earlier runs left out; a line that was cut short tells of none."""
    told: dict[int, str] = {}
    for line in (folder / LOG).read_bytes().splitlines() if (folder / LOG).is_file() else ():
        try:
            row = orjson.loads(line)
        except orjson.JSONDecodeError:
            continue
        if isinstance(row, dict) and isinstance(row.get("left_out"), int):
            told[row["left_out"]] = str(row.get("outcome"))
    return told
