"""Adds a built version of the documentation to the published ones: `python docs/publish.py HTML PAGES VERSION`.

PAGES is the folder of the whole site: a folder for each version, `versions.json` for the menu of versions, and a page
that leads to the newest release, or to `dev` as long as there is none.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

DEVELOPMENT = "dev"


def publish(built: Path, pages: Path, version: str) -> None:
    """Copy a built version, and list all versions, the newest first."""
    shutil.rmtree(pages / version, ignore_errors=True)
    shutil.copytree(built, pages / version)
    versions = sorted((path.parent.name for path in pages.glob("*/index.html")), key=_order, reverse=True)
    releases = [one for one in versions if one != DEVELOPMENT]
    newest = releases[0] if releases else DEVELOPMENT
    names = {newest: f"{newest} (stable)"} if releases else {}
    menu = [{"name": names.get(one, one), "version": one, "url": f"../{one}/"} for one in versions]
    (pages / "versions.json").write_text(json.dumps(menu, indent=2) + "\n", encoding="utf-8")
    (pages / ".nojekyll").touch()  # files whose names begin with an underscore are published too
    redirect = f'<!DOCTYPE html><meta http-equiv="refresh" content="0; url={newest}/"><title>sonata2d</title>\n'
    (pages / "index.html").write_text(redirect, encoding="utf-8")


def _order(version: str) -> tuple[bool, list[int]]:
    """The development version first, then releases by number."""
    return version == DEVELOPMENT, [int(part) for part in version.split(".") if part.isdecimal()]


if __name__ == "__main__":
    publish(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
