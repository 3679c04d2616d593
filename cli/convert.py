"""The commands `sonata2d export` and `sonata2d import`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sonata2d.registry import FORMATS

from .command import Command
from .common import PATH, examples, json_option, note, progress, registry_option, show_json

if TYPE_CHECKING:
    from sonata2d.formats.api import TransferResult


@click.command(
    "export",
    cls=Command,
    epilog=examples(
        "export demo --to csv -o tracks",
        "export demo/000000.json --to socnav3 -o one.json",
        "export demo --to sonata --quirks original -o old",
    ),
)
@click.argument("source", type=PATH, metavar="DIR|FILE")
@click.option("--to", "format", **registry_option(FORMATS), required=True, help="Format; see docs/formats.md.")
@click.option("-o", "--output", type=PATH, required=True, help="Folder; for a single episode, a folder or a file.")
@click.option("--quirks", type=click.Choice(["original"]), help="Format sonata: reproduce its original quirks.")
@json_option
def export_command(source: Path, format: str, output: Path, quirks: str | None, as_json: bool) -> None:
    """Export episodes to a format of another program.

    Episodes that readers of the format would misinterpret are refused; the exit code is then 1.
    """
    from sonata2d.formats.api import episodes_in, export_to
    from sonata2d.formats.base import Options

    with progress(len(episodes_in(source)), "episodes") as advance:
        result = export_to(source, format, output, Options(original=quirks == "original"), advance=advance)
    _show_result(result, format, f"{output}: {len(result.files)} {format} files", as_json=as_json)


@click.command(
    "import",
    cls=Command,
    epilog=examples("import old --from sonata -o episodes", "import eth.txt --from csv --frame-time 0.04 -o eth.json"),
)
@click.argument("source", type=PATH, metavar="DIR|FILE")
@click.option("--from", "format", **registry_option(FORMATS), required=True, help="Format; see docs/formats.md.")
@click.option("-o", "--output", type=PATH, required=True, help="Folder; for a single file, a folder or a .json file.")
@click.option(
    "--frame-time",
    type=click.FloatRange(1e-6, 3600.0),
    help="Duration of one frame number in seconds, for track files without times.",
)
@json_option
def import_command(source: Path, format: str, output: Path, frame_time: float | None, as_json: bool) -> None:
    """Import episodes from files of another program.

    Each episode records which data its source lacks. Invalid files are refused; the exit code is then 1.
    """
    from sonata2d.formats.api import count_sources, import_from
    from sonata2d.formats.base import Options

    with progress(count_sources(source, format), "files") as advance:
        result = import_from(source, format, output, Options(frame_time=frame_time), advance=advance)
    _show_result(result, format, f"{output}: {len(result.files)} episodes from {format}", as_json=as_json)


def _show_result(result: TransferResult, format: str, line: str, *, as_json: bool) -> None:
    """Print what was written, and on standard error what was refused; exit with 1 if anything was refused."""
    if as_json:
        show_json({"format": format, "files": [str(file) for file in result.files], "refused": result.refused})
    else:
        note(line + (f", {len(result.refused)} refused" if result.refused else ""))
        for refused in result.refused:
            click.echo(f"refused: {refused}", err=True)
    if result.refused:
        sys.exit(1)
