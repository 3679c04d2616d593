"""`sonata2d merge`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json


@click.command(epilog="Examples:  sonata2d merge demo demo-mirrored -o both   ·   sonata2d merge a b c -o all --json")
@click.argument("folders", type=click.Path(path_type=Path), metavar="DIR DIR…", nargs=-1, required=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="A new folder.")
@json_option
def command(folders: tuple[Path, ...], output: Path, as_json: bool) -> None:
    """Make one data set of several. Every file keeps its bytes, every source its settings and seed."""
    from sonata2d.datasets.manifest import read_manifest
    from sonata2d.datasets.merge import merge_datasets

    with progress(sum(len(read_manifest(folder)["files"]) for folder in folders), "episodes") as advance:
        manifest = merge_datasets(folders, output, advance=advance)
    sources = [source["name"] for source in manifest["sources"]]
    if as_json:
        show_json({"output": str(output), "episodes": manifest["episodes"], "sources": sources})
    else:
        click.echo(f"{output}: {manifest['episodes']} episodes of {', '.join(sources)}")
