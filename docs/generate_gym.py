"""Writes the table of the parts of an observation in docs/gym.md from `sonata2d.gym.parts`: `[--check]`."""

from __future__ import annotations

import sys
from itertools import groupby
from pathlib import Path

from marked_part import write_part

from sonata2d.gym.parts import OPTIONAL, STANDARD, ObservationPart

ROWS = {"humans": "H", "objects": "M", "walls": "W", "interactions": "I"}


def columns(part: type[ObservationPart]) -> str:
    """The columns of a part; columns of one unit together."""
    groups = groupby(part.columns, key=lambda column: column.unit)
    words = [
        ", ".join(f"`{column.name}`" for column in group) + (f" ({unit})" if unit else "") for unit, group in groups
    ]
    return ", ".join(words)


def row(part: type[ObservationPart]) -> str:
    """The row of a part."""
    count = len(part.columns)
    shape = f"{ROWS[part.rows_of]} × {count}" if part.rows_of else str(count)
    if part.columns[0].values:
        shape = ROWS[part.rows_of]
    meaning = (part.__doc__ or "").strip().splitlines()[0]
    return (
        f"| `{part.name}` | {shape} | {part.version} | {', '.join(sorted(part.about))} | {columns(part)} | {meaning} |"
    )


def table() -> str:
    """One row a part."""
    parts = (*STANDARD, *OPTIONAL)
    return "\n".join(["| part | shape | version | about | columns | meaning |", "| --- " * 6 + "|", *map(row, parts)])


if __name__ == "__main__":
    sys.exit(write_part(Path(__file__).with_name("gym.md"), "generate_gym.py", table()))
