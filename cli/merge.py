"""The command `sonata2d merge`."""

from __future__ import annotations

from pathlib import Path

import click

from .command import Command
from .options import PATH, examples, json_option
from .output import progress, show_result


@click.command(cls=Command, epilog=examples("merge demo demo-mirrored -o both", "merge a b c -o all --json"))
@click.argument("folders", type=PATH, metavar="DIR...", nargs=-1, required=True)
@click.option("-o", "--output", type=PATH, required=True, help="New folder.")
@json_option
def command(folders: tuple[Path, ...], output: Path) -> None:
    """Merge two or more data sets into a new one.

    Episode files are copied unchanged; the manifest keeps settings and seed of each source.
    """
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.transforms.merge import merge_datasets

    with progress(sum(len(read_manifest(folder)["files"]) for folder in folders), "episodes") as advance:
        manifest = merge_datasets(folders, output, advance=advance)
    sources = [source["name"] for source in manifest["sources"]]
    result = {"output": str(output), "episodes": manifest["episodes"], "sources": sources}
    show_result(result, f"{output}: {manifest['episodes']} episodes of {', '.join(sources)}")
