"""The part of a page of docs/ that a script writes, between two comments."""

from __future__ import annotations

import sys
from pathlib import Path

_END = "<!-- end -->"


def write_part(page: Path, script: str, content: str) -> int:
    """Write the part of a page, or with --check report whether it is up to date; returns an exit code.

    Args:
        page: has the comments `begin: written by docs/SCRIPT` and `end` around the part.
        script: name of the file in docs/ that writes it.
        content: of the part.
    """
    begin = f"<!-- begin: written by docs/{script} -->"
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(_END)
    wanted = f"{before}{begin}\n\n{content}\n\n{_END}{after}"
    if "--check" not in sys.argv[1:]:
        page.write_text(wanted, encoding="utf-8")
        return 0
    if text != wanted:
        print(f"{page} is not up to date; run python docs/{script}", file=sys.stderr)
    return int(text != wanted)
