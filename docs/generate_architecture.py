"""Writes the drawing and the tables in docs/architecture.md from docs/architecture.toml: `[--check]`."""

from __future__ import annotations

import sys
import tomllib
from itertools import groupby
from pathlib import Path
from typing import Any

from marked_part import write_part

DOCS = Path(__file__).parent
WIDTH = 60


def drawing(rooms: list[dict[str, Any]]) -> str:
    """The floors from the top down; every arrow points down."""
    lines = []
    for floor, here in groupby(sorted(rooms, key=lambda room: -room["floor"]), key=lambda room: room["floor"]):
        lines += [f"{floor}   {'   '.join(room['name'] for room in here)}"]
    return "\n".join(["```", *lines, "```"])


def table(rooms: list[dict[str, Any]]) -> str:
    """One row a package."""
    rows = ["| package | floor | holds | third-party packages of its own |", "| --- | --- | --- | --- |"]
    for room in sorted(rooms, key=lambda room: room["floor"]):
        rows.append(f"| `{room['name']}` | {room['floor']} | {room['holds']} | {', '.join(room.get('outside', ()))} |")
    return "\n".join(rows)


def late_table(imports: list[dict[str, Any]]) -> str:
    """One row for each module that imports by name."""
    rows = ["| module | imports by name | reason |", "| --- | --- | --- |"]
    for late in imports:
        names = ", ".join(f"`{name}`" for name in late["imported"])
        rows.append(f"| `{late['importer']}` | {names} | {late['reason']} |")
    return "\n".join(rows)


def main() -> int:
    structure = tomllib.loads((DOCS / "architecture.toml").read_text(encoding="utf-8"))
    rooms = structure["package"]
    content = f"{drawing(rooms)}\n\n{table(rooms)}\n\n{late_table(structure['late'])}"
    return write_part(DOCS / "architecture.md", "generate_architecture.py", content)


if __name__ == "__main__":
    sys.exit(main())
