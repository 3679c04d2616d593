"""`sonata2d card`."""

from __future__ import annotations

from pathlib import Path

import click

from .output import json_option, progress, show_json


@click.command(epilog="Examples:  sonata2d card demo   ·   sonata2d card demo --no-figures")
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--figures/--no-figures", default=True, show_default=True, help="Draw how the episodes look.")
@json_option
def command(folder: Path, figures: bool, as_json: bool) -> None:
    """Write a data set's card: README.md with figures and Hugging Face front matter, and Croissant metadata."""
    from sonata2d.datacard import FIGURES, write_card
    from sonata2d.record import CROISSANT, read_manifest

    with progress(len(read_manifest(folder)["files"]), "episodes") as advance:
        path = write_card(folder, figures=figures, advance=advance)
    written = {"card": str(path), "metadata": str(folder / CROISSANT)}
    written |= {"figures": str(folder / FIGURES)} if figures else {}
    if as_json:
        show_json(written)
    else:
        click.echo(", ".join(written.values()))
