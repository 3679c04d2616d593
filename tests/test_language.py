"""Docstrings have a noun or a verb as their first word, and sentences name their subject."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
FILES = [path for folder in ("sonata2d", "cli") for path in sorted((ROOT / folder).rglob("*.py"))]
QUESTION_WORD = re.compile(r"(What|Which|How|Who|Whose|Whom|Whoever|Whatever)\b")


def docstrings(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each string that documents a module, a class, a function, or the constant above it."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        for statement in getattr(node, "body", ()) if not isinstance(node, ast.Lambda | ast.IfExp) else ():
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                text = statement.value.value
                if isinstance(text, str):
                    yield statement.lineno, text


def test_no_docstring_begins_with_a_question_word() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {text[:60]}"
        for path in FILES
        for line, text in docstrings(path)
        if QUESTION_WORD.match(text)
    ]
    assert not wrong
