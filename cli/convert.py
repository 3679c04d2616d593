"""The commands `sonata2d export` and `sonata2d import`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from sonata2d.core.wording import counted
from sonata2d.registry import FORMATS

from .command import Command
from .common import PATH, examples, json_option, note, progress, registry_option, show_json
from .workers import WorkerOptions, workers_options

if TYPE_CHECKING:
    from sonata2d.formats.api import TransferResult
    from sonata2d.formats.format import Options

FLAGS = {"original": "--quirks", "frame_time": "--frame-time", "types": "--as"}  # else -- and the name of the option


def _types(ctx: click.Context, _: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Parse `object=plant`, or `plant` for all types without a value of their own."""
    pairs = [value.rpartition("=") for value in values]
    if bad := [value for value, (_type, _equals, known) in zip(values, pairs, strict=True) if not known.strip()]:
        raise click.BadParameter(f"{bad[0]!r} is not of the form KNOWN or TYPE=KNOWN, such as object=plant")
    return {type.strip() or "*": known.strip() for type, _equals, known in pairs}


@click.command(
    "export",
    cls=Command,
    epilog=examples(
        "export demo --to csv -o tracks",
        "export demo/000000.json --to socnav3 -o one.json",
        "export demo --to sonata --quirks original -o old",
        "export big --to parquet --shard-size 1000 --workers 8 -o tables",
    ),
)
@click.argument("source", type=PATH, metavar="DIR|FILE")
@click.option("--to", "format", **registry_option(FORMATS), required=True, help="Format; see docs/formats.md.")
@click.option("-o", "--output", type=PATH, required=True, help="Folder; for a single episode, a folder or a file.")
@click.option("--quirks", type=click.Choice(["original"]), help="Format sonata: reproduce its original quirks.")
@click.option("--context", metavar="TEXT", help="Format socnav3: context of all runs; '' for none.")
@click.option(
    "--as",
    "types",
    metavar="[TYPE=]KNOWN",
    multiple=True,
    callback=_types,
    help="Format socnav3: write objects of a type, or of all types that it does not list, as another; may be repeated.",
)
@click.option(
    "--shard-size",
    type=click.IntRange(1),
    metavar="N",
    help="Format parquet: N episodes in each file, for large data sets.",
)
@workers_options
@json_option
def export_command(
    source: Path,
    format: str,
    output: Path,
    quirks: str | None,
    context: str | None,
    types: dict[str, str],
    shard_size: int | None,
    workers: WorkerOptions,
    as_json: bool,
) -> None:
    """Export episodes to a format of another program.

    Episodes that the format cannot hold, or that its readers would misinterpret, are skipped, with the reason. The exit
    code is 1 if a file is damaged or cannot be written, or if no episode was exported.
    """
    from sonata2d.formats.api import episodes_in, export_to
    from sonata2d.formats.format import Options

    with workers.started() as pool, progress(len(episodes_in(source)), "episodes") as advance:
        options = Options(original=quirks == "original", context=context, types=types)
        _require_supported(format, options)
        result = export_to(source, format, output, options, shard_size=shard_size, workers=pool, advance=advance)
    _show_result(result, format, f"{output}: {counted(len(result.files), f'{format} file')}", as_json=as_json)


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
@click.option("--renumber", is_flag=True, help="Format socnav3: replace ids that a file uses twice by new ones.")
@click.option(
    "--walls",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="FILE",
    help="Walls of the room, x1,y1,x2,y2 in m, for formats whose files may lack them.",
)
@json_option
def import_command(
    source: Path,
    format: str,
    output: Path,
    frame_time: float | None,
    renumber: bool,
    walls: Path | None,
    as_json: bool,
) -> None:
    """Import episodes from files of another program.

    Each episode records which data its source lacks. Invalid files are refused; the exit code is then 1.
    """
    from sonata2d.formats.api import count_sources, import_from
    from sonata2d.formats.format import Options

    with progress(count_sources(source, format), "files") as advance:
        options = Options(frame_time=frame_time, renumber=renumber, walls=walls)
        _require_supported(format, options)
        result = import_from(source, format, output, options, advance=advance)
    line = f"{output}: {counted(len(result.files), 'episode')} from {format}"
    if output.is_dir():
        line += "; a folder of episodes, not a data set: split, merge and card need a manifest"
    _show_result(result, format, line, as_json=as_json)


def _require_supported(format: str, options: Options) -> None:
    """Refuse the flag of an option that a format does not use."""
    from sonata2d.formats.api import unsupported_options

    if names := unsupported_options(format, options):
        flag = FLAGS.get(names[0], f"--{names[0]}")
        raise click.ClickException(f"the format {format} does not use {flag}; leave it out")


def _show_result(result: TransferResult, format: str, line: str, *, as_json: bool) -> None:
    """Print what was written, and on standard error what was not; exit with 1 unless all that can be written was."""
    from sonata2d.formats.api import summarised

    omitted = {"skipped": result.skipped, "refused": result.refused}
    if as_json:
        reasons = {name: [str(omission) for omission in found] for name, found in omitted.items()}
        show_json({"format": format, "files": [str(file) for file in result.files], **reasons, "notes": result.notes})
    else:
        note(line + "".join(f", {len(found)} {name}" for name, found in omitted.items() if found))
        for name, found in omitted.items():
            for reason in summarised(found):
                click.echo(f"{name}: {reason}", err=True)
        for remark in result.notes:
            note(f"note: {remark}", err=True)
    if result.refused or not result.files:
        raise click.exceptions.Exit(1)
