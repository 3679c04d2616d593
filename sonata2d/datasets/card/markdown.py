"""Text of any origin as Markdown that shows it as it is."""

from __future__ import annotations

import html
import re

_MARKUP = re.compile(r"[\\`*_\[\]|~$!#]")  # begins or ends Markdown markup; HTML is escaped separately


def inline(text: str) -> str:
    """Text as Markdown that shows it as it is: names from other files must not become markup."""
    return _MARKUP.sub(r"\\\g<0>", html.escape(_one_line(text), quote=False))


def code(text: str) -> str:
    """Text as a Markdown code span, whose delimiters are longer than the backticks in it."""
    text = _one_line(text)
    fence = "`" * (_longest_run(text) + 1)
    return f"{fence} {text} {fence}" if "`" in text or not text.strip() else f"{fence}{text}{fence}"


def cell(markdown: str) -> str:
    """Markdown in a cell of a table; there a bar must be escaped even in a code span."""
    return markdown.replace("|", "\\|")


def code_block(text: str) -> str:
    fence = "`" * max(_longest_run(text) + 1, 3)
    return f"{fence}\n{text}\n{fence}"


def _longest_run(text: str) -> int:
    """Length of the longest run of backticks."""
    return max(map(len, re.findall("`+", text)), default=0)


def _one_line(text: str) -> str:
    """Text without line breaks and control characters, which may be invisible or change what is shown."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
