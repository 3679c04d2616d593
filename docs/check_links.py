"""Checks the links of the built documentation: `python docs/check_links.py HTML_FOLDER`.

Every link, picture, script and anchor within the site must exist. Links to other sites are checked by
`sphinx-build -b linkcheck docs site`, which needs a connection.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """The anchors of a page, and what it refers to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = {"", "top"}
        self.targets: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.anchors.add(value)
            if name in ("href", "src") and value is not None:
                self.targets.append(value)


def broken_links(folder: Path) -> tuple[int, list[str]]:
    """The number of links within a site, and those that lead nowhere, each with its page."""
    files = (path for path in folder.rglob("*.html") if "_static" not in path.parts)  # templates of the theme
    pages = {path.resolve(): _Page(path.read_text("utf-8")) for path in files}
    found = [(path, target) for path, page in pages.items() for target in page.targets if _is_inside(target)]
    return len(found), [f"{path.relative_to(folder.resolve())}: {why}" for path, why in _broken(pages, found)]


def _broken(pages: dict[Path, _Page], links: list[tuple[Path, str]]) -> Iterator[tuple[Path, str]]:
    for path, target in links:
        parts = urlsplit(target)
        file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        if not file.exists():
            yield path, f"{target} does not exist"
        elif file in pages and unquote(parts.fragment) not in pages[file].anchors:
            yield path, f"{target} has no such anchor"


def _is_inside(target: str) -> bool:
    parts = urlsplit(target)
    return not parts.scheme and not parts.netloc and not target.startswith("/")


def main(arguments: list[str]) -> int:
    count, broken = broken_links(Path(arguments[0]))
    for line in broken:
        print(line)
    print(f"{count} links within the site, {len(broken)} broken")
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
