"""`sonata2d check`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from .output import json_option, progress, show_json

SHOWN = 20  # problems, unless JSON is asked for


@click.command(epilog="Examples:  sonata2d check demo   ·   sonata2d check demo --replay --workers 2")
@click.argument("path", type=click.Path(path_type=Path), metavar="DIR|FILE")
@click.option("--replay", is_flag=True, help="Run the recorded commands again and compare every byte.")
@click.option("--rerun", is_flag=True, help="Run the controller again and compare every byte.")
@click.option("--controller", metavar="NAME", help="For --rerun, if it is no longer found by the name in the files.")
@click.option(
    "--workers", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), show_default=True, help="Processes."
)
@json_option
def command(path: Path, replay: bool, rerun: bool, controller: str | None, workers: int, as_json: bool) -> None:
    """Prove a data set or an episode: schema, hashes, finite numbers, ids, physical sense; and, if asked, replay.

    Exit code 1 if anything is wrong.
    """
    from sonata2d.datasets.verification import files_of, verify

    files = files_of(path)
    with progress(len(files), "files") as advance:
        problems = verify(
            path, replay=replay, rerun=rerun or controller is not None, controller=controller, workers=workers,
            advance=advance,
        )  # fmt: skip
    if as_json:
        rows = [{"file": p.file, "place": p.place, "message": p.message} for p in problems]
        show_json({"files": len(files), "problems": rows})
    else:
        for problem in problems[:SHOWN]:
            click.echo(f"{problem.file}: {problem.place}: {problem.message}")
        if len(problems) > SHOWN:
            click.echo(f"… and {len(problems) - SHOWN} more; --json shows all")
        done = "".join([", replayed" if replay else "", ", rerun" if rerun else ""])
        click.echo(f"{path}: {len(files)} files checked{done}, {len(problems) or 'no'} problems")
    if problems:
        sys.exit(1)
