"""`sonata2d export`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sonata2d.registry import FORMATS

from .output import json_option, named_in, progress, show_json

if TYPE_CHECKING:
    from sonata2d.formats.api import Done


@click.command(
    epilog="Examples:  sonata2d export demo --to sonata -o old   ·   sonata2d export demo/000000.json --to socnav3 -o"
    " one.json   ·   sonata2d export demo --to sonata --quirks original -o old"
)
@click.argument("source", type=click.Path(path_type=Path), metavar="DIR|FILE")
@click.option("--to", "format", **named_in(FORMATS), required=True, help="The format; see docs/formats.md.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), required=True, help="A folder; for one episode, a file."
)
@click.option("--quirks", type=click.Choice(["original"]), help="sonata: keep those of the original toolkit.")
@json_option
def command(source: Path, format: str, output: Path, quirks: str | None, as_json: bool) -> None:
    """Write episodes in a format that other programs read; refuse what would mislead them.

    Exit code 1 if an episode was refused.
    """
    from sonata2d.formats.api import episodes_in, export_to
    from sonata2d.formats.base import Options

    with progress(len(episodes_in(source)), "episodes") as advance:
        done = export_to(source, format, output, Options(original=quirks == "original"), advance=advance)
    show_done(done, format, f"{output}: {len(done.files)} {format} files", as_json=as_json)


def show_done(done: Done, format: str, line: str, *, as_json: bool) -> None:
    """Say what was written; what was refused goes to standard error, with exit code 1."""
    if as_json:
        show_json({"format": format, "files": [str(file) for file in done.files], "refused": done.refused})
    else:
        click.echo(line + (f", {len(done.refused)} refused" if done.refused else ""))
        for refused in done.refused:
            click.echo(f"refused: {refused}", err=True)
    if done.refused:
        sys.exit(1)
