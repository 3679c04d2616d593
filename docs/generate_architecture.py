"""Writes the drawing and the tables in docs/architecture.md from docs/architecture.toml: `[--check]`."""

from __future__ import annotations

import sys
import tomllib
from itertools import groupby
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
BEGIN, END = "<!-- begin: written by docs/generate_architecture.py -->", "<!-- end -->"
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


def main(arguments: list[str]) -> int:
    structure = tomllib.loads((DOCS / "architecture.toml").read_text(encoding="utf-8"))
    rooms = structure["package"]
    path = DOCS / "architecture.md"
    text = path.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    wanted = f"{before}{BEGIN}\n\n{drawing(rooms)}\n\n{table(rooms)}\n\n{late_table(structure['late'])}\n\n{END}{after}"
    if "--check" not in arguments:
        path.write_text(wanted, encoding="utf-8")
        return 0
    if text != wanted:
        print(f"{path} is not up to date; run python docs/generate_architecture.py", file=sys.stderr)
    return int(text != wanted)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
