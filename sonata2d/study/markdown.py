"""Texts of a study in Markdown, as HTML for the page, and the pictures in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from markdown_it import MarkdownIt
from markdown_it.token import Token

from ..errors import ConfigError
from ..record.files import sha256_of

# HTML in a text is shown as text.
_markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
_MAX_PICTURE_BYTES = 5_000_000
_BEGINNINGS = {
    ".png": (b"\x89PNG\r\n\x1a\n",), ".jpg": (b"\xff\xd8\xff",), ".jpeg": (b"\xff\xd8\xff",), ".webp": (b"RIFF",),
    ".gif": (b"GIF87a", b"GIF89a"), ".svg": (b"<svg", b"<?xml", b"<!--", b"<!DOCTYPE svg", b"\xef\xbb\xbf<"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture file that a text names.

    Attributes:
        path: of the file.
        name: by which the page asks for it; it changes with the content.
    """

    path: Path
    name: str


def picture_at(path: Path) -> Picture:
    """The picture in a file.

    Raises:
        ConfigError: there is no such file, or it is too large or no picture.
    """
    suffix = path.suffix.lower()
    if suffix not in _BEGINNINGS:
        raise ConfigError(f"{path.name} is no picture; its name ends with {', '.join(_BEGINNINGS)}")
    if not path.is_file():
        raise ConfigError(f"{path} does not exist, or is no file")
    if (size := path.stat().st_size) > _MAX_PICTURE_BYTES:
        raise ConfigError(f"{path.name} has {size} bytes; a picture has up to {_MAX_PICTURE_BYTES}")
    with path.open("rb") as file:
        beginning = file.read(100).lstrip()
    if not beginning.startswith(_BEGINNINGS[suffix]):
        raise ConfigError(f"{path.name} does not begin as a {suffix} file does; save the picture again")
    return Picture(path, f"{sha256_of(path)[:16]}{suffix}")


def pictures_in(text: str) -> Iterator[str]:
    """The sources of the pictures in a text that are files, as Markdown has them."""
    for token in _markdown.parse(text):
        for child in token.children or ():
            if child.type == "image" and not _scheme(source := str(child.attrs["src"])):
                yield source


def path_of(source: str) -> str:
    """The path of the source of a picture.

    >>> path_of("my%20logo.png")
    'my logo.png'
    """
    return unquote(source)


def html_of(text: str, pictures: Mapping[str, Picture]) -> str:
    """Markdown as HTML, without scripts and without HTML of its own; links open another tab.

    A picture of another server becomes a link: the browser would tell that server about the participant.

    Args:
        text: Markdown.
        pictures: the picture files, by source.
    """
    tokens = _markdown.parse(text)
    for token in tokens:
        token.children = [part for child in token.children or () for part in _shown(child, pictures)]
    return str(_markdown.renderer.render(tokens, _markdown.options, {}))


def _shown(token: Token, pictures: Mapping[str, Picture]) -> list[Token]:
    """A part of a text as the page gets it."""
    if token.type == "link_open":
        return [_opened(token)]
    if token.type != "image" or _scheme(source := str(token.attrs["src"])) == "data":
        return [token]
    if source in pictures:
        token.attrSet("src", f"../pictures/{pictures[source].name}")
        return [token]
    words = Token("text", "", 0, content=token.content or source)
    return [_opened(Token("link_open", "a", 1, attrs={"href": source})), words, Token("link_close", "a", -1)]


def _opened(link: Token) -> Token:
    """The beginning of a link that opens another tab."""
    link.attrSet("target", "_blank")
    link.attrSet("rel", "noopener noreferrer")
    return link


def _scheme(source: str) -> str:
    """The scheme of the source of a picture that is no file, or its server; empty for a file."""
    try:
        parts = urlsplit(source)
    except ValueError:  # such as of //[
        return source
    return parts.scheme or parts.netloc
