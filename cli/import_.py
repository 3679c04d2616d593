"""The command `sonata2d import`."""

from __future__ import annotations

from pathlib import Path

import click

from sonata2d.core.wording import counted
from sonata2d.registry import FORMATS

from .command import Command
from .options import PATH, examples, json_option, registry_option
from .output import progress
from .transfer import require_supported, show_transfer


@click.command(
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
@click.option("--renumber", is_flag=True, help="Format socnav3: replace ids that a file uses twice by new ones.")
@click.option(
    "--walls",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="FILE",
    help="Walls of the room, x1,y1,x2,y2 in m, for formats whose files may lack them.",
)
@json_option
def command(
    source: Path, format: str, output: Path, frame_time: float | None, renumber: bool, walls: Path | None
) -> None:
    """Import episodes from files of another program.

    Each episode records which data its source lacks. Invalid files are refused; the exit code is then 1.
    """
    from sonata2d.formats.api import count_sources, import_from
    from sonata2d.formats.format import Options

    with progress(count_sources(source, format), "files") as advance:
        options = Options(frame_time=frame_time, renumber=renumber, walls=walls)
        require_supported(format, options)
        result = import_from(source, format, output, options, advance=advance)
    line = f"{output}: {counted(len(result.files), 'episode')} from {format}"
    if output.is_dir():
        line += "; a folder of episodes, not a data set: split, merge and card need a manifest"
    show_transfer(result, format, line)
