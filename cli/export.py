"""The command `sonata2d export`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from sonata2d.core.wording import counted
from sonata2d.registry import FORMATS

from .command import Command
from .options import PATH, examples, json_option, registry_option
from .output import progress
from .transfer import require_supported, show_transfer
from .workers import WorkerOptions, workers_options


def _types(ctx: click.Context, _: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Parse `object=plant`, or `plant` for all types without a value of their own."""
    pairs = [value.rpartition("=") for value in values]
    if bad := [value for value, (_type, _equals, known) in zip(values, pairs, strict=True) if not known.strip()]:
        raise click.BadParameter(f"{bad[0]!r} is not of the form KNOWN or TYPE=KNOWN, such as object=plant")
    return {type.strip() or "*": known.strip() for type, _equals, known in pairs}


@click.command(
    cls=Command,
    epilog=examples(
        "export demo --to csv -o tracks",
        "export demo/000000.json --to socnav3 -o one.json",
        "export demo --to sonata --quirks original -o old",
        "export demo --to chat --questions 10 --pictures -o chat",
        "export demo --to mcap -o logs",
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
    "--robot",
    type=click.IntRange(0),
    default=0,
    metavar="N",
    show_default=True,
    help="Formats that describe one robot: the number of the one to export; 0 is the first.",
)
@click.option(
    "--robots-as",
    type=click.Choice(["people", "objects"]),
    default="people",
    show_default=True,
    help="Formats that describe one robot: what the other robots are.",
)
@click.option(
    "--shard-size",
    type=click.IntRange(1),
    metavar="N",
    help="Formats parquet, webdataset: N episodes in each file, for large data sets.",
)
@click.option("--part", metavar="NAME", help="Only this part of a data set that is split.")
@click.option(
    "--questions", type=click.IntRange(1), metavar="N", help="Format chat: lines of each episode.  [default: 20]"
)
@click.option("--pictures", is_flag=True, help="Format chat: a picture with each question; lerobot: a film.")
@workers_options
@json_option
def command(
    source: Path,
    format: str,
    output: Path,
    quirks: str | None,
    context: str | None,
    types: dict[str, str],
    robot: int,
    robots_as: Literal["people", "objects"],
    shard_size: int | None,
    part: str | None,
    questions: int | None,
    pictures: bool,
    workers: WorkerOptions,
) -> None:
    """Export episodes to a format of another program.

    Episodes that the format cannot hold, or that its readers would misinterpret, are skipped, with the reason. The exit
    code is 1 if a file is damaged or cannot be written, or if no episode was exported.
    """
    from sonata2d.datasets.dataset import Dataset
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.manifest.read import has_manifest
    from sonata2d.formats.api import episodes_in, export_to
    from sonata2d.formats.format import Options

    chosen: Path | Dataset = source
    if part is not None:
        parts = Dataset(source).parts
        if part not in parts:
            raise click.UsageError(f"{source} has no part {part!r}; it has {', '.join(parts)}")
        chosen = parts[part]
    count = len(chosen) if isinstance(chosen, Dataset) else len(episodes_in(source))
    with workers.started() as pool, progress(count, "episodes") as advance:
        options = Options(
            original=quirks == "original", context=context, types=types, robot=robot, robots_as=robots_as,
            questions=questions, pictures=pictures,
        )  # fmt: skip
        require_supported(format, options)
        result = export_to(chosen, format, output, options, shard_size=shard_size, workers=pool, advance=advance)
    if part is None and has_manifest(source) and (split := read_manifest(source)["split"]):
        result.notes.append(f"all parts of the split are in the export, {', '.join(split)}; --part NAME exports one")
    show_transfer(result, format, f"{output}: {counted(len(result.files), f'{format} file')}")
