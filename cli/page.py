"""The command `sonata2d page`."""

from __future__ import annotations

from pathlib import Path

import click

from .command import Command
from .options import PATH, examples, json_option
from .output import echo, show_result


@click.command(cls=Command, epilog=examples("page DIR", "page DIR --pyodide ./pyodide --wheels ./wheels"))
@click.argument("out", type=PATH, metavar="DIR")
@click.option(
    "--pyodide",
    metavar="URL",
    help="Distribution of Pyodide: an address, or a folder with its files.  [default: version 314.0.7 on jsDelivr]",
)
@click.option("--wheels", type=PATH, help="Folder with wheels for Pyodide that replace those of the distribution.")
@json_option
def command(out: Path, pyodide: str | None, wheels: Path | None) -> None:
    """Write the simulator as a web page that needs no server.

    DIR then holds a page in which anybody drives the robot, or watches a controller, in any preset: Python runs in the
    browser (Pyodide). Any server of files can serve it, such as `python -m http.server`; a page that is opened as a
    file cannot load it. The server of a study uses such a folder, too: `serve --page DIR`.

    Some 20 MB are downloaded once, from jsDelivr and the Python Package Index.
    """
    from sonata2d.web.page_folder import SOURCE, write_page

    size = write_page(out, pyodide or SOURCE, wheels=wheels, advance=lambda name: echo(f"reading {name}", err=True))
    served = f"python -m http.server --directory {out} serves it at http://localhost:8000"
    show_result({"folder": str(out), "bytes": size}, f"{out}: {size / 1e6:.1f} MB; {served}")
