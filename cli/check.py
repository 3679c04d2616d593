"""The command `sonata2d check`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sonata2d.core.wording import counted

from .command import Command
from .options import PATH, examples, json_option
from .output import echo, progress, show_json, wants_json
from .workers import WorkerOptions, workers_options

if TYPE_CHECKING:
    from sonata2d.datasets import Problem

_MAX_PROBLEMS = 20  # problems printed without --json


@click.command(cls=Command, epilog=examples("check demo", "check demo --replay --workers 2", "check demo/000000.json"))
@click.argument("path", type=PATH, metavar="DIR|FILE")
@click.option("--replay", is_flag=True, help="Also run the recorded commands again and compare every byte.")
@click.option("--rerun", is_flag=True, help="Also run the controller again and compare every byte.")
@click.option("--controller", metavar="NAME", help="Controller for --rerun, if not built in or renamed.")
@workers_options
@json_option
def command(path: Path, replay: bool, rerun: bool, controller: str | None, workers: WorkerOptions) -> None:
    """Verify a data set or an episode file.

    Checks the schema, hashes, finite numbers, ids and physical plausibility, and that scenario.json, data card and
    Croissant metadata agree with the manifest; with --replay and --rerun also that the simulation reproduces the
    episodes. The exit code is 1 if there is a problem, and 0 if there are only warnings, such as unknown keys.
    """
    from sonata2d.datasets.check.verification import verify
    from sonata2d.datasets.manifest import files_of

    files = files_of(path)
    with workers.started() as pool, progress(len(files), "files") as advance:
        problems = verify(
            path, replay=replay, rerun=rerun or controller is not None, controller=controller, workers=pool,
            advance=advance,
        )  # fmt: skip
    if wants_json():
        show_json({"files": len(files), "problems": problems})
    else:
        lines = _grouped(problems)
        for line in lines[:_MAX_PROBLEMS]:
            click.echo(line)
        if len(lines) > _MAX_PROBLEMS:
            click.echo(f"... and {len(lines) - _MAX_PROBLEMS} more; --json prints all")
        refused = len({problem.file for problem in problems if problem.place == "physics"})
        how_many = f"{len(files) - refused} of them " if refused else ""
        done = "".join([f", {how_many}replayed" if replay else "", f", {how_many}rerun" if rerun else ""])
        count = sum(not problem.is_warning for problem in problems)
        warnings = f", {counted(len(problems) - count, 'warning')}" if len(problems) > count else ""
        result = counted(count, "problem") if count else "no problems"
        echo(f"{path}: {counted(len(files), 'file')} checked{done}, {result}{warnings}")
    if any(not problem.is_warning for problem in problems):
        raise click.exceptions.Exit(1)


def _grouped(problems: Iterable[Problem]) -> list[str]:
    """One line per problem; a problem that several files have is one line, which names the first of them."""
    files: dict[Problem, list[str]] = {}
    for problem in problems:
        files.setdefault(replace(problem, file=""), []).append(problem.file)
    return [
        str(replace(problem, file=first + (f" and {counted(len(others), 'other file')}" if others else "")))
        for problem, (first, *others) in files.items()
    ]
