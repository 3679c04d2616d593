"""Texts of a study in Markdown, as HTML for the page."""

from __future__ import annotations

from markdown_it import MarkdownIt

# HTML in a text is shown as text. Images would be requests to other servers.
_markdown = MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")


def html_of(text: str) -> str:
    """Markdown as HTML, without scripts, images or HTML of its own; links open another tab."""
    tokens = _markdown.parse(text)
    for token in tokens:
        for child in token.children or ():
            if child.type == "link_open":
                child.attrSet("target", "_blank")
                child.attrSet("rel", "noopener noreferrer")
    return str(_markdown.renderer.render(tokens, _markdown.options, {}))
