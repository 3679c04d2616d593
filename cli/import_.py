"""The command `sonata2d import`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from sonata2d.core.wording import counted
from sonata2d.registry import FORMATS

from .command import Command
from .options import PATH, examples, json_option, registry_option
from .output import progress
from .transfer import require_supported, show_transfer, track_options


@click.command(
    cls=Command,
    epilog=examples(
        "import old --from sonata -o episodes",
        "import eth.txt --from tracks --frame-rate 15 -o eth.json",
        "import people.txt --from tracks --unit cm --columns id,frame,x,y,z --frame-rate 16 -o episodes",
    ),
)
@click.argument("source", type=PATH, metavar="DIR|FILE")
@click.option("--from", "format", **registry_option(FORMATS), required=True, help="Format; see docs/formats.md.")
@click.option("-o", "--output", type=PATH, required=True, help="Folder; for a single file, a folder or a .json file.")
@track_options
@click.option("--renumber", is_flag=True, help="Format socnav3: replace ids that a file uses twice by new ones.")
@json_option
def command(source: Path, format: str, output: Path, **options: Any) -> None:
    """Import episodes from files of another program.

    Each episode records which data its source lacks. Invalid files are refused; the exit code is then 1.
    """
    from sonata2d.formats.api import count_sources, import_from
    from sonata2d.formats.format import Options

    with progress(count_sources(source, format), "files") as advance:
        chosen = Options(**options)  # options have the names of its fields
        require_supported(format, chosen)
        result = import_from(source, format, output, chosen, advance=advance)
    line = f"{output}: {counted(len(result.files), 'episode')} from {format}"
    if output.is_dir():
        line += "; a folder of episodes, not a data set: split, merge and card need a manifest"
    show_transfer(result, format, line)
