"""The command `sonata2d bench`."""

from __future__ import annotations

from pathlib import Path

import click

from .command import Command
from .common import PATH, examples, json_option, note, progress, show_json, show_table


@click.command(cls=Command, epilog=examples("bench", "bench --json", "bench --picture bench.png --workers 4"))
@click.option("--workers", type=click.IntRange(1), help="Largest number of processes.  [default: all processors]")
@click.option("--picture", type=PATH, metavar="FILE", help="Draw the figures: .png, .pdf or .svg.")
@json_option
def command(workers: int | None, picture: Path | None, as_json: bool) -> None:
    """Measure this machine: frames beside the bare engine, start-up, memory, processes, and reading.

    Takes about a minute. Compare figures of one run; docs/performance.md says what to expect.
    """
    from sonata2d.testing.benchmark import STEPS, benchmark

    if picture is not None:
        from sonata2d.metrics.plots import check_picture_path

        check_picture_path(picture)
    with progress(STEPS, "parts") as advance:
        found = benchmark(workers=workers, advance=advance)
    if picture is not None:
        found.save(picture)
    if as_json:
        show_json(found.to_json())
        return
    show_table(found.rows())
    if picture is not None:
        note(f"picture  {picture}")
