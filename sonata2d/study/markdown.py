"""Texts of a study in Markdown: as HTML for a browser, and as paragraphs for the window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from markdown_it import MarkdownIt
from markdown_it.token import Token

# HTML in a text is shown as text. Images would be requests to other servers.
_markdown = MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A part of a text that begins on a line of its own.

    Attributes:
        text: without marks.
        kind: `heading`, `text`, or `code`, which keeps its lines.
        indent: depth in lists and quotations.
        mark: of a list item, such as `•` or `2.`; empty for other paragraphs.
    """

    text: str
    kind: Literal["heading", "text", "code"] = "text"
    indent: int = 0
    mark: str = ""


def html_of(text: str) -> str:
    """Markdown as HTML, without scripts, images or HTML of its own; links open another tab."""
    tokens = _markdown.parse(text)
    for token in tokens:
        for child in token.children or ():
            if child.type == "link_open":
                child.attrSet("target", "_blank")
                child.attrSet("rel", "noopener noreferrer")
    return str(_markdown.renderer.render(tokens, _markdown.options, {}))


def paragraphs_of(text: str) -> list[Paragraph]:
    """Markdown as paragraphs; addresses of links stand in brackets, and rows of tables are paragraphs.

    >>> [(part.mark, part.text) for part in paragraphs_of("- one\\n- [two](https://example.org)")]
    [('•', 'one'), ('•', 'two (https://example.org)')]
    """
    paragraphs: list[Paragraph] = []
    numbers: list[int | None] = []  # of the next item of each open list; None for bullets
    quotations, mark, kind = 0, "", "text"
    row: list[str] | None = None
    for token in _markdown.parse(text):
        if token.type in ("bullet_list_open", "ordered_list_open"):
            numbers.append(int(token.attrGet("start") or 1) if token.type == "ordered_list_open" else None)
        elif token.type in ("bullet_list_close", "ordered_list_close"):
            numbers.pop()
        elif token.type == "list_item_open":
            number = numbers[-1]
            mark = "•" if number is None else f"{number}."
            numbers[-1] = None if number is None else number + 1
        elif token.type in ("blockquote_open", "blockquote_close"):
            quotations += token.nesting
        elif token.type in ("heading_open", "heading_close"):
            kind = "heading" if token.nesting > 0 else "text"
        elif token.type == "tr_open":
            row = []
        elif token.type == "tr_close":
            paragraphs.append(Paragraph("   ".join(row or ()), indent=quotations))
            row = None
        elif token.type in ("fence", "code_block"):
            paragraphs.append(Paragraph(token.content.rstrip("\n"), "code", len(numbers) + quotations))
        elif token.type == "inline" and row is not None:
            row.append(_plain(token))
        elif token.type == "inline":
            indent = len(numbers) + quotations
            paragraphs.append(Paragraph(_plain(token), kind, indent, mark))  # type: ignore[arg-type]
            mark = ""
    return paragraphs


def _plain(token: Token) -> str:
    """The text of a line without marks."""
    words: list[str] = []
    addresses: list[str] = []
    for child in token.children or ():
        if child.type == "link_open":
            addresses.append(str(child.attrGet("href") or ""))
        elif child.type == "link_close":
            address = addresses.pop()
            words.append(f" ({address})" if words[-1:] != [address] else "")
        else:
            words.append("\n" if child.type == "hardbreak" else " " if child.type == "softbreak" else child.content)
    return "".join(words)
