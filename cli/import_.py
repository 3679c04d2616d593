"""`sonata2d import`."""

from __future__ import annotations

from pathlib import Path

import click

from sonata2d.registry import FORMATS

from .export import show_done
from .output import json_option, named_in, progress


@click.command(
    epilog="Examples:  sonata2d import old --from sonata -o episodes   ·   sonata2d import eth.txt --from csv"
    " --frame-time 0.04 -o eth.json"
)
@click.argument("source", type=click.Path(path_type=Path), metavar="FILE|DIR")
@click.option("--from", "format", **named_in(FORMATS), required=True, help="The format; see docs/formats.md.")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="A folder; of one file, a .json.")
@click.option(
    "--frame-time",
    type=click.FloatRange(1e-6, 3600.0),
    help="Seconds that a frame number stands for, where a file of tracks does not say it.",
)
@json_option
def command(source: Path, format: str, output: Path, frame_time: float | None, as_json: bool) -> None:
    """Make episodes of files in another format; each says what its source lacked.

    Exit code 1 if a file was refused.
    """
    from sonata2d.formats.api import count_sources, import_from
    from sonata2d.formats.base import Options

    with progress(count_sources(source, format), "files") as advance:
        done = import_from(source, format, output, Options(frame_time=frame_time), advance=advance)
    show_done(done, format, f"{output}: {len(done.files)} episodes from {format}", as_json=as_json)
