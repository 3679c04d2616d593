"""Adds a built version of the documentation to the published ones: `python docs/publish.py HTML PAGES VERSION BASE`.

PAGES is the folder of the whole site: a folder for each version, `versions.json` for the menu of versions, and a page
that leads to the newest release, or to `dev` as long as there is none. BASE is the path of the site, `/sonata2d/`.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from packaging.version import Version

DEVELOPMENT = "dev"


def publish(built: Path, pages: Path, version: str, base: str) -> None:
    """Copy a built version, and list all versions, the newest first."""
    shutil.rmtree(pages / version, ignore_errors=True)
    shutil.copytree(built, pages / version)
    folders = [path.parent.name for path in pages.glob("*/index.html") if path.parent.name != DEVELOPMENT]
    releases = sorted(folders, key=Version, reverse=True)
    newest = next((one for one in releases if not Version(one).is_prerelease), DEVELOPMENT)
    versions = [DEVELOPMENT] * (pages / DEVELOPMENT).is_dir() + releases
    menu = [
        # the theme appends the name of the page; an address relative to it would depend on its folder
        {"name": f"{one} (stable)" if one == newest != DEVELOPMENT else one, "version": one, "url": f"{base}{one}/"}
        for one in versions
    ]
    (pages / "versions.json").write_text(json.dumps(menu, indent=2) + "\n", encoding="utf-8")
    (pages / ".nojekyll").touch()  # files whose names begin with an underscore are published too
    redirect = f'<!DOCTYPE html><meta http-equiv="refresh" content="0; url={base}{newest}/"><title>sonata2d</title>\n'
    (pages / "index.html").write_text(redirect, encoding="utf-8")


if __name__ == "__main__":
    publish(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4])
